"""What the blocks of a scene mean together, kept up to date block by block.

A :class:`Scene` is a root file and the files that it includes. It holds an index of names (who defines, assigns and
uses each) and the messages of every block. When blocks change, the index tells whose meaning that touches: the new
blocks, and those that use a name whose *signature* changed (its kind, a Selection's parameters, a constant's text).
Only these are resolved again, by the same code that compiles scenes.

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
from ..reading.ignore import WORD as IGNORE_WORD
from ..reading.ignore import Ignore, ignores, is_ignored
from ..reading.resolve_names import ARTICLES, Names, _identity
from ..reading.source import Source, Span
from .deadline import Deadline
from .document import Document, Meaning, Message, Place
from .earlier import Earlier
from .facts import Definition, Facts, drop_facts, facts_of, keep_lost
from .namespace import Namespace
from .parts import role_of
from .pending import Pending
from .resolving import BlockResolver, Router
from .retouch import retouch, touch_of
from .text import Block, Change

# A change that adds so many blocks is a file that is opened: reading it takes longer than a request may wait.
MANY_BLOCKS = 200

# So many texts of a block are known to have been right, for what is typed to be taken back.
RIGHT_TEXTS = 4

_PLACE = attrgetter("start", "end")

_SINGLE = ("camera", "background")


class Scene:
    """``open_file`` gives the document of a path, or raises OSError. ``number`` is this scene's own."""

    _numbers = count(1)

    def __init__(self, root: Document, open_file: Callable[[Path], Document]) -> None:
        self.root, self.open_file = root, open_file
        self.number = next(self._numbers)
        self.documents: list[Document] = []
        names = self._names = Namespace(self._position)
        self.entries, self.definers, self.writers, self.users = names.entries, names.definers, names.writers, names.users
        self.singles: dict[str, dict[Block, None]] = {name: {} for name in _SINGLE}
        self.whole: dict[Block, list[Diagnostic]] = {}  # messages of the whole-file checks
        self.general: dict[Block, list[Diagnostic]] = {}  # those about what parts of the scene share
        self.forecast: dict | None = None  # their forecast, of the last text without errors
        self.insights: dict[Block, list] = {}  # what they found to show beside the text: see insights.py
        self.is_opening = False  # names aren't known yet: much of a file was never read
        self._pending = Pending()
        self._earlier = Earlier()
        self._reading: Iterator[None] | None = None
        self._messages: dict[Block, list[Diagnostic]] = {}  # of resolving
        self._syntax: dict[Block, list[Diagnostic]] = {}
        self._ignoring: dict[Block, None] = {}  # blocks with `plsys-ignore` comments
        # Blocks to be resolved: the last one first. Places are all that has changed, where the rest is right.
        self._edited: dict[Block, list[Span] | None] = {}
        self._dirty: dict[Block, list[Span] | None] = {}  # then those that use what was edited
        self._opened: dict[Block, None] = {}  # and then those of a file that was opened, from its start
        self._resolver = BlockResolver(Router(self._messages), self.entries, names.nearest)
        self._include_messages: dict[Block, list[Diagnostic]] = {}
        self._find_files()

    @property
    def is_alive(self) -> bool:
        """Whether this is still one of the scenes that its root is looked at in."""
        return self in self.root.scenes

    # --- following the text

    def changed(self, change: Change) -> None:
        """Take note that blocks of a document were exchanged; ``work`` then does what follows from it."""
        self._pending.add(change)
        self.is_opening |= len(change.added) >= MANY_BLOCKS

    def work(self, deadline: Deadline | None = None) -> bool:
        """Read and resolve what changes have touched, up to ``deadline``, or up to where
        only the rest of a file that was opened is left. True when nothing is left to do."""
        had_edits = bool(self._pending or self._edited or self._dirty)
        if not self.read(deadline):
            return False
        while self._edited or self._dirty or self._opened:
            places = None
            if self._edited:
                block, places = self._edited.popitem()
            elif self._dirty:
                block, places = next(iter(self._dirty.items()))
            elif had_edits and deadline is not None:
                return False  # what is known about the edit needs not wait
            else:
                block = next(iter(self._opened))
            self._dirty.pop(block, None)
            self._opened.pop(block, None)
            self._resolve(block, places)
            if deadline is not None and deadline.has_passed():
                return self.is_current
        return True

    def read(self, deadline: Deadline | None = None) -> bool:
        """The first half of ``work``: after it all names are known, but what is wrong with them isn't."""
        while self._reading is not None or self._pending or not self._names.is_fresh:
            self._reading = self._reading or self._steps()
            for _ in self._reading:
                if deadline is not None and deadline.has_passed():
                    return False
            self._reading = None
        self.is_opening = False
        return True

    @property
    def is_current(self) -> bool:
        """Whether all that the last changes touched has been resolved."""
        read = self._reading is None and not self._pending and self._names.is_fresh
        return read and not (self._edited or self._dirty or self._opened)

    def _steps(self) -> Iterator[None]:
        """Reads what is pending, with a pause after each block."""
        while self._pending:
            change, removed_includes = self._pending.take(), False
            is_alone = self._is_alone()
            if is_alone and self._retouch(change):
                yield
                continue
            if change.removed:
                for block in change.added:
                    if not is_alone or not self._earlier.take(block):
                        facts_of(block)
                    yield
                keep_lost(change)
            is_lent = any(facts_of(block).ghosts for block in change.added) if change.removed else True
            for block in change.removed:
                if is_alone and not is_lent:
                    self._note_right(block)
                    self._earlier.keep(block)
                self._forget(block)
                self._names.forget(facts_of(block))
                removed_includes |= b"include" in block.data and bool(facts_of(block).includes)
                if (readers := block.__dict__.get("readers", 1)) > 1:
                    block.__dict__["readers"] = readers - 1  # another scene has yet to forget the same facts
                else:
                    drop_facts(block)
                yield
            waiting = self._opened if len(change.added) >= MANY_BLOCKS else self._edited
            for block in change.added:
                self._learn(block)
                self._names.learn(facts_of(block))
                if waiting is self._opened:
                    role_of(block)  # the whole-file checks ask for it, of all blocks at once
                if not self._is_right(block):
                    waiting[block] = None
                yield
            if removed_includes or any(facts_of(block).includes for block in change.added if b"include" in block.data):
                self._find_files()
        for found in self._names.refresh():
            if found is not None:
                self._note_change(*found)
            yield

    def _is_alone(self) -> bool:
        """Whether no other scene looks at the same files."""
        return all([len(each.scenes) == 1 for each in self.documents])

    def _note_change(self, facts: Facts, name: str) -> None:
        """``name``, which is in ``facts``, means something else now."""
        block = facts.block
        if block in self._opened:
            return
        places = [each.node.span for each in facts.names if each.node.name == name]
        waiting = self._edited if block in self._edited else self._dirty
        if block not in waiting:
            waiting[block] = places if self._is_right_but_at(block, places) else None
        elif (known := waiting[block]) is not None:
            known += places

    def _is_right_but_at(self, block: Block, places: list[Span]) -> bool:
        """Whether nothing is known to be wrong with ``block`` but what is in ``places``. (Of a second definition nothing is
        known but that it is one.)"""
        return all(
            each.code != "duplicate-name"
            and any(place.start <= each.span.start and each.span.end <= place.end for place in places)
            for each in self._messages.get(block, ())
        )

    def _retouch(self, change: Change) -> bool:
        """Whether all that was typed is in one token or beside all, which has been read then."""
        if len(change.removed) != 1 or len(change.added) != 1:
            return False
        (old,), (new,) = change
        touch = touch_of(old, new) if new not in self._earlier else None
        if touch is None:
            return False
        facts, leaf, names = facts_of(old), touch.leaf, self._names
        was_broken, words, places = facts.is_broken, facts.words, [leaf.span] if leaf is not None else []
        name = leaf.name if isinstance(leaf, syntax.Name) else None
        # Whether all else in the block is known to be right.
        was_right = not was_broken and not self._is_waiting(old) and self._is_right_but_at(old, places)
        self._note_right(old)
        self._forget(old)
        if touch.renames and touch.index is None:
            names.forget(facts)
            retouch(old, new, touch)
            names.learn(facts)
        else:
            retouch(old, new, touch)
            if touch.renames:
                names.rename(facts, name, touch.text, words)
            elif name is not None:
                names.learn_uses(facts, words)
            elif leaf is not None:
                names.learn_value(facts, facts.is_broken is not was_broken)
        self._learn(new)
        if not (was_right and leaf is None) and not self._is_right(new):
            self._edited[new] = places if was_right else None
        return True

    def _note_right(self, block: Block) -> None:
        """Note with the facts of a block that goes if all in it is known to be right."""
        if not (self._is_waiting(block) or self._messages.get(block) or facts_of(block).is_broken):
            right = facts_of(block).right
            right.pop(block.data, None)
            right[block.data] = self._names.now
            if len(right) > RIGHT_TEXTS:
                del right[next(iter(right))]

    def _is_waiting(self, block: Block) -> bool:
        """Whether a block is to be resolved."""
        return block in self._edited or block in self._dirty or block in self._opened

    def _is_right(self, block: Block) -> bool:
        """Whether an earlier block with the same text was right, and all names in it mean the same."""
        facts = facts_of(block)
        moment = facts.right.get(block.data)
        return moment is not None and self._names.are_as(facts, moment)

    def _forget(self, block: Block) -> None:
        waiting = self._edited, self._dirty, self._opened
        for table in (self._messages, self._syntax, self.whole, self.general, self.insights, self._ignoring, *waiting):
            table.pop(block, None)
        for single in self.singles.values():
            single.pop(block, None)

    def _learn(self, block: Block) -> None:
        facts = facts_of(block)
        block.__dict__["readers"] = block.__dict__.get("readers", 0) + 1
        if facts.syntax:
            self._syntax[block] = facts.syntax
        if IGNORE_WORD in block.data:
            self._ignoring[block] = None
        for each in facts.blocks:
            if each.name.name in self.singles:
                self.singles[each.name.name][block] = None

    def _position(self, block: Block, definition: Definition) -> tuple[int, int, int]:
        for i, document in enumerate(self.documents):
            if block in document.text.order:
                return i, document.text.order[block], definition.node.span.start
        return len(self.documents), 0, 0

    def _resolve(self, block: Block, places: list[Span] | None = None) -> None:
        self._messages.pop(block, None)
        facts = facts_of(block)
        if facts.is_broken:
            return  # what it means can only be guessed at
        for definition in facts.definitions:
            # Another block that uses it may have been first, and its messages went with the old ones.
            self._names.renew(definition)
        try:
            self._resolver.run_on(facts, places)
        except RecursionError:
            pass  # the whole-file checks, which have more room, report it

    # --- included files

    def _find_files(self) -> None:
        """Work out which files belong to the scene, and take in or drop the blocks of those that changed sides."""
        before = self.documents
        self.documents = []
        self._include_messages.clear()
        self._expand(self.root, [])
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
        # By place: resolving by block and the whole-file checks both look for missing files.
        places: dict[tuple[int, str, str], Message] = {}
        for table in tables:
            for block, said in table.items():
                if (index := order.get(block)) is None:
                    continue
                base = start_at(index)
                for each in said:
                    if table is self._messages and each.code == "unknown-name" and block in unfinished:
                        continue
                    start = base + each.span.start
                    places[start, each.code, each.message] = Message(each, start, base + each.span.end)
        found = [*places.values(), *self._second_ones(document)]
        if ignored := self._ignores(document):
            found = [m for m in found if not is_ignored(m.diagnostic.code, m.diagnostic.severity, m.start, ignored)]
        return sorted(found, key=_PLACE)

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
            places.sort(key=lambda pair: (self.documents.index(pair[0].document), pair[0].start))
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
