"""The outline of a file: definitions and scene blocks.

Example: ``Selection Tree(n) { … }`` is the symbol ``Tree(n)`` of kind Class, ``camera { … }`` is ``camera``, an Object.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from plsys.compiler.analysis import Block, Outline, syntax
from plsys.lsp.request import Feature, Request

# SymbolKind of the protocol: what each kind of definition is shown as.
SYMBOL_KINDS = {
    "selection": 5,  # Class
    "calculation": 12,  # Function
    "transformation": 25,  # Operator
    "texture": 23,  # Struct
    "pigment": 23,
    "finish": 23,
    "color_map": 18,  # Array
    "object": 19,  # Object
    "value": 14,  # Constant
    "input": 7,  # Property
    "parameter": 13,  # Variable
    "block": 19,
}

DETAILS = {"input": "Parameter", "value": "constant"}


class _Symbol(NamedTuple):
    """``lines`` and ``characters`` are those of start, end, name's start and name's end; lines count from the block's."""

    name: str
    detail: str
    kind: int
    lines: tuple[int, ...]
    characters: tuple[int, ...]


def document_symbols(request: Request) -> list[dict[str, Any]]:
    text = request.document.text
    found = []
    for index, (block, base) in enumerate(zip(text.blocks, text.first_lines)):
        for each in _symbols(request, index, block):
            start, end, first, last = (
                {"line": base + line, "character": character} for line, character in zip(each.lines, each.characters)
            )
            found.append({
                "name": each.name, "detail": each.detail, "kind": each.kind,
                "range": {"start": start, "end": end}, "selectionRange": {"start": first, "end": last},
            })  # fmt: skip
    return found


def _symbols(request: Request, index: int, block: Block) -> list[_Symbol]:
    """The block's symbols, kept with it."""
    kept = block.__dict__.get("symbols")
    if kept is None or kept[0] != request.workspace.encoding:
        base = request.document.text.first_lines[index]
        kept = block.__dict__["symbols"] = request.workspace.encoding, [
            _symbol(request, each, base) for each in request.document.outline(index, index + 1)
        ]
    return kept[1]


def _symbol(request: Request, each: Outline, base: int) -> _Symbol:
    places = [request.positions.position(at) for at in (each.start, each.end, each.name_start, each.name_end)]
    detail = DETAILS.get(each.kind, "" if each.kind == "block" else each.kind)
    lines, characters = zip(*((place["line"] - base, place["character"]) for place in places))
    return _Symbol(symbol_name(each), detail, SYMBOL_KINDS[each.kind], lines, characters)


def symbol_name(outline: Outline) -> str:
    """``Branch(length, width)`` for a Selection with parameters, the name for others."""
    if isinstance(outline.node, syntax.Selection) and outline.node.parameters:
        return f"{outline.name}({', '.join(each.name for each in outline.node.parameters)})"
    return outline.name or "(unnamed)"


FEATURES = (Feature("textDocument/documentSymbol", document_symbols, "documentSymbolProvider"),)
