"""Does a recursion without end shrink what it makes? Then it is legal: the detail cut-off ends it.

``contracts(component, derivation)`` looks at states that enter each other for ever, and at the linear parts of the
transformations between them. First the largest stretch of each transformation: if no cycle multiplies to 1 or
more, every walk contracts. Otherwise the spectral radius of each cycle found must be below 1 (DESIGN: the
language), which is what the largest stretch overestimates for sheared or unevenly scaled maps.
"""

from __future__ import annotations

import math

from ..reading.affine import spectral_radius
from .matrices import Matrix, multiply
from .states import Derivation, State

Edge = tuple[int, int, Matrix]
MAX_CYCLES = 1000


def contracts(component: list[State], derivation: Derivation) -> bool:
    numbers = {state: k for k, state in enumerate(component)}
    edges: list[Edge] = [
        (numbers[state], numbers[entered], matrix)
        for state in component
        for entered, matrix in derivation.matrices(state)
        if entered in numbers
    ]
    if not _has_growing_cycle(len(component), [(a, b, math.log(stretch(m) or 1e-300)) for a, b, m in edges]):
        return True
    return all(spectral_radius(matrix) < 1 - 1e-12 for matrix in _cycles(len(component), edges))


def stretch(m: Matrix) -> float:
    """A bound of the largest singular value of the linear part: the square root of the largest of MᵀM's row sums."""
    columns = [(m[c], m[4 + c], m[8 + c]) for c in range(3)]
    rows = (sum(abs(sum(a * b for a, b in zip(u, v))) for v in columns) for u in columns)
    return math.sqrt(max(rows))


def _has_growing_cycle(count: int, edges: list[tuple[int, int, float]]) -> bool:
    """Whether a cycle's logarithms sum to 0 or more: Bellman and Ford's relaxation, longest paths."""
    longest = [0.0] * count
    for _ in range(count + 1):
        changed = False
        for a, b, weight in edges:
            longer = (
                longest[a] + weight + 1e-12
            )  # a little more, so that a cycle of exactly 1 counts as growing
            if longer > longest[b]:
                longest[b], changed = longer, True
        if not changed:
            return False
    return True


def _cycles(count: int, edges: list[Edge]) -> list[Matrix]:
    """The products along simple cycles, at most MAX_CYCLES of them."""
    leaving: list[list[tuple[int, Matrix]]] = [[] for _ in range(count)]
    for a, b, matrix in edges:
        leaving[a].append((b, matrix))
    found: list[Matrix] = []
    for start in range(count):
        stack: list[tuple[int, Matrix | None, frozenset[int]]] = [(start, None, frozenset())]
        while stack and len(found) < MAX_CYCLES:
            state, product, passed = stack.pop()
            for following, matrix in leaving[state]:
                longer = multiply(product, matrix) if product else matrix
                if following == start:
                    found.append(longer)
                elif following > start and following not in passed:
                    stack.append((following, longer, passed | {following}))
    return found
