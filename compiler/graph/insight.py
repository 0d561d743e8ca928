"""The facts that insights.py finds, as data: what an editor shows beside a scene's text.

Light to import: a language server has them without the graph that they are made of. ``span`` is None while they travel
between processes.

Example: ``GuardInsight(span, path=10, total=(1023, 1023))`` of ``if (cntTree > 0)`` in Figure 2.1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ..reading.source import Span

Count = int | None  # None: without end


@dataclass(slots=True)
class SymbolInsight:
    """Of the largest instance of a symbol: ``primitives`` least and most (None: without end), by shape in ``kinds``,
    ``expected`` where draws decide (None where unknown). ``depth``: symbols entered on the longest path below, itself
    included (None: without end). ``scale``: least and most mean scale (cube root of the volume's) from one
    level of its recursion to the next, None where it isn't recursive. ``instances``: how often it is entered from
    outside of its recursion (or at all, where that never happens), least and most; ``alike`` says that all of those have the same primitives."""

    name: str
    span: Span | None
    primitives: tuple[Count, Count]
    kinds: dict[str, tuple[Count, Count]]
    expected: float | None
    depth: int | None
    scale: tuple[float, float] | None
    instances: tuple[Count, Count]
    alike: bool


@dataclass(slots=True)
class GuardInsight:
    """``path``: how often the guard holds on the longest path; ``total``: least and most in the whole scene. None is
    without end."""

    span: Span | None
    path: int | None
    total: tuple[Count, Count]


@dataclass(slots=True)
class ValueInsight:
    """The values of an assignment, an argument or an alternative's share: ``first`` at the level where it is first met,
    ``last`` at the deepest, ``low`` and ``high`` of all. Where a draw has a part in them, where one of the two levels
    has several, or where there is no deepest one, they aren't ``certain``: only the bounds mean anything."""

    kind: str
    name: str
    span: Span | None
    first: float
    last: float
    low: float
    high: float
    certain: bool


@dataclass
class Insights:
    symbols: list[SymbolInsight] = field(default_factory=list)
    guards: list[GuardInsight] = field(default_factory=list)
    values: list[ValueInsight] = field(default_factory=list)
