"""Triangle meshes: from OBJ and PLY files through trimesh, and from the triangles of ``mesh { … }`` blocks.

Example::

    load(Path("leaf.obj"))            # Mesh('leaf.obj', vertices (n, 3), normals (n, 3), triangles (k, 3), …)
"""

from __future__ import annotations

from pathlib import Path
from typing import Sequence

from .model import Mesh


class MeshError(Exception):
    """A mesh file that can't be used, and why."""


def load(path: Path) -> Mesh:
    """The mesh in the OBJ or PLY file at ``path``: its triangles in the file's order (polygons are cut into
    triangles), smooth where the file has vertex normals. Raises MeshError."""
    if path.suffix.lower() not in (".obj", ".ply"):
        raise MeshError("only OBJ and PLY files can be read")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(error.strerror or str(error)) from None
    import numpy

    groups = _groups(path, data)
    vertices = numpy.concatenate([group[0] for group in groups])
    if not numpy.isfinite(vertices).all():
        raise MeshError("a vertex isn't a finite number")
    triangles = _joined([(len(group[0]), group[1]) for group in groups])
    if len(triangles) == 0:
        raise MeshError("it has no triangles")
    kept = _with_area(vertices, triangles)
    if not kept.any():
        raise MeshError("all its triangles are degenerate")
    empty = numpy.zeros((0, 3))
    if all(group[2] is None for group in groups):
        return Mesh(path.name, vertices, empty, triangles[kept], triangles[:0])
    normals, normal_triangles = _normals(groups)
    if not numpy.isfinite(normals).all() or not normals[normal_triangles[kept]].any(axis=2).all():
        raise MeshError("a vertex normal is zero or not a finite number")
    return Mesh(path.name, vertices, normals, triangles[kept], normal_triangles[kept])


def _groups(path: Path, data: bytes) -> list[tuple]:
    """(vertices, triangles, normals or None) of each group of the file; an OBJ file may have several. trimesh's
    loaders are called below its Trimesh class, which would make up normals and forget which were the file's."""
    import numpy
    import trimesh
    from trimesh.exchange.obj import load_obj
    from trimesh.exchange.ply import load_ply

    stream = trimesh.util.wrap_as_stream(data)
    try:
        if path.suffix.lower() == ".obj":
            found = load_obj(stream, skip_materials=True)
            parts = list(found["geometry"].values()) if "geometry" in found else [found]
        else:
            parts = [load_ply(stream, skip_materials=True)]
        groups = []
        for part in parts:
            if part.get("faces") is None or len(part["faces"]) == 0:
                continue
            vertices = numpy.array(part["vertices"], dtype=numpy.float64).reshape(-1, 3)
            faces = numpy.array(trimesh.geometry.triangulate_quads(part["faces"]), dtype=numpy.int64).reshape(
                -1, 3
            )
            normals = part.get("vertex_normals")
            if normals is not None and len(normals) != len(vertices):
                normals = None
            groups.append(
                (vertices, faces, None if normals is None else numpy.array(normals, dtype=numpy.float64))
            )
    except Exception as error:  # the loaders raise whatever they run into in a broken file
        raise MeshError(f"it isn't a mesh that can be read ({type(error).__name__}: {error})") from None
    if not groups:
        raise MeshError("it has no triangles")
    if any(faces.min() < 0 or faces.max() >= len(vertices) for vertices, faces, _ in groups):
        raise MeshError("a triangle refers to a vertex that isn't there")
    return groups


def _joined(parts: Sequence[tuple]):
    """The triangles of all groups, given as (how many vertices, triangles), with indices into all vertices."""
    import numpy

    offsets = numpy.cumsum([0, *(count for count, _ in parts)])
    return numpy.concatenate([triangles + offset for offset, (_, triangles) in zip(offsets, parts)])


def _normals(groups: Sequence[tuple]) -> tuple:
    """Normals and normal indices of all groups; a group without has those of its triangles' planes."""
    import numpy

    normals, parts = [], []
    for vertices, triangles, given in groups:
        if given is None:
            a, b, c = (vertices[triangles[:, i]] for i in range(3))
            given = numpy.cross(b - a, c - a)
            triangles = numpy.repeat(numpy.arange(len(triangles))[:, None], 3, axis=1)
        normals.append(given)
        parts.append((len(given), triangles))
    return numpy.concatenate(normals), _joined(parts)


def _with_area(vertices, triangles):
    """Which triangles have an area: others can't be hit."""
    import numpy

    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return numpy.any(numpy.cross(b - a, c - a) != 0, axis=1)


def build(name: str, triangles: Sequence[Sequence[tuple[float, ...]]]) -> Mesh:
    """A mesh of triangles, each three points, or three points with their normals in between. When one is smooth,
    a flat one's normals are its own plane's."""
    import numpy

    smooth = any(len(triangle) == 6 for triangle in triangles)
    points: dict[tuple[float, ...], int] = {}
    normals: dict[tuple[float, ...], int] = {}
    corners, normal_corners = [], []
    for triangle in triangles:
        own = triangle[::2] if len(triangle) == 6 else triangle
        corners.append([points.setdefault(tuple(point), len(points)) for point in own])
        if smooth:
            flat = tuple(numpy.cross(numpy.subtract(own[1], own[0]), numpy.subtract(own[2], own[0])).tolist())
            given = triangle[1::2] if len(triangle) == 6 else (flat,) * 3
            normal_corners.append([normals.setdefault(tuple(normal), len(normals)) for normal in given])
    return Mesh(
        name,
        numpy.array(list(points), dtype=numpy.float64),
        numpy.array(list(normals), dtype=numpy.float64).reshape(-1, 3),
        numpy.array(corners, dtype=numpy.int64),
        numpy.array(normal_corners, dtype=numpy.int64).reshape(-1, 3),
    )
