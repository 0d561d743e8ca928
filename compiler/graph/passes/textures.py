"""Remove textures that another one replaces before any primitive is reached.

before ::                              after ::

    0 texture Bark {…} -> 1                0 texture Leaf {…} -> 2
    1 texture Leaf {…} -> 2                2 primitive sphere
    2 primitive sphere

A texture that draws stays: its draws move the ordinals of those below.
"""

from __future__ import annotations

from .. import graph as g
from ..rewrite import fixpoint, node_draws, redirect


def unused_textures(graph: g.Graph) -> None:
    # Whether a primitive below takes the texture that is inherited at the node.
    takes = [False] * len(graph.nodes)

    def step(i: int, node: g.Node) -> bool:
        if isinstance(node, (g.Primitive, g.MeshLeaf)):
            return True
        return not isinstance(node, g.Texture) and any(takes[child] for child in node.children())

    fixpoint(graph, takes, step)
    targets = {}
    for i, node in enumerate(graph.nodes):
        if isinstance(node, g.Texture) and not takes[node.child] and not node_draws(node):
            targets[i] = node.child
            graph.left_out.append(
                g.LeftOut(f"texture {node.name}".strip(), "always replaced by another one below it")
            )
    redirect(graph, targets)
