"""Merge adjacent constant transformations into one matrix.

before ::                                    after ::

    0 transform A <2 0 0 0 …> -> 1               0 transform A*B <2 0 0 6 …> -> 2
    1 transform B <1 0 0 3 …> -> 2               2 primitive sphere
    2 primitive sphere

Singular ones stay apart: rounding could make the product of one look regular. So do products that overflow or
underflow to a singular matrix.
"""

from __future__ import annotations

from .. import graph as g
from ..matrices import is_singular, regular_product


def merge(graph: g.Graph) -> None:
    absorbed: set[int] = set()
    for i in list(graph.reachable()):  # outer ones first
        node = graph.nodes[i]
        if i in absorbed or not isinstance(node, g.Transform) or is_singular(node.matrix):
            continue
        while isinstance(inner := graph.nodes[node.child], g.Transform) and not is_singular(inner.matrix):
            product = regular_product(node.matrix, inner.matrix)
            if product is None:
                break
            absorbed.add(node.child)
            why = f"merged into {_shown(node)}, which stands before it"
            graph.left_out.append(g.LeftOut(_shown(inner), why))
            node.name = "*".join(name for name in (node.name, inner.name) if name)
            node.matrix, node.child = product, inner.child


def _shown(node: g.Transform) -> str:
    return f"transformation {node.name}" if node.name else "an inline transformation"
