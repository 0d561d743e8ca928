"""Symbols of all files that are known: the open ones and those that they include.

Example: the query `tb` finds `T_branch` and `TallBush`: its letters stand in the name in this order. Best matches first.
"""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Any
from urllib.parse import unquote, urlsplit

from plsys.compiler.analysis import Place
from plsys.lsp.features.document_symbols import SYMBOL_KINDS
from plsys.lsp.request import Feature, Request

# A longer list helps nobody.
MAX_SYMBOLS = 500


def workspace_symbols(request: Request) -> list[dict[str, Any]]:
    query = request.params.get("query", "").lower()
    found = []
    for document in request.workspace.project.documents.values():
        for each in document.outline():
            rank = _rank(query, each.name)
            if rank is not None and each.kind != "block":
                found.append((rank, len(each.name), each.name, each.kind, Place(document, each.name_start, each.name_end)))
    found.sort(key=lambda row: row[:3])
    return [_symbol(request, name, kind, place) for _, _, name, kind, place in found[:MAX_SYMBOLS]]


def _rank(query: str, name: str) -> int | None:
    """How well the name fits, 0 best: it starts with the query, holds it, or has its letters in order; None: none of these."""
    lower = name.lower()
    if lower.startswith(query):
        return 0
    if query in lower:
        return 1
    letters = iter(lower)
    return 2 if all(letter in letters for letter in query) else None


def _symbol(request: Request, name: str, kind: str, place: Place) -> dict[str, Any]:
    location = request.workspace.location(place)
    file = PurePosixPath(unquote(urlsplit(location["uri"]).path)).name
    return {"name": name, "kind": SYMBOL_KINDS[kind], "location": location, "containerName": file}


FEATURES = (Feature("workspace/symbol", workspace_symbols, "workspaceSymbolProvider"),)
