"""A file's text → the top-level pieces that can be read on their own.

A piece starts where a definition starts in the first column: at a reserved word (`Selection`, `#declare` …: *hard*,
because nothing can contain one) or at `name {` (*soft*: it may also stand inside of a block that isn't indented).
Comments, strings and braces are looked at, nothing else, so that the split costs a fraction of a parse and a piece
depends on its own text only. :func:`group` then joins soft pieces that lie inside a block which a later one closes.

Example: ``camera { }\\nSelection A\\n{ A -> box; }\\n`` is two pieces; ``union {\\nbox { }\\n}\\n`` is three, and after
grouping one.
"""

from __future__ import annotations

import re
from typing import NamedTuple, Sequence

_TOKEN = re.compile(
    rb"""
    (?P<line>//[^\r\n]*)
  | (?P<comment>/\*)
  | (?P<string>"(?:[^"\\\r\n]|\\[^\r\n])*\\?"?)
  | (?P<brace>[{}])
  | (?<=[\r\n])(?P<hard>(?:Selection|Calculation|Transformation|Parameter)\b|\#[ \t]*(?:declare|local|include)\b)
  | (?<=[\r\n])(?P<soft>[A-Za-z_]\w*(?=\s*(?:[A-Za-z_]\w*\s*)?\{))
    """,
    re.VERBOSE,
)
_HARD_START = re.compile(rb"(?:Selection|Calculation|Transformation|Parameter)\b|#[ \t]*(?:declare|local|include)\b")


class Shape(NamedTuple):
    """What of a piece matters to its neighbours. ``depth`` is the number of braces it leaves open (negative: it closes
    more than it opens), ``low`` the lowest depth on the way, and ``comment`` says that a comment in it never ends."""

    hard: bool
    low: int
    depth: int
    comment: bool

    def then(self, other: Shape) -> Shape:
        """The shape of this piece and ``other`` as one."""
        low = min(self.low, self.depth + other.low)
        return Shape(self.hard, low, self.depth + other.depth, self.comment or other.comment)


class Piece(NamedTuple):
    start: int
    end: int
    shape: Shape


def is_hard(data: bytes) -> bool:
    """Whether a text begins with a word that nothing can contain."""
    return _HARD_START.match(data) is not None


def split(data: bytes) -> list[Piece]:
    """The pieces of ``data``, which cover it without gaps. A comment that nothing ends counts as its opener only."""
    pieces: list[Piece] = []
    comments: dict[int, int] = {}  # where each comment ends → where it starts
    start = at = depth = low = 0
    hard, comment = is_hard(data), False
    while (match := _TOKEN.search(data, at)) is not None:
        kind, at = match.lastgroup, match.end()
        if kind == "brace":
            depth += 1 if data[match.start()] == 0x7B else -1
            low = min(low, depth)
        elif kind == "line":
            comments[at] = match.start()
        elif kind == "comment":
            end = data.find(b"*/", at)
            if end < 0:
                comment = True
            else:
                at = end + 2
                comments[at] = match.start()
        elif kind == "hard" or (kind == "soft" and _is_complete(data, start, match.start(), comments)):
            pieces.append(Piece(start, match.start(), Shape(hard, low, depth, comment)))
            start, depth, low, comment = match.start(), 0, 0, False
            hard = kind == "hard"
    pieces.append(Piece(start, len(data), Shape(hard, low, depth, comment)))
    return pieces


def _is_complete(data: bytes, start: int, end: int, comments: dict[int, int]) -> bool:
    """Whether the piece ``data[start:end]`` may be over. ``#declare Bark =`` isn't: a block belongs to it."""
    while end > start:
        stripped = len(data[max(start, end - 256) : end].rstrip())
        stripped += max(start, end - 256)
        if stripped in comments and comments[stripped] >= start:
            end = comments[stripped]
        elif stripped == end or data[stripped - 1 : stripped].strip():
            return stripped <= start or data[stripped - 1] in b'};"'
        else:
            end = stripped
    return True


def group(shapes: Sequence[Shape]) -> list[int]:
    """Which pieces belong together: for each piece of ``shapes``, how many pieces it is one with, itself included.

    A piece that leaves braces open takes the soft pieces after it up to the one that closes them. If a hard piece or
    the end comes first, the brace is never closed and the pieces stay apart, so that it costs its neighbours nothing.
    The list holds 0 for pieces that an earlier one took."""
    counts: list[int] = []
    i = 0
    while i < len(shapes):
        taken, depth = 1, shapes[i].depth
        if depth > 0:
            j = i + 1
            while j < len(shapes) and not shapes[j].hard:
                if depth + shapes[j].low <= 0:
                    taken = j - i + 1
                    break
                depth += shapes[j].depth
                j += 1
        counts += [taken] + [0] * (taken - 1)
        i += taken
    return counts
