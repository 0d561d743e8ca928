"""Completion: what can stand at the cursor, and nothing else.

The context (compiler/analysis/context.py) tells the construct from the tokens before the cursor, so that half-typed texts
complete as well. Lists are short: names that don't fit what is typed are left out, and documentation is worked out when the
editor asks for it.

Example: in ``Selection Tree { Tree -> T_|`` the items are Transformations, first those whose names begin with ``T_``.
"""

from __future__ import annotations

from typing import Any

from plsys.compiler.analysis import context_at
from plsys.lsp import candidates, describe, prose
from plsys.lsp.candidates import Candidate, detailed
from plsys.lsp.place import fit
from plsys.lsp.request import Feature, Request

# More items than this slow down editor and reader; the list then says that it is incomplete.
MAX_ITEMS = 200

# CompletionItemKind of the protocol.
KINDS = {
    "selection": 7,  # Class
    "calculation": 3,  # Function
    "transformation": 24,  # Operator
    "texture": 22,  # Struct
    "pigment": 22,
    "finish": 22,
    "color_map": 22,
    "object": 6,  # Variable
    "value": 21,  # Constant
    "input": 10,  # Property
    "parameter": 6,
    "function": 3,
    "constant": 21,
    "axis": 21,
    "primitive": 20,  # EnumMember
    "operation": 2,  # Method
    "block": 9,  # Module
    "modifier": 10,
    "property": 10,
    "colour": 16,  # Color
    "colourword": 16,
    "keyword": 14,
    "directive": 14,
    "snippet": 15,
    "file": 17,
    "folder": 19,
}


def completion(request: Request) -> dict[str, Any]:
    context = context_at(request.document, request.offset)
    found = candidates.at(request.scene, request.document, request.offset, context)
    fitting = [(rank, each) for each in found if (rank := fit(each.name, context.prefix)) is not None]
    fitting.sort(key=lambda pair: (pair[0], pair[1].order))
    start = request.offset - len(context.prefix.encode())
    range_ = request.range(start, request.offset)
    snippets = bool(request.supports("textDocument", "completion", "completionItem", "snippetSupport"))
    uri = request.params["textDocument"]["uri"]
    shown = [detailed(request.scene, each) for _, each in fitting[:MAX_ITEMS]]
    items = [item(each, i, range_, snippets, uri) for i, each in enumerate(shown)]
    return {"isIncomplete": len(fitting) > MAX_ITEMS, "items": items}


def item(each: Candidate, order: int, range_: dict, snippets: bool, uri: str) -> dict[str, Any]:
    """The protocol's CompletionItem."""
    row = {"row": f"{each.row.kind}.{each.row.name}", "block": each.row.block} if each.row is not None else {}
    found: dict[str, Any] = {
        "label": each.name,
        "kind": KINDS.get(each.kind, 1),
        "sortText": f"{order:04d}",
        "filterText": each.name,
        "data": {"uri": uri, "name": each.name, **row},
    }
    if each.detail:
        found["detail"] = each.detail
    if each.snippet and snippets:
        found["insertTextFormat"] = 2
        found["textEdit"] = {"range": range_, "newText": each.snippet}
    else:
        found["textEdit"] = {"range": range_, "newText": each.plain or each.name}
    return found


def resolve(request: Request) -> dict[str, Any]:
    """The item with its documentation."""
    found = dict(request.params)
    data = found.get("data") or {}
    row = candidates.row_of(data.get("row", ""), data.get("block", ""))
    text = prose.documentation(row) if row is not None else None
    if text is None and data.get("name"):
        about = Request(request.workspace, {"textDocument": {"uri": data["uri"]}}, request.client)
        text = describe.describe(about.scene, data["name"])
    if text:
        found["documentation"] = {"kind": "markdown", "value": text}
    return found


FEATURES = (
    Feature(
        "textDocument/completion",
        completion,
        "completionProvider",
        {"triggerCharacters": ["#", '"', "/", ">", "[", "(", "<"], "resolveProvider": True},
    ),
    Feature("completionItem/resolve", resolve),
)

