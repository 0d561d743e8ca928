"""Call hierarchy: the production graph. Who produces a symbol or applies an operator, and what does it produce itself?

Example: of `Tree`, incoming are `object` (the start) and `Tree` (its recursion), outgoing `T_scale`, `C_Tree` and `Tree`.
"""

from __future__ import annotations

from typing import Any

from plsys.compiler.analysis import Document, Place, facts_of, syntax
from plsys.lsp.features.document_symbols import SYMBOL_KINDS
from plsys.lsp.request import Feature, Request

# What takes part: symbols, operators, and declared objects.
KINDS = frozenset(("selection", "calculation", "transformation", "texture", "object"))


def prepare(request: Request) -> list[dict[str, Any]] | None:
    found = request.document.name_at(request.offset)
    meaning = request.scene.meaning(found[0]) if found else None
    if meaning is None or meaning.kind not in KINDS or not meaning.definitions:
        return None
    place = meaning.definitions[0]
    found = _node_at(place)
    return [_item(request, place.document, *found)] if found else None


def incoming(request: Request) -> list[dict[str, Any]]:
    name, document = _asked(request)
    if name is None:
        return []
    callers: dict[int, tuple[dict, list[dict]]] = {}
    for place in _scene(request, document).uses(name):
        found = _node_at(place) if place.role == "read" else None
        if found is not None:
            caller = callers.setdefault(id(found[0]), (_item(request, place.document, *found), []))
            caller[1].append(request.workspace.range(place))
    return [{"from": item, "fromRanges": ranges} for item, ranges in callers.values()]


def outgoing(request: Request) -> list[dict[str, Any]]:
    document = request.workspace.document(request.params["item"]["uri"])
    found = _node_at(Place(document, *_selection(request, document)))
    if found is None:
        return []
    node, base, _ = found
    scene = _scene(request, document)
    callees: dict[str, list[dict]] = {}
    block, _ = document.text.block_at(base + node.span.start)
    for name in facts_of(block).names:
        if name.role == "read" and node.span.start <= name.start < node.span.end:
            callees.setdefault(name.name, []).append(request.workspace.range(Place(document, base + name.start, base + name.end)))
    result = []
    for name, ranges in callees.items():
        meaning = scene.meaning(name)
        if meaning is not None and meaning.kind in KINDS and meaning.definitions:
            place = meaning.definitions[0]
            if (callee := _node_at(place)) is not None:
                result.append({"to": _item(request, place.document, *callee), "fromRanges": ranges})
    return result


# --- items


def _scene(request: Request, document: Document):
    scene = request.workspace.scene(document)
    scene.work()
    return scene


def _selection(request: Request, document: Document) -> tuple[int, int]:
    return request.workspace.positions(document).offsets(request.params["item"]["selectionRange"])


def _asked(request: Request) -> tuple[str | None, Document]:
    """The name of the item that is asked about; None for scene blocks, which nothing names."""
    document = request.workspace.document(request.params["item"]["uri"])
    found = document.name_at(_selection(request, document)[0])
    return found[0] if found and found[1].role == "definition" else None, document


def _node_at(place: Place) -> tuple[syntax.Definition, int, str] | None:
    """The definition or scene block round ``place``, where its text block starts, and its kind."""
    block, base = place.document.text.block_at(place.start)
    facts = facts_of(block)
    for node in facts.file.definitions:
        if node.span.start <= place.start - base < node.span.end and not isinstance(node, syntax.Include):
            kind = next((each.kind for each in facts.definitions if each.node is node), "block")
            return node, base, kind
    return None


def _item(request: Request, document: Document, node: syntax.Definition, base: int, kind: str) -> dict[str, Any]:
    """The CallHierarchyItem of a definition or scene block."""

    def range_of(span) -> dict:
        return request.workspace.range(Place(document, base + span.start, base + span.end))

    return {
        "name": node.name.name,
        "kind": SYMBOL_KINDS[kind],
        "detail": "" if kind == "block" else kind,
        "uri": request.workspace.uri(document),
        "range": range_of(node.span),
        "selectionRange": range_of(node.name.span),
    }


FEATURES = (
    Feature("textDocument/prepareCallHierarchy", prepare, "callHierarchyProvider"),
    Feature("callHierarchy/incomingCalls", incoming),
    Feature("callHierarchy/outgoingCalls", outgoing),
)
