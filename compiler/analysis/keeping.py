"""What the worker of the whole-file checks keeps of a large part, so that an edit is checked with what it can change.

A part (parts.py) may be all of a file, when a symbol ties its blocks together. What its definitions mean (reading/meanings.py)
and what checks found out about them (reading/memory.py) then stays for all but the blocks that an edit touched, and those
that use a name that means something else now.

Example: after an edit in a rule of ``Tree``, the Selections that place a Tree are as they were, unless its parameters or its
entry action changed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Iterable, Iterator

from ..reading import syntax
from ..reading.diagnostics import Diagnostic, Diagnostics
from ..reading.meanings import Meanings
from ..reading.memory import Memory
from ..reading.model import Model
from ..reading.resolve import Resolver
from ..reading.resolve_again import resolve_again
from ..reading.source import Source, Span
from .facts import facts_of
from .parts import Part, Parts, role_of
from .text import Block

# Parts with fewer blocks are checked anew.
MANY_BLOCKS = 100


@dataclass
class Kept:
    """``meanings`` and ``answers`` of the blocks that no edit touched. After an edit within definitions even the resolver
    and its model are kept, and what is ``_due`` is exchanged there (reading/resolve_again.py)."""

    meanings: Meanings | None = field(default_factory=Meanings)  # None: nothing is kept of what was resolved
    answers: Memory = field(default_factory=Memory)
    _resolver: Resolver | None = None
    _blocks: set[Block] = field(default_factory=set)  # what it has seen
    _gone: set[Block] = field(default_factory=set)  # what the resolver has seen of them doesn't hold
    _due: set[Block] = field(default_factory=set)  # what it has to see instead
    _syntax: dict[Block, list[Diagnostic]] = field(default_factory=dict)

    def forget(self, removed: list[Block], added: list[Block], touched: list[Block]) -> None:
        """Blocks went and came, which touched others."""
        for block in (*removed, *touched):
            self.meanings.forget(block)
        if self._resolver is not None:
            self._gone.update(removed, touched)
            self._due.update(added, touched)
            self._due.difference_update(removed)

    def let_go(self) -> None:
        """Forget what was resolved, but for meanings."""
        if self._resolver is not None:
            self._resolver.close()
        self._resolver = None
        self._gone, self._due = set(), set()

    def resolved(self, blocks: list[Block], root: Block, order: dict[Block, int], found: Diagnostics) -> Model:
        """The model of ``blocks``; messages of reading and resolving them are added to those ``found``."""
        resolver, gone, due, before, now = self._resolver, self._gone, self._due, self._blocks, set(blocks)
        self._resolver, self._gone, self._due, self._blocks = None, set(), set(), now
        due &= now
        try:
            if resolver is None or (before - gone) | due != now or not self._exchange(resolver, gone, sorted(due, key=order.__getitem__), order):
                if resolver is not None:
                    resolver.close()
                resolver = self._resolve(blocks, root)
            model, said = resolver.model, resolver.diagnostics.items
            model.source = root
            found.items += [each for several in self._syntax.values() for each in several]
            if self.meanings is not None and not resolver.diagnostics.has_errors and not found.has_errors and model.objects:
                self._resolver = resolver
            found.items += said
            return model
        finally:
            if resolver is not None and self._resolver is None:
                resolver.close()

    def _exchange(self, resolver: Resolver, gone: set[Block], due: list[Block], order: dict[Block, int]) -> bool:
        names = frozenset().union(*(role_of(block).names for blocks in (gone, due) for block in blocks))
        said = resolver.diagnostics.items
        said[:] = [each for each in said if each.span.source not in gone]
        if not resolve_again(resolver, [facts_of(block).file for block in due], gone, names, order):
            return False
        for block in gone:
            self._syntax.pop(block, None)
        self._syntax.update((block, facts_of(block).syntax) for block in due)
        return True

    def _resolve(self, blocks: list[Block], root: Block) -> Resolver:
        self._syntax = {block: facts_of(block).syntax for block in blocks if facts_of(block).syntax}
        every = (each for block in blocks for each in facts_of(block).file.definitions)
        definitions = tuple(each for each in every if not isinstance(each, syntax.Include))
        resolver = Resolver(syntax.File(Span(root, 0, len(root.data)), definitions), Diagnostics(), {}, None, Source.read)
        resolver.names.meanings = self.meanings
        resolver.run()
        return resolver


def hand_over(before: Iterable[Part], parts: Parts, removed: list[Block], added: list[Block]) -> None:
    """Give the large ones of the parts what was kept of those ``before`` that they come from, but for what the blocks that
    went and came may have changed. Before the facts of removed blocks are dropped."""
    old = [part for part in before if part.memory is not None]
    if old:
        every = any(role_of(block).kind == "general" for block in (*removed, *added))
        touched = [] if every else list(_touched(parts, removed, added))
        are_exchanged = not every and _are_exchanged(removed, added)
        for part in old:
            if every:
                part.memory.meanings.forget_all()
            if not are_exchanged:
                part.memory.let_go()
            part.memory.forget(removed, added, touched)
    now = list(parts)
    gone = [part for part in old if part not in now]
    for part in now:
        if part.memory is None and len(part.blocks) >= MANY_BLOCKS:
            blocks = set(part.blocks)
            heir = next((other for other in gone if not blocks.isdisjoint(other.blocks)), None)
            part.memory = heir.memory if heir is not None else Kept()
            gone = [other for other in gone if other is not heir]
    for part in gone:
        part.memory.let_go()


def _are_exchanged(removed: list[Block], added: list[Block]) -> bool:
    """Whether the scene's blocks are as before but for what stands within definitions."""
    return len(removed) == len(added) and all(
        role_of(old)._replace(names=None) == role_of(new)._replace(names=None)
        and not (role_of(old).includes or facts_of(old).blocks or facts_of(new).blocks)
        and [each.name for each in facts_of(old).definitions] == [each.name for each in facts_of(new).definitions]
        for old, new in zip(removed, added)
    )


def _touched(parts: Parts, removed: list[Block], added: list[Block]) -> Iterator[Block]:
    """The blocks whose meaning may have changed because others went and came."""
    before, after = _signatures(removed), _signatures(added)
    queue = [name for name in before.keys() | after.keys() if before.get(name) != after.get(name)]
    assigned = [frozenset().union(*(role_of(block).assigned for block in blocks)) for blocks in (removed, added)]
    queue += assigned[0] ^ assigned[1]
    seen = set(queue)
    while queue:
        name = queue.pop()
        for block in parts.users.get(name, ()):
            yield block
            for definition in facts_of(block).definitions:
                if definition.name not in seen and _passes_on(block, definition.node, name):
                    seen.add(definition.name)
                    queue.append(definition.name)


def _signatures(blocks: list[Block]) -> dict[str, object]:
    """What others see of the definitions in ``blocks``; equal to nothing else where that is the whole definition."""
    found: dict[str, object] = {}
    for block in blocks:
        for definition in facts_of(block).definitions:
            node = definition.node
            is_first = definition.name not in found
            is_selection = is_first and isinstance(node, syntax.Selection) and not facts_of(block).is_broken
            found[definition.name] = _signature(node) if is_selection else object()
    return found


def _signature(node: syntax.Selection) -> object:
    entry = node.entry.items if node.entry is not None else ()
    if not all(isinstance(item, syntax.Name) for item in entry):
        return object()  # its operators are others now
    return tuple(each.name for each in node.parameters), node.is_whole, tuple(item.name for item in entry)


def _passes_on(block: Block, node: syntax.Definition, name: str) -> bool:
    """Whether what a definition is to others changes with the meaning of ``name`` in it."""
    if not isinstance(node, syntax.Selection):
        return True
    entry = node.entry.span if node.entry is not None else None
    return entry is not None and any(
        each.name == name and entry.start <= each.start < entry.end for each in facts_of(block).names
    )
