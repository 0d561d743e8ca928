"""A model as the checks look at it: its productions, its operators, and what was found out about each.

What a check asks of a single node goes through ``ask`` (memory.py), so that after an edit it is known of all nodes that
are still there; what a check does for the whole scene goes over answers, not over expressions.

Example::

    view = View(model, Memory())
    for way in view.ways(model.symbols["Tree"].production): …
    view.writes["n"]                # what is assigned to 'n'
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Callable, NamedTuple

from .intervals import Ask, Interval, intervals_of
from .linear import form
from .memory import Memory
from .model import Assign, Calculate, Enter, Expression, Model, Operator, Primitive, Production
from .walk import Way, expressions_of, reached_from, reads, seed_of, ways


class Uses(NamedTuple):
    """What an operator or a production does with parameters. ``feeds``: (parameter, what the value assigned to it reads);
    ``read``: what all else reads."""

    read: frozenset[str]
    feeds: tuple[tuple[str, frozenset[str]], ...] = ()


class View:
    def __init__(self, model: Model, memory: Memory) -> None:
        self.model, self.seed = model, seed_of(model)
        self.ask, self.ask_in_turn, self.ask_again = memory.ask, memory.ask_in_turn, memory.ask_again
        self._ask_each = memory.ask_each
        self.symbols = list(model.symbols.values())
        self.productions: list[Production] = [placed.body for placed in model.objects]  # type: ignore[misc]
        self.productions += [symbol.production for symbol in self.symbols]

    def of_each(self, question: Callable[..., Any], nodes: list, given: list | None = None, in_turn: bool = False) -> list:
        """Memory.ask_each with the seed, and with what is ``given`` for each where there is more."""
        seed = self.seed
        several = [(seed,)] * len(nodes) if given is None else [(seed, each) for each in given]
        return self._ask_each(question, nodes, several, in_turn)

    def of_productions(self, question: Callable[..., Any], in_turn: bool = False) -> list:
        """What a question that needs no seed comes to for all productions, those of objects first."""
        return self._ask_each(question, self.productions, [()] * len(self.productions), in_turn)

    def ways(self, production: Production) -> tuple[Way, ...]:
        return self.ask(ways_of, production)

    @cached_property
    def operators(self) -> list[Operator]:
        """Every operator of the scene, each once."""
        found = {id(each): each for several in self.of_productions(operators_in) for each in several}
        return list(found.values())

    @cached_property
    def calculations(self) -> list[Calculate]:
        found = {id(each): each for several in self.of_productions(calculations_in) for each in several}
        return list(found.values())

    @cached_property
    def writes(self) -> dict[str, list[tuple[int, float | None]]]:
        """What operators assign to each parameter: (the operator's id, the constant or None)."""
        return self.ask_in_turn(_writes_of, *self.calculations)

    @cached_property
    def intervals(self) -> dict[str, Interval]:
        """Where the values of each assigned parameter lie."""
        return self.ask_in_turn(intervals_of, *self.calculations)

    @cached_property
    def entered(self) -> list[frozenset[str]]:
        """The symbols that each production leads to."""
        return self.of_productions(entered_by)

    @cached_property
    def edges(self) -> dict[str, frozenset[str]]:
        """The symbols that each symbol leads to."""
        return dict(zip(self.model.symbols, self.entered[len(self.model.objects) :]))

    @cached_property
    def reached(self) -> frozenset[str]:
        """The symbols that the scene's objects lead to, guards ignored."""
        starts = frozenset().union(*self.entered[: len(self.model.objects)])
        return self.ask_again(reached_from, starts, self.edges)

    @cached_property
    def uses(self) -> list[Uses]:
        """What operators and productions do with parameters."""
        found = [self.ask(uses_of_operator, operator) for operator in self.operators]
        return found + [self.ask(uses_of_production, production) for production in self.productions]


# --- questions


def _writes_of(ask: Ask, *calculations: Calculate) -> dict[str, list[tuple[int, float | None]]]:
    found: dict[str, list[tuple[int, float | None]]] = {}
    for operator in calculations:
        for name, value in ask(constants_of, operator):
            found.setdefault(name, []).append((id(operator), value))
    return found


def ways_of(production: Production) -> tuple[Way, ...]:
    return tuple(ways(production))


def entered_by(production: Production) -> frozenset[str]:
    return frozenset(way.leaf.symbol for way in ways(production) if isinstance(way.leaf, Enter))


def operators_in(production: Production) -> tuple[Operator, ...]:
    return tuple({id(each): each for way in ways(production) for each in way.operators}.values())


def calculations_in(production: Production) -> tuple[Calculate, ...]:
    return tuple(each for each in operators_in(production) if isinstance(each, Calculate))


def own_expressions(production: Production) -> list[Expression]:
    """The guards, weights and arguments of primitives of a production, each once."""
    found: dict[int, Expression] = {}
    for way in ways(production):
        several = [test for test, _ in way.guards]
        several += way.weights
        several += way.leaf.arguments if isinstance(way.leaf, Primitive) else ()
        found.update((id(each), each) for each in several)
    return list(found.values())


def constants_of(operator: Calculate) -> tuple[tuple[str, float | None], ...]:
    """The parameters that an operator assigns, with the constant that they get; None for another value."""
    assigns = [each for each in operator.statements if isinstance(each, Assign)]
    forms = ((each.parameter, form(each.value, {})) for each in assigns)
    return tuple((name, None if value.factors or value.low != value.high else value.low) for name, value in forms)


def guards_read(production: Production) -> tuple[str, ...]:
    """The parameters that a production's guards read, sorted."""
    return tuple(sorted({name for way in ways(production) for test, _ in way.guards for name in reads(test)}))


def uses_of_operator(operator: Operator) -> Uses:
    if not isinstance(operator, Calculate):
        return Uses(frozenset().union(*map(reads, expressions_of(operator))))
    assigns = [each for each in operator.statements if isinstance(each, Assign)]
    others = [each.count for each in operator.statements if not isinstance(each, Assign)]
    feeds = tuple((each.parameter, reads(each.value)) for each in assigns)
    return Uses(frozenset().union(*map(reads, others)), feeds)


def uses_of_production(production: Production) -> Uses:
    return Uses(frozenset().union(*map(reads, own_expressions(production))))


def read_by(ask: Ask, production: Production) -> frozenset[str]:
    """The parameters that a production and its operators read, their own updates apart."""
    every = [uses_of_production(production), *(ask(uses_of_operator, each) for each in operators_in(production))]
    fed = (several - {name} for uses in every for name, several in uses.feeds)
    return frozenset().union(*(uses.read for uses in every), *fed)
