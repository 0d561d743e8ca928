"""Affine 3x4 matrices, row by row in tuples of 12 doubles: the lines of a Transformation → one matrix.

p' = M·(p, 1), so that ``matrix[4 * row + column]`` and column 3 is the translation. Sums run in the runtime's
order (runtime/affine.h).

Example: ``matrix_of([("trans", (0, 0, 2)), ("rotz", (90,))])`` is
``(0, -1, 0, 0,  1, 0, 0, 0,  0, 0, 1, 2)``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from .. import elementary

Matrix = tuple[float, ...]

IDENTITY: Matrix = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """a·b: b acts first."""
    product = []
    for row in (0, 4, 8):
        x, y, z, t = a[row : row + 4]
        for column in range(4):
            total = x * b[column] + y * b[4 + column] + z * b[8 + column]
            product.append(total + t if column == 3 else total)
    return tuple(product)


def determinant(m: Matrix) -> float:
    """Of the linear part."""
    return (
        m[0] * (m[5] * m[10] - m[6] * m[9])
        - m[1] * (m[4] * m[10] - m[6] * m[8])
        + m[2] * (m[4] * m[9] - m[5] * m[8])
    )


def is_singular(m: Matrix) -> bool:
    """Whether the runtime drops what stands below: the determinant is 0, or the inverse isn't finite."""
    det = determinant(m)
    if det == 0:
        return True
    if 1e-50 < abs(det) and max(m) < 1e50 and min(m) > -1e50:
        return False  # the inverse's entries stay below 1e200
    adjugate = (
        m[5] * m[10] - m[6] * m[9],
        m[2] * m[9] - m[1] * m[10],
        m[1] * m[6] - m[2] * m[5],
        m[6] * m[8] - m[4] * m[10],
        m[0] * m[10] - m[2] * m[8],
        m[2] * m[4] - m[0] * m[6],
        m[4] * m[9] - m[5] * m[8],
        m[1] * m[8] - m[0] * m[9],
        m[0] * m[5] - m[1] * m[4],
    )
    inverse = [entry / det for entry in adjugate]
    moved = [sum(inverse[3 * r + c] * m[4 * c + 3] for c in range(3)) for r in range(3)]
    return not all(map(math.isfinite, (*inverse, *moved)))


def regular_product(a: Matrix, b: Matrix) -> Matrix | None:
    """a·b, without -0; None if it overflows, or became singular by rounding."""
    product = tuple([value + 0.0 for value in multiply(a, b)])
    return product if is_finite(product) and not is_singular(product) else None


def is_finite(m: Matrix) -> bool:
    return all(map(math.isfinite, m))


def matrix_of(steps: Iterable[tuple[str, Sequence[float]]]) -> Matrix:
    """M = step0 · step1 · …, of (operation, numbers) pairs. ValueError for a rotation about a zero axis."""
    matrix = None
    for operation, numbers in steps:
        step = STEPS[operation](*numbers)
        matrix = multiply(matrix, step) if matrix else step
    return tuple([value + 0.0 for value in matrix or IDENTITY])  # -0 becomes 0: bytecode has no -0


def _translation(x: float, y: float, z: float) -> Matrix:
    return (1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z)


def _sin_cos(angle_deg: float) -> tuple[float, float]:
    return elementary.apply("sin", angle_deg), elementary.apply("cos", angle_deg)


def _rotation_x(angle_deg: float) -> Matrix:
    s, c = _sin_cos(angle_deg)
    return (1.0, 0.0, 0.0, 0.0, 0.0, c, -s, 0.0, 0.0, s, c, 0.0)


def _rotation_y(angle_deg: float) -> Matrix:
    s, c = _sin_cos(angle_deg)
    return (c, 0.0, s, 0.0, 0.0, 1.0, 0.0, 0.0, -s, 0.0, c, 0.0)


def _rotation_z(angle_deg: float) -> Matrix:
    s, c = _sin_cos(angle_deg)
    return (c, -s, 0.0, 0.0, s, c, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def _rotation(angle_deg: float, x: float, y: float, z: float) -> Matrix:
    """Rodrigues: R = c·I + (1 - c)·u·uᵀ + s·[u]×, u the axis made a unit vector."""
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0:
        raise ValueError("a rotation about the axis 0, 0, 0")
    x, y, z = x / largest, y / largest, z / largest  # so that the squares neither overflow nor vanish
    length = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    s, c = _sin_cos(angle_deg)
    k = 1 - c
    return (
        *(c + k * x * x, k * x * y - s * z, k * x * z + s * y, 0.0),
        *(k * x * y + s * z, c + k * y * y, k * y * z - s * x, 0.0),
        *(k * x * z - s * y, k * y * z + s * x, c + k * z * z, 0.0),
    )


def _scaling(x: float, y: float, z: float) -> Matrix:
    return (x, 0.0, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, 0.0, z, 0.0)


def _shearing(xy: float, xz: float, yx: float, yz: float, zx: float, zy: float) -> Matrix:
    return (1.0, xy, xz, 0.0, yx, 1.0, yz, 0.0, zx, zy, 1.0, 0.0)


def _povray_matrix(*v: float) -> Matrix:
    """POV-Ray's 12 numbers: the images of x, y and z, then the origin's."""
    return (v[0], v[3], v[6], v[9], v[1], v[4], v[7], v[10], v[2], v[5], v[8], v[11])


# By the opcode's name in runtime/bytecode.toml.
STEPS = {
    "trans": _translation,
    "rotx": _rotation_x,
    "roty": _rotation_y,
    "rotz": _rotation_z,
    "rot": _rotation,
    "scale": _scaling,
    "scale_uniform": lambda s: _scaling(s, s, s),
    "shear": _shearing,
    "matrix": _povray_matrix,
}
