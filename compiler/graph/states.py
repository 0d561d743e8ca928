"""The derivation state by state (paper, section 2; DESIGN: a state is symbol, live parameters, random key).

``Derivation(graph)`` expands one state at a time with the runtime's exact values: which primitives its production
has, and which states it enters. :mod:`forecast` explores the graph of states with it.

Example: in Figure 2.1 the state (Tree, cntTree 3, cntTrunk 0, betaBr 32) has one cylinder and enters
(Tree, 2, 0, 28) twice.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field

from ..elementary import seed_key
from ..reading.source import Span
from . import graph as g
from .evaluate import EvaluationError, Scope, calculate, choose, evaluate, transform
from .matrices import IDENTITY, Matrix, is_singular, multiply
from .rewrite import expressions

State = Hashable


@dataclass(slots=True)
class Formula:
    """What a state gives, as a sum: primitives of its own by kind, states that it enters by how often, and of each
    of ``picks`` one alternative, with its probability."""

    own: dict[str, int] = field(default_factory=dict)
    enters: dict[State, int] = field(default_factory=dict)
    picks: list[list[tuple[float, Formula]]] = field(default_factory=list)

    def add(self, kind: str) -> None:
        self.own[kind] = self.own.get(kind, 0) + 1

    def enter(self, state: State) -> None:
        self.enters[state] = self.enters.get(state, 0) + 1

    def states(self) -> Iterator[State]:
        yield from self.enters
        for pick in self.picks:
            for _, formula in pick:
                yield from formula.states()


class DerivationError(Exception):
    """An evaluation error with its circumstances: a message that names the symbol and its values, and a span."""

    def __init__(self, error: EvaluationError, span: Span | None, circumstances: str) -> None:
        super().__init__(error.message)
        self.code, self.span = error.code, error.span or span
        self.message = error.message + circumstances


class Derivation:
    """Expands concrete states. ``scopes`` holds a representative of each state met: parameters that aren't live may
    differ between instances of a state, but change nothing that counts here."""

    def __init__(self, graph: g.Graph) -> None:
        self.graph = graph
        self.scopes: dict[State, Scope] = {}
        self.singular: dict[int, int] = {}  # node → subtrees dropped
        self.seed_key = seed_key(seed_of(graph))
        self.children = [node.children() for node in graph.nodes]

    def start(self, node: int) -> Formula:
        """The formula of an object node. Primitives outside of symbols aren't counted."""
        placed = self.graph.nodes[node]
        scope = Scope.of_object(self.seed_key, placed.name, placed.ordinal)
        formula = self._walk(placed.child, scope, None, None)
        return Formula(enters=formula.enters)

    def expand(self, state: State) -> Formula:
        """Raises DerivationError."""
        return self._walk(self.graph.nodes[state[0]].body, self.scopes[state], state, None)

    def matrices(self, state: State) -> list[tuple[State, Matrix]]:
        """The states that a state enters, each with the transformation on the way there."""
        found: list[tuple[State, Matrix]] = []
        self._walk(self.graph.nodes[state[0]].body, self.scopes[state], state, found)
        return found

    def _walk(self, node: int, scope: Scope, state: State | None, edges: list | None) -> Formula:
        formula = Formula()
        stack = [(node, scope.copy(), IDENTITY)]
        while stack:
            index, scope, matrix = stack.pop()
            try:
                following = self._step(index, scope, matrix, formula, edges)
            except EvaluationError as error:
                raise DerivationError(
                    error, self.graph.nodes[index].span, self.circumstances(state)
                ) from None
            stack.extend(reversed(following))
        return formula

    def _step(
        self, index: int, scope: Scope, matrix: Matrix, formula: Formula, edges: list | None
    ) -> list[tuple[int, Scope, Matrix]]:
        """Pass one node: what follows it. ``scope`` may be changed. Matrices are composed only for ``edges``."""
        node = self.graph.nodes[index]
        match node:
            case g.Branch():
                return [(node.then if evaluate(node.test, scope) != 0 else node.otherwise, scope, matrix)]
            case g.Choose():
                return [(choose(node, scope), scope, matrix)]
            case g.Calculate():
                calculate(node, scope)
            case g.TransformCode() | g.Transform():
                own = node.matrix if isinstance(node, g.Transform) else transform(node, scope)
                if is_singular(own):
                    self.singular[index] = self.singular.get(index, 0) + 1
                    return []
                if edges is not None:
                    matrix = multiply(matrix, own)
            case g.Texture() if node.draws:
                for expression in expressions(node):
                    evaluate(expression, scope)
            case g.Union():
                return [(child, scope.term(i), matrix) for i, child in enumerate(node.children_)]
            case g.Enter():
                self._enter(node, scope, matrix, formula, edges)
                return []
            case g.Primitive():
                for argument in node.arguments:
                    evaluate(argument, scope)
                formula.add(node.shape)
            case g.MeshLeaf():
                formula.add("mesh")
        return [(child, scope, matrix) for child in self.children[index]]

    def _enter(
        self, node: g.Enter, scope: Scope, matrix: Matrix, formula: Formula, edges: list | None
    ) -> None:
        symbol = self.graph.nodes[node.symbol]
        entered = scope.entered(symbol.name)
        live = tuple(entered.values.get(name) for name in symbol.live)
        state = (node.symbol, live, entered.key if symbol.draws else None)
        self.scopes.setdefault(state, entered)
        formula.enter(state)
        if edges is not None:
            edges.append((state, matrix))

    def circumstances(self, state: State | None) -> str:
        """`` (in 'Tree' with cntTree = 0, betaBr = 20)``, or '' outside of symbols."""
        if state is None:
            return ""
        symbol = self.graph.nodes[state[0]]
        values = [f"{name} = {value:.10g}" for name, value in zip(symbol.live, state[1]) if value is not None]
        return f" (in '{symbol.name}'{' with ' if values else ''}{', '.join(values)})"


def seed_of(graph: g.Graph) -> float:
    settings = dict(graph.settings.values) if graph.settings else {}
    return settings.get("seed", (0.0,))[0]


def objects_of(graph: g.Graph) -> list[int]:
    """The graph's object nodes."""
    root = graph.nodes[0]
    top = root.children_ if isinstance(root, g.Union) else (0,)
    return [i for i in top if isinstance(graph.nodes[i], g.Object)]
