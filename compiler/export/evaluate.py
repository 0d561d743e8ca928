"""Expressions over many instances at once.

A :class:`Scope` is what expressions see of n instances: their parameters, random keys and the draws of their
current application. ``evaluate(expression, scope)`` gives n doubles. Everything here is NumPy; the only
functions shared with the runtime are those of ``plsys.compiler.elementary``, because an ulp in a guard is
another plant.

Example: with ``betaBr`` 60 in the first instance and 56 in the second, ``betaBr - 4.0`` gives
``array([56., 52.])``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import elementary
from ..bytecode.layout_rows import LIMITS
from ..reading.diagnostics import PlsysError
from ..reading.model import Apply, Assign, Constant, Expression, Read, Variants

NO_DRAW = np.uint64(0x7FF8000000000001)
"""Stands in ``Scope.draws`` where an instance didn't draw: a NaN's bits, so no stream's."""

DRAWS_PER_APPLICATION = LIMITS["draws_per_application"]

BINARY = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "modulo": np.fmod,
    "less": np.less,
    "less_equal": np.less_equal,
    "greater": np.greater,
    "greater_equal": np.greater_equal,
    "equal": np.equal,
    "not_equal": np.not_equal,
    "min": lambda a, b: np.where(a < b, a, b),
    "max": lambda a, b: np.where(a > b, a, b),
    "pow": elementary.pow,
    "atan2": elementary.atan2,
}
UNARY = {
    "bool": lambda a: a != 0,
    "not": lambda a: a == 0,
    "negate": np.negative,
    "abs": np.abs,
    "sign": lambda a: (a > 0) * 1.0 - (a < 0) * 1.0,
    "floor": np.floor,
    "ceil": np.ceil,
    "round": lambda a: np.trunc(a) + np.where(np.abs(a - np.trunc(a)) >= 0.5, np.copysign(1.0, a), 0.0),
    "sqrt": np.sqrt,
    "exp": elementary.exp,
    "log": elementary.log,
    "sin": elementary.sin,
    "cos": elementary.cos,
    "tan": elementary.tan,
    "asin": elementary.asin,
    "acos": elementary.acos,
}
TERNARY = {
    "clamp": lambda x, low, high: BINARY["min"](BINARY["max"](x, low), high),
    "mix": lambda a, b, t: a * (1 - t) + b * t,
}


@dataclass(slots=True)
class Scope:
    """What n instances know: ``parameters`` (n, slots) with NaN for *not assigned*, ``key`` (n,) uint64,
    ``draws`` (n, d) uint64: the streams drawn from in this application, in order. Assignments replace the
    arrays, never write into them, so that scopes may share them."""

    parameters: np.ndarray
    key: np.ndarray
    draws: np.ndarray
    slots: dict[str, int]
    seed_key: np.uint64

    def __len__(self) -> int:
        return len(self.key)

    def known(self, row: int) -> str:
        """``" (n = 3, len = 0.5)"``: the parameters that one instance has, for a message; empty if it has none."""
        values = {name: float(self.parameters[row, slot]) for name, slot in self.slots.items()}
        known = [f"{name} = {value:.17g}" for name, value in values.items() if not np.isnan(value)]
        return f" ({', '.join(known)})" if known else ""


def evaluate(expression: Expression, scope: Scope, rows: np.ndarray | None = None) -> np.ndarray:
    """The values (len(rows),) of an expression for some instances (None: all). Draws are entered in
    ``scope.draws``. Raises PlsysError where a parameter is read before it is assigned."""
    if rows is None:
        rows = np.arange(len(scope))
    match expression:
        case Constant(value):
            return np.full(len(rows), value, dtype=np.float64)
        case Read(name):
            return _read(expression, name, scope, rows)
        case Apply(operation, arguments):
            with np.errstate(all="ignore"):
                return _apply(expression, operation, arguments, scope, rows)
    raise TypeError(f"not an expression: {expression!r}")


def _read(expression: Read, name: str, scope: Scope, rows: np.ndarray) -> np.ndarray:
    slot = scope.slots.get(name)
    values = scope.parameters[rows, slot] if slot is not None else np.full(len(rows), np.nan)
    if np.isnan(values).any():
        raise PlsysError(f"parameter '{name}' is read before it is assigned", place(expression))
    return values


def _apply(
    expression: Apply, operation: str, arguments: tuple[Expression, ...], scope: Scope, rows: np.ndarray
) -> np.ndarray:
    if operation in ("and", "or", "select"):
        return _short_circuit(operation, arguments, scope, rows)
    values = [evaluate(argument, scope, rows) for argument in arguments]
    if operation in ("rand", "hash") and not all(np.isfinite(v).all() for v in values):
        raise PlsysError(f"an argument of {operation} is not a finite number", place(expression))
    if operation == "rand":
        return draw(scope, rows, elementary.bits(values[0]), expression)
    if operation == "hash":
        return elementary.hash(scope.seed_key, *values)
    function = (UNARY, BINARY, TERNARY)[len(values) - 1][operation]
    return np.asarray(function(*values), dtype=np.float64)


def _short_circuit(
    operation: str, arguments: tuple[Expression, ...], scope: Scope, rows: np.ndarray
) -> np.ndarray:
    """``and``, ``or`` and ``select`` evaluate their operands only for the instances that need them."""
    test = evaluate(arguments[0], scope, rows) != 0
    result = test.astype(np.float64)
    if operation == "select":
        branches = ((test, arguments[1]), (~test, arguments[2]))
    else:
        branches = ((test if operation == "and" else ~test, arguments[1]),)
    for needed, operand in branches:
        if needed.any():
            values = evaluate(operand, scope, rows[needed])
            result[needed] = values if operation == "select" else values != 0
    return result


def draw(scope: Scope, rows: np.ndarray, stream: np.ndarray, origin: object) -> np.ndarray:
    """One draw for each of ``rows`` from the streams whose bits are ``stream``: uniform in [0, 1)."""
    drawn = scope.draws[rows]
    if len(rows) and (drawn != NO_DRAW).sum(axis=1).max(initial=0) >= DRAWS_PER_APPLICATION:
        raise PlsysError(
            f"more than {DRAWS_PER_APPLICATION} draws in one application of a rule", place(origin)
        )
    ordinal = (drawn == stream[:, None]).sum(axis=1).astype(np.uint64)
    column = np.full((len(scope), 1), NO_DRAW)
    column[rows, 0] = stream
    scope.draws = np.concatenate([scope.draws, column], axis=1)
    return elementary.unit(elementary.mix(elementary.mix(scope.key[rows], stream), ordinal))


def execute(statements: tuple[Assign | Variants, ...], together: bool, name: str, scope: Scope) -> None:
    """Runs a Calculation on ``scope``. With ``together`` every value is evaluated before the first is
    assigned."""
    parameters = scope.parameters.copy()
    if not together:
        scope.parameters = parameters
    for statement in statements:
        if isinstance(statement, Variants):
            _variants(statement, name, scope)
            continue
        values = evaluate(statement.value, scope)
        if not np.isfinite(values).all():
            bad = values[~np.isfinite(values)][0]
            raise PlsysError(
                f"parameter '{statement.parameter}' becomes {bad}" + (f" in '{name}'" if name else ""),
                place(statement),
            )
        parameters[:, scope.slots[statement.parameter]] = values
    scope.parameters = parameters


def _variants(statement: Variants, name: str, scope: Scope) -> None:
    count = evaluate(statement.count, scope)
    if not ((count >= 1) & (count <= 2.0**32) & (count == np.floor(count))).all():
        raise PlsysError("variants needs an integer from 1 to 4294967296", place(statement))
    chosen = scope.key % count.astype(np.uint64)
    named = elementary.mix(scope.seed_key, elementary.name_hash(name))
    scope.key = elementary.mix(np.full(len(scope), named, dtype=np.uint64), chosen)


def place(origin: object) -> str:
    """'file:line:column' of a node or expression, or ''."""
    span = getattr(origin, "span", None)
    return str(span) if span is not None else ""
