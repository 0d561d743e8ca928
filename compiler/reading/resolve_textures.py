"""Textures: pigment, finish and their transformations → the texture record.

texture, pigment and finish blocks → :class:`Look` → model.TextureValue. The same code reads scene blocks, where
all is constant, and ``Texture Name { … }`` operators, whose colours and finishes may read parameters.

Example: ``texture { pigment { checker White, Black scale 2 } finish { phong 0.5 } }`` becomes the values pattern 1,
matrix diag(2, 2, 2), phong 0.5 and two entries.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import Sequence

from . import affine, syntax, vocabulary
from .diagnostics import nearest
from .model import Apply, Constant, Expression, Paint, Read, Step, TextureValue
from .problems import Problem
from .records import record
from .resolve_expressions import BLOCKS, TEXTURES, Expressions, Scope, Value
from .resolve_items import Items, check_range
from .resolve_names import Entry, Names
from .source import Span
from .vocabulary import MODIFIERS, PROPERTIES

PATTERNS = {"solid": 0, "checker": 1, "gradient": 2}  # ids of runtime/bytecode.toml's patterns
TRANSFORMATIONS = vocabulary.BLOCKS["pigment"].modifiers

ColourEntry = tuple[Expression, ...]  # position, red, green, blue, filter, transmit


def entry_of(position: float, parts: Sequence[Expression]) -> ColourEntry:
    return (Constant(float(position)), *parts)


def constant_entry(position: float, red: float, green: float, blue: float) -> ColourEntry:
    return tuple(Constant(float(value)) for value in (position, red, green, blue, 0, 0))


# POV-Ray 3.7's defaults: black without a pigment, blue and green checkers, a gradient of greys.
BLACK = (constant_entry(0, 0, 0, 0),)
CHECKERS = (constant_entry(0, 0, 0, 1), constant_entry(0, 0, 1, 0))
GREYS = (constant_entry(0, 0, 0, 0), constant_entry(1, 1, 1, 1))


@record
class Pigment:
    pattern: str = "solid"
    direction: tuple[float, ...] = (1.0, 0.0, 0.0)
    entries: tuple[ColourEntry, ...] = BLACK
    matrix: affine.Matrix = affine.IDENTITY  # pattern space → the texture's frame

    def moved(self, matrix: affine.Matrix) -> Pigment:
        return replace(self, matrix=affine.compose(matrix, self.matrix))


@record
class Look:
    """A texture; ``finish`` has what is set, by name of the texture record."""

    pigment: Pigment = Pigment()
    finish: dict[str, tuple[Expression, ...]] = field(default_factory=dict)

    def record(self) -> TextureValue:
        values: list[tuple[str, tuple[Expression, ...]]] = []
        pigment = self.pigment
        if pigment.pattern != "solid":
            values.append(("pattern", (Constant(float(PATTERNS[pigment.pattern])),)))
            if pigment.pattern == "gradient":
                values.append(("direction", tuple(map(Constant, pigment.direction))))
            if pigment.matrix != affine.IDENTITY:
                values.append(("matrix", tuple(map(Constant, pigment.matrix))))
        values += sorted(self.finish.items())
        return TextureValue(tuple(values), pigment.entries)

    @property
    def is_constant(self) -> bool:
        parts = [part for entry in self.pigment.entries for part in entry]
        parts += [part for value in self.finish.values() for part in value]
        return not any(isinstance(part, Read | Apply) for part in parts)


class Textures:
    def __init__(self, names: Names, expressions: Expressions) -> None:
        self.names, self.expressions = names, expressions

    def items(self, block: syntax.Block, scope: Scope) -> Items:
        return Items(f"'{block.name.name}'", block.span, block.items, self.expressions, scope)

    # --- named ones

    def paint(self, entry: Entry, span: Span) -> Paint:
        """The operator that the texture ``entry`` is in a production. Raises Problem."""
        return Paint(entry.definition.name, self.declared(entry, span).record(), span)

    def declared(self, entry: Entry, span: Span):
        """The Look, Pigment, finish or colour map that ``entry`` declares, made once. Raises Problem."""
        node: syntax.Texture | syntax.Declare = entry.node  # type: ignore[assignment]
        make = lambda: self.names.known(node, lambda: self._declared(entry))  # noqa: E731
        return entry.once(make, span, f"'{entry.definition.name}' is declared through itself")

    def _declared(self, entry: Entry):
        node = entry.node
        if isinstance(node, syntax.Texture):
            return self.texture(node.block, TEXTURES)
        assert isinstance(node, syntax.Declare)
        block = node.items[0]
        assert isinstance(block, syntax.Block)
        if len(node.items) > 1:
            raise Problem(
                "wrong-value", node.items[1].span, f"#declare {node.name.name} has more than one value"
            )
        read = {
            "texture": self.texture,
            "pigment": self.pigment,
            "finish": self.finish,
            "color_map": self.color_map,
        }
        return read[entry.kind](block, BLOCKS)

    def _named(self, items: Items, kind: str):
        """The declared thing that a block starts with, as in ``texture { Bark … }``, or None."""
        entry = self.names.entries.get(items.plain_word())
        if entry is None or entry.kind != kind:
            return None
        name = items.take()
        assert isinstance(name, syntax.Name)
        self.names.find(name, (kind,), f"a {kind}")
        value = self.declared(entry, name.span)
        if isinstance(value, Look) and not items.scope.reads and not value.is_constant:
            hint = f"use '{name.name}' as an operator in a production, or declare a constant texture"
            raise Problem(
                "wrong-kind",
                name.span,
                f"the Texture '{name.name}' reads parameters, which have no value here",
                hint,
            )
        return value

    # --- blocks

    def texture(self, block: syntax.Block, scope: Scope) -> Look:
        items = self.items(block, scope)
        look: Look = self._named(items, "texture") or Look()
        moved = False
        while items:
            word = items.word()
            if word == "pigment" and isinstance(items.peek(), syntax.Block):
                if moved:
                    hint = "write the pigment first: what stands before it isn't moved in POV-Ray"
                    raise Problem(
                        "wrong-order",
                        items.peek().span,
                        "a pigment after the texture's transformations",
                        hint,
                    )
                look = replace(look, pigment=self.pigment(items.take(), scope, look.pigment))
            elif word == "finish" and isinstance(items.peek(), syntax.Block):
                look = replace(look, finish=self.finish(items.take(), scope, look.finish))
            elif word in TRANSFORMATIONS:
                look = replace(look, pigment=look.pigment.moved(self.moved(items)))
                moved = True
            else:
                raise self._misfit(items, "texture", ["pigment", "finish", *TRANSFORMATIONS])
        return look

    def pigment(self, block: syntax.Block, scope: Scope, base: Pigment | None = None) -> Pigment:
        """A pigment block; ``base`` is what the texture has already and the block changes."""
        items = self.items(block, scope)
        pigment: Pigment = self._named(items, "pigment") or base or Pigment()
        while items:
            word, is_block = items.word(), isinstance(items.peek(), syntax.Block)
            if word == "checker" and not is_block:
                items.take()
                pigment = replace(pigment, pattern="checker", entries=self._checkers(items))
            elif word == "gradient" and not is_block:
                items.take()
                span = items.peek().span if items else block.span
                direction = items.vector("the gradient's direction")
                if not any(direction):
                    raise Problem("degenerate", span, "the gradient's direction is zero")
                entries = (
                    pigment.entries if len(pigment.entries) > 1 and pigment.pattern != "checker" else GREYS
                )
                pigment = replace(pigment, pattern="gradient", direction=direction, entries=entries)
            elif word in ("color_map", "colour_map") and is_block:
                pigment = replace(pigment, entries=self.color_map(items.take(), scope))
                if pigment.pattern == "checker":
                    raise Problem("wrong-value", block.span, "a checker takes two colours, not a color_map")
            elif word in TRANSFORMATIONS:
                pigment = pigment.moved(self.moved(items))
            elif items.starts_colour():
                pigment = replace(pigment, pattern="solid", entries=(entry_of(0, items.colour().parts),))
            else:
                raise self._misfit(items, "pigment", [*PROPERTIES["pigment"], *TRANSFORMATIONS])
        if pigment.pattern == "solid" and len(pigment.entries) != 1:
            raise Problem(
                "wrong-value", block.span, "a color_map needs a pattern", "write gradient z before it"
            )
        return pigment

    def _checkers(self, items: Items) -> tuple[ColourEntry, ...]:
        entries = list(CHECKERS)
        for i in range(2):
            if items and items.starts_colour():
                entries[i] = entry_of(0, items.colour().parts)
        return tuple(entries)

    def color_map(self, block: syntax.Block, scope: Scope) -> tuple[ColourEntry, ...]:
        items = self.items(block, scope)
        if (named := self._named(items, "color_map")) is not None:
            if items:
                raise items.misfit(())
            return named
        entries: list[ColourEntry] = []
        last = 0.0
        while items:
            item = items.take()
            if not isinstance(item, syntax.MapEntry):
                raise Problem(
                    "wrong-value",
                    item.span,
                    "a color_map holds entries",
                    "write [0 color Red] [1 color Blue]",
                )
            inner = Items("an entry", item.span, item.items, self.expressions, scope)
            position = inner.constant("an entry's position")
            if not last <= position <= 1:
                message = f"positions of a color_map rise from 0 to 1; {position:g} follows {last:g}"
                raise Problem("wrong-value", item.span, message)
            last = position
            entries.append(entry_of(position, inner.colour().parts))
            if inner:
                raise inner.misfit(())
        if not entries:
            raise Problem(
                "wrong-value", block.span, "this color_map is empty", "write [0 color Red] [1 color Blue]"
            )
        return tuple(entries)

    def finish(
        self, block: syntax.Block, scope: Scope, base: dict | None = None
    ) -> dict[str, tuple[Expression, ...]]:
        items = self.items(block, scope)
        values = dict(self._named(items, "finish") or base or {})
        rows = PROPERTIES["finish"]
        while items:
            word = items.word()
            row = rows.get(word)
            if row is None or (isinstance(items.peek(), syntax.Block) and word != "reflection"):
                raise self._misfit(items, "finish", list(rows))
            item = items.take()
            if row.type == "colour":
                if word == "reflection" and isinstance(item, syntax.Block):
                    inner = self.items(item, scope)
                    value: Value = inner.colour("the reflection")
                    if inner:
                        raise inner.misfit(())
                else:
                    value = items.colour(f"'{word}'")
                values[word] = value.parts[:3]
            else:
                number = items.number(f"'{word}'")
                if isinstance(number, Constant):
                    check_range(row, number.value, items.items[items.at - 1].span)
                values[word] = (number,)
        return values

    def _misfit(self, items: Items, kind: str, rows: list[str]) -> Problem:
        """The next item fits nothing in a block of this ``kind``: perhaps a name that isn't defined."""
        item = items.peek()
        if (
            not isinstance(item, syntax.Name)
            or items.at > 0
            or item.name in MODIFIERS
            or vocabulary.kind_of(item.name)
            or items.home_of(item.name)
            or isinstance(items.peek(1), syntax.Number | syntax.Vector)
        ):
            return items.misfit(rows)
        try:
            self.names.find(item, (kind,), f"a {kind}")
        except Problem as problem:
            if problem.code == "unknown-name":
                problem.hint = nearest(item.name, rows) or problem.hint
            return problem
        return items.misfit(rows)

    # --- transformations

    def steps(self, items: Items) -> tuple[Step, ...]:
        """The steps of the modifier that comes next (translate, rotate, scale or matrix). Raises Problem."""
        item = items.take()
        word = item.name.name if isinstance(item, syntax.Block | syntax.Call) else item.name  # type: ignore
        if isinstance(item, syntax.Block | syntax.Call):
            raise Problem(
                "wrong-arguments", item.span, f"'{word}' takes a vector", f"write {MODIFIERS[word].signature}"
            )
        begin = items.at
        plain = items.peek()
        if word == "matrix":
            values = items.vector("a matrix", 12)
            step = Step("matrix", tuple(map(Constant, values)), item.span)
            if affine.determinant(affine.of_step(step)) == 0:
                raise Problem(
                    "degenerate", plain.span, "this matrix flattens what it acts on", "its determinant is 0"
                )
            return (step,)
        values = items.vector(f"'{word}'")
        span = item.span.to(items.items[begin].span)
        if word == "translate":
            return (Step("trans", tuple(map(Constant, values)), span),)
        if word == "rotate":
            # About x first: the last step acts first.
            written = items.items[begin]
            parts = written.components if isinstance(written, syntax.Vector) and len(written.components) == 3 else [written] * 3
            pairs = [(f"rot{axis}", values[i], parts[i].span) for i, axis in reversed(list(enumerate("xyz")))]
            return tuple(Step(name, (Constant(angle, at),), span) for name, angle, at in pairs if angle != 0)
        if 0.0 in values:
            raise Problem("degenerate", span, "a scale of 0 flattens what it acts on", "leave that axis at 1")
        if values[0] == values[1] == values[2]:
            return (Step("scale_uniform", (Constant(values[0]),), span),)
        return (Step("scale", tuple(map(Constant, values)), span),)

    def moved(self, items: Items) -> affine.Matrix:
        """The matrix of the modifier that comes next."""
        return affine.of_steps(self.steps(items))
