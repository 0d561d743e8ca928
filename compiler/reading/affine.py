"""Constant affine maps as 12 numbers, for what the reader itself must compose (textures, lights, shapes).

A map is the 3×4 matrix row by row: p' = M·(p, 1). Small enough for plain Python, so that reading a scene doesn't
wait for NumPy.

Example::

    compose(translation((0, 0, 1)), scaling((2, 2, 2)))      # scale first, then move
"""

from __future__ import annotations

import math
from typing import Sequence

from .evaluate import apply
from .model import Constant, Step

Matrix = tuple[float, ...]
Vector = tuple[float, ...]

SQUARINGS = 40

IDENTITY: Matrix = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def compose(outer: Matrix, inner: Matrix) -> Matrix:
    """outer · inner: ``inner`` acts first."""
    result = []
    for row in range(3):
        a = outer[4 * row : 4 * row + 4]
        for column in range(4):
            result.append(
                sum(a[k] * inner[4 * k + column] for k in range(3)) + (a[3] if column == 3 else 0.0)
            )
    return tuple(result)


def transform_point(matrix: Matrix, point: Vector) -> Vector:
    return tuple(
        sum(matrix[4 * row + k] * point[k] for k in range(3)) + matrix[4 * row + 3] for row in range(3)
    )  # fmt: skip


def determinant(matrix: Matrix) -> float:
    """Of the linear part."""
    a, b, c, _, d, e, f, _, g, h, i, _ = matrix
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def spectral_radius(m: Matrix) -> float:
    """The largest |eigenvalue| of the linear part, by Gelfand's formula |M^k|^(1/k) with k = 2^40."""
    linear = [m[0:3], m[4:7], m[8:11]]
    logarithm = 0.0  # of the k-th root of the factor taken out of the power
    for i in range(SQUARINGS):
        size = max(abs(value) for row in linear for value in row)
        if size == 0:
            return 0.0
        logarithm += math.log(size) / 2**i
        linear = [[value / size for value in row] for row in linear]
        linear = [[sum(linear[r][k] * linear[k][c] for k in range(3)) for c in range(3)] for r in range(3)]
    return math.exp(logarithm)


def inverse(matrix: Matrix) -> Matrix | None:
    """The map back, by the adjugate; None for a singular map."""
    a, b, c, x, d, e, f, y, g, h, i, z = matrix
    size = determinant(matrix)
    if size == 0:
        return None
    rows = [(e * i - f * h, c * h - b * i, b * f - c * e),
            (f * g - d * i, a * i - c * g, c * d - a * f),
            (d * h - e * g, b * g - a * h, a * e - b * d)]  # fmt: skip
    found: list[float] = []
    for row in rows:
        linear = [value / size for value in row]
        found += [*linear, -sum(p * q for p, q in zip(linear, (x, y, z)))]
    return tuple(found)


def from_columns(x: Vector, y: Vector, z: Vector, origin: Vector) -> Matrix:
    """The map that takes the axes to x, y, z and the origin to ``origin``."""
    return tuple(column[row] for row in range(3) for column in (x, y, z, origin))


def columns(matrix: Matrix) -> tuple[Vector, Vector, Vector, Vector]:
    """The inverse of :func:`from_columns`; together they are POV-Ray's 12 numbers."""
    return tuple(tuple(matrix[4 * row + column] for row in range(3)) for column in range(4))  # type: ignore


def of_step(step: Step) -> Matrix:
    """The matrix of one step with constant arguments."""
    values = [argument.value for argument in step.arguments if isinstance(argument, Constant)]
    if step.operation == "trans":
        return from_columns((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), tuple(values))
    if step.operation in ("scale", "scale_uniform"):
        x, y, z = values * 3 if len(values) == 1 else values
        return (x, 0.0, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, 0.0, z, 0.0)
    if step.operation == "matrix":
        return from_columns(*(tuple(values[3 * i : 3 * i + 3]) for i in range(4)))
    if step.operation == "shear":
        xy, xz, yx, yz, zx, zy = values
        return (1.0, xy, xz, 0.0, yx, 1.0, yz, 0.0, zx, zy, 1.0, 0.0)
    sine, cosine = apply("sin", values[:1]), apply("cos", values[:1])
    if step.operation == "rot":
        return _about(values[1:], sine, cosine)
    first, second = {"rotx": (1, 2), "roty": (2, 0), "rotz": (0, 1)}[step.operation]
    matrix = list(IDENTITY)
    matrix[5 * first], matrix[5 * second] = cosine, cosine
    matrix[4 * second + first], matrix[4 * first + second] = sine, -sine
    return tuple(matrix)


def _about(axis: Sequence[float], sine: float, cosine: float) -> Matrix:
    """The rotation about ``axis`` (of any length but 0), by Rodrigues' formula."""
    size = math.hypot(*axis)
    x, y, z = (value / size for value in axis)
    rows = []
    for i, cross_row in enumerate(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))):
        for j in range(3):
            outer = (x, y, z)[i] * (x, y, z)[j]
            rows.append(outer * (1 - cosine) + (cosine if i == j else 0.0) + cross_row[j] * sine)
        rows.append(0.0)
    return tuple(rows)


def of_steps(steps: Sequence[Step]) -> Matrix:
    """M = step0 · step1 · …: the last acts first."""
    matrix = IDENTITY
    for step in steps:
        matrix = compose(matrix, of_step(step))
    return matrix


# --- vectors


def difference(a: Vector, b: Vector) -> Vector:
    return tuple(x - y for x, y in zip(a, b))


def scaled(a: Vector, factor: float) -> Vector:
    return tuple(x * factor for x in a)


def cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def length(a: Vector) -> float:
    return math.hypot(*a)


def perpendiculars(axis: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors that make a right-handed frame with ``axis`` (of any length but 0). A coordinate axis gives
    coordinate axes, so that upright shapes have exact matrices."""
    size = length(axis)
    z = scaled(axis, 1 / size)
    smallest = min(range(3), key=lambda i: abs(z[i]))
    seed = tuple(1.0 if i == smallest else 0.0 for i in range(3))
    x = difference(seed, scaled(z, z[smallest]))
    x = scaled(x, 1 / length(x))
    return x, cross(z, x)
