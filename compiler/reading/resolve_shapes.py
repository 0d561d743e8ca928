"""POV-Ray's shapes as transformed unit shapes.

The arguments of a ``sphere { … }`` block and its kin → an operand: a unit shape in a constant Transform.

Example: ``sphere { <1, 2, 3>, 4 }`` is the unit sphere in ``trans 1 2 3; scale 4``.
"""

from __future__ import annotations

from typing import Callable

from . import affine
from .affine import Vector
from .model import Constant, Operand, Prefixed, Primitive, Step, Transform
from .problems import Problem
from .resolve_items import Items
from .source import Span


def shape(items: Items, name: str) -> Operand:
    """The operand of the block ``name``, whose arguments come next in ``items``. Raises Problem."""
    return _SHAPES[name](items, items.span)


def placed(primitive: str, arguments: tuple[float, ...], matrix: affine.Matrix, span: Span) -> Operand:
    """A unit shape under a map."""
    numbers = tuple(Constant(value) for column in affine.columns(matrix) for value in column)
    leaf = Primitive(primitive, tuple(map(Constant, arguments)), span)
    return Prefixed(Transform("", (Step("matrix", numbers, span),), span), leaf, span)


def stepped(
    primitive: str, arguments: tuple[float, ...], steps: list[tuple[str, tuple]], span: Span
) -> Operand:
    """A unit shape in named steps, which read better than a matrix; those that do nothing are left out."""
    made = tuple(
        Step(name, tuple(map(Constant, values)), span)
        for name, values in steps
        if any(value != (1.0 if name.startswith("scale") else 0.0) for value in values)
    )
    leaf = Primitive(primitive, tuple(map(Constant, arguments)), span)
    return Prefixed(Transform("", made, span), leaf, span) if made else leaf


def _positive(items: Items, what: str) -> float:
    value = items.constant(what)
    if value <= 0:
        raise Problem("degenerate", items.items[items.at - 1].span, f"{what} must be above 0, not {value:g}")
    return value


def _sphere(items: Items, span: Span) -> Operand:
    centre, radius = items.vector("the sphere's centre"), _positive(items, "the sphere's radius")
    return stepped("sphere", (), [("trans", centre), ("scale_uniform", (radius,))], span)


def _box(items: Items, span: Span) -> Operand:
    a, b = items.vector("the box's corner"), items.vector("the box's second corner")
    low, high = tuple(map(min, a, b)), tuple(map(max, a, b))
    sizes = affine.difference(high, low)
    if 0.0 in sizes:
        raise Problem("degenerate", span, "this box is flat", "its corners must differ on every axis")
    return stepped("box", (), [("trans", low), ("scale", sizes)], span)


def _along(start: Vector, end: Vector, radius: float) -> affine.Matrix:
    """The unit cylinder's z from ``start`` to ``end``, its radius ``radius``."""
    axis = affine.difference(end, start)
    x, y = affine.perpendiculars(axis)
    return affine.from_columns(affine.scaled(x, radius), affine.scaled(y, radius), axis, start)


def _ends(start: Vector, end: Vector, what: str, span: Span) -> None:
    if start == end:
        raise Problem("degenerate", span, f"this {what} has no length", "its two points are the same")


def _cylinder(items: Items, span: Span) -> Operand:
    start, end = items.vector("the cylinder's base point"), items.vector("the cylinder's cap point")
    radius = _positive(items, "the cylinder's radius")
    _ends(start, end, "cylinder", span)
    return placed("cylinder", (), _along(start, end, radius), span)


def _cone(items: Items, span: Span) -> Operand:
    start, start_radius = items.vector("the cone's base point"), items.constant("the cone's base radius")
    end, end_radius = items.vector("the cone's cap point"), items.constant("the cone's cap radius")
    _ends(start, end, "cone", span)
    if min(start_radius, end_radius) < 0 or max(start_radius, end_radius) == 0:
        message = f"a cone's radii can't be negative or both 0, these are {start_radius:g} and {end_radius:g}"
        raise Problem("degenerate", span, message)
    if start_radius == end_radius:
        return placed("cylinder", (), _along(start, end, start_radius), span)
    if start_radius < end_radius:
        start, start_radius, end, end_radius = end, end_radius, start, start_radius
    return placed("cone", (end_radius / start_radius,), _along(start, end, start_radius), span)


def _plane(items: Items, span: Span) -> Operand:
    normal, distance = items.vector("the plane's normal"), items.constant("the plane's distance")
    size = affine.length(normal)
    if size == 0:
        raise Problem("degenerate", span, "this plane's normal is zero")
    unit = affine.scaled(normal, 1 / size)
    x, y = affine.perpendiculars(unit)
    return placed("plane", (), affine.from_columns(x, y, unit, affine.scaled(unit, distance)), span)


def _torus(items: Items, span: Span) -> Operand:
    major, minor = _positive(items, "the torus's major radius"), _positive(items, "the torus's minor radius")
    return stepped("torus", (minor / major,), [("rotx", (90.0,)), ("scale_uniform", (major,))], span)


def corners(items: Items, smooth: bool) -> list[Vector]:
    """The three points of a triangle, each with its normal after it when ``smooth``. Raises Problem when the
    triangle has no area or a normal no length."""
    found = []
    for i in range(3):
        found.append(items.vector(f"the triangle's point {i + 1}"))
        if smooth:
            normal = items.vector(f"the triangle's normal {i + 1}")
            if not any(normal):
                raise Problem("degenerate", items.items[items.at - 1].span, "this normal is zero")
            found.append(normal)
    a, b, c = found[:: 2 if smooth else 1]
    if not any(affine.cross(affine.difference(b, a), affine.difference(c, a))):
        raise Problem("degenerate", items.span, "this triangle has no area", "its points lie on one line")
    return found


def _triangle(items: Items, span: Span) -> Operand:
    a, b, c = corners(items, smooth=False)
    u, v = affine.difference(b, a), affine.difference(c, a)
    # The third column may be anything across the triangle; of the triangle's own size it keeps the matrix tame.
    across = affine.cross(u, v)
    across = affine.scaled(across, max(affine.length(u), affine.length(v)) / affine.length(across))
    return placed("triangle", (), affine.from_columns(u, v, across, a), span)


def _disc(items: Items, span: Span) -> Operand:
    centre, normal = items.vector("the disc's centre"), items.vector("the disc's normal")
    radius = _positive(items, "the disc's radius")
    size = affine.length(normal)
    if size == 0:
        raise Problem("degenerate", span, "this disc's normal is zero")
    if items.starts_colour():
        raise Problem(
            "unsupported",
            items.peek().span,
            "a disc with a hole isn't supported",
            "leave the fourth argument out",
        )
    return placed(
        "disc",
        (),
        _along(centre, tuple(map(sum, zip(centre, affine.scaled(normal, radius / size)))), radius),
        span,
    )


_SHAPES: dict[str, Callable[[Items, Span], Operand]] = {
    "sphere": _sphere, "box": _box, "cylinder": _cylinder, "cone": _cone, "plane": _plane, "torus": _torus,
    "triangle": _triangle, "disc": _disc,
}  # fmt: skip
