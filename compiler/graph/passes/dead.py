"""Remove assignments to parameters that nothing below reads.

before ::                                        after ::

    0 calculate C { n = n - 1; age = 3 } -> 1        0 calculate C { n = n - 1 } -> 1
    1 branch (n > 0) then 2 else 3                   1 branch (n > 0) then 2 else 3

A parameter that only feeds itself (``age += 1`` and no more) is dead as well. Assignments that draw stay: a
draw moves the ordinals of those after it. What is dead goes with its errors.
"""

from __future__ import annotations

from collections import Counter

from ...reading.model import Assign
from .. import graph as g
from .liveness import live_sets, needed


def dead_parameters(graph: g.Graph) -> None:
    live = live_sets(graph, "everything")
    removed: Counter[str] = Counter()
    written: set[str] = set()
    for node in graph.nodes:
        if not isinstance(node, g.Calculate):
            continue
        before = Counter(s.parameter for s in node.statements if isinstance(s, Assign))
        node.statements, _ = needed(node, live[node.child], "everything")
        removed += before - Counter(s.parameter for s in node.statements if isinstance(s, Assign))
        written.update(s.parameter for s in node.statements if isinstance(s, Assign))
    for parameter, count in removed.items():
        times = "1 assignment" if count == 1 else f"{count} assignments"
        graph.left_out.append(g.LeftOut(f"parameter {parameter}", f"{times} that nothing reads"))
    used = written.union(*live)
    graph.parameters = [name for name in graph.parameters if name in used]
