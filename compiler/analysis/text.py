"""A file's text as a list of blocks, kept up to date by edits.

A :class:`Block` is a top-level piece of the file with a text of its own; all that is known about it (syntax tree,
names, messages) has offsets inside of it, so that an edit moves later blocks without touching them. A
:class:`Text` joins the blocks to a file: it finds a block by offset or line, and an edit splits again only the text
that it touched.

Example::

    text = Text("tree.plsys", path, b"camera { }\\nobject { Tree }\\n")
    change = text.replace(20, 24, b"Bush")      # → Change(removed=[Block], added=[Block])
    text.line_of(11)                            # 1: lines count from 0
"""

from __future__ import annotations

import re
from bisect import bisect_right
from pathlib import Path
from typing import NamedTuple

from ..reading.records import lazy_property
from ..reading.source import Source
from .split import Piece, Shape, group, is_hard, split
from .sums import Sums

_LINE_END = re.compile(rb"\r\n|\n|\r")

# Bytes that begin and end no comment, string, block, definition or line; and such with one more at each side which they make
# nothing else of.
_PLAIN = re.compile(rb"[\w ().,:<>=+|-]*")
_AMID_PLAIN = re.compile(rb"[\w ().,:<>=+|{};-][\w ().,:<>=+|-]*[\w ().,:<>=+|{};\r\n-]")

# Where a definition is complete, and nothing but comments (about the next one, mostly) follows; or the text's end.
_CODE_END = re.compile(rb"[};](?=(?:\s|//[^\r\n]*(?=[\r\n]|\Z)|/\*(?:[^*]|\*(?!/))*\*/)*\Z)|.\Z", re.DOTALL)

# A definition that lacks its name.
_NAMELESS = re.compile(rb"[A-Za-z_]\w*\s*\{")

# A line on which another piece might begin: see split.py.
_HEAD_LINE = re.compile(rb"[\r\n][A-Za-z_#]")


class Block(Source):
    """One top-level piece of a file: a definition as a rule, or some that can't be told apart.

    A block is never changed; an edit replaces it. ``before`` is the block that it replaced, if it replaced just one,
    with the edit inside of it as (start, old end, new end)."""

    def __init__(self, name: str, data: bytes, path: Path | None, shape: Shape) -> None:
        self.__dict__.update(name=name, data=data, path=path, shape=shape, before=None, after=None, is_gone=False)

    shape: Shape
    is_gone: bool  # an edit has removed it
    before: tuple[Block, tuple[int, int, int]] | None
    after: Block | None  # the block that replaced this one

    @lazy_property
    def line_starts(self) -> list[int]:
        """Byte offset of each line's first byte in this block."""
        return [0, *(match.end() for match in _LINE_END.finditer(self.data))]

    @property
    def line_ends(self) -> int:
        return len(self.line_starts) - 1

    @lazy_property
    def has_head_lines(self) -> bool:
        """Whether another piece might begin on one of the lines after the first."""
        return _HEAD_LINE.search(self.data) is not None


class Change(NamedTuple):
    """Blocks that went and blocks that came, both in text order."""

    removed: list[Block]
    added: list[Block]


class Text:
    """The bytes of a file. Offsets are bytes, lines and columns count from 0, columns are bytes."""

    def __init__(self, name: str, path: Path | None, data: bytes) -> None:
        self.name, self.path = name, path
        self.blocks: list[Block] = []
        self._starts, self._lines = Sums(), Sums()  # bytes and line ends before each block
        self._order: dict[Block, int] | None = None
        self._loose: list[Block] = []  # blocks with an open brace or comment: an edit further down may end it
        self._put(0, 0, data)

    # --- where things are

    @property
    def starts(self) -> list[int]:
        """Where each block starts, and last the length of the text; valid up to the next edit."""
        return self._starts.all()

    @property
    def first_lines(self) -> list[int]:
        """The line on which each block starts, and last the file's last line; valid up to the next edit."""
        return self._lines.all()

    @property
    def order(self) -> dict[Block, int]:
        """Each block's place among the blocks."""
        if self._order is None:
            self._order = dict(zip(self.blocks, range(len(self.blocks))))
        return self._order

    def __len__(self) -> int:
        return self._starts.total

    @property
    def data(self) -> bytes:
        """The whole text, joined."""
        return b"".join([block.data for block in self.blocks])

    def start_at(self, index: int) -> int:
        """Where block ``index`` starts: for a few blocks of many."""
        return self._starts[index]

    def index_at(self, offset: int) -> int:
        """The index of the block with the byte at ``offset``; at the end of the text, of the last block."""
        return max(0, min(self._starts.find(offset), len(self.blocks) - 1))

    def block_at(self, offset: int) -> tuple[Block, int]:
        """The block with the byte at ``offset``, and where in the file it starts."""
        index = self.index_at(offset)
        return self.blocks[index], self._starts[index]

    def start_of(self, block: Block) -> int | None:
        """Where ``block`` starts in the file, None if it is no longer part of it."""
        index = self.order.get(block)
        return None if index is None else self._starts[index]

    # --- lines

    @property
    def line_count(self) -> int:
        return self._lines.total + 1

    def locate(self, offset: int) -> tuple[int, bytes]:
        """The line with the byte at ``offset``, and that line's text before it."""
        return self.locate_both(offset, offset)[0]

    def locate_both(self, start: int, end: int) -> tuple[tuple[int, bytes], tuple[int, bytes]]:
        """As ``locate``, of the two ends of a range: mostly of one line, which is found once."""
        index = self.index_at(start)
        block, base = self.blocks[index], self._starts[index]
        starts, inside = block.line_starts, start - base
        line = bisect_right(starts, inside) - 1
        low, number = starts[line], self._lines[index] + line
        first = number, block.data[low:inside].rstrip(b"\r\n")
        if start == end:
            return first, first
        high = starts[line + 1] if line + 1 < len(starts) else len(block.data)
        if end < base + high:
            return first, (number, block.data[low : end - base].rstrip(b"\r\n"))
        return first, self.locate(end)

    def line_of(self, offset: int) -> int:
        return self.locate(offset)[0]

    def _index_of_line(self, line: int) -> int:
        return min(self._lines.find(line), len(self.blocks) - 1)

    def line(self, line: int) -> tuple[int, bytes]:
        """The offset of a line's first byte, and its text without the line end; of lines past the end, the text's
        length and nothing."""
        index = self._index_of_line(line)
        block, inside = self.blocks[index], line - self._lines[index]
        starts, data = block.line_starts, block.data
        if inside + 1 < len(starts):
            text = data[starts[inside] : starts[inside + 1]]
        elif inside < len(starts):
            text = data[starts[inside] :]
        else:
            return len(self), b""
        return self._starts[index] + starts[inside], text.rstrip(b"\r\n")

    def line_start(self, line: int) -> int:
        return self.line(line)[0]

    def line_bytes(self, line: int) -> bytes:
        return self.line(line)[1]

    def slice(self, start: int, end: int) -> bytes:
        first, last = self.index_at(start), self.index_at(max(start, end - 1))
        base = self._starts[first]
        return b"".join([block.data for block in self.blocks[first : last + 1]])[start - base : end - base]

    # --- edits

    def replace(self, start: int, end: int, data: bytes) -> Change:
        """Put ``data`` in the place of the bytes from ``start`` to ``end``."""
        size = len(self)
        start = max(0, min(start, size))
        end = max(start, min(end, size))
        return self._plain(start, end, data) or self._put(start, end, data)

    def renew(self, block: Block) -> Change:
        """Put an equal block in the place of ``block``: what is known of it holds no longer."""
        change = self._swap(self.order[block], block.data)
        self._loose = [change.added[0] if each is block else each for each in self._loose]
        return change

    def _plain(self, start: int, end: int, data: bytes) -> Change | None:
        """An edit that leaves the block round it as it is to its neighbours, and so needs no look at them. None for one of
        which that isn't clear."""
        index = self.index_at(start)
        block, base = self.blocks[index], self._starts[index]
        old, low, high, shape = block.data, start - base, end - base, block.shape
        if shape.depth or shape.comment or not low or not _PLAIN.fullmatch(data) or not _AMID_PLAIN.fullmatch(old, low - 1, high + 1):
            return None
        # Whether the next block starts where it does is seen at the end of this one.
        may_have_comments = b"/" in old
        end = _CODE_END.search(old).start() if may_have_comments else len(old.rstrip()) - 1  # type: ignore[union-attr]
        if high > end or old[end] not in b"};":
            return None
        new = old[:low] + data + old[high:]
        if not 0 <= old.find(b"{") < low:  # in the head
            if not shape.hard or not is_hard(new):
                return None  # it might be no block any more, or another kind of one
            if (_NAMELESS.match(new) is None) is not (_NAMELESS.match(old) is None):
                return None  # a name in the line before makes `name Selection {` of it, which starts there
        # Plain bytes are no tokens of the split but in the words that begin a line.
        if block.has_head_lines and [piece.shape for piece in split(new)] != [shape]:
            return None
        if new == old:
            return Change([], [])
        change = self._swap(index, new)
        if (starts := block.__dict__.get("line_starts")) is not None:
            behind, by = bisect_right(starts, low), len(new) - len(old)
            change.added[0].__dict__["line_starts"] = starts[:behind] + [each + by for each in starts[behind:]]
        _link(block, change.added[0], low, high, len(data))
        return change

    def _swap(self, index: int, data: bytes) -> Change:
        """Put a block with as many lines and the same shape in the place of one."""
        old = self.blocks[index]
        new = self.blocks[index] = Block(self.name, data, self.path, old.shape)
        new.__dict__["has_head_lines"] = old.has_head_lines
        old.__dict__["is_gone"] = True
        if len(data) != len(old.data):
            self._starts.grow(index, len(data) - len(old.data))
        if self._order is not None:
            self._order[new] = self._order.pop(old)
        return Change([old], [new])

    def _put(self, start: int, end: int, data: bytes) -> Change:
        # A block's boundaries depend on its own start and on how the block before it ends; so one more block on
        # each side is split again, and further ones where a brace or comment is open.
        first, last = self.index_at(start), self.index_at(end)
        low, high = self._loose_before(max(0, first - 1)), min(len(self.blocks), last + 2)
        while low > 0 and not self.blocks[low].shape.hard and b"{" not in self.blocks[low].data:
            low -= 1  # that it starts there is because of the brace in the next one
        while True:
            base = self._starts[low]
            old = b"".join([block.data for block in self.blocks[low:high]])
            new = old[: start - base] + data + old[end - base :]
            pieces = split(new)
            if any(piece.shape.comment for piece in pieces):
                ends = next((i for i in range(high, len(self.blocks)) if b"*/" in self.blocks[i].data), None)
                if ends is not None:
                    high = ends + 1
                    continue
            # Where the block after the edited ones starts no longer, what follows it may start elsewhere too.
            after = len(new) - len(self.blocks[high - 1].data) if high < len(self.blocks) else 0
            if not any(piece.start == after for piece in pieces):
                high = min(len(self.blocks), 2 * high - low)
                continue
            joined, taken = self._joined(pieces, high)
            if not taken:
                break
            high += taken
        change, head = self._exchange(low, high, [(new[piece.start : piece.end], piece.shape) for piece in joined])
        if len(change.removed) == len(change.added) == 1:
            base = self._starts[low + head]
            _link(change.removed[0], change.added[0], start - base, end - base, len(data))
        return change

    def _loose_before(self, low: int) -> int:
        """The first block that must be split again when block ``low`` is: an earlier one with an open comment, or with
        an open brace that only soft blocks follow."""
        waiting = sorted((self.order[block] for block in self._loose), reverse=True) if self._loose else []
        first = low
        for index in waiting:
            if index < first:
                shape = self.blocks[index].shape
                if shape.comment or not any(block.shape.hard for block in self.blocks[index + 1 : first + 1]):
                    first = index
        return first

    def _exchange(self, low: int, high: int, texts: list[tuple[bytes, Shape]]) -> tuple[Change, int]:
        """Put blocks with ``texts`` in the place of ``blocks[low:high]``, keeping those whose text is the same; also
        how many at the head were kept."""
        old = self.blocks[low:high]
        same = min(len(old), len(texts))
        head = next((i for i in range(same) if old[i].data != texts[i][0]), same)
        same -= head
        tail = next((i for i in range(same) if old[-1 - i].data != texts[-1 - i][0]), same)
        added = [Block(self.name, data, self.path, shape) for data, shape in texts[head : len(texts) - tail]]
        removed = old[head : len(old) - tail]
        self.blocks[low + head : high - tail] = added
        self._starts.exchange(low + head, high - tail, [len(block.data) for block in added])
        self._lines.exchange(low + head, high - tail, [block.line_ends for block in added])
        if self._order is not None and len(added) == len(removed):
            for index, (block, new) in enumerate(zip(removed, added), low + head):
                del self._order[block]
                self._order[new] = index
        else:
            self._order = None
        for block in removed:
            block.__dict__["is_gone"] = True
        if self._loose:
            self._loose = [block for block in self._loose if not block.is_gone]
        self._loose += [block for block in added if block.shape.depth > 0 or block.shape.comment]
        return Change(removed, added), head

    def _joined(self, pieces: list[Piece], high: int) -> tuple[list[Piece], int]:
        """Pieces that belong together as one, and how many of the blocks from ``high`` on belong to them too."""
        if all(piece.shape.depth <= 0 for piece in pieces):
            return pieces, 0
        shapes = [piece.shape for piece in pieces]
        counts = group([*shapes, *(block.shape for block in self.blocks[high:])])[: len(pieces)]
        joined: list[Piece] = []
        for i, count in enumerate(counts):
            if i + count > len(pieces):
                return pieces, i + count - len(pieces)
            if count:
                shape = shapes[i]
                for other in shapes[i + 1 : i + count]:
                    shape = shape.then(other)
                joined.append(Piece(pieces[i].start, pieces[i + count - 1].end, shape))
        return joined, 0


def _link(old: Block, new: Block, start: int, end: int, length: int) -> None:
    """Remember how one block became the other: by ``length`` bytes in the place of start to end."""
    if 0 <= start and end <= len(old.data):
        new.__dict__["before"] = (old, (start, end, start + length))
    old.__dict__.update(after=new, before=None)  # one step of history is enough
