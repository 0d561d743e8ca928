"""Limits of the bytecode that a scene can exceed: ``check_limits(graph, diagnostics)`` adds an error for each.

The runtime's stack holds 64 values, and an application draws at most 64 times (runtime/bytecode.toml), counted
along the way that draws most.

Example: ``rand(0) + rand(0) + …`` of 65 terms is ``error[limit]: Tree draws 65 times in one application``.
"""

from __future__ import annotations

from ..bytecode.layout_rows import LIMITS
from ..reading.diagnostics import Diagnostics
from ..reading.model import Apply, Expression
from . import graph as g
from .rewrite import expressions, fixpoint

STACK = LIMITS["stack"]
DRAWS_PER_APPLICATION = LIMITS["draws_per_application"]


def check_limits(graph: g.Graph, diagnostics: Diagnostics) -> None:
    _check_draws(graph, diagnostics)
    for node in graph.nodes:
        if node.span and _stack_of(node) > STACK:
            diagnostics.add(
                "limit", node.span, f"an expression here needs more than {STACK} values at a time"
            )


def _check_draws(graph: g.Graph, diagnostics: Diagnostics) -> None:
    most = [0] * len(graph.nodes)

    def step(i: int, node: g.Node) -> int:
        below = 0 if isinstance(node, g.Enter) else max((most[child] for child in node.children()), default=0)
        return isinstance(node, g.Choose) + sum(map(draw_count, expressions(node))) + below

    fixpoint(graph, most, step)
    for i, node in enumerate(graph.nodes):
        if isinstance(node, (g.Symbol, g.Object)) and node.span and most[i] > DRAWS_PER_APPLICATION:
            message = f"'{node.name}' draws up to {most[i]} times in one application, at most {DRAWS_PER_APPLICATION} are possible"
            diagnostics.add(
                "limit", node.span, message, "a reference to another Selection begins a new application"
            )


def draw_count(expression: Expression) -> int:
    """The most draws that evaluating an expression takes."""
    if not isinstance(expression, Apply):
        return 0
    counts = [draw_count(argument) for argument in expression.arguments]
    if expression.operation == "select":
        return counts[0] + max(counts[1:])
    return sum(counts) + (expression.operation == "rand")


def _stack_of(node: g.Node) -> int:
    """The most values that a node's code has on the stack at a time."""
    match node:
        case g.TransformCode():
            return max((_in_a_row(step.arguments) for step in node.steps), default=0)
        case g.Primitive():
            return _in_a_row(node.arguments)
        case g.Calculate() if node.together:
            return _in_a_row(list(expressions(node)))
    return max(map(stack_depth, expressions(node)), default=0)


def stack_depth(expression: Expression) -> int:
    if not isinstance(expression, Apply):
        return 1
    if expression.operation in ("and", "or", "select"):
        return max(map(stack_depth, expression.arguments))
    return _in_a_row(expression.arguments)


def _in_a_row(items: tuple[Expression, ...] | list[Expression]) -> int:
    """Values that stay on the stack while the following ones are evaluated."""
    return max((i + stack_depth(item) for i, item in enumerate(items)), default=0)
