"""All files that an editor or a tool looks at: open ones, those that they include, and the scenes that they form.

A file that no other known file includes is a scene of its own; what another includes is looked at as part of that
scene, where its names mean what they mean to the includer.

Example::

    project = Project()
    document = project.open(Path("tree.plsys"), b"object { Tree }\\n")
    project.edit(document, 9, 13, b"Bush")
    project.work()
    project.messages(document)
"""

from __future__ import annotations

from pathlib import Path
from typing import Callable, Iterable, Iterator

from .deadline import Deadline
from .document import Document, Message
from .folders import SUFFIX
from .scene import Scene
from .text import Change


class Project:
    """``scenes_above`` gives the files, open or not, whose scenes a file is part of (folders.py); with None as its limit,
    all of them."""

    def __init__(self, scenes_above: Callable[..., Iterable[Path]] = lambda path, limit=0: ()) -> None:
        self.documents: dict[Path | str, Document] = {}
        self.scenes: dict[Document, Scene] = {}
        self.scenes_above = scenes_above

    # --- files

    def document(self, path: Path) -> Document:
        """The document of ``path``: as opened, or as it is on disk. Raises OSError."""
        key = _key(path)
        found = self.documents.get(key)
        if found is None:
            if not path.is_file():
                raise FileNotFoundError(2, "No such file or directory")
            found = self.documents[key] = Document(path, path.read_bytes())
        return found

    def known(self, path: Path) -> Document | None:
        """The document of ``path``, if it has been opened or read."""
        return self.documents.get(_key(path))

    def open(self, path: Path | None, data: bytes, version: int | None = 0, name: str = "") -> Document:
        """The editor opened ``path`` with the text ``data``, which now counts instead of the file. A text without a
        file has a ``name`` of its own instead."""
        key = _key(path) if path is not None else name
        document = self.documents.get(key)
        if document is None:
            document = self.documents[key] = Document(path, data, version)
        else:
            self._changed(document, [document.set(data)])
            document.version = version
        self._find_scenes()
        return document

    def close(self, document: Document) -> None:
        """The editor closed ``document``: from now on the file on disk counts."""
        document.version = None
        self.reload(document)
        self._find_scenes()

    def reload(self, document: Document) -> None:
        """Read a document that isn't open from disk again."""
        if document.version is not None or document.path is None:
            return
        try:
            self._changed(document, [document.set(document.path.read_bytes())])
        except OSError:
            self.documents.pop(_key(document.path), None)
        self._look_for_includes()

    def file_changed(self, path: Path) -> None:
        """A file was made, changed or deleted outside of the editor."""
        document = self.documents.get(_key(path))
        if document is not None:
            self.reload(document)
        elif path.suffix == SUFFIX:
            self._look_for_includes()
        else:
            self._mesh_changed(path.name.encode())

    def _mesh_changed(self, name: bytes) -> None:
        """What uses a mesh file is read and checked as if it had been edited."""
        for document in list(self.documents.values()):
            using = [block for block in document.text.blocks if b"mesh" in block.data and name in block.data]
            self._changed(document, [document.text.renew(block) for block in using])

    def edit(self, document: Document, start: int, end: int, data: bytes) -> None:
        self.edits(document, ((start, end, data),))

    def edits(self, document: Document, edits: Iterable[tuple[int, int, bytes]]) -> None:
        """See Document.edits."""
        self._changed(document, document.edits(edits))

    def _changed(self, document: Document, changes: Iterable[Change]) -> None:
        for scene in list(document.scenes):
            for change in changes:
                scene.changed(change)

    def _look_for_includes(self) -> None:
        for scene in list(self.scenes.values()):
            scene.includes_changed()
        self._find_scenes()

    # --- scenes

    def _find_scenes(self) -> None:
        """A scene for each open document that is in none, and none for those that another scene has taken in."""
        for document in [each for each in self.documents.values() if each.version is not None]:
            self._open_scenes_above(document)
            if not document.scenes:
                self.scenes[document] = Scene(document, self.document)
        for root, scene in list(self.scenes.items()):
            elsewhere = any(other is not scene for other in root.scenes)
            unused = all(document.version is None for document in scene.documents)
            if unused or (elsewhere and not _includes_all(root, scene)):
                self._drop(scene)
        needed = {document for scene in self.scenes.values() for document in scene.documents}
        for key, document in list(self.documents.items()):
            if document.version is None and document not in needed:
                del self.documents[key]

    def _open_scenes_above(self, document: Document, **limit: None) -> None:
        for path in self.scenes_above(document.path, **limit) if document.path is not None else ():
            try:
                root = self.document(path)
            except OSError:
                continue
            if not root.scenes:
                self.scenes[root] = Scene(root, self.document)

    def folders_changed(self) -> None:
        """What ``scenes_above`` says is new. Scenes that nobody has open and that it no longer names are dropped."""
        opened = [each.path for each in self.documents.values() if each.version is not None and each.path is not None]
        named = {_key(path) for each in opened for path in self.scenes_above(each)}
        for root, scene in list(self.scenes.items()):
            if root.version is None and root.path is not None and _key(root.path) not in named:
                self._drop(scene)
        self._find_scenes()

    def _drop(self, scene: Scene) -> None:
        del self.scenes[scene.root]
        for document in scene.documents:
            document.scenes.remove(scene)

    def scenes_with(self, name: str, document: Document) -> Iterator[Scene]:
        """The scenes in which ``name`` means what it does in ``document``: those that share a file that has it, open or
        not. All that edits touched in them is read."""
        seen: list[Scene] = []
        waiting, looked_at = [document], {document}
        while waiting:
            found = waiting.pop()
            self._open_scenes_above(found, limit=None)
            for scene in list(found.scenes):
                if scene not in seen:
                    seen.append(scene)
                    scene.work()
                    yield scene
                    users = scene.documents_with(name) - looked_at
                    looked_at |= users
                    waiting += users

    def scene_of(self, document: Document) -> Scene:
        """The scene that ``document`` is looked at in."""
        if not document.scenes:
            self._find_scenes()
        if not document.scenes:  # not open, and nobody includes it
            self.scenes[document] = Scene(document, self.document)
        return document.scenes[0]

    # --- work

    def work(self, deadline: Deadline | None = None) -> bool:
        """Resolve what edits have touched, up to ``deadline``; True when all is done."""
        return all([scene.work(deadline) for scene in self.scenes.values()])

    def messages(self, document: Document) -> list[Message]:
        return self.scene_of(document).messages(document)


def _includes_all(root: Document, scene: Scene) -> bool:
    """Whether ``root`` and another scene's root include each other: then the older scene stays."""
    others = [other for other in root.scenes if other is not scene]
    return all(other.root in scene.documents for other in others) and scene is root.scenes[0]


def _key(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):
        return path
