"""Bytes → numbers, trusting nothing: every read is bounded by its section, every count by the bytes that are left.

Example::

    reader = Reader(data, 28, len(data), "bytecode")
    reader.u()              # an unsigned LEB128 number
    reader.index(3, "node") # one below 3, or BytecodeError("node 7, but there are 3", "bytecode")
"""

from __future__ import annotations

import math
import struct

from ..reading.diagnostics import PlsysError

MAX_U = 2**32 - 1


class BytecodeError(PlsysError):
    """Bytes that aren't valid bytecode: ``place`` is the section, ``reason`` what is wrong with it."""


class Reader:
    def __init__(self, data: bytes, start: int, end: int, section: str) -> None:
        self.data, self.at, self.end, self.section = data, start, end, section

    def fail(self, reason: str) -> BytecodeError:
        return BytecodeError(reason, self.section)

    @property
    def left(self) -> int:
        return self.end - self.at

    def u(self) -> int:
        """An unsigned LEB128 number of at most 32 bits, in its shortest form."""
        value = 0
        for i in range(5):
            if self.at >= self.end:
                raise self.fail("ends in the middle of a number")
            byte = self.data[self.at]
            self.at += 1
            value |= (byte & 0x7F) << 7 * i
            if byte & 0x80:
                continue
            if (i > 0 and byte == 0) or value > MAX_U:
                break
            return value
        raise self.fail("has a number that isn't in its shortest form or has more than 32 bits")

    def index(self, limit: int, what: str) -> int:
        index = self.u()
        if index >= limit:
            raise self.fail(f"{what} {index}, but there are {limit}")
        return index

    def count(self, size: int) -> int:
        """How many elements follow, each of at least ``size`` bytes."""
        count = self.u()
        if count > self.left // size:
            raise self.fail(f"says it has {count} elements, more than fit into its bytes")
        return count

    def take(self, length: int) -> bytes:
        if length > self.left:
            raise self.fail("ends too early")
        self.at += length
        return self.data[self.at - length : self.at]

    def f64(self) -> float:
        if self.left < 8:
            raise self.fail("ends in the middle of a number")
        (value,) = struct.unpack("<d", self.take(8))
        if not math.isfinite(value):
            raise self.fail("has a number that is NaN or infinite")
        return value
