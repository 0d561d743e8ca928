"""The parts of a scene that have nothing to do with each other, so that an edit is checked with its own part only.

Blocks → :class:`Part`\\ s. Blocks are *tied* when they share a name that one of them defines or assigns. *Shared* blocks
tie nothing, since they are the same to everyone: constants, inputs, declared textures, Transformations of plain
numbers, and what the scene has once (camera, lights, settings: *general*). A part is checked together with the shared
blocks that it needs and with the general ones. A shared block that nothing uses is a part of its own, and so are the
general blocks alone, as the part without blocks.

Example: two trees with symbols, Calculations and objects of their own are two parts, even if they have one bark.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Iterable, Iterator, NamedTuple

from ..reading import syntax, vocabulary
from .facts import Facts, facts_of
from .text import Block

_SHARED = frozenset(("value", "input", "texture", "pigment", "finish", "color_map"))
_GENERAL = frozenset(row.name for row in vocabulary.BLOCKS.values() if row.makes == "scene")


class Role(NamedTuple):
    """``kind``: tied, shared or general; the scene's names that the block uses, those that it defines or assigns,
    and those that it assigns; whether it places objects and whether it includes files. All that has to be known of a block that isn't checked."""

    kind: str
    names: frozenset[str]
    defined: frozenset[str]
    assigned: frozenset[str]
    places: bool
    includes: bool


def role_of(block: Block) -> Role:
    """The block's role; worked out at the first call, unless it was told with the block (exchange.NewBlock)."""
    found = block.__dict__.get("role")
    if found is None:
        found = block.__dict__["role"] = _role(facts_of(block))
    return found


def _role(facts: Facts) -> Role:
    assigned = {each.name for each in facts.assigned}
    defined = {each.name for each in facts.definitions} | assigned
    names = {each.name for each in facts.names if not vocabulary.kind_of(each.name)}
    kind = "tied"
    if all(each.name.name in _GENERAL for each in facts.blocks) and not facts.is_broken:
        if not facts.definitions:
            kind = "general" if facts.blocks or facts.includes else "shared"
        elif not facts.blocks and all(_is_shared(each, names - defined) for each in facts.definitions):
            kind = "shared"
    places = any(each.name.name in vocabulary.OBJECT_BLOCKS for each in facts.blocks)
    return Role(kind, frozenset(names), frozenset(defined), frozenset(assigned), places, bool(facts.includes))


def _is_shared(definition: Any, read: set[str]) -> bool:
    if isinstance(definition.node, syntax.Texture):
        return False  # it may read parameters
    return definition.kind in _SHARED or (definition.kind == "transformation" and not read)


@dataclass(eq=False)
class Part:
    """``blocks`` are its own; ``outcome`` is what checking it gave, None while that is due; ``memory`` is what is kept of a
    large part from one check to the next."""

    blocks: list[Block]
    outcome: Any = field(default=None, repr=False)
    memory: Any = field(default=None, repr=False)


class Parts:
    """The parts of one scene, kept up to date."""

    def __init__(self) -> None:
        self.users: dict[str, dict[Block, None]] = {}
        self.shared: dict[str, dict[Block, None]] = {}  # shared blocks by the names that they define
        self.general: dict[Block, None] = {}
        self.base = Part([])
        self.touched: dict[Part, None] = {}  # that lost their outcome without being made anew
        self._part_of: dict[Block, Part] = {}
        self._needed: dict[Part, dict[Block, None]] = {}  # as far as it was asked for

    def __iter__(self) -> Iterator[Part]:
        yield self.base
        yield from dict.fromkeys(self._part_of.values())

    def part_of(self, block: Block) -> Part | None:
        """None for shared blocks that are used."""
        return self._part_of.get(block)

    def change(self, removed: Iterable[Block], added: Iterable[Block]) -> None:
        """Blocks went and came; parts that this touches lose their outcome or are made anew."""
        removed, added = self._exchange(list(removed), list(added))
        if removed or added:
            self._needed.clear()
        seeds: dict[Block, None] = {}
        names: set[str] = set()
        for block in removed:
            self._unlink(block)
            names |= role_of(block).names | role_of(block).defined
            self._dissolve(block, seeds)
        for block in added:
            self._link(block)
            names |= role_of(block).names | role_of(block).defined
            seeds[block] = None
        if any(role_of(block).kind == "general" for block in (*removed, *added)):
            for part in self:
                part.outcome = None
        for block in self._depending(name for block in (*removed, *added) for name in role_of(block).defined):
            if block in self.general:
                for part in self:
                    part.outcome = None
            self._dissolve(block, seeds)
        for name in names:  # what becomes unused, or used
            for block in self.shared.get(name, ()):
                self._dissolve(block, seeds)
                seeds[block] = None
        for block in removed:
            seeds.pop(block, None)
        self._gather(seeds)

    def _exchange(self, removed: list[Block], added: list[Block]) -> tuple[list[Block], list[Block]]:
        """Let new blocks of the same role take the places of old ones: no part is made anew. What is left then."""
        if len(removed) != len(added):
            return removed, added
        others = [(old, new) for old, new in zip(removed, added) if role_of(old) != role_of(new)]
        for old, new in zip(removed, added):
            role = role_of(new)
            if role != role_of(old):
                continue
            self._unlink(old)
            self._link(new)
            for needed in self._needed.values() if role.kind != "tied" else ():
                if old in needed:
                    del needed[old]
                    needed[new] = None
            part = self._part_of.pop(old, None)
            if part is not None:
                part.blocks[part.blocks.index(old)] = new
                self._part_of[new] = part
                self._touch(part)
            using = list(self._depending(role.defined)) if role.kind == "shared" else []
            for each in using:
                if each in self._part_of:
                    self._touch(self._part_of[each])
            if role.kind == "general" or any(each in self.general for each in using):
                for part in self:
                    part.outcome = None
        return [old for old, _ in others], [new for _, new in others]

    def _touch(self, part: Part) -> None:
        part.outcome = None
        self.touched[part] = None

    def _link(self, block: Block) -> None:
        role = role_of(block)
        for name in role.names | role.defined:
            self.users.setdefault(name, {})[block] = None
        if role.kind == "shared":
            for name in role.defined:
                self.shared.setdefault(name, {})[block] = None
        elif role.kind == "general":
            self.general[block] = None

    def _unlink(self, block: Block) -> None:
        role = role_of(block)
        for table, names in ((self.users, role.names | role.defined), (self.shared, role.defined)):
            for name in names:
                if (blocks := table.get(name)) is not None:
                    blocks.pop(block, None)
                    if not blocks:
                        del table[name]
        self.general.pop(block, None)

    def _dissolve(self, block: Block, seeds: dict[Block, None]) -> None:
        """Let the part of ``block`` go; its blocks have to be put together again."""
        part = self._part_of.get(block)
        for each in part.blocks if part is not None else ():
            self._part_of.pop(each, None)
            seeds[each] = None

    def _depending(self, names: Iterable[str]) -> Iterator[Block]:
        """The blocks that use one of ``names``, or a shared block that does."""
        queue, seen = list(names), set()
        while queue:
            for block in self.users.get(queue.pop(), ()):
                if block not in seen:
                    seen.add(block)
                    yield block
                    if role_of(block).kind == "shared":
                        queue += role_of(block).defined

    def _gather(self, seeds: dict[Block, None]) -> None:
        while seeds:
            block = seeds.popitem()[0]
            kind = role_of(block).kind
            if kind == "tied" and block not in self._part_of:
                blocks = self._tied(block)
                part = Part(blocks)
                self._part_of.update(dict.fromkeys(blocks, part))
            elif kind == "shared" and all(len(self.users.get(name, ())) < 2 for name in role_of(block).defined):
                self._part_of[block] = Part([block])

    def _tied(self, block: Block) -> list[Block]:
        found, new, seen = {block: None}, [block], set(self.shared)
        while new:
            roles = list(map(role_of, new))
            names = set().union(*[role.names for role in roles], *[role.defined for role in roles]) - seen
            seen |= names
            using = set().union(*[self.users.get(name, ()) for name in names]).difference(found)
            new = [each for each in using if role_of(each).kind == "tied"]
            found.update(dict.fromkeys(new))
        return list(found)

    def needed(self, part: Part) -> dict[Block, None]:
        """The general blocks, and the shared blocks that they or ``part`` need."""
        found = self._needed.get(part)
        if found is None:
            found = self._needed[part] = self._find_needed(part)
        return found

    def _find_needed(self, part: Part) -> dict[Block, None]:
        found = dict(self.general)
        new = [*part.blocks, *found]
        while new:
            names = set().union(*[role_of(block).names for block in new])
            new = [block for name in names & self.shared.keys() for block in self.shared[name] if block not in found]
            found.update(dict.fromkeys(new))
        return {block: None for block in found if self._part_of.get(block) is not part}
