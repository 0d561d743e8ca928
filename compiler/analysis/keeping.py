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
from ..reading.meanings import Meanings
from ..reading.memory import Memory
from .facts import facts_of
from .parts import Part, Parts, role_of
from .text import Block

# Parts with fewer blocks are checked anew.
MANY_BLOCKS = 100


@dataclass
class Kept:
    meanings: Meanings = field(default_factory=Meanings)
    answers: Memory = field(default_factory=Memory)


def hand_over(before: Iterable[Part], parts: Parts, removed: list[Block], added: list[Block]) -> None:
    """Give the large ones of the parts what was kept of those ``before`` that they come from, but for what the blocks that
    went and came may have changed. Before the facts of removed blocks are dropped."""
    old = [part for part in before if part.memory is not None]
    if old:
        every = any(role_of(block).kind == "general" for block in (*removed, *added))
        touched = [] if every else list(_touched(parts, removed, added))
        for part in old:
            if every:
                part.memory.meanings.forget_all()
            for block in (*removed, *touched):
                part.memory.meanings.forget(block)
    now = list(parts)
    gone = [part for part in old if part not in now]
    for part in now:
        if part.memory is None and len(part.blocks) >= MANY_BLOCKS:
            blocks = set(part.blocks)
            heir = next((other for other in gone if not blocks.isdisjoint(other.blocks)), None)
            part.memory = heir.memory if heir is not None else Kept()
            gone = [other for other in gone if other is not heir]


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
