"""The derivation state by state with everything noted that an editor shows beside the text: which guards hold, the
values of assignments and arguments, shares of alternatives, and how much each way from symbol to symbol shrinks.

A drawn number is a range here (ranges.py), so that a random plant has as few states as its counters give it. States
hold every parameter that matters for anything, colours included.

Example: in Figure 2.1 the trace of (Tree, cntTree 3, cntTrunk 0, betaBr 32) notes that ``cntTree > 0`` holds, that
``--cntTree`` gives 2 and ``betaBr -= 4.0`` gives 28, and enters (Tree, 2, 0, 28) twice, each scaled by 0.8³.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from ..elementary import seed_key
from ..reading.model import Assign, Constant, Step
from ..reading.source import Span
from . import graph as g
from .matrices import determinant, is_finite, is_singular, matrix_of
from .passes.liveness import live_sets
from .ranges import UNKNOWN, Range, Ranges, Value, Values
from .states import Formula, State, seed_of

# A way's logarithm of |determinant|: least and most.
Shrinking = tuple[float, float]
UNCHANGED: Shrinking = (0.0, 0.0)


class Site(NamedTuple):
    """A place of the text whose values are noted: ``kind`` is guard, assign, argument or share; ``name`` the
    parameter that an assignment gives a value, or the operation that an argument is of."""

    kind: str
    name: str
    span: Span

    @property
    def key(self) -> tuple[int, int, int, str]:
        return id(self.span.source), self.span.start, self.span.end, self.kind


class Noted(NamedTuple):
    site: Site
    value: Value


class Entered(NamedTuple):
    state: State
    shrinking: Shrinking


class Either(NamedTuple):
    """One of several continuations, which a draw decides."""

    ways: tuple[tuple[Item, ...], ...]


Item = Noted | Entered | Either


@dataclass(slots=True)
class Trace(Formula):
    """A formula with what its application met, in the order of derivation."""

    items: list[Item] = field(default_factory=list)


def flat(items: list[Item] | tuple[Item, ...]) -> Iterator[Noted | Entered]:
    """The items with those of all alternatives, in order."""
    for item in items:
        if isinstance(item, Either):
            for way in item.ways:
                yield from flat(way)
        else:
            yield item


class Observer:
    """Expands states as chances.Chances does. ``purpose`` as in passes.liveness: what states tell apart."""

    def __init__(self, graph: g.Graph, uniform: bool = False, purpose: str = "everything") -> None:
        self.graph = graph
        self.ranges = Ranges(uniform, seed_key(seed_of(graph)))
        self.live = live_sets(graph, purpose)
        self.order = {
            i: tuple(sorted(self.live[i])) for i, node in enumerate(graph.nodes) if isinstance(node, g.Symbol)
        }

    def start(self, node: int) -> Trace:
        """The trace of an object node; primitives outside of symbols aren't counted."""
        trace = self._walk(self.graph.nodes[node].child, {}, UNCHANGED)
        trace.own.clear()
        return trace

    def expand(self, state: State) -> Trace:
        symbol, live = state
        values = {name: value for name, value in zip(self.order[symbol], live) if value is not None}
        return self._walk(self.graph.nodes[symbol].body, values, UNCHANGED)

    def _walk(self, node: int, values: Values, shrinking: Shrinking) -> Trace:
        trace = Trace()
        stack = [(node, values, shrinking)]
        while stack:
            index, values, shrinking = stack.pop()
            node = self.graph.nodes[index]
            match node:
                case g.Branch():
                    self._branch(node, values, shrinking, trace, stack)
                case g.Choose():
                    self._choose(node, values, shrinking, trace, stack)
                case g.Calculate():
                    stack.append((node.child, self._calculate(node, values, trace), shrinking))
                case g.Transform() | g.TransformCode():
                    more = self._transform(node, values, trace)
                    if more is not None:
                        total = shrinking[0] + more[0], shrinking[1] + more[1]
                        stack.append((node.child, values, total))
                case g.Enter():
                    # An unknown value is no value: were they told apart, a range that grows would never meet itself.
                    live = tuple(values.get(name) for name in self.order[node.symbol])
                    trace.enter((node.symbol, live))
                    trace.items.append(Entered((node.symbol, live), shrinking))
                case g.Primitive():
                    self._arguments(node.shape, node.arguments, values, trace)
                    trace.add(node.shape)
                case g.MeshLeaf():
                    trace.add("mesh")
                case _:
                    stack.extend((child, values, shrinking) for child in reversed(node.children()))
        return trace

    def _branch(self, node: g.Branch, values: Values, shrinking: Shrinking, trace: Trace, stack: list) -> None:
        chance = self.ranges.probability(node.test, values)
        site = Site("guard", "", node.test.span or node.span)
        if chance in (0.0, 1.0):
            if chance:
                trace.items.append(Noted(site, 1.0))
            stack.append((node.then if chance else node.otherwise, values, shrinking))
            return
        then = self._walk(node.then, self.ranges.refine(node.test, True, values), shrinking)
        otherwise = self._walk(node.otherwise, self.ranges.refine(node.test, False, values), shrinking)
        then.items.insert(0, Noted(site, 1.0))
        self._either(trace, [(chance, then), (1 - chance, otherwise)])

    def _choose(self, node: g.Choose, values: Values, shrinking: Shrinking, trace: Trace, stack: list) -> None:
        weights = [self.ranges.evaluate(weight, values) for weight, _ in node.cases]
        shares = _shares(weights)
        for (weight, _), share in zip(node.cases, shares):
            if weight.span is not None:
                trace.items.append(Noted(Site("share", "", weight.span), share))
        possible = [(_middle(s), body) for s, (_, body) in zip(shares, node.cases) if _high(s) > 0]
        if len(possible) == 1:
            stack.append((possible[0][1], values, shrinking))
        elif possible:
            total = sum(p for p, _ in possible)
            ways = [(p / total, self._walk(body, values, shrinking)) for p, body in possible]
            self._either(trace, ways)

    @staticmethod
    def _either(trace: Trace, ways: list[tuple[float, Trace]]) -> None:
        trace.picks.append(list(ways))
        trace.items.append(Either(tuple(tuple(way.items) for _, way in ways)))

    def _calculate(self, node: g.Calculate, values: Values, trace: Trace) -> Values:
        changed = dict(values)
        for statement in node.statements:
            if not isinstance(statement, Assign):
                continue
            value = self.ranges.evaluate(statement.value, values if node.together else changed)
            span = statement.span or statement.value.span
            if span is not None:
                trace.items.append(Noted(Site("assign", statement.parameter, span), value))
            if value == UNKNOWN or not _is_number(value):
                changed.pop(statement.parameter, None)
            else:
                changed[statement.parameter] = value
        return changed

    def _arguments(self, operation: str, arguments: tuple, values: Values, trace: Trace) -> list[Value]:
        found = []
        for argument in arguments:
            value = self.ranges.evaluate(argument, values)
            found.append(value)
            if argument.span is not None and not isinstance(argument, Constant):
                trace.items.append(Noted(Site("argument", operation, argument.span), value))
        return found

    def _transform(self, node: g.Transform | g.TransformCode, values: Values, trace: Trace) -> Shrinking | None:
        """How the transformation changes volumes; None if what stands below is dropped."""
        if isinstance(node, g.Transform):
            return None if is_singular(node.matrix) else (math.log(abs(determinant(node.matrix))),) * 2
        steps = [(s, self._arguments(s.operation, s.arguments, values, trace)) for s in node.steps]
        if not any(isinstance(value, Range) for _, arguments in steps for value in arguments):
            try:
                matrix = matrix_of((step.operation, arguments) for step, arguments in steps)
            except ValueError:
                return None  # the forecast reports it
            if not is_finite(matrix) or is_singular(matrix):
                return None
            return (math.log(abs(determinant(matrix))),) * 2
        ways = [_shrinking(step, arguments) for step, arguments in steps]
        return sum(low for low, _ in ways), sum(high for _, high in ways)


def _shrinking(step: Step, arguments: list[Value]) -> Shrinking:
    """The logarithm of a step's |determinant|."""
    if step.operation in ("trans", "rotx", "roty", "rotz", "rot"):
        return UNCHANGED
    if step.operation in ("scale", "scale_uniform"):
        times = 3 if step.operation == "scale_uniform" else 1
        ends = [_absolute(value) for value in arguments]
        return times * sum(_log(low) for low, _ in ends), times * sum(_log(high) for _, high in ends)
    if any(isinstance(value, Range) for value in arguments):
        return -math.inf, math.inf
    return (_log(abs(determinant(matrix_of([(step.operation, arguments)])))),) * 2


def _log(value: float) -> float:
    return math.log(value) if value > 0 else -math.inf


def _absolute(value: Value) -> tuple[float, float]:
    low, high = value if isinstance(value, Range) else (value, value)
    if low <= 0 <= high:
        return 0.0, max(-low, high)
    return min(abs(low), abs(high)), max(abs(low), abs(high))


def _shares(weights: list[Value]) -> list[Value]:
    """Of each weight its share of the sum."""
    ends = [(max(0.0, w.low), max(0.0, w.high)) if isinstance(w, Range) else (w, w) for w in weights]
    low, high = sum(a for a, _ in ends), sum(b for _, b in ends)
    found: list[Value] = []
    for a, b in ends:
        least = a / (a + high - b) if 0 < a + high - b < math.inf else 0.0
        most = b / (b + low - a) if 0 < b + low - a < math.inf else float(b > 0)
        found.append(least if least == most else Range(min(least, most), max(least, most)))
    return found


def _middle(value: Value) -> float:
    return (value.low + value.high) / 2 if isinstance(value, Range) else value


def _high(value: Value) -> float:
    return value.high if isinstance(value, Range) else value


def _is_number(value: Value) -> bool:
    return not any(map(math.isnan, value)) if isinstance(value, Range) else math.isfinite(value)
