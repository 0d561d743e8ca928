"""What the blocks of a scene mean together, kept up to date block by block.

A :class:`Scene` is a root file and the files that it includes. It holds an index of names (who defines, assigns and
uses each) and the messages of every block. When blocks change, the index tells whose meaning that touches: the new
blocks, and those that use a name whose *signature* changed (its kind, a Selection's parameters, a constant's text).
Only these are resolved again, by the same code that compiles scenes.

Example::

    scene = Scene(document, open_file)
    scene.changed(document, document.edit(120, 121, b"x"))
    scene.work()                                    # resolve what the edit touched
    [message.diagnostic.message for message in scene.messages(document)]
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Callable, Iterable, Iterator

from ..reading import syntax, vocabulary
from ..reading.diagnostics import Diagnostic, Diagnostics, Note
from ..reading.ignore import WORD as IGNORE_WORD
from ..reading.ignore import Ignore, ignores, is_ignored
from ..reading.model import Definition as ModelDefinition
from ..reading.resolve import _Resolver
from ..reading.resolve_names import ARTICLES, Entry, Names, _identity
from ..reading.source import Source, Span
from .document import Document, Meaning, Message, Place
from .facts import Definition, Facts, facts_of
from .text import Block, Change

# Definitions whose value others are made of: when one changes, so may what is said about those.
_VALUES = frozenset(("value", "input", "texture", "pigment", "finish", "color_map", "object"))
_SINGLE = ("camera", "background")


class _Nothing(list):
    """A list that stays empty: the resolver's record of references, which the index has already."""

    def append(self, _: object) -> None:
        pass


class _Router(Diagnostics):
    """Puts each message to the block that it is about; of blocks with syntax errors, whose meaning can only be guessed
    at, it keeps none."""

    def __init__(self, messages: dict[Block, list[Diagnostic]]) -> None:
        super().__init__()
        self.messages = messages

    def add(self, code: str, span: Span, message: str, hint: str = "", notes: Iterable[Note] = ()) -> None:
        super().add(code, span, message, hint, notes)
        found = self.items.pop()
        if facts_of(span.source).is_broken:  # type: ignore[arg-type]
            return
        known = self.messages.setdefault(span.source, [])  # type: ignore[arg-type]
        if not any((k.code, k.span.start, k.message) == (code, span.start, message) for k in known):
            known.append(found)


class _BlockResolver(_Resolver):
    """The compiler's resolver, asked about one block in the namespace ``entries``. It is made anew for each block, so
    that what it remembers of one doesn't outlive it; values of constants stay in the entries."""

    def __init__(self, block: Source, diagnostics: Diagnostics, entries: dict[str, Entry]) -> None:
        super().__init__(syntax.File(Span(block, 0, 0), ()), diagnostics, {}, 0.0, Source.read)
        self.names.entries = entries
        # Which entry actions run where decides no message, and the closure of all references costs too much per key.
        self.terms.reached = lambda name: frozenset()  # type: ignore[method-assign]
        self._suggestions: dict[tuple, str] = {}
        self._suggest_anew = self.names._suggest
        self.names._suggest = self._suggest  # type: ignore[method-assign]

    def _suggest(self, name: syntax.Name, kinds: tuple[str, ...]) -> str:
        """A wrong name that stands in several places of a block is compared with all others once."""
        key = (name.name, kinds)
        if key not in self._suggestions:
            self._suggestions[key] = self._suggest_anew(name, kinds)
        return self._suggestions[key]

    def load_mesh(self, call: syntax.Call) -> int:
        """Meshes are loaded by the whole-file checks; here it is enough that the file is there."""
        if len(call.arguments) == 1 and isinstance(call.arguments[0], syntax.String):
            base = call.span.source.path
            if ((base.parent if base is not None else Path()) / call.arguments[0].value).is_file():
                return 0
        return super().load_mesh(call)

    def run_on(self, facts: Facts) -> None:
        """Resolve what ``facts``' block holds."""
        names = self.names
        for definition in facts.definitions:
            entry = names.entries.get(definition.name)
            if entry is None or entry.node is not definition.node:
                names._define(definition.node)  # says why it isn't in the namespace
                continue
            if isinstance(definition.node, syntax.Selection):
                self.rules.selection(definition.node)
            elif entry.kind == "input" and not entry.failed:
                names.reporting(lambda: self.constant_of(entry, entry.definition.span), None)
            names.reporting(lambda: self.force(entry), None)
        for name in facts.assigned:
            names._assign(name)
        for block in facts.blocks:
            if block.name.name == "global_settings":
                names.reporting(lambda: self.blocks.global_settings(block, {}), None)
            else:
                names.reporting(lambda: self.block(block), None)


class Scene:
    """``open_file`` gives the document of a path, or raises OSError."""

    def __init__(self, root: Document, open_file: Callable[[Path], Document]) -> None:
        self.root, self.open_file = root, open_file
        self.documents: list[Document] = []
        self.definers: dict[str, dict[Block, list[Definition]]] = {}
        self.writers: dict[str, dict[Block, list[syntax.Name]]] = {}
        self.users: dict[str, dict[Block, None]] = {}
        self.singles: dict[str, dict[Block, None]] = {name: {} for name in _SINGLE}
        self.whole: dict[Block, list[Diagnostic]] = {}  # messages of the whole-file checks
        self.forecast: dict | None = None  # their forecast, of the last text without errors
        self.insights: dict[Block, list] = {}  # what they found to show beside the text: see insights.py
        self._messages: dict[Block, list[Diagnostic]] = {}  # of resolving
        self._syntax: dict[Block, list[Diagnostic]] = {}
        self._ignoring: dict[Block, None] = {}  # blocks with `plsys-ignore` comments
        self._signatures: dict[str, object] = {}
        self._dirty: dict[Block, None] = {}
        self.entries: dict[str, Entry] = {}  # the namespace
        self._router = _Router(self._messages)
        self._include_messages: dict[Block, list[Diagnostic]] = {}
        self._find_files()

    # --- following the text

    def changed(self, document: Document, change: Change) -> None:
        """Take note that blocks of ``document`` were exchanged; ``work`` then does what follows from it."""
        self._exchange(change.removed, change.added)
        if any(facts_of(block).includes for block in (*change.removed, *change.added)):
            self._find_files()

    def work(self, deadline: float | None = None) -> bool:
        """Resolve the blocks that changes have touched, up to ``deadline`` (of time.perf_counter, in seconds). True
        when nothing is left to do."""
        while self._dirty:
            block = next(iter(self._dirty))
            del self._dirty[block]
            self._resolve(block)
            if deadline is not None and time.perf_counter() > deadline:
                return not self._dirty
        return True

    @property
    def is_current(self) -> bool:
        """Whether all that the last changes touched has been resolved."""
        return not self._dirty

    def _exchange(self, removed: list[Block], added: list[Block]) -> None:
        touched: dict[str, None] = {}
        for block in removed:
            self._forget(block, touched)
        for block in added:
            self._learn(block, touched)
        for block in added:
            self._dirty[block] = None
        queue = [name for name in touched if self._refresh(name)]
        self._spread(queue)

    def _forget(self, block: Block, touched: dict[str, None]) -> None:
        facts = facts_of(block)
        for table in (self._messages, self._syntax, self.whole, self._dirty, self._ignoring):
            table.pop(block, None)
        for definition in (*facts.definitions, *facts.ghosts.values()):
            self.definers.get(definition.name, {}).pop(block, None)
            touched[definition.name] = None
        for name in facts.assigned:
            self.writers.get(name.name, {}).pop(block, None)
            touched[name.name] = None
        for name in facts.names:
            self.users.get(name.name, {}).pop(block, None)
        for single in self.singles.values():
            single.pop(block, None)

    def _learn(self, block: Block, touched: dict[str, None]) -> None:
        facts = facts_of(block)
        if facts.syntax:
            self._syntax[block] = facts.syntax
        if IGNORE_WORD in block.data:
            self._ignoring[block] = None
        for definition in (*facts.definitions, *facts.ghosts.values()):
            self.definers.setdefault(definition.name, {}).setdefault(block, []).append(definition)
            touched[definition.name] = None
        for name in facts.assigned:
            self.writers.setdefault(name.name, {}).setdefault(block, []).append(name)
            touched[name.name] = None
        for name in facts.names:
            self.users.setdefault(name.name, {})[block] = None
        for each in facts.blocks:
            if each.name.name in self.singles:
                self.singles[each.name.name][block] = None

    def _refresh(self, name: str) -> bool:
        """Bring the namespace's entry of ``name`` up to date; whether its signature changed."""
        node, kind = self._defining(name)
        if node is None:
            self.entries.pop(name, None)
        else:
            entry = self.entries.get(name)
            if entry is None or entry.node is not node:
                span = node.span if isinstance(node, syntax.Name) else node.name.span
                definition = ModelDefinition(name, kind, span, _Nothing(), _Nothing())
                self.entries[name] = Entry(definition, node)
        several = sum(map(len, self.definers.get(name, {}).values())) > 1
        signature = (_signature(node, kind), id(node) if several else 0)
        if self._signatures.get(name) == signature:
            return False
        self._signatures[name] = signature
        return True

    def _defining(self, name: str) -> tuple[syntax.Definition | syntax.Name | None, str]:
        """The syntax of what defines ``name`` (the first, as the compiler sees it), and its kind."""
        if vocabulary.kind_of(name):
            return None, ""
        found = [(block, each) for block, several in self.definers.get(name, {}).items() for each in several]
        if found:
            if len(found) > 1:
                found.sort(key=lambda pair: (pair[1].name in facts_of(pair[0]).ghosts, *self._position(*pair)))
            return found[0][1].node, found[0][1].kind
        writers = self.writers.get(name)
        return (next(iter(writers.values()))[0], "parameter") if writers else (None, "")

    def _position(self, block: Block, definition: Definition) -> tuple[int, int, int]:
        for i, document in enumerate(self.documents):
            if block in document.text.order:
                return i, document.text.order[block], definition.node.span.start
        return len(self.documents), 0, 0

    def _spread(self, queue: list[str]) -> None:
        """Mark the blocks that depend on the names in ``queue``, and on constants made of those."""
        seen = set(queue)
        while queue:
            for block in self.users.get(queue.pop(), ()):
                self._dirty[block] = None
                for definition in facts_of(block).definitions:
                    entry = self._renew(definition)
                    if entry is not None and entry.kind in _VALUES and definition.name not in seen:
                        seen.add(definition.name)
                        queue.append(definition.name)

    def _renew(self, definition: Definition) -> Entry | None:
        """Forget the value of the entry that ``definition`` makes; the entry, if it makes one."""
        entry = self.entries.get(definition.name)
        if entry is None or entry.node is not definition.node:
            return None
        entry.value, entry.failed = None, False
        return entry

    def _resolve(self, block: Block) -> None:
        self._messages.pop(block, None)
        facts = facts_of(block)
        if facts.is_broken:
            return  # what it means can only be guessed at
        for definition in facts.definitions:
            # Another block that uses it may have been first, and its messages went with the old ones.
            self._renew(definition)
        try:
            _BlockResolver(block, self._router, self.entries).run_on(facts)
        except RecursionError:
            pass  # the whole-file checks, which have more room, report it
        if not self._messages.get(block, True):
            del self._messages[block]

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
                self._exchange(list(document.text.blocks), [])
        for document in self.documents:
            if document not in before:
                document.scenes.append(self)
                self._exchange([], list(document.text.blocks))

    def _expand(self, document: Document, chain: list[Path]) -> None:
        self.documents.append(document)
        chain = [*chain, _identity(document.path)]
        for node in document.includes():
            found = self._include(node, chain)
            if found is not None and found not in self.documents:
                self._expand(found, chain)

    def _include(self, node: syntax.Include, chain: list[Path]) -> Document | None:
        router = _Router(self._include_messages)
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
        order, found = document.text.order, []
        tables = (self._syntax, self._include_messages, self._messages, self.whole)
        noisy = {block for table in tables for block in table}
        for index, block in sorted((order[block], block) for block in noisy if block in order):
            base = document.text.starts[index]
            for table in tables:
                found += [Message(d, base + d.span.start, base + d.span.end) for d in table.get(block, ())]
        found += self._second_ones(document)
        ignored = self._ignores(document)
        kept = [m for m in found if not is_ignored(m.diagnostic.code, m.diagnostic.severity, m.start, ignored)]
        return sorted(kept, key=lambda message: (message.start, message.end))

    def _ignores(self, document: Document) -> list[Ignore]:
        """What `plsys-ignore` comments of ``document`` say. One at the end of a block may speak of the next one."""
        found = []
        text = document.text
        for index in sorted(text.order[block] for block in self._ignoring if block in text.order):
            base, length = text.starts[index], len(text.blocks[index].data)
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
        places = []
        for block in self.users.get(name, ()):
            document = self.document_of(block)
            if document is None:
                continue
            base = document.text.start_of(block)
            for each in facts_of(block).names:
                if each.name == name:
                    places.append(Place(document, base + each.start, base + each.end, each.role))
        return sorted(places, key=self._reading_order)

    def names(self) -> dict[str, str]:
        """All names of the scene with their kinds."""
        return {name: entry.kind for name, entry in self.entries.items()}

    def described(self, kind: str) -> str:
        """``a Selection`` for 'selection', and so on."""
        return ARTICLES.get(kind, kind)


def _signature(node: syntax.Definition | syntax.Name | None, kind: str) -> object:
    """What others see of a definition."""
    if node is None or kind in ("calculation", "transformation", "parameter"):
        return kind
    if isinstance(node, syntax.Selection):
        return kind, tuple(parameter.name for parameter in node.parameters)
    return kind, node.span.text
