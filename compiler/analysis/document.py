"""One file as editors see it, and the small facts that the analysis answers with.

Offsets are bytes in the file's UTF-8 text.

Example::

    document = Document(Path("tree.plsys"), b"object { Tree }\\n")
    document.edit(9, 13, b"Bush")
    document.name_at(10)            # Place(…, 9, 13, 'read')
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Iterable, Iterator, NamedTuple

from ..reading import syntax
from ..reading.diagnostics import Diagnostic
from ..reading.vocabulary import Row
from .facts import Definition, facts_of
from .text import Block, Change, Text

if TYPE_CHECKING:
    from tree_sitter import Node

    from .scene import Scene


class Place(NamedTuple):
    """A range of a file. ``role`` of a name: definition, write, target or read."""

    document: Document
    start: int
    end: int
    role: str = ""

    @property
    def text(self) -> str:
        return self.document.text.slice(self.start, self.end).decode(errors="replace")


class Message(NamedTuple):
    """A diagnostic and where it stands in its file now."""

    diagnostic: Diagnostic
    start: int
    end: int


class Meaning(NamedTuple):
    """What a name means: ``kind`` as in model.Definition or of the vocabulary; where it is defined (a parameter: where
    it is assigned), the definition's syntax, or the vocabulary's row."""

    name: str
    kind: str
    definitions: tuple[Place, ...]
    node: syntax.Definition | None
    row: Row | None


class Outline(NamedTuple):
    """A top-level definition or block: ``start`` to ``end`` is all of it, ``name_start`` to ``name_end`` its name."""

    name: str
    kind: str
    start: int
    end: int
    name_start: int
    name_end: int
    node: syntax.Definition


@dataclass(eq=False)
class Document:
    """A file: ``path`` (None for a text without one), its blocks in ``text``, the scenes that it is part of, and the
    editor's ``version`` (None where the file isn't open)."""

    path: Path | None
    data: bytes = field(repr=False)
    version: int | None = None
    scenes: list[Scene] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        self.text = Text(str(self.path or "<text>"), self.path, self.data)
        del self.data

    def edit(self, start: int, end: int, data: bytes) -> Change:
        """Put ``data`` in the place of the bytes from ``start`` to ``end``."""
        return self.text.replace(start, end, data)

    def edits(self, edits: Iterable[tuple[int, int, bytes]]) -> list[Change]:
        """Several edits one after the other, each in the coordinates that the one before left. ``edits`` may be a
        generator that looks at the text."""
        return [self.text.replace(start, end, data) for start, end, data in edits]

    def set(self, data: bytes) -> Change:
        """Replace the whole text, as one edit of what differs."""
        old = self.text.data
        same = min(len(old), len(data))
        start = next((i for i in range(0, same, 4096) if old[i : i + 4096] != data[i : i + 4096]), same)
        return self.edit(min(start, same), len(old), data[min(start, same) :])

    # --- asking

    def includes(self) -> list[syntax.Include]:
        return [node for block in self.text.blocks if b"include" in block.data for node in facts_of(block).includes]

    def included_paths(self, offset: int | None = None) -> list[tuple[Place, Path]]:
        """The quoted names of included files with the paths that they stand for; only those in the block at
        ``offset`` where one is given."""
        found = []
        pairs = zip(self.text.blocks, self.text.starts) if offset is None else [self.text.block_at(offset)]
        for block, base in pairs:
            for node in facts_of(block).includes if b"include" in block.data else ():
                path = (self.path.parent if self.path is not None else Path()) / node.path.value
                found.append((Place(self, base + node.path.span.start, base + node.path.span.end), path))
        return found

    def outline(self, first: int = 0, end: int | None = None) -> Iterator[Outline]:
        """Definitions and scene blocks in text order; of the blocks from number ``first`` up to ``end``."""
        for block, base in zip(self.text.blocks[first:end], self.text.starts[first:end]):
            for node in facts_of(block).file.definitions:
                if isinstance(node, syntax.Include):
                    continue
                kind = "block" if isinstance(node, syntax.Block) else ""
                name = node.name
                if not kind:
                    kind = next((d.kind for d in facts_of(block).definitions if d.node is node), "")
                if kind:
                    yield Outline(name.name, kind, base + node.span.start, base + node.span.end,
                                  base + name.span.start, base + name.span.end, node)

    def definition_at(self, offset: int) -> tuple[Definition | None, int]:
        """The definition round ``offset``, and where its block starts (offsets in its syntax count from there)."""
        block, base = self.text.block_at(offset)
        for each in facts_of(block).definitions:
            if each.node.span.start <= offset - base <= each.node.span.end:
                return each, base
        return None, base

    def name_at(self, offset: int) -> tuple[str, Place] | None:
        """The scene name at ``offset`` (or ending there) and its place."""
        for at in (offset, offset - 1):
            if at < 0:
                continue
            block, base = self.text.block_at(at)
            for each in facts_of(block).names:
                if each.start <= offset - base <= each.end and each.start <= at - base < each.end:
                    return each.name, Place(self, base + each.start, base + each.end, each.role)
        return None

    def node_at(self, offset: int) -> tuple[Node, int]:
        """The smallest syntax tree node at ``offset``, and where its block starts (its bytes count from there)."""
        block, base = self.text.block_at(offset)
        at = offset - base
        root = facts_of(block).tree.root_node
        return root.descendant_for_byte_range(at, at) or root, base

    def trees(self) -> Iterator[tuple[Node, int, Block]]:
        """Each block's tree (its root) and where the block starts."""
        for block, base in zip(self.text.blocks, self.text.starts):
            yield facts_of(block).tree.root_node, base, block
