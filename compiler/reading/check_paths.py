"""Parameters that are read before they are assigned.

A forward data-flow analysis over the paths from the scene's objects (Aho, Lam, Sethi & Ullman, section 9.2): at
every symbol, which parameters are assigned on all paths that lead there (``must``) and on at least one (``may``).
A read of a parameter outside of ``may`` fails wherever it happens; one outside of ``must`` fails on some path.

Example: ``Selection A { A -> [ roty a ] box; }`` placed by ``object { A }``: 'a' is in neither.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from .diagnostics import Diagnostics
from .model import Apply, Assign, Calculate, Enter, Expression, Operator, Primitive, Production, Read
from .source import Span
from .view import View
from .walk import Way, expressions_of, reads, ways

Names = frozenset[str]


@dataclass(frozen=True)
class Known:
    """What is assigned at a place: on all paths, and on some."""

    must: Names = frozenset()
    may: Names = frozenset()

    def joined(self, other: Known | None) -> Known:
        return self if other is None else Known(self.must & other.must, self.may | other.may)

    def with_(self, names: Names) -> Known:
        return Known(self.must | names, self.may | names)


class Flow(NamedTuple):
    """What a production does to what is assigned. ``leaves``: (symbol that is entered, what is assigned on the way there).
    ``exposed``: what is read before anything in the production assigns it."""

    leaves: tuple[tuple[str, Names], ...]
    exposed: Names


def check_paths(view: View, diagnostics: Diagnostics) -> None:
    """Report reads before assignment, each place once."""
    every, count = view.of_productions(flow_of), len(view.model.objects)
    placed, flows = every[:count], dict(zip(view.model.symbols, every[count:]))
    reporter = _Reporter(view, diagnostics)
    for each, flow in zip(view.model.objects, placed):
        if flow.exposed:
            reporter.follow(each.symbol, each.body, Known())
    for name, known in view.ask_again(exposed_at, placed, flows):
        reporter.follow(name, view.model.symbols[name].production, known)


def exposed_at(starts: list[Flow], flows: dict[str, Flow]) -> list[tuple[str, Known]]:
    """The symbols that read what isn't assigned on all paths from the objects, with what is assigned there."""
    at: dict[str, Known] = {}
    waiting: dict[str, None] = {}

    def follow(flow: Flow, known: Known) -> None:
        for name, assigned in flow.leaves:
            if name in flows:
                before = at.get(name)
                joined = known.with_(assigned).joined(before)
                if joined != before:
                    at[name] = joined
                    waiting[name] = None

    for flow in starts:
        follow(flow, Known())
    while waiting:
        name = waiting.popitem()[0]
        follow(flows[name], at[name])
    return [(name, known) for name, known in at.items() if not flows[name].exposed <= known.must]


def flow_of(production: Production) -> Flow:
    found: dict[tuple[str, Names], None] = {}
    exposed: set[str] = set()
    for way in ways(production):
        assigned: set[str] = set()
        for test in (*(test for test, _ in way.guards), *way.weights):
            exposed |= reads(test)
        for operator in way.operators:
            together = isinstance(operator, Calculate) and operator.together
            before = frozenset(assigned) if together else assigned
            for statement in operator.statements if isinstance(operator, Calculate) else ():
                exposed |= reads(statement.value if isinstance(statement, Assign) else statement.count) - before
                if isinstance(statement, Assign):
                    assigned.add(statement.parameter)
            if not isinstance(operator, Calculate):
                for expression in expressions_of(operator):
                    exposed |= reads(expression) - assigned
        if isinstance(way.leaf, Primitive):
            for argument in way.leaf.arguments:
                exposed |= reads(argument) - assigned
        elif isinstance(way.leaf, Enter):
            found[way.leaf.symbol, frozenset(assigned)] = None
    return Flow(tuple(found), frozenset(exposed))


class _Reporter:
    def __init__(self, view: View, diagnostics: Diagnostics) -> None:
        self.view, self.diagnostics = view, diagnostics
        self.owner = ""
        self.said: set[tuple[int, int]] = set()

    @cached_property
    def needed(self) -> Names:
        return needed_parameters(self.view)

    def follow(self, owner: str, production: Production, known: Known) -> None:
        """Report what each way of ``production`` reads that isn't assigned; ``known`` is what is at its start."""
        self.owner = owner
        for way in self.view.ways(production):
            self._way(way, known)

    def _way(self, way: Way, known: Known) -> None:
        for test, _ in way.guards:
            self.read(test, known)
        for weight in way.weights:
            self.read(weight, known)
        for operator in way.operators:
            known = self._operator(operator, known)
        if isinstance(way.leaf, Primitive):
            for argument in way.leaf.arguments:
                self.read(argument, known)

    def _operator(self, operator: Operator, known: Known) -> Known:
        if not isinstance(operator, Calculate):
            for expression in expressions_of(operator):
                self.read(expression, known)
            return known
        before = known
        for statement in operator.statements:
            scope = before if operator.together else known
            if not isinstance(statement, Assign):
                self.read(statement.count, scope)
                continue
            # What is assigned to no purpose is removed, and its errors with it.
            self.read(statement.value, scope, certain=statement.parameter in self.needed)
            known = known.with_(frozenset((statement.parameter,)))
        return known

    def read(self, expression: Expression, known: Known, certain: bool = True) -> None:
        """Report the reads in ``expression``; those that are evaluated only sometimes aren't ``certain``."""
        if isinstance(expression, Apply):
            lazy = expression.operation in ("and", "or", "select")
            for i, argument in enumerate(expression.arguments):
                self.read(argument, known, certain and not (lazy and i > 0))
        elif isinstance(expression, Read) and expression.parameter not in known.must:
            self._report(expression, known, certain)

    def _report(self, read: Read, known: Known, certain: bool) -> None:
        span = read.span
        if span is None or (span.start, id(span.source)) in self.said:
            return
        self.said.add((span.start, id(span.source)))
        name = read.parameter
        hint = self._hint(name, span)
        if certain and name not in known.may:
            message = f"'{name}' is read on the way through '{self.owner}', but nothing has assigned it"
            self.diagnostics.add("unassigned", span, message, hint)
        else:
            message = f"'{name}' may be read on the way through '{self.owner}' before it is assigned"
            self.diagnostics.add("maybe-unassigned", span, message, hint)

    def _hint(self, name: str, span: Span) -> str:
        owner = self.owner
        return f"assign it in an entry action: Calculation C_init {{ {name} = 0; }} and, first in {owner}, C_init {owner};"


def needed_parameters(view: View) -> Names:
    """The parameters that something but assignments depends on, directly or through other parameters."""
    needed: set[str] = set()
    feeds: dict[str, set[str]] = {}
    for uses in view.uses:
        needed |= uses.read
        for name, several in uses.feeds:
            feeds.setdefault(name, set()).update(several)
    waiting = list(needed)
    while waiting:
        for name in feeds.get(waiting.pop(), ()):
            if name not in needed:
                needed.add(name)
                waiting.append(name)
    return frozenset(needed)
