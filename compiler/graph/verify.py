"""What a legal graph is, as rows of rules; run after lowering and after every pass.

A violation is a mistake of ours, never of the scene's: :class:`InvalidGraph` names the pass, the node and the
rule.

Example: a union of one term after ``merge`` raises
``InvalidGraph: after merge: 7 union 8: has two or more terms``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cache

from ..bytecode.layout_rows import LIMITS, OPCODES, SHAPES
from ..reading.model import Apply, Assign, Constant, Expression, Read, Step, Variants
from . import graph as g
from .matrices import STEPS
from .printing import print_node
from .rewrite import expressions, parts

# How many arguments operations take: those that the bytecode has a row for, and those that it has jumps for.
LAZY = {"and": 2, "or": 2, "select": 3}
ARGUMENTS = LAZY | {
    name: row.pops for name, row in OPCODES.items() if row.pushes == 1 and row.pops > 0 and name != "bool"
}
STEP_ARGUMENTS = {name: OPCODES[name].pops for name in STEPS}

# What a Selection's guards may lead to, and what stands at the top of a scene.
PRODUCTIONS = (g.Branch, g.Choose, g.Rule, g.Empty)
TOP = (g.Object, g.Empty)
BELOW_RULES = (
    *(g.Calculate, g.Transform, g.TransformCode, g.Texture, g.NoShadow),
    *(g.Union, g.Enter, g.Primitive, g.MeshLeaf, g.Empty),
)


class InvalidGraph(AssertionError):
    """The graph breaks a rule: an internal error of the pass named."""


# Rows of (node class, rule in words, test of graph and node).
RULES: tuple[tuple[type, str, Callable[[g.Graph, g.Node], bool]], ...] = (
    (
        g.Node,
        "every child is a node of the graph",
        lambda graph, n: all(0 <= c < len(graph.nodes) for c in n.children()),
    ),
    (
        g.Node,
        "every operation exists and has its arguments",
        lambda graph, n: all(map(_is_legal, expressions(n))),
    ),
    (
        g.Node,
        "every parameter that is read or assigned has a slot",
        lambda graph, n: _names(n) <= set(graph.parameters),
    ),
    (g.Enter, "leads to a symbol", lambda graph, n: isinstance(graph.nodes[n.symbol], g.Symbol)),
    (g.Symbol, "has a name", lambda graph, n: bool(n.name)),
    (g.Symbol, "leads to guards and rules", lambda graph, n: isinstance(graph.nodes[n.body], PRODUCTIONS)),
    (g.Symbol, "has known live parameters in slot order", lambda graph, n: _in_order(graph, n.live)),
    (g.Branch, "leads to guards and rules", lambda graph, n: _all(graph, n, PRODUCTIONS)),
    (g.Choose, "has cases", lambda graph, n: len(n.cases) > 0),
    (g.Choose, "leads to rules", lambda graph, n: _all(graph, n, (g.Rule, g.Empty))),
    (g.Rule, "counts from 0", lambda graph, n: n.index >= 0),
    (g.Rule, "leads to an expression", lambda graph, n: _all(graph, n, BELOW_RULES)),
    (g.Union, "has two or more terms", lambda graph, n: len(n.children_) >= 2),
    (
        g.Union,
        "joins expressions or objects",
        lambda graph, n: _all(graph, n, BELOW_RULES) or _all(graph, n, TOP),
    ),
    (g.Object, "leads to an expression", lambda graph, n: _all(graph, n, BELOW_RULES)),
    (
        g.Calculate,
        "assigns or chooses a variant",
        lambda graph, n: all(isinstance(s, (Assign, Variants)) for s in n.statements),
    ),
    (
        g.Calculate,
        "assigns different parameters, if together",
        lambda graph, n: not n.together or len(_names_assigned(n)) == len(n.statements),
    ),
    (
        g.Transform,
        "has twelve finite numbers",
        lambda graph, n: (
            len(n.matrix) == 12 and all(isinstance(v, float) and math.isfinite(v) for v in n.matrix)
        ),
    ),
    (
        g.TransformCode,
        "has known steps with their arguments",
        lambda graph, n: all(map(_is_legal_step, n.steps)),
    ),
    (
        g.Primitive,
        "has a known shape with its arguments",
        lambda graph, n: _has_shape(n),
    ),
    (g.MeshLeaf, "has a mesh", lambda graph, n: 0 <= n.mesh < len(graph.meshes)),
)


@cache
def _rules_of(kind: type[g.Node]) -> tuple[tuple[str, Callable[[g.Graph, g.Node], bool]], ...]:
    return tuple((rule, test) for base, rule, test in RULES if issubclass(kind, base))


def verify(graph: g.Graph, after: str) -> None:
    """Raises InvalidGraph, naming the pass ``after`` which the graph is wrong."""
    if not graph.nodes:
        raise InvalidGraph(f"after {after}: there is no root")
    for i, node in enumerate(graph.nodes):
        for rule, test in _rules_of(type(node)):
            if not test(graph, node):
                raise InvalidGraph(f"after {after}: {i} {print_node(node)}: {rule}")
    _verify_root(graph, after)
    _verify_cycles(graph, after)


def _verify_root(graph: g.Graph, after: str) -> None:
    root = graph.nodes[0]
    if not isinstance(root, TOP) and not (isinstance(root, g.Union) and _all(graph, root, TOP)):
        raise InvalidGraph(
            f"after {after}: 0 {print_node(root)}: the root is an object, a union of objects, or empty"
        )


def _verify_cycles(graph: g.Graph, after: str) -> None:
    """Every cycle goes through an Enter, and only an Enter leads to a symbol."""
    unseen, open_, done = 0, 1, 2
    state = [unseen] * len(graph.nodes)
    for start in range(len(graph.nodes)):
        stack = [start]
        while stack:
            i = stack[-1]
            if state[i] != unseen:
                stack.pop()
                state[i] = done
                continue
            state[i] = open_
            if isinstance(graph.nodes[i], g.Enter):
                continue
            for child in graph.nodes[i].children():
                if state[child] == open_ or isinstance(graph.nodes[child], g.Symbol):
                    where = f"after {after}: {i} {print_node(graph.nodes[i])}"
                    raise InvalidGraph(f"{where}: only an enter node leads back or to a symbol")
                if state[child] == unseen:
                    stack.append(child)


def _all(graph: g.Graph, node: g.Node, kinds: tuple[type, ...]) -> bool:
    return all(isinstance(graph.nodes[child], kinds) for child in node.children())


def _in_order(graph: g.Graph, names: Iterable[str]) -> bool:
    slots = [graph.parameters.index(name) if name in graph.parameters else -1 for name in names]
    return all(slot >= 0 for slot in slots) and slots == sorted(set(slots))


def _names(node: g.Node) -> set[str]:
    read = {part.parameter for e in expressions(node) for part in parts(e) if isinstance(part, Read)}
    return read | (_names_assigned(node) if isinstance(node, g.Calculate) else set())


def _names_assigned(node: g.Calculate) -> set[str]:
    return {s.parameter for s in node.statements if isinstance(s, Assign)}


def _is_legal(expression: Expression) -> bool:
    return all(_is_legal_part(part) for part in parts(expression))


def _is_legal_part(part: Expression) -> bool:
    if isinstance(part, Apply):
        count = len(part.arguments)
        return (
            1 <= count <= LIMITS["hash_arguments"]
            if part.operation == "hash"
            else ARGUMENTS.get(part.operation) == count
        )
    return isinstance(part, Read) or (isinstance(part, Constant) and isinstance(part.value, (int, float)))


def _is_legal_step(step: Step) -> bool:
    return step.operation in STEPS and STEP_ARGUMENTS[step.operation] == len(step.arguments)


def _has_shape(node: g.Primitive) -> bool:
    return node.shape in SHAPES and len(SHAPES[node.shape].arguments) == len(node.arguments)
