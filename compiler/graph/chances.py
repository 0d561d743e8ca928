"""The derivation with unknown draws: states whose parameters may be ranges, guards that may go both ways.

Only what the *number* of primitives depends on is followed: guards, weights and what flows into them. So a tree
whose angles alone are random has as few states here as one without randomness, and is counted exactly.

``Chances(graph, uniform)`` expands states as :class:`states.Derivation` does, with ``Formula.picks`` where a draw
decides.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..elementary import seed_key
from ..reading.model import Assign
from . import graph as g
from .passes.liveness import live_sets, needed
from .ranges import Range, Ranges, Value, Values
from .states import Formula, State, seed_of


class Chances:
    def __init__(self, graph: g.Graph, uniform: bool) -> None:
        self.graph = graph
        self.ranges = Ranges(uniform, seed_key(seed_of(graph)))
        self.live = live_sets(graph, "count")
        self.order = {
            i: tuple(sorted(self.live[i])) for i, node in enumerate(graph.nodes) if isinstance(node, g.Symbol)
        }
        self.statements = {
            i: [s for s in needed(node, self.live[node.child], "count")[0] if isinstance(s, Assign)]
            for i, node in enumerate(graph.nodes)
            if isinstance(node, g.Calculate)
        }

    def start(self, node: int) -> Formula:
        """The formula of an object node; primitives outside of symbols aren't counted."""
        return Formula(enters=self._walk(self.graph.nodes[node].child, {}).enters)

    def expand(self, state: State) -> Formula:
        symbol, live = state
        values = {name: value for name, value in zip(self.order[symbol], live) if value is not None}
        return self._walk(self.graph.nodes[symbol].body, values)

    def _walk(self, node: int, values: Values) -> Formula:
        formula = Formula()
        stack = [(node, values)]
        while stack:
            index, values = stack.pop()
            node = self.graph.nodes[index]
            match node:
                case g.Branch():
                    chance = self.ranges.probability(node.test, values)
                    if chance in (0.0, 1.0):
                        stack.append((node.then if chance else node.otherwise, values))
                    else:
                        ways = ((chance, node.then, True), (1 - chance, node.otherwise, False))
                        formula.picks.append(
                            [
                                (p, self._walk(to, self.ranges.refine(node.test, holds, values)))
                                for p, to, holds in ways
                            ]
                        )
                case g.Choose():
                    self._choose(node, values, formula, stack)
                case g.Calculate():
                    stack.append((node.child, self._calculate(index, node, values)))
                case g.Enter():
                    formula.enter((node.symbol, tuple(values.get(name) for name in self.order[node.symbol])))
                case g.Primitive():
                    formula.add(node.shape)
                case g.MeshLeaf():
                    formula.add("mesh")
                case _:
                    stack.extend((child, values) for child in reversed(node.children()))
        return formula

    def _calculate(self, index: int, node: g.Calculate, values: Values) -> Values:
        changed = dict(values)
        for statement in self.statements[index]:
            changed[statement.parameter] = self.ranges.evaluate(
                statement.value, values if node.together else changed
            )
        return changed

    def _choose(self, node: g.Choose, values: Values, formula: Formula, stack: list) -> None:
        weights = [self.ranges.evaluate(weight, values) for weight, _ in node.cases]
        possible = [(self._weight(w), body) for w, (_, body) in zip(weights, node.cases) if _highest(w) > 0]
        total = sum(weight for weight, _ in possible)
        if len(possible) == 1:
            stack.append((possible[0][1], values))
        elif possible:
            shares = _shares([weight for weight, _ in possible], total)
            formula.picks.append([(p, self._walk(body, values)) for p, (_, body) in zip(shares, possible)])

    def _weight(self, weight: Value) -> float:
        return max(0.0, self.ranges.middle(weight))


def _highest(weight: Value) -> float:
    return weight.high if isinstance(weight, Range) else weight


def _shares(weights: Sequence[float], total: float) -> list[float]:
    return [weight / total if 0 < total < float("inf") else 1 / len(weights) for weight in weights]
