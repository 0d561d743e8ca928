"""What editors are told about a scene, for whoever has no editor: a file → all messages, in the order of files and places.

`plsys check` says this of scenes with errors, so that both say the same: what is wrong stays in its block, and the checks of
parts without errors are told beside it.

Example: ``[each.message for each in messages_about(Source.read("tree.plsys"))]``
"""

from __future__ import annotations

from dataclasses import replace

from ..pipeline import deep_nesting
from ..reading.diagnostics import Diagnostic, Note
from ..reading.source import Source, Span
from .document import Document
from .project import Project
from .scene import Scene
from .whole import run


def messages_about(source: Source) -> list[Diagnostic]:
    """All messages about ``source`` and the files that it includes, those about the file itself first."""
    project = Project()
    root = project.open(source.path, source.data, name=source.name)
    scene = project.scene_of(root)
    with deep_nesting(source.name):
        run(scene)
    sources = {document: _source_of(document) for document in scene.documents}
    sources[root] = source
    found = []
    for document in scene.documents:
        for message in scene.messages(document):
            said, place = message.diagnostic, Span(sources[document], message.start, message.end)
            notes = tuple(_placed(note, scene, sources) for note in said.notes)
            found.append(replace(said, span=place, notes=notes))
    return found


def _source_of(document: Document) -> Source:
    return Source(document.text.name, document.text.data, document.path)


def _placed(note: Note, scene: Scene, sources: dict[Document, Source]) -> Note:
    place = scene.place(note.span)
    return note if place is None else Note(Span(sources[place.document], place.start, place.end), note.message)
