"""Expressions: syntax → model, with every name looked up.

One reader serves rules, where values are numbers that may depend on parameters, and scene blocks, where they
may be vectors and colours and are computed at once. It is a :class:`Scope` that tells them apart.

Example::

    expressions.number(tree_of("betaBr - 4"), RULES)     # Apply('subtract', (Read('betaBr'), Constant(4.0)))
    expressions.value(tree_of("2*<1, 0, 0>"), BLOCKS)    # Value('vector', (2.0, 0.0, 0.0))
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Callable, Sequence

from . import syntax, vocabulary
from .evaluate import NotFinite, fold
from .model import Apply, Constant, Expression, Read
from .problems import Problem
from .resolve_names import Entry, Names
from .records import record
from .source import Span

BINARY = {
    "*": "multiply", "/": "divide", "%": "modulo", "+": "add", "-": "subtract", "<": "less", "<=": "less_equal",
    ">": "greater", ">=": "greater_equal", "==": "equal", "!=": "not_equal", "&&": "and", "||": "or",
}  # fmt: skip
COMPONENTWISE = frozenset("*/+-")
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@record
class Scope:
    """What an expression may use where it stands: ``reads`` parameters, ``draws`` random numbers; in a ``block``
    there are axes, vectors and colours, and constant parts are folded."""

    place: str
    reads: bool = False
    draws: bool = False
    block: bool = False


RULES = Scope("a rule", reads=True, draws=True)
BLOCKS = Scope("a scene block", block=True)
ARGUMENTS = Scope("an object's arguments", draws=True)
TEXTURES = Scope("a Texture", reads=True, draws=True, block=True)
INPUTS = Scope("a Parameter's value", block=True)


@record
class Value:
    """A number (one part), a vector (two parts or more) or a colour (red, green, blue, filter, transmit)."""

    kind: str
    parts: tuple[Expression, ...]
    span: Span = field(compare=False)

    def numbers(self) -> tuple[float, ...]:
        """The parts of a constant value."""
        return tuple(part.value for part in self.parts)  # type: ignore[union-attr]

    @property
    def described(self) -> str:
        return f"a vector of {len(self.parts)}" if self.kind == "vector" else f"a {self.kind}"


class Expressions:
    """``constant_of`` gives the value of a declared constant or an input; ``seed`` is asked for when a constant
    needs the scene's seed, and may raise Problem."""

    def __init__(
        self, names: Names, constant_of: Callable[[Entry, Span], Value], seed: Callable[[Span], float]
    ) -> None:
        self.names, self.constant_of, self.seed = names, constant_of, seed

    # --- what other modules ask for

    def number(self, node: syntax.Expression, scope: Scope) -> Expression:
        """``node`` as a number. Raises Problem."""
        value = self.value(node, scope)
        if value.kind != "number":
            raise Problem("wrong-value", node.span, f"a number is needed here, this is {value.described}")
        return value.parts[0]

    def constant(self, node: syntax.Expression, scope: Scope = BLOCKS) -> float:
        """``node`` as a constant number. Raises Problem."""
        number = self.number(node, scope)
        assert isinstance(number, Constant)
        return number.value

    def value(self, node: syntax.Expression, scope: Scope) -> Value:
        """``node`` as a number, vector or colour. Raises Problem."""
        value = self._value(node, scope)
        if not scope.block:
            return value
        try:
            seed = self.seed(node.span) if _has_hash(value.parts) else 0.0
            return Value(value.kind, tuple(fold(part, seed) for part in value.parts), node.span)
        except NotFinite as error:
            raise Problem("not-finite", error.span or node.span, error.reason) from None

    # --- by kind of node

    def _value(self, node: syntax.Expression, scope: Scope) -> Value:
        match node:
            case syntax.Number():
                return Value("number", (Constant(node.value, node.span),), node.span)
            case syntax.Name():
                return self._name(node, scope)
            case syntax.Call():
                return self._call(node, scope)
            case syntax.Vector():
                return self._vector(node, scope)
            case syntax.Unary():
                return self._unary(node, scope)
            case syntax.Binary():
                return self._binary(node, scope)
            case syntax.Conditional():
                return self._conditional(node, scope)
            case syntax.String():
                raise Problem("wrong-value", node.span, "a number is needed here, this is a text")
            case _:
                raise Problem("wrong-kind", node.span, "a value is needed here")

    def _name(self, node: syntax.Name, scope: Scope) -> Value:
        name, span = node.name, node.span
        if name not in self.names.entries:
            if name in vocabulary.CONSTANTS:
                return Value("number", (Constant(math.pi, span),), span)
            if name in vocabulary.COLOURS and scope.block:
                parts = (*vocabulary.COLOURS[name], 0.0, 0.0)[:5]
                return Value("colour", tuple(Constant(part, span) for part in parts), span)
            if name in AXES and scope.block:
                return Value("vector", tuple(Constant(part, span) for part in AXES[name]), span)
        kinds = ("parameter", "value", "input") + (("constant", "colour") if scope.block else ("constant",))
        try:
            entry = self.names.find(node, kinds, "a value" if scope.block else "a number")
        except Problem as problem:
            if problem.code == "unknown-name" and scope.reads and not problem.hint:
                problem.hint = (
                    f"nothing assigns it: write Calculation C {{ {name} = 1; }}, or Parameter {name} = 1;"
                )
            raise
        if entry.kind != "parameter":
            value = self.constant_of(entry, span)
            return Value(value.kind, tuple(Constant(number, span) for number in value.numbers()), span)
        if not scope.reads:
            hint = "use numbers, #declare constants or Parameter inputs; for a texture by parameters, write Texture Name { ... }"
            raise Problem("wrong-kind", span, f"the parameter '{name}' has no value in {scope.place}", hint)
        return Value("number", (Read(name, span),), span)

    def _call(self, node: syntax.Call, scope: Scope) -> Value:
        name = node.name
        row = vocabulary.FUNCTIONS.get(name.name)
        if row is None:
            if name.name in self.names.entries:
                self.names.find(name, (), "a function")
            raise self.names.unknown(name, ("function",), "a function")
        if not row.accepts(len(node.arguments)):
            message = f"{row.name} takes {row.expected}, not {len(node.arguments)}"
            raise Problem("wrong-arguments", node.span, message, f"write {row.signature}")
        if row.name == "rand" and not scope.draws:
            hint = "use hash(...), or draw in a Calculation"
            raise Problem(
                "wrong-kind", node.span, f"there is nothing to draw random numbers for in {scope.place}", hint
            )
        arguments = tuple(self.number(argument, scope) for argument in node.arguments)
        if row.name in ("min", "max"):
            result = arguments[0]
            for argument in arguments[1:]:
                result = Apply(row.name, (result, argument), node.span)
            return Value("number", (result,), node.span)
        return Value("number", (Apply(row.name, arguments, node.span),), node.span)

    def _vector(self, node: syntax.Vector, scope: Scope) -> Value:
        if not scope.block:
            hint = "write the numbers side by side: trans 0 0 1"
            raise Problem("wrong-value", node.span, "a number is needed here, this is a vector", hint)
        parts = tuple(self.number(component, scope) for component in node.components)
        return Value("vector", parts, node.span)

    def _unary(self, node: syntax.Unary, scope: Scope) -> Value:
        operand = self._value(node.operand, scope)
        if node.operator == "+":
            return operand
        if node.operator == "!" and operand.kind != "number":
            raise Problem("wrong-value", node.span, f"'!' needs a number, this is {operand.described}")
        operation = "not" if node.operator == "!" else "negate"
        # A signed number is one constant, so that `-0.5` reads back as it was written.
        if operation == "negate" and isinstance(node.operand, syntax.Number):
            return Value("number", (Constant(-node.operand.value, node.span),), node.span)
        return Value(
            operand.kind, tuple(Apply(operation, (part,), node.span) for part in operand.parts), node.span
        )

    def _binary(self, node: syntax.Binary, scope: Scope) -> Value:
        left, right = self._value(node.left, scope), self._value(node.right, scope)
        operation = BINARY.get(node.operator, "")
        if not operation:
            raise Problem  # a broken expression, which has been reported
        if left.kind == right.kind == "number":
            return Value("number", (Apply(operation, (left.parts[0], right.parts[0]), node.span),), node.span)
        sizes = {len(value.parts) for value in (left, right) if value.kind != "number"}
        if node.operator not in COMPONENTWISE or len(sizes) > 1:
            message = f"'{node.operator}' can't join {left.described} and {right.described}"
            raise Problem("wrong-value", node.span, message)
        size = sizes.pop()
        kind = "colour" if "colour" in (left.kind, right.kind) else "vector"
        pairs = zip(_spread(left, size), _spread(right, size))
        return Value(kind, tuple(Apply(operation, pair, node.span) for pair in pairs), node.span)

    def _conditional(self, node: syntax.Conditional, scope: Scope) -> Value:
        test = self.number(node.test, scope)
        then, otherwise = self._value(node.then, scope), self._value(node.otherwise, scope)
        if then.kind != otherwise.kind or len(then.parts) != len(otherwise.parts):
            message = (
                f"both results of '?:' must be alike, these are {then.described} and {otherwise.described}"
            )
            raise Problem("wrong-value", node.span, message)
        pairs = zip(then.parts, otherwise.parts)
        return Value(then.kind, tuple(Apply("select", (test, *pair), node.span) for pair in pairs), node.span)


def _spread(value: Value, size: int) -> Sequence[Expression]:
    """A number counts as a vector of itself, as in POV-Ray."""
    return value.parts * size if value.kind == "number" else value.parts


def _has_hash(parts: Sequence[Expression]) -> bool:
    return any(
        isinstance(part, Apply) and (part.operation == "hash" or _has_hash(part.arguments)) for part in parts
    )
