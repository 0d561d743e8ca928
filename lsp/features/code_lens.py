"""Code lenses: ``▶ Preview`` over what makes a picture, and how often each definition is used.

The commands are the client's: ``plsys.preview`` takes a file's URI, ``plsys.showReferences`` a URI, a position and
locations, as `editor.action.showReferences` does.

Example: over ``Selection Tree`` stands ``5 references``, and over the first ``camera`` or ``object`` ``▶ Preview``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from plsys.compiler.analysis import Block, facts_of
from plsys.lsp.request import Feature, Request

PREVIEWED = ("camera", "object")
# In files with more definitions than this, only Selections have lenses: editors ask for all of them after each edit.
MANY = 1000


class _Names(NamedTuple):
    """What of a block can have lenses: names that it defines, with their kinds, and the first of each of its scene blocks
    that can be previewed. Bytes count from its start."""

    definitions: list[tuple[str, str, int, int]]
    previewed: dict[str, tuple[int, int]]


def code_lenses(request: Request) -> list[dict[str, Any]]:
    uri = request.params["textDocument"]["uri"]
    lenses = []
    first = preview_place(request)
    if first is not None:
        command = {"title": "▶ Preview", "command": "plsys.preview", "arguments": [uri]}
        lenses.append({"range": request.range(*first), "command": command})
    text = request.document.text
    found = [(_names_of(block).definitions, base) for block, base in zip(text.blocks, text.starts)]
    are_many = sum(len(definitions) for definitions, _ in found) > MANY
    for definitions, base in found:
        for name, kind, start, end in definitions:
            if not are_many or kind == "selection":
                data = {"uri": uri, "name": name}
                lenses.append({"range": request.range(base + start, base + end), "data": data})
    return lenses


def _names_of(block: Block) -> _Names:
    """Kept with the block."""
    kept = block.__dict__.get("lenses")
    if kept is None:
        facts, previewed = facts_of(block), {}
        for node in facts.blocks:
            if node.name.name in PREVIEWED:
                previewed.setdefault(node.name.name, (node.name.span.start, node.name.span.end))
        definitions = [(each.name, each.kind, each.name_span.start, each.name_span.end) for each in facts.definitions]
        kept = block.__dict__["lenses"] = _Names(definitions, previewed)
    return kept


def preview_place(request: Request) -> tuple[int, int] | None:
    """The name of the camera, or of the first object."""
    found: dict[str, tuple[int, int]] = {}
    text = request.document.text
    for block, base in zip(text.blocks, text.starts):
        for name, (start, end) in _names_of(block).previewed.items():
            found.setdefault(name, (base + start, base + end))
    return next((found[name] for name in PREVIEWED if name in found), None)


def resolve(request: Request) -> dict[str, Any]:
    """Count the references when the lens comes into view; a lens without ``data`` is whole already."""
    lens = dict(request.params)
    if "data" not in lens:
        return lens
    data = lens["data"]
    about = Request(request.workspace, {"textDocument": {"uri": data["uri"]}}, request.client)
    places = [place for place in about.scene.uses(data["name"]) if place.role != "definition"]
    title = f"{len(places)} reference{'' if len(places) == 1 else 's'}"
    locations = [request.workspace.location(place) for place in places]
    arguments = [data["uri"], lens["range"]["start"], locations]
    lens["command"] = {"title": title, "command": "plsys.showReferences" if places else "", "arguments": arguments}
    return lens


FEATURES = (
    Feature("textDocument/codeLens", code_lenses, "codeLensProvider", {"resolveProvider": True}),
    Feature("codeLens/resolve", resolve),
)
