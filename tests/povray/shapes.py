"""Ray intersections of POV-Ray's primitives, for the reference model of `model.py`.

Input: rays in the object's own space, origins and directions as (n, 3) float64 arrays.  Output of
`Shape.hits`: all crossings as t (k, n), inf where there is none, and their normals (k, n, 3), not
normalised, pointing out.  A shape also writes itself as POV-Ray text, so that a scene is described once:

    Sphere((0, 0, 1), 2).pov()  ->  "sphere { <0.0, 0.0, 1.0>, 2.0"        (the caller closes the brace)

The equations are the textbook ones (Glassner, An Introduction to Ray Tracing, ch. 2); what is POV-Ray's own
is said where it happens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Vector = Sequence[float]


def vector_text(v: Vector) -> str:
    """A POV-Ray vector literal with all digits."""
    return "<" + ", ".join(repr(float(x)) for x in v) + ">"


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Row-wise dot product."""
    return np.einsum("...i,...i->...", a, b)


def unit(a: np.ndarray) -> np.ndarray:
    """Row-wise normalised vectors."""
    return a / np.sqrt(dot(a, a))[..., None]


def quadratic(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Both roots of a t² + 2 b t + c as a (2, n) array, inf where there is none."""
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - a * c)
        t = np.stack([(-b - root) / a, (-b + root) / a])
    return np.where(np.isfinite(t), t, np.inf)


def at(o: np.ndarray, d: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points o + t d for t of shape (k, n); the origin where t is inf, which nobody reads."""
    return o + np.where(np.isfinite(t), t, 0.0)[..., None] * d


class Shape:
    """A primitive: `hits` in its own space, and `pov`, its text up to the closing brace."""

    def hits(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError

    def pov(self) -> str:
        raise NotImplementedError


@dataclass
class Sphere(Shape):
    center: Vector
    radius: float

    def hits(self, o, d):
        oc = o - np.asarray(self.center, float)
        t = quadratic(dot(d, d), dot(oc, d), dot(oc, oc) - self.radius**2)
        return t, at(oc, d, t)

    def pov(self):
        return f"sphere {{ {vector_text(self.center)}, {self.radius!r}"


@dataclass
class Box(Shape):
    low: Vector
    high: Vector

    def hits(self, o, d):
        low, high = np.asarray(self.low, float), np.asarray(self.high, float)
        with np.errstate(all="ignore"):
            t0, t1 = (low - o) / d, (high - o) / d
        near, far = np.minimum(t0, t1), np.maximum(t0, t1)
        enter, leave = near.max(axis=1), far.min(axis=1)
        t = np.where(enter <= leave, np.stack([enter, leave]), np.inf)
        sign = np.sign(d)
        normals = [
            -sign * np.eye(3)[near.argmax(axis=1)],
            sign * np.eye(3)[far.argmin(axis=1)],
        ]
        return t, np.stack(normals)

    def pov(self):
        return f"box {{ {vector_text(self.low)}, {vector_text(self.high)}"


@dataclass
class Plane(Shape):
    """Points p with p·normal = distance; POV-Ray normalises the normal first."""

    normal: Vector
    distance: float

    def hits(self, o, d):
        n = unit(np.asarray(self.normal, float))
        with np.errstate(all="ignore"):
            t = ((self.distance - o @ n) / (d @ n))[None]
        t = np.where(np.isfinite(t), t, np.inf)
        return t, np.broadcast_to(n, (*t.shape, 3))

    def pov(self):
        return f"plane {{ {vector_text(self.normal)}, {self.distance!r}"


@dataclass
class Cone(Shape):
    """Truncated cone with caps; `Cone(a, r, b, r)` is a cylinder."""

    base: Vector
    base_radius: float
    apex: Vector
    apex_radius: float
    is_open: bool = False

    def hits(self, o, d):
        base, apex = np.asarray(self.base, float), np.asarray(self.apex, float)
        length = np.linalg.norm(apex - base)
        w = (apex - base) / length
        slope = (self.apex_radius - self.base_radius) / length
        oz, dz = (o - base) @ w, d @ w
        ox, dx = o - base - oz[:, None] * w, d - dz[:, None] * w
        r, dr = self.base_radius + slope * oz, slope * dz
        t = quadratic(dot(dx, dx) - dr * dr, dot(ox, dx) - r * dr, dot(ox, ox) - r * r)
        height = oz + np.where(np.isfinite(t), t, 0) * dz
        t = np.where((height >= 0) & (height <= length), t, np.inf)
        side = at(ox, dx, t)
        radius = self.base_radius + slope * (oz + np.where(np.isfinite(t), t, 0) * dz)
        ts, normals = [t], [side - (slope * radius)[..., None] * w]
        if not self.is_open:
            for z, r, n in ((0.0, self.base_radius, -w), (length, self.apex_radius, w)):
                with np.errstate(all="ignore"):
                    t = ((z - oz) / dz)[None]
                p = at(ox, dx, t)
                ts.append(np.where(np.isfinite(t) & (dot(p, p) <= r * r), t, np.inf))
                normals.append(np.broadcast_to(n, p.shape))
        return np.concatenate(ts), np.concatenate(normals)

    def pov(self):
        end = " open" if self.is_open else ""
        if self.base_radius == self.apex_radius:
            return (
                f"cylinder {{ {vector_text(self.base)}, {vector_text(self.apex)}, {self.base_radius!r}{end}"
            )
        return (
            f"cone {{ {vector_text(self.base)}, {self.base_radius!r}, "
            f"{vector_text(self.apex)}, {self.apex_radius!r}{end}"
        )


def Cylinder(base: Vector, apex: Vector, radius: float, is_open: bool = False) -> Cone:
    """A cylinder, as the cone of two equal radii that it is."""
    return Cone(base, radius, apex, radius, is_open)


@dataclass
class Torus(Shape):
    """Around the y axis.  The quartic's roots are eigenvalues of its companion matrix, then two Newton steps."""

    major: float
    minor: float
    sturm: bool = False

    def hits(self, o, d):
        length = np.sqrt(dot(d, d))
        d = d / length[:, None]
        closer = -dot(o, d)
        p = o + closer[:, None] * d
        k = dot(p, p) - self.major**2 - self.minor**2
        c = np.stack(
            [
                np.ones(len(o)),
                np.zeros(len(o)),
                2 * (k + 2 * self.major**2 * d[:, 1] ** 2),
                8 * self.major**2 * p[:, 1] * d[:, 1],
                k * k + 4 * self.major**2 * (p[:, 1] ** 2 - self.minor**2),
            ]
        )
        t = np.full((4, len(o)), np.inf)
        near = np.flatnonzero(dot(p, p) <= (self.major + self.minor) ** 2)
        roots = self.roots(c[:, near])
        t[:, near] = np.where(np.isfinite(roots), (roots + closer[near]) / length[near], np.inf)
        point = at(o, d * length[:, None], t)
        ring = point * [1, 0, 1]
        return t, point - self.major * ring / np.maximum(np.sqrt(dot(ring, ring)), 1e-300)[..., None]

    @staticmethod
    def roots(c):
        """Real roots (4, n) of the quartics with coefficients c (5, n), highest power first; inf where complex."""
        companion = np.zeros((c.shape[1], 4, 4))
        companion[:, 0] = -c[1:].T
        companion[:, 1, 0] = companion[:, 2, 1] = companion[:, 3, 2] = 1
        found = np.linalg.eigvals(companion).T
        real = found.real
        for _ in range(2):
            value = (((real + c[1]) * real + c[2]) * real + c[3]) * real + c[4]
            slope = ((4 * real + 3 * c[1]) * real + 2 * c[2]) * real + c[3]
            real = real - value / np.where(slope == 0, np.inf, slope)
        return np.where(np.abs(found.imag) < 1e-7, real, np.inf)

    def pov(self):
        return f"torus {{ {self.major!r}, {self.minor!r}{' sturm' if self.sturm else ''}"


@dataclass
class Disc(Shape):
    center: Vector
    normal: Vector
    radius: float
    hole: float = 0.0

    def hits(self, o, d):
        n = unit(np.asarray(self.normal, float))
        oc = o - np.asarray(self.center, float)
        with np.errstate(all="ignore"):
            t = (-(oc @ n) / (d @ n))[None]
        p = at(oc, d, t)
        r2 = dot(p, p)
        inside = np.isfinite(t) & (r2 <= self.radius**2) & (r2 >= self.hole**2)
        return np.where(inside, t, np.inf), np.broadcast_to(n, p.shape)

    def pov(self):
        return (
            f"disc {{ {vector_text(self.center)}, {vector_text(self.normal)}, {self.radius!r}, {self.hole!r}"
        )


@dataclass
class Triangle(Shape):
    """A triangle; with `normals` a smooth one.

    A smooth normal is the sum of the corners' normalised normals, weighted by the barycentric coordinates of
    the hit.  `single` rounds corners and normals to float32, as POV-Ray stores those of a mesh.
    """

    corners: Sequence[Vector]
    normals: Sequence[Vector] | None = None
    single: bool = False

    def hits(self, o, d):
        kind = np.float32 if self.single else float
        a, b, c = np.asarray(self.corners, kind).astype(float)
        e, f = b - a, c - a
        n = np.cross(e, f)
        with np.errstate(all="ignore"):
            t = (a - o) @ n / (d @ n)
        p = at(o - a, d, t[None])[0]
        v, w = np.cross(p, f) @ n / (n @ n), np.cross(e, p) @ n / (n @ n)
        inside = np.isfinite(t) & (v >= 0) & (w >= 0) & (v + w <= 1)
        if self.normals is None:
            shading = np.broadcast_to(n, p.shape)
        else:
            corner = unit(np.asarray(self.normals, float)).astype(kind).astype(float)
            shading = np.stack([1 - v - w, v, w], axis=1) @ corner
        return np.where(inside, t, np.inf)[None], shading[None]

    def pov(self):
        if self.normals is None:
            return "triangle { " + ", ".join(vector_text(p) for p in self.corners)
        pairs = (f"{vector_text(p)}, {vector_text(n)}" for p, n in zip(self.corners, self.normals))
        return "smooth_triangle { " + ", ".join(pairs)


@dataclass
class Mesh(Shape):
    """Triangles in POV-Ray's `mesh`, or with `indexed` in its `mesh2`; both keep them in single precision."""

    triangles: Sequence[Triangle]
    indexed: bool = False

    def __post_init__(self):
        for triangle in self.triangles:
            triangle.single = True

    def hits(self, o, d):
        parts = [triangle.hits(o, d) for triangle in self.triangles]
        return np.concatenate([t for t, _ in parts]), np.concatenate([n for _, n in parts])

    def pov(self):
        if not self.indexed:
            return "mesh { " + " ".join(triangle.pov() + " }" for triangle in self.triangles)
        count = 3 * len(self.triangles)
        corners = ", ".join(vector_text(p) for t in self.triangles for p in t.corners)
        faces = ", ".join(f"<{i}, {i + 1}, {i + 2}>" for i in range(0, count, 3))
        text = f"mesh2 {{ vertex_vectors {{ {count}, {corners} }}"
        if self.triangles[0].normals is not None:
            normals = ", ".join(vector_text(n) for t in self.triangles for n in t.normals)
            text += f" normal_vectors {{ {count}, {normals} }}"
        return text + f" face_indices {{ {len(self.triangles)}, {faces} }}"
