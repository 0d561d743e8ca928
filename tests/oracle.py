"""Brute force: rays against a list of unfolded primitives, in NumPy, by textbook formulas of its own.

Independent of the runtime on purpose: no acceleration, no code in common. `nearest(rays, primitives)` gives for each
ray the foremost hit's t, which primitive, and the gap to the next candidate (hits closer together than rounding can
tell are ambiguous).

Shapes are the language's unit shapes (DESIGN: closed and solid); a primitive is (kind, 3x4 object-to-world
matrix, argument).
"""

from __future__ import annotations

import numpy as np

INFINITY = np.inf


def _quadratic(a, b, c):
    """Roots of a·t² + 2b·t + c, lower first; NaN where none. Arrays of one shape."""
    with np.errstate(all="ignore"):
        discriminant = b * b - a * c
        root = np.sqrt(np.where(discriminant >= 0, discriminant, np.nan))
        q = -(b + np.copysign(root, b))
        first, second = q / a, c / q
        first = np.where(q == 0, -b / a, first)
        second = np.where(q == 0, -b / a, second)
    return np.minimum(first, second), np.maximum(first, second)


def _sphere(o, d, argument):
    near, far = _quadratic((d * d).sum(1), (o * d).sum(1), (o * o).sum(1) - 1)
    return [near, far]


def _cap(o, d, z, radius):
    with np.errstate(all="ignore"):
        t = (z - o[:, 2]) / d[:, 2]
        x, y = o[:, 0] + t * d[:, 0], o[:, 1] + t * d[:, 1]
        return np.where(x * x + y * y <= radius * radius, t, np.nan)


def _cone(o, d, top):
    """Radius 1 at z = 0 to `top` at z = 1, with caps."""
    k = top - 1.0
    radius_o, radius_d = 1 + k * o[:, 2], k * d[:, 2]
    a = d[:, 0] ** 2 + d[:, 1] ** 2 - radius_d**2
    b = o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1] - radius_o * radius_d
    c = o[:, 0] ** 2 + o[:, 1] ** 2 - radius_o**2
    roots = list(_quadratic(a, b, c))
    kept = []
    for t in roots:
        with np.errstate(all="ignore"):
            z = o[:, 2] + t * d[:, 2]
            kept.append(np.where((z >= 0) & (z <= 1) & (1 + k * z >= 0), t, np.nan))
    kept.append(_cap(o, d, 0.0, 1.0))
    if top > 0:
        kept.append(_cap(o, d, 1.0, top))
    return kept


def _cylinder(o, d, argument):
    return _cone(o, d, 1.0)


def _box(o, d, argument):
    with np.errstate(all="ignore"):
        low, high = (0 - o) / d, (1 - o) / d
    near, far = np.fmin(low, high).max(1), np.fmax(low, high).min(1)
    hit = near <= far
    return [np.where(hit, near, np.nan), np.where(hit, far, np.nan)]


def _flat(inside):
    def roots(o, d, argument):
        with np.errstate(all="ignore"):
            t = -o[:, 2] / d[:, 2]
            x, y = o[:, 0] + t * d[:, 0], o[:, 1] + t * d[:, 1]
            return [np.where(inside(x, y), t, np.nan)]

    return roots


def _torus(o, d, minor):
    """Quartic by companion matrices, polished by Newton, from the ray's closest point to the centre."""
    length = np.linalg.norm(d, axis=1)
    u = d / length[:, None]
    shift = -(o * u).sum(1)
    p = o + shift[:, None] * u
    k = (p * p).sum(1) + 1 - minor * minor
    b = 2 * (p * u).sum(1)
    # (|p + t u|² + 1 - r²)² = 4 (x² + y²)
    polynomial = np.stack(
        [
            np.ones(len(o)),
            2 * b,
            b * b + 2 * k - 4 * (u[:, 0] ** 2 + u[:, 1] ** 2),
            2 * b * k - 8 * (p[:, 0] * u[:, 0] + p[:, 1] * u[:, 1]),
            k * k - 4 * (p[:, 0] ** 2 + p[:, 1] ** 2),
        ],
        axis=1,
    )
    found = np.full((4, len(o)), np.nan)
    for i, coefficients in enumerate(polynomial):
        roots = np.roots(coefficients)
        real = np.sort(roots.real[np.abs(roots.imag) < 1e-7])
        derivative = np.polyder(coefficients)
        for _ in range(2):
            slope = np.polyval(derivative, real)
            real = np.where(slope != 0, real - np.polyval(coefficients, real) / np.where(slope == 0, 1, slope), real)
        found[: len(real), i] = (np.sort(real) + shift[i]) / length[i]
    return list(found)


ROOTS = {
    "sphere": _sphere,
    "cylinder": _cylinder,
    "cone": _cone,
    "box": _box,
    "torus": _torus,
    "triangle": _flat(lambda x, y: (x >= 0) & (y >= 0) & (x + y <= 1)),
    "square": _flat(lambda x, y: (x >= 0) & (y >= 0) & (x <= 1) & (y <= 1)),
    "disc": _flat(lambda x, y: x * x + y * y <= 1),
    "plane": _flat(lambda x, y: np.isfinite(x)),
}


def candidates(origins, directions, kind, matrix, argument):
    """All t > 0 of n rays with one primitive: (k, n), NaN where there is none."""
    inverse = np.linalg.inv(matrix[:, :3])
    o = (origins - matrix[:, 3]) @ inverse.T
    d = directions @ inverse.T
    roots = np.array(ROOTS[kind](o, d, argument))
    return np.where(roots > 0, roots, np.nan)


def nearest(origins, directions, primitives):
    """(t, primitive, gap) a ray: t INFINITY and primitive -1 where nothing is hit; gap is the relative distance from
    the foremost hit to the next primitive's, INFINITY where there is no other."""
    n = len(origins)
    best, second = np.full(n, INFINITY), np.full(n, INFINITY)
    which = np.full(n, -1)
    for index, (kind, matrix, argument) in enumerate(primitives):
        t = np.nan_to_num(candidates(origins, directions, kind, matrix, argument), nan=INFINITY).min(0)
        closer = t < best
        second = np.where(closer, best, np.minimum(second, t))
        which = np.where(closer, index, which)
        best = np.where(closer, t, best)
    with np.errstate(invalid="ignore"):
        gap = np.where(np.isfinite(second), (second - best) / np.maximum(best, 1), INFINITY)
    return best, which, gap
