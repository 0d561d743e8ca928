"""Fill ``Symbol.live`` and ``Symbol.draws``: what the geometry below a symbol depends on, and with it what makes
two instances one state. Fill ``Texture.draws``.

before ::                              after ::

    3 symbol Tree -> 4                     3 symbol Tree [n] -> 4
    4 branch (n > 0) then 5 else 9         4 branch (n > 0) then 5 else 9

A parameter is live at a node if its value there can reach a guard, a weight, a transformation or a shape's
argument below without being assigned again. Textures don't count: only how they draw does, since that moves the
ordinals of the draws after them. The analysis is the classic backward one (Aho, Lam, Sethi & Ullman, Compilers,
9.2.5) with strong liveness: a value counts only if what is made of it does.
"""

from __future__ import annotations

from collections.abc import Iterable

from ...reading.model import Assign, Expression, Variants
from .. import graph as g
from ..rewrite import drawing_reads, draws, expressions, fixpoint, node_draws, reads

# What an analysis asks for: everything (colours too), the geometry, or only how many primitives there are.
PURPOSES = ("everything", "geometry", "count")


def liveness(graph: g.Graph) -> None:
    live = live_sets(graph, "geometry")
    keyed = draw_sets(graph, "geometry", live)
    order = {name: slot for slot, name in enumerate(graph.parameters)}
    for i, node in enumerate(graph.nodes):
        if isinstance(node, g.Symbol):
            node.live = tuple(sorted(live[i], key=order.__getitem__))
            node.draws = keyed[i]
        elif isinstance(node, g.Texture):
            node.draws = node_draws(node)


def live_sets(graph: g.Graph, purpose: str) -> list[frozenset[str]]:
    """Of each node: the parameters whose values on the way into it matter below, for the purpose."""
    sets = [frozenset()] * len(graph.nodes)

    def step(i: int, node: g.Node) -> frozenset[str]:
        below = set().union(*(sets[child] for child in node.children()))
        if isinstance(node, g.Calculate):
            return frozenset(needed(node, below, purpose)[1])
        for expression in expressions(node):
            below |= reads(expression) if counts(node, purpose) else drawing_reads(expression)
        return frozenset(below)

    fixpoint(graph, sets, step)
    return sets


def counts(node: g.Node, purpose: str) -> bool:
    """Whether the values of a node's expressions matter in themselves."""
    if isinstance(node, g.Texture):
        return purpose == "everything"
    if isinstance(node, (g.TransformCode, g.Primitive)):
        return purpose != "count"
    return isinstance(node, (g.Branch, g.Choose))


def needed(
    node: g.Calculate, live: Iterable[str], purpose: str
) -> tuple[tuple[Assign | Variants, ...], set[str]]:
    """The statements that must stay, given what is live below the node, and what is live above it.

    Statements that draw stay in any case; "everything" then keeps all that they read, so that they can run."""
    kept, below = [], set(live)
    after = frozenset(below)
    if node.together:  # all values are evaluated before the first is assigned
        below -= {statement.parameter for statement in node.statements}
    for statement in reversed(node.statements):
        value = value_of(statement)
        matters = isinstance(statement, Variants) or statement.parameter in (
            after if node.together else below
        )
        stays = matters or draws(value)
        if matters and isinstance(statement, Assign) and not node.together:
            below.discard(statement.parameter)
        if stays:
            kept.append(statement)
            below |= reads(value) if matters or purpose == "everything" else drawing_reads(value)
    return tuple(reversed(kept)), below


def value_of(statement: Assign | Variants) -> Expression:
    return statement.value if isinstance(statement, Assign) else statement.count


def draw_sets(graph: g.Graph, purpose: str, live: list[frozenset[str]]) -> list[bool]:
    """Of each node: whether a draw whose value matters below, for the purpose, can be reached from it."""
    found = [False] * len(graph.nodes)

    def step(i: int, node: g.Node) -> bool:
        if any(found[child] for child in node.children()):
            return True
        if isinstance(node, g.Choose):
            return True
        if not isinstance(node, g.Calculate):
            return counts(node, purpose) and any(map(draws, expressions(node)))
        # Per statement, what is live after it decides; a statement alone makes a node of its own for that.
        below = set(live[node.child])
        for statement in reversed(node.statements):
            if draws(value_of(statement)) and (
                isinstance(statement, Variants) or statement.parameter in below
            ):
                return True
            if not node.together:
                below = needed(g.Calculate("", (statement,), node.child), below, purpose)[1]
        return False

    fixpoint(graph, found, step)
    return found
