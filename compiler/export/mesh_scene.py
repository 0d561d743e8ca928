"""A mesh read back from a file → a graph that can be drawn like the scene it came from.

Each object of the file is one mesh leaf under the texture that it was exported with; camera, lights and the
planes, which the file can't carry, are the scene's.

Example: ``mesh_graph(graph, exported, read_back("tree.obj"))``
"""

from __future__ import annotations

import numpy as np

from ..bytecode.layout_rows import PATTERNS, RECORDS, SHAPES
from ..graph import graph as g
from ..reading.model import Constant, Mesh, TextureValue
from .matrices import chain
from .mesh import ExportedMesh, MeshRead
from .textures import RECORD, Palette, Texture
from .unfold import unfold


def mesh_graph(graph: g.Graph, exported: ExportedMesh, read: MeshRead) -> g.Graph:
    """The graph of the meshes of ``read``, seen and lit as ``graph`` is."""
    result = g.Graph(settings=graph.settings, camera=graph.camera, lights=graph.lights)
    result.add(g.Union(()))
    objects = []
    for name, mesh in read.objects.items():
        result.meshes.append(
            Mesh(
                name,
                np.asarray(mesh.vertices),
                np.zeros((0, 3)),
                np.asarray(mesh.faces),
                np.zeros((0, 3), np.int64),
            )
        )
        leaf = result.add(g.MeshLeaf(len(result.meshes) - 1))
        objects.append(_object(result, exported.textures.get(name), leaf))
    for texture, matrix in _planes(graph):
        leaf = result.add(g.Primitive("plane"))
        leaf = result.add(g.Transform("", tuple(matrix.ravel().tolist()), leaf))
        objects.append(_object(result, texture, leaf))
    if len(objects) == 1:
        result.nodes[0] = result.nodes[objects[0]]
    else:
        result.nodes[0] = g.Union(tuple(objects))
    return result


def _object(graph: g.Graph, texture: Texture | None, child: int) -> int:
    if texture is not None:
        child = graph.add(g.Texture(texture.name, texture_value(texture), child))
    return graph.add(g.Object("", 0, child))


def _planes(graph: g.Graph) -> list[tuple[Texture | None, np.ndarray]]:
    palette, found = Palette(graph), []
    for batch in unfold(graph):
        rows = np.flatnonzero(batch.kind == SHAPES["plane"].id)
        if len(rows):
            planes = batch.take(rows)
            textures, of = palette.distinct(planes)
            found += [(textures[i][1], planes.matrix[k]) for k, i in enumerate(of.tolist())]
    return found


def texture_value(texture: Texture) -> TextureValue:
    """The constant texture whose frame is the world: a pattern's own matrix takes in the frame where it
    stood."""
    row = texture.row.copy()
    field = RECORDS["texture"].values["matrix"]
    if texture.pattern != "solid":
        own = row[field.offset : field.offset + field.size].reshape(3, 4)
        row[field.offset : field.offset + field.size] = chain(texture.frame, own).ravel()
    values = {
        name: tuple(Constant(float(v)) for v in row[value.offset : value.offset + value.size])
        for name, value in RECORD.values.items()
    }
    values["pattern"] = (Constant(float(PATTERNS[texture.pattern])),)
    entries = tuple(tuple(Constant(float(v)) for v in entry) for entry in texture.entries)
    return TextureValue(tuple(values.items()), entries)
