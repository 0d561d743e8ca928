"""What can stand at a place: names of the scene and rows of the vocabulary, as candidates for completion.

Scene, document, offset and context → a list of :class:`Candidate`. What an item looks like in the protocol is the
feature's business.

Example: ``at(scene, document, offset, Context("statement", "transformation"))`` gives the operations, each with a snippet
of its arguments.
"""

from __future__ import annotations

import re
from typing import Iterable, Iterator, NamedTuple

from plsys.compiler.analysis import Context, Document, Scene, facts_of, insights_of, syntax, vocabulary

from . import prose, snippets

Row = vocabulary.Row

OBJECTS = ("object", "union", "sphere", "box", "cylinder", "cone", "plane", "torus", "triangle", "disc", "mesh")
TOP_BLOCKS = ("global_settings", "background", "camera", "light_source", *OBJECTS)
DECLARED = ("texture", "pigment", "finish", "color_map", *OBJECTS)
MOVES = ("translate", "rotate", "scale", "matrix")
# Of blocks that aren't objects: the modifiers that they take.
MODIFIERS = {"light_source": MOVES, "texture": MOVES, "pigment": MOVES}
# The kinds of names that a block may begin with.
NAMED = {
    "object": ("selection", "object"),
    "union": ("object",),
    "texture": ("texture",),
    "pigment": ("pigment",),
    "finish": ("finish",),
    "color_map": ("color_map",),
}
NESTED = {
    "union": OBJECTS,
    "texture": ("pigment", "finish"),
    "pigment": ("color_map",),
    "mesh": ("triangle", "smooth_triangle"),
    "object": OBJECTS,
}
COLOUR_BLOCKS = ("background", "light_source", "pigment", "color_map")
FORMS = ("rgb", "rgbt", "rgbf", "rgbft")
COLOURS = frozenset(("colour", "colours"))
VALUES = {"value": 2, "input": 2}
# After these no new item begins: a value goes on.
VALUE_MARKS = frozenset("<,(*/%+-=?:!&|") | {"&&", "||", "==", "!=", "<=", ">="}
SCENE_FILES = (".plsys",)
MESH_FILES = (".obj", ".ply")
_MESH = re.compile(rb"\bmesh\s*\(\s*\"([^\"\r\n]*)$")
_VECTOR = re.compile(rb"<[^<>{}]*$")
MAX_DETAIL = 60
# Names of a kind that are looked at further: more than a list shows.
MAX_NAMES = 250


class Candidate(NamedTuple):
    """``order`` sorts candidates of equal fit: lower first. ``plain`` is what is put in where there are no snippets,
    if that isn't the name."""

    name: str
    kind: str
    order: int = 5
    detail: str = ""
    snippet: str = ""
    plain: str = ""
    row: Row | None = None


def at(scene: Scene, document: Document, offset: int, context: Context) -> list[Candidate]:
    """All that can stand at ``offset``."""
    place = _Place(scene, document, offset, context)
    return list(getattr(place, context.kind, place.nothing)())


def fit(name: str, prefix: str) -> int | None:
    """0 for names that begin as typed, 1 whatever the case, 2 for those that have the letters in order; None for others."""
    if name.startswith(prefix):
        return 0
    low, typed = name.lower(), prefix.lower()
    if low.startswith(typed):
        return 1
    letters = iter(low)
    return 2 if low[:1] == typed[:1] and all(letter in letters for letter in typed) else None


def detailed(scene: Scene, each: Candidate) -> Candidate:
    """With a short line about a scene's name; for a symbol with parameters the snippet of a call."""
    entry = scene.entries.get(each.name) if each.row is None and not each.detail else None
    if entry is None:
        return each
    node = entry.node
    if isinstance(node, syntax.Selection) and node.parameters:
        names = [name.name for name in node.parameters]
        places = ", ".join(f"${{{i}:{name}}}" for i, name in enumerate(names, 1))
        call = each.snippet or f"{each.name}({places})"
        return each._replace(detail=f"Selection {each.name}({', '.join(names)})", snippet=call)
    if isinstance(node, syntax.ParameterDeclaration | syntax.Declare):
        return each._replace(detail=_short(node.span.text))
    if each.kind == "parameter":
        return each._replace(detail=prose.parameter(insights_of(scene, each.name)))
    return each._replace(detail=prose.KINDS.get(each.kind, each.kind))


def row_of(key: str, block: str) -> Row | None:
    """The row of a candidate, from what an editor sent back."""
    kind, _, name = key.partition(".")
    return vocabulary.ALL.get(f"{kind}.{block}.{name}" if block else key)


class _Place:
    """One method for each kind of context."""

    def __init__(self, scene: Scene, document: Document, offset: int, context: Context) -> None:
        self.scene, self.document, self.offset, self.context = scene, document, offset, context
        self.near = {each.name for each in facts_of(document.text.block_at(max(0, offset - 1))[0]).names}

    def nothing(self) -> Iterator[Candidate]:
        yield from ()

    # --- between definitions

    def top(self) -> Iterator[Candidate]:
        for name, snippet in snippets.DEFINITIONS.items():
            row = vocabulary.KEYWORDS.get(name) or vocabulary.DIRECTIVES.get(name.lstrip("#"))
            yield Candidate(name, "keyword", 0, row.signature if row else "", snippet, row=row)
        for name, (detail, snippet) in snippets.WHOLE.items():
            yield Candidate(name, "snippet", 2, detail, snippet)
        yield from self.blocks(TOP_BLOCKS, 1)

    def name(self) -> Iterator[Candidate]:
        """A new definition: what is used and nothing defines."""
        if self.context.previous not in snippets.DEFINITIONS:
            return
        for name in self.scene.users:
            if name not in self.scene.entries and not vocabulary.kind_of(name) and name != self.context.prefix:
                yield Candidate(name, "selection", 0, "used, not defined yet")

    def include(self) -> Iterator[Candidate]:
        yield from self.files(self.context.prefix, SCENE_FILES)

    def string(self) -> Iterator[Candidate]:
        line = self.document.text.line_of(self.offset)
        start = self.document.text.line_start(line)
        match = _MESH.search(self.document.text.slice(start, self.offset))
        if match is not None:
            yield from self.files(match[1].decode(errors="replace"), MESH_FILES)

    def files(self, typed: str, suffixes: tuple[str, ...]) -> Iterator[Candidate]:
        """Files and folders beside the scene; paths begin as typed."""
        folder = self.document.path.parent if self.document.path is not None else None
        if folder is None or "\0" in typed:
            return
        head = typed.rpartition("/")[0]
        head = f"{head}/" if head else ""
        try:
            found = sorted((folder / head).iterdir())
        except OSError:
            return
        for path in found[:1000]:
            if path.name.startswith(".") or path == self.document.path:
                continue
            if path.is_dir():
                yield Candidate(f"{head}{path.name}/", "folder", 6)
            elif path.suffix.lower() in suffixes:
                yield Candidate(f"{head}{path.name}", "file", 5)

    def declare(self) -> Iterator[Candidate]:
        if self.context.previous == self.context.owner:
            return  # the = is still missing
        if self.context.previous in vocabulary.COLOUR_WORDS:
            yield from self.colours()
            return
        yield from self.blocks(DECLARED, 2)
        yield from self.colour_words()
        yield from self.expression()

    # --- rules

    def selection(self) -> Iterator[Candidate]:
        """Where a rule, a guard or the entry action starts."""
        owner = self.context.owner
        yield Candidate(owner, "selection", 0, "a rule", f"{owner} -> $0;", f"{owner} -> ")
        guard = f"if (${{1:n}} > 0) {owner} -> $0;"
        yield Candidate("if", "keyword", 1, "a guarded rule", guard, row=vocabulary.KEYWORDS["if"])
        if self.context.previous == ";":
            yield Candidate("else", "keyword", 1, "", f"else {owner} -> $0;", row=vocabulary.KEYWORDS["else"])
            chain = f"else if (${{1:n}} > 0) {owner} -> $0;"
            yield Candidate("else if", "keyword", 2, "", chain, row=vocabulary.KEYWORDS["else"])
        if self.context.previous == "{":
            for each in self.scene_names(("calculation",), 3):
                entry = f"{each.name} {owner};"
                yield each._replace(detail="the entry action", snippet=f"{entry}$0", plain=entry)

    def production(self) -> Iterator[Candidate]:
        if self.context.previous in (":", "->", "|", "+", "(", "]") or self.context.previous[:1].isalpha():
            yield from self.scene_names(("selection", "calculation", "transformation", "texture"), 3)
            for row in vocabulary.PRIMITIVES.values():
                yield self.of_row(row, 4, snippets.call(row) if row.arity != (0,) else "")
            yield Candidate("[ ]", "snippet", 6, "an inline operator", "[ $1 ] $0", "[")
            yield Candidate("( )", "snippet", 6, "several terms", "($1 + $0)", "(")

    # --- statements

    def statement(self) -> Iterator[Candidate]:
        body = self.context.owner
        if body in ("transformation", "inline"):
            for row in vocabulary.OPERATIONS.values():
                if row.name != "variants":
                    yield self.of_row(row, 1, snippets.operation(row, body != "inline"))
        if body in ("calculation", "inline"):
            end = "" if body == "inline" else ";"
            for each in self.scene_names(("parameter",), 2):
                yield each._replace(snippet=f"{each.name} = $0{end}", plain=f"{each.name} = ")
            row = vocabulary.OPERATIONS["variants"]
            yield self.of_row(row, 3, snippets.operation(row, body != "inline"))

    def arguments(self) -> Iterator[Candidate]:
        yield from self.values(with_parameters=True)

    def expression(self) -> Iterator[Candidate]:
        yield from self.values(with_parameters=self.context.kind != "declare")

    def call(self) -> Iterator[Candidate]:
        if self.context.function == "mesh":
            yield Candidate('"file.obj"', "file", 0, "", '"${1:file.obj}"', '"')
        else:
            yield from self.values(with_parameters=True)

    def values(self, with_parameters: bool) -> Iterator[Candidate]:
        """What an expression may begin with."""
        yield from self.ordered_names({"parameter": 1, **VALUES} if with_parameters else VALUES)
        for row in vocabulary.FUNCTIONS.values():
            yield self.of_row(row, 4, snippets.call(row))
        for row in vocabulary.CONSTANTS.values():
            yield self.of_row(row, 4)

    # --- scene blocks

    def block(self) -> Iterator[Candidate]:
        block = self.context.blocks[-1] if self.context.blocks else ""
        previous = self.context.previous
        wanted = vocabulary.PROPERTIES.get(block, {}).get(previous)
        if previous in vocabulary.COLOUR_WORDS or wanted is not None and wanted.type in COLOURS:
            yield from self.colours()
            if previous in FORMS:
                yield from self.block_values()
        elif wanted is not None and wanted.type not in ("flag", "block") or previous in vocabulary.MODIFIERS and previous != "no_shadow":
            if wanted is None or wanted.type in ("vector", "matrix"):
                yield Candidate("<x, y, z>", "snippet", 0, "a vector", "<${1:0}, ${2:0}, ${3:0}>", "<")
            yield from self.block_values()
        elif previous in VALUE_MARKS or self.in_vector():
            yield from self.block_values()
            if previous == "," and not self.in_vector() and block in ("pigment", "light_source"):
                yield from self.colours()
        else:
            yield from self.items(block)

    def in_vector(self) -> bool:
        text, base = self.document.text.block_at(max(0, self.offset - 1))
        return _VECTOR.search(text.data[: self.offset - base]) is not None

    def items(self, block: str) -> Iterator[Candidate]:
        """What an item of a block may begin with."""
        for row in vocabulary.PROPERTIES.get(block, {}).values():
            yield self.of_row(row, 1, snippets.property_(row))
        modifiers = MODIFIERS.get(block, vocabulary.MODIFIERS if block in OBJECTS else ())
        nested = NESTED.get(block, ())
        yield from (self.of_row(vocabulary.MODIFIERS[name], 3, snippets.property_(vocabulary.MODIFIERS[name])) for name in modifiers)
        yield from self.blocks([name for name in nested if name not in modifiers], 2)
        kinds = NAMED.get(block, ())
        if self.context.previous == "{" or block == "union":
            yield from self.scene_names(kinds, 0)
        if block in COLOUR_BLOCKS:
            yield from self.colour_words()
            yield from self.colours(names_only=True)

    def block_values(self) -> Iterator[Candidate]:
        """Values in scene blocks: constants only, but in a Texture operator parameters as well."""
        yield from self.values(with_parameters=self.is_texture_operator())
        for row in vocabulary.AXES.values():
            yield self.of_row(row, 5)

    def is_texture_operator(self) -> bool:
        block, _ = self.document.text.block_at(max(0, self.offset - 1))
        return bool(re.search(rb"\bTexture\s+" + re.escape(self.context.owner.encode()) + rb"\b", block.data)) and bool(self.context.owner)

    def colour_words(self) -> Iterator[Candidate]:
        for name in ("color", "rgb"):
            yield self.of_row(vocabulary.COLOUR_WORDS[name], 2, snippets.COLOURS[name])

    def colours(self, names_only: bool = False) -> Iterator[Candidate]:
        """The forms of colours, and their names."""
        if not names_only and self.context.previous not in FORMS:
            for name in FORMS:
                yield self.of_row(vocabulary.COLOUR_WORDS[name], 0, snippets.COLOURS[name])
            yield from self.scene_names(("value",), 1)
        elif self.context.previous in FORMS:
            yield Candidate("<r, g, b>", "snippet", 0, "", snippets.COLOURS[self.context.previous].partition(" ")[2], "<")
            return
        for name, parts in vocabulary.COLOURS.items():
            yield Candidate(name, "colour", 4, f"<{', '.join(map(prose.number, parts))}>")

    # --- candidates

    def scene_names(self, kinds: Iterable[str], order: int) -> Iterator[Candidate]:
        return self.ordered_names(dict.fromkeys(kinds, order))

    def ordered_names(self, orders: dict[str, int]) -> Iterator[Candidate]:
        """Names of the kinds in ``orders`` that fit what is typed; those of the block come first. Of many, some."""
        prefix, entries = self.context.prefix, self.scene.entries
        for name in self.near:
            order = orders.get(entries[name].kind) if name in entries else None
            if order is not None and name != prefix:
                yield Candidate(name, entries[name].kind, order - 1)
        firsts = (prefix[:1].lower(), prefix[:1].upper())
        count = 0
        for name, entry in entries.items():
            if prefix and name[0] not in firsts:
                continue  # a quick look, for scenes with thousands of names
            kind = entry.definition.kind
            if kind in orders and (name not in self.near or name == prefix) and fit(name, prefix) is not None:
                yield Candidate(name, kind, orders[kind])
                count += 1
                if count > MAX_NAMES:
                    return

    @staticmethod
    def of_row(row: Row, order: int, snippet: str = "") -> Candidate:
        return Candidate(row.name, row.kind, order, row.signature, snippet, row=row)

    def blocks(self, names: Iterable[str], order: int) -> Iterator[Candidate]:
        for name in names:
            row = vocabulary.BLOCKS[name]
            yield self.of_row(row, order, snippets.block(row))


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= MAX_DETAIL else line[: MAX_DETAIL - 1] + "…"
