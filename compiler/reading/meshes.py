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
    import trimesh

    try:
        # Smooth normals must be the file's own: trimesh makes some up when asked, so it is asked what it has.
        loaded = trimesh.load(
            trimesh.util.wrap_as_stream(data), file_type=path.suffix[1:].lower(), process=False, force="mesh"
        )
    except Exception as error:  # trimesh raises whatever its parsers ran into
        raise MeshError(f"it isn't a mesh that can be read ({type(error).__name__}: {error})") from None
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise MeshError("it has no triangles")
    vertices = numpy.array(loaded.vertices, dtype=numpy.float64)
    triangles = numpy.array(loaded.faces, dtype=numpy.int64)
    if not numpy.isfinite(vertices).all():
        raise MeshError("a vertex isn't a finite number")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise MeshError("a triangle refers to a vertex that isn't there")
    triangles = _with_area(vertices, triangles)
    if len(triangles) == 0:
        raise MeshError("all its triangles are degenerate")
    normals = numpy.zeros((0, 3))
    if "vertex_normals" in loaded._cache.cache:
        normals = numpy.array(loaded.vertex_normals, dtype=numpy.float64)
        if not numpy.isfinite(normals).all() or not (numpy.abs(normals).sum(axis=1)[triangles] > 0).all():
            raise MeshError("a vertex normal is zero or not a finite number")
    return Mesh(path.name, vertices, normals, triangles, triangles.copy() if len(normals) else triangles[:0])


def _with_area(vertices, triangles):
    """The triangles that have an area: others can't be hit."""
    import numpy

    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return triangles[numpy.any(numpy.cross(b - a, c - a) != 0, axis=1)]


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
