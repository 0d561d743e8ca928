"""Remove textures that another one replaces before any primitive is reached.

before ::                              after ::

    0 texture Bark {…} -> 1                0 texture Leaf {…} -> 2
    1 texture Leaf {…} -> 2                2 primitive sphere
    2 primitive sphere

A texture that draws stays: its draws move the ordinals of those below. So does one above a recursion without primitives: where
the detail cut-off ends it, boxes are drawn with the texture that is inherited there.
"""

from __future__ import annotations

from .. import graph as g
from ..rewrite import fixpoint, node_draws, redirect


def unused_textures(graph: g.Graph) -> None:
    # Whether a primitive below takes the texture that is inherited at the node.
    takes = [False] * len(graph.nodes)
    bare = _bare_recursions(graph)

    def step(i: int, node: g.Node) -> bool:
        if isinstance(node, (g.Primitive, g.MeshLeaf)) or i in bare:
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


def _bare_recursions(graph: g.Graph) -> set[int]:
    """The symbols that lead back to themselves, and to no primitive."""
    leads = [False] * len(graph.nodes)

    def step(_: int, node: g.Node) -> bool:
        return isinstance(node, (g.Primitive, g.MeshLeaf)) or any(leads[child] for child in node.children())

    fixpoint(graph, leads, step)
    return {
        i for i, node in enumerate(graph.nodes) if isinstance(node, g.Symbol) and not leads[i] and _returns(graph, i)
    }


def _returns(graph: g.Graph, start: int) -> bool:
    pending, met = list(graph.nodes[start].children()), set()
    while pending:
        i = pending.pop()
        if i == start:
            return True
        if i not in met:
            met.add(i)
            pending.extend(graph.nodes[i].children())
    return False
