"""The outline of a file: definitions and scene blocks.

Example: ``Selection Tree(n) { … }`` is the symbol ``Tree(n)`` of kind Class, ``camera { … }`` is ``camera``, an Object.
"""

from __future__ import annotations

from typing import Any

from plsys.compiler.analysis import Outline, syntax
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


def document_symbols(request: Request) -> list[dict[str, Any]]:
    return [
        {
            "name": symbol_name(each),
            "detail": DETAILS.get(each.kind, "" if each.kind == "block" else each.kind),
            "kind": SYMBOL_KINDS[each.kind],
            "range": request.range(each.start, each.end),
            "selectionRange": request.range(each.name_start, each.name_end),
        }
        for each in request.document.outline()
    ]


def symbol_name(outline: Outline) -> str:
    """``Branch(length, width)`` for a Selection with parameters, the name for others."""
    if isinstance(outline.node, syntax.Selection) and outline.node.parameters:
        return f"{outline.name}({', '.join(each.name for each in outline.node.parameters)})"
    return outline.name or "(unnamed)"


FEATURES = (Feature("textDocument/documentSymbol", document_symbols, "documentSymbolProvider"),)
