"""Linear forms with bounds: what an operator sequence surely does to an expression's value.

An expression is read as ``sum of factor · parameter + something in [low, high]``; draws, sines and what else isn't linear
go into the bounds. That is enough to see how far a counter moves on its way round a recursion.

Example: after ``n -= 1 + rand(0)`` the form of ``n`` is ``1·n + [-2, -1]``.
"""

from __future__ import annotations

import math
from typing import Mapping, NamedTuple, Sequence

from .model import Apply, Assign, Calculate, Constant, Expression, Operator, Read

# What some functions give whatever they are given.
RANGES = {"rand": (0.0, 1.0), "hash": (0.0, 1.0), "sin": (-1.0, 1.0), "cos": (-1.0, 1.0), "sign": (-1.0, 1.0)}
COMPARISONS = frozenset(
    ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "and", "or", "not")
)


class Form(NamedTuple):
    """``factors`` by parameter, none of them 0; ``low`` and ``high`` bound the rest."""

    factors: tuple[tuple[str, float], ...]
    low: float
    high: float

    @property
    def is_bounded(self) -> bool:
        return math.isfinite(self.low) and math.isfinite(self.high)

    def plus(self, other: Form, sign: float = 1.0) -> Form:
        factors = dict(self.factors)
        for name, factor in other.factors:
            factors[name] = factors.get(name, 0.0) + sign * factor
        low, high = sorted((sign * other.low, sign * other.high))
        return Form(_clean(factors), self.low + low, self.high + high)

    def times(self, number: float) -> Form:
        if number == 0:
            return NOTHING
        low, high = sorted((number * self.low, number * self.high))
        return Form(_clean({name: number * factor for name, factor in self.factors}), low, high)


NOTHING = Form((), 0.0, 0.0)
UNKNOWN = Form((), -math.inf, math.inf)
Scope = Mapping[str, Form]


def _clean(factors: dict[str, float]) -> tuple[tuple[str, float], ...]:
    return tuple(sorted((name, factor) for name, factor in factors.items() if factor != 0))


def form(expression: Expression, scope: Scope) -> Form:
    """The form of ``expression``, in terms of the parameters at the start of ``scope``; those that it doesn't hold are
    as they were."""
    if isinstance(expression, Constant):
        return Form((), expression.value, expression.value)
    if isinstance(expression, Read):
        name = expression.parameter
        return scope.get(name) or Form(((name, 1.0),), 0.0, 0.0)
    operation = expression.operation
    if operation in RANGES:
        return Form((), *RANGES[operation])
    if operation in COMPARISONS:
        return Form((), 0.0, 1.0)
    if operation == "select":
        then, otherwise = (form(argument, scope) for argument in expression.arguments[1:])
        return _either(then, otherwise)
    return _arithmetic(operation, [form(argument, scope) for argument in expression.arguments])


def _arithmetic(operation: str, forms: Sequence[Form]) -> Form:
    if operation == "negate":
        return forms[0].times(-1.0)
    if operation in ("add", "subtract"):
        return forms[0].plus(forms[1], 1.0 if operation == "add" else -1.0)
    if operation == "multiply":
        for one, other in (forms, forms[::-1]):
            if _is_constant(one):
                return other.times(one.low)
    if operation == "divide" and _is_constant(forms[1]) and forms[1].low != 0:
        return forms[0].times(1.0 / forms[1].low)
    if operation == "abs":
        return Form((), 0.0, math.inf)
    return UNKNOWN


def _is_constant(each: Form) -> bool:
    return not each.factors and each.low == each.high


def _either(one: Form, other: Form) -> Form:
    if one.factors == other.factors:
        return Form(one.factors, min(one.low, other.low), max(one.high, other.high))
    return UNKNOWN


def after(operators: Sequence[Operator], scope: Scope | None = None) -> dict[str, Form]:
    """The parameters' forms after ``operators``, in terms of those before."""
    found = dict(scope or {})
    for operator in operators:
        if not isinstance(operator, Calculate):
            continue
        before = dict(found)
        for statement in operator.statements:
            if isinstance(statement, Assign):
                found[statement.parameter] = form(statement.value, before if operator.together else found)
    return found


def difference(test: Apply) -> Expression:
    """``left - right`` of a comparison."""
    return Apply("subtract", test.arguments, test.span)
