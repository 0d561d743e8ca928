"""Recursions without end: legal iff every way round makes things smaller.

Then the detail cut-off ends them (runtime/cut.h). On the graph of symbols the transformations of every simple cycle are
multiplied; a spectral radius of 1 or more is an error. Ways whose guards aren't decided, and transformations that
depend on parameters, aren't judged here: what the derivation makes of them is seen by the forecast, and the runtime proves its
boxes before it draws.

Example: ``Selection A { A -> box + [ trans 0 0 1 ] A; }`` is an error; with ``[ trans 0 0 1; scale 0.9 ]`` it isn't.
"""

from __future__ import annotations

from . import affine
from .check_scaling import linear_map
from .model import Enter, Symbol
from .walk import Way, decided, is_open, ways

MOST_CYCLES = 1000
MOST_STEPS = 20_000
CONTRACTING = 1 - 1e-9

Linear = tuple[float, ...]


def stays_large(members: list[Symbol], seed: float) -> bool:
    """Whether a way round through symbols that never end provably doesn't contract."""
    names = {symbol.name: number for number, symbol in enumerate(members)}
    leaving: list[set[tuple[int, Linear]]] = [set() for _ in members]
    for symbol in members:
        for way in ways(symbol.production):
            if not (isinstance(way.leaf, Enter) and way.leaf.symbol in names and is_open(way, seed)):
                continue
            matrix = _linear(way, seed)
            if matrix is not None and all(decided(test, seed) is not None for test, _ in way.guards):
                leaving[names[symbol.name]].add((names[way.leaf.symbol], matrix))
    return any(affine.spectral_radius(matrix) >= CONTRACTING for matrix in _cycles(leaving))


def _cycles(leaving: list[set[tuple[int, Linear]]]) -> list[Linear]:
    """The distinct products along simple cycles, as many as there is time for."""
    found: set[Linear] = set()
    steps = 0
    for start in range(len(leaving)):
        stack = [(start, affine.IDENTITY, frozenset((start,)))]
        seen = set(stack)
        while stack and len(found) < MOST_CYCLES and steps < MOST_STEPS:
            at, product, passed = stack.pop()
            for following, matrix in leaving[at]:
                steps += 1
                longer = affine.compose(product, matrix)
                entry = (following, longer, passed | {following})
                if following == start:
                    found.add(longer)
                elif following > start and following not in passed and entry not in seen:
                    seen.add(entry)
                    stack.append(entry)
    return list(found)


def _linear(way: Way, seed: float) -> Linear | None:
    """The way's transformations without their translations; None where they aren't constant."""
    matrix = linear_map(way.operators, seed)
    return matrix and tuple(0.0 if i % 4 == 3 else value for i, value in enumerate(matrix))
