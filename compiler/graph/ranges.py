"""Expressions over values that aren't known yet because they were drawn.

A value is a float, or a :class:`Range`. There are two readings of a range, one for each question of the forecast:

- *bounds* (``uniform=False``): some number in [low, high]; operations give a range that surely holds the result.
- *expectation* (``uniform=True``): a number drawn evenly from [low, high]. Sums and multiples by constants stay
  exact, and so does the probability that it is less than a constant; everything else takes the middle.

Example: after ``x = rand(0) * 4``, ``x < 1`` holds with probability 0.25 in the expectation; in bounds it is
undecided.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from .. import elementary
from ..reading.model import Apply, Constant, Expression, Read
from .evaluate import apply

BELOW_ONE = 1 - 2.0**-53


class Range(NamedTuple):
    low: float
    high: float


Value = float | Range
Values = dict[str, Value]

DRAWN = Range(0.0, BELOW_ONE)
UNKNOWN = Range(-math.inf, math.inf)
UNDECIDED = Range(0.0, 1.0)

COMPARISONS = ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal")
# Monotone in each argument, whatever the others are: the extremes stand at the corners.
CORNERS = (
    *("add", "subtract", "multiply", "negate", "min", "max", "clamp", "sign", "floor", "ceil", "round"),
    *("exp", "log", "sqrt", "asin", "acos", "mix"),
)
MIRRORED = {
    "less": "greater",
    "less_equal": "greater_equal",
    "greater": "less",
    "greater_equal": "less_equal",
    "equal": "equal",
    "not_equal": "not_equal",
}
OPPOSITE = {
    "less": "greater_equal",
    "less_equal": "greater",
    "greater": "less_equal",
    "greater_equal": "less",
    "equal": "not_equal",
    "not_equal": "equal",
}


@dataclass(frozen=True)
class Ranges:
    """One of the two readings. ``seed_key`` makes ``hash`` of known arguments known."""

    uniform: bool
    seed_key: int

    def evaluate(self, expression: Expression, values: Values) -> Value:
        """A parameter without a value is unknown: the concrete derivation reports it."""
        if isinstance(expression, Constant):
            return expression.value
        if isinstance(expression, Read):
            value = values.get(expression.parameter, UNKNOWN)
            return self.middle(value) if self.uniform and value == UNKNOWN else value
        operation = expression.operation
        if operation == "select":
            return self._select(expression.arguments, values)
        if operation in ("and", "or", "not", *COMPARISONS):
            chance = self.probability(expression, values)
            return chance if chance in (0.0, 1.0) else self._known(UNDECIDED)
        arguments = [self.evaluate(argument, values) for argument in expression.arguments]
        if operation == "rand":
            return DRAWN
        if not any(isinstance(argument, Range) for argument in arguments):
            return (
                elementary.hash(self.seed_key, *arguments)
                if operation == "hash"
                else apply(operation, arguments)
            )
        return self._uniform(operation, arguments) if self.uniform else self._bounds(operation, arguments)

    def probability(self, test: Expression, values: Values) -> float:
        """That a test holds. In bounds only 0 and 1 mean anything; all between is 'undecided'."""
        operation = test.operation if isinstance(test, Apply) else ""
        if operation == "not":
            return 1 - self.probability(test.arguments[0], values)
        if operation in ("and", "or"):
            first = self.probability(test.arguments[0], values)
            if first == (0.0 if operation == "and" else 1.0):
                return first
            # Refined, the second is conditional on the first: products are exact for chains of comparisons.
            refined = self.refine(test.arguments[0], operation == "and", values)
            second = self.probability(test.arguments[1], refined)
            return first * second if operation == "and" else first + (1 - first) * second
        if operation in COMPARISONS:
            left, right = (self.evaluate(argument, values) for argument in test.arguments)
            return self._compare(operation, left, right)
        value = self.evaluate(test, values)
        if not isinstance(value, Range):
            return 1.0 if value != 0 else 0.0
        if self.uniform:
            return 1.0 if value.low < value.high else float(value.low != 0)
        return 1.0 if value.low > 0 or value.high < 0 else 0.0 if value.low == value.high == 0 else 0.5

    def refine(self, test: Expression, holds: bool, values: Values) -> Values:
        """The values when it is known whether a test holds: parameters compared directly become narrower."""
        if not isinstance(test, Apply):
            return values
        if test.operation == "not":
            return self.refine(test.arguments[0], not holds, values)
        if test.operation in ("and", "or"):
            if holds != (test.operation == "and"):
                return values
            return self.refine(test.arguments[1], holds, self.refine(test.arguments[0], holds, values))
        if test.operation not in COMPARISONS:
            return values
        operation = test.operation if holds else OPPOSITE[test.operation]
        left, right = test.arguments
        if isinstance(right, Read) and not isinstance(left, Read):
            operation, left, right = MIRRORED[operation], right, left
        value, bound = values.get(getattr(left, "parameter", "")), self.evaluate(right, values)
        if not isinstance(value, Range) or isinstance(bound, Range):
            return values
        return {**values, left.parameter: _narrow(value, operation, bound)}

    def _compare(self, operation: str, left: Value, right: Value) -> float:
        a, b = _range(left), _range(right)
        if operation in ("greater", "greater_equal", "not_equal"):
            opposite = {"greater": "less_equal", "greater_equal": "less", "not_equal": "equal"}[operation]
            return 1 - self._compare(opposite, left, right)
        if operation == "equal":
            if a == b and a.low == a.high:
                return 1.0
            apart = a.high < b.low or b.high < a.low
            return 0.0 if apart or self.uniform else 0.5
        if a.high < b.low or (operation == "less_equal" and a.high <= b.low):
            return 1.0
        if a.low > b.high or (operation == "less" and a.low >= b.high):
            return 0.0
        if not self.uniform:
            return 0.5
        # One of them is drawn evenly; against another range its middle counts.
        if a.low < a.high:
            return _share(a, self.middle(right))
        return 1 - _share(b, a.low)

    def _select(self, arguments: Sequence[Expression], values: Values) -> Value:
        chance = self.probability(arguments[0], values)
        if chance in (0.0, 1.0):
            return self.evaluate(arguments[1 if chance else 2], values)
        then = self.evaluate(arguments[1], self.refine(arguments[0], True, values))
        otherwise = self.evaluate(arguments[2], self.refine(arguments[0], False, values))
        if self.uniform:
            return self.middle(then) * chance + self.middle(otherwise) * (1 - chance)
        a, b = _range(then), _range(otherwise)
        return Range(min(a.low, b.low), max(a.high, b.high))

    def _uniform(self, operation: str, arguments: list[Value]) -> Value:
        """Straight lines of one drawn number stay even; all else is taken in the middle."""
        drawn = [i for i, argument in enumerate(arguments) if isinstance(argument, Range)]
        is_line = operation in ("add", "subtract", "negate", "multiply") or drawn == [
            {"divide": 0, "mix": 2}.get(operation)
        ]
        if len(drawn) == 1 and is_line:
            ends = [self._at(operation, arguments, drawn[0], end) for end in arguments[drawn[0]]]
            if all(map(math.isfinite, ends)):
                return Range(min(ends), max(ends)) if ends[0] != ends[1] else ends[0]
        middles = [self.middle(argument) for argument in arguments]
        return elementary.hash(self.seed_key, *middles) if operation == "hash" else apply(operation, middles)

    @staticmethod
    def _at(operation: str, arguments: list[Value], i: int, end: float) -> float:
        return apply(operation, [*arguments[:i], end, *arguments[i + 1 :]])

    def _bounds(self, operation: str, arguments: list[Value]) -> Value:
        ranges = [_range(argument) for argument in arguments]
        match operation:
            case "sin" | "cos":
                return Range(-1.0, 1.0)
            case "hash":
                return DRAWN
            case "abs":
                (a,) = ranges
                low = 0.0 if a.low <= 0 <= a.high else min(abs(a.low), abs(a.high))
                return Range(low, max(abs(a.low), abs(a.high)))
            case "divide" if ranges[1].low > 0 or ranges[1].high < 0:
                return _corners(operation, ranges)
            case "pow" if ranges[0].low > 0:
                return _corners(operation, ranges)
            case "modulo":
                size = max(abs(ranges[1].low), abs(ranges[1].high), 0.0)
                return Range(-size if ranges[0].low < 0 else 0.0, size if ranges[0].high > 0 else 0.0)
        return _corners(operation, ranges) if operation in CORNERS else UNKNOWN

    def _known(self, value: Range) -> Value:
        return self.middle(value) if self.uniform else value

    @staticmethod
    def middle(value: Value) -> float:
        if not isinstance(value, Range):
            return value
        return 0.0 if value == UNKNOWN else value.low / 2 + value.high / 2


def _range(value: Value) -> Range:
    return value if isinstance(value, Range) else Range(value, value)


def _corners(operation: str, ranges: list[Range]) -> Value:
    ends = [apply(operation, corner) for corner in itertools.product(*ranges)]
    return UNKNOWN if any(map(math.isnan, ends)) else Range(min(ends), max(ends))


def _share(drawn: Range, bound: float) -> float:
    """The probability that a number drawn evenly from a range is below ``bound``."""
    high = 1.0 if drawn == DRAWN else drawn.high  # draws are in [0, 1): 0.8 of them are below 0.8
    return min(1.0, max(0.0, (bound - drawn.low) / (high - drawn.low)))


def _narrow(value: Range, operation: str, bound: float) -> Value:
    low, high = value
    if operation in ("less", "less_equal", "equal"):
        high = min(high, max(bound, low))
    if operation in ("greater", "greater_equal", "equal"):
        low = max(low, min(bound, high))
    return Range(low, high) if low < high else low
