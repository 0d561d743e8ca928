"""Texts before and after actions."""

from __future__ import annotations

from plsys.compiler.analysis import Action, Document, Message, Project, Scene, check_whole, fixes, refactorings

CURSOR = "<cursor>"


def opened(text: str) -> tuple[Scene, Document]:
    """The scene of a text, all checks done."""
    project = Project()
    document = project.open(None, text.encode(), name="scene.plsys")
    scene = project.scene_of(document)
    project.work()
    check_whole(scene)
    return scene, document


def messages(text: str) -> list[Message]:
    scene, document = opened(text)
    return scene.messages(document)


def applied(text: str, action: Action) -> str:
    data = text.encode()
    for edit in reversed(sorted(action.edits, key=lambda each: each.start)):
        data = data[: edit.start] + edit.text.encode() + data[edit.end :]
    return data.decode()


def fixed(text: str, code: str) -> dict[str, str]:
    """What the fixes of the first message with ``code`` that has some make of a text, by their titles."""
    scene, document = opened(text)
    found = [each for each in scene.messages(document) if each.diagnostic.code == code]
    assert found, [each.diagnostic for each in scene.messages(document)]
    actions = ({action.title: applied(text, action) for action in fixes(scene, document, each)} for each in found)
    return next(filter(None, actions), {})


def refactored(marked: str) -> dict[str, str]:
    """What the refactorings at the cursor make of a text, by their titles."""
    at = len(marked[: marked.index(CURSOR)].encode())
    text = marked.replace(CURSOR, "")
    scene, document = opened(text)
    return {action.title: applied(text, action) for action in refactorings(scene, document, at, at)}
