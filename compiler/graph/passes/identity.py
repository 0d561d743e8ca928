"""Remove nodes that change nothing, and those that only lead to nothing.

before ::                               after ::

    0 union 1 2 3                           0 union 4 5 6
    1 transform I <1 0 0 0 …> -> 4
    2 empty                                 4 primitive sphere
    3 union 5 6                             5 primitive box
    …                                       …

That is: identity transformations, calculations without statements, and operators, rules and branches above
nothing. A union's empty terms go and its inner unions are spliced into it, but only where nothing below draws: a
term's index is part of the random key.
"""

from __future__ import annotations

from .. import graph as g
from ..matrices import IDENTITY
from ..rewrite import redirect
from .liveness import draw_sets, live_sets


def identity(graph: g.Graph) -> None:
    keyed = draw_sets(graph, "everything", live_sets(graph, "everything"))
    while _round(graph, keyed):
        pass


def _round(graph: g.Graph, keyed: list[bool]) -> bool:
    """One pass over all nodes; whether anything changed. ``keyed``: where a draw can be reached below."""
    changed, targets = False, {}
    for i, node in enumerate(graph.nodes):
        if _leads_nowhere(graph, node):
            graph.nodes[i] = g.Empty(span=node.span)
            changed = True
        elif _changes_nothing(node):
            targets[i] = node.child
        elif isinstance(node, g.Union) and not keyed[i]:
            terms = _terms(graph, node)
            if len(terms) == 1:
                targets[i] = terms[0]
            elif terms != node.children_:
                node.children_ = terms
                changed = True
    for i in targets:
        if isinstance(graph.nodes[i], g.Transform):
            graph.left_out.append(
                g.LeftOut(f"transformation {graph.nodes[i].name}".strip(), "it changes nothing")
            )
    redirect(graph, targets)
    # What was passed over is out of reach, and mustn't be found again.
    for i in targets:
        if i != 0:
            graph.nodes[i] = g.Empty()
    return changed or bool(targets)


def _leads_nowhere(graph: g.Graph, node: g.Node) -> bool:
    """Whether a node that isn't Empty itself surely gives nothing. Symbols keep their node."""
    if isinstance(node, (g.Empty, g.Symbol, g.Enter)) or not node.children():
        return False
    return all(isinstance(graph.nodes[child], g.Empty) for child in node.children())


def _changes_nothing(node: g.Node) -> bool:
    return (
        (isinstance(node, g.Transform) and node.matrix == IDENTITY)
        or (isinstance(node, g.TransformCode) and not node.steps)
        or (isinstance(node, g.Calculate) and not node.statements)
    )


def _terms(graph: g.Graph, union: g.Union) -> tuple[int, ...]:
    """The union's terms without empty ones, inner unions spliced in."""
    terms: list[int] = []
    for child in union.children_:
        node = graph.nodes[child]
        if isinstance(node, g.Union):
            terms.extend(node.children_)
        elif not isinstance(node, g.Empty):
            terms.append(child)
    return tuple(terms)
