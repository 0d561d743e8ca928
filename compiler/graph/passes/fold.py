"""Work out what is constant: expressions, guards, weights and transformations.

before ::                                 after ::

    0 symbol A -> 1                           0 symbol A -> 2
    1 branch (2 > 1) then 2 else 5            2 rule 0 -> 3
    2 rule 0 -> 3                             3 transform T <0.5 0 0 0 …> -> 4
    3 transform_code T { scale 1 / 2 } -> 4   4 primitive sphere
    4 primitive sphere

The values have the runtime's bits (``plsys.compiler.elementary``). ``rand`` is never folded, and nothing that
draws is removed or doubled. A value that isn't finite stays an expression, for the derivation to report. ``hash``
stays as well: it is what changes with the seed.
"""

from __future__ import annotations

import math

from ...reading.model import Apply, Constant, Expression
from .. import graph as g
from ..evaluate import apply
from ..lower import constant_transform
from ..rewrite import map_expressions, redirect


def fold(graph: g.Graph) -> None:
    targets: dict[int, int] = {}
    for i, node in enumerate(graph.nodes):
        map_expressions(node, fold_expression)
        match node:
            case g.Branch(Constant(value), then, otherwise):
                targets[i] = then if value != 0 else otherwise
                verdict = "always" if value != 0 else "never"
                graph.left_out.append(g.LeftOut(f"a guard{_place(node)}", f"it {verdict} holds"))
            case g.Choose():
                _fold_choice(graph, i, node, targets)
            case g.TransformCode():
                graph.nodes[i] = constant_transform(node) or node
    redirect(graph, targets)


def fold_expression(expression: Expression) -> Expression:
    """The expression with its constant parts worked out."""
    if not isinstance(expression, Apply):
        return expression
    arguments = tuple(map(fold_expression, expression.arguments))
    first = arguments[0]
    match expression.operation:
        case "select" if isinstance(first, Constant):
            return arguments[1] if first.value != 0 else arguments[2]
        case "and" if isinstance(first, Constant) and first.value == 0:
            return Constant(0.0, expression.span)
        case "or" if isinstance(first, Constant) and first.value != 0:
            return Constant(1.0, expression.span)
    folded = Apply(expression.operation, arguments, expression.span)
    is_pure = expression.operation not in ("rand", "hash")
    if is_pure and all(isinstance(argument, Constant) for argument in arguments):
        value = apply(expression.operation, [argument.value for argument in arguments])
        if math.isfinite(value):
            return Constant(value, expression.span)
    return folded


def _fold_choice(graph: g.Graph, i: int, node: g.Choose, targets: dict[int, int]) -> None:
    """Cases of constant weight 0 are never taken; a single case of positive constant weight always is. The draw
    that this saves stands on a stream of its own, so that no other draw moves."""
    possible = tuple(case for case in node.cases if case[0] != Constant(0.0))
    if not possible:
        return  # an error that the derivation reports
    if len(possible) < len(node.cases):
        count = len(node.cases) - len(possible)
        graph.left_out.append(
            g.LeftOut(f"{count} of {len(node.cases)} alternatives{_place(node)}", "weight 0")
        )
    node.cases = possible
    (weight, body) = possible[0]
    if len(possible) == 1 and isinstance(weight, Constant) and weight.value > 0:
        targets[i] = body


def _place(node: g.Node) -> str:
    return f" at {node.span}" if node.span else ""
