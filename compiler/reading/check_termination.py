"""Counters: do the guards of a recursion bring it to its end?

A recursion surely ends if its ways round can be removed one after the other: a way goes if a guard on it needs a quantity
to be on one side of a bound, the way moves the quantity towards the bound by at least some fixed amount, and no other way
moves it back (a ranking function; Podelski & Rybalchenko 2004, linear case, lexicographic). What is left over is reported:
a counter that steps over the one value that its guard waits for, or else that no proof was found.

Example: ``if (n != 0) A -> box + [ n -= 2 ] A; else A -> sphere;`` from n = 5 never meets 0.
"""

from __future__ import annotations

from typing import Iterator, NamedTuple

from . import affine
from .check_scaling import Back, linear_map
from .diagnostics import Diagnostics
from .linear import NOTHING, Form, after, difference, form
from .model import Apply, Enter, Expression, Read
from .walk import Way, components, draws

# What parameters have where a recursion is entered, by name.
Values = tuple[tuple[str, tuple[float, ...] | None], ...]

# Rounds of a counter that are tried out to see whether it meets a value.
MAX_ROUNDS = 100_000

# What a comparison needs to hold → the sign of left - right; "" where it must only not be 0.
_NEEDS = {
    ("greater", True): ">", ("greater_equal", True): ">", ("less", True): "<", ("less_equal", True): "<",
    ("greater", False): "<", ("greater_equal", False): "<", ("less", False): ">", ("less_equal", False): ">",
    ("not_equal", True): "", ("equal", False): "",
}  # fmt: skip

# Whether a guard stops a counter (or lets it go on), and whether it falls → the comparison that it can't step over.
_TOWARDS = {(False, True): ">", (False, False): "<", (True, True): "<=", (True, False): ">="}


class Need(NamedTuple):
    """A guard on a way: ``quantity`` has to be above 0 (side '>'), below ('<'), or different from it ('')."""

    quantity: Expression
    side: str
    test: Expression


def check_termination(back: list[Back], starts: Starts, diagnostics: Diagnostics) -> None:
    """Report on the ways ``back`` of one recursion, of which none is unguarded."""
    edges = [each for each in back if not _draws(each[1])]
    while edges:
        removed = next((found for found in map(lambda e: _removable(e, edges, starts), edges) if found), None)
        if removed is None:
            break
        edges = cyclic([each for each in edges if each not in removed])
    if edges:
        _report(edges, starts, diagnostics)


def _report(edges: list[Back], starts: Starts, diagnostics: Diagnostics) -> None:
    for symbol, way in edges:
        for need in needs(way):
            missed = _missed(need, way, edges, starts)
            if missed is not None:
                start, step, name, bound = missed
                span = need.test.span or symbol.name_span
                message = f"'{name}' goes from {start:g} in steps of {step:g} and never is exactly {bound:g}"
                stops = isinstance(need.test, Apply) and need.test.operation == "equal"
                operator = _TOWARDS[stops, step < 0]
                hint = f"the recursion doesn't end there: write {name} {operator} {bound:g}"
                diagnostics.add("steps-over", span, message, hint)
                return
    if all(_shrinks(each, starts.seed) for each in edges):
        return  # the detail cut-off ends it
    symbol, way = edges[0]
    span = way.leaf.span or symbol.name_span
    message = f"can't prove that this recursion of '{symbol.name}' ends"
    hint = "a counter that each round moves towards its bound would show it: if (n > 0) … [ --n ] …"
    diagnostics.add("unproven", span, message, hint)


def _shrinks(edge: Back, seed: float) -> bool:
    """Whether a way from a symbol to itself surely makes things smaller."""
    symbol, way = edge
    matrix = linear_map(way.operators, seed)
    return _target(way) == symbol.name and matrix is not None and affine.spectral_radius(matrix) < 1 - 1e-9


def needs(way: Way) -> Iterator[Need]:
    """What the guards on a way ask for, one by one."""
    for test, needed in way.guards:
        yield from _needs_of(test, needed)


def _needs_of(test: Expression, needed: bool) -> Iterator[Need]:
    if isinstance(test, Read):
        if needed:
            yield Need(test, "", test)
    elif isinstance(test, Apply):
        side = _NEEDS.get((test.operation, needed))
        if side is not None:
            yield Need(difference(test), side, test)
        elif test.operation == "not":
            yield from _needs_of(test.arguments[0], not needed)
        elif (test.operation, needed) in (("and", True), ("or", False)):
            for argument in test.arguments:
                yield from _needs_of(argument, needed)


def _draws(way: Way) -> bool:
    return bool(way.weights) or any(draws(test) for test, _ in way.guards)


def _removable(edge: Back, edges: list[Back], starts: Starts) -> list[Back]:
    """``edge`` and others, if a guard on it shows that it is taken a limited number of times only."""
    for need in needs(edge[1]):
        sides = (
            [need.side] if need.side else [">", "<"] if _missed(need, edge[1], edges, starts, True) else []
        )
        for side in sides:
            quantity = form(need.quantity, {})
            if side == "<":
                quantity = quantity.times(-1.0)
            falls = [_falls(quantity, need, side, each[1], starts) for each in edges]
            if falls[edges.index(edge)] == 1 and all(fall is not None for fall in falls):
                return [edge]
    return []


def _falls(quantity: Form, need: Need, side: str, way: Way, starts: Starts) -> int | None:
    """1 if the way lowers ``quantity`` by at least some amount while it is above 0, 0 if it doesn't raise it."""
    later = form(need.quantity, after(way.operators))
    if side == "<":
        later = later.times(-1.0)
    change = later.plus(quantity, -1.0)
    if not change.factors:
        # The bounds of the quantity itself are no change: n - [c, c] both times.
        return 1 if change.high < 0 else 0 if change.high <= 0 else None
    if (
        len(quantity.factors) != 1
        or len(change.factors) != 1
        or change.factors[0][0] != quantity.factors[0][0]
    ):
        return None
    (name, factor), (_, slope) = quantity.factors[0], change.factors[0]
    # change = slope·n + rest, and n on its side of the bound -low/factor.
    if not quantity.is_bounded or quantity.low != quantity.high:
        return None
    bound = 0.0 - quantity.low / factor
    if slope / factor < 0:
        return 1 if slope * bound + change.high < 0 else None
    # It moves the faster the further it is: then where it starts decides.
    known = starts.of(name)
    if known is None:
        return None
    return 1 if known and all(slope * start + change.high < 0 for start in known) else None


def _missed(
    need: Need, way: Way, edges: list[Back], starts: Starts, meets: bool = False
) -> tuple[float, float, str, float] | None:
    """For a guard that waits for one value: the start, step, counter and value where the counter misses it; with
    ``meets`` where it does not, from any start."""
    quantity = form(need.quantity, {})
    if need.side or len(quantity.factors) != 1 or quantity.low != quantity.high:
        return None
    name, factor = quantity.factors[0]
    changes = {
        form(Read(name), after(each.operators)).plus(Form(((name, 1.0),), 0.0, 0.0), -1.0)
        for _, each in edges
    }
    changes.discard(NOTHING)
    known = starts.of(name)
    if len(changes) != 1 or not known:
        return None
    change = changes.pop()
    if change.factors or change.low != change.high:
        return None
    bound, results = 0.0 - quantity.low / factor, []
    for start in known:
        result = (start, change.low, name, bound)
        if _meets(start, change.low, bound) is meets:
            if not meets:
                return result
            results.append(result)
    return results[0] if meets and len(results) == len(known) else None


def _meets(start: float, step: float, bound: float) -> bool | None:
    """Whether ``start``, changed by ``step`` again and again as doubles are, is ever ``bound``; None if unknown."""
    value = start
    for _ in range(MAX_ROUNDS):
        if value == bound:
            return True
        if (value > bound) == (step > 0):
            return False
        value += step
    return None


class Starts(NamedTuple):
    """The constants that parameters have where a recursion is entered; None for those that may have something else."""

    seed: float
    values: dict[str, tuple[float, ...] | None]

    def of(self, name: str) -> tuple[float, ...] | None:
        return self.values.get(name)


def starts_of(
    writes: dict[str, list[tuple[int, float | None]]], name: str, inside: frozenset[int]
) -> tuple[float, ...] | None:
    """What operators assign to a parameter (view.View.writes), but for those ``inside`` (by their ids); None unless it is all
    constant."""
    values = [value for operator, value in writes.get(name, ()) if operator not in inside]
    return tuple(values) if values and None not in values else None  # type: ignore[arg-type]


def cyclic(edges: list[Back]) -> list[Back]:
    """The edges that lie on a cycle of ``edges``."""
    targets: dict[str, set[str]] = {}
    for symbol, way in edges:
        targets.setdefault(symbol.name, set()).add(_target(way))
    for name in {name for names in targets.values() for name in names}:
        targets.setdefault(name, set())
    owner = {name: component for component in components(targets) for name in component}
    return [(symbol, way) for symbol, way in edges if _target(way) in owner[symbol.name]]


def _target(way: Way) -> str:
    assert isinstance(way.leaf, Enter)
    return way.leaf.symbol
