"""Definition, references and highlights of the name at the cursor.

Example: on ``Tree`` in ``object { Tree }``, definition is the range of ``Tree`` in ``Selection Tree``, and references
are all places that name it, in all files of the scene.
"""

from __future__ import annotations

from typing import Any

from plsys.lsp.request import Feature, Request

READ, WRITE = 2, 3  # DocumentHighlightKind


def definition(request: Request) -> list[dict[str, Any]]:
    """Where the name is defined; of a parameter, where it is assigned; of an include, the file."""
    included = _included_file(request)
    if included is not None:
        return [included]
    found = request.document.name_at(request.offset)
    meaning = request.scene.meaning(found[0]) if found else None
    return [request.location(place) for place in meaning.definitions] if meaning else []


def _included_file(request: Request) -> dict[str, Any] | None:
    for place, path in request.document.included_paths(request.offset):
        if place.start <= request.offset <= place.end and path.is_file():
            start = {"line": 0, "character": 0}
            return {"uri": request.workspace.uri_of(path), "range": {"start": start, "end": start}}
    return None


def references(request: Request) -> list[dict[str, Any]]:
    found = request.document.name_at(request.offset)
    if found is None or found[0] not in request.scene.entries:
        return []
    declarations = request.params.get("context", {}).get("includeDeclaration", True)
    scenes = request.workspace.project.scenes_with(found[0], request.document)
    places = dict.fromkeys(place for scene in scenes for place in scene.uses(found[0]))
    return request.workspace.locations(place for place in places if declarations or place.role != "definition")


def highlights(request: Request) -> list[dict[str, Any]]:
    found = request.document.name_at(request.offset)
    if found is None or found[0] not in request.scene.entries:
        return []
    places = [place for place in request.scene.uses(found[0]) if place.document is request.document]
    kinds = {"definition": WRITE, "write": WRITE}
    return [{"range": request.range(p.start, p.end), "kind": kinds.get(p.role, READ)} for p in places]


FEATURES = (
    Feature("textDocument/definition", definition, "definitionProvider"),
    Feature("textDocument/references", references, "referencesProvider"),
    Feature("textDocument/documentHighlight", highlights, "documentHighlightProvider"),
)
