"""Links: the files of ``#include`` and ``mesh("…")``.

Example: in ``#include "lib.plsys"`` the quoted name is a link to the file beside this one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Iterator

from plsys.compiler.analysis import Document, facts_of
from plsys.lsp.request import Feature, Request


def document_links(request: Request) -> list[dict[str, Any]]:
    document = request.document
    found = [(place.start, place.end, path) for place, path in document.included_paths()]
    found += meshes(document)
    return [
        {
            "range": request.range(start + 1, end - 1),
            "target": request.workspace.uri_of(path),
            "tooltip": "Open the file",
        }
        for start, end, path in sorted(found)
        if end - start > 2 and path.is_file()
    ]


def meshes(document: Document) -> Iterator[tuple[int, int, Path]]:
    """The quoted names of mesh files, and their paths."""
    folder = document.path.parent if document.path is not None else Path()
    for block, base in zip(document.text.blocks, document.text.starts):
        if b"mesh" not in block.data:
            continue
        for node in calls(facts_of(block).tree.root_node):
            for argument in node.children_by_field_name("argument"):
                if argument.type == "string":
                    start, end = base + argument.start_byte, base + argument.end_byte
                    written = document.text.slice(start + 1, end - 1).decode(errors="replace")
                    if "\0" not in written:
                        yield start, end, folder / written


def calls(node: Any) -> Iterator[Any]:
    """The calls of ``mesh`` below ``node``."""
    if node.type == "call":
        name = node.child_by_field_name("name")
        if name is not None and name.text == b"mesh":
            yield node
    for child in node.children:
        yield from calls(child)


FEATURES = (Feature("textDocument/documentLink", document_links, "documentLinkProvider", {"resolveProvider": False}),)
