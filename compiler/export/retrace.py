"""Tracing single pixels again, exactly enough to say which of two pictures is right.

A pixel's colour hangs on decisions: which surface each ray of its ray tree hits, which lights are in shadow,
which square of a checker it is. The retracer takes these decisions over the unfolded primitives in extended
precision, for the pixel itself and for neighbours a millionth of a pixel away. Where neighbours decide
otherwise the pixel is *ambiguous*: rounding alone may turn it. Where they agree, a renderer that decided
otherwise is wrong.

Example: ``Retracer(graph).decide(pixel_rays)`` is a :class:`Verdict` with ``is_ambiguous`` and the hits to
compare with."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..graph.graph import Graph
from ..reading.diagnostics import PlsysError
from ..reading.model import Mesh
from .closed_forms import bounds
from .intersect import LONG, ROOTS, mesh_roots, normal
from .povray import values_of
from .textures import Palette, Texture
from .unfold import SHAPE_NAMES, Instances, concatenate, unfold

MOST_PRIMITIVES = 2_000_000
NEAREST, FARTHEST = 1e-4, 1e7  # POV-Ray's smallest and largest distance of a hit
SHADOW, CACHED_SHADOW = 1e-3, 1e-4  # … of a shadow's, and of an occluder's that it remembers
TIE = 1e-9  # hits closer together than this, relatively, may come in either order
CHECKER_BIAS = 1e-10


@dataclass
class Ray:
    """A ray that was decided: ``primitive`` is the nearest with a hit before ``end``, -1 for none. Shadow
    rays only ask whether there is one."""

    origin: np.ndarray
    direction: np.ndarray
    primitive: int
    end: float = np.inf
    is_shadow: bool = False


@dataclass
class Verdict:
    """``why`` a pixel is ambiguous, or ''; ``rays`` are the decisions along its ray tree."""

    why: str = ""
    rays: list[Ray] = field(default_factory=list)

    @property
    def is_ambiguous(self) -> bool:
        return bool(self.why)


@dataclass
class _Surface:
    """Where a bundle of rays hits: one part of one primitive."""

    primitive: int
    part: int
    distance: np.ndarray  # (k,)


class Retracer:
    """The unfolded scene, ready for single rays. Raises PlsysError for more than MOST_PRIMITIVES."""

    def __init__(self, graph: Graph) -> None:
        try:
            parts = list(unfold(graph, max_primitives=MOST_PRIMITIVES))
        except PlsysError as error:
            raise PlsysError(f"pixels can't be traced again: {error.reason}") from None
        self.meshes = graph.meshes
        self.scene: Instances | None = concatenate(parts) if parts else None
        self.lights = [values_of(light, "light") for light in graph.lights]
        settings = values_of(graph.settings, "settings")
        self.most_levels, self.bailout = int(settings["max_trace_level"][0]), settings["adc_bailout"][0]
        if self.scene is None:
            return
        self.low, self.high = bounds(self.scene, graph.meshes)
        distinct, self.texture_of = Palette(graph).distinct(self.scene)
        self.textures: list[Texture | None] = [texture for _, texture in distinct]

    def decide(self, origin: np.ndarray, directions: np.ndarray) -> Verdict:
        """``directions`` (k, 3): the pixel's own ray first, then its neighbours'; ``origin`` (3,)."""
        verdict = self._decide(origin, directions, [mesh.vertices for mesh in self.meshes])
        if self.meshes and not verdict.is_ambiguous:
            single = self._decide(origin, directions, [np.float32(mesh.vertices) for mesh in self.meshes])
            if [ray.primitive for ray in single.rays] != [ray.primitive for ray in verdict.rays]:
                verdict.why = "POV-Ray keeps meshes in single precision"
        return verdict

    def _decide(self, origin: np.ndarray, directions: np.ndarray, vertices: list[np.ndarray]) -> Verdict:
        verdict, self.vertices = Verdict(), vertices
        if self.scene is not None:
            origins = np.broadcast_to(origin, directions.shape).astype(LONG)
            self._follow(verdict, origins, directions.astype(LONG), level=0, weight=1.0)
        return verdict

    # --- the ray tree ---

    def _follow(self, verdict: Verdict, origins, directions, level: int, weight: float) -> None:
        """Decides one bundle of rays, then those that start where it hits. Stops at the first ambiguity."""
        if level >= self.most_levels or weight < self.bailout:
            return
        directions = directions / _length(directions)
        surface = self._nearest(verdict, *self._hits(origins, directions))
        # Secondary rays start on a surface, which they must not find again.
        start = origins[0] + (NEAREST * directions[0] if verdict.rays else 0)
        verdict.rays.append(Ray(start, directions[0], -1 if surface is None else surface.primitive))
        if surface is None or verdict.is_ambiguous:
            return
        points = origins + surface.distance[:, None] * directions
        texture = self.textures[self.texture_of[surface.primitive]]
        if texture is None:
            return
        if self._pattern_turns(texture, points):
            verdict.why = "on the edge of a pattern"
        for light in self.lights:
            if not verdict.is_ambiguous:
                self._shadow(verdict, points, light)
        through = float(texture.entries[:, 4:].max(initial=0.0))
        if through > 0 and level + 1 < self.most_levels and not verdict.is_ambiguous:
            self._follow(verdict, points, directions, level, weight * through)
        reflection = float(texture.value("reflection").max())
        if reflection > 0 and not verdict.is_ambiguous:
            n = self._normals(surface, points)
            mirrored = directions - 2 * np.sum(directions * n, axis=1, keepdims=True) * n
            self._follow(verdict, points, mirrored, level + 1, weight * reflection)

    def _nearest(self, verdict: Verdict, rows: np.ndarray, t: np.ndarray) -> _Surface | None:
        """The surface that the whole bundle hits first; None where it hits nothing. ``t`` is (roots, k,
        c)."""
        if t.size == 0:
            return None
        near = t[:, 0]
        if ((near > NEAREST / 2) & (near < 2 * NEAREST)).any():
            verdict.why = "a surface at POV-Ray's smallest distance"
        t = np.where((t >= NEAREST) & (t < FARTHEST), t, np.inf)
        table = t.transpose(1, 0, 2).reshape(t.shape[1], -1)
        foremost, which = table.min(axis=1), table.argmin(axis=1)
        if np.isinf(foremost).all():
            return None
        if np.isinf(foremost).any() or (which != which[0]).any():
            verdict.why = "a ray a millionth of a pixel away hits something else"
        second = np.partition(table[0], 1)[1] if table.shape[1] > 1 else np.inf
        if np.isfinite(second) and second - foremost[0] <= TIE * max(1.0, float(foremost[0])):
            verdict.why = "two surfaces coincide"
        part, column = divmod(int(which[0]), len(rows))
        return _Surface(int(rows[column]), part, foremost)

    def _shadow(self, verdict: Verdict, points: np.ndarray, light: dict) -> None:
        """One decision a light: all points of the bundle are lit alike, with either of POV-Ray's
        tolerances."""
        location = np.array(light["location"], LONG)
        towards = location - points
        if light["parallel"][0]:
            axis = np.array(light["point_at"], LONG) - location
            axis = axis / np.sqrt(np.sum(axis**2))
            towards = -axis * np.maximum(np.sum((points - location) * axis, axis=1, keepdims=True), 0)
        left = _length(towards)
        if light["shadowless"][0] or not (left > 2 * SHADOW).all():
            return
        directions = towards / left
        rows, t = self._hits(points, directions)
        t = t[:, :, ~self.scene.no_shadow[rows]]
        left = left[None]
        dark = ((t > SHADOW) & (t < left - SHADOW)).any(axis=(0, 2))
        if (dark != dark[0]).any() or (((t > CACHED_SHADOW) & (t < left)).any(axis=(0, 2)) != dark).any():
            verdict.why = "on the edge of a shadow"
            return
        start = points[0] + SHADOW * directions[0]
        end = float(left[0, 0, 0]) - 2 * SHADOW
        verdict.rays.append(Ray(start, directions[0], 0 if dark[0] else -1, end, is_shadow=True))

    def _pattern_turns(self, texture: Texture, points: np.ndarray) -> bool:
        """Whether the bundle's points fall on both sides of a jump of the pattern."""
        if texture.pattern == "solid":
            return False
        for m in (texture.frame, texture.value("matrix").reshape(3, 4)):
            inverse = np.linalg.inv(m[:, :3]).astype(LONG)
            points = (points - m[:, 3]) @ inverse.T
        if texture.pattern == "checker":
            value, margin = points + CHECKER_BIAS, CHECKER_BIAS / 100
        else:
            direction = texture.value("direction")
            value, margin = (points @ (direction / np.linalg.norm(direction)))[:, None], 1e-9
        cell = np.floor(value)
        close = np.abs(value[0] - np.rint(value[0])) < margin * np.maximum(1, np.abs(value[0]))
        return bool((cell != cell[0]).any() or close.any())

    # --- geometry ---

    def _hits(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All t of k rays with the primitives near the first: (c,) primitive numbers and (roots, k, c), NaN
        where there is none."""
        rows = self._near(origins[0].astype(float), directions[0].astype(float))
        found = []
        with np.errstate(all="ignore"):
            for row in rows:
                found.append(self._roots(row, origins, directions))
        most = max((len(r) for r in found), default=0)
        t = np.full((most, len(origins), len(rows)), np.nan, LONG)
        for i, roots in enumerate(found):
            t[: len(roots), :, i] = roots
        return rows, t

    def _near(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Primitives whose boxes, a little enlarged, the ray meets."""
        slack = 1e-5 * (
            1 + np.abs(origin).max() + np.where(np.isfinite(self.high - self.low), self.high - self.low, 0)
        )
        with np.errstate(all="ignore"):
            a, b = (self.low - slack - origin) / direction, (self.high + slack - origin) / direction
            enter, leave = np.fmin(a, b).max(axis=1), np.fmax(a, b).min(axis=1)
        return np.flatnonzero(~(enter > leave) & ~(leave < 0))

    def _roots(self, row: int, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        m = self.scene.matrix[row].astype(LONG)
        inverse = _inverse(m[:, :3])
        o, d = (origins - m[:, 3]) @ inverse.T, directions @ inverse.T
        kind, argument = SHAPE_NAMES[int(self.scene.kind[row])], LONG(self.scene.argument[row])
        if kind == "mesh":
            return np.array(
                mesh_roots(o, d, self.vertices[int(argument)], self.meshes[int(argument)].triangles)
            )
        return np.array(ROOTS[kind](o, d, argument))

    def _normals(self, surface: _Surface, points: np.ndarray) -> np.ndarray:
        """Unit normals (k, 3) in the world, as shading has them: smooth where a mesh is."""
        m = self.scene.matrix[surface.primitive].astype(LONG)
        inverse = _inverse(m[:, :3])
        local = (points - m[:, 3]) @ inverse.T
        kind, argument = (
            SHAPE_NAMES[int(self.scene.kind[surface.primitive])],
            self.scene.argument[surface.primitive],
        )
        if kind == "mesh":
            own = _mesh_normals(self.meshes[int(argument)], surface.part, local)
        else:
            own = normal(kind, surface.part, local, LONG(argument))
        world = own @ inverse
        return world / _length(world)


def _mesh_normals(mesh: Mesh, triangle: int, points: np.ndarray) -> np.ndarray:
    """The flat normal, or the corners' unit normals weighted by the barycentric coordinates of the points."""
    a, b, c = np.asarray(mesh.vertices, LONG)[mesh.triangles[triangle]]
    flat = np.cross(b - a, c - a)
    if not len(mesh.normals):
        return np.broadcast_to(flat, points.shape)
    v = np.cross(points - a, c - a) @ flat / (flat @ flat)
    w = np.cross(b - a, points - a) @ flat / (flat @ flat)
    corners = np.asarray(mesh.normals, LONG)[mesh.normal_triangles[triangle]]
    return np.stack([1 - v - w, v, w], axis=1) @ (corners / _length(corners))


def _length(v: np.ndarray) -> np.ndarray:
    """(k, 1) of (k, 3)."""
    return np.sqrt(np.sum(v * v, axis=1, keepdims=True))


def _inverse(a: np.ndarray) -> np.ndarray:
    """Of a (3, 3) longdouble matrix, by the adjugate: NumPy's own works in double."""
    rows = [np.cross(a[:, 1], a[:, 2]), np.cross(a[:, 2], a[:, 0]), np.cross(a[:, 0], a[:, 1])]
    return np.array(rows) / np.sum(a[:, 0] * rows[0])
