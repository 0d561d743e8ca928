"""Recursions without a bound: does each round make things smaller?

Where nothing limits the number of rounds (a draw ends them, or a guard that nothing moves), what grows from round to round
soon fills all space, and what hardly shrinks goes on for thousands of rounds. The measure is the spectral radius of the
product of a way's transformations, by which many rounds stretch on average (DESIGN: the language).

Example: ``Selection A { if (rand(0) < 0.9) A -> box + [ scale 1.2 ] A; }`` makes things ×1.2 larger with every round.
"""

from __future__ import annotations

from typing import Sequence

from . import affine
from .diagnostics import Diagnostics
from .evaluate import NotFinite, fold
from .model import Constant, Enter, Operator, Step, Symbol, Transform
from .walk import Way

GROWING = 1 + 1e-9
SLOW = 0.99

Back = tuple[Symbol, Way]


def check_scaling(back: Sequence[Back], seed: float, diagnostics: Diagnostics) -> None:
    """Report on the first way round that grows or hardly shrinks; ways through several symbols aren't judged."""
    for symbol, way in back:
        if not isinstance(way.leaf, Enter) or way.leaf.symbol != symbol.name:
            continue
        matrix = linear_map(way.operators, seed)
        if matrix is None:
            continue
        factor = affine.spectral_radius(matrix)
        span = way.leaf.span or symbol.name_span
        if factor > GROWING:
            message = f"each round of '{symbol.name}' makes things ×{factor:.4g} larger, and nothing limits the rounds"
            hint = "make them smaller, scale 0.9, or count the rounds down"
            diagnostics.add("diverging", span, message, hint)
            return
        if SLOW <= factor < 1 - 1e-9:
            message = f"each round of '{symbol.name}' shrinks things by ×{factor:.4g} only, and nothing limits the rounds"
            hint = "thousands of rounds pass before they are too small to be seen: a counter would end them"
            diagnostics.add("slow-contraction", span, message, hint)
            return


def linear_map(operators: Sequence[Operator], seed: float) -> affine.Matrix | None:
    """The matrix of all transformations on a way; None where it isn't constant."""
    matrix = affine.IDENTITY
    for operator in operators:
        if not isinstance(operator, Transform):
            continue
        for step in operator.steps:
            try:
                values = tuple(fold(argument, seed) for argument in step.arguments)
            except NotFinite:
                return None
            numbers = [value.value for value in values if isinstance(value, Constant)]
            if len(numbers) < len(values) or (step.operation == "rot" and not any(numbers[1:])):
                return None
            matrix = affine.compose(matrix, affine.of_step(Step(step.operation, values)))
    return matrix
