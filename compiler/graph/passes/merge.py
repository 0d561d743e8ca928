"""Merge adjacent constant transformations into one matrix.

before ::                                    after ::

    0 transform A <2 0 0 0 …> -> 1               0 transform A*B <2 0 0 6 …> -> 2
    1 transform B <1 0 0 3 …> -> 2               2 primitive sphere
    2 primitive sphere

Singular ones stay apart: rounding could make the product of one look regular. So do products that overflow or
underflow to a singular matrix.
"""

from __future__ import annotations

from dataclasses import replace

from .. import graph as g
from ..matrices import is_singular, regular_product


def merge(graph: g.Graph) -> None:
    absorbed: set[int] = set()
    for i in list(graph.reachable()):  # outer ones first
        node = graph.nodes[i]
        if i in absorbed or not isinstance(node, g.Transform):
            continue
        while isinstance(inner := graph.nodes[node.child], g.Transform) and (
            both := joined(graph, node, inner)
        ):
            absorbed.add(node.child)
            node.name, node.matrix, node.child = both.name, both.matrix, both.child


def joined(graph: g.Graph, outer: g.Transform, inner: g.Transform) -> g.Transform | None:
    """Both as one, above what stands below ``inner``, which is noted; None where one is singular, or their product isn't
    regular."""
    if is_singular(outer.matrix) or is_singular(inner.matrix):
        return None
    matrix = regular_product(outer.matrix, inner.matrix)
    if matrix is None:
        return None
    why = f"merged into {_shown(outer)}, which stands before it"
    graph.left_out.append(g.LeftOut(_shown(inner), why))
    name = "*".join(name for name in (outer.name, inner.name) if name)
    return replace(outer, name=name, matrix=matrix, child=inner.child)


def _shown(node: g.Transform) -> str:
    return f"transformation {node.name}" if node.name else "an inline transformation"
