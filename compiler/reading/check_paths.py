"""Parameters that are read before they are assigned.

A forward data-flow analysis over the paths from the scene's objects (Aho, Lam, Sethi & Ullman, section 9.2): at
every symbol, which parameters are assigned on all paths that lead there (``must``) and on at least one (``may``).
A read of a parameter outside of ``may`` fails wherever it happens; one outside of ``must`` fails on some path.

Example: ``Selection A { A -> [ roty a ] box; }`` placed by ``object { A }``: 'a' is in neither.
"""

from __future__ import annotations

from dataclasses import dataclass

from .diagnostics import Diagnostics
from .model import Apply, Assign, Calculate, Enter, Expression, Model, Operator, Primitive, Production, Read
from .source import Span
from .walk import Way, all_ways, expressions_of, operators_of, reads, ways

Names = frozenset[str]


@dataclass(frozen=True)
class Known:
    """What is assigned at a place: on all paths, and on some."""

    must: Names = frozenset()
    may: Names = frozenset()

    def joined(self, other: Known | None) -> Known:
        return self if other is None else Known(self.must & other.must, self.may | other.may)

    def with_(self, name: str) -> Known:
        return Known(self.must | {name}, self.may | {name})


def check_paths(model: Model, diagnostics: Diagnostics) -> None:
    """Report reads before assignment, each place once."""
    checker = _Paths(model, diagnostics)
    for placed in model.objects:
        checker.follow(placed.body, Known())
    while checker.waiting:
        name = checker.waiting.pop()
        checker.follow(model.symbols[name].production, checker.at[name])
    checker.reporting = True
    for placed in model.objects:
        checker.owner = placed.symbol
        checker.follow(placed.body, Known())
    for name, known in list(checker.at.items()):
        checker.owner = name
        checker.follow(model.symbols[name].production, known)


class _Paths:
    def __init__(self, model: Model, diagnostics: Diagnostics) -> None:
        self.model, self.diagnostics = model, diagnostics
        self.at: dict[str, Known] = {}
        self.waiting: list[str] = []
        self.reporting = False
        self.owner = ""
        self.said: set[tuple[int, int]] = set()
        self.needed = needed_parameters(model)

    def follow(self, production: Production, known: Known) -> None:
        """Carry ``known`` along every way of ``production`` to the symbols that it enters."""
        for way in ways(production):
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
        elif isinstance(way.leaf, Enter) and way.leaf.symbol in self.model.symbols:
            self._enter(way.leaf.symbol, known)

    def _enter(self, name: str, known: Known) -> None:
        before = self.at.get(name)
        joined = known.joined(before)
        if joined != before:
            self.at[name] = joined
            if name not in self.waiting:
                self.waiting.append(name)

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
            known = known.with_(statement.parameter)
        return known

    def read(self, expression: Expression, known: Known, certain: bool = True) -> None:
        """Report the reads in ``expression``; those that are evaluated only sometimes aren't ``certain``."""
        if not self.reporting:
            return
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


def needed_parameters(model: Model) -> Names:
    """The parameters that something but assignments depends on, directly or through other parameters."""
    needed: set[str] = set()
    feeds: dict[str, set[str]] = {}
    for operator in operators_of(model):
        if isinstance(operator, Calculate):
            for statement in operator.statements:
                if isinstance(statement, Assign):
                    feeds.setdefault(statement.parameter, set()).update(reads(statement.value))
                else:
                    needed |= reads(statement.count)
        else:
            for expression in expressions_of(operator):
                needed |= reads(expression)
    for way in all_ways(model):
        for expression in (*(test for test, _ in way.guards), *way.weights):
            needed |= reads(expression)
        if isinstance(way.leaf, Primitive):
            for expression in way.leaf.arguments:
                needed |= reads(expression)
    waiting = list(needed)
    while waiting:
        for name in feeds.get(waiting.pop(), ()):
            if name not in needed:
                needed.add(name)
                waiting.append(name)
    return frozenset(needed)
