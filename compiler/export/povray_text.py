"""POV-Ray's spelling of numbers, textures and primitives.

Numbers are written with the fewest digits that read back as the same double (17 at most). A primitive is
written in world coordinates, ``cylinder{p0,p1,r}`` and its like, wherever its transform keeps the shape what
it is, and as the unit shape with a ``matrix`` otherwise: the first takes half of POV-Ray's memory.

Example: the unit cylinder, scaled by .15 .15 2, is ``cylinder{<0.0,0.0,0.0>,<0.0,0.0,2.0>,0.15}``.
"""

from __future__ import annotations

from typing import Callable, Sequence

import numpy as np

from ..bytecode.layout_rows import SHAPES
from ..reading.model import Mesh
from .matrices import IDENTITY
from .textures import Texture
from .unfold import Instances

ROUND = 1e-12
"""How far, relatively, a transform may be from a similarity and still count as one. Chains of a thousand
rotations stay below it, and it moves no surface by more than a millionth of the 1e-5 that pictures are
compared at."""

SMALLEST = 1e-7
"""POV-Ray refuses cylinders and cones shorter than 1e-10; below this size they are written with a matrix."""

VECTOR = "<%r,%r,%r>"
MATRIX = "matrix<" + ",".join(["%r"] * 12) + ">"


def vector(values: Sequence[float]) -> str:
    return "<" + ",".join(repr(float(v)) for v in values) + ">"


def povray_order(m: np.ndarray) -> np.ndarray:
    """(n, 3, 4) → (n, 12): the images of x, y and z, then the origin's."""
    return m.swapaxes(1, 2).reshape(-1, 12)


def matrix(m: np.ndarray) -> str:
    return "matrix<" + ",".join(repr(float(v)) for v in povray_order(m[None])[0]) + ">"


def color(entry: np.ndarray) -> str:
    """Of (red, green, blue, filter, transmit)."""
    return "rgb" + vector(entry[:3]) if not entry[3:].any() else "rgbft" + vector(entry)


def texture(value: Texture) -> str:
    """A whole ``texture { … }``; a pattern carries the frame where its texture stands."""
    if value.pattern == "solid":
        pigment = color(value.entries[0, 1:]) if len(value.entries) else "rgb 0"
    else:
        if value.pattern == "checker":
            pigment = "checker " + " ".join(color(entry[1:]) for entry in value.entries)
        else:
            stops = " ".join(f"[{float(entry[0])!r} {color(entry[1:])}]" for entry in value.entries)
            pigment = f"gradient {vector(value.value('direction'))} color_map {{ {stops} }}"
        own = value.value("matrix").reshape(3, 4)
        if not np.array_equal(own, IDENTITY):
            pigment += " " + matrix(own)
    placed = (
        "" if value.pattern == "solid" or np.array_equal(value.frame, IDENTITY) else " " + matrix(value.frame)
    )
    return f"texture {{ pigment {{ {pigment} }} {finish(value)}{placed} }}"


def finish(value: Texture) -> str:
    words = []
    for name in ("ambient", "emission"):
        words.append(f"{name} rgb{vector(value.value(name))}")
    for name in ("diffuse", "brilliance", "phong", "phong_size", "specular", "roughness"):
        words.append(f"{name} {float(value.value(name)[0])!r}")
    if value.value("reflection").any():
        words.append(f"reflection {{ rgb{vector(value.value('reflection'))} }}")
    return f"finish {{ {' '.join(words)} }}"


def mesh2(mesh: Mesh) -> str:
    """A ``mesh2 { … }``; POV-Ray keeps its vertices and normals in single precision."""
    parts = [_listed("vertex_vectors", mesh.vertices, float)]
    if len(mesh.normals):
        parts.append(_listed("normal_vectors", mesh.normals, float))
    parts.append(_listed("face_indices", mesh.triangles, int))
    if len(mesh.normals):
        parts.append(_listed("normal_indices", mesh.normal_triangles, int))
    return "mesh2 {\n" + "\n".join(parts) + "\n}"


def _listed(word: str, rows: np.ndarray, kind: type) -> str:
    items = ",\n".join("<" + ",".join(repr(kind(v)) for v in row) + ">" for row in rows)
    return f"{word} {{ {len(rows)},\n{items} }}"


# --- primitives ---


def primitives(batch: Instances) -> np.ndarray:
    """(n,) object array of texts, each a whole object without a texture."""
    texts = np.empty(len(batch), dtype=object)
    for kind, write in WRITERS.items():
        rows = np.flatnonzero(batch.kind == kind)
        if len(rows):
            write(batch.matrix[rows], batch.argument[rows], texts, rows)
    return texts


def _fill(texts: np.ndarray, rows: np.ndarray, form: str, *columns: np.ndarray) -> None:
    """texts[rows] := form with one row of the columns each."""
    table = np.concatenate([c if c.ndim == 2 else c[:, None] for c in columns], axis=1)
    texts[rows] = [form % tuple(row) for row in table.tolist()]


def _columns(m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Images of the axes and of the origin, (n, 3) each."""
    return m[:, :, 0], m[:, :, 1], m[:, :, 2], m[:, :, 3]


def _length(v: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sum(v * v, axis=1))


def _orthogonal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(np.sum(a * b, axis=1)) <= ROUND * _length(a) * _length(b)


def _equal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vectors of the same length."""
    return np.abs(_length(a) - _length(b)) <= ROUND * _length(a)


def _keeps_circles(m: np.ndarray) -> np.ndarray:
    x, y, _, _ = _columns(m)
    return _orthogonal(x, y) & _equal(x, y) & (_length(x) > SMALLEST)


def _upright(m: np.ndarray) -> np.ndarray:
    """Circles stay circles and the axis stays perpendicular to them."""
    x, y, z, _ = _columns(m)
    return _keeps_circles(m) & _orthogonal(x, z) & _orthogonal(y, z) & (_length(z) > SMALLEST)


def _radius(m: np.ndarray) -> np.ndarray:
    return (_length(m[:, :, 0]) + _length(m[:, :, 1])) / 2


def _sphere(m, argument, texts, rows):
    round_ = _upright(m) & _equal(m[:, :, 0], m[:, :, 2])
    _fill(texts, rows[round_], f"sphere{{{VECTOR},%r}}", m[round_, :, 3], _radius(m[round_]))
    _fill(texts, rows[~round_], f"sphere{{0,1 {MATRIX}}}", povray_order(m[~round_]))


def _cylinder(m, argument, texts, rows):
    round_ = _upright(m)
    base, top = m[round_, :, 3], m[round_, :, 3] + m[round_, :, 2]
    _fill(texts, rows[round_], f"cylinder{{{VECTOR},{VECTOR},%r}}", base, top, _radius(m[round_]))
    _fill(texts, rows[~round_], f"cylinder{{0,z,1 {MATRIX}}}", povray_order(m[~round_]))


def _cone(m, argument, texts, rows):
    round_ = _upright(m)
    base, top, radius = m[round_, :, 3], m[round_, :, 3] + m[round_, :, 2], _radius(m[round_])
    form = f"cone{{{VECTOR},%r,{VECTOR},%r}}"
    _fill(texts, rows[round_], form, base, radius, top, radius * argument[round_])
    _fill(texts, rows[~round_], f"cone{{0,1,z,%r {MATRIX}}}", argument[~round_], povray_order(m[~round_]))


def _box(m, argument, texts, rows):
    """POV-Ray's box is parallel to the axes: so must the images of the axes be, exactly."""
    parallel = ((m[:, :, :3] != 0).sum(axis=1) == 1).all(axis=1) & (_length(m[:, :, 0]) > SMALLEST)
    base = m[parallel, :, 3]
    corner = base + m[parallel, :, :3].sum(axis=2)
    low, high = np.minimum(base, corner), np.maximum(base, corner)
    _fill(texts, rows[parallel], f"box{{{VECTOR},{VECTOR}}}", low, high)
    _fill(texts, rows[~parallel], f"box{{0,1 {MATRIX}}}", povray_order(m[~parallel]))


def _torus(m, argument, texts, rows):
    """POV-Ray's stands about y: its y is our z, and its z our -y."""
    turned = np.stack([m[:, :, 0], m[:, :, 2], -m[:, :, 1], m[:, :, 3]], axis=2)
    _fill(texts, rows, f"torus{{1,%r sturm {MATRIX}}}", argument, povray_order(turned))


def _triangle(m, argument, texts, rows):
    x, y, _, origin = _columns(m)
    _fill(texts, rows, f"triangle{{{VECTOR},{VECTOR},{VECTOR}}}", origin, origin + x, origin + y)


def _square(m, argument, texts, rows):
    x, y, _, o = _columns(m)
    _fill(texts, rows, "polygon{5," + ",".join([VECTOR] * 5) + "}", o, o + x, o + x + y, o + y, o)


def _disc(m, argument, texts, rows):
    round_ = _keeps_circles(m)
    x, y, _, origin = _columns(m[round_])
    normal = np.cross(x, y) / np.sum(x * x, axis=1, keepdims=True)
    _fill(texts, rows[round_], f"disc{{{VECTOR},{VECTOR},%r}}", origin, normal, _radius(m[round_]))
    _fill(texts, rows[~round_], f"disc{{0,z,1 {MATRIX}}}", povray_order(m[~round_]))


def _plane(m, argument, texts, rows):
    x, y, z, origin = _columns(m)
    normal = np.cross(x, y)
    normal *= np.sign(np.sum(normal * z, axis=1, keepdims=True)) / _length(normal)[:, None]
    _fill(texts, rows, f"plane{{{VECTOR},%r}}", normal, np.sum(normal * origin, axis=1))


def _mesh(m, argument, texts, rows):
    texts[rows] = [f"object{{Mesh{int(a)} {matrix(one)}}}" for a, one in zip(argument, m)]


WRITERS: dict[int, Callable] = {
    0: _mesh,
    SHAPES["sphere"].id: _sphere,
    SHAPES["cylinder"].id: _cylinder,
    SHAPES["cone"].id: _cone,
    SHAPES["box"].id: _box,
    SHAPES["torus"].id: _torus,
    SHAPES["triangle"].id: _triangle,
    SHAPES["square"].id: _square,
    SHAPES["disc"].id: _disc,
    SHAPES["plane"].id: _plane,
}
