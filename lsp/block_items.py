"""What can stand in a scene block: the values that it begins with, then its properties, modifiers and inner blocks.

Example: in ``sphere { |`` a vector comes, in ``sphere { 0, |`` a number, and in ``sphere { 0, 1 |`` modifiers.
"""

from __future__ import annotations

import re
from typing import Iterator

from plsys.compiler.analysis import facts_of, syntax, vocabulary

from . import snippets
from .place import FORMS, Candidate, Place

# The types of the values that a block begins with, where its row has none.
FIRST = {"light_source": ("vector",)}
COLOUR_BLOCKS = ("background", "light_source", "pigment")
COLOURS = frozenset(("colour", "colours"))
# After these no new item begins: a value goes on.
VALUE_MARKS = frozenset("<,(*/%+-=?:!&|") | {"&&", "||", "==", "!=", "<=", ">="}
# An object is made of what stands first, and modifiers follow it.
_MODIFIER = re.compile(rb"\b(?:" + "|".join(vocabulary.MODIFIERS).encode() + rb")\b")
_VECTOR = re.compile(rb"<[^<>{}]*$")
_BRACE = re.compile(rb'//[^\r\n]*|/\*.*?(?:\*/|\Z)|"(?:[^"\\\r\n]|\\.)*"?|[{}]', re.DOTALL)


class BlockPlace(Place):
    def block(self) -> Iterator[Candidate]:
        block = self.context.blocks[-1] if self.context.blocks else ""
        previous = self.context.previous
        wanted = vocabulary.PROPERTIES.get(block, {}).get(previous)
        if block == "color_map":
            yield from self.colour_map()
        elif previous in vocabulary.COLOUR_WORDS or wanted is not None and wanted.type in COLOURS:
            yield from self.colours()
            if previous in FORMS or wanted is not None and previous not in vocabulary.COLOUR_WORDS:
                yield from self.block_values()
        elif wanted is not None and wanted.type not in ("flag", "block"):
            yield from self.of_type(wanted.type)
        elif previous in vocabulary.MODIFIERS and vocabulary.MODIFIERS[previous].type in ("vector", "matrix"):
            yield from self.of_type("vector")
        elif (first := self.first_value(block)) is not None:
            yield from self.of_type(first) if first else ()
        elif previous in VALUE_MARKS or self.in_vector():
            yield from self.of_type("component" if self.in_vector() else "any")
            if previous == "," and not self.in_vector() and block in ("pigment", "light_source"):
                yield from self.colours()
        else:
            yield from self.items(block)

    def of_type(self, type_: str) -> Iterator[Candidate]:
        """A value of a type: vectors may be sums of x, y and z, too."""
        if type_ in ("vector", "matrix"):
            yield Candidate("<x, y, z>", "snippet", 0, "a vector", "<${1:0}, ${2:0}, ${3:0}>", "<")
        yield from self.block_values(with_axes=type_ in ("vector", "any"))

    def first_value(self, block: str) -> str | None:
        """The type of the value that has to come, of those that the block begins with; '' where one goes on, None where
        all are there."""
        row = vocabulary.BLOCKS.get(block)
        types = row.types or FIRST.get(block, ()) if row is not None else ()
        previous = self.context.previous
        inside = self.inside()
        if not types or re.search(rb"[A-Za-z_]\w*\s+[^\s,*/+-]", re.sub(rb"\b\w+\s*(?=\()|\b(?:[xyz]|pi)\b", b"", inside)):
            return None
        count = re.sub(rb"<[^<>]*>?|\([^()]*\)?", b"", inside).count(b",")
        if self.in_vector() or count >= len(types) or previous in VALUE_MARKS - {","}:
            return None
        if previous in ("{", ","):
            return types[count]
        if count + 1 < len(types):
            return types[count + 1] if previous == ">" else ""
        return None

    def in_vector(self) -> bool:
        return _VECTOR.search(self.before) is not None

    def inside(self) -> bytes:
        """What stands in the innermost block so far, inner blocks and comments left out."""
        text = self.before
        parts: list[list[bytes]] = [[]]
        last = 0
        for match in _BRACE.finditer(text):
            parts[-1].append(text[last : match.start()])
            last = match.end()
            if match[0] == b"{":
                parts.append([])
            elif match[0] == b"}" and len(parts) > 1:
                parts.pop()
        return b" ".join([*parts[-1], text[last:]]).removesuffix(self.context.prefix.encode())

    def items(self, block: str) -> Iterator[Candidate]:
        """What an item of a block may begin with."""
        is_first = self.context.previous == "{"
        yield from self.properties(block)
        row = vocabulary.BLOCKS.get(block)
        modifiers = row.modifiers or (vocabulary.MODIFIERS if row.makes == "object" else ()) if row is not None else ()
        nested = _inner_blocks(row.holds) if row is not None else ()
        is_made = block not in ("object", "union", "mesh") or not is_first
        if is_made:
            yield from (self.of_row(row, 3, snippets.property_(row)) for row in map(vocabulary.MODIFIERS.__getitem__, modifiers))
        has_room = is_first if block == "object" else block not in ("union", "mesh") or not _MODIFIER.search(self.inside())
        if has_room:
            yield from self.blocks([name for name in nested if name not in modifiers or not is_made], 2)
        if is_first or block == "union" and has_room:
            yield from self.names(row.begins if row is not None else ())
        if block in COLOUR_BLOCKS:
            yield from self.colour_words()
            yield from self.colours(names_only=True)

    def properties(self, block: str) -> Iterator[Candidate]:
        """After look_at, a camera has no room for what would change the picture there in POV-Ray."""
        looks = block == "camera" and re.search(rb"\blook_at\b", self.inside()) is not None
        for row in vocabulary.PROPERTIES.get(block, {}).values():
            if not looks or row.name in ("look_at", "angle", "perspective"):
                yield self.of_row(row, 1, snippets.property_(row))

    def names(self, kinds: tuple[str, ...]) -> Iterator[Candidate]:
        """Names that a block may begin with: not the one that is being defined, and without parameters where none have
        a value."""
        constant = not self.is_texture_operator()
        for each in self.scene_names(kinds, 0):
            if each.name != self.context.owner and not (constant and each.kind == "texture" and self.reads_parameters(each.name)):
                yield each

    def reads_parameters(self, name: str) -> bool:
        """Whether a Texture reads parameters, which have a value in rules only."""
        node = self.scene.entries[name].node
        if not isinstance(node, syntax.Texture):
            return False
        kinds = (self.scene.entries[each.name].kind for each in facts_of(node.span.source).names if each.name in self.scene.entries)
        return "parameter" in kinds

    def colour_map(self) -> Iterator[Candidate]:
        """``[position colour]``, and what stands in it."""
        previous = self.context.previous
        if previous in ("{", "]"):
            yield Candidate("[ ]", "snippet", 0, "a position from 0 to 1, and its colour", "[${1:0} color rgb <${2:1}, ${3:1}, ${4:1}>]", "[")
            if previous == "{":
                yield from self.names(vocabulary.BLOCKS["color_map"].begins)
        elif previous == "[" or previous in VALUE_MARKS:
            yield from self.block_values(with_axes=False)
        elif previous in vocabulary.COLOUR_WORDS:
            yield from self.colours()
        else:
            yield from self.colour_words()
            yield from self.colours(names_only=True)

    def block_values(self, with_axes: bool = True) -> Iterator[Candidate]:
        """Values in scene blocks: constants only, but in a Texture operator parameters as well."""
        yield from self.values(with_parameters=self.is_texture_operator())
        for row in vocabulary.AXES.values() if with_axes else ():
            yield self.of_row(row, 5)

    def is_texture_operator(self) -> bool:
        owner = self.context.owner.encode()
        return bool(owner) and re.search(rb"\bTexture\s+" + re.escape(owner) + rb"\b", self.before) is not None


def _inner_blocks(holds: tuple[str, ...]) -> tuple[str, ...]:
    return vocabulary.OBJECT_BLOCKS if "object" in holds else holds
