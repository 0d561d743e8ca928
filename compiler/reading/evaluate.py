"""The values of constant expressions.

model.Expression → float, with the runtime's own elementary and random functions, so that a value folded at
compile time has the bits that the runtime would have computed.

Example::

    fold(Apply("add", (Constant(1.0), Constant(2.0))))      # Constant(3.0)
    apply("divide", (1.0, 0.0))                             # raises NotFinite('division by zero')
"""

from __future__ import annotations

import math
from typing import Sequence

from .model import Apply, Constant, Expression
from .source import Span


class NotFinite(Exception):
    """An expression whose value is infinite or not a number; ``reason`` says why, ``span`` where."""

    def __init__(self, reason: str, span: Span | None = None) -> None:
        super().__init__(reason)
        self.reason, self.span = reason, span


def apply(operation: str, values: Sequence[float], seed: float = 0.0) -> float:
    """The value of one opcode, or of and/or/select, for finite numbers; angles in degrees. ``seed`` is the scene's,
    for ``hash``. Raises NotFinite; ``rand`` has no constant value and is a KeyError."""
    if operation == "and":
        return float(values[0] != 0 and values[1] != 0)
    if operation == "or":
        return float(values[0] != 0 or values[1] != 0)
    if operation == "select":
        return values[1] if values[0] != 0 else values[2]
    if operation in ("divide", "modulo") and values[1] == 0:
        raise NotFinite("division by zero" if operation == "divide" else "remainder of a division by zero")
    from .. import elementary

    if operation == "hash":
        result = elementary.hash(elementary.seed_key(seed), *values)
    else:
        result = elementary.apply(operation, *values)
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
