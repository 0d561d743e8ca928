"""Semantic tokens: what each word means, for colours.

| words | type | modifiers |
|---|---|---|
| `Selection` … `if`, `else`, `to`, `#declare`, `#include`, `Texture` | keyword | |
| Selections | class | declaration where defined |
| Calculations, Transformations | function, method | declaration |
| textures, pigments, finishes, maps, declared objects | struct | declaration |
| `#declare`d values, `Parameter`s | variable | readonly, declaration |
| parameters that Calculations assign | parameter | modification where assigned |
| primitives, scene blocks | type | defaultLibrary |
| operations, functions | method, function | defaultLibrary |
| properties, modifiers, `rgb` … | property | defaultLibrary |
| colour names, `pi` | enumMember, variable | defaultLibrary, readonly |
| comments, texts, numbers | comment, string, number | |

Names that mean nothing get no token, so that they stand out. Example: in `roty -betaBr;`, `roty` is a method of
the default library and `betaBr` a parameter.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Iterator, NamedTuple

from plsys.compiler.analysis import Block, facts_of, queries, vocabulary
from plsys.lsp.request import Feature, Request
from plsys.lsp.text import units

TYPES = ("keyword", "class", "function", "method", "struct", "variable", "parameter", "type", "property", "enumMember",
         "comment", "string", "number")  # fmt: skip
MODIFIERS = ("declaration", "readonly", "modification", "defaultLibrary")
DECLARATION, READONLY, MODIFICATION, LIBRARY = (1 << i for i in range(len(MODIFIERS)))

# What a name of the scene or of the vocabulary is shown as, by its kind.
_KINDS = {
    "selection": ("class", 0), "calculation": ("function", 0), "transformation": ("method", 0),
    "texture": ("struct", 0), "pigment": ("struct", 0), "finish": ("struct", 0), "color_map": ("struct", 0), "object": ("struct", 0),
    "value": ("variable", READONLY), "input": ("variable", READONLY), "parameter": ("parameter", 0),
    "primitive": ("type", LIBRARY), "block": ("type", LIBRARY), "operation": ("method", LIBRARY), "function": ("function", LIBRARY),
    "modifier": ("property", LIBRARY), "colour": ("enumMember", LIBRARY), "constant": ("variable", READONLY | LIBRARY),
    "keyword": ("keyword", 0),
}  # fmt: skip
_ROLES = {"definition": DECLARATION, "write": MODIFICATION}

_QUERY = """
(comment) @comment (string) @string (number) @number (name) @name (block name: (name) @block)
["Selection" "Calculation" "Transformation" "Parameter" "if" "else" "#declare" "#include"] @keyword (range "to" @keyword)
((named_block kind: (name) @keyword) (#eq? @keyword "Texture"))
"""


class _Word(NamedTuple):
    """A token of a block, before names have a meaning: ``type`` is an index of TYPES, or None for a ``name``."""

    line: int  # from the block's first
    column: int
    length: int
    type: int | None
    modifiers: int
    name: str


def full(request: Request) -> dict[str, Any]:
    text = request.document.text
    data = _encode(_tokens(request, 0, len(text.blocks) - 1))
    return {"resultId": _keep(request, data), "data": data}


def range_(request: Request) -> dict[str, Any]:
    """The tokens of the lines of ``params.range``."""
    text, (start, end) = request.document.text, request.offsets
    first, last = text.line_of(start), text.line_of(end)
    tokens = _tokens(request, text.index_at(start), text.index_at(end))
    return {"data": _encode(token for token in tokens if first <= token[0] <= last)}


def delta(request: Request) -> dict[str, Any]:
    """What changed since the result that the client has; all if that is unknown."""
    kept = request.document.__dict__.get("semantic_tokens")
    if kept is None or kept[0] != request.params.get("previousResultId"):
        return full(request)
    old, new = kept[1], _encode(_tokens(request, 0, len(request.document.text.blocks) - 1))
    start, tail = _same(old, new)
    edits = [] if start + tail == len(old) == len(new) else [
        {"start": start, "deleteCount": len(old) - start - tail, "data": new[start : len(new) - tail]}
    ]  # fmt: skip
    return {"resultId": _keep(request, new), "edits": edits}


def _keep(request: Request, data: list[int]) -> str:
    """Remember what the client has now, with the document; its id."""
    kept = request.document.__dict__.get("semantic_tokens")
    number = str(int(kept[0]) + 1 if kept else 1)
    request.document.__dict__["semantic_tokens"] = number, data
    return number


def _same(old: list[int], new: list[int]) -> tuple[int, int]:
    """How many numbers at the start and at the end of both lists are the same."""
    shorter, step = min(len(old), len(new)), 4096
    start = next((i for i in range(0, shorter, step) if old[i : i + step] != new[i : i + step]), shorter)
    while start < shorter and old[start] == new[start]:
        start += 1
    tail = 0
    while tail < shorter - start and old[-1 - tail] == new[-1 - tail]:
        tail += 1
    return start, tail


# --- tokens


def _tokens(request: Request, first: int, last: int) -> Iterator[tuple[int, int, int, int, int]]:
    """(line, column, length, type, modifiers) of the blocks from ``first`` to ``last``, in text order."""
    text, entries = request.document.text, request.scene.entries
    numbers = {name: TYPES.index(name) for name in TYPES}
    kinds = {kind: (numbers[name], modifiers) for kind, (name, modifiers) in _KINDS.items()}
    for index in range(first, last + 1):
        line = text.first_lines[index]
        for word in _words(text.blocks[index], request.workspace.encoding):
            if word.type is not None:
                yield line + word.line, word.column, word.length, word.type, word.modifiers
                continue
            entry = entries.get(word.name)
            found = kinds.get(entry.kind if entry is not None else vocabulary.kind_of(word.name))
            if found is not None:
                yield line + word.line, word.column, word.length, found[0], found[1] | word.modifiers


def _encode(tokens: Iterator[tuple[int, int, int, int, int]]) -> list[int]:
    """The protocol's numbers, each token's place relative to the one before."""
    data: list[int] = []
    last_line = last_column = 0
    for line, column, length, type_, modifiers in tokens:
        if line != last_line:
            last_column = 0
        data += (line - last_line, column - last_column, length, type_, modifiers)
        last_line, last_column = line, column
    return data


@cache
def _query():
    return queries.compile(_QUERY)


def _words(block: Block, encoding: str) -> list[_Word]:
    """The block's words, kept with it."""
    kept = block.__dict__.get("words")
    if kept is None or kept[0] != encoding:
        kept = block.__dict__["words"] = encoding, sorted(_read(block, encoding), key=lambda word: word[:2])
    return kept[1]


def _read(block: Block, encoding: str) -> Iterator[_Word]:
    facts = facts_of(block)
    roles = {name.start: name.role for name in facts.names}
    captures = queries.captures(_query(), facts.tree.root_node)
    library = TYPES.index("type"), LIBRARY
    blocks = {node.start_byte for node in captures.pop("block", ())}
    keywords = {node.start_byte for node in captures.get("keyword", ())}
    for capture, nodes in captures.items():
        for node in nodes:
            start = node.start_byte
            type_, modifiers, name = None, 0, ""
            if capture == "name":
                if start in keywords:
                    continue
                name = facts.text[start : node.end_byte].decode(errors="replace")
                modifiers = _ROLES.get(roles.get(start, ""), 0)
                if start in blocks and vocabulary.kind_of(name):
                    type_, modifiers = library
                elif start not in roles and vocabulary.kind_of(name) in ("", "modifier"):
                    type_, modifiers = TYPES.index("property"), LIBRARY
            else:
                type_ = TYPES.index(capture)
            yield from _lines(block, encoding, start, node.end_byte, (type_, modifiers, name))


def _lines(block: Block, encoding: str, start: int, end: int, rest: tuple) -> Iterator[_Word]:
    """The parts of a token, one a line: clients need not know tokens over several lines."""
    first, last = block.position(start).line - 1, block.position(max(start, end - 1)).line - 1
    for line in range(first, last + 1):
        line_start = block.line_starts[line]
        line_end = block.line_starts[line + 1] if line + 1 < len(block.line_starts) else len(block.data)
        low, high = max(start, line_start), min(end, line_end)
        part = block.data[low:high].rstrip(b"\r\n")
        if part:
            yield _Word(line, units(block.data[line_start:low], encoding), units(part, encoding), *rest)


_LEGEND = {"tokenTypes": list(TYPES), "tokenModifiers": list(MODIFIERS)}
_OPTIONS = {"legend": _LEGEND, "range": True, "full": {"delta": True}}

FEATURES = (
    Feature("textDocument/semanticTokens/full", full, "semanticTokensProvider", _OPTIONS),
    Feature("textDocument/semanticTokens/full/delta", delta),
    Feature("textDocument/semanticTokens/range", range_),
)
