"""A document's white space as it should be: the formatter, block by block.

A block with a syntax error is left as it is. What was found out about a block is kept with it, so that formatting after
an edit costs the blocks that it touched.

Example::

    formatted = format_document(document)
    formatted.edits         # [Edit(120, 122, b" "), …], in text order
    formatted.skipped       # [Block, …]: those with syntax errors
    formatted.data          # the whole text
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Iterator

from ..formatting import Edit, apply, format_tree
from .document import Document
from .facts import facts_of
from .text import Block

# So many blocks whose format is known are left behind in a step: as long as finding that of one takes.
KNOWN_BLOCKS = 256


@dataclass(frozen=True, slots=True)
class Formatted:
    """``edits`` have the document's offsets."""

    document: Document
    edits: list[Edit]
    skipped: list[Block]

    @property
    def data(self) -> bytes:
        return apply(self.document.text.data, self.edits)


def format_document(document: Document, start: int = 0, end: int | None = None) -> Formatted:
    """What formats ``document``; of bytes ``start`` to ``end``, the lines that they are part of."""
    text = document.text
    end = len(text) if end is None else end
    first, last = text.index_at(start), text.index_at(max(start, end))
    line_end = line_end_of(document)
    edits: list[Edit] = []
    skipped = []
    blocks = zip(text.blocks[first : last + 1], text.starts[first:])
    for index, (block, base) in enumerate(blocks, first):
        if facts_of(block).is_broken:
            skipped.append(block)
            continue
        found = _edits_of(block, line_end, index == 0, index + 1 == len(text.blocks))
        edits += [Edit(base + edit.start, base + edit.end, edit.data) for edit in found]
    if start > 0 or end < len(text):
        low, high = text.line_start(text.line_of(start)), text.line_start(text.line_of(end) + 1)
        edits = [
            _within(edit, low) for edit in edits if low <= edit.end < high or edit.end == high == len(text)
        ]
    return Formatted(document, edits, skipped)


def preparing_format(document: Document) -> Iterator[None]:
    """Finds out step by step what formats the blocks of ``document``, so that formatting it has little left to do."""
    line_end, blocks = line_end_of(document), list(document.text.blocks)
    for index, block in enumerate(blocks):
        if "formatted" not in block.__dict__ and not facts_of(block).is_broken:
            _edits_of(block, line_end, index == 0, index + 1 == len(blocks))
            yield
        elif index % KNOWN_BLOCKS == 0:
            yield


def line_end_of(document: Document) -> bytes:
    """What ends the document's first line."""
    ends = (
        block.data[max(0, start - 2) : start]
        for block in document.text.blocks
        for start in block.line_starts[1:2]
    )
    first = next(ends, b"\n")
    return first if first == b"\r\n" else first[-1:]


def _edits_of(block: Block, line_end: bytes, is_first: bool, is_last: bool) -> list[Edit]:
    key = (line_end, is_first, is_last)
    kept = block.__dict__.get("formatted")
    if kept is None or kept[0] != key:
        found = format_tree(block.data, facts_of(block).tree.root_node, *key)
        kept = block.__dict__["formatted"] = key, found
    return kept[1]


def _within(edit: Edit, low: int) -> Edit:
    """Of an edit of the gap before a line that starts at ``low``, the line's indentation."""
    if edit.start >= low:
        return edit
    return Edit(low, edit.end, edit.data[len(edit.data.rstrip(b" ")) :])
