"""Recursions that can't end, or end by luck only.

On the graph of symbols (guards ignored unless they are decided): a symbol *ends* if one of its ways leads only to
symbols that end. What doesn't end is an error unless every way round contracts. Of what may end, cycles are looked at whose guards read nothing
that changes on the way round, and cycles that only a draw leaves.

Example: ``Selection A { A -> box + [ trans 0 0 1 ] A; }`` never ends; with ``if (n > 0)`` and no ``--n``, it ends
at once or never.
"""

from __future__ import annotations

from typing import Any, Sequence

from . import affine
from .check_contraction import stays_large
from .check_scaling import Back, check_scaling, linear_map
from .check_termination import Starts, Values, check_termination, cyclic, starts_of
from .diagnostics import Diagnostic, Diagnostics
from .linear import after, form
from .model import (
    Apply,
    Assign,
    Branch,
    Calculate,
    Choose,
    Constant,
    Enter,
    Operand,
    Produce,
    Production,
    Read,
    Symbol,
    Transform,
    Variants,
)
from .view import View, guards_read
from .walk import Way, components, decided, draws, is_open, leaves, ways

# The ids of the operators on the ways round a recursion, and the parameters in its guards.
Needs = tuple[frozenset[int], tuple[str, ...]]

# Guards that stay true for ever when their left side moves this way.
UNBOUNDED = {"greater": 1, "greater_equal": 1, "less": -1, "less_equal": -1}


def check_recursion(view: View, diagnostics: Diagnostics) -> None:
    """Report on the recursions that the scene's objects lead to."""
    symbols = view.model.symbols
    edges = {name: ends for name, ends in view.edges.items() if name in view.reached}
    ways_to_end = view.of_each(endings, [symbols[name].production for name in edges])
    endless = view.ask_again(_endless, edges, dict(zip(edges, ways_to_end)))
    recursions = view.ask_again(_recursions, edges)
    own = _said_of_own_cycles(view, [symbols[names[0]] for names in recursions if len(names) == 1 and names[0] not in endless])
    for names in recursions:
        members = [symbols[name] for name in names]
        if not endless.isdisjoint(names):
            diagnostics.items += view.ask(said_of_endless, *members, given=(view.seed,))
        elif len(members) == 1:
            diagnostics.items += own[names[0]]
        else:
            (starts,) = values_at_entry([view.ask(needs_of, *members, given=(view.seed,))], view.writes)
            diagnostics.items += view.ask(said_of_cycle, *members, given=(view.seed, starts))


def _said_of_own_cycles(view: View, symbols: list[Symbol]) -> dict[str, list[Diagnostic]]:
    """Of symbols that enter themselves and may end: nearly all recursions of a large scene."""
    starts = view.ask_again(values_at_entry, view.of_each(needs_of, symbols), view.writes)
    said = view.of_each(said_of_cycle, symbols, starts)
    return {symbol.name: each for symbol, each in zip(symbols, said)}


def values_at_entry(needs: list[Needs], writes: dict[str, list[tuple[int, float | None]]]) -> list[Values]:
    """What parameters in the guards of recursions have where they are entered: all that these need to know of the scene."""
    return [tuple((name, starts_of(writes, name, inside)) for name in names) for inside, names in needs]


# --- questions


def said_of_endless(*given: Any) -> list[Diagnostic]:
    """Of symbols that enter each other and never end."""
    *members, seed = given
    diagnostics = Diagnostics()
    if stays_large(members, seed):
        _report_endless(members[0], members, diagnostics)
    else:
        check_scaling(_ways_back(members, seed), seed, diagnostics)
    return diagnostics.items


def said_of_cycle(*given: Any) -> list[Diagnostic]:
    """Of symbols that enter each other and may end."""
    *members, seed, starts = given
    diagnostics = Diagnostics()
    _check_cycle(members, Starts(seed, dict(starts)), diagnostics)
    return diagnostics.items


def needs_of(*given: Any) -> Needs:
    """What a recursion needs to know of the scene."""
    *members, seed = given
    inside = frozenset(id(operator) for _, way in _ways_back(members, seed) for operator in way.operators)
    return inside, tuple(sorted({name for symbol in members for name in guards_read(symbol.production)}))


def endings(production: Production, seed: float) -> tuple[frozenset[str], ...]:
    """A production ends if all symbols of one of these do."""
    found: list[frozenset[str]] = []
    waiting: list[Production] = [production]
    while waiting:
        production = waiting.pop()
        if isinstance(production, Branch):
            truth = decided(production.test, seed)
            waiting += [production.then] if truth is not False else []
            waiting += [production.otherwise] if truth is not True else []
        elif isinstance(production, Choose):
            waiting += [each for weight, each in production.cases if not (isinstance(weight, Constant) and weight.value == 0)]
        else:
            body: Operand = production.body if isinstance(production, Produce) else production
            found.append(frozenset(leaf.symbol for _, leaf in leaves(body) if isinstance(leaf, Enter)))
    return tuple(dict.fromkeys(found))


# --- what is said


def _report_endless(symbol: Symbol, members: list[Symbol], diagnostics: Diagnostics) -> None:
    others = ", ".join(f"'{other.name}'" for other in members[1:])
    through = f" (through {others})" if others else ""
    message = f"'{symbol.name}' never ends: each of its rules leads back to it{through}, and not every way round shrinks"
    hint = f"count down: if (n > 0) {symbol.name} -> … [ --n ] {symbol.name}; and a rule for the end"
    hint += f"\nor make every way round smaller, [ scale 0.5 ] {symbol.name}: then the detail cut-off ends it"
    diagnostics.add("endless", symbol.name_span, message, hint)


def _recursions(edges: dict[str, frozenset[str]]) -> list[list[str]]:
    """The symbols that lead back to themselves, those that lead to each other together, in the order of ``edges``."""
    place = {name: i for i, name in enumerate(edges)}
    found = (sorted(component, key=place.__getitem__) for component in components(edges))
    return [names for names in found if len(names) > 1 or names[0] in edges[names[0]]]


def _endless(edges: dict[str, frozenset[str]], endings: dict[str, tuple[frozenset[str], ...]]) -> frozenset[str]:
    """The symbols none of whose derivations is finite: the complement of a least fixpoint, component by component
    (what a component enters comes before it)."""
    ending: set[str] = set()
    for component in components(edges):
        changed = True
        while changed:
            changed = False
            for name in component - ending:
                if any(needed <= ending for needed in endings[name]):
                    ending.add(name)
                    changed = True
    return frozenset(edges) - ending


def _check_cycle(members: list[Symbol], starts: Starts, diagnostics: Diagnostics) -> None:
    """A cycle that can be left: does something change on the way round that its guards look at?"""
    seed = starts.seed
    back = _ways_back(members, seed)
    if not back:
        return  # all ways round are flattened to nothing
    drawing = [
        (symbol, way) for symbol, way in back if way.weights or any(draws(test) for test, _ in way.guards)
    ]
    guards = {name for symbol in members for name in guards_read(symbol.production)}
    changed = {name for _, way in back for name in _assigned(way)}
    if drawing and not guards & changed:
        symbol, way = drawing[0]
        span = way.leaf.span or symbol.name_span
        message = f"this recursion of '{symbol.name}' ends with some probability only"
        diagnostics.add(
            "random-loop", span, message, "the number of its rounds has no limit; a counter would give one"
        )
        check_scaling(back, seed, diagnostics)
        return
    if _check_identity(back, diagnostics):
        return
    if guards and not guards & changed and not drawing:
        symbol, way = back[0]
        span = way.leaf.span or symbol.name_span
        named = ", ".join(f"'{name}'" for name in sorted(guards))
        message = f"the guards read {named}, which this recursion of '{symbol.name}' never changes"
        diagnostics.add(
            "counter", span, message, f"change it on the way: [ --{sorted(guards)[0]} ] {symbol.name}"
        )
        check_scaling(back, seed, diagnostics)
    elif not _check_direction(back, diagnostics):
        check_termination(back, starts, diagnostics)


def _ways_back(members: Sequence[Symbol], seed: float) -> list[Back]:
    """The ways from the members of a recursion to its members that can be taken."""
    component = {symbol.name for symbol in members}
    return [
        (symbol, way)
        for symbol in members
        for way in ways(symbol.production)
        if isinstance(way.leaf, Enter) and way.leaf.symbol in component
        if is_open(way, seed) and not _is_dropped(way, seed)
    ]


def _is_dropped(way: Way, seed: float) -> bool:
    """Whether a constant transformation on the way is singular, so that nothing follows it."""
    matrix = linear_map(way.operators, seed)
    return matrix is not None and affine.determinant(matrix) == 0


def _check_identity(back: list[Back], diagnostics: Diagnostics) -> bool:
    """Whether some cycle changes nothing on its way, which is reported."""
    idle = cyclic([each for each in back if not _draws_before(each[1]) and not _has_effect(each[1])])
    if not idle:
        return False
    symbol, way = idle[0]
    through = sorted({other.name for other, _ in idle} - {symbol.name})
    passing = f" (through {', '.join(map(repr, through))})" if through else ""
    message = f"'{symbol.name}' leads back to itself with nothing changed{passing}: this never ends"
    hint = f"put an operator before it: [ --n; trans 0 0 1 ] {way.leaf.symbol}"
    diagnostics.add("identity-cycle", way.leaf.span or symbol.name_span, message, hint)
    return True


def _has_effect(way: Way) -> bool:
    """Whether operators on the way change a parameter, the random key or the place. (Textures are no part of a state.)"""
    for operator in way.operators:
        if isinstance(operator, Calculate):
            if any(isinstance(statement, Variants) for statement in operator.statements):
                return True
        elif isinstance(operator, Transform) and linear_map([operator], 0.0) != affine.IDENTITY:
            return True
    return any(found != form(Read(name), {}) for name, found in after(way.operators).items())


def _check_direction(back: list[Back], diagnostics: Diagnostics) -> bool:
    """Whether every way round moves a counter away from the guard that would end the recursion, `++n` under `n > 0`,
    which is reported."""
    for symbol, way in back:
        for test, needed in way.guards:
            if not (needed and isinstance(test, Apply) and test.operation in UNBOUNDED):
                continue
            counter, bound = test.arguments
            if not (isinstance(counter, Read) and isinstance(bound, Constant)):
                continue
            wrong = UNBOUNDED[test.operation]
            moves = [_direction(each, counter.parameter) for each in back]
            if all(move == wrong for move in moves):
                name = counter.parameter
                verb, other = ("grows", "--") if wrong > 0 else ("falls", "++")
                message = (
                    f"'{name}' only {verb} on every way round, and so this guard never ends the recursion"
                )
                span = test.span or symbol.name_span
                diagnostics.add("counter", span, message, f"count the other way: {other}{name}")
                return True
    return False


def _direction(back: Back, name: str) -> int | None:
    """1 or -1 if the way moves the parameter by constants of that sign only, else None."""
    signs = set()
    for operator in back[1].operators:
        for statement in operator.statements if isinstance(operator, Calculate) else ():
            if isinstance(statement, Assign) and statement.parameter == name:
                value = statement.value
                moved = isinstance(value, Apply) and value.operation in ("add", "subtract")
                if not (
                    moved and isinstance(value.arguments[0], Read) and value.arguments[0].parameter == name
                ):
                    return None
                amount = value.arguments[1]
                if not isinstance(amount, Constant) or amount.value == 0:
                    return None
                signs.add((1 if amount.value > 0 else -1) * (1 if value.operation == "add" else -1))
    return signs.pop() if len(signs) == 1 else None


def _draws_before(way: Way) -> bool:
    return bool(way.weights) or any(draws(test) for test, _ in way.guards)


def _assigned(way: Way) -> set[str]:
    return {
        statement.parameter
        for operator in way.operators
        if isinstance(operator, Calculate)
        for statement in operator.statements
        if isinstance(statement, Assign)
    }
