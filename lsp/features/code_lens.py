"""Code lenses: ``▶ Preview`` over what makes a picture, and how often each definition is used.

The commands are the client's: ``plsys.preview`` takes a file's URI, ``plsys.showReferences`` a URI, a position and
locations, as `editor.action.showReferences` does.

Example: over ``Selection Tree`` stands ``5 references``, and over the first ``camera`` or ``object`` ``▶ Preview``.
"""

from __future__ import annotations

from typing import Any

from plsys.compiler.analysis import facts_of
from plsys.lsp.request import Feature, Request

PREVIEWED = ("camera", "object")
# In files with more definitions than this, only Selections have lenses: editors ask for all of them after each edit.
MANY = 1000


def code_lenses(request: Request) -> list[dict[str, Any]]:
    uri = request.params["textDocument"]["uri"]
    lenses = []
    first = preview_place(request)
    if first is not None:
        command = {"title": "▶ Preview", "command": "plsys.preview", "arguments": [uri]}
        lenses.append({"range": request.range(*first), "command": command})
    named = [each for each in request.document.outline() if each.name and each.kind != "block"]
    for each in named:
        if len(named) <= MANY or each.kind == "selection":
            data = {"uri": uri, "name": each.name}
            lenses.append({"range": request.range(each.name_start, each.name_end), "data": data})
    return lenses


def preview_place(request: Request) -> tuple[int, int] | None:
    """The name of the camera, or of the first object."""
    found: dict[str, tuple[int, int]] = {}
    text = request.document.text
    for block, base in zip(text.blocks, text.starts):
        for node in facts_of(block).blocks:
            span = node.name.span
            found.setdefault(node.name.name, (base + span.start, base + span.end))
    return next((found[name] for name in PREVIEWED if name in found), None)


def resolve(request: Request) -> dict[str, Any]:
    """Count the references when the lens comes into view."""
    lens = dict(request.params)
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
