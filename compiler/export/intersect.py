"""Where rays meet unit shapes, in extended precision (NumPy's longdouble): slow, plain, and independent of
the runtime.

For deciding who is right where two pictures differ. A function a shape takes origins and directions (..., 3)
in the shape's own space and its argument, and gives all roots as (roots, ...) arrays, NaN where there is
none; the same part of a surface (side, cap, face) always has the same place among the roots.

Example: ``ROOTS["sphere"](o, d, 0.0)`` for o = (0, 0, -3), d = (0, 0, 1) is [2, 4].
"""

from __future__ import annotations

import numpy as np

LONG = np.longdouble
NAN = LONG("nan")


def _where(inside: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.where(inside, t, NAN)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1)


def _quadratic(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Roots of a·t² + 2b·t + c, without cancellation, the lower first."""
    root = np.sqrt(b * b - a * c)
    q = -(b + np.copysign(root, b))
    first, second = q / a, c / q
    return np.fmin(first, second), np.fmax(first, second)


def sphere(o, d, _):
    return list(_quadratic(_dot(d, d), _dot(o, d), _dot(o, o) - 1))


def cone(o, d, top):
    """Radius 1 at z = 0 to ``top`` at z = 1, with caps."""
    k = top - 1
    radius, slope = 1 + k * o[..., 2], k * d[..., 2]
    xy_o, xy_d = o[..., :2], d[..., :2]
    roots = _quadratic(
        _dot(xy_d, xy_d) - slope * slope,
        _dot(xy_o, xy_d) - radius * slope,
        _dot(xy_o, xy_o) - radius * radius,
    )
    found = []
    for t in roots:
        z = o[..., 2] + t * d[..., 2]
        found.append(_where((z >= 0) & (z <= 1), t))
    for z, r in ((0, 1), (1, top)):
        t = (z - o[..., 2]) / d[..., 2]
        p = xy_o + t[..., None] * xy_d
        found.append(_where((_dot(p, p) <= r * r) & (r > 0), t))
    return found


def cylinder(o, d, _):
    return cone(o, d, LONG(1))


def box(o, d, _):
    low, high = -o / d, (1 - o) / d
    near, far = np.fmin(low, high), np.fmax(low, high)
    enter, leave = near.max(axis=-1), far.min(axis=-1)
    first, last = near.argmax(axis=-1), far.argmin(axis=-1)
    hit = enter <= leave
    faces = [_where(hit & (first == axis), enter) for axis in range(3)]
    return faces + [_where(hit & (last == axis), leave) for axis in range(3)]


def _flat(inside):
    def roots(o, d, _):
        t = -o[..., 2] / d[..., 2]
        return [_where(inside(o[..., 0] + t * d[..., 0], o[..., 1] + t * d[..., 1]), t)]

    return roots


def torus(o, d, minor):
    """The quartic's roots in double, polished by Newton in extended precision, from the point nearest to the
    centre."""
    shape = np.broadcast_shapes(o.shape, d.shape)[:-1]
    o, d = (np.broadcast_to(v, (*shape, 3)).reshape(-1, 3) for v in (o, d))
    length = np.sqrt(_dot(d, d))
    u = d / length[:, None]
    shift = -_dot(o, u)
    p = o + shift[:, None] * u
    k = _dot(p, p) + 1 - minor * minor
    ring, cross = 1 - u[:, 2] ** 2, _dot(p[:, :2], u[:, :2])
    one = np.ones_like(k)
    coefficients = [one, 0 * k, 2 * k - 4 * ring, -8 * cross, k * k - 4 * _dot(p[:, :2], p[:, :2])]
    found = np.full((4, len(o)), NAN)
    for i in range(len(o)):
        row = np.array([c[i] for c in coefficients])
        roots = np.roots(row.astype(float))
        real = np.sort(roots.real[np.abs(roots.imag) < 1e-6]).astype(LONG)
        derivative = np.polyder(row)
        for _ in range(4):
            slope = np.polyval(derivative, real)
            real = real - np.where(slope != 0, np.polyval(row, real) / np.where(slope != 0, slope, 1), 0)
        found[: len(real), i] = (np.sort(real) + shift[i]) / length[i]
    return list(found.reshape(4, *shape))


ROOTS = {
    "sphere": sphere,
    "cylinder": cylinder,
    "cone": cone,
    "box": box,
    "torus": torus,
    "triangle": _flat(lambda x, y: (x >= 0) & (y >= 0) & (x + y <= 1)),
    "square": _flat(lambda x, y: (x >= 0) & (y >= 0) & (x <= 1) & (y <= 1)),
    "disc": _flat(lambda x, y: x * x + y * y <= 1),
    "plane": _flat(lambda x, y: np.isfinite(x)),
}


def mesh_roots(o, d, vertices: np.ndarray, triangles: np.ndarray):
    """One root a triangle."""
    a, b, c = (np.asarray(vertices)[triangles[:, i]].astype(LONG) for i in range(3))
    found = []
    for origin, e, f in zip(a, b - a, c - a):
        normal = np.cross(e, f)
        t = _dot(origin - o, normal) / _dot(d, normal)
        p = o + t[..., None] * d - origin
        area = _dot(normal, normal)
        v, w = _dot(np.cross(p, f), normal) / area, _dot(np.cross(e, p), normal) / area
        found.append(_where((v >= 0) & (w >= 0) & (v + w <= 1), t))
    return found


def normal(kind: str, part: int, points: np.ndarray, argument) -> np.ndarray:
    """Normals (k, 3) of a shape at points (k, 3) on it, in its own space, of any length and either sign;
    ``part`` is the place among the roots."""
    if kind == "sphere":
        return points
    if kind in ("cylinder", "cone") and part < 2:
        slope = (argument - 1) if kind == "cone" else LONG(0)
        return np.concatenate([points[:, :2], -slope * (1 + slope * points[:, 2:])], axis=1)
    if kind == "torus":
        ring = points * np.array([1, 1, 0])
        return points - ring / np.sqrt(_dot(ring, ring))[:, None]
    axis = part % 3 if kind == "box" else 2
    return np.broadcast_to(np.eye(3, dtype=LONG)[axis], points.shape)
