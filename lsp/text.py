"""Positions of the protocol ⇄ offsets in a document.

LSP counts lines from 0 and characters in code units of an encoding that client and server agree on; a document counts
bytes of UTF-8. Lines end with LF, CRLF or a lone CR, and with nothing else.

Example::

    positions = Positions(document.text, "utf-16")
    positions.offset(3, 14)             # the byte of line 3, UTF-16 unit 14
    positions.range(120, 124)           # {"start": {"line": 3, "character": 14}, "end": …}
"""

from __future__ import annotations

from typing import NamedTuple

from plsys.compiler.analysis import Text

ENCODINGS = ("utf-8", "utf-16", "utf-32")


class Edit(NamedTuple):
    """Bytes ``start`` to ``end`` become ``data``."""

    start: int
    end: int
    data: bytes


def byte_column(line: bytes, character: int, encoding: str) -> int:
    """The byte of ``line`` (without its end) at ``character``; the line's length where it has fewer. A place inside of
    a character is that character's start."""
    if character <= 0:
        return 0
    if encoding == "utf-8":
        column = min(character, len(line))
        while column < len(line) and column > 0 and line[column] & 0xC0 == 0x80:
            column -= 1
        return column
    if line.isascii():
        return min(character, len(line))
    text = line.decode(errors="surrogateescape")
    if encoding == "utf-16":
        units = text.encode("utf-16-le", "surrogatepass")[: 2 * character]
        prefix = units.decode("utf-16-le", "surrogatepass" if _ends_whole(units) else "ignore")
    else:
        prefix = text[:character]
    return len(prefix.encode(errors="surrogateescape"))


def _ends_whole(units: bytes) -> bool:
    """Whether UTF-16 text doesn't end with the first half of a pair."""
    return len(units) < 2 or not 0xD8 <= units[-1] <= 0xDB


def units(text: bytes, encoding: str) -> int:
    """How many code units of ``encoding`` the UTF-8 ``text`` is."""
    if encoding == "utf-8":
        return len(text)
    decoded = text.decode(errors="surrogateescape")
    return len(decoded) if encoding == "utf-32" else len(decoded.encode("utf-16-le", "surrogatepass")) // 2


def encode(text: str) -> bytes:
    """UTF-8 of a text from the client. Half a surrogate pair, which JSON can hold and UTF-8 can't, becomes U+FFFD, which
    is as long in UTF-16."""
    try:
        return text.encode()
    except UnicodeEncodeError:
        whole = text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", errors="replace")
        return whole.encode()


class Positions:
    """Converts positions of one text."""

    def __init__(self, text: Text, encoding: str) -> None:
        self.text, self.encoding = text, encoding

    def offset(self, line: int, character: int) -> int:
        """The offset of a position; one outside of the text is taken to be at its nearest end."""
        if line < 0:
            return 0
        offset, text = self.text.line(line)
        return offset + byte_column(text, character, self.encoding)

    def position(self, offset: int) -> dict:
        return self._position(*self.text.locate(offset))

    def _position(self, line: int, before: bytes) -> dict:
        return {"line": line, "character": len(before) if before.isascii() else units(before, self.encoding)}

    def range(self, start: int, end: int) -> dict:
        first, last = self.text.locate_both(start, end)
        return {"start": self._position(*first), "end": self._position(*last)}

    def offsets(self, range_: dict) -> tuple[int, int]:
        """Start and end of a protocol's range."""
        start, end = range_["start"], range_["end"]
        first = self.offset(start["line"], start["character"])
        if start == end:
            return first, first
        return first, max(first, self.offset(end["line"], end["character"]))

    def edit(self, change: dict) -> Edit:
        """One element of didChange's ``contentChanges``; without a range it is the whole text."""
        data = encode(change["text"])
        if change.get("range") is None:
            return Edit(0, len(self.text), data)
        return Edit(*self.offsets(change["range"]), data)

