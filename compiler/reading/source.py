"""Source texts and places in them.

A :class:`Source` is one file's bytes; a :class:`Span` is a half-open byte range of it. Everything that the
reader makes (tokens, tree nodes, diagnostics) carries a span, and only this module turns bytes into lines and
columns.

Example::

    source = Source.read("scenes/tree.plsys")
    span = Span(source, 0, 15)
    span.start_position          # Position(line=1, column=1)
    span.text                    # 'global_settings'
"""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from .records import record


class Position(NamedTuple):
    """A place as people count it: ``line`` from 1, ``column`` in characters (code points) from 1."""

    line: int
    column: int


@dataclass(frozen=True, eq=False)
class Source:
    """One text: ``name`` as shown in messages, ``data`` as UTF-8 bytes, ``path`` where it has a file."""

    name: str
    data: bytes
    path: Path | None = None

    @classmethod
    def read(cls, path: str | Path) -> Source:
        """The file at ``path``. Raises OSError; bytes that aren't UTF-8 are left for the parser to report."""
        return cls(str(path), Path(path).read_bytes(), Path(path))

    @classmethod
    def from_text(cls, text: str, name: str = "<text>") -> Source:
        return cls(name, text.encode())

    @cached_property
    def line_starts(self) -> list[int]:
        """Byte offset of each line's first byte. Lines end with LF, CRLF or a lone CR."""
        starts = [0]
        data = self.data
        i = 0
        while True:
            newline, carriage = data.find(b"\n", i), data.find(b"\r", i)
            ends = [end for end in (newline, carriage) if end >= 0]
            if not ends:
                return starts
            end = min(ends)
            i = end + (2 if data[end : end + 2] == b"\r\n" else 1)
            starts.append(i)

    def position(self, offset: int) -> Position:
        """Line and column of the byte at ``offset`` (clamped to the text)."""
        offset = max(0, min(offset, len(self.data)))
        line = bisect.bisect_right(self.line_starts, offset)
        start = self.line_starts[line - 1]
        return Position(line, len(_text(self.data[start:offset])) + 1)

    def line_text(self, line: int) -> str:
        """The text of ``line`` (from 1) without its line end."""
        start = self.line_starts[line - 1]
        end = self.line_starts[line] if line < len(self.line_starts) else len(self.data)
        return _text(self.data[start:end]).rstrip("\r\n")


def _text(line: bytes) -> str:
    """What a line shows: a byte order mark at the start of a file is no character of it."""
    return line.decode(errors="replace").removeprefix("\ufeff")


@record(eq=False)
class Span:
    """The bytes ``[start, end)`` of ``source``."""

    source: Source = field(repr=False)
    start: int
    end: int

    @property
    def text(self) -> str:
        return self.source.data[self.start : self.end].decode(errors="replace")

    @property
    def start_position(self) -> Position:
        return self.source.position(self.start)

    @property
    def end_position(self) -> Position:
        """The place just after the last character."""
        return self.source.position(self.end)

    def to(self, other: Span) -> Span:
        """The smallest span of this source that covers both."""
        return Span(self.source, min(self.start, other.start), max(self.end, other.end))

    def __str__(self) -> str:
        line, column = self.start_position
        return f"{self.source.name}:{line}:{column}"
