"""Remove nodes that the root doesn't lead to, unused meshes with them, and number the rest in derivation order.

before ::                       after ::

    0 object A 0 -> 3               0 object A 0 -> 1
    1 symbol B -> 2                 1 enter -> 2
    2 rule 1 -> 4                   2 symbol A -> 3
    3 enter -> 5                    …
    …
"""

from __future__ import annotations

from .. import graph as g
from ..rewrite import map_children


def prune(graph: g.Graph) -> None:
    order = list(graph.reachable())
    numbers = {old: new for new, old in enumerate(order)}
    for i, node in enumerate(graph.nodes):
        if i not in numbers and isinstance(node, g.Symbol):
            graph.left_out.append(g.LeftOut(f"symbol {node.name}", "no object leads to it"))
    graph.nodes = [graph.nodes[old] for old in order]
    for node in graph.nodes:
        map_children(node, numbers.__getitem__)
    _prune_meshes(graph)


def _prune_meshes(graph: g.Graph) -> None:
    used = sorted({node.mesh for node in graph.nodes if isinstance(node, g.MeshLeaf)})
    for i, mesh in enumerate(graph.meshes):
        if i not in used:
            graph.left_out.append(g.LeftOut(f"mesh {mesh.name}", "nothing uses it"))
    graph.meshes = [graph.meshes[i] for i in used]
    for node in graph.nodes:
        if isinstance(node, g.MeshLeaf):
            node.mesh = used.index(node.mesh)
