"""A graph → a triangle mesh: Wavefront OBJ with its materials, through trimesh.

The scene is unfolded twice: once for its exact size and volume, once to be tessellated so that no facet is
further from its surface than the tolerance. Each texture is one object and one material; flat shapes are
objects of their own, so that the others enclose their volume.

Example: ``export_mesh(graph, "tree.obj", tolerance=0.01).error`` is 0.0099: the largest distance there is.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..graph.graph import Graph
from ..reading.diagnostics import PlsysError
from .closed_forms import bounds, volumes
from .matrices import apply, determinant
from .meshers import MESHERS, Mesher, segments_for
from .files import whole_file
from .output import Exported, check_size
from .textures import Palette, Texture
from .unfold import SHAPE_NAMES, Instances, unfold

DEFAULT_TOLERANCE = 1e-3  # of the scene's diagonal
MOST_TRIANGLES = 20_000_000
OPEN = "_open"  # in names of objects that needn't enclose a volume: flat shapes and meshes
FINISHES = ("emission", "reflection")  # what a material of the format can't say


@dataclass
class ExportedMesh(Exported):
    """``tolerance`` asked for and ``error`` reached, in scene units. ``volume`` of the solids and ``low``,
    ``high`` of everything but planes are the exact scene's; ``mesh_volume`` is that of the facets, from
    closed forms as well."""

    tolerance: float = 0.0
    error: float = 0.0
    triangles: int = 0
    volume: float = 0.0
    mesh_volume: float = 0.0
    textures: dict[str, Texture | None] = field(default_factory=dict)  # by object name
    low: np.ndarray = field(default_factory=lambda: np.full(3, np.inf))
    high: np.ndarray = field(default_factory=lambda: np.full(3, -np.inf))


@dataclass
class _Part:
    """The mesh of one texture's solids, or of its flat shapes and meshes."""

    name: str
    texture: Texture | None
    vertices: list[np.ndarray] = field(default_factory=list)
    faces: list[np.ndarray] = field(default_factory=list)
    size: int = 0

    def add(self, vertices: np.ndarray, faces: np.ndarray) -> int:
        """Appends (n, k, 3) vertices with (n, t, 3) faces of their own; the number of triangles added."""
        n, k = vertices.shape[:2]
        faces = faces + (self.size + k * np.arange(n))[:, None, None]
        self.vertices.append(vertices.reshape(-1, 3))
        self.faces.append(faces.reshape(-1, 3))
        self.size += n * k
        return n * faces.shape[1]


def export_mesh(
    graph: Graph, path: str | Path, tolerance: float | None = None, **limits: int
) -> ExportedMesh:
    """Writes ``path`` and the .mtl beside it, whole or not at all. ``tolerance`` is in scene units (None: a
    thousandth of the scene's diagonal). Raises PlsysError for a tolerance that isn't positive, a scene
    without anything to tessellate, or more than MOST_TRIANGLES triangles."""
    check_size(graph)
    result = _measure(graph, limits)
    diagonal = float(np.linalg.norm(result.high - result.low)) if np.isfinite(result.low).all() else 0.0
    if diagonal == 0:
        raise PlsysError("the scene has nothing that a mesh can hold")
    result.tolerance = DEFAULT_TOLERANCE * diagonal if tolerance is None else tolerance
    if not (0 < result.tolerance < math.inf):
        raise PlsysError(f"a tolerance must be a positive number of scene units, not {tolerance}")
    parts = _tessellate(graph, result, limits)
    result.textures = {part.name: part.texture for part in parts}
    _note_losses(graph, result, parts)
    _write(parts, Path(path), result)
    return result


def _measure(graph: Graph, limits: dict[str, int]) -> ExportedMesh:
    result = ExportedMesh()
    unfolding = unfold(graph, **limits)
    for batch in unfolding:
        result.count(batch)
        result.volume += math.fsum(volumes(batch))
        low, high = bounds(batch, graph.meshes)
        finite = np.isfinite(low).all(axis=1)
        if finite.any():
            result.low = np.minimum(result.low, low[finite].min(axis=0))
            result.high = np.maximum(result.high, high[finite].max(axis=0))
    result.finish(unfolding)
    return result


def _tessellate(graph: Graph, result: ExportedMesh, limits: dict[str, int]) -> list[_Part]:
    parts: dict[tuple[bytes, bool], _Part] = {}
    names: set[str] = set()
    palette = Palette(graph)
    for batch in unfold(graph, **limits):
        textures, of = palette.distinct(batch)
        for number, (key, texture) in enumerate(textures):
            mine = batch.take(of == number)
            for kind in np.unique(mine.kind):
                name = SHAPE_NAMES[int(kind)]
                if name == "plane":
                    continue
                solid = name in MESHERS and MESHERS[name].solid
                part = parts.get((key, solid))
                if part is None:
                    part = parts[key, solid] = _Part(_name(texture, solid, names), texture)
                _add(part, name, mine.take(mine.kind == kind), graph, result)
    return list(parts.values())


def _name(texture: Texture | None, solid: bool, taken: set[str]) -> str:
    base = (texture.name if texture and texture.name else "Texture") + ("" if solid else OPEN)
    name, number = base, 2
    while name in taken:
        name, number = f"{base}_{number}", number + 1
    taken.add(name)
    return name


def _add(part: _Part, name: str, batch: Instances, graph: Graph, result: ExportedMesh) -> None:
    """Tessellate instances of one shape; those that need equally fine meshes together."""
    if name == "mesh":
        for index in np.unique(batch.argument):
            mesh, here = graph.meshes[int(index)], batch.take(batch.argument == index)
            _place(part, here.matrix, np.asarray(mesh.vertices), np.asarray(mesh.triangles), result)
        return
    mesher = MESHERS[name]
    stretch = _stretch(name, batch.matrix)
    groups: dict[tuple[float, int], list[int]] = {}
    for i, (argument, scale) in enumerate(zip(batch.argument.tolist(), stretch.tolist())):
        groups.setdefault((argument, _segments(mesher, result.tolerance / scale, argument)), []).append(i)
    for (argument, n), rows in groups.items():
        if mesher.volume is not None:
            result.mesh_volume += mesher.volume(n, argument) * math.fsum(
                np.abs(determinant(batch.matrix[rows]))
            )
        result.error = max(result.error, float(mesher.error(n, argument) * stretch[rows].max()))
        _place(part, batch.matrix[rows], *mesher.build(n, argument), result)


def _segments(mesher: Mesher, relative: float, argument: float) -> int:
    """Segments for a relative tolerance, rounded down to a power of 2^(1/4) so that neighbours share a
    mesh."""
    return segments_for(mesher, 2.0 ** (math.floor(4 * math.log2(relative)) / 4), argument)


def _stretch(name: str, m: np.ndarray) -> np.ndarray:
    """(n,): how much a transform magnifies the chords' error at most."""
    columns = 2 if name in ("cylinder", "cone", "disc") else 3
    return np.linalg.norm(m[:, :, :columns], ord=2, axis=(1, 2))


def _place(part: _Part, m: np.ndarray, vertices: np.ndarray, faces: np.ndarray, result: ExportedMesh) -> None:
    result.triangles += len(m) * len(faces)
    if result.triangles > MOST_TRIANGLES:
        raise PlsysError(
            f"the mesh needs more than {MOST_TRIANGLES} triangles; a larger tolerance needs fewer"
        )
    mirrored = determinant(m) < 0
    faces = np.where(mirrored[:, None, None], faces[None, :, ::-1], faces[None])
    part.add(apply(m, vertices), faces)


def _note_losses(graph: Graph, result: ExportedMesh, parts: list[_Part]) -> None:
    lost = result.lost
    if planes := result.by_kind["plane"]:
        lost.append(f"{planes} plane{'s' if planes > 1 else ''}, without end")
    textures = [part.texture for part in parts if part.texture]
    if patterns := sorted({t.pattern for t in textures} - {"solid"}):
        lost.append(f"patterns ({', '.join(patterns)}): materials have the first colour")
    for name in FINISHES:
        if any(t.value(name).any() for t in textures):
            lost.append(name)
    if graph.camera or graph.lights:
        lost.append("camera, lights and background")


def _write(parts: list[_Part], path: Path, result: ExportedMesh) -> None:
    import trimesh
    from trimesh.exchange.obj import export_obj

    digits = digits_of(result.tolerance)
    result.error += math.sqrt(3) / 2 * 10.0**-digits
    meshes = []
    for part in parts:
        mesh = trimesh.Trimesh(np.concatenate(part.vertices), np.concatenate(part.faces), process=False)
        mesh.visual = trimesh.visual.TextureVisuals(material=_material(part))
        mesh.metadata["name"] = part.name
        meshes.append(mesh)
    header = [f"Written by plsys: {result.primitives} primitives, {result.triangles} triangles"]
    header.append(f"at most {result.error:.3g} scene units from the surfaces")
    header += [f"not carried: {line}" for line in result.lost]
    materials = path.with_suffix(".mtl")
    text, files = export_obj(
        trimesh.Scene(meshes),
        include_normals=False,
        digits=digits,
        mtl_name=materials.name,
        header="\n# ".join(header),
        return_texture=True,
        write_texture=False,
    )
    with whole_file(path) as file, whole_file(materials) as library:
        library.write(files[materials.name].decode() + "\n")
        file.write(text)


def _material(part: _Part):
    """A trimesh material that writes all digits (trimesh's own keep 8 bits a colour)."""
    from trimesh.visual.material import SimpleMaterial

    class Material(SimpleMaterial):
        def to_obj(self, name=None):
            return {f"{self.name}.mtl": material_text(part.name, part.texture).encode()}, self.name

        def __hash__(self):
            return hash(self.name)

    logging.getLogger("trimesh").setLevel(logging.ERROR)
    return Material(name=part.name)


def material_text(name: str, texture: Texture | None) -> str:
    """A material in linear light: Ka and Kd are the pigment times ambient and 1, Ks the stronger
    highlight."""
    if texture is None:
        return f"newmtl {name}\nKa 0 0 0\nKd 0 0 0\nKs 0 0 0\nNs 1"
    color = texture.entries[0, 1:4] if len(texture.entries) else np.zeros(3)
    filtered = float(texture.entries[0, 4:].sum()) if len(texture.entries) else 0.0
    phong, specular = float(texture.value("phong")[0]), float(texture.value("specular")[0])
    size = (
        float(texture.value("phong_size")[0])
        if phong >= specular
        else 1 / float(texture.value("roughness")[0])
    )
    numbers = {
        "Ka": color * texture.value("ambient"),
        "Kd": color,
        "Ks": np.full(3, max(phong, specular)),
        "Ns": [size],
        "d": [1 - min(1.0, filtered)],
    }
    return "\n".join(
        [f"newmtl {name}", *(f"{k} " + " ".join(f"{float(v)!r}" for v in vs) for k, vs in numbers.items())]
    )


# --- reading back ---


@dataclass
class MeshRead:
    """What stands in a file: ``volume`` and ``area`` of the objects that enclose one, and everything's
    bounds."""

    triangles: int
    volume: float
    area: float
    watertight: bool
    low: np.ndarray
    high: np.ndarray
    objects: dict[str, object]  # name -> trimesh.Trimesh


def read_back(path: str | Path) -> MeshRead:
    """Reads an exported .obj with trimesh."""
    import trimesh

    logging.getLogger("trimesh").setLevel(logging.ERROR)
    scene = trimesh.load_scene(
        path, split_objects=True, group_material=False, process=False, maintain_order=True
    )
    objects = {mesh.metadata.get("name", name): mesh for name, mesh in scene.geometry.items()}
    solid = [mesh for name, mesh in objects.items() if OPEN not in name]
    corners = np.array([mesh.bounds for mesh in objects.values()])
    return MeshRead(
        triangles=sum(len(mesh.faces) for mesh in objects.values()),
        volume=math.fsum(float(mesh.volume) for mesh in solid),
        area=math.fsum(float(mesh.area) for mesh in objects.values()),
        watertight=all(mesh.is_watertight and mesh.is_winding_consistent for mesh in solid),
        low=corners[:, 0].min(axis=0),
        high=corners[:, 1].max(axis=0),
        objects=objects,
    )


def agrees(exported: ExportedMesh, read: MeshRead) -> bool:
    """Whether a mesh read back is closed and has the scene's bounds within the stated error, the facets'
    volume within the rounding of its numbers, and the exact volume as closely as surfaces moved by the error
    can have it (area times error to first order; doubled for the rest)."""
    off = np.abs(np.concatenate([read.low - exported.low, read.high - exported.high]))
    rounding = read.area * 10.0 ** -digits_of(exported.tolerance) + 1e-12
    return (
        read.watertight
        and bool((off <= exported.error * (1 + 1e-9)).all())
        and abs(read.volume - exported.mesh_volume) <= rounding
        and abs(read.volume - exported.volume) <= 2 * read.area * exported.error + rounding
    )


def digits_of(tolerance: float) -> int:
    """Decimals that keep rounding below a thousandth of the tolerance."""
    return min(17, max(3, math.ceil(3 - math.log10(tolerance))))
