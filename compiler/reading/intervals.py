"""Intervals of numbers, and those that parameters lie in wherever they are assigned.

A model's assignments are taken together, whatever the order and the path in which they run: so what is said of a
parameter holds everywhere. Named constants and inputs may be anything, since they are there to be changed.

Example: of ``n = 5`` and ``--n`` the interval is all up to 5; of ``k = 2 + rand(0)`` it is from 2 to 3.
"""

from __future__ import annotations

import math
import re
from typing import Any, Callable, Iterable, NamedTuple

from .model import Apply, Assign, Calculate, Constant, Expression, Read
from .walk import components, reads

# Memory.ask
Ask = Callable[..., Any]

_NUMBER = re.compile(r"-?[\d.]+(?:[eE][-+]?\d+)?|(?:\+\+|--).*|.*(?:\+\+|--)\s*;?", re.DOTALL)
# An end that an assignment still moves after so many rounds is taken to move for ever.
ROUNDS = 3


class Interval(NamedTuple):
    """From ``low`` to ``high``; an end may be left out."""

    low: float = -math.inf
    low_open: bool = False
    high: float = math.inf
    high_open: bool = False

    def and_(self, operation: str, bound: float) -> Interval:
        """The part of the interval where ``value operation bound`` holds."""
        low, high = (self.low, self.low_open), (self.high, not self.high_open)
        if operation in ("greater", "greater_equal", "equal"):
            low = max(low, (bound, operation == "greater"))
        if operation in ("less", "less_equal", "equal"):
            high = min(high, (bound, operation != "less"))
        return Interval(low[0], low[1], high[0], not high[1])

    @property
    def is_empty(self) -> bool:
        return self.low > self.high or (self.low == self.high and (self.low_open or self.high_open))

    def __str__(self) -> str:
        """``n > 0 and n <= 5`` without the name, which stands for {}."""
        ends = []
        if self.low == self.high:
            return f"{{}} is {self.low:g}"
        if self.low > -math.inf:
            ends.append(f"{{}} {'>' if self.low_open else '>='} {self.low:g}")
        if self.high < math.inf:
            ends.append(f"{{}} {'<' if self.high_open else '<='} {self.high:g}")
        return " and ".join(ends)

    def joined(self, other: Interval) -> Interval:
        """The least closed interval that holds both."""
        return Interval(min(self.low, other.low), False, max(self.high, other.high), False)


ALL = Interval()


def intervals_of(ask: Ask, *calculations: Calculate) -> dict[str, Interval]:
    """Of each parameter that is assigned: where its values lie. Parameters whose values go round (``n`` in ``--n``, or several
    through each other) are worked out together, after all that goes into them; what stays the same there isn't followed
    further."""
    assigned: dict[str, list[Assign]] = {}
    for operator in calculations:
        for name, several in ask(assigns_of, operator).items():
            assigned.setdefault(name, []).extend(several)
    found: dict[str, Interval] = {}
    read = {name: {other for each in several for other in reads(each.value)} for name, several in assigned.items()}
    for component in components(read):
        names = sorted(component)
        outside = sorted({other for name in names for other in read[name] if other not in component and other in found})
        statements = [each for name in names for each in assigned[name]]
        found.update(ask(joined_intervals, *statements, given=tuple((name, found[name]) for name in outside)))
    return found


def assigns_of(operator: Calculate) -> dict[str, list[Assign]]:
    found: dict[str, list[Assign]] = {}
    for statement in operator.statements:
        if isinstance(statement, Assign):
            found.setdefault(statement.parameter, []).append(statement)
    return found


def joined_intervals(*given: Assign | tuple[str, Interval]) -> dict[str, Interval]:
    """The intervals of the parameters that some statements assign, which need only each other and those that are given."""
    assigned = [each for each in given if isinstance(each, Assign)]
    known = dict(each for each in given if not isinstance(each, Assign))
    readers: dict[str, list[Assign]] = {}
    for statement in assigned:
        for name in reads(statement.value):
            readers.setdefault(name, []).append(statement)
    found: dict[str, Interval] = {}
    rounds: dict[int, int] = {}
    waiting = assigned[::-1]
    while waiting:
        statement = waiting.pop()
        name, value = statement.parameter, interval_of(statement.value, {**known, **found})
        if value is None:
            continue
        old = found.get(name, value)
        new = old.joined(value)
        rounds[id(statement)] = rounds.get(id(statement), 0) + 1
        if rounds[id(statement)] > ROUNDS:
            new = _widened(old, new)
        if found.get(name) != new:
            found[name] = new
            waiting += readers.get(name, ())
    return found


def known_of(names: Iterable[str], intervals: dict[str, Interval]) -> tuple[tuple[str, Interval], ...]:
    """The intervals of some parameters, as far as they say anything."""
    return tuple((name, intervals[name]) for name in names if intervals.get(name, ALL) != ALL)


def is_number(constant: Constant) -> bool:
    """Whether it stands there as a number (or as ++ and --, which add 1), and isn't the value of a name."""
    return constant.span is None or _NUMBER.fullmatch(constant.span.text) is not None


def _widened(old: Interval, new: Interval) -> Interval:
    low = old.low if new.low >= old.low else -math.inf
    return Interval(low, False, old.high if new.high <= old.high else math.inf, False)


def interval_of(expression: Expression, known: dict[str, Interval]) -> Interval | None:
    """Where the values of an expression lie; None while a parameter that it reads has no value yet."""
    if isinstance(expression, Constant):
        return Interval(expression.value, False, expression.value, False) if is_number(expression) else ALL
    if isinstance(expression, Read):
        return known.get(expression.parameter)
    assert isinstance(expression, Apply)
    values = [interval_of(argument, known) for argument in expression.arguments]
    if None in values:
        return None
    return _applied(expression.operation, values)


def _applied(operation: str, values: list[Interval]) -> Interval:
    """Rounding keeps the order of numbers, so that the ends of sums and products are those of their rounded values."""
    if operation in ("rand", "hash"):
        return Interval(0.0, False, 1.0, False)
    if operation == "negate":
        return Interval(-values[0].high, False, -values[0].low, False)
    if operation == "select":
        return values[1].joined(values[2])
    if operation in ("floor", "ceil", "round") and all(map(math.isfinite, (values[0].low, values[0].high))):
        return Interval(math.floor(values[0].low), False, math.ceil(values[0].high), False)
    if operation in ("add", "subtract", "multiply") and len(values) == 2:
        a, b = values
        if operation == "add":
            ends = (a.low + b.low, a.high + b.high)
        elif operation == "subtract":
            ends = (a.low - b.high, a.high - b.low)
        else:
            ends = _span([x * y for x in (a.low, a.high) for y in (b.low, b.high)])
        return ALL if any(map(math.isnan, ends)) else Interval(ends[0], False, ends[1], False)
    if operation in ("min", "max"):
        choose = min if operation == "min" else max
        return Interval(choose(v.low for v in values), False, choose(v.high for v in values), False)
    return ALL


def _span(values: Iterable[float]) -> tuple[float, float]:
    values = list(values)
    return (math.nan, math.nan) if any(map(math.isnan, values)) else (min(values), max(values))
