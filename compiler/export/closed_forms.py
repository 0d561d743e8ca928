"""Exact volumes and bounds of transformed primitives.

What an export is checked against: no tessellation and no sampling, only the support functions of the unit
shapes.

Example: the unit sphere under diag(1, 1, 2) has volume 8π/3 and bounds (-1, -1, -2) to (1, 1, 2).
"""

from __future__ import annotations

import numpy as np

from ..reading.model import Mesh
from .matrices import apply, determinant
from .unfold import SHAPE_NAMES, Instances

SOLID = {"sphere", "cylinder", "cone", "box", "torus"}

UNIT_VOLUMES = {
    "sphere": lambda r: np.full(len(r), 4 / 3 * np.pi),
    "cylinder": lambda r: np.full(len(r), np.pi),
    "cone": lambda r: np.pi / 3 * (1 + r + r * r),
    "box": lambda r: np.ones(len(r)),
    "torus": lambda r: 2 * np.pi**2 * r * r,
}


def volumes(batch: Instances) -> np.ndarray:
    """(n,): each primitive's volume; 0 for flat ones and meshes."""
    found = np.zeros(len(batch))
    for kind, name in SHAPE_NAMES.items():
        rows = batch.kind == kind
        if name in UNIT_VOLUMES and rows.any():
            found[rows] = np.abs(determinant(batch.matrix[rows])) * UNIT_VOLUMES[name](batch.argument[rows])
    return found


def bounds(batch: Instances, meshes: list[Mesh]) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) lowest and highest corners of each primitive's box; infinite for planes."""
    low, high = np.full((len(batch), 3), -np.inf), np.full((len(batch), 3), np.inf)
    for kind, name in SHAPE_NAMES.items():
        rows = np.flatnonzero(batch.kind == kind)
        if len(rows) and name != "plane":
            low[rows], high[rows] = _bounds(name, batch.matrix[rows], batch.argument[rows], meshes)
    return low, high


def _bounds(name: str, m: np.ndarray, argument: np.ndarray, meshes: list[Mesh]):
    x, y, z, origin = (m[:, :, k] for k in range(4))
    circle, ball = np.sqrt(x * x + y * y), np.sqrt(x * x + y * y + z * z)
    radius = argument[:, None]
    match name:
        case "sphere":
            return origin - ball, origin + ball
        case "disc":
            return origin - circle, origin + circle
        case "torus":
            reach = circle + np.abs(radius) * ball
            return origin - reach, origin + reach
        case "cylinder":
            return np.minimum(origin, origin + z) - circle, np.maximum(origin, origin + z) + circle
        case "cone":
            top = radius * circle
            return np.minimum(origin - circle, origin + z - top), np.maximum(
                origin + circle, origin + z + top
            )
        case "mesh":
            boxes = [apply(m[i : i + 1], meshes[int(a)].vertices)[0] for i, a in enumerate(argument)]
            return np.array([b.min(axis=0) for b in boxes]), np.array([b.max(axis=0) for b in boxes])
    corners = apply(m, CORNERS[name])
    return corners.min(axis=1), corners.max(axis=1)


CORNERS = {
    "box": np.array([(i, j, k) for i in (0.0, 1.0) for j in (0.0, 1.0) for k in (0.0, 1.0)]),
    "triangle": np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)]),
    "square": np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]),
}
