"""Guards that can't hold because of the guards before them.

On the way to a guard, the tests before it say in which interval each parameter lies. A comparison with a constant that no
value there meets is reported.

Example: in ``if (n > 0) A -> x; else if (n > 5) A -> y;`` the second guard never holds: n is at most 0 there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .diagnostics import Diagnostics
from .evaluate import NotFinite, fold
from .model import Apply, Branch, Constant, Expression, Model, Production, Read
from .walk import decided, seed_of

_OPPOSITE = {
    "less": "greater_equal", "greater_equal": "less", "greater": "less_equal", "less_equal": "greater",
    "equal": "not_equal", "not_equal": "equal",
}  # fmt: skip
_MIRRORED = {
    "less": "greater",
    "greater": "less",
    "less_equal": "greater_equal",
    "greater_equal": "less_equal",
}


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


Intervals = dict[str, Interval]
Comparison = tuple[str, str, float]  # parameter, operation, bound


def check_guards(model: Model, diagnostics: Diagnostics) -> None:
    """Report guards that what stands before them rules out."""
    checker = _Guards(seed_of(model), diagnostics)
    for symbol in model.symbols.values():
        checker.follow(symbol.production, {})


class _Guards:
    def __init__(self, seed: float, diagnostics: Diagnostics) -> None:
        self.seed, self.diagnostics = seed, diagnostics

    def follow(self, production: Production, known: Intervals) -> None:
        """Look at the guards of ``production``, where the parameters lie in the intervals ``known``."""
        # A loop for the else parts: chains of rules are long, nested guards aren't.
        while isinstance(production, Branch):
            test = production.test
            then = self.narrowed(test, True, known)
            if then is None:
                self.report(test, known)
            elif then is not known:
                self.follow(production.then, then)
            else:
                self.follow(production.then, known)
            known = self.narrowed(test, False, known) or known
            production = production.otherwise

    def report(self, test: Expression, known: Intervals) -> None:
        if test.span is None or decided(test, self.seed) is not None:
            return
        names = sorted({part[0] for part in self.comparisons(test, True) if part[0] in known})
        told = "; ".join(str(known[name]).format(*[f"'{name}'"] * 2) for name in names)
        self.diagnostics.add("constant-guard", test.span, f"this guard is always false: here {told}",
                             "the guards before it take all other cases; is one of them too wide?")  # fmt: skip

    def narrowed(self, test: Expression, holds: bool, known: Intervals) -> Intervals | None:
        """What is known after the test; None if it can't come out so."""
        found = dict(known)
        for name, operation, bound in self.comparisons(test, holds):
            interval = found.get(name, Interval())
            if operation == "not_equal":
                if interval.low == interval.high == bound:
                    return None
                continue
            found[name] = interval.and_(operation, bound)
            if found[name].is_empty:
                return None
        return found

    def comparisons(self, test: Expression, holds: bool) -> list[Comparison]:
        """The comparisons of a parameter with a constant that are sure to hold if the test comes out so."""
        if not isinstance(test, Apply):
            return []
        if test.operation == "not":
            return self.comparisons(test.arguments[0], not holds)
        if (test.operation, holds) in (("and", True), ("or", False)):
            return [each for argument in test.arguments for each in self.comparisons(argument, holds)]
        if test.operation not in _OPPOSITE:
            return []
        operation = test.operation if holds else _OPPOSITE[test.operation]
        try:
            left, right = (fold(argument, self.seed) for argument in test.arguments)
        except NotFinite:
            return []
        if isinstance(left, Constant):
            left, right, operation = right, left, _MIRRORED.get(operation, operation)
        if isinstance(left, Read) and isinstance(right, Constant):
            return [(left.parameter, operation, right.value)]
        return []
