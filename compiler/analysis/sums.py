"""Where each of many pieces starts, kept up to date when pieces are exchanged.

Sums of sizes in a list with a *gap*: what lies behind it lacks a shift that is added when it is looked at. An exchange moves
the gap to its place, so that edits in any direction through a file cost the way between them, not the rest of the file at
each. (The technique of Scintilla's `Partitioning`.)

Example::

    sums = Sums()
    sums.exchange(0, 0, [5, 7, 2])
    sums.find(6), sums[2]           # 1, 12: the byte 6 is in piece 1; piece 2 starts at 12
    sums.exchange(0, 1, [6])        # piece 0 has become longer
    sums[2]                         # 13
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
from typing import Iterable


class Sums:
    """``sums[i]`` is where piece ``i`` starts; after the last piece comes the sum of all."""

    def __init__(self) -> None:
        self._sums = [0]
        self._gap = 0  # the sums behind this one lack the shift
        self._shift = 0

    def __getitem__(self, index: int) -> int:
        return self._sums[index] + (self._shift if index > self._gap else 0)

    @property
    def total(self) -> int:
        return self[len(self._sums) - 1]

    def all(self) -> list[int]:
        """All sums as a list, valid up to the next exchange."""
        self._move(len(self._sums) - 1)
        return self._sums

    def find(self, value: int) -> int:
        """The piece that holds ``value``: the last one that starts at or before it."""
        sums, behind = self._sums, self._gap + 1
        if behind < len(sums) and sums[behind] + self._shift <= value:
            return bisect_right(sums, value - self._shift, behind) - 1
        return bisect_right(sums, value, 0, behind) - 1

    def exchange(self, low: int, high: int, sizes: Iterable[int]) -> None:
        """Pieces of ``sizes`` take the place of those from ``low`` up to ``high``."""
        self._move(low)
        after = self[high]
        new = list(accumulate(sizes, initial=self._sums[low]))
        self._sums[low : high + 1] = new
        self._gap = low + len(new) - 1
        self._shift += new[-1] - after

    def grow(self, index: int, by: int) -> None:
        """Piece ``index`` has become longer ``by`` so much."""
        self._move(index)
        self._shift += by

    def _move(self, index: int) -> None:
        gap, shift = self._gap, self._shift
        if shift:
            if index > gap:
                self._sums[gap + 1 : index + 1] = [each + shift for each in self._sums[gap + 1 : index + 1]]
            else:
                self._sums[index + 1 : gap + 1] = [each - shift for each in self._sums[index + 1 : gap + 1]]
        self._gap = index
