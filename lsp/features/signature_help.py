"""Signature help: the arguments of the function, operation, primitive or symbol round the cursor.

Example: in ``clamp(x, |`` the signature is ``clamp(x, low, high)`` with ``low`` active; in ``trans 0 |`` it is
``trans x y z`` with ``y``.
"""

from __future__ import annotations

import re
from typing import Any

from plsys.compiler.analysis import Context, Scene, context_at, syntax, vocabulary
from plsys.lsp import prose
from plsys.lsp.request import Feature, Request

# What stands in the innermost block so far; vectors, also half-typed; and calls and constants in values.
_OPENED = re.compile(rb"\{([^{}]*)$")
_VECTOR = re.compile(rb"<[^<>]*>?")
_CALLS = re.compile(rb"\b[A-Za-z_]\w*\s*(?=\()|\b(?:[xyz]|pi)\b")
_LETTER = re.compile(rb"[A-Za-z_]\w*\s+[^\s,*/+-]")
_WORD = re.compile(r"[A-Za-z_]\w*")


def signature_help(request: Request) -> dict[str, Any] | None:
    context = context_at(request.document, request.offset)
    if context.kind == "call":
        rows = vocabulary.FUNCTIONS.get(context.function) or vocabulary.PRIMITIVES.get(context.function)
        if rows is None:
            return symbol_signature(request.scene, context)
        return answer([signature(rows, rows.signature)], 0, context.argument)
    if context.kind == "arguments" and context.function in vocabulary.OPERATIONS:
        row = vocabulary.OPERATIONS[context.function]
        forms = row.signature.split("   or   ")
        return operation_signature(row, forms, context.argument)
    if context.kind == "block" and context.blocks:
        return block_signature(request, context.blocks[-1])
    return None


def block_signature(request: Request, name: str) -> dict[str, Any] | None:
    """The values that a shape's block begins with: ``sphere { centre, radius ... }``."""
    row = vocabulary.BLOCKS.get(name)
    if row is None or not row.types:
        return None
    block, base = request.document.text.block_at(max(0, request.offset - 1))
    match = _OPENED.search(block.data[: request.offset - base])
    if match is None or _LETTER.search(_CALLS.sub(b"", match[1])):
        return None  # a property or a modifier has begun
    commas = _VECTOR.sub(b"", match[1]).count(b",")
    found = signature(row, row.signature)
    found["parameters"] = found["parameters"][: len(row.types)]
    return answer([found], 0, commas) if commas < len(row.types) else None


def operation_signature(row: vocabulary.Row, forms: list[str], argument: int) -> dict[str, Any]:
    """The first form that has the argument (``scale s`` until a second factor is begun)."""
    signatures = [signature(row, form) for form in forms]
    active = next((i for i, each in enumerate(signatures) if argument < len(each["parameters"])), len(forms) - 1)
    return answer(signatures, active, argument)


def signature(row: vocabulary.Row, form: str) -> dict[str, Any]:
    """One form of a row with the places of its arguments' names."""
    name = _WORD.match(form)
    first = name.end() if name else 0
    spans = [match.span() for match in re.finditer(r"[A-Za-z_]\w*|\.\.\.|\"[^\"]*\"", form[first:])]
    parameters = [{"label": [first + start, first + end]} for start, end in spans]
    facts = prose.facts(row)
    text = f"{row.doc}\n\n{facts}" if facts else row.doc
    return {"label": form, "documentation": {"kind": "markdown", "value": text}, "parameters": parameters}


def symbol_signature(scene: Scene, context: Context) -> dict[str, Any] | None:
    """``Branch(length, width)`` of a Selection with parameters."""
    meaning = scene.meaning(context.function)
    if meaning is None or not isinstance(meaning.node, syntax.Selection):
        return None
    names = [name.name for name in meaning.node.parameters]
    label, spans = f"{context.function}(", []
    for i, name in enumerate(names):
        label += ", " if i else ""
        spans.append({"label": [len(label), len(label) + len(name)]})
        label += name
    text = "The symbol's parameters are assigned in its own scope, then its entry action runs."
    found = {"label": label + ")", "documentation": {"kind": "markdown", "value": text}, "parameters": spans}
    return answer([found], 0, context.argument)


def answer(signatures: list[dict[str, Any]], active: int, argument: int) -> dict[str, Any]:
    """Arguments after the last one with a name belong to ``...``."""
    count = len(signatures[active]["parameters"])
    if signatures[active]["label"].find("...") >= 0:
        argument = min(argument, count - 1)
    return {"signatures": signatures, "activeSignature": active, "activeParameter": argument}


FEATURES = (
    Feature(
        "textDocument/signatureHelp",
        signature_help,
        "signatureHelpProvider",
        {"triggerCharacters": ["(", ",", " "], "retriggerCharacters": [")"]},
    ),
)
