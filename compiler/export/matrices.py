"""Arrays of affine maps: (n, 3, 4) float64, row by row, p' = M·(p, 1).

Products are written out in elementwise operations (no BLAS, no fused multiply-add), so that an export has the
same bits on every machine. Rotations take degrees and come from ``plsys.compiler.elementary``, whose right
angles are exact.

Example: ``chain(translation(0, 0, 1), axis_rotation(2, 90))`` maps (1, 0, 0) to (0, 1, 1).
"""

from __future__ import annotations

import numpy as np

from .. import elementary

IDENTITY = np.eye(3, 4)


def identity(n: int) -> np.ndarray:
    return np.broadcast_to(IDENTITY, (n, 3, 4)).copy()


def chain(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a·b: first b, then a. Either may be a single (3, 4) matrix."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    with np.errstate(
        all="ignore"
    ):  # what isn't finite stays visible in the product, for the caller to report
        for row in range(3):
            x, y, z, t = (a[..., row, k] for k in range(4))
            for column in range(4):
                value = x * b[..., 0, column] + y * b[..., 1, column] + z * b[..., 2, column]
                product[..., row, column] = value + t if column == 3 else value
    return product


def determinant(m: np.ndarray) -> np.ndarray:
    """(…): signed volume of the image of the unit cube."""
    a, b, c = (m[..., :, k] for k in range(3))
    return (
        a[..., 0] * (b[..., 1] * c[..., 2] - c[..., 1] * b[..., 2])
        - b[..., 0] * (a[..., 1] * c[..., 2] - c[..., 1] * a[..., 2])
        + c[..., 0] * (a[..., 1] * b[..., 2] - b[..., 1] * a[..., 2])
    )


def is_singular(m: np.ndarray) -> np.ndarray:
    """(…) bool: the determinant is 0, or the inverse isn't finite in doubles."""
    with np.errstate(all="ignore"):
        a, b, c = (m[..., :, k] for k in range(3))
        inverse = (
            np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
            / determinant(m)[..., None, None]
        )
        shift = -np.sum(inverse * m[..., None, :, 3], axis=-1)
    return ~(np.isfinite(inverse).all(axis=(-2, -1)) & np.isfinite(shift).all(axis=-1))


def apply(m: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The images (n, k, 3) of points (k, 3) or (n, k, 3) under n maps."""
    points = np.broadcast_to(points, (len(m), *points.shape[-2:]))
    return np.einsum("nij,nkj->nki", m[:, :, :3], points) + m[:, None, :, 3]


def translation(x, y, z) -> np.ndarray:
    m = identity(np.size(x))
    m[:, 0, 3], m[:, 1, 3], m[:, 2, 3] = x, y, z
    return m


def scaling(x, y, z) -> np.ndarray:
    m = np.zeros((np.size(x), 3, 4))
    m[:, 0, 0], m[:, 1, 1], m[:, 2, 2] = x, y, z
    return m


def axis_rotation(axis: int, degrees: np.ndarray) -> np.ndarray:
    """About x (0: y to z), y (1: z to x) or z (2: x to y)."""
    sine, cosine = elementary.sin(degrees), elementary.cos(degrees)
    m = identity(np.size(degrees))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    m[:, u, u], m[:, u, v], m[:, v, u], m[:, v, v] = cosine, -sine, sine, cosine
    return m


def rotation(degrees: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Rodrigues' rotation about the axis (x, y, z); NaN where the axis is zero."""
    sine, cosine = elementary.sin(degrees), elementary.cos(degrees)
    with np.errstate(all="ignore"):
        # By the largest component first, so that no square over- or underflows.
        largest = np.maximum(np.abs(x), np.maximum(np.abs(y), np.abs(z)))
        x, y, z = x / largest, y / largest, z / largest
        length = np.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
    rest = 1 - cosine
    m = np.zeros((np.size(degrees), 3, 4))
    m[:, 0, 0], m[:, 0, 1], m[:, 0, 2] = (
        cosine + rest * x * x,
        rest * x * y - sine * z,
        rest * x * z + sine * y,
    )
    m[:, 1, 0], m[:, 1, 1], m[:, 1, 2] = (
        rest * x * y + sine * z,
        cosine + rest * y * y,
        rest * y * z - sine * x,
    )
    m[:, 2, 0], m[:, 2, 1], m[:, 2, 2] = (
        rest * x * z - sine * y,
        rest * y * z + sine * x,
        cosine + rest * z * z,
    )
    return m


def shear(xy, xz, yx, yz, zx, zy) -> np.ndarray:
    m = identity(np.size(xy))
    m[:, 0, 1], m[:, 0, 2], m[:, 1, 0], m[:, 1, 2], m[:, 2, 0], m[:, 2, 1] = xy, xz, yx, yz, zx, zy
    return m


def from_povray(*numbers) -> np.ndarray:
    """POV-Ray's 12 numbers: the images of x, y and z, then the origin's."""
    return np.stack(numbers, axis=-1).reshape(-1, 4, 3).swapaxes(1, 2)


STEPS = {
    "trans": translation,
    "rotx": lambda a: axis_rotation(0, a),
    "roty": lambda a: axis_rotation(1, a),
    "rotz": lambda a: axis_rotation(2, a),
    "rot": rotation,
    "scale": scaling,
    "scale_uniform": lambda s: scaling(s, s, s),
    "shear": shear,
    "matrix": from_povray,
}
"""The map of each step of a Transformation, from arrays of its arguments."""
