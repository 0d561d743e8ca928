"""Symbols of all files that are known: the open ones, those that they include, and the other scenes of the folders.

Example: the query `tb` finds `T_branch` and `TallBush`: its letters stand in the name in this order. Best matches first.
"""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Any, Iterator, NamedTuple
from urllib.parse import unquote, urlsplit

from plsys.compiler.analysis import Place
from plsys.lsp.features.document_symbols import SYMBOL_KINDS
from plsys.lsp.request import Feature, Request
from plsys.lsp.text import units

# A longer list helps nobody.
MAX_SYMBOLS = 500


class _Hit(NamedTuple):
    """``where`` is a Place, or the path and the Symbol of a file that isn't open."""

    rank: int
    length: int
    name: str
    kind: str
    where: Any


def workspace_symbols(request: Request) -> list[dict[str, Any]]:
    query = request.params.get("query", "").lower()
    hits = sorted((each for each in _hits(request, query)), key=lambda hit: hit[:3])
    return [_symbol(request, hit) for hit in hits[:MAX_SYMBOLS]]


def _hits(request: Request, query: str) -> Iterator[_Hit]:
    known = request.workspace.project.documents
    for document in known.values():
        for each in document.outline():
            rank = _rank(query, each.name)
            if rank is not None and each.kind != "block":
                yield _Hit(rank, len(each.name), each.name, each.kind, Place(document, each.name_start, each.name_end))
    for path, entry in request.workspace.scans.entries.items():
        if path not in known:
            for symbol in entry.symbols:
                rank = _rank(query, symbol.name)
                if rank is not None:
                    yield _Hit(rank, len(symbol.name), symbol.name, symbol.kind, (path, symbol))


def _rank(query: str, name: str) -> int | None:
    """How well the name fits, 0 best: it starts with the query, holds it, or has its letters in order; None: none of these."""
    lower = name.lower()
    if lower.startswith(query):
        return 0
    if query in lower:
        return 1
    letters = iter(lower)
    return 2 if all(letter in letters for letter in query) else None


def _symbol(request: Request, hit: _Hit) -> dict[str, Any]:
    if isinstance(hit.where, Place):
        location = request.workspace.location(hit.where)
    else:
        path, symbol = hit.where
        start = units(symbol.before, request.workspace.encoding)
        line, ends = symbol.line, (start, start + len(hit.name))  # a name is ASCII
        start, end = ({"line": line, "character": character} for character in ends)
        location = {"uri": request.workspace.uri_of(path), "range": {"start": start, "end": end}}
    file = PurePosixPath(unquote(urlsplit(location["uri"]).path)).name
    return {"name": hit.name, "kind": SYMBOL_KINDS[hit.kind], "location": location, "containerName": file}


FEATURES = (Feature("workspace/symbol", workspace_symbols, "workspaceSymbolProvider"),)
