"""Walks over the model: what productions lead where, under which guards, and which expressions stand in them.

Example::

    for way in ways(model.symbols["Tree"].production):
        way.guards, way.operators, way.leaf       # ((Apply('greater', …), True),), (Calculate, …), Enter('Tree')
"""

from __future__ import annotations

from typing import AbstractSet, Hashable, Iterable, Iterator, Mapping, TypeVar

from .evaluate import NotFinite, fold
from .model import (
    Apply,
    Assign,
    Branch,
    Calculate,
    Choose,
    Constant,
    Expression,
    Model,
    Operand,
    Operator,
    Paint,
    Prefixed,
    Produce,
    Production,
    Read,
    Sum,
    Transform,
)
from .records import record

T = TypeVar("T", bound=Hashable)


@record
class Way:
    """One way through a production to a leaf (Enter, Primitive, MeshLeaf, Empty). ``guards`` are the tests on it
    with the outcome it needs, ``weights`` the weights of the alternatives it takes."""

    guards: tuple[tuple[Expression, bool], ...]
    weights: tuple[Expression, ...]
    operators: tuple[Operator, ...]
    leaf: Operand
    is_rule: bool  # not where no rule applies


def ways(production: Production, guards: tuple = (), weights: tuple = ()) -> Iterator[Way]:
    if isinstance(production, Branch):
        yield from ways(production.then, (*guards, (production.test, True)), weights)
        yield from ways(production.otherwise, (*guards, (production.test, False)), weights)
    elif isinstance(production, Choose):
        for weight, produce in production.cases:
            yield from ways(produce, guards, (*weights, weight))
    else:
        body = production.body if isinstance(production, Produce) else production
        for operators, leaf in leaves(body):
            yield Way(guards, weights, operators, leaf, isinstance(production, Produce))


def leaves(
    operand: Operand, operators: tuple[Operator, ...] = ()
) -> Iterator[tuple[tuple[Operator, ...], Operand]]:
    """The leaves of an operand, each with the operators on its way, outermost first."""
    while isinstance(operand, Prefixed):
        operators = (*operators, operand.operator)
        operand = operand.operand
    if isinstance(operand, Sum):
        for term in operand.terms:
            yield from leaves(term, operators)
    else:
        yield operators, operand


def parts(expression: Expression) -> Iterator[Expression]:
    """``expression`` and all that it is made of."""
    yield expression
    if isinstance(expression, Apply):
        for argument in expression.arguments:
            yield from parts(argument)


def reads(expression: Expression) -> frozenset[str]:
    return frozenset(part.parameter for part in parts(expression) if isinstance(part, Read))


def draws(expression: Expression) -> bool:
    return any(isinstance(part, Apply) and part.operation == "rand" for part in parts(expression))


def expressions_of(operator: Operator) -> Iterator[Expression]:
    """The expressions of an operator, in order of evaluation."""
    if isinstance(operator, Calculate):
        for statement in operator.statements:
            yield statement.value if isinstance(statement, Assign) else statement.count
    elif isinstance(operator, Transform):
        for step in operator.steps:
            yield from step.arguments
    elif isinstance(operator, Paint):
        for _, values in operator.texture.values:
            yield from values
        for entry in operator.texture.entries:
            yield from entry


def decided(test: Expression, seed: float) -> bool | None:
    """Whether a guard is always true or always false, where that can be told: constants, and draws (which are in
    [0, 1)) compared with a constant outside of their range."""
    try:
        folded = fold(test, seed)
    except NotFinite:
        return None
    if isinstance(folded, Constant):
        return folded.value != 0
    if isinstance(folded, Apply) and len(folded.arguments) == 2:
        draw, bound = folded.arguments
        if isinstance(draw, Apply) and draw.operation == "rand" and isinstance(bound, Constant):
            above, below = bound.value >= 1, bound.value < 0
            if folded.operation in ("less", "less_equal") and (above or below):
                return above
            if folded.operation in ("greater", "greater_equal") and (above or below):
                return below
            if folded.operation == "less" and bound.value == 0:
                return False
            if folded.operation == "greater_equal" and bound.value == 0:
                return True
    return None


def is_open(way: Way, seed: float) -> bool:
    """Whether no guard and no weight on the way rules it out for certain."""
    if any(decided(test, seed) is (not needed) for test, needed in way.guards):
        return False
    return not any(isinstance(weight, Constant) and weight.value == 0 for weight in way.weights)


def seed_of(model: Model) -> float:
    """The scene's seed."""
    return dict(model.settings.values).get("seed", (0.0,))[0] if model.settings is not None else 0.0


def components(edges: Mapping[str, AbstractSet[str]]) -> list[frozenset[str]]:
    """The strongly connected components (Tarjan 1972), without recursion so that long chains are fine."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    on_stack: set[str] = set()
    found: list[frozenset[str]] = []
    for root in edges:
        if root in order:
            continue
        work = [(root, iter(sorted(edges[root])))]
        order[root] = low[root] = len(order)
        stack.append(root)
        on_stack.add(root)
        while work:
            name, successors = work[-1]
            for other in successors:
                if other not in edges:
                    continue
                if other not in order:
                    order[other] = low[other] = len(order)
                    stack.append(other)
                    on_stack.add(other)
                    work.append((other, iter(sorted(edges[other]))))
                    break
                if other in on_stack:
                    low[name] = min(low[name], order[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[name])
                if low[name] == order[name]:
                    members: set[str] = set()
                    while name not in members:
                        members.add(stack.pop())
                    on_stack -= members
                    found.append(frozenset(members))
    return found


def reached_from(starts: Iterable[T], edges: Mapping[T, Iterable[T]]) -> frozenset[T]:
    """What ``edges`` lead to from ``starts``, these included."""
    found: set[T] = set()
    waiting = list(starts)
    while waiting:
        each = waiting.pop()
        if each not in found and each in edges:
            found.add(each)
            waiting.extend(edges[each])
    return frozenset(found)
