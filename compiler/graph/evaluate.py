"""Expressions, one value at a time, with the runtime's exact meaning (runtime/bytecode.toml, runtime/expression.h).

A :class:`Scope` is what the runtime keeps along a path: parameters, the random key, and the draws of the current
application. The forecast derives with it, ``fold`` uses :func:`apply`.

Example::

    scope = Scope.of_object(seed_key(7.0), "Tree", 0)
    scope.values["n"] = 3.0
    evaluate(Apply("subtract", (Read("n"), Constant(1.0))), scope)      # 2.0
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .. import elementary
from ..bytecode.layout_rows import LIMITS
from ..elementary import CHOICE_STREAM, bits, mix, name_hash
from ..reading.model import Apply, Assign, Constant, Expression, Read
from ..reading.source import Span
from . import graph as g
from .matrices import Matrix, is_finite, matrix_of
from .rewrite import parts

DRAWS_PER_APPLICATION = LIMITS["draws_per_application"]
MAX_VARIANTS = 2**32


class EvaluationError(Exception):
    """What the runtime would stop with: ``code`` of reading/codes.py, a message and the place."""

    def __init__(self, code: str, message: str, span: Span | None) -> None:
        super().__init__(message)
        self.code, self.message, self.span = code, message, span


@dataclass(slots=True)
class Scope:
    """Parameters without a value yet are missing in ``values``. ``drawn`` counts draws by the stream's bits."""

    seed_key: int
    values: dict[str, float] = field(default_factory=dict)
    key: int = 0
    drawn: dict[int, int] = field(default_factory=dict)

    @classmethod
    def of_object(cls, seed_key: int, name: str, ordinal: int) -> Scope:
        return cls(seed_key, key=mix(mix(seed_key, name_hash(name)), ordinal))

    def copy(self) -> Scope:
        return Scope(self.seed_key, dict(self.values), self.key, dict(self.drawn))

    def entered(self, name: str) -> Scope:
        """The scope inside a symbol: a new key, no draws yet."""
        return Scope(self.seed_key, dict(self.values), mix(self.key, name_hash(name)))

    def term(self, i: int) -> Scope:
        """The scope of term i of a union."""
        scope = self.copy()
        scope.key = elementary.term_key(self.key, i)
        return scope

    def draw(self, stream: int, span: Span | None = None) -> float:
        """The next number in [0, 1) of a stream, given by its bits."""
        ordinal = self.drawn.get(stream, 0)
        if sum(self.drawn.values()) >= DRAWS_PER_APPLICATION:
            raise EvaluationError(
                "limit", f"more than {DRAWS_PER_APPLICATION} draws in one application", span
            )
        self.drawn[stream] = ordinal + 1
        return elementary.rand(self.key, stream, ordinal)


def _divide(a: float, b: float) -> float:
    if b != 0:
        return a / b
    # IEEE: the sign of the infinity follows both signs.
    return math.nan if a == 0 or math.isnan(a) else math.copysign(math.inf, a) * math.copysign(1.0, b)


# Operations that Python does with IEEE's bits; all others go to the shared C.
QUICK: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": _divide,
    "negate": lambda a: -a,
    "not": lambda a: 1.0 if a == 0 else 0.0,
    "less": lambda a, b: 1.0 if a < b else 0.0,
    "less_equal": lambda a, b: 1.0 if a <= b else 0.0,
    "greater": lambda a, b: 1.0 if a > b else 0.0,
    "greater_equal": lambda a, b: 1.0 if a >= b else 0.0,
    "equal": lambda a, b: 1.0 if a == b else 0.0,
    "not_equal": lambda a, b: 1.0 if a != b else 0.0,
}


def apply(operation: str, arguments: Sequence[float]) -> float:
    """A pure operation on numbers (also infinite ones and NaN), ``and``, ``or`` and ``select`` included."""
    match operation:
        case "and":
            return 1.0 if arguments[0] != 0 and arguments[1] != 0 else 0.0
        case "or":
            return 1.0 if arguments[0] != 0 or arguments[1] != 0 else 0.0
        case "select":
            return arguments[1] if arguments[0] != 0 else arguments[2]
    quick = QUICK.get(operation)
    return quick(*arguments) if quick else elementary.apply(operation, *arguments)


def evaluate(expression: Expression, scope: Scope) -> float:
    """The expression's value; draws move on in ``scope``. Raises EvaluationError."""
    if isinstance(expression, Constant):
        return expression.value
    if isinstance(expression, Read):
        value = scope.values.get(expression.parameter)
        if value is None:
            message = f"'{expression.parameter}' is read before anything assigns it"
            raise EvaluationError("unassigned", message, expression.span)
        return value
    operation, arguments = expression.operation, expression.arguments
    if operation in ("and", "or", "select"):
        return _evaluate_lazily(operation, arguments, scope)
    values = [evaluate(argument, scope) for argument in arguments]
    if operation == "rand":
        _require_finite("the stream of rand", values[0], expression)
        return scope.draw(bits(values[0]), expression.span)
    if operation == "hash":
        for value in values:
            _require_finite("an argument of hash", value, expression)
        return elementary.hash(scope.seed_key, *values)
    return apply(operation, values)


def _evaluate_lazily(operation: str, arguments: tuple[Expression, ...], scope: Scope) -> float:
    first = evaluate(arguments[0], scope)
    if operation == "select":
        return evaluate(arguments[1] if first != 0 else arguments[2], scope)
    if (first != 0) == (operation == "or"):
        return 1.0 if first != 0 else 0.0
    return 1.0 if evaluate(arguments[1], scope) != 0 else 0.0


def calculate(node: g.Calculate, scope: Scope) -> None:
    """Run a Calculation on ``scope``."""
    if node.together:
        values = [evaluate(statement.value, scope) for statement in node.statements]
        for statement, value in zip(node.statements, values):
            _assign(statement, value, scope)
        return
    for statement in node.statements:
        if isinstance(statement, Assign):
            _assign(statement, evaluate(statement.value, scope), scope)
        else:
            count = evaluate(statement.count, scope)
            if not (1 <= count <= MAX_VARIANTS and count == int(count)):
                message = f"variants needs an integer from 1 to {MAX_VARIANTS}, not {count:.17g}"
                raise EvaluationError("wrong-value", message, statement.span)
            scope.key = mix(mix(scope.seed_key, name_hash(node.name)), scope.key % int(count))


def _assign(statement: Assign, value: float, scope: Scope) -> None:
    if not math.isfinite(value):
        why = ": division by zero" if _divides_by_zero(statement.value, scope.copy()) else ""
        message = f"'{statement.parameter}' becomes {_shown(value)}{why}"
        raise EvaluationError("not-finite", message, statement.span)
    scope.values[statement.parameter] = value


def transform(node: g.TransformCode, scope: Scope) -> Matrix:
    """The matrix of a transformation with arguments."""
    steps = []
    for step in node.steps:
        steps.append((step.operation, [evaluate(argument, scope) for argument in step.arguments]))
    try:
        matrix = matrix_of(steps)
    except ValueError as error:
        raise EvaluationError("degenerate", str(error), node.span) from None
    if not is_finite(matrix):
        raise EvaluationError("not-finite", f"the matrix of {repr(node.name) if node.name else 'these operations'} isn't finite", node.span)
    return matrix


def choose(node: g.Choose, scope: Scope) -> int:
    """The child that a weighted choice leads to."""
    weights = check_weights(node, [evaluate(weight, scope) for weight, _ in node.cases])
    threshold = scope.draw(CHOICE_STREAM, node.span) * _sum(weights)
    running, taken = 0.0, -1
    for weight, (_, body) in zip(weights, node.cases):
        running += weight
        if weight > 0:  # where rounding lets no sum exceed the threshold, the last that can be counts
            taken = body
        if running > threshold:
            break
    return taken


def check_weights(node: g.Choose, weights: list[float]) -> list[float]:
    for weight, (expression, _) in zip(weights, node.cases):
        if not (0 <= weight < math.inf):
            message = f"a weight is {weight:.17g}: weights are finite and not negative"
            raise EvaluationError("weights", message, expression.span or node.span)
    if not 0 < _sum(weights) < math.inf:
        message = "all weights are 0" if not any(weights) else "the sum of the weights is infinite"
        raise EvaluationError("weights", message, node.span)
    return weights


def _sum(weights: list[float]) -> float:
    """In order, each addition rounded (Python's own sum may compensate)."""
    total = 0.0
    for weight in weights:
        total += weight
    return total


def _require_finite(what: str, value: float, expression: Expression) -> None:
    if not math.isfinite(value):
        raise EvaluationError("not-finite", f"{what} is {_shown(value)}", expression.span)


def _shown(value: float) -> str:
    return "not a number" if math.isnan(value) else "infinite"


def _divides_by_zero(expression: Expression, scope: Scope) -> bool:
    """Whether a division in an expression is by zero, to explain its value (``scope`` is spent on it)."""
    return any(
        evaluate(part.arguments[1], scope) == 0
        for part in parts(expression)
        if isinstance(part, Apply) and part.operation in ("divide", "modulo")
    )
