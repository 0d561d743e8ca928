"""Formatting: of a document, of a range, and while typing.

Example: ``Calculation C{n=1;}`` is answered by four insertions of a space. What has syntax errors stays as it is; a line
that is typed in it is indented by the brackets before it.
"""

from __future__ import annotations

import re
from typing import Any

from plsys.compiler.analysis import facts_of, format_document
from plsys.lsp.request import Feature, Request

INDENT = 4

_TOKEN = re.compile(rb'//[^\r\n]*|/\*.*?(?:\*/|\Z)|"(?:[^"\\\r\n]|\\.)*"?|[{}()\[\]]|[\r\n][ \t]*', re.DOTALL)


def formatting(request: Request) -> list[dict[str, Any]]:
    """Edits of the document, or of the lines of ``params.range``."""
    start, end = request.offsets
    return [_edit(request, *edit) for edit in format_document(request.document, start, end).edits]


def on_type(request: Request) -> list[dict[str, Any]]:
    """After `}` or `;`: the lines of the statement that it ends. After a line break: the indentation of the new line."""
    text, offset = request.document.text, request.offset
    if request.params.get("ch") == "\n":
        return _indented(request, offset)
    block, base = text.block_at(max(0, offset - 1))
    if facts_of(block).is_broken:
        return _indented(request, offset) if request.params.get("ch") == "}" else []
    start = _unit_start(request, offset - 1)
    edits = format_document(request.document, start, offset).edits
    return [_edit(request, *edit) for edit in edits if base <= edit.start and edit.end <= offset]


def _edit(request: Request, start: int, end: int, data: bytes) -> dict[str, Any]:
    return {"range": request.range(start, end), "newText": data.decode()}


def _unit_start(request: Request, offset: int) -> int:
    """Where the statement, rule or body starts that the token at ``offset`` ends."""
    node, base = request.document.node_at(max(0, offset))
    parent = node.parent or node
    if parent.type.endswith("body") and parent.parent is not None:
        parent = parent.parent
    return base + parent.start_byte


def _indented(request: Request, offset: int) -> list[dict[str, Any]]:
    """The edit that indents the cursor's line by the brackets that are open before it."""
    text = request.document.text
    line_start = text.line_start(text.line_of(offset))
    line = text.line_bytes(text.line_of(offset))
    blanks = len(line) - len(line.lstrip(b" \t"))
    _, base = text.block_at(max(0, line_start - 1))
    open_brackets: list[int] = []  # the indentation of the line of each
    indent = 0
    for match in _TOKEN.finditer(text.slice(base, line_start)):
        token = match[0]
        if token[:1] in b"\r\n":
            indent = len(token) - 1
        elif token in (b"{", b"(", b"["):
            open_brackets.append(indent)
        elif token in (b"}", b")", b"]") and open_brackets:
            open_brackets.pop()
    wanted = open_brackets[-1] + INDENT if open_brackets else 0
    if line[blanks : blanks + 1] in (b"}", b")", b"]") and open_brackets:
        wanted = open_brackets[-1]
    if not open_brackets and request.params.get("ch") == "\n":
        return []
    if line[:blanks] == b" " * wanted:
        return []
    return [_edit(request, line_start, line_start + blanks, b" " * wanted)]


FEATURES = (
    Feature("textDocument/formatting", formatting, "documentFormattingProvider"),
    Feature("textDocument/rangeFormatting", formatting, "documentRangeFormattingProvider"),
    Feature(
        "textDocument/onTypeFormatting",
        on_type,
        "documentOnTypeFormattingProvider",
        {"firstTriggerCharacter": "}", "moreTriggerCharacter": [";", "\n"]},
    ),
)
