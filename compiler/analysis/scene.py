"""A scene as editors see it: its files, what is said about them, and what names mean.

A :class:`Scene` is a root file and the files that it includes, kept up to date block by block (following.py).

Example::

    scene = Scene(document, open_file)
    scene.changed(document.edit(120, 121, b"x"))
    scene.work()                                    # read and resolve what the edit touched
    [message.diagnostic.message for message in scene.messages(document)]
"""

from __future__ import annotations

from itertools import count
from operator import attrgetter
from pathlib import Path
from typing import Callable, Iterator

from ..reading import syntax, vocabulary
from ..reading.diagnostics import Diagnostic
from ..reading.ignore import Ignore, ignores, is_ignored
from ..reading.resolve_names import ARTICLES, Names, _identity
from ..reading.source import Source, Span
from .document import Document, Meaning, Message, Place
from .facts import Facts, facts_of
from .following import Following
from .resolving import Router
from .text import Block, Change

_PLACE = attrgetter("start", "end")


class Scene(Following):
    """``open_file`` gives the document of a path, or raises OSError. ``number`` is this scene's own."""

    _numbers = count(1)

    def __init__(self, root: Document, open_file: Callable[[Path], Document]) -> None:
        super().__init__()
        self.root, self.open_file = root, open_file
        self.number = next(self._numbers)
        self.forecast: dict | None = None  # of the whole-file checks, of the last text without errors
        self._include_messages: dict[Block, list[Diagnostic]] = {}
        self._find_files()

    @property
    def is_alive(self) -> bool:
        """Whether this is still one of the scenes that its root is looked at in."""
        return self in self.root.scenes

    # --- included files

    def _find_files(self) -> None:
        """Work out which files belong to the scene, and take in or drop the blocks of those that changed sides."""
        before = self.documents
        self.documents = []
        self._include_messages.clear()
        self._included_by.clear()
        self._expand(self.root, [])
        self._names.order_changed()
        for document in before:
            if document not in self.documents:
                document.scenes.remove(self)
                self.changed(Change(list(document.text.blocks), []))
        for document in self.documents:
            if document not in before:
                document.scenes.append(self)
                self.changed(Change([], list(document.text.blocks)))

    def _expand(self, document: Document, chain: list[Path]) -> None:
        self.documents.append(document)
        chain = [*chain, _identity(document.path)]
        for node in document.includes():
            found = self._include(node, chain)
            if found is not None and found not in self.documents:
                self._included_by[found] = node
                self._expand(found, chain)

    def _include(self, node: syntax.Include, chain: list[Path]) -> Document | None:
        router = Router(self._include_messages)
        path = Names(router, Source.read).path_of(node, chain)
        if path is None:
            return None
        try:
            return self.open_file(path)
        except OSError as error:
            span, written = node.path.span, node.path.value
            hint = f"looked for {path}, relative to the file that includes it"
            message = f"can't read '{written}': {error.strerror or error}"
            router.add("include", span, message, hint)
            return None

    def includes_changed(self) -> None:
        """A file came, went or was renamed: look again at what the scene includes."""
        self._find_files()

    # --- asking

    def document_of(self, block: Source) -> Document | None:
        for document in self.documents:
            if block in document.text.order:
                return document
        return None

    def place(self, span: Span, role: str = "") -> Place | None:
        """Where ``span``, of a block of this scene or of one that was replaced since, stands now."""
        block = span.source
        while block is not None:
            document = self.document_of(block)
            if document is not None:
                base = document.text.start_of(block)
                length = len(block.data)
                return Place(document, base + min(span.start, length), base + min(span.end, length), role)
            block = getattr(block, "after", None)
        return None

    def messages(self, document: Document) -> list[Message]:
        """All messages about ``document``, in text order."""
        order, start_at = document.text.order, document.text.start_at
        tables = (self._syntax, self._include_messages, self._messages, self.whole, self.general)
        unfinished = self._names.users_of_unfinished()
        swallowed: set[str] | None = None
        # By place: resolving by block and the whole-file checks both look for missing files.
        places: dict[tuple[int, str, str], Message] = {}
        for table in tables:
            for block, said in table.items():
                if (index := order.get(block)) is None:
                    continue
                base = start_at(index)
                for each in said:
                    if table is self._messages and each.code == "unknown-name":
                        swallowed = self._swallowed_names() if swallowed is None else swallowed
                        if block in unfinished or each.span.text in swallowed:
                            continue
                    start = base + each.span.start
                    places[start, each.code, each.message] = Message(each, start, base + each.span.end)
        found = [*places.values(), *self._second_ones(document)]
        if ignored := self._ignores(document):
            found = [m for m in found if not is_ignored(m.diagnostic.code, m.diagnostic.severity, m.start, ignored)]
        return sorted(found, key=_PLACE)

    def _swallowed_names(self) -> set[str]:
        """What blocks that can't be read may define: not knowing it is no mistake of its users."""
        broken = (block for block in self._syntax if facts_of(block).is_broken)
        return {name for block in broken for name in facts_of(block).headwords}

    def _ignores(self, document: Document) -> list[Ignore]:
        """What `plsys-ignore` comments of ``document`` say. One at the end of a block may speak of the next one."""
        found = []
        text = document.text
        for index in sorted(text.order[block] for block in self._ignoring if block in text.order):
            base, length = text.start_at(index), len(text.blocks[index].data)
            data = b"".join(block.data for block in text.blocks[index : index + 2])
            found += [each._replace(start=base + each.start, end=base + each.end)
                      for each in ignores(data) if each.code_start < length]  # fmt: skip
        return found

    def _second_ones(self, document: Document) -> Iterator[Message]:
        """Cameras and backgrounds after the first: a scene has one."""
        for name, blocks in self.singles.items():
            if len(blocks) < 2:
                continue
            nodes = [node for block in blocks for node in facts_of(block).blocks if node.name.name == name]
            places = [(place, node) for node in nodes if (place := self.place(node.name.span)) is not None]
            places.sort(key=lambda pair: self._position(pair[1].span.source, pair[1].span.start))
            for place, node in places[1:]:
                if place.document is document and node.span.source not in self._syntax:
                    text = f"a second {name} block"
                    hint = "a scene has one; remove the other"
                    message = Diagnostic("duplicate-name", "error", text, node.name.span, hint)
                    if not any(d.message == text for d in self._messages.get(node.span.source, ())):
                        yield Message(message, place.start, place.end)

    def meaning(self, name: str) -> Meaning | None:
        """What ``name`` means in this scene: a definition of the scene's or a row of the vocabulary; None if nothing."""
        entry = self.entries.get(name)
        if entry is not None:
            spans = [d.node.name.span for several in self.definers.get(name, {}).values() for d in several]
            if entry.kind == "parameter":
                spans = [each.span for several in self.writers.get(name, {}).values() for each in several]
            places = [place for span in spans if (place := self.place(span, "definition")) is not None]
            node = None if isinstance(entry.node, syntax.Name) else entry.node
            return Meaning(name, entry.kind, tuple(sorted(places, key=self._reading_order)), node, None)
        kind = vocabulary.kind_of(name)
        row = next((vocabulary.ALL[key] for key in (f"{kind}.{name}",) if key in vocabulary.ALL), None)
        return Meaning(name, kind, (), None, row) if kind else None

    def _reading_order(self, place: Place) -> tuple[int, int]:
        return self.documents.index(place.document), place.start

    def uses(self, name: str) -> list[Place]:
        """Every occurrence of the scene's own ``name``, with its role, in all files, in reading order."""
        numbers = {document.text.name: i for i, document in enumerate(self.documents)}
        using: list[tuple[int, int, Facts]] = []
        for facts in self.users.get(name, ()):
            number = numbers.get(facts.block.name)
            index = None if number is None else self.documents[number].text.order.get(facts.block)
            if index is not None:
                using.append((number, index, facts))
        places: list[Place] = []
        for number, index, facts in sorted(using, key=lambda each: each[:2]):
            document = self.documents[number]
            base = document.text.start_at(index)
            places += [
                Place(document, base + each.start, base + each.end, each.role) for each in facts.names if each.node.name == name
            ]
        return places

    def documents_with(self, name: str) -> set[Document]:
        """The files in which ``name`` stands."""
        found = {self.document_of(facts.block) for facts in self.users.get(name, ())}
        return {document for document in found if document is not None}

    def names(self) -> dict[str, str]:
        """All names of the scene with their kinds."""
        return {name: entry.kind for name, entry in self.entries.items()}

    def described(self, kind: str) -> str:
        """``a Selection`` for 'selection', and so on."""
        return ARTICLES.get(kind, kind)
