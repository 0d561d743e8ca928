"""What passes and analyses share: sending references elsewhere, walking expressions, telling what draws.

Example: ``redirect(graph, {4: 7})`` makes every edge to node 4 one to node 7 (and one to 7 stays, unless 7 is
redirected too).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy

from ..reading.model import Apply, Assign, Expression, Read, Step, TextureValue
from . import graph as g

CHILD_FIELDS = ("child", "body", "then", "otherwise", "symbol")


def redirect(graph: g.Graph, targets: dict[int, int]) -> None:
    """Follow ``targets`` from every edge, through chains. The root keeps its number: it takes over the node it
    is sent to."""
    if not targets:
        return

    def final(index: int) -> int:
        passed = []
        while index in targets:
            passed.append(index)
            index = targets[index]
        targets.update((i, index) for i in passed)  # the chain is walked once
        return index

    for node in graph.nodes:
        map_children(node, final)
    if 0 in targets:
        graph.nodes[0] = copy(graph.nodes[final(0)])


def map_children(node: g.Node, change: Callable[[int], int]) -> None:
    """Put ``change(child)`` in the place of every child."""
    for name in CHILD_FIELDS:
        if hasattr(node, name):
            setattr(node, name, change(getattr(node, name)))
    if isinstance(node, g.Union):
        node.children_ = tuple(map(change, node.children_))
    elif isinstance(node, g.Choose):
        node.cases = tuple((weight, change(body)) for weight, body in node.cases)


def map_expressions(node: g.Node, change: Callable[[Expression], Expression]) -> None:
    """Put ``change(expression)`` in the place of every expression of a node."""
    match node:
        case g.Branch():
            node.test = change(node.test)
        case g.Choose():
            node.cases = tuple((change(weight), body) for weight, body in node.cases)
        case g.Calculate():
            node.statements = tuple(
                Assign(s.parameter, change(s.value), s.span)
                if isinstance(s, Assign)
                else type(s)(change(s.count), s.span)
                for s in node.statements
            )
        case g.TransformCode():
            node.steps = tuple(
                Step(step.operation, tuple(map(change, step.arguments)), step.span) for step in node.steps
            )
        case g.Texture():
            node.texture = TextureValue(
                tuple((name, tuple(map(change, values))) for name, values in node.texture.values),
                tuple(tuple(map(change, entry)) for entry in node.texture.entries),
            )
        case g.Primitive():
            node.arguments = tuple(map(change, node.arguments))


def expressions(node: g.Node) -> Iterator[Expression]:
    """All expressions of a node, in the order in which they are evaluated."""
    match node:
        case g.Branch():
            yield node.test
        case g.Choose():
            yield from (weight for weight, _ in node.cases)
        case g.Calculate():
            yield from (s.value if isinstance(s, Assign) else s.count for s in node.statements)
        case g.TransformCode():
            yield from (argument for step in node.steps for argument in step.arguments)
        case g.Texture():
            yield from texture_expressions(node.texture)
        case g.Primitive():
            yield from node.arguments


def texture_expressions(texture: TextureValue) -> Iterator[Expression]:
    yield from (value for _, values in texture.values for value in values)
    yield from (value for entry in texture.entries for value in entry)


def parts(expression: Expression) -> Iterator[Expression]:
    """The expression and all below it."""
    stack = [expression]
    while stack:
        part = stack.pop()
        yield part
        if isinstance(part, Apply):
            stack.extend(reversed(part.arguments))


def reads(expression: Expression) -> set[str]:
    """The parameters that an expression names."""
    return {part.parameter for part in parts(expression) if isinstance(part, Read)}


def draws(expression: Expression) -> bool:
    """Whether evaluating the expression may draw from a random stream."""
    return any(isinstance(part, Apply) and part.operation == "rand" for part in parts(expression))


def node_draws(node: g.Node) -> bool:
    """Whether passing the node may draw."""
    return isinstance(node, g.Choose) or any(map(draws, expressions(node)))


def drawing_reads(expression: Expression) -> set[str]:
    """The parameters on which depends *how* an expression draws: how often, and from which streams.

    ``hue + rand(1)`` draws once from stream 1, whatever hue is; ``rand(s)`` and ``s > 0 ? rand(0) : 1`` depend on s."""
    if not isinstance(expression, Apply):
        return set()
    found: set[str] = set()
    for argument in expression.arguments:
        found |= drawing_reads(argument)
    if (
        expression.operation == "rand"
        or expression.operation in ("and", "or", "select")
        and any(map(draws, expression.arguments[1:]))
    ):
        found |= reads(expression.arguments[0])
    return found


def fixpoint(graph: g.Graph, sets: list, step: Callable[[int, g.Node], object]) -> None:
    """Repeat ``sets[i] = step(i, node)`` for nodes whose children changed, until nothing changes.

    The steps must be monotone; children are done before parents, so that few rounds are needed."""
    parents: list[list[int]] = [[] for _ in graph.nodes]
    for i, node in enumerate(graph.nodes):
        for child in node.children():
            parents[child].append(i)
    pending = list(range(len(graph.nodes)))
    waiting = [True] * len(graph.nodes)
    while pending:
        i = pending.pop()
        waiting[i] = False
        value = step(i, graph.nodes[i])
        if value != sets[i]:
            sets[i] = value
            for parent in parents[i]:
                if not waiting[parent]:
                    waiting[parent] = True
                    pending.append(parent)
