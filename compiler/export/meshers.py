"""Triangles for the unit shapes: one function a shape, n segments around → vertices and faces.

Solids are watertight, and all faces are seen counter-clockwise from outside. Vertices lie on the surface, so
the error is that of chords: ``error(n, argument)`` is how far the triangles stay from the surface, in units
of the largest stretch of the transform.

Example: ``MESHERS["cylinder"].build(6, 0.0)`` is a hexagonal prism: 14 vertices, 24 faces; 0.134 from the
cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable

import numpy as np

Triangles = tuple[np.ndarray, np.ndarray]  # vertices (k, 3) float64, faces (t, 3) int64

FEWEST, MOST = 6, 4096


def _chord(n: float) -> float:
    """1 - cos(π/n) without cancellation: how far a regular n-gon stays inside the unit circle."""
    return 2 * np.sin(np.pi / (2 * n)) ** 2


@dataclass(frozen=True)
class Mesher:
    """``error`` is 0 where triangles are exact. ``volume`` is what the triangles enclose, in closed form;
    None for flat shapes, which enclose nothing."""

    build: Callable[[int, float], Triangles]
    error: Callable[[int, float], float]
    volume: Callable[[int, float], float] | None = None

    @property
    def solid(self) -> bool:
        return self.volume is not None


def segments_for(mesher: Mesher, relative: float, argument: float) -> int:
    """The least number of segments (even, FEWEST to MOST) whose error is at most ``relative``."""
    if mesher.error(FEWEST, argument) <= relative:
        return FEWEST
    low, high = FEWEST, MOST
    while high - low > 2:
        middle = (low + high) // 4 * 2
        low, high = (low, middle) if mesher.error(middle, argument) <= relative else (middle, high)
    return high


def _ring(n: int, radius: float, z: float) -> np.ndarray:
    angle = 2 * np.pi * np.arange(n) / n
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, z)], axis=1)


def _band(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Two triangles for each pair of neighbours on two closed rings of vertex indices; outside is to the
    right of the rings' direction."""
    a, b, c, d = lower, np.roll(lower, -1), np.roll(upper, -1), upper
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _fan(centre: int, ring: np.ndarray) -> np.ndarray:
    """Triangles from a centre to a closed ring, counter-clockwise as the ring is."""
    return np.stack([np.full(len(ring), centre), ring, np.roll(ring, -1)], axis=1)


def frustum(n: int, top: float) -> Triangles:
    """Radius 1 at z = 0 to ``top`` at z = 1, with caps."""
    ring = np.arange(n)
    base, foot = _ring(n, 1.0, 0.0), [[0.0, 0, 0], [0.0, 0, 1]]
    if top == 0:
        return np.concatenate([base, foot]), np.concatenate([_fan(n, ring[::-1]), _fan(n + 1, ring)])
    vertices = np.concatenate([base, _ring(n, top, 1.0), foot])
    faces = [_band(ring, ring + n), _fan(2 * n, ring[::-1]), _fan(2 * n + 1, ring + n)]
    return vertices, np.concatenate(faces)


def sphere(n: int, _: float) -> Triangles:
    """n meridians and n/2 bands of latitude between two poles."""
    bands = n // 2
    angle = np.pi * np.arange(1, bands) / bands
    vertices = [_ring(n, np.sin(a), -np.cos(a)) for a in angle] + [[[0.0, 0, -1], [0.0, 0, 1]]]
    rings = np.arange(n * (bands - 1)).reshape(bands - 1, n)
    south, north = n * (bands - 1), n * (bands - 1) + 1
    faces = [_band(a, b) for a, b in zip(rings, rings[1:])]
    return np.concatenate(vertices), np.concatenate(
        [*faces, _fan(south, rings[0][::-1]), _fan(north, rings[-1])]
    )


def torus(n: int, minor: float) -> Triangles:
    """n segments around the axis, as many around the tube."""
    angle = 2 * np.pi * np.arange(n) / n
    rings = np.arange(n * n).reshape(n, n)
    vertices = np.concatenate([_ring(n, 1 + minor * np.cos(a), minor * np.sin(a)) for a in angle])
    return vertices, np.concatenate([_band(rings[i], rings[(i + 1) % n]) for i in range(n)])


def box(_: int, __: float) -> Triangles:
    square_ = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    ring = np.arange(4)
    caps = np.array([[0, 3, 2], [0, 2, 1], [4, 5, 6], [4, 6, 7]])
    return np.concatenate([square_, square_ + [0, 0, 1]]), np.concatenate([_band(ring, ring + 4), caps])


def disc(n: int, _: float) -> Triangles:
    return np.concatenate([_ring(n, 1.0, 0.0), [[0.0, 0, 0]]]), _fan(n, np.arange(n))


def square(_: int, __: float) -> Triangles:
    return np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def triangle(_: int, __: float) -> Triangles:
    return np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])


def _exact(n: int, argument: float) -> float:
    return 0.0


def _turned(n: int, r: np.ndarray, z: np.ndarray) -> float:
    """Volume of the profile (r, z), a chain of straight pieces, turned about z in n flat steps: each piece is
    a frustum over a regular n-gon."""
    pieces = np.diff(z) * (r[:-1] ** 2 + r[:-1] * r[1:] + r[1:] ** 2) / 3
    return float(n / 2 * np.sin(2 * np.pi / n) * pieces.sum())


def _frustum_volume(n: int, top: float) -> float:
    return _turned(n, np.array([1.0, top]), np.array([0.0, 1.0]))


def _sphere_volume(n: int, _: float) -> float:
    angle = np.pi * np.arange(n // 2 + 1) / (n // 2)
    return _turned(n, np.sin(angle), -np.cos(angle))


def _torus_volume(n: int, minor: float) -> float:
    angle = 2 * np.pi * np.arange(n + 1) / n
    return _turned(n, 1 + minor * np.cos(angle), minor * np.sin(angle))


MESHERS = {
    # A facet of the sphere spans one step of longitude and one of latitude; the torus's likewise.
    "sphere": Mesher(sphere, lambda n, _: 2 * _chord(n), _sphere_volume),
    "cylinder": Mesher(
        lambda n, _: frustum(n, 1.0), lambda n, _: _chord(n), lambda n, _: _frustum_volume(n, 1.0)
    ),
    "cone": Mesher(frustum, lambda n, top: max(1.0, top) * _chord(n), _frustum_volume),
    "box": Mesher(box, _exact, lambda n, _: 1.0),
    "torus": Mesher(torus, lambda n, minor: (1 + 2 * minor) * _chord(n), _torus_volume),
    "triangle": Mesher(triangle, _exact),
    "square": Mesher(square, _exact),
    "disc": Mesher(disc, lambda n, _: _chord(n)),
}
