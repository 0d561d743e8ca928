"""What can stand at a place: names of the scene and rows of the vocabulary, as candidates for completion.

Scene, document, offset and context → a list of :class:`Candidate`. What an item looks like in the protocol is the
feature's business.

Example: ``at(scene, document, offset, Context("statement", "transformation"))`` gives the operations, each with a snippet
of its arguments.
"""

from __future__ import annotations

import re
from typing import Iterator

from plsys.compiler.analysis import CODES, Context, Document, Scene, insights_of, syntax, vocabulary

from . import prose, snippets
from .block_items import VALUE_MARKS, BlockPlace
from .place import Candidate, Row

TOP_BLOCKS = tuple(row.name for row in vocabulary.BLOCKS.values() if row.makes != "texture")
DECLARED = tuple(row.name for row in vocabulary.BLOCKS.values() if row.makes != "scene")
SCENE_FILES = (".plsys",)
MESH_FILES = (".obj", ".ply")
_MESH = re.compile(rb"\bmesh\s*\(\s*\"([^\"\r\n]*)$")
_NUMBER = re.compile(rb"(?<![\w.])\.?\d[\w.]*$")
_HEAD = re.compile(rb"#declare\b|\b(?:Selection|Calculation|Transformation|Texture|Parameter)\b")
_COMMENT = re.compile(rb"//[^\r\n]*|/\*.*?(?:\*/|\Z)", re.DOTALL)
# The last rule has a guard, so that an else may follow.
_GUARDED = re.compile(rb"(?:^|[;{])\s*(?:else\s+)?if\b[^;]*;\s*\Z")
MAX_DETAIL = 60


def at(scene: Scene, document: Document, offset: int, context: Context) -> list[Candidate]:
    """All that can stand at ``offset``; nothing where a number is typed."""
    place = _Anywhere(scene, document, offset, context)
    if not context.prefix and context.kind not in ("include", "string") and _NUMBER.search(place.before):
        return []
    found: dict[str, Candidate] = {}
    for each in getattr(place, context.kind, place.nothing)():
        found.setdefault(each.name, each)
    return list(found.values())


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


class _Anywhere(BlockPlace):
    """One method for each kind of context."""

    def ignore(self) -> Iterator[Candidate]:
        """The codes that a comment can silence."""
        for name, code in CODES.items():
            if code.severity != "error":
                yield Candidate(name, "keyword", 5, code.summary)

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
        previous = self.context.previous
        if previous in vocabulary.COLOUR_WORDS:
            yield from self.colours()
        elif previous == "=" or previous in VALUE_MARKS:
            if previous == "=":
                yield from self.blocks(DECLARED, 2)
                yield from self.colour_words()
            yield from (each for each in self.values(with_parameters=False) if each.name != self.context.owner)

    def input(self) -> Iterator[Candidate]:
        """The value and the range of a Parameter."""
        if self.context.previous in VALUE_MARKS or self.context.previous in ("[", "to"):
            yield from (each for each in self.values(with_parameters=False) if each.name != self.context.owner)
        elif self.context.function == "[":
            yield Candidate("to", "keyword", 0, "", "to $0")

    # --- rules

    def selection(self) -> Iterator[Candidate]:
        """Where a rule, a guard or the entry action starts."""
        owner, previous = self.context.owner, self.context.previous
        if previous == "]" or previous in self.scene.entries:
            yield Candidate(owner, "selection", 0, "the entry action's end", f"{owner};$0", f"{owner};")
            yield from self.scene_names(("calculation",), 3)
            return
        yield Candidate(owner, "selection", 0, "a rule", f"{owner} -> $0;", f"{owner} -> ")
        guard = f"if (${{1:n}} > 0) {owner} -> $0;"
        yield Candidate("if", "keyword", 1, "a guarded rule", guard, row=vocabulary.KEYWORDS["if"])
        if previous == ";" and _GUARDED.search(self.inside()):
            yield Candidate("else", "keyword", 1, "", f"else {owner} -> $0;", row=vocabulary.KEYWORDS["else"])
            chain = f"else if (${{1:n}} > 0) {owner} -> $0;"
            yield Candidate("else if", "keyword", 2, "", chain, row=vocabulary.KEYWORDS["else"])
        if previous == "{":
            for each in self.scene_names(("calculation",), 3):
                entry = f"{each.name} {owner};"
                yield each._replace(detail="the entry action", snippet=f"{entry}$0", plain=entry)

    def production(self) -> Iterator[Candidate]:
        """Operators and operands; behind an operand '+', and behind '|' a weight."""
        previous = self.context.previous
        entry = self.scene.entries.get(previous)
        if previous == ")" or previous in vocabulary.PRIMITIVES or entry is not None and entry.kind == "selection":
            yield Candidate("+", "keyword", 0, "joins operands", "+ $0", "+ ")
        elif previous == "|":
            yield from self.values(with_parameters=True)
        elif previous in (":", "->", "+", "(", "]") or previous[:1].isalpha():
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

    def step(self) -> Iterator[Candidate]:
        """What ++ or -- counts."""
        yield from self.scene_names(("parameter",), 2)

    def arguments(self) -> Iterator[Candidate]:
        row = vocabulary.OPERATIONS.get(self.context.function)
        if row is not None and (self.context.argument < max(row.arity) or self.context.previous in VALUE_MARKS):
            yield from self.values(with_parameters=True)

    def expression(self) -> Iterator[Candidate]:
        yield from self.values(with_parameters=True)

    def call(self) -> Iterator[Candidate]:
        if self.context.function == "mesh":
            yield Candidate('"file.obj"', "file", 0, "", '"${1:file.obj}"', '"')
        else:
            yield from self.values(self.has_parameters())

    def has_parameters(self) -> bool:
        """Whether parameters have values here: in rules, their operators, and Textures."""
        heads = _HEAD.findall(_COMMENT.sub(b"", self.before))
        return bool(heads) and heads[-1] not in (b"#declare", b"Parameter")


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= MAX_DETAIL else line[: MAX_DETAIL - 1] + "…"
