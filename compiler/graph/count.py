"""Counting without unfolding: sums over explored states, exact integers of any size.

Endless is None here: more than any number. Counts by kind are counted kind by kind; kind '' is all kinds together.

Example: in Figure 2.1 every state of the crown has 1 + 2·(primitives of the next) cylinders: 2,047 from order 10.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal, localcontext

from .explore import Exploration
from .states import Formula, State

Count = int | None  # None: endless
MAX_LINEAR_SYSTEM = 80
DIGITS = 30


def count(found: Exploration, kind: str, choose: Callable[[list[Count]], Count]) -> dict[State, Count]:
    """Of each state the primitives of a kind, ``choose`` (least or most) deciding between alternatives."""
    counts: dict[State, Count] = {}
    for i, component in enumerate(found.components):
        if i not in found.cyclic:
            (state,) = component
            counts[state] = evaluate(found.formulas[state], kind, counts, choose)
        else:
            _count_cycle(found, component, kind, counts, choose)
    return counts


def least(counts: list[Count]) -> Count:
    return min((n for n in counts if n is not None), default=None)


def most(counts: list[Count]) -> Count:
    return None if None in counts else max(counts)


def evaluate(formula: Formula, kind: str, counts: dict[State, Count], choose: Callable) -> Count:
    total = sum(formula.own.values()) if not kind else formula.own.get(kind, 0)
    for state, times in formula.enters.items():
        if counts[state] is None:
            return None
        total += times * counts[state]
    for pick in formula.picks:
        picked = choose([evaluate(alternative, kind, counts, choose) for _, alternative in pick])
        if picked is None:
            return None
        total += picked
    return total


def _count_cycle(
    found: Exploration, component: list[State], kind: str, counts: dict[State, Count], choose: Callable
) -> None:
    """States that enter each other. The least: begin endless and go down to what can end. The most: begin with
    nothing and go up; what still grows after as many rounds as there are states grows for ever."""
    downward = choose is least
    counts.update((state, None if downward else 0) for state in component)
    for _ in range(len(component) + 1):
        before = [counts[state] for state in component]
        for state in component:
            counts[state] = evaluate(found.formulas[state], kind, counts, choose)
        if [counts[state] for state in component] == before:
            return
    if not downward:
        counts.update((state, None) for state in component)


def expected(found: Exploration) -> dict[State, Decimal | None]:
    """Of each state the expected number of primitives: by linearity a system of linear equations a component."""
    values: dict[State, Decimal | None] = {}
    with localcontext() as context:
        context.prec = DIGITS
        for i, component in enumerate(found.components):
            rows = {state: _linear(found.formulas[state]) for state in component}
            if i not in found.cyclic:
                (state,) = component
                constant, factors = rows[state]
                values[state] = _weighted(constant, factors, values)
            else:
                values.update(_solve(component, rows, values))
    return values


def _linear(formula: Formula) -> tuple[Decimal, dict[State, Decimal]]:
    """A constant and a factor for each state entered."""
    constant = Decimal(sum(formula.own.values()))
    factors = {state: Decimal(times) for state, times in formula.enters.items()}
    for pick in formula.picks:
        for probability, alternative in pick:
            inner_constant, inner = _linear(alternative)
            share = Decimal(probability)
            constant += share * inner_constant
            for state, factor in inner.items():
                factors[state] = factors.get(state, Decimal(0)) + share * factor
    return constant, factors


def _weighted(constant: Decimal, factors: dict[State, Decimal], values: dict) -> Decimal | None:
    for state, factor in factors.items():
        if values[state] is None:
            return None
        constant += factor * values[state]
    return constant


def _solve(component: list[State], rows: dict, values: dict) -> dict[State, Decimal | None]:
    """x = c + M·x by Gaussian elimination. The expectation is finite iff the solution isn't negative (M's spectral
    radius is below 1 then, M being irreducible and not negative); a system too large to solve counts as endless."""
    endless = dict.fromkeys(component)
    if len(component) > MAX_LINEAR_SYSTEM:
        return endless
    inside = {state: k for k, state in enumerate(component)}
    matrix = []
    for state in component:
        constant, factors = rows[state]
        outside = {s: f for s, f in factors.items() if s not in inside}
        total = _weighted(constant, outside, values)
        if total is None:
            return endless
        row = [Decimal(int(k == inside[state])) for k in range(len(component))] + [total]
        for s, factor in factors.items():
            if s in inside:
                row[inside[s]] -= factor
        matrix.append(row)
    if not any(row[-1] for row in matrix):
        return dict.fromkeys(component, Decimal(0))
    solution = _eliminate(matrix)
    if solution is None or any(x < 0 for x in solution):
        return endless
    return dict(zip(component, solution))


def _eliminate(matrix: list[list[Decimal]]) -> list[Decimal] | None:
    """Gauss–Jordan with partial pivoting; None for a singular matrix."""
    size = len(matrix)
    for column in range(size):
        pivot = max(range(column, size), key=lambda r: abs(matrix[r][column]))
        if abs(matrix[pivot][column]) < Decimal("1e-20"):
            return None
        matrix[column], matrix[pivot] = matrix[pivot], matrix[column]
        for r in range(size):
            if r != column and matrix[r][column]:
                factor = matrix[r][column] / matrix[column][column]
                matrix[r] = [a - factor * b for a, b in zip(matrix[r], matrix[column])]
    return [matrix[k][-1] / matrix[k][k] for k in range(size)]
