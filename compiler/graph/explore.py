"""The graph of states, explored depth first without recursion and without unfolding anything.

``explore(starts, expand) -> Exploration`` with the strongly connected components in the order in which they can be
counted (Tarjan, Depth-first search and linear graph algorithms, 1972): what a component enters stands before it.

Example: for Figure 2.1 there are thirteen components of one state each, (0, 0, …) first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from .states import Formula, State


# Lengths of a path at which to see whether it has an end.
LOOKED_AT = frozenset(2**i for i in range(8, 20))


class Stopped(Exception):
    """Raised by ``expand`` or a limit to end the exploration."""


@dataclass
class Exploration:
    formulas: dict[State, Formula] = field(default_factory=dict)
    numbers: dict[State, int] = field(default_factory=dict)  # in the order of discovery
    components: list[list[State]] = field(default_factory=list)
    cyclic: set[int] = field(default_factory=set)  # indices of components that enter themselves
    complete: bool = True
    limit: str = ""  # 'states' or 'depth' where it stopped
    path: list[State] = field(default_factory=list)  # where it stopped


def explore(
    starts: Iterable[State],
    expand: Callable[[State], Formula],
    max_states: int,
    max_depth: int,
    runs_away: Callable[[list[State]], bool] | None = None,
) -> Exploration:
    """Every state that ``starts`` lead to, unless a limit stops the exploration: so many states beside the path to
    the one at hand, or so long a path. ``runs_away`` may know of a path that it will be as long."""
    found = Exploration()
    try:
        for start in starts:
            if start not in found.formulas:
                _search(start, expand, found, max_states, max_depth, runs_away)
    except Stopped:
        found.complete = False
    return found


def _search(
    start: State,
    expand: Callable[[State], Formula],
    found: Exploration,
    max_states: int,
    max_depth: int,
    runs_away: Callable[[list[State]], bool] | None,
) -> None:
    number = found.numbers
    lowest: dict[State, int] = {}
    open_: list[State] = []
    is_open: set[State] = set()
    path: list[tuple[State, Iterator[State]]] = []

    def visit(state: State) -> None:
        # States on the path itself don't count as many: one long recursion isn't an explosion.
        beside = len(number) - len(path)
        is_long = len(path) >= max_depth
        if runs_away is not None and len(path) in LOOKED_AT:
            is_long = is_long or runs_away([s for s, _ in path])
        for limit, reached in (("depth", is_long), ("states", beside >= max_states)):
            if reached:
                found.limit, found.path = limit, [s for s, _ in path]
                raise Stopped
        number[state] = lowest[state] = len(number)
        open_.append(state)
        is_open.add(state)
        formula = found.formulas[state] = expand(state)
        path.append((state, iter(list(formula.states()))))

    visit(start)
    while path:
        state, entered = path[-1]
        for child in entered:
            if child not in number:
                visit(child)
                break
            if child in is_open:
                lowest[state] = min(lowest[state], number[child])
        else:
            path.pop()
            if path:
                lowest[path[-1][0]] = min(lowest[path[-1][0]], lowest[state])
            if lowest[state] == number[state]:
                _close(state, open_, is_open, found)


def _close(state: State, open_: list[State], is_open: set[State], found: Exploration) -> None:
    """Take a whole component from the open states."""
    component = []
    while not component or component[-1] != state:
        component.append(open_.pop())
        is_open.discard(component[-1])
    if len(component) > 1 or state in set(found.formulas[state].states()):
        found.cyclic.add(len(found.components))
    found.components.append(component)
