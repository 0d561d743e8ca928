"""What a Transformation does, in numbers: its matrix, determinant, how much it stretches, and by how much it turns.

Syntax + scene → :class:`Motion`. Arguments that read parameters count with the values of their first level, as far as
the whole-file checks have found them.

Example: ``trans 0 0 1.99; roty 60; scale 0.8;`` moves by (0, 0, 1.99), turns by 60° about (0, 1, 0), and stretches
everything by 0.8: the determinant is 0.512.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..reading import syntax
from ..reading.diagnostics import Diagnostics
from ..reading.problems import Problem
from ..reading.source import Span
from .resolving import BlockResolver
from .scene import Scene

Vector = tuple[float, float, float]

# They change no lengths.
_RIGID = ("trans", "rotx", "roty", "rotz", "rot", "variants")


class Motion(NamedTuple):
    """``matrix`` row by row, 3x4. ``stretch``: by how much lengths change, least and most (the singular values of the
    linear part). ``turn``: the angle in degrees and the axis, where the linear part is a rotation times one factor, else
    None. ``is_constant``: no argument reads a parameter."""

    matrix: tuple[float, ...]
    determinant: float
    stretch: tuple[float, float]
    turn: tuple[float, Vector] | None
    is_constant: bool

    @property
    def translation(self) -> Vector:
        return self.matrix[3], self.matrix[7], self.matrix[11]

    @property
    def scaling(self) -> Vector | None:
        """The factors where nothing but scaling happens to the axes."""
        m = self.matrix
        off = (m[1], m[2], m[4], m[6], m[8], m[9])
        return None if any(abs(each) > 1e-12 for each in off) else (m[0], m[5], m[10])


class Stretching(NamedTuple):
    """``determinant`` of a chain of operations, and bounds of the factors by which it changes lengths."""

    determinant: float
    low: float
    high: float


def stretching_of(scene: Scene, statements: tuple[syntax.Statement, ...]) -> Stretching | None:
    """What is known of a Transformation whatever its angles and distances are; None if a factor isn't constant."""
    determinant, low, high = 1.0, 1.0, 1.0
    for statement in statements:
        if not isinstance(statement, syntax.Operation) or statement.name.name in _RIGID:
            continue
        motion = motion_of(scene, (statement,))
        if motion is None or not motion.is_constant:
            return None
        determinant *= motion.determinant
        low, high = low * motion.stretch[0], high * motion.stretch[1]
    return Stretching(determinant, low, high)


def motion_of(scene: Scene, statements: tuple[syntax.Statement, ...]) -> Motion | None:
    """What the operations among ``statements`` do; None where an argument's value isn't known."""
    from ..graph.matrices import determinant, is_finite, matrix_of

    steps, is_constant = [], True
    for statement in statements:
        if not isinstance(statement, syntax.Operation) or statement.name.name == "variants":
            continue
        found = [_value(scene, argument) for argument in statement.arguments]
        if None in found:
            return None
        is_constant &= all(constant for _, constant in found)
        uniform = statement.name.name == "scale" and len(found) == 1
        steps.append(("scale_uniform" if uniform else statement.name.name, [value for value, _ in found]))
    try:
        matrix = matrix_of(steps)
    except (ValueError, KeyError, TypeError):
        return None  # the checks say why
    if not steps or not is_finite(matrix):
        return None
    stretches = _singular_values(matrix)
    return Motion(
        matrix, determinant(matrix), (stretches[0], stretches[2]), _turn(matrix, stretches), is_constant
    )


def _value(scene: Scene, argument: syntax.Expression) -> tuple[float, bool] | None:
    """An argument's value, and whether it is a constant."""
    value = constant_of(scene, argument)
    if value is not None:
        return value, True
    first = _first_value(scene, argument.span)
    return None if first is None else (first, False)


def constant_of(scene: Scene, node: syntax.Expression) -> float | None:
    """The number that an expression of the scene stands for; None if it isn't a constant."""
    if isinstance(node, syntax.Number):
        return node.value
    expressions = BlockResolver(Diagnostics(), scene.entries, lambda name, kinds: "").expressions
    try:
        return expressions.constant(node)
    except (Problem, RecursionError):
        return None


def _first_value(scene: Scene, span: Span) -> float | None:
    for start, end, insight in scene.insights.get(span.source, ()):
        if (
            (start, end) == (span.start, span.end)
            and getattr(insight, "kind", "") == "argument"
            and insight.certain
        ):
            return insight.first
    return None


def _singular_values(m: tuple[float, ...]) -> Vector:
    """Of the linear part, rising: square roots of the eigenvalues of MᵀM (O. Smith, Eigenvalues of a symmetric 3x3
    matrix, 1961)."""
    columns = [(m[c], m[4 + c], m[8 + c]) for c in range(3)]
    a = [[sum(x * y for x, y in zip(u, v)) for v in columns] for u in columns]
    mean = (a[0][0] + a[1][1] + a[2][2]) / 3
    off = a[0][1] ** 2 + a[0][2] ** 2 + a[1][2] ** 2
    spread = math.sqrt((sum((a[i][i] - mean) ** 2 for i in range(3)) + 2 * off) / 6)
    if spread <= 1e-15 * mean:
        return (math.sqrt(mean),) * 3
    b = [[(a[i][j] - (mean if i == j else 0)) / spread for j in range(3)] for i in range(3)]
    det = (
        b[0][0] * (b[1][1] * b[2][2] - b[1][2] * b[2][1])
        - b[0][1] * (b[1][0] * b[2][2] - b[1][2] * b[2][0])
        + b[0][2] * (b[1][0] * b[2][1] - b[1][1] * b[2][0])
    )
    angle = math.acos(max(-1.0, min(1.0, det / 2))) / 3
    most = mean + 2 * spread * math.cos(angle)
    least = mean + 2 * spread * math.cos(angle + 2 * math.pi / 3)
    return tuple(math.sqrt(max(0.0, each)) for each in (least, 3 * mean - most - least, most))


def _turn(m: tuple[float, ...], stretches: Vector) -> tuple[float, Vector] | None:
    """Angle and axis of a rotation times one positive factor."""
    factor = stretches[1]
    if factor <= 0 or stretches[2] - stretches[0] > 1e-6 * factor:
        return None
    r = [[m[4 * row + column] / factor for column in range(3)] for row in range(3)]
    axis = (r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1])
    length = math.sqrt(sum(each * each for each in axis))
    cosine = (r[0][0] + r[1][1] + r[2][2] - 1) / 2
    if abs(cosine) > 1 + 1e-6 or abs(math.hypot(length / 2, cosine) - 1) > 1e-6:
        return None  # a reflection
    angle = math.degrees(math.atan2(length / 2, cosine))
    if length > 1e-6:
        return angle, tuple(each / length for each in axis)
    if cosine > 0:
        return 0.0, (0.0, 0.0, 1.0)
    # Half a turn: the axis spans the image of R + I.
    column = max(range(3), key=lambda c: r[c][c])
    axis = tuple(r[row][column] + (row == column) for row in range(3))
    length = math.sqrt(sum(each * each for each in axis))
    return 180.0, tuple(each / length for each in axis)
