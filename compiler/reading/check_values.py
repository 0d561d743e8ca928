"""What expressions and steps come to: no finite value, exact comparisons of rounded numbers, angles in radians, and
transformations that flatten.

Nearly all of it shows in one operator or production alone (the questions); two things need the whole scene: what is
assigned to a parameter that stands as an angle, and the intervals of those that a step reads.

Example: ``Transformation T { scale 1 1 0; }`` flattens; ``sqrt(-1)`` has no value; ``rotz pi/2`` is an angle in radians.
"""

from __future__ import annotations

import math
from typing import Iterable, Iterator, NamedTuple

from . import affine
from .diagnostics import Diagnostic, Diagnostics
from .evaluate import NotFinite, fold
from .intervals import ALL, Ask, Interval, interval_of, known_of
from .linear import COMPARISONS
from .model import Apply, Assign, Calculate, Constant, Expression, Operator, Production, Read, Step, Transform
from .source import Span
from .view import View, operators_in, own_expressions
from .walk import expressions_of, parts, reads

# Angles that people write when they think in radians, and no whole number of degrees.
RADIANS = [math.pi * factor for factor in (2, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 2 / 3, 3 / 4, 3 / 2)]
ANGLES = frozenset("rotx roty rotz rot sin cos tan".split())
INEXACT = frozenset("divide sqrt sin cos tan asin acos atan2 exp log pow mix rand hash".split())

Intervals = dict[str, Interval]


class Steps(NamedTuple):
    """What a Transformation's steps say: messages, those left open (with what their arguments come to), and the parameters
    that are angles (operation, name)."""

    messages: list[Diagnostic]
    undecided: tuple[tuple[Step, tuple[Expression, ...]], ...]
    angles: tuple[tuple[str, str], ...]


class Said(NamedTuple):
    """What a production and its operators say: as Steps; ``reads`` are the parameters that undecided steps read, and
    ``in_radians`` those that get an angle in radians, with its place."""

    messages: list[Diagnostic]
    angles: tuple[tuple[str, str], ...]
    reads: tuple[str, ...]
    in_radians: tuple[tuple[str, Span], ...]


def check_values(view: View, diagnostics: Diagnostics) -> None:
    """Report each place once, whatever uses it."""
    told = {_identity(each) for each in diagnostics.items}
    for message in _messages(view):
        if _identity(message) not in told:
            told.add(_identity(message))
            diagnostics.items.append(message)


def _identity(message: Diagnostic) -> tuple:
    """Of an angle it is enough to be told once that it looks like radians."""
    said = message.code == "radians" or message.message
    return message.code, id(message.span.source), message.span.start, message.span.end, said


def _messages(view: View) -> Iterator[Diagnostic]:
    every = view.of_each(said_by, view.productions, in_turn=True)
    in_radians: dict[str, list[Span]] = {}
    for said in every:
        for name, span in said.in_radians:
            in_radians.setdefault(name, []).append(span)
    for said in every:
        yield from said.messages
        for operation, name in said.angles if in_radians else ():
            for span in in_radians.get(name, ()):
                yield _in_radians(span, f"{operation} takes degrees, and '{name}' looks like radians")
    undecided = [(production, said.reads) for production, said in zip(view.productions, every) if said.reads]
    if undecided:
        productions, several = map(list, zip(*undecided))
        known = view.ask_again(intervals_in_steps, several, view.intervals)
        for found in view.of_each(settled_by, productions, known, in_turn=True):
            yield from found


# --- questions


def said_by(ask: Ask, production: Production, seed: float) -> Said:
    messages = list(values_of_production(production, seed))
    angles, read, in_radians = [], set(), []
    for operator in operators_in(production):
        messages += ask(values_of_operator, operator, given=(seed,))
        if isinstance(operator, Transform):
            steps = ask(steps_said, operator, given=(seed,))
            messages += steps.messages
            angles += steps.angles
            read.update(name for _, values in steps.undecided for value in values for name in reads(value))
        elif isinstance(operator, Calculate):
            in_radians += ask(assigned_in_radians, operator)
    return Said(messages, tuple(dict.fromkeys(angles)), tuple(sorted(read)), tuple(in_radians))


def values_of_operator(operator: Operator, seed: float) -> list[Diagnostic]:
    return _values(expressions_of(operator), seed)


def values_of_production(production: Production, seed: float) -> list[Diagnostic]:
    return _values(own_expressions(production), seed)


def assigned_in_radians(operator: Calculate) -> tuple[tuple[str, Span], ...]:
    """The parameters that get an angle in radians, with its place."""
    assigns = [each for each in operator.statements if isinstance(each, Assign) and each.value.span is not None]
    return tuple((each.parameter, each.value.span) for each in assigns if _is_in_radians(each.value))  # type: ignore[misc]


def steps_said(operator: Transform, seed: float) -> Steps:
    messages: list[Diagnostic] = []
    undecided, angles = [], []
    for step in operator.steps:
        if step.operation in ANGLES:
            angle = _unsigned(step.arguments[0])
            if isinstance(angle, Read):
                angles.append((step.operation, angle.parameter))
            else:
                messages += _angle(step.operation, step.arguments[0])
        try:
            values = tuple(fold(argument, seed) for argument in step.arguments)
        except NotFinite:
            continue
        if all(isinstance(value, Constant) for value in values):
            messages += _flat(step, values)
        else:
            undecided.append((step, values))
    return Steps(messages, tuple(undecided), tuple(angles))


def intervals_in_steps(several: list[tuple[str, ...]], intervals: Intervals) -> list[tuple[tuple[str, Interval], ...]]:
    """Where the values of the parameters lie that productions' steps read."""
    return [known_of(names, intervals) for names in several]


def settled_by(ask: Ask, production: Production, seed: float, known: tuple[tuple[str, Interval], ...]) -> list[Diagnostic]:
    """What is said of undecided steps, where parameters lie in the intervals that are ``known``."""
    intervals, found = dict(known), []
    for operator in operators_in(production):
        for step, values in ask(steps_said, operator, given=(seed,)).undecided if isinstance(operator, Transform) else ():
            settled = tuple(_settled(value, intervals) for value in values)
            found += _flat(step, settled) if all(isinstance(value, Constant) for value in settled) else []
    return found


# --- what is said


def _values(expressions: Iterable[Expression], seed: float) -> list[Diagnostic]:
    """Of parts without a finite value the first; exact comparisons of inexact numbers; angles in radians."""
    found = Diagnostics()
    for expression in expressions:
        try:
            _divide_by_zero(fold(expression, seed))
        except NotFinite as error:
            if error.span is not None:
                found.add("not-finite", error.span, error.reason, _finite_hint(error.reason))
        for part in parts(expression):
            if isinstance(part, Apply):
                if part.operation in ("equal", "not_equal") and part.span is not None and _is_inexact(part):
                    hint = "numbers are rounded: compare with < or >, or abs(a - b) < 0.001"
                    found.add("float-equality", part.span, "exact comparison of numbers that may be rounded", hint)
                if part.operation in ANGLES:
                    found.items += _angle(part.operation, part.arguments[0])
    return found.items


def _is_inexact(comparison: Apply) -> bool:
    if all(isinstance(side, Apply) and side.operation in COMPARISONS for side in comparison.arguments):
        return False  # both are 0 or 1
    return any(
        (isinstance(part, Constant) and part.value != int(part.value))
        or (isinstance(part, Apply) and part.operation in INEXACT)
        for argument in comparison.arguments
        for part in parts(argument)
    )


def _unsigned(angle: Expression) -> Expression:
    return angle.arguments[0] if isinstance(angle, Apply) and angle.operation == "negate" else angle


def _angle(operation: str, argument: Expression) -> list[Diagnostic]:
    angle = _unsigned(argument)
    looks_so = isinstance(angle, Constant) and any(abs(abs(angle.value) - r) < 1e-3 for r in RADIANS)
    if argument.span is None or not (looks_so or _is_in_radians(argument)):
        return []
    return [_in_radians(argument.span, f"{operation} takes degrees, and this looks like radians")]


def _in_radians(span: Span, message: str) -> Diagnostic:
    found = Diagnostics()
    found.add("radians", span, message, "a full turn is 360; to convert, multiply by 180/pi")
    return found.items[0]


def _flat(step: Step, values: tuple[Expression, ...]) -> list[Diagnostic]:
    """A constant step without an inverse. (POV-Ray modifiers with one are errors already.)"""
    found, numbers = Diagnostics(), [value.value for value in values]  # type: ignore[union-attr]
    if step.span is None:
        return []
    if step.operation == "rot":
        if not any(numbers[1:]):
            hint = "write rot angle x y z, such as rot 30 0 0 1"
            found.add("degenerate", step.span, "the axis of this rotation is zero", hint)
    elif _is_singular(step.operation, values, numbers):
        message = "this transformation flattens what it acts on: its subtree is dropped"
        hint = "for something thin, scale by a small number; flat shapes are triangle, square and disc"
        found.add("singular", step.span, message, hint)
    return found.items


def _is_singular(operation: str, values: tuple[Expression, ...], numbers: list[float]) -> bool:
    if operation in ("scale", "scale_uniform"):
        return 0.0 in numbers
    if operation == "matrix":
        return affine.determinant(affine.of_step(Step("matrix", values))) == 0
    if operation == "shear":
        xy, xz, yx, yz, zx, zy = numbers
        return affine.determinant((1, xy, xz, 0, yx, 1, yz, 0, zx, zy, 1, 0)) == 0
    return False


def _settled(value: Expression, intervals: Intervals) -> Expression:
    """A value that is the same for all that parameters are assigned, as a constant."""
    if isinstance(value, Constant):
        return value
    interval = interval_of(value, intervals) or ALL
    return Constant(interval.low, value.span) if interval.low == interval.high else value


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
