"""The documents of a client, by URI, and what the protocol says about them.

A :class:`Workspace` turns the client's notifications into edits of a project, and places into the protocol's ranges
and locations. It knows nothing of transport, so that tests use it without one.

Example::

    workspace = Workspace("utf-16")
    workspace.did_open("file:///tree.plsys", "object { Tree }\\n", 1)
    workspace.did_change("file:///tree.plsys", 2, [{"range": …, "text": "Bush"}])
    workspace.diagnostics("file:///tree.plsys")
"""

from __future__ import annotations

import logging
import os
from itertools import groupby
from pathlib import Path
from typing import Iterable, Iterator
from urllib.parse import quote, unquote, urlsplit

from plsys.compiler.analysis import SCENE_SUFFIX, Document, Folders, Found, Message, Place, Project, Scene

from .text import Edit, Positions, encode

logger = logging.getLogger(__name__)

# A list of more messages than this helps nobody, and slows down the editor. The most severe ones are
# kept, and what is only unnecessary goes first.
MAX_DIAGNOSTICS = 500

SEVERITY = {"error": 1, "warning": 2, "info": 3}
UNNECESSARY = {"unused", "unreachable", "unreachable-rule"}


def _weight(message: Message) -> tuple[int, bool]:
    found = message.diagnostic
    return SEVERITY[found.severity], found.code in UNNECESSARY


class UnknownDocument(Exception):
    """A request about a document that isn't open and has no file."""


class Workspace:
    """``encoding`` is utf-8, utf-16 or utf-32; ``folders`` are the roots that the client has open, ``scans`` what they
    hold."""

    def __init__(self, encoding: str = "utf-16", scans: Folders | None = None) -> None:
        self.encoding = encoding
        self.scans = scans or Folders()
        self.project = Project(self.scans.scenes_above)
        self.folders: dict[str, Path] = {}
        self.open: dict[str, Document] = {}
        self.uris: dict[Document, str] = {}

    # --- what the client tells

    def did_open(self, uri: str, text: str, version: int) -> Document:
        document = self.project.open(path_of(uri), encode(text), version, name=uri)
        self.open[uri] = document
        self.uris[document] = uri
        return document

    def did_change(self, uri: str, version: int, changes: Iterable[dict]) -> Document | None:
        """Apply the changes in order; each is in the coordinates of the text that the one before left."""
        document = self.open.get(uri)
        if document is None:
            return None
        self.project.edits(document, self._edits(document, changes))
        document.version = version
        return document

    def _edits(self, document: Document, changes: Iterable[dict]) -> Iterator[Edit]:
        """The changes as edits, up to the first that makes no sense: what was applied by then has to be analysed."""
        positions = self.positions(document)
        try:
            for change in changes:
                yield positions.edit(change)
        except (KeyError, TypeError, AttributeError) as error:
            logger.warning("a change that makes no sense: %r", error)

    def did_close(self, uri: str) -> Document | None:
        document = self.open.pop(uri, None)
        if document is not None:
            self.uris.pop(document, None)
            self.project.close(document)
        return document

    def files_changed(self, uris: Iterable[str]) -> None:
        """Files came, changed or went outside of the editor."""
        paths = {uri: path for uri in uris if (path := path_of(uri)) is not None}
        for uri, path in paths.items():
            if uri not in self.open:
                self.project.file_changed(path)
        self.scans.look_at(path for path in paths.values() if path.suffix == SCENE_SUFFIX)

    def add_folder(self, uri: str) -> Path | None:
        path = path_of(uri)
        if path is not None:
            self.folders[uri] = path
        return path

    def remove_folder(self, uri: str) -> None:
        path = self.folders.pop(uri, None)
        if path is not None:
            self.scans.remove(path, self.folders.values())
            self.project.folders_changed()

    def take(self, found: Found) -> None:
        """Something was found in the folders."""
        self.scans.take(found)
        self.project.folders_changed()

    # --- documents and places

    def document(self, uri: str) -> Document:
        """An open document, or one from disk. Raises UnknownDocument."""
        found = self.open.get(uri)
        if found is not None:
            return found
        path = path_of(uri)
        try:
            if path is None:
                raise OSError
            return self.project.document(path)
        except OSError:
            raise UnknownDocument(uri) from None

    @property
    def is_opening(self) -> bool:
        """Whether a long file is still being read: most of its names aren't known yet."""
        return any(scene.is_opening for scene in self.project.scenes.values())

    def scene(self, document: Document) -> Scene:
        return self.project.scene_of(document)

    def uri(self, document: Document) -> str:
        return self.uris.get(document) or uri_of(document.path)

    def uri_of(self, path: Path) -> str:
        """The URI of a path: the client's own where the file is open."""
        document = self.project.known(path)
        return self.uri(document) if document is not None else uri_of(path)

    def positions(self, document: Document) -> Positions:
        return Positions(document.text, self.encoding)

    def range(self, place: Place) -> dict:
        return self.positions(place.document).range(place.start, place.end)

    def location(self, place: Place) -> dict:
        """The protocol's Location of ``place``."""
        return {"uri": self.uri(place.document), "range": self.range(place)}

    def locations(self, places: Iterable[Place]) -> list[dict]:
        """The Locations of many places, those of a file together."""
        found: list[dict] = []
        for document, several in groupby(places, lambda place: place.document):
            uri, range_ = self.uri(document), self.positions(document).range
            found += [{"uri": uri, "range": range_(place.start, place.end)} for place in several]
        return found

    # --- diagnostics

    def diagnostics(self, document: Document) -> list[dict]:
        """The protocol's Diagnostics of ``document``, as far as they are known now."""
        scene = self.scene(document)
        messages = scene.messages(document)
        if len(messages) > MAX_DIAGNOSTICS:
            kept = sorted(range(len(messages)), key=lambda i: _weight(messages[i]))[:MAX_DIAGNOSTICS]
            messages = [messages[i] for i in sorted(kept)]
        positions = self.positions(document)
        found = [self._diagnostic(scene, positions, message) for message in messages]
        return [*found, *self._in_included_files(scene, document)] if len(scene.documents) > 1 else found

    def _in_included_files(self, scene: Scene, document: Document) -> Iterator[dict]:
        """At each #include: the errors of files that it leads to and that nobody would see, since they aren't open."""
        for place, path in document.included_paths():
            waiting, seen = [self.project.known(path)], {document}
            errors: list[tuple[Document, Message]] = []
            while waiting:
                included = waiting.pop(0)
                if included is None or included in seen or included not in scene.documents or included.version is not None:
                    continue
                seen.add(included)
                errors += [(included, each) for each in scene.messages(included) if each.diagnostic.severity == "error"]
                waiting += [self.project.known(other) for _, other in included.included_paths()]
            if errors:
                yield self._include_with_errors(place, errors)

    def _include_with_errors(self, place: Place, errors: list[tuple[Document, Message]]) -> dict:
        included, first = errors[0]
        where = self.location(Place(included, first.start, first.end))
        count = "an error" if len(errors) == 1 else f"{len(errors)} errors, the first"
        line = where["range"]["start"]["line"] + 1
        return {
            "range": self.range(place),
            "severity": SEVERITY["error"],
            "code": "include",
            "source": "plsys",
            "message": f"'{Path(included.text.name).name}' has {count} in line {line}: {first.diagnostic.message}",
            "relatedInformation": [{"location": where, "message": first.diagnostic.message}],
        }

    def _diagnostic(self, scene: Scene, positions: Positions, message: Message) -> dict:
        found = message.diagnostic
        text = f"{found.message}\n{found.hint}" if found.hint else found.message
        result = {
            "range": positions.range(message.start, message.end),
            "severity": SEVERITY[found.severity],
            "code": found.code,
            "source": "plsys",
            "message": text,
        }
        if found.code in UNNECESSARY:
            result["tags"] = [1]
        if found.notes:
            places = [(scene.place(note.span), note.message) for note in found.notes]
            related = [{"location": self.location(place), "message": said} for place, said in places if place is not None]
            if related:
                result["relatedInformation"] = related
        return result


def path_of(uri: str) -> Path | None:
    """The path of a file URI; None for other schemes and for what is no URI."""
    try:
        parts = urlsplit(uri)
    except ValueError:
        return None
    if parts.scheme != "file" or "\0" in unquote(parts.path):
        return None
    path = unquote(parts.path)
    if os.name == "nt":
        path = path.lstrip("/") if not parts.netloc else f"//{parts.netloc}{path}"
    return Path(path) if path else None


def uri_of(path: Path | None) -> str:
    if path is None:
        return "untitled:"
    written = path.absolute()
    plain = Path(os.path.normpath(written))
    # Behind a symbolic link `..` leads elsewhere than the text says.
    text = (plain if ".." not in written.parts or os.path.realpath(plain) == os.path.realpath(written) else written.resolve()).as_posix()
    return "file://" + quote(text if text.startswith("/") else "/" + text)
