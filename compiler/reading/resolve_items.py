"""The items of a scene block, read from left to right.

POV-Ray's blocks are flat: ``location <0, 1, 2> angle 45`` is a name, a vector, a name, a number. An
:class:`Items` cursor takes them apart by what each property wants, as the vocabulary says.

Example::

    items = Items(block, expressions, BLOCKS)
    items.vector("the centre"), items.number("the radius")
    items.colour()                 # color rgb <1, 0, 0> transmit 0.5
"""

from __future__ import annotations

from typing import Sequence

from . import syntax, vocabulary
from .diagnostics import Diagnostics, nearest
from .model import Constant, Expression
from .problems import Problem, unsupported
from .resolve_expressions import Expressions, Scope, Value
from .source import Span
from .vocabulary import Row

RGB_PARTS = {"rgb": (0, 1, 2), "rgbf": (0, 1, 2, 3), "rgbt": (0, 1, 2, 4), "rgbft": (0, 1, 2, 3, 4)}
WORD_PARTS = {"red": 0, "green": 1, "blue": 2, "filter": 3, "transmit": 4}


class Items:
    """A cursor over ``items``; ``end`` is the span to blame for what is missing."""

    def __init__(
        self, what: str, span: Span, items: Sequence[syntax.Item], expressions: Expressions, scope: Scope
    ) -> None:
        self.what, self.span = what, span
        self.items = [part for item in items for part in _spread(item, expressions)]
        self.expressions, self.scope, self.at = expressions, scope, 0

    @property
    def diagnostics(self) -> Diagnostics:
        return self.expressions.names.diagnostics

    def __bool__(self) -> bool:
        return self.at < len(self.items)

    def peek(self, ahead: int = 0) -> syntax.Item | None:
        at = self.at + ahead
        return self.items[at] if at < len(self.items) else None

    def take(self) -> syntax.Item:
        item = self.items[self.at]
        self.at += 1
        return item

    def word(self) -> str:
        """The name that comes next, of a word or of a block, or ''."""
        item = self.peek()
        if isinstance(item, syntax.Name):
            return item.name
        return item.name.name if isinstance(item, syntax.Block | syntax.Call) else ""

    def plain_word(self) -> str:
        """The name that comes next, unless it is a block's or a call's."""
        item = self.peek()
        return item.name if isinstance(item, syntax.Name) else ""

    def skip_value(self) -> None:
        """After an error: go on to the next item that can begin a property."""
        while self and not isinstance(self.peek(), syntax.Name | syntax.Block):
            self.at += 1

    # --- values

    def value(self, needed: str) -> Value:
        item = self.peek()
        if item is None or isinstance(item, syntax.Block | syntax.MapEntry) or self._begins_property(item):
            span = item.span if item is not None else Span(self.span.source, self.span.end, self.span.end)
            what = f"a value for {needed}" if needed.startswith("'") else needed
            raise Problem("wrong-arguments", span, f"{self.what} needs {what} here", self._form(needed))
        return self.expressions.value(self.take(), self.scope)  # type: ignore[arg-type]

    def _has_value(self) -> bool:
        item = self.peek()
        return item is not None and not isinstance(item, syntax.Block | syntax.MapEntry) and not self._begins_property(item)

    def _begins_property(self, item: syntax.Item) -> bool:
        """Whether the word that comes next is no value but begins what follows the values."""
        name = self.plain_word()
        return name not in self.expressions.names.entries and (
            name in vocabulary.MODIFIERS or bool(self.home_of(name))
        )

    def _form(self, needed: str) -> str:
        """A hint that shows the form of the modifier that is needed, or of the block."""
        if needed.strip("'") in vocabulary.MODIFIERS:
            return f"it looks like {vocabulary.MODIFIERS[needed.strip(chr(39))].signature}"
        if needed.startswith("'"):
            return ""
        row = vocabulary.BLOCKS.get(self.what.strip("'"))
        return f"it looks like {row.signature}" if row is not None and (row.types or row.name == "light_source") else ""

    def number(self, needed: str = "a number") -> Expression:
        value = self.value(needed)
        if value.kind != "number":
            raise Problem("wrong-value", value.span, f"{needed} must be a number, this is {value.described}")
        return value.parts[0]

    def constant(self, needed: str = "a number", row: Row | None = None) -> float:
        number = self.number(needed)
        if not isinstance(number, Constant):
            raise Problem("wrong-kind", self.items[self.at - 1].span, f"{needed} must be constant")
        if row is not None:
            check_range(row, number.value, self.items[self.at - 1].span)
        return number.value

    def vector(self, needed: str = "a vector", size: int = 3) -> tuple[float, ...]:
        """A constant vector; a number stands for a vector of itself, as in POV-Ray."""
        value = self.value(needed)
        if value.kind == "number":
            value = Value("vector", value.parts * size, value.span)
        if len(value.parts) != size or value.kind != "vector":
            raise Problem(
                "wrong-value", value.span, f"{needed} must be a vector of {size}, this is {value.described}"
            )
        if not all(isinstance(part, Constant) for part in value.parts):
            raise Problem("wrong-kind", value.span, f"{needed} must be constant")
        return value.numbers()

    # --- colours

    def starts_colour(self) -> bool:
        """Whether a colour word, a colour's name or a value comes next."""
        item = self.peek()
        if isinstance(item, syntax.Name):
            name = item.name
            if name in vocabulary.COLOUR_WORDS or name in vocabulary.COLOURS:
                return True
            entry = self.expressions.names.entries.get(name)
            return entry is not None and entry.kind in ("value", "input", "parameter")
        return item is not None and not isinstance(item, syntax.Block | syntax.MapEntry | syntax.String)

    def colour(self, needed: str = "a colour") -> Value:
        """``color rgb <1, 0, 0>``, ``Red transmit 0.5``, ``red 1 green 0.5``, ``<1, 0, 0>``: five parts."""
        item = self.peek()
        begin = self.at
        if self.plain_word() in ("color", "colour"):
            self.take()
        word = self.plain_word()
        if word in RGB_PARTS:
            self.take()
            parts = self._rgb(word)
        elif word in WORD_PARTS:
            parts = [Constant(0.0)] * 5
        else:
            parts = self._plain(needed)
        while self.plain_word() in WORD_PARTS:
            word = self.plain_word()
            name = self.take()
            if word.capitalize() in vocabulary.COLOURS and not self._has_value():
                mend = word.capitalize()
                raise Problem("unknown-name", name.span, f"unknown name '{word}': a colour is needed here", f"did you mean '{mend}'?", mend=mend)
            parts[WORD_PARTS[word]] = self.number(f"'{word}'")
        first = self.items[begin] if item is not None else self
        span = first.span.to(self.items[self.at - 1].span)
        self._look_for_bytes(parts, span)
        return Value("colour", tuple(parts), span)

    def _rgb(self, word: str) -> list[Expression]:
        indices = RGB_PARTS[word]
        value = self.value(f"{word}'s components")
        given = value.parts
        if value.kind == "number":
            given = given * len(indices)
        elif value.kind == "colour":
            given = tuple(given[i] for i in indices)
        if len(given) != len(indices):
            row = vocabulary.COLOUR_WORDS[word]
            message = f"{word} takes {len(indices)} components, this is {value.described}"
            raise Problem("wrong-value", value.span, message, f"write {row.signature}")
        parts: list[Expression] = [Constant(0.0)] * 5
        for i, part in zip(indices, given):
            parts[i] = part
        return parts

    def _plain(self, needed: str) -> list[Expression]:
        """A colour without ``rgb``: missing components are 0, a number stands for all five (POV-Ray)."""
        value = self.value(needed)
        if value.kind == "number":
            return list(value.parts * 5)
        if not 3 <= len(value.parts) <= 5:
            raise Problem("wrong-value", value.span, f"{needed} must be a colour, this is {value.described}")
        return [*value.parts, Constant(0.0), Constant(0.0)][:5]

    def _look_for_bytes(self, parts: Sequence[Expression], span: Span) -> None:
        shown = [part.value for part in parts[:3] if isinstance(part, Constant)]
        is_named = span.text.split()[-1:] and span.text.split()[-1].isidentifier()
        if any(value > 20 for value in shown) and not is_named and all(
            value == int(value) and 0 <= value <= 255 for value in shown
        ):
            hint = "divide them by 255"
            if len(shown) == 3:
                hint = f"perhaps rgb <{', '.join(f'{value:g}/255' for value in shown)}>"
            self.diagnostics.add("colour-range", span, "a colour's components are from 0 to 1", hint)

    # --- what doesn't belong

    def misfit(self, rows: Sequence[str]) -> Problem:
        """What to say of the next item, which the block has no use for; moves past it."""
        begin = self.at
        item = self.take()
        name = item.name if isinstance(item, syntax.Block | syntax.Call) else item
        if not isinstance(name, syntax.Name):
            self.skip_value()
            hint = f"it has: {' '.join(rows)}" if rows else ""
            if isinstance(item, syntax.Number):
                hint = "a vector is written <x, y, z>"
            return Problem("wrong-value", item.span, f"{self.what} has no use for this", hint)
        self.skip_value()
        if not name.name:
            return Problem()
        if name.name in vocabulary.UNSUPPORTED:
            return unsupported(name)
        if name.name in rows and isinstance(item, syntax.Block):
            return Problem("wrong-value", item.span, f"'{name.name}' takes no block")
        if name.name in rows:
            return Problem("missing", name.span, f"'{name.name}' needs a block", f"write {name.name} {{ … }}")
        message = f"{self.what} has no '{name.name}'"
        if (mend := self._at_home(begin, rows)) is not None:
            span = name.span.to(self.items[self.at - 1].span)
            return Problem("unknown-name", span, message, f"write {mend}", mend=mend)
        hint = nearest(name.name, rows)
        if not hint and rows:
            hint = f"it has: {' '.join(rows)}"
        code = (
            "wrong-kind"
            if vocabulary.kind_of(name.name) or name.name in self.expressions.names.entries
            else "unknown-name"
        )
        return Problem(code, name.span, message, hint)


    def home_of(self, name: str) -> str:
        """The block that has the property or the colour ``name``, of those that objects and textures hold."""
        if name in vocabulary.COLOUR_WORDS:
            return "pigment"
        return next((block for block in ("finish", "pigment") if name in vocabulary.PROPERTIES[block]), "")

    def _at_home(self, begin: int, rows: Sequence[str]) -> str | None:
        """What has been taken from the item ``begin`` on, in the block where it belongs; None if that isn't in ``rows``."""
        first = self.items[begin]
        home = self.home_of(first.name) if isinstance(first, syntax.Name) else ""
        if home not in rows or not home or first.name in self.expressions.names.entries:
            return None
        while self.plain_word() in vocabulary.COLOURS or self.plain_word() in (*RGB_PARTS, *WORD_PARTS):
            self.take()
            self.skip_value()
        if self.at - begin < 2:
            return None
        return f"{home} {{ {first.span.to(self.items[self.at - 1].span).text} }}"


def _spread(item: syntax.Item, expressions: Expressions) -> list[syntax.Item]:
    """``phong(0.5)`` is the property and its value, as in POV-Ray, if it calls nothing."""
    if not isinstance(item, syntax.Call):
        return [item]
    name = item.name.name
    calls = name in vocabulary.FUNCTIONS or name in expressions.names.entries or name == "mesh"
    return [item] if calls else [item.name, *item.arguments]


def check_range(row: Row, value: float, span: Span) -> None:
    """Raises Problem unless ``value`` is in the row's range."""
    if row.type == "integer" and value != int(value):
        raise Problem("wrong-value", span, f"{row.name} must be a whole number, not {value:g}")
    if row.range is not None and value not in row.range:
        unit = f" {row.unit}" if row.unit == "degrees" else ""
        raise Problem("wrong-value", span, f"{row.name} must be {row.range}{unit}, not {value:g}")
