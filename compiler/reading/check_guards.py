"""Guards that come out one way only: because of the guards before them, or because of all that their parameters are
assigned.

On the way to a guard, the tests before it say in which interval each parameter lies. A comparison with a constant that no
value there meets is reported. What the assignments alone decide is reported as well, but not where a recursion has been
found wrong already.

Example: in ``if (n > 0) A -> x; else if (n > 5) A -> y;`` the second guard never holds: n is at most 0 there.
"""

from __future__ import annotations

from bisect import bisect_left, insort

from .diagnostics import Diagnostic, Diagnostics
from .evaluate import NotFinite, fold
from .intervals import ALL, Interval, is_number, known_of
from .model import Apply, Branch, Constant, Expression, Production, Read, Symbol
from .source import Span
from .view import View, guards_read
from .walk import decided, parts, reads

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


Intervals = dict[str, Interval]
Comparison = tuple[str, str, float]  # parameter, operation, bound


def check_guards(view: View, diagnostics: Diagnostics) -> None:
    """Report guards that what stands before them rules out, or that have one outcome for all that is assigned."""
    told: dict[int, list[int]] = {}  # where messages start, by file
    for item in diagnostics.items:
        insort(told.setdefault(id(item.span.source), []), item.span.start)
    for found in view.of_each(ruled_out, view.symbols):
        diagnostics.items += found
    known = view.ask_again(intervals_in_guards, view.of_productions(guards_read), view.intervals)
    limited = [
        (symbol, limits)
        for symbol, limits in zip(view.symbols, known[len(view.model.objects) :])
        if limits and not _has_any(told.get(id(symbol.span.source), []), symbol.span)
    ]
    if limited:
        for found in view.of_each(decided_by_assignments, *map(list, zip(*limited))):
            diagnostics.items += found


def intervals_in_guards(several: list[tuple[str, ...]], intervals: Intervals) -> list[tuple[tuple[str, Interval], ...]]:
    """Where the values of the parameters lie that productions' guards read."""
    return [known_of(names, intervals) for names in several]


def ruled_out(symbol: Symbol, seed: float) -> list[Diagnostic]:
    """What is said of guards that those before them rule out."""
    checker = _Guards(seed)
    checker.follow(symbol.production, {})
    return checker.diagnostics.items


def decided_by_assignments(symbol: Symbol, seed: float, known: tuple[tuple[str, Interval], ...]) -> list[Diagnostic]:
    """What is said of guards that come out one way where parameters lie in the intervals that are ``known``."""
    checker = _Guards(seed)
    checker.follow(symbol.production, {})
    before = len(checker.diagnostics.items)
    checker.decided_by_assignments(symbol.production, dict(known))
    return checker.diagnostics.items[before:]


def _has_any(starts: list[int], span: Span) -> bool:
    return bisect_left(starts, span.start) < bisect_left(starts, span.end)


def _is_of_numbers(test: Expression) -> bool:
    """Whether all constants of a guard are written as numbers: named ones are there to be switched."""
    return all(is_number(part) for part in parts(test) if isinstance(part, Constant))


class _Guards:
    def __init__(self, seed: float) -> None:
        self.seed, self.diagnostics = seed, Diagnostics()
        self.told: set[Span] = set()

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

    def decided_by_assignments(self, production: Production, assigned: Intervals) -> None:
        """Report guards that come out one way for all values that are ever assigned."""
        waiting = [production]
        while waiting:
            production = waiting.pop()
            if not isinstance(production, Branch):
                continue
            waiting += [production.then, production.otherwise]
            test = production.test
            if all(assigned.get(name, ALL) == ALL for name in reads(test)):
                continue  # of literals, or of parameters that may be anything
            if test.span is None or test.span in self.told or not _is_of_numbers(test):
                continue
            for outcome in (True, False):
                if self.narrowed(test, outcome, assigned) is None:
                    names = sorted({part[0] for part in self.comparisons(test, outcome) if part[0] in assigned})
                    told = "; ".join(str(assigned[name]).format(*[f"'{name}'"] * 2) for name in names)
                    message = f"this guard is always {'false' if outcome else 'true'}: {told} wherever it is assigned"
                    self.diagnostics.add("constant-guard", test.span, message, "to switch it by hand, use a Parameter or a #declare")
                    break

    def report(self, test: Expression, known: Intervals) -> None:
        if test.span is None or decided(test, self.seed) is not None:
            return
        self.told.add(test.span)
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
