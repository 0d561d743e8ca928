"""How much a scene unfolds to, without unfolding it: graph → :class:`Forecast`.

The states of the derivation are explored with the runtime's exact values, so that counts are exact integers
however long (Figure 2.1 of order 1000 has a count of 302 digits and 1003 states). Where draws decide how many
primitives there are, the forecast gives bounds, over everything that the draws could be, and an expectation.

Example::

    >>> forecast(graph).primitives, forecast(graph).states, forecast(graph).depth      # Figure 2.1
    (2049, 13, 13)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from decimal import Decimal

from ..bytecode.layout_rows import LIMITS
from ..reading.diagnostics import Diagnostics
from ..reading.source import Span
from . import graph as g
from .chances import Chances
from .contraction import contracts
from .count import Count, count, expected, least, most
from .explore import Exploration, explore
from .passes.liveness import draw_sets, live_sets
from .runaway import runs_away
from .states import Derivation, DerivationError, Formula, State, objects_of

MAX_STATES = 50_000
MAX_DEPTH = LIMITS["depth"]  # the runtime follows no path farther
MAX_ERRORS = 20
PROOF_STATES = 2000

# An export has at most so many; rendering has no such limit.
MOST_PRIMITIVES = 100_000_000


@dataclass
class Forecast:
    """``primitives`` counts what symbols generate (objects' own shapes don't count); None if it depends on draws or has
    no end. ``by_kind`` by the shapes' names. ``primitives_range``: low, expected, high; all the same number if it is
    known, None where there is no finite or known one. ``states``: distinct states, None if there are more than
    MAX_STATES. ``depth``: most symbols entered on a path, None if endless or unknown. ``infinite``: a recursion
    without end that contracts."""

    primitives: int | None = 0
    by_kind: dict[str, int | None] = field(default_factory=dict)
    primitives_range: tuple[int | None, int | float | None, int | None] = (0, 0, 0)
    states: int | None = 0
    depth: int | None = 0
    infinite: bool = False
    diagnostics: list = field(default_factory=list)


def forecast(graph: g.Graph, max_states: int = MAX_STATES, max_depth: int = MAX_DEPTH) -> Forecast:
    """The forecast of a graph after all passes. Errors that the derivation would stop with, endless recursion and
    limits are in ``diagnostics``."""
    return _Forecaster(graph, max_states, max_depth).run()


class _Forecaster:
    def __init__(self, graph: g.Graph, max_states: int, max_depth: int) -> None:
        self.graph, self.max_states, self.max_depth = graph, max_states, max_depth
        self.derivation = Derivation(graph)
        self.diagnostics = Diagnostics()
        self.told: set[tuple[str, int]] = set()
        self.result = Forecast()

    def run(self) -> Forecast:
        result = self.result
        starts = self.starts(self.derivation)
        found = explore(starts, self.expand, self.max_states, self.max_depth, self.runs_away)
        if not found.complete:
            self.report_limit(found)
        endless = self.report_cycles(found)
        depends = draw_sets(self.graph, "count", live_sets(self.graph, "count"))[0]
        result.states = len(found.formulas) if found.complete else None
        result.depth = self.depth(found, starts) if found.complete else None
        if found.complete and not depends:
            self.count_exactly(found, starts)
        else:
            result.primitives, result.primitives_range, result.by_kind = None, (None, None, None), {}
            if not endless:
                # After a path without end seen, only a proof of it is worth looking for.
                proof = (min(self.max_states, PROOF_STATES), min(self.max_depth, PROOF_STATES))
                self.count_chances(*(proof if found.limit == "depth" else (self.max_states, self.max_depth)))
        self.report_expansion(result)
        result.infinite = bool(found.cyclic) and not self.diagnostics.has_errors
        result.diagnostics = self.diagnostics.sorted()
        return result

    # --- exploring

    def starts(self, deriver: Derivation | Chances) -> dict[State, int]:
        """The states that objects enter, and how often."""
        starts: dict[State, int] = {}
        for node in objects_of(self.graph):
            try:
                formula = deriver.start(node)
            except DerivationError as error:
                self.report(error)
                continue
            for state, times in formula.enters.items():
                starts[state] = starts.get(state, 0) + times
        return starts

    def expand(self, state: State) -> Formula:
        try:
            return self.derivation.expand(state)
        except DerivationError as error:
            self.report(error)
            return Formula()

    def runs_away(self, path: list[State]) -> bool:
        return runs_away(self.graph, path, self.max_depth)

    def report(self, error: DerivationError) -> None:
        self.tell(error.code, error.span, error.message)

    def tell(self, code: str, span: Span | None, message: str, hint: str = "") -> None:
        """One message a code and place, however many states meet it."""
        span = span or next((node.span for node in self.graph.nodes if node.span), None)
        if span is None or len(self.told) >= MAX_ERRORS or (code, span.start) in self.told:
            return
        self.told.add((code, span.start))
        self.diagnostics.add(code, span, message, hint)

    def report_limit(self, found: Exploration) -> None:
        if found.limit == "depth":
            state = found.path[-1]
            message = (
                f"a path enters more than {self.max_depth:,} symbols{self.derivation.circumstances(state)}"
            )
            hint = "the recursion seems to have no end: does a guard stop it?"
            self.tell("depth-limit", self.graph.nodes[state[0]].span, message, hint)
            return
        symbol = self.graph.nodes[next(iter(found.formulas))[0]]
        message = f"more than {self.max_states:,} states: their number isn't counted, errors in them aren't looked for"
        self.tell("state-limit", symbol.span, message)

    def report_expansion(self, result: Forecast) -> None:
        """What the back ends that unfold a scene would refuse."""
        low, middle, _ = result.primitives_range
        count = low if low == middle else middle
        if count is None or count <= MOST_PRIMITIVES:
            return
        digits = 1 + int(int(count).bit_length() * 0.30103)
        shown = f"{int(count):,}" if digits <= 15 else f"a number of about {digits} digits of"
        message = f"the scene has {shown} primitives: rendering doesn't mind, but no export can write so many"
        hint = f"an export has at most {MOST_PRIMITIVES:,}; -D sets a Parameter to a smaller value"
        placing = (i for i in objects_of(self.graph) if self.derivation.start(i).enters)
        span = next((self.graph.nodes[i].span for i in placing), None)
        self.tell("expansion", span, message, hint)

    def report_cycles(self, found: Exploration) -> bool:
        """Whether a recursion without end doesn't contract."""
        endless = False
        for i in found.cyclic:
            component = found.components[i]
            if contracts(component, self.derivation):
                continue
            endless = True
            state = component[-1]
            name = self.graph.nodes[state[0]].name
            message = f"endless recursion: '{name}' comes back to itself unchanged{self.derivation.circumstances(state)}"
            hint = "a guard has to end it, or every way round has to make things smaller"
            self.tell("endless", self.graph.nodes[state[0]].span, message, hint)
        return endless

    def depth(self, found: Exploration, starts: dict[State, int]) -> int | None:
        """The most symbols entered on a path; None if there is no end."""
        depths: dict[State, int | None] = {}
        for i, component in enumerate(found.components):
            for state in component:
                below = [None] if i in found.cyclic else [depths[s] for s in found.formulas[state].states()]
                depths[state] = None if None in below else 1 + max(below, default=0)
        below = [depths[state] for state in starts]
        return None if None in below else max(below, default=0)

    # --- counting

    def kinds(self, found: Exploration) -> list[str]:
        kinds: dict[str, None] = {}
        pending = list(found.formulas.values())
        while pending:
            formula = pending.pop()
            kinds.update(dict.fromkeys(formula.own))
            pending.extend(alternative for pick in formula.picks for _, alternative in pick)
        return sorted(kinds)

    def count_exactly(self, found: Exploration, starts: dict[State, int]) -> None:
        result = self.result
        result.primitives = _total(count(found, "", most), starts)
        result.by_kind = {kind: _total(count(found, kind, most), starts) for kind in self.kinds(found)}
        result.primitives_range = (result.primitives,) * 3

    def count_chances(self, max_states: int, max_depth: int) -> None:
        """Bounds and, where they differ, the expectation."""
        result = self.result
        bounds = Chances(self.graph, uniform=False)
        starts = self.starts(bounds)
        found = explore(starts, bounds.expand, max_states, max_depth)
        if not found.complete:
            return
        low, high = (_total(count(found, "", choose), starts) for choose in (least, most))
        if low is None:
            self.report_certain_recursion(found, starts)
        for kind in self.kinds(found):
            ends = [_total(count(found, kind, choose), starts) for choose in (least, most)]
            result.by_kind[kind] = ends[0] if ends[0] == ends[1] else None
        if result.states is not None or result.depth is None:
            result.depth = result.depth or self.depth(found, starts)
        if low == high:
            result.primitives, result.primitives_range = low, (low, low, high)
        else:
            result.primitives_range = (low, self.expectation(low, high), high)

    def expectation(self, low: int | None, high: int | None) -> int | float | None:
        chances = Chances(self.graph, uniform=True)
        starts = self.starts(chances)
        found = explore(starts, chances.expand, self.max_states, self.max_depth)
        if not found.complete:
            return None
        values = expected(found)
        if low is None or any(values[state] is None for state in starts):
            return None
        total = sum((times * values[state] for state, times in starts.items()), Decimal(0))
        expected_count = float(total) if total < Decimal("1e300") else int(total)
        # Rounded chances may add up to less or more than 1.
        return max(low, expected_count if high is None else min(expected_count, high))

    def report_certain_recursion(self, found: Exploration, starts: dict[State, int]) -> None:
        """A recursion that no draw can end."""
        counts = count(found, "", least)
        for i, component in enumerate(found.components):
            state = component[-1]
            if i in found.cyclic and counts[state] is None:
                symbol = self.graph.nodes[state[0]]
                message = f"endless recursion: '{symbol.name}' always comes back to itself, whatever is drawn"
                self.tell("endless", symbol.span, message)
                return


def _total(counts: dict[State, Count], starts: dict[State, int]) -> Count:
    if any(counts[state] is None for state in starts):
        return None
    return sum(times * counts[state] for state, times in starts.items())
