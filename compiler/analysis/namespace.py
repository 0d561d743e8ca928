"""Which block defines, assigns and uses each name of a scene, kept up to date block by block.

Blocks that come and go → entries of the compiler's namespace, and the names whose *signature* changed: what others see
of a definition (its kind, a Selection's parameters, a constant's text).

Example::

    namespace.forget(old)
    namespace.learn(new)
    for found in namespace.refresh(): …         # (facts, name): they use it, and it means something else now
"""

from __future__ import annotations

from typing import Callable, Container, Iterable, Iterator

from ..reading import syntax, vocabulary
from ..reading.model import Definition as ModelDefinition
from ..reading.nearest import NameIndex, nearest_of
from ..reading.resolve_names import Entry, vocabulary_names
from .facts import Definition, Facts
from .text import Block

# Definitions whose value others are made of: when one changes, so may what is said about those.
_VALUES = frozenset(("value", "input", "texture", "pigment", "finish", "color_map", "object"))

# A name that nothing has, and the kinds that are wanted there (None: any).
Wrong = tuple[str, tuple[str, ...] | None]

# When more hints than this are kept, it is asked which of their wrong names are still there.
MANY_HINTS = 1024

_VOCABULARY = {kind: NameIndex(vocabulary_names(kind)) for kind in ("primitive", "function", "constant", "colour")}


class _Nothing(list):
    """A list that stays empty: the resolver's record of references, which the index has already."""

    def append(self, _: object) -> None:
        pass


class Namespace:
    """``position`` tells where a place of a block stands, so that the first of several counts. What defines, assigns and uses a
    name are facts, which outlive their block's text (retouch.py)."""

    def __init__(self, position: Callable[[Block, int], tuple[int, ...]]) -> None:
        self.definers: dict[str, dict[Facts, list[Definition]]] = {}
        self.writers: dict[str, dict[Facts, list[syntax.Name]]] = {}
        self.users: dict[str, dict[Facts, None]] = {}
        self.entries: dict[str, Entry] = {}
        self._unfinished: dict[str, dict[Facts, None]] = {}  # Calculations that are being typed
        self._position = position
        self._signatures: dict[str, object] = {}
        self._touched: dict[str, None] = {}  # names that may mean something else since the last refresh
        self._names: dict[str, NameIndex] = {}  # by kind, for names that are like a wrong one
        self._hints: dict[Wrong, str] = {}  # as long as the other names stay
        self._room = MANY_HINTS  # for hints, before that is asked
        self._doubted: dict[Wrong, str] = {}  # those that were given before others came or went
        self.now = 0  # counts refreshes
        self._changed: dict[str, int] = {}  # in which refresh a name came to mean something else

    # --- following blocks

    def forget(self, facts: Facts) -> None:
        for definition in (*facts.definitions, *facts.ghosts.values()):
            self._drop(self.definers, definition.name, facts)
            self._drop(self._unfinished, definition.name, facts)
            self._touched[definition.name] = None
        for name in facts.assigned:
            self._drop(self.writers, name.name, facts)
            self._touched[name.name] = None
        for name in facts.words:
            self._drop(self.users, name, facts)

    @staticmethod
    def _drop(table: dict[str, dict], name: str, facts: Facts) -> None:
        several = table.get(name)
        if several is not None:
            several.pop(facts, None)
            if not several:
                del table[name]

    def learn(self, facts: Facts) -> None:
        for definition in (*facts.definitions, *facts.ghosts.values()):
            self._learn_definition(facts, definition)
        for name in facts.assigned:
            self.writers.setdefault(name.name, {}).setdefault(facts, []).append(name)
            self._touched[name.name] = None
        self._learn_users(facts, facts.words)

    def _learn_definition(self, facts: Facts, definition: Definition) -> None:
        self.definers.setdefault(definition.name, {}).setdefault(facts, []).append(definition)
        if definition.kind == "calculation" and facts.is_broken:
            self._unfinished.setdefault(definition.name, {})[facts] = None
        self._touched[definition.name] = None

    def rename(self, facts: Facts, old: str, new: str) -> None:
        """``facts`` name what they define or assign ``new`` in one place where they named it ``old``."""
        for name in (old, new):
            for table in (self.definers, self._unfinished, self.writers):
                self._drop(table, name, facts)
            self._touched[name] = None
        for definition in facts.definitions:
            if definition.name in (old, new):
                self._learn_definition(facts, definition)
        for each in facts.assigned:
            if each.name in (old, new):
                self.writers.setdefault(each.name, {}).setdefault(facts, []).append(each)
        self.rename_use(facts, old, new)

    def _learn_users(self, facts: Facts, words: Iterable[str]) -> None:
        users = self.users
        for name in words:
            if (several := users.get(name)) is not None:
                several[facts] = None
            else:
                users[name] = {facts: None}

    def rename_use(self, facts: Facts, old: str, new: str) -> None:
        """``facts`` have the name ``new`` in one place where they had ``old``."""
        words = facts.words
        if old not in words:
            self._drop(self.users, old, facts)
        if words[new] == 1:
            self._learn_users(facts, (new,))
        self.learn_value(facts)

    def learn_uses(self, facts: Facts, before: dict[str, int]) -> None:
        """``facts`` have other words than ``before``, but still define and assign the same names."""
        words = facts.words.keys()
        for name in before.keys() - words:
            self._drop(self.users, name, facts)
        self._learn_users(facts, words - before.keys())
        self.learn_value(facts)

    def learn_value(self, facts: Facts, is_other: bool = False) -> None:
        """What ``facts`` say of their definitions has changed, but no name; ``is_other``: so has whether they are broken."""
        for definition in facts.definitions:
            if definition.kind in _VALUES:
                self._touched[definition.name] = None
            elif definition.kind == "calculation" and is_other:
                self._drop(self._unfinished, definition.name, facts)
                if facts.is_broken:
                    self._unfinished.setdefault(definition.name, {})[facts] = None
                self._touched[definition.name] = None

    def order_changed(self) -> None:
        """Of several definitions another one may be the first now."""
        self._touched.update((name, None) for name, definers in self.definers.items() if len(definers) > 1)

    @property
    def is_fresh(self) -> bool:
        return not self._touched

    def refresh(self) -> Iterator[tuple[Facts, str] | None]:
        """Bring the entries up to date; who uses a name whose signature changed, or a constant made of those, and
        which name. None in between, where a pause can be made."""
        queue = []
        self.now += 1
        while self._touched:
            name = next(iter(self._touched))
            del self._touched[name]
            if self._refresh(name):
                queue.append(name)
                self._changed[name] = self.now
            yield None
        self._touched = {}  # what once was large takes long to find the first of
        seen = set(queue)
        while queue:
            name = queue.pop()
            for facts in list(self.users.get(name, ())):
                yield facts, name
                for definition in facts.definitions:
                    entry = self.renew(definition)
                    if entry is not None and entry.kind in _VALUES and definition.name not in seen:
                        seen.add(definition.name)
                        queue.append(definition.name)
                        self._changed[definition.name] = self.now

    def _refresh(self, name: str) -> bool:
        """Bring the entry of ``name`` up to date; whether its signature changed."""
        node, kind = self._defining(name)
        entry = self.entries.get(name)
        if node is None:
            if entry is not None:
                self._unname(entry)
                del self.entries[name]
        elif entry is None or entry.node is not node or entry.kind != kind:
            span = node.span if isinstance(node, syntax.Name) else node.name.span
            definition = ModelDefinition(name, kind, span, _Nothing(), _Nothing())
            self.entries[name] = Entry(definition, node)
            if entry is None or entry.kind != kind:
                if entry is not None:
                    self._unname(entry)
                self._names.setdefault(kind, NameIndex()).add(name)
                self._doubt()
        else:
            entry.value, entry.failed = None, False  # the same syntax may say something else: see retouch.py
        if node is None:
            return self._signatures.pop(name, None) is not None
        definers = self.definers.get(name, {})
        several = len(definers) > 1 or any(len(each) > 1 for each in definers.values())
        signature = (_signature(node, kind), id(node) if several else 0)
        if self._signatures.get(name) == signature:
            return False
        self._signatures[name] = signature
        return True

    def _unname(self, entry: Entry) -> None:
        self._names[entry.kind].remove(entry.definition.name)
        self._doubt()

    def _doubt(self) -> None:
        """Something else may be most like a wrong name now."""
        if self._hints:
            self._doubted = self._hints | self._doubted  # of two hints the earlier one: some were told nothing else yet
            self._hints = {}

    def _defining(self, name: str) -> tuple[syntax.Definition | syntax.Name | None, str]:
        """The syntax of what defines ``name`` (the first, as the compiler sees it), and its kind."""
        if vocabulary.kind_of(name):
            return None, ""
        found = [(facts, each) for facts, several in self.definers.get(name, {}).items() for each in several]
        if found:
            if len(found) > 1:
                found.sort(key=lambda pair: (name in pair[0].ghosts, *self._position(pair[0].block, pair[1].node.span.start)))
            return found[0][1].node, found[0][1].kind
        writers = self.writers.get(name)
        return (next(iter(writers.values()))[0], "parameter") if writers else (None, "")

    def users_of_unfinished(self) -> set[Block]:
        """The blocks that use a Calculation which is being typed: what it assigns isn't known yet."""
        return {facts.block for name in self._unfinished for facts in self.users.get(name, ())}

    def renew(self, definition: Definition) -> Entry | None:
        """Forget the value of the entry that ``definition`` makes; the entry, if it makes one."""
        entry = self.entries.get(definition.name)
        if entry is None or entry.node is not definition.node:
            return None
        entry.value, entry.failed = None, False
        return entry

    # --- asking

    def are_as(self, facts: Facts, moment: int) -> bool:
        """Whether all names in ``facts`` mean what they did when ``now`` was ``moment``."""
        changed = self._changed
        return all(changed.get(name, 0) <= moment for name in facts.words)

    @property
    def has_doubts(self) -> bool:
        """Whether some were told what a wrong name is like, and other names have come or gone since."""
        return bool(self._doubted)

    def settle_doubts(self, wrong: Container[str]) -> Iterator[str | None]:
        """The names of ``wrong`` that something else is most like now. None in between, where a pause can be made."""
        while self._doubted:
            (name, kinds), hint = self._doubted.popitem()
            yield name if name in wrong and self.nearest(name, kinds) != hint else None
        self._room = max(MANY_HINTS, 2 * len(self._hints))

    def nearest(self, name: str, kinds: tuple[str, ...] | None) -> str:
        """As Names.nearest of the compiler."""
        hint = self._hints.get((name, kinds))
        if hint is None:
            if len(self._hints) >= self._room:
                self._room *= 2
                self._doubt()
            if kinds is None:
                indexes = list(self._names.values())
            else:
                indexes = [table[kind] for kind in kinds for table in (self._names, _VOCABULARY) if kind in table]
            hint = self._hints[name, kinds] = nearest_of(name, indexes)
        return hint


def _signature(node: syntax.Definition | syntax.Name, kind: str) -> object:
    """What others see of a definition."""
    if kind in ("calculation", "transformation", "parameter"):
        return kind
    if isinstance(node, syntax.Selection):
        return kind, tuple(parameter.name for parameter in node.parameters), node.is_whole
    return kind, node.span.text
