"""The vocabulary with types: what each name that plsys itself defines means.

grammar/vocabulary.toml → vocabulary_rows.py (generated) → :class:`Row` objects, by kind and name.

Example::

    FUNCTIONS["clamp"].signature          # 'clamp(x, low, high)'
    PROPERTIES["camera"]["angle"].range   # Interval(0, 180, open at both ends)
    kind_of("sphere")                     # 'primitive'
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from .records import record
from .vocabulary_rows import COLOURS, ROWS, STOCK_INCLUDES, SYNONYMS, UNSUPPORTED, UNSUPPORTED_DIRECTIVES

__all__ = ["COLOURS", "STOCK_INCLUDES", "SYNONYMS", "UNSUPPORTED", "UNSUPPORTED_DIRECTIVES"]


class Interval(NamedTuple):
    """A range of numbers: '[0, 1]' with its ends, '(0, inf)' without."""

    low: float
    high: float
    low_open: bool
    high_open: bool

    @classmethod
    def parse(cls, text: str) -> Interval:
        match = re.fullmatch(r"([\[(])\s*(\S+),\s*(\S+)([\])])", text)
        assert match, text
        return cls(float(match[2]), float(match[3]), match[1] == "(", match[4] == ")")

    def __contains__(self, value: object) -> bool:
        assert isinstance(value, float | int)
        above = value > self.low if self.low_open else value >= self.low
        return above and (value < self.high if self.high_open else value <= self.high)

    def __str__(self) -> str:
        if self.high == math.inf:
            return f"{'above' if self.low_open else 'at least'} {self.low:g}"
        if self.low == self.high:
            return f"{self.low:g}"
        low = f"above {self.low:g}" if self.low_open else f"from {self.low:g}"
        return f"{low} {'and below' if self.high_open else 'to'} {self.high:,.10g}"


@record
class Row:
    """One row of the table; see the head of grammar/vocabulary.toml for the fields."""

    kind: str
    name: str
    block: str  # the block that a property belongs to, else ''
    signature: str
    doc: str
    example: str
    arity: tuple[int, ...] = ()
    variadic: bool = False
    type: str = ""
    types: tuple[str, ...] = ()
    unit: str = ""
    range: Interval | None = None
    default: object = None
    povray: str = ""
    makes: str = ""
    begins: tuple[str, ...] = ()
    holds: tuple[str, ...] = ()
    modifiers: tuple[str, ...] = ()

    def accepts(self, count: int) -> bool:
        """Whether ``count`` arguments fit."""
        if self.variadic:
            return self.arity[0] <= count <= self.arity[1]
        return count in self.arity

    @property
    def expected(self) -> str:
        """How many arguments it takes, for messages: '3 arguments', '1 or 3 arguments', '2 or more …'."""
        if self.variadic:
            return f"{self.arity[0]} to {self.arity[1]} arguments"
        if self.arity == (0,):
            return "no arguments"
        plural = "" if self.arity == (1,) else "s"
        return f"{' or '.join(str(n) for n in self.arity)} argument{plural}"


def _row(key: str, fields: dict) -> Row:
    kind, *path = key.split(".")
    values = dict(fields)
    interval = values.pop("range", "")
    for name in ("arity", "types", "begins", "holds", "modifiers"):
        values[name] = tuple(values.get(name, ()))
    block = path[0] if kind == "property" else ""
    return Row(kind, path[-1], block, range=Interval.parse(interval) if interval else None, **values)


ALL: dict[str, Row] = {key: _row(key, fields) for key, fields in ROWS.items()}


def _kind(kind: str) -> dict[str, Row]:
    return {row.name: row for row in ALL.values() if row.kind == kind}


KEYWORDS = _kind("keyword")
DIRECTIVES = _kind("directive")
PRIMITIVES = _kind("primitive")
FUNCTIONS = _kind("function")
CONSTANTS = _kind("constant")
AXES = _kind("axis")
OPERATIONS = _kind("operation")
BLOCKS = _kind("block")
OBJECT_BLOCKS = tuple(row.name for row in BLOCKS.values() if row.makes == "object")
MODIFIERS = _kind("modifier")
COLOUR_WORDS = _kind("colourword")
PROPERTIES: dict[str, dict[str, Row]] = {}
for _each in ALL.values():
    if _each.kind == "property":
        PROPERTIES.setdefault(_each.block, {})[_each.name] = _each

# The names that a scene can't define, each with what it is. Properties, axes and the words of colours mean
# something in their own places only, and are free.
_TAKEN: dict[str, str] = {"colour_map": "block"}
for _kind_name, _rows in (
    ("keyword", KEYWORDS),
    ("modifier", MODIFIERS),
    ("block", BLOCKS),
    ("operation", OPERATIONS),
    ("constant", CONSTANTS),
    ("function", FUNCTIONS),
    ("primitive", PRIMITIVES),
):
    _TAKEN |= dict.fromkeys(_rows, _kind_name)
_TAKEN |= dict.fromkeys(COLOURS, "colour")


def kind_of(name: str) -> str:
    """What the vocabulary has under ``name``: 'primitive', 'function', 'operation', 'block', 'modifier',
    'constant', 'colour', 'keyword', or '' where the name is free."""
    return _TAKEN.get(name, "")
