"""Recursions that run away: from a few rounds of a path, the proof that it goes on beyond any limit.

Where every round adds the same to each parameter and all guards on the way compare affine expressions, each comparison
changes its truth at most once. If none does between now and the limit, all rounds in between are like this one.

Path of states → whether it reaches the limit. Example: ``if (n > 0) Row -> box + [ ++n ] Row;`` after some rounds; not
``if (n != 5000) …``, whose difference changes its sign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..reading.model import Apply, Constant, Expression, Read
from . import graph as g
from .evaluate import EvaluationError, Scope, evaluate
from .rewrite import expressions
from .states import State

MAX_PERIOD = 8  # symbols in one round
ROUNDS = 4  # rounds that are compared
_ORDERED = ("less", "less_equal", "greater", "greater_equal")
_HARMLESS = ("trans", "rotx", "roty", "rotz")  # never singular, whatever their arguments


def runs_away(
    graph: g.Graph, path: Sequence[State], limit: int, order: Mapping[int, Sequence[str]] | None = None
) -> bool:
    """Whether a path of the derivation surely enters ``limit`` symbols or more. ``order``: the names of the values in a
    symbol's states, if they aren't its live parameters."""
    for period in range(1, MAX_PERIOD + 1):
        if len(path) > period * (ROUNDS + 1) and path[-1][0] == path[-1 - period][0]:
            rounds = limit // period + 1
            return all(
                _goes_on(graph, path[-1 - phase :: -period][: ROUNDS + 1], rounds, order)
                for phase in range(period)
            )
    return False


def _goes_on(
    graph: g.Graph, states: Sequence[State], rounds: int, order: Mapping[int, Sequence[str]] | None
) -> bool:
    """``states`` are of one place in a round, the last round's first: symbol, values, and a random key where draws are
    reachable."""
    symbol = graph.nodes[states[0][0]]
    if not isinstance(symbol, g.Symbol) or any(
        state[0] != states[0][0] or any(state[2:]) for state in states
    ):
        return False
    values = [state[1] for state in states]
    if not all(isinstance(value, float) for each in values for value in each):
        return False
    slopes = [a - b for a, b in zip(values[0], values[1])]
    for later, earlier in zip(values, values[1:]):
        if any(abs(a - b - slope) > 1e-9 * max(1.0, abs(a)) for a, b, slope in zip(later, earlier, slopes)):
            return False
    names = symbol.live if order is None else order[states[0][0]]
    now = Scope(0, dict(zip(names, values[0])))
    # A little farther than need be, so that rounding in between can't matter.
    then = Scope(
        0, {name: value + 1.01 * rounds * slope for name, value, slope in zip(names, values[0], slopes)}
    )
    return _steady_body(graph, symbol.body, now, then)


def _steady_body(graph: g.Graph, start: int, now: Scope, then: Scope) -> bool:
    """Whether all that a symbol's body evaluates takes the same way in both scopes and can't fail in between."""
    waiting = [(start, False)]
    while waiting:
        index, is_changed = waiting.pop()
        node = graph.nodes[index]
        match node:
            case g.Branch():
                if is_changed or not _is_steady(node.test, now, then):
                    return False
                waiting.append((node.then if evaluate(node.test, now) != 0 else node.otherwise, is_changed))
                continue
            case g.Choose():
                return False
            case g.TransformCode():
                if any(step.operation not in _HARMLESS and _reads(step.arguments) for step in node.steps):
                    return False
            case g.Texture() if node.draws:
                return False
            case g.Enter():
                continue
        if not all(map(_is_affine, expressions(node))):
            return False
        is_changed = is_changed or isinstance(node, g.Calculate)
        waiting += [(child, is_changed) for child in node.children()]
    return True


def _is_steady(test: Expression, now: Scope, then: Scope) -> bool:
    """Whether no comparison in ``test`` changes its truth on the straight line between two scopes."""
    if isinstance(test, Apply) and test.operation in ("and", "or", "not"):
        return all(_is_steady(each, now, then) for each in test.arguments)
    try:
        if isinstance(test, Apply) and test.operation in _ORDERED and all(map(_is_affine, test.arguments)):
            return evaluate(test, now) == evaluate(test, then)
        if isinstance(test, Apply) and test.operation in ("equal", "not_equal"):
            test = Apply("subtract", test.arguments, test.span)
        return _is_affine(test) and (
            isinstance(test, Constant) or evaluate(test, now) * evaluate(test, then) > 0
        )
    except EvaluationError:
        return False


def _is_affine(expression: Expression) -> bool:
    if not isinstance(expression, Apply):
        return True
    if expression.operation in ("add", "subtract", "negate"):
        return all(map(_is_affine, expression.arguments))
    if expression.operation == "multiply":
        return any(isinstance(each, Constant) for each in expression.arguments) and all(
            map(_is_affine, expression.arguments)
        )
    if expression.operation == "divide":
        divisor = expression.arguments[1]
        return isinstance(divisor, Constant) and divisor.value != 0 and _is_affine(expression.arguments[0])
    return not _reads(expression.arguments)


def _reads(arguments: Sequence[Expression]) -> bool:
    """Whether expressions read a parameter, or draw."""
    return any(
        isinstance(each, Read)
        or isinstance(each, Apply)
        and (each.operation == "rand" or _reads(each.arguments))
        for each in arguments
    )
