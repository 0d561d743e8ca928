"""Camera, lights, background and settings → records.

Example: ``camera { location <0, 0, -5> angle 40 }`` is
``Record('camera', (('location', (0, 0, -5)), ('angle', (40,))))``.
"""

from __future__ import annotations

from typing import Sequence

from . import affine, syntax
from .diagnostics import Note
from .model import Constant, Record
from .problems import Problem
from .resolve_expressions import BLOCKS, Expressions
from .resolve_items import Items
from .resolve_names import Names
from .resolve_textures import TRANSFORMATIONS, Textures
from .source import Span
from .vocabulary import PROPERTIES, Row

Values = dict[str, tuple[float, ...]]

# POV-Ray turns the camera when it meets look_at: what comes later isn't turned with it.
BEFORE_LOOK_AT = ("location", "sky", "direction", "right", "up")


class Blocks:
    def __init__(self, names: Names, expressions: Expressions, textures: Textures) -> None:
        self.names, self.expressions, self.textures = names, expressions, textures

    def _items(self, block: syntax.Block) -> Items:
        name = "the camera" if block.name.name == "camera" else f"'{block.name.name}'"
        return Items(name, block.span, block.items, self.expressions, BLOCKS)

    def _property(self, row: Row, items: Items) -> tuple[float, ...]:
        """The value of the property whose name has been taken."""
        if row.type == "flag":
            return (1.0,)
        what = f"'{row.name}'"
        if row.type == "vector":
            return items.vector(what)
        if row.type == "colour":
            return rgb(items, what)
        return (items.constant(what, row),)

    def _report(self, items: Items, problem: Problem) -> None:
        problem.report(self.names.diagnostics)
        items.skip_value()

    # --- settings

    def global_settings(self, block: syntax.Block, values: Values) -> None:
        """Add the block's settings to ``values`` (POV-Ray merges several blocks)."""
        items, rows = self._items(block), PROPERTIES["global_settings"]
        while items:
            try:
                row = rows.get(items.plain_word())
                if row is None:
                    raise items.misfit(list(rows))
                items.take()
                if row.name == "assumed_gamma":
                    self._gamma(items)
                else:
                    values[row.name] = self._property(row, items)
            except Problem as problem:
                self._report(items, problem)

    def _gamma(self, items: Items) -> None:
        value = items.constant("assumed_gamma")
        if value != 1:
            message = f"assumed_gamma must be 1.0, not {value:g}"
            hint = "light is computed linearly; output files get their own encoding"
            raise Problem("unsupported", items.items[items.at - 1].span, message, hint)

    def background(self, block: syntax.Block, values: Values) -> None:
        items = self._items(block)
        values["background"] = rgb(items, "the background")
        if items:
            raise items.misfit(list(PROPERTIES["background"]))

    # --- camera

    def camera(self, block: syntax.Block) -> Record:
        items, rows = self._items(block), PROPERTIES["camera"]
        values: Values = {}
        look_at: Span | None = None
        while items:
            try:
                word = items.word()
                if word in TRANSFORMATIONS:
                    span = items.take().span
                    raise Problem(
                        "unsupported", span, "the camera can't be transformed", "set location and look_at"
                    )
                row = rows.get(items.plain_word())
                if row is None:
                    raise items.misfit(list(rows))
                name = items.take()
                if look_at is not None and word in BEFORE_LOOK_AT:
                    message = f"'{word}' after look_at: in POV-Ray this would change the picture"
                    note = Note(look_at, "look_at turns the camera here")
                    self.names.diagnostics.add(
                        "wrong-order", name.span, message, f"write '{word}' before look_at", (note,)
                    )
                if word == "perspective":
                    continue
                values[word] = self._property(row, items)
                if word == "look_at":
                    look_at = name.span
                    values["has_look_at"] = (1.0,)
            except Problem as problem:
                self._report(items, problem)
        self._check_camera(block, values)
        return Record("camera", tuple(values.items()), block.span)

    def _check_camera(self, block: syntax.Block, values: Values) -> None:
        def degenerate(message: str, hint: str = "") -> None:
            self.names.diagnostics.add("degenerate", block.name.span, message, hint)

        for name in ("sky", "direction", "right", "up"):
            if name in values and not any(values[name]):
                degenerate(f"the camera's '{name}' is zero")
                return
        if "look_at" in values:
            view = affine.difference(values["look_at"], values.get("location", (0.0,) * 3))
            if not any(view):
                degenerate("the camera looks at its own location", "move location or look_at")
            elif affine.length(
                affine.cross(view, values.get("sky", (0.0, 1.0, 0.0)))
            ) <= 1e-12 * affine.length(view):
                degenerate(
                    "the camera looks straight along 'sky'",
                    "set sky to another direction, such as sky <0, 1, 0>",
                )

    # --- lights

    def light(self, block: syntax.Block) -> Record:
        items, rows = self._items(block), PROPERTIES["light_source"]
        values: Values = {"location": items.vector("the light's location")}
        while items:
            word = items.word()
            row = rows.get(items.plain_word())
            if word in TRANSFORMATIONS:
                matrix = self.textures.moved(items)
                values["location"] = affine.transform_point(matrix, values["location"])
                # The point that the light aims at moves too, the default one as well.
                aim = values.get("point_at", tuple(row_default(rows["point_at"])))
                values["point_at"] = affine.transform_point(matrix, aim)
            elif row is not None and word != "color":
                items.take()
                values[word] = self._property(row, items)
                if word in ("spotlight", "shadowless"):  # as in POV-Ray, the last of the two counts
                    values.pop("shadowless" if word == "spotlight" else "spotlight", None)
            elif items.starts_colour():
                values["color"] = rgb(items, "the light's colour")
            else:
                raise items.misfit([*rows, *TRANSFORMATIONS])
        aimed = "spotlight" in values or "parallel" in values
        if not aimed:
            values.pop("point_at", None)
        elif values["location"] == values.get("point_at", tuple(row_default(rows["point_at"]))):
            raise Problem(
                "degenerate",
                block.name.span,
                "this light points at its own location",
                "set point_at elsewhere",
            )
        return Record("light", tuple(values.items()), block.span)


def row_default(row: Row) -> Sequence[float]:
    assert isinstance(row.default, list)
    return [float(value) for value in row.default]


def rgb(items: Items, what: str) -> tuple[float, ...]:
    """A constant colour's red, green and blue."""
    value = items.colour(what)
    if not all(isinstance(part, Constant) for part in value.parts):
        raise Problem("wrong-kind", value.span, f"{what} must be constant")
    return value.numbers()[:3]
