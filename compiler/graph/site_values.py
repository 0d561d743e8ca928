"""The values that a derivation meets at one place of the text: first, last, least and greatest.

Example: at ``--n`` of a counter from 3 the values are 2 at the first level, then 1, and 0 at the last.
"""

from __future__ import annotations

import math

from .insight import ValueInsight
from .observe import Site
from .ranges import Range, Value


class SiteValues:
    """The values noted at one site, with those of its first and its last level; ``drawn`` says that a draw has a part
    in them."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self.low, self.high, self.drawn = math.inf, -math.inf, False
        self.earliest: float = math.inf
        self.latest: float = -1
        self.first: set[Value] = set()
        self.last: set[Value] = set()

    def note(self, value: Value, earliest: int, latest: int | None) -> None:
        low, high = value if isinstance(value, Range) else (value, value)
        self.drawn |= isinstance(value, Range)
        self.low, self.high = min(self.low, low), max(self.high, high)
        if earliest < self.earliest:
            self.earliest, self.first = earliest, set()
        if earliest == self.earliest:
            self.first.add(value)
        depth = math.inf if latest is None else latest
        if depth > self.latest:
            self.latest, self.last = depth, set()
        if depth == self.latest:
            self.last.add(value)

    def insight(self) -> ValueInsight:
        certain = not self.drawn and len(self.first) == len(self.last) == 1
        certain &= self.latest < math.inf or self.low == self.high
        first, last = (next(iter(values)) if certain else math.nan for values in (self.first, self.last))
        return ValueInsight(*self.site, first, last, self.low, self.high, certain)
