"""Hover: what the name, word or guard under the cursor means.

Example: on ``roty`` the vocabulary's row, on ``T_left`` its matrix and a sentence, on ``Tree`` its forecast, on ``if`` how
often the guard holds.
"""

from __future__ import annotations

from typing import Any

from plsys.compiler.analysis import GuardInsight, context_at, insights_in, vocabulary
from plsys.lsp import describe, palette, prose
from plsys.lsp.request import Feature, Request

WORDS = frozenset(b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_")
# How far behind `if` its guard is looked for.
GUARD_REACH = 12


def hover(request: Request) -> dict[str, Any] | None:
    found = request.document.name_at(request.offset)
    if found is not None:
        name, place = found
        text = describe.describe(request.scene, name)
        if text is None and place.role in ("definition", "write"):
            return None
        if text is not None:
            return answer(request, text, place.start, place.end)
    start, end = word_at(request)
    word = request.document.text.slice(start, end).decode(errors="replace")
    text = describe_word(request, word, start)
    if word in palette.FORMS and text:
        text = f"{swatch_at(request, start)}{text}"
    return answer(request, text, start, end) if text else None


def answer(request: Request, text: str, start: int, end: int) -> dict[str, Any]:
    formats = request.supports("textDocument", "hover", "contentFormat")
    kind = "markdown" if not formats or "markdown" in formats else "plaintext"
    return {"contents": {"kind": kind, "value": text}, "range": request.range(start, end)}


def word_at(request: Request) -> tuple[int, int]:
    """The word round the cursor, with a directive's ``#``."""
    text = request.document.text
    line = text.line_of(request.offset)
    base, data = text.line_start(line), text.line_bytes(line)
    start = end = min(request.offset - base, len(data))
    while start > 0 and data[start - 1] in WORDS:
        start -= 1
    while end < len(data) and data[end] in WORDS:
        end += 1
    if start > 0 and data[start - 1 : start] == b"#":
        start -= 1
    return base + start, base + end


def describe_word(request: Request, word: str, start: int) -> str | None:
    """A word of the language: of the block that it stands in first."""
    if not word or word[0].isdigit():
        return None
    context = context_at(request.document, start)
    if context.kind in ("comment", "string", "include"):
        return None
    row = row_of(word, context.blocks)
    if row is None:
        return None
    text = prose.documentation(row)
    if word == "if":
        shown = insights_in(request.scene, request.document, start, start + GUARD_REACH)
        found = next((each for each in shown if isinstance(each.insight, GuardInsight) and each.start > start), None)
        if found is not None:
            text = f"{describe.guard(found.insight)}\n\n{text}"
    return text


def swatch_at(request: Request, start: int) -> str:
    """The swatch of the constant colour that begins at ``start``, if one does."""
    block, base = request.document.text.block_at(start)
    for first, _, parts in palette.colours_of(request.scene, block):
        if base + first == start:
            return describe.swatch(parts) + "\n\n"
    return ""


def row_of(word: str, blocks: tuple[str, ...]) -> vocabulary.Row | None:
    """The vocabulary's row for ``word`` in the innermost of ``blocks``."""
    tables = [vocabulary.PROPERTIES.get(blocks[-1], {})] if blocks else []
    tables += [vocabulary.MODIFIERS, vocabulary.BLOCKS, vocabulary.COLOUR_WORDS, vocabulary.AXES] if blocks else []
    tables += [vocabulary.KEYWORDS, vocabulary.OPERATIONS, vocabulary.BLOCKS, vocabulary.PRIMITIVES]
    tables += [vocabulary.FUNCTIONS, vocabulary.CONSTANTS, vocabulary.DIRECTIVES]
    return next((table[word.lstrip("#")] for table in tables if word.lstrip("#") in table), None)


FEATURES = (Feature("textDocument/hover", hover, "hoverProvider"),)
