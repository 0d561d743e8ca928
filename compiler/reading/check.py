"""Scenes that can't work: semantic checks on the model.

model.Model → diagnostics. resolve has made sure that every name means something; here is what only shows when
rules, guards and parameters are looked at together. The larger checks stand in check_*.py.

Example::

    check(model, diagnostics)
    # error[unassigned]: 'age' is read in Tree, but nothing has assigned it
"""

from __future__ import annotations

import math
from functools import cached_property

from . import affine
from .check_camera import check_camera
from .check_guards import check_guards
from .check_paths import check_paths
from .check_recursion import check_recursion
from .diagnostics import Diagnostics
from .evaluate import NotFinite, fold
from .intervals import ALL, Interval, interval_of, intervals_of
from .model import Apply, Assign, Calculate, Constant, Expression, Model, Read, Step, Symbol
from .resolve_names import ARTICLES
from .source import Span
from .walk import (
    Way,
    all_expressions,
    all_ways,
    decided,
    expressions_of,
    is_open,
    operators_of,
    parts,
    reached_symbols,
    reads,
    seed_of,
    steps_of,
    ways,
)

# Angles that people write when they think in radians, and no whole number of degrees.
RADIANS = [math.pi * factor for factor in (2, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 2 / 3, 3 / 4, 3 / 2)]
ANGLES = {"rotx": 0, "roty": 0, "rotz": 0, "rot": 0, "sin": 0, "cos": 0, "tan": 0}
INEXACT = frozenset(
    (
        "divide",
        "sqrt",
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan2",
        "exp",
        "log",
        "pow",
        "mix",
        "rand",
        "hash",
    )
)


def check(model: Model, diagnostics: Diagnostics) -> None:
    """Add what is wrong or suspicious with ``model``, which resolve made without errors (with errors the checks
    still run on what there is, but may say less)."""
    checker = _Checker(model, diagnostics)
    checker.scene()
    checker.values()
    checker.steps()
    checker.guards()
    if not diagnostics.has_errors:
        check_paths(model, diagnostics)
        check_recursion(model, diagnostics)
        check_guards(model, checker.intervals, diagnostics)
        check_camera(model, diagnostics)
    checker.unused()


class _Checker:
    def __init__(self, model: Model, diagnostics: Diagnostics) -> None:
        self.model, self.diagnostics = model, diagnostics
        self.seed = seed_of(model)
        self.reached = reached_symbols(model)
        self.radians: set[Span] = set()  # where angles in radians have been reported
        self.assigned: dict[str, list[Expression]] = {}
        for operator in operators_of(model):
            for statement in operator.statements if isinstance(operator, Calculate) else ():
                if isinstance(statement, Assign):
                    self.assigned.setdefault(statement.parameter, []).append(statement.value)

    @cached_property
    def intervals(self) -> dict[str, Interval]:
        return intervals_of(self.model)

    def scene(self) -> None:
        start = Span(self.model.source, 0, 0)
        if self.model.camera is None:
            hint = "write camera { location <0, -10, 5> sky <0, 0, 1> right <-4/3, 0, 0> look_at <0, 0, 0> }"
            self.diagnostics.add("no-camera", start, "the scene has no camera", hint)
        if not self.model.objects:
            names = [*self.model.symbols, "Tree"]
            hint = f"to place a Selection, write object {{ {names[0]} }}"
            self.diagnostics.add("no-object", start, "the scene has no object", hint)
        elif not self.model.lights:
            self.diagnostics.add(
                "no-light",
                start,
                "the scene has no light",
                "write light_source { <20, -30, 40> color rgb 1 }",
            )

    # --- expressions

    def values(self) -> None:
        """Constant parts without a finite value, exact comparisons of inexact numbers, angles in radians."""
        said: set[tuple[int, int]] = set()
        for expression in all_expressions(self.model):
            try:
                _divide_by_zero(fold(expression, self.seed))
            except NotFinite as error:
                if error.span is not None and (error.span.start, error.span.end) not in said:
                    said.add((error.span.start, error.span.end))
                    self.diagnostics.add("not-finite", error.span, error.reason, _finite_hint(error.reason))
            for part in parts(expression):
                if isinstance(part, Apply):
                    self._comparison(part)
                    self._angle(part.operation, part.arguments)

    def _comparison(self, node: Apply) -> None:
        if node.operation not in ("equal", "not_equal") or node.span is None:
            return
        inexact = any(
            (isinstance(part, Constant) and part.value != int(part.value))
            or (isinstance(part, Apply) and part.operation in INEXACT)
            for argument in node.arguments
            for part in parts(argument)
        )
        if inexact:
            hint = "numbers are rounded: compare with < or >, or abs(a - b) < 0.001"
            self.diagnostics.add(
                "float-equality", node.span, "exact comparison of numbers that may be rounded", hint
            )

    def _angle(self, operation: str, arguments: tuple[Expression, ...]) -> None:
        if operation not in ANGLES:
            return
        angle = arguments[0]
        if isinstance(angle, Apply) and angle.operation == "negate":
            angle = angle.arguments[0]
        if isinstance(angle, Read) and operation.startswith("rot"):
            for value in self.assigned.get(angle.parameter, ()):
                if _is_in_radians(value) and value.span is not None:
                    self._in_radians(value.span, f"{operation} takes degrees, and '{angle.parameter}' looks like radians")
            return
        span = arguments[0].span
        looks_so = isinstance(angle, Constant) and any(abs(abs(angle.value) - r) < 1e-3 for r in RADIANS)
        if (looks_so or _is_in_radians(arguments[0])) and span is not None:
            self._in_radians(span, f"{operation} takes degrees, and this looks like radians")

    def _in_radians(self, span: Span, message: str) -> None:
        if span not in self.radians:
            self.radians.add(span)
            self.diagnostics.add("radians", span, message, "a full turn is 360; to convert, multiply by 180/pi")

    # --- transformations

    def steps(self) -> None:
        for step in steps_of(self.model):
            self._angle(step.operation, step.arguments)
            self._flat(step)

    def _flat(self, step: Step) -> None:
        """A constant step without an inverse. (POV-Ray modifiers with one are errors already.)"""
        try:
            values = [fold(argument, self.seed) for argument in step.arguments]
        except NotFinite:
            return
        values = [self._settled(value) for value in values]
        numbers = [value.value for value in values if isinstance(value, Constant)]
        if step.span is None or len(numbers) != len(values):
            return
        if step.operation == "rot" and not any(numbers[1:]):
            self.diagnostics.add(
                "degenerate",
                step.span,
                "the axis of this rotation is zero",
                "write rot angle x y z, such as rot 30 0 0 1",
            )
        elif step.operation in ("scale", "scale_uniform") and 0.0 in numbers:
            self._singular(step.span)
        elif (
            step.operation == "matrix"
            and affine.determinant(affine.of_step(Step("matrix", tuple(values)))) == 0
        ):
            self._singular(step.span)
        elif step.operation == "shear":
            xy, xz, yx, yz, zx, zy = numbers
            if affine.determinant((1, xy, xz, 0, yx, 1, yz, 0, zx, zy, 1, 0)) == 0:
                self._singular(step.span)

    def _settled(self, value: Expression) -> Expression:
        """A value that is the same for all that parameters are assigned, as a constant."""
        if isinstance(value, Constant):
            return value
        interval = interval_of(value, self.intervals) or ALL
        return Constant(interval.low, value.span) if interval.low == interval.high else value

    def _singular(self, span: Span) -> None:
        message = "this transformation flattens what it acts on: its subtree is dropped"
        self.diagnostics.add(
            "singular",
            span,
            message,
            "for something thin, scale by a small number; flat shapes are triangle, square and disc",
        )

    # --- guards and weights

    def guards(self) -> None:
        said: set[int] = set()
        for symbol in self.model.symbols.values():
            ways_ = list(ways(symbol.production))
            for way in ways_:
                for test, _ in way.guards:
                    if id(test) not in said:
                        said.add(id(test))
                        self._literal_guard(test)
            self._no_rule(symbol, ways_)

    def _literal_guard(self, test: Expression) -> None:
        """A guard of literals only; one of inputs and named constants is there to be switched."""
        if reads(test) or test.span is None:
            return
        constants = [part for part in parts(test) if isinstance(part, Constant)]
        if all(part.span is not None and part.span.text[:1] in "0123456789-" for part in constants):
            truth = decided(test, self.seed)
            if truth is not None:
                outcome = "true" if truth else "false"
                self.diagnostics.add("constant-guard", test.span, f"this guard is always {outcome}")

    def _no_rule(self, symbol: Symbol, ways_: list[Way]) -> None:
        if not any(way.is_rule and is_open(way, self.seed) for way in ways_):
            self.diagnostics.add(
                "no-rule", symbol.name_span, f"no rule of '{symbol.name}' can apply: it produces nothing"
            )

    # --- names

    def unused(self) -> None:
        """Definitions of the scene's own file that nothing uses. (Included files are libraries.)"""
        read = self._read_parameters()
        for definition in self.model.definitions.values():
            if definition.span.source.name != self.model.source.name:
                continue
            name, what = definition.name, ARTICLES[definition.kind]
            if definition.kind == "parameter":
                if name not in read and definition.assignments:
                    message = f"'{name}' is assigned but never read"
                    self.diagnostics.add("unused", definition.span, message)
            elif definition.kind == "selection":
                if self.model.objects and name not in self.reached and name in self.model.symbols:
                    message = f"no object leads to the Selection '{name}'"
                    self.diagnostics.add(
                        "unreachable", definition.span, message, f"to place it, write object {{ {name} }}"
                    )
            elif not definition.references:
                self.diagnostics.add("unused", definition.span, f"'{name}' is {what} that nothing uses")

    def _read_parameters(self) -> set[str]:
        """The parameters that something reads, their own updates apart; those of operators that nothing uses count
        as read, since the operators themselves are reported."""
        read: set[str] = set()
        assigned: set[str] = set()
        for operator in operators_of(self.model):
            if isinstance(operator, Calculate):
                for statement in operator.statements:
                    if isinstance(statement, Assign):
                        assigned.add(statement.parameter)
                        read |= reads(statement.value) - {statement.parameter}
                    else:
                        read |= reads(statement.count)
            else:
                for expression in expressions_of(operator):
                    read |= reads(expression)
        for way in all_ways(self.model):
            for expression in (
                *(test for test, _ in way.guards),
                *way.weights,
                *getattr(way.leaf, "arguments", ()),
            ):
                read |= reads(expression)
        return read | (set(self.model.parameters) - assigned)


def _divide_by_zero(folded: Expression, lazy: bool = False) -> None:
    """Raises NotFinite for what is divided by a constant 0, unless it is evaluated only sometimes."""
    if isinstance(folded, Apply) and not lazy:
        if folded.operation in ("divide", "modulo") and folded.arguments[1] == Constant(0.0):
            raise NotFinite("division by zero", folded.span)
        for i, argument in enumerate(folded.arguments):
            _divide_by_zero(argument, folded.operation in ("and", "or", "select") and i > 0)


def _is_in_radians(angle: Expression) -> bool:
    """Whether an angle is made with pi, and not converted to degrees. What functions make of pi counts for nothing."""
    numbers, waiting = [], [angle]
    while waiting:
        part = waiting.pop()
        if isinstance(part, Constant):
            numbers.append(part.value)
        elif isinstance(part, Apply) and part.operation in ("add", "subtract", "multiply", "divide", "negate"):
            waiting += part.arguments
    return math.pi in numbers and not any(abs(number) in (180.0, 360.0) for number in numbers)


def _finite_hint(reason: str) -> str:
    if "zero" in reason:
        return "guard it: b != 0 ? a/b : 0"
    hints = {
        "sqrt(": "only numbers from 0 on have a square root: sqrt(max(x, 0))",
        "log(": "only numbers above 0 have a logarithm: log(max(x, 0.001))",
        "asin(": "asin takes -1 to 1: asin(clamp(x, -1, 1))",
        "acos(": "acos takes -1 to 1: acos(clamp(x, -1, 1))",
    }
    return next((hint for start, hint in hints.items() if reason.startswith(start)), "")
