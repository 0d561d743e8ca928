"""Drop what stands below a constant transformation that can't be inverted (``check`` warns of it).

before ::                                      after ::

    0 transform Flat <1 0 0 0 … 0 0 0 0> -> 1      0 empty
    1 primitive sphere

Flattened things have no inverse to trace rays with; the runtime would drop them one by one. (Barnsley's fern has
such a map for its stem.)
"""

from __future__ import annotations

from .. import graph as g
from ..matrices import is_singular


def singular(graph: g.Graph) -> None:
    reached = set(graph.reachable())
    for i, node in enumerate(graph.nodes):
        if not isinstance(node, g.Transform) or not is_singular(node.matrix):
            continue
        graph.nodes[i] = g.Empty(span=node.span)
        if i in reached:
            shown = f"'{node.name}'" if node.name else "this transformation"
            why = "it can't be inverted: it flattens what it is applied to"
            graph.left_out.append(g.LeftOut(f"what {shown} is applied to", why))
