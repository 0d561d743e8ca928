"""The values of constant expressions.

model.Expression → float, with the runtime's own elementary and random functions, so that a value folded at
compile time has the bits that the runtime would have computed.

Example::

    fold(Apply("add", (Constant(1.0), Constant(2.0))))      # Constant(3.0)
    apply("divide", (1.0, 0.0))                             # raises NotFinite('division by zero')
"""

from __future__ import annotations

import math
from typing import Callable, Sequence

from .model import Apply, Constant, Expression
from .source import Span


class NotFinite(Exception):
    """An expression whose value is infinite or not a number; ``reason`` says why, ``span`` where."""

    def __init__(self, reason: str, span: Span | None = None) -> None:
        super().__init__(reason)
        self.reason, self.span = reason, span


def _sign(a: float) -> float:
    return float((a > 0) - (a < 0))


def _round(a: float) -> float:
    # a + 0.5 would round 0.49999999999999994 up, so the halves are told apart by the exact fraction.
    whole = math.floor(abs(a))
    return math.copysign(whole + (abs(a) - whole >= 0.5), a)


_EXACT: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "modulo": math.fmod,
    "negate": lambda a: -a,
    "not": lambda a: float(a == 0),
    "less": lambda a, b: float(a < b),
    "less_equal": lambda a, b: float(a <= b),
    "greater": lambda a, b: float(a > b),
    "greater_equal": lambda a, b: float(a >= b),
    "equal": lambda a, b: float(a == b),
    "not_equal": lambda a, b: float(a != b),
    "abs": abs,
    "sign": _sign,
    "floor": lambda a: float(math.floor(a)),
    "ceil": lambda a: float(math.ceil(a)),
    "round": _round,
    "min": lambda a, b: a if a < b else b,
    "max": lambda a, b: a if a > b else b,
    "clamp": lambda a, low, high: _EXACT["min"](_EXACT["max"](a, low), high),
    "mix": lambda a, b, t: a * (1 - t) + b * t,
    "sqrt": math.sqrt,
    "and": lambda a, b: float(a != 0 and b != 0),
    "or": lambda a, b: float(a != 0 or b != 0),
    "select": lambda test, then, otherwise: then if test != 0 else otherwise,
}  # fmt: skip

_ELEMENTARY = frozenset(("pow", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan2"))


def apply(operation: str, values: Sequence[float], seed: float = 0.0) -> float:
    """The value of one operation on finite numbers; angles in degrees. ``seed`` is the scene's, for ``hash``.
    Raises NotFinite; ``rand`` has no constant value and is a KeyError."""
    if operation in ("divide", "modulo") and values[1] == 0:
        raise NotFinite("division by zero" if operation == "divide" else "remainder of a division by zero")
    try:
        if operation in _ELEMENTARY or operation == "hash":
            from .. import elementary

            if operation == "hash":
                result = elementary.hash(elementary.seed_key(seed), *values)
            else:
                result = getattr(elementary, operation)(*values)
        else:
            result = _EXACT[operation](*values)
    except (ValueError, OverflowError):
        result = math.nan
    if not math.isfinite(result):
        shown = ", ".join(f"{value:g}" for value in values)
        raise NotFinite(f"{operation}({shown}) is {'not a number' if math.isnan(result) else 'infinite'}")
    return result


def fold(expression: Expression, seed: float = 0.0) -> Expression:
    """``expression`` with every constant part computed. ``and``, ``or`` and ``select`` look only at what would be
    evaluated. Raises NotFinite with the span of the part that has no value."""
    if not isinstance(expression, Apply):
        return expression
    first = fold(expression.arguments[0], seed)
    operation, span = expression.operation, expression.span
    if isinstance(first, Constant):
        if operation == "select":
            return fold(expression.arguments[1 if first.value != 0 else 2], seed)
        if operation == "and" and first.value == 0:
            return Constant(0.0, span)
        if operation == "or" and first.value != 0:
            return Constant(1.0, span)
    arguments = (first, *(fold(argument, seed) for argument in expression.arguments[1:]))
    if operation == "rand" or not all(isinstance(argument, Constant) for argument in arguments):
        return Apply(operation, arguments, span)
    try:
        return Constant(apply(operation, [argument.value for argument in arguments], seed), span)
    except NotFinite as error:
        raise NotFinite(error.reason, error.span or span) from None
