"""What an editor shows beside a scene's text: forecasts of symbols, runs of guards, values of parameters.

model → :class:`Insights`. Everything is worked out over states (observe.py) and never unfolded; numbers of primitives
and runs are exact integers where no draw decides them, and bounds where one does.

Example: of Figure 2.1 the symbol Tree makes 2,049 cylinders in 13 levels, scaled by 0.8 to 1 a level; its guard
``cntTree > 0`` holds 10 times on the longest path; ``roty betaBr`` turns by 56° first and by 20° last.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

from ..reading.model import Model
from ..reading.walk import reached_from
from . import graph as g
from .count import Count, count, expected, least, most
from .explore import Exploration, explore
from .insight import GuardInsight, Insights, SymbolInsight, ValueInsight
from .lower import lower
from .observe import Either, Entered, Item, Noted, Observer, Site, Trace, flat
from .passes.dead import dead_parameters
from .ranges import Range
from .runaway import runs_away
from .site_values import SiteValues
from .states import State, objects_of

MAX_STATES = 20_000
MAX_DEPTH = 100_000


def insights(model: Model, max_states: int = MAX_STATES) -> Insights:
    """The insights of a model without errors; none where even what counts depends on has too many states."""
    graph = lower(model)
    dead_parameters(graph)
    for purpose in ("everything", "count"):
        observation = _Observation(graph, purpose, max_states)
        if observation.found.complete:
            return observation.insights()
    return Insights()


class _Observation:
    def __init__(self, graph: g.Graph, purpose: str, max_states: int) -> None:
        self.graph, self.purpose, self.max_states = graph, purpose, max_states
        observer = Observer(graph, purpose=purpose)
        self.roots = [observer.start(node) for node in objects_of(graph)]
        self.found: Exploration = explore(
            _states(self.roots),
            observer.expand,
            max_states,
            MAX_DEPTH,
            lambda path: runs_away(graph, path, MAX_DEPTH, observer.order),
        )

    def insights(self) -> Insights:
        self.cyclic = {state for i in self.found.cyclic for state in self.found.components[i]}
        self.low, self.high = (count(self.found, "", choose) for choose in (least, most))
        self.times = self._instances(min), self._instances(max)
        self.states: dict[int, list[State]] = {}
        self.components: dict[int, dict[int, None]] = {}  # those that a symbol has a state in
        for i, component in enumerate(self.found.components):
            for state in component:
                self.states.setdefault(state[0], []).append(state)
                self.components.setdefault(state[0], {})[i] = None
        self.depths = self._longest(lambda state: 1, frozenset(self.states))
        self.groups = self._groups()
        return Insights(list(self._symbols()), list(self._guards()), list(self._values()))

    # --- how often

    def _instances(self, choose: Callable[[Iterable[int]], int]) -> dict[State, Count]:
        """How often each state is entered in all: a bound where draws decide."""
        times: dict[State, Count] = dict.fromkeys(self.found.formulas, 0)
        for root in self.roots:
            for state, more in _entered(root, choose).items():
                times[state] += more
        for i in range(len(self.found.components) - 1, -1, -1):
            component = self.found.components[i]
            if i in self.found.cyclic and any(times[state] != 0 for state in component):
                times.update(dict.fromkeys(component))
            for state in component:
                for entered, more in _entered(self.found.formulas[state], choose).items():
                    before, own = times[entered], times[state]
                    if more and (before is None or own is None):
                        times[entered] = None
                    elif more:
                        times[entered] = before + own * more
        return times

    def _longest(self, weight: Callable[[State], int], inside: frozenset[int]) -> dict[State, int | None]:
        """The greatest sum of weights on a path from each state; only over states of symbols ``inside``."""
        longest: dict[State, int | None] = {}
        for i in self._components_of(inside):
            component = self.found.components[i]
            endless = i in self.found.cyclic and any(map(weight, component))
            for state in component:
                below = [longest.get(s, 0) for s in self.found.formulas[state].states() if s not in component]
                longest[state] = None if endless or None in below else weight(state) + max(below, default=0)
        return longest

    def _components_of(self, symbols: frozenset[int]) -> list[int]:
        """In the order in which they can be counted."""
        return sorted({i for symbol in symbols for i in self.components[symbol]})

    # --- symbols

    def _groups(self) -> dict[int, frozenset[int]]:
        """Of each symbol: those that it shares a recursion with, itself included."""
        below: dict[int, set[int]] = {symbol: set() for symbol in self.states}
        for state, formula in self.found.formulas.items():
            below[state[0]].update(entered[0] for entered in formula.states())
        reached = {symbol: reached_from(below[symbol], below) for symbol in below}
        return {
            symbol: frozenset({symbol, *(other for other in reached[symbol] if symbol in reached[other])})
            for symbol in below
        }

    def _symbols(self) -> Iterator[SymbolInsight]:
        kinds = sorted({kind for trace in self.found.formulas.values() for kind in _kinds(trace)})
        by_kind = {
            kind: (self.low, self.high) if len(kinds) == 1 else tuple(count(self.found, kind, c) for c in (least, most))
            for kind in kinds
        }
        expectations = self._expectations()
        outer = self._outermost()
        for symbol, states in self.states.items():
            # Symbols that only others of their recursion enter have no outermost instance: all count.
            entries = outer.get(symbol) or {state: tuple(times[state] for times in self.times) for state in states}
            largest = max(entries, key=lambda state: (_size(self.high[state]), _size(self.low[state])))
            node = self.graph.nodes[symbol]
            shapes = {kind: (low[largest], high[largest]) for kind, (low, high) in by_kind.items() if high[largest] != 0}
            yield SymbolInsight(
                name=node.name,
                span=node.span,
                primitives=(self.low[largest], self.high[largest]),
                kinds=shapes,
                expected=expectations.get((symbol, largest[1])),
                depth=self.depths[largest],
                scale=self._scale(symbol),
                instances=tuple(_sum(ends[i] for ends in entries.values()) for i in (0, 1)),
                alike=len({(self.low[state], self.high[state]) for state in entries}) <= 1,
            )

    def _expectations(self) -> dict[State, float]:
        """Of states that draws decide about: how many primitives to expect."""
        if self.low == self.high:
            return {}
        observer = Observer(self.graph, uniform=True, purpose="count" if self.purpose == "count" else "everything")
        roots = [observer.start(node) for node in objects_of(self.graph)]
        starts = dict.fromkeys((*_states(roots), *(s for s in self.found.formulas if _is_known(s))))
        found = explore(starts, observer.expand, self.max_states, MAX_DEPTH)
        if not found.complete:
            return {}
        return {state: float(value) for state, value in expected(found).items() if value is not None and value < 1e300}

    def _outermost(self) -> dict[int, dict[State, tuple[Count, Count]]]:
        """Of each symbol the states that are entered from outside of its recursion, and how often."""
        outer: dict[int, dict[State, list[Count]]] = {}

        def note(trace: Trace, times: tuple[Count, Count], group: frozenset[int]) -> None:
            for i, choose in enumerate((min, max)):
                for state, more in _entered(trace, choose).items():
                    if state[0] not in group:
                        ends = outer.setdefault(state[0], {}).setdefault(state, [0, 0])
                        ends[i] = _sum((ends[i], None if times[i] is None and more else more * (times[i] or 0)))

        for root in self.roots:
            note(root, (1, 1), frozenset())
        for state, trace in self.found.formulas.items():
            note(trace, (self.times[0][state], self.times[1][state]), self.groups[state[0]])
        return {symbol: {s: tuple(ends) for s, ends in states.items()} for symbol, states in outer.items()}

    def _scale(self, symbol: int) -> tuple[float, float] | None:
        """The mean scale from an instance to the next of the same symbol below it."""
        group = self.groups[symbol]
        returns: dict[State, tuple[float, float]] = {}
        ends: list[tuple[float, float]] = []
        for state in (state for i in self._components_of(group) for state in self.found.components[i]):
            ways = []
            for item in flat(self.found.formulas[state].items):
                if isinstance(item, Entered):
                    low, high = item.shrinking
                    if item.state[0] == symbol:
                        ways.append((low, high))
                    elif item.state in returns:
                        below = returns[item.state]
                        ways.append((low + below[0], high + below[1]))
            if ways:
                returns[state] = min(low for low, _ in ways), max(high for _, high in ways)
                if state[0] == symbol:
                    ends.append(returns[state])
        if not ends:
            return None
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        return (math.exp(low / 3), math.exp(high / 3)) if high < 700 else None

    # --- guards and values

    def _guards(self) -> Iterator[GuardInsight]:
        guards: dict[tuple, tuple[Site, dict[State, None]]] = {}
        for states in self.states.values():
            for state in states:
                for item in flat(self.found.formulas[state].items):
                    if isinstance(item, Noted) and item.site.kind == "guard":
                        guards.setdefault(item.site.key, (item.site, {}))[1][state] = None
        for key, (site, held) in guards.items():
            group = frozenset().union(*(self.groups[state[0]] for state in held))
            paths = self._longest(lambda state: int(state in held), group)
            path = None if None in paths.values() else max(paths.values())
            totals = []
            for choose, times in zip((min, max), self.times):
                runs = (_runs(self.found.formulas[state].items, key, choose) for state in held)
                totals.append(_sum(_product(times[s], n) for s, n in zip(held, runs)))
            yield GuardInsight(site.span, path, tuple(totals))

    def _values(self) -> Iterator[ValueInsight]:
        if self.purpose == "count":
            return  # states don't tell apart what these depend on
        drawn = self._drawn()
        noted: dict[tuple, SiteValues] = {}
        first, last = self._levels()
        traces = [(root, 0, 0, False) for root in self.roots]
        traces += [(trace, first[s], last[s], s in drawn) for s, trace in self.found.formulas.items()]
        for trace, earliest, latest, is_drawn in traces:
            for whole in trace.items:
                for item in flat((whole,)):
                    if isinstance(item, Noted) and item.site.kind != "guard":
                        values = noted.setdefault(item.site.key, SiteValues(item.site))
                        values.note(item.value, earliest, latest)
                        values.drawn |= is_drawn or isinstance(whole, Either)
        for each in noted.values():
            if math.isfinite(each.low) and math.isfinite(each.high):
                yield each.insight()

    def _drawn(self) -> set[State]:
        """The states that are met, or met so deep, only where a draw wills it."""
        found: set[State] = set()
        pending = [
            state
            for trace in (*self.roots, *self.found.formulas.values())
            for pick in trace.picks
            for _, way in pick
            for state in way.states()
        ]
        while pending:
            state = pending.pop()
            if state not in found:
                found.add(state)
                pending += self.found.formulas[state].states()
        return found

    def _levels(self) -> tuple[dict[State, int], dict[State, int | None]]:
        """The least and the greatest depth at which each state stands; None without end."""
        first: dict[State, int] = {}
        pending, level = list(_states(self.roots)), 1
        while pending:
            new = [state for state in dict.fromkeys(pending) if state not in first]
            first.update(dict.fromkeys(new, level))
            pending, level = [s for state in new for s in self.found.formulas[state].states()], level + 1
        last: dict[State, int | None] = dict.fromkeys(self.found.formulas, 0) | dict.fromkeys(_states(self.roots), 1)
        for i in range(len(self.found.components) - 1, -1, -1):
            component = self.found.components[i]
            if i in self.found.cyclic:
                last.update(dict.fromkeys(component))
            for state in component:
                depth = last[state]
                for entered in self.found.formulas[state].states():
                    known = last[entered]
                    last[entered] = None if depth is None or known is None else max(known, depth + 1)
        return first, last


def _states(traces: Iterable[Trace]) -> dict[State, None]:
    return {state: None for trace in traces for state in trace.states()}


def _is_known(state: State) -> bool:
    return not any(isinstance(value, Range) for value in state[1])


def _entered(trace: Trace, choose: Callable[[Iterable[int]], int]) -> dict[State, int]:
    """How often a trace enters each state: the least or the most that draws allow."""
    times = dict(trace.enters)
    for pick in trace.picks:
        ways = [_entered(way, choose) for _, way in pick]
        for state in dict.fromkeys(state for way in ways for state in way):
            times[state] = times.get(state, 0) + choose(way.get(state, 0) for way in ways)
    return times


def _runs(items: Iterable[Item], key: tuple, choose: Callable[[Iterable[int]], int]) -> int:
    """How often a guard holds in one application."""
    total = 0
    for item in items:
        if isinstance(item, Either):
            total += choose([_runs(way, key, choose) for way in item.ways])
        elif isinstance(item, Noted):
            total += item.site.key == key
    return total


def _kinds(trace: Trace) -> Iterator[str]:
    yield from trace.own
    for pick in trace.picks:
        for _, way in pick:
            yield from _kinds(way)


def _size(value: Count) -> float:
    if value is None:
        return math.inf
    return float(value) if value < 1e300 else 1e300 * value.bit_length()


def _sum(values: Iterable[Count]) -> Count:
    total = 0
    for value in values:
        if value is None:
            return None
        total += value
    return total


def _product(times: Count, runs: int) -> Count:
    return 0 if not runs else None if times is None else times * runs
