"""Code actions: quick fixes of the messages in a range, and refactorings at the cursor.

What can be done is known to the compiler (`analysis/fixes.py`, `analysis/refactor.py`); here it becomes the protocol's.
Example: on "missing ';' after this rule" the action "Add ';'", a quickfix with one insertion.
"""

from __future__ import annotations

from typing import Any, Iterator

from plsys.compiler.analysis import Action, Message, fix_all, fixes, ignoring, line_break, refactorings
from plsys.lsp.request import Feature, Request

KINDS = ("quickfix", "refactor.extract", "refactor.inline", "refactor.rewrite", "source.fixAll")

# Messages beyond this many in one range are not looked at.
MAX_MESSAGES = 50


def code_actions(request: Request) -> list[dict[str, Any]]:
    only = request.params.get("context", {}).get("only")
    if only and all(kind.startswith("source") for kind in only):  # as editors ask when they save
        found = fix_all(request.scene, request.document) if _is_wanted("source.fixAll", only) else ()
        return [_protocol(request, action) for action in found]
    return [_protocol(request, action) for action in _actions(request) if _is_wanted(action.kind, only)]


def _actions(request: Request) -> Iterator[Action]:
    start, end = request.offsets
    document, scene = request.document, request.scene
    found = [each for each in scene.messages(document) if each.start <= end and start <= each.end]
    for message in found[:MAX_MESSAGES]:
        yield from fixes(scene, document, message)
    for message in found[:MAX_MESSAGES]:
        yield from ignoring(scene, document, message)
    for action in refactorings(scene, document, start, end):
        if not action.name or not _is_used_elsewhere(request, action.name):
            yield action


def _is_used_elsewhere(request: Request, name: str) -> bool:
    """Whether a scene that shares the definition of ``name`` uses it in a file that isn't part of this one."""
    scenes = request.workspace.project.scenes_with(name, request.document)
    own = request.scene.documents
    return any(use.document not in own for scene in scenes for use in scene.uses(name))


def _is_wanted(kind: str, only: list[str] | None) -> bool:
    return not only or any(kind == each or kind.startswith(each + ".") for each in only)


def _protocol(request: Request, action: Action) -> dict[str, Any]:
    workspace = request.workspace
    edits: dict[Any, list[dict]] = {}
    for edit in sorted(action.edits, key=lambda each: each.start):
        range_ = workspace.positions(edit.document).range(edit.start, edit.end)
        text = edit.text.replace("\n", line_break(edit.document)) if "\n" in edit.text else edit.text
        edits.setdefault(edit.document, []).append({"range": range_, "newText": text})
    if request.supports("workspace", "workspaceEdit", "documentChanges"):
        changes: dict[str, Any] = {
            "documentChanges": [
                {"textDocument": {"uri": workspace.uri(document), "version": document.version}, "edits": found}
                for document, found in edits.items()
            ]
        }
    else:
        changes = {"changes": {workspace.uri(document): found for document, found in edits.items()}}
    result = {"title": action.title, "kind": action.kind, "edit": changes}
    if action.message is not None:
        result["diagnostics"] = _diagnostics(request, action.message)
        result["isPreferred"] = action.preferred
    return result


def _diagnostics(request: Request, message: Message) -> list[dict]:
    """The client's own words for the message that is fixed, where it sent them along."""
    sent = request.params.get("context", {}).get("diagnostics") or []
    start = request.range(message.start, message.end)["start"]
    return [each for each in sent if each.get("code") == message.diagnostic.code and each["range"]["start"] == start]


FEATURES = (Feature("textDocument/codeAction", code_actions, "codeActionProvider", {"codeActionKinds": list(KINDS)}),)
