"""A camera that stands inside of something.

Shapes that objects place directly, or through Selections whose transformations are constant, are tried: if the camera is
inside one and no light is, the picture is dark. (Around a room or a sky there are lights inside too.)

Example: ``camera { location <0, 0, 0.5> … } sphere { 0, 1 } light_source { <5, 5, 5> … }``.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Iterator, NamedTuple

from . import affine
from .check_scaling import linear_map
from .diagnostics import Diagnostics
from .evaluate import NotFinite, fold
from .model import Constant, Enter, Expression, Primitive, Production
from .view import View
from .walk import is_open, ways

# Places that are tried, and how many Selections deep.
MAX_PLACES = 2000
MAX_DEPTH = 8


class Placed(NamedTuple):
    """What a production surely leads to, with the matrix on the way there; ``tried`` is the number of its ways."""

    tried: int
    leaves: tuple[tuple[Primitive | Enter, affine.Matrix], ...]


def check_camera(view: View, diagnostics: Diagnostics) -> None:
    """Report the first shape that holds the camera and no light."""
    model = view.model
    if model.camera is None:
        return
    camera = dict(model.camera.values).get("location", (0.0, 0.0, 0.0))
    span = model.camera.span
    lights = [dict(light.values).get("location", (0.0, 0.0, 0.0)) for light in model.lights]
    if span is None or not lights:
        return
    for shape, matrix in _shapes(view):
        inverse = affine.inverse(matrix)
        if inverse is None or not _is_inside(shape, affine.transform_point(inverse, camera), view.seed):
            continue
        if not any(
            _is_inside(shape, affine.transform_point(inverse, light), view.seed) for light in lights
        ):
            message = f"the camera stands inside a {shape.shape}, where no light is"
            hint = "move its location, or put a light inside, as in a room"
            if shape.shape == "plane":
                message = "the camera stands behind a plane, where no light is"
                hint = "the plane's normal points away from it: move its location, or turn the normal round"
            diagnostics.add("camera-inside", span, message, hint)
            return


def _shapes(view: View) -> Iterator[tuple[Primitive, affine.Matrix]]:
    """Primitives whose place is constant, with the matrices of their places, in the order of a breadth-first derivation."""
    symbols, tried = view.model.symbols, 0
    waiting = deque((placed.body, affine.IDENTITY, 0) for placed in view.model.objects)
    while waiting and tried < MAX_PLACES:
        body, outer, depth = waiting.popleft()
        placed = view.ask(placed_by, body, given=(view.seed,))
        tried += placed.tried
        for leaf, inner in placed.leaves:
            matrix = inner if outer is affine.IDENTITY else affine.compose(outer, inner)
            if isinstance(leaf, Primitive):
                yield leaf, matrix
            elif leaf.symbol in symbols and depth < MAX_DEPTH:
                waiting.append((symbols[leaf.symbol].production, matrix, depth + 1))


def placed_by(production: Production, seed: float) -> Placed:
    several, leaves = list(ways(production)), []
    for way in several:
        # What stands under an undecided guard may not be there at all.
        if any(_value(test, seed) is None for test, _ in way.guards) or way.weights or not is_open(way, seed):
            continue
        inner = linear_map(way.operators, seed)
        if inner is not None and isinstance(way.leaf, Primitive | Enter):
            leaves.append((way.leaf, inner))
    return Placed(len(several), tuple(leaves))


def _value(expression: Expression, seed: float) -> float | None:
    try:
        value = fold(expression, seed)
    except NotFinite:
        return None
    return value.value if isinstance(value, Constant) else None


def _is_inside(shape: Primitive, point: affine.Vector, seed: float) -> bool:
    """Whether ``point`` lies in the unit shape."""
    x, y, z = point
    arguments = [_value(argument, seed) for argument in shape.arguments]
    if None in arguments:
        return False
    if shape.shape == "sphere":
        return x * x + y * y + z * z < 1
    if shape.shape == "cylinder":
        return x * x + y * y < 1 and 0 < z < 1
    if shape.shape == "cone":
        radius = 1 + ((arguments[0] if arguments else 0.0) - 1) * z
        return 0 < z < 1 and math.hypot(x, y) < radius
    if shape.shape == "box":
        return 0 < x < 1 and 0 < y < 1 and 0 < z < 1
    if shape.shape == "plane":
        return z < 0
    if shape.shape == "torus":
        return (math.hypot(x, y) - 1) ** 2 + z * z < arguments[0] ** 2
    return False
