"""Renaming, in all files of the scenes that know the name.

Example: `Tree` to `Oak` edits the definition, its rules, its entry action and `object { Tree }`. A name that would clash is
refused with a sentence: "'Bush' is in this scene already: a Selection".
"""

from __future__ import annotations

import re
from typing import Any

from plsys.compiler.analysis import Document, Place, Scene, enters_keys, facts_of, vocabulary
from plsys.lsp.request import Feature, Request
from plsys.lsp.session import Refused

# Names enter random keys (see analysis/keys.py).
_KEYS = {
    "label": "Rename: random numbers below this name change",
    "needsConfirmation": True,
    "description": "the name is part of the random key, so the scene's plants will look different",
}

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")

# Free names that mean something where a scene's own name may stand as well.
_CONTEXTUAL = frozenset(
    (*(name for block in vocabulary.PROPERTIES.values() for name in block), *vocabulary.COLOUR_WORDS, *vocabulary.AXES)
)


def prepare(request: Request) -> dict[str, Any] | None:
    """The range of the name at the cursor; None where there is none. Refuses names that aren't the scene's."""
    found = _renameable(request)
    if found is None:
        return None
    name, place = found
    return {"range": request.range(place.start, place.end), "placeholder": name}


def rename(request: Request) -> dict[str, Any] | None:
    found, new = _renameable(request), request.params["newName"]
    if found is None:
        raise Refused("there is no name here that could be renamed")
    name, _ = found
    if new == name:
        return None
    scenes = list(request.workspace.project.scenes_with(name, request.document))
    places = {(place.document, place.start, place.end): place for scene in scenes for place in scene.uses(name)}
    _check(name, new, scenes, list(places.values()))
    edits: dict[Document, list[dict]] = {}
    for place in sorted(places.values(), key=lambda each: each.start):
        edits.setdefault(place.document, []).append({"range": request.workspace.range(place), "newText": new})
    return _workspace_edit(request, edits, any(enters_keys(scene, name) for scene in scenes))


def _renameable(request: Request) -> tuple[str, Place] | None:
    found = request.document.name_at(request.offset)
    if found is None:
        return None
    name = found[0]
    request.scene.work()  # of a file that is still being opened, all must be known
    if kind := vocabulary.kind_of(name):
        raise Refused(f"'{name}' is {request.scene.described(kind)} of plsys and can't be renamed")
    if name not in request.scene.entries:
        raise Refused(f"nothing defines '{name}', so there is nothing to rename")
    return found


def _check(old: str, new: str, scenes: list[Scene], places: list[Place]) -> None:
    """Refuse what ``old`` can't be called."""
    if not _NAME.fullmatch(new):
        raise Refused(f"'{new}' is no name: a name has the letters A to Z, digits and '_', and doesn't start with a digit")
    for scene in scenes:
        if kind := vocabulary.kind_of(new):
            raise Refused(f"'{new}' is {scene.described(kind)} of plsys and can't be redefined")
        if (entry := scene.entries.get(new)) is not None:
            raise Refused(f"'{new}' is in this scene already: {scene.described(entry.kind)}")
        if scene.uses(new):
            raise Refused(f"'{new}' is already used in this scene, though nothing defines it")
    if new in _CONTEXTUAL and (place := _lost(old, new, places)) is not None:
        line = place.document.text.line_of(place.start) + 1
        raise Refused(f"'{new}' has a meaning of its own where '{old}' stands in line {line}")


def _lost(old: str, new: str, places: list[Place]) -> Place | None:
    """A place where ``new`` would be read as something else than a name of the scene."""
    blocks = {place.document.text.block_at(place.start)[0]: place for place in places}
    for block, place in blocks.items():
        data, wanted = block.data, 0
        for each in reversed([each for each in facts_of(block).names if each.name == old]):
            data = data[: each.start] + new.encode() + data[each.end :]
            wanted += 1
        renamed = Document(None, data)
        found = sum(each.name == new for part in renamed.text.blocks for each in facts_of(part).names)
        if found != wanted:
            return place
    return None


def _workspace_edit(request: Request, edits: dict[Document, list[dict]], changes_plants: bool) -> dict[str, Any]:
    """``changes_plants``: the editor asks before it renames, if it can."""
    uris = {document: request.workspace.uri(document) for document in edits}
    if not request.supports("workspace", "workspaceEdit", "documentChanges"):
        return {"changes": {uris[document]: found for document, found in edits.items()}}
    annotated = changes_plants and request.supports("workspace", "workspaceEdit", "changeAnnotationSupport") is not None
    for edit in (each for found in edits.values() for each in found) if annotated else ():
        edit["annotationId"] = "keys"
    more = {"changeAnnotations": {"keys": _KEYS}} if annotated else {}
    return more | {
        "documentChanges": [
            {"textDocument": {"uri": uris[document], "version": document.version}, "edits": found}
            for document, found in edits.items()
        ]
    }


FEATURES = (
    Feature("textDocument/rename", rename, "renameProvider", {"prepareProvider": True}),
    Feature("textDocument/prepareRename", prepare),
)
