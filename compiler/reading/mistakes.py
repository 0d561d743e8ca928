"""What the grammar can't accept: bytes that aren't text, unclosed comments, unknown words, and the places where
tree-sitter gave up (ERROR) or filled a gap (MISSING).

Example: ``first_error(reading, node)`` on ``camera { location @ }`` is the diagnostic
"the character '@' has no meaning here".
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from .codes import CODES
from .diagnostics import Diagnostic, Diagnostics, nearest
from .source import Source, Span

if TYPE_CHECKING:
    from tree_sitter import Node, Tree

    from .parse_values import Reading

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
DEFINITION_WORDS = ("Selection", "Calculation", "Transformation", "Texture", "Parameter")
_CLOSERS = {")": "(", "}": "{", "]": "[", ">": "<"}
# What may stand in a file outside of strings and comments.
_KNOWN = re.compile(r"[A-Za-z0-9_\s\"#%&()*+,\-./:;<=>?\[\]{|}!→]")

# By the kind of node that an error stands in: what was expected there.
_EXPECTED = {
    "source_file": "a definition starts with Selection, Calculation, Transformation, Texture, Parameter, "
    "#declare or a block's name: camera { … }",
    "selection_body": "a rule looks like Name -> operators operand + …;",
    "rule": "a rule looks like Name -> operators operand + …;",
    "statements": "a statement looks like count = 2; or --count; or trans 0 0 1;",
    "block_body": "a block holds names, values and blocks: camera { location <0, 1, 2> }",
    "guard": "a condition looks like if (count > 0 && height < 2)",
    "vector": "a vector looks like <x, y, z>; comparisons in it stand in brackets",
    "range": "a range looks like [0 to 20]",
    "parameter": 'a Parameter looks like Parameter age = 10 [0 to 20] "Years";',
    "parameters": "parameters look like Branch(length, width)",
    "declare": "a declaration looks like #declare Bark = texture { … }",
    "include": 'an include looks like #include "forest.plsys"',
}


def clean(source: Source, diagnostics: Diagnostics) -> bytes:
    """The bytes to parse: like the source's, but with spaces for a byte order mark, for NUL bytes and for bytes
    that aren't UTF-8 (both reported, at the first one), so that every offset stays what it is."""
    data = source.data
    if data.startswith(BYTE_ORDER_MARK):
        data = b"   " + data[3:]
    try:
        data.decode()
    except UnicodeDecodeError as error:
        span = Span(source, error.start, error.start + 1)
        diagnostics.add("encoding", span, f"the byte 0x{data[error.start]:02x} is not UTF-8 text",
                        "save the file as UTF-8")
        # A replaced byte is one character, so every bad byte becomes exactly one space.
        data = data.decode("utf-8", "surrogateescape")
        data = re.sub("[\udc80-\udcff]", " ", data).encode()
    if b"\0" in data:
        at = data.index(b"\0")
        diagnostics.add("encoding", Span(source, at, at + 1), "a NUL byte stands in the text",
                        "remove it; or is this no text file?")
        data = data.replace(b"\0", b" ")
    return data


def comments(reading: Reading, tree: Tree) -> None:
    """Report a comment that the end of the file cuts off, and directives that plsys doesn't have."""
    pass


def unknown_definition(word: str) -> tuple[str, str]:
    """Message and hint for ``Selction Tree { … }``."""
    hint = nearest(word.capitalize(), DEFINITION_WORDS)
    return f"'{word}' defines nothing", hint or "Selection, Calculation, Transformation and Texture do"


def stray_in_block(text: str) -> tuple[str, str]:
    """Message and hint for a token that has no place in a scene block."""
    if text in ("->", "=>"):
        return f"'{text}' can't stand in a scene block", "rules stand in a Selection: Selection Name { Name -> …; }"
    if text in (";", ":", "="):
        return f"'{text}' can't stand in a scene block", "remove it: items stand side by side, camera { angle 45 }"
    return f"'{text}' can't stand in a scene block", "comparisons stand in brackets, statements in a Calculation"


def first_error(reading: Reading, node: Node) -> Diagnostic | None:
    """The message for the first place in ``node`` where the text doesn't follow the grammar."""
    broken = _first_broken(node)
    if broken is None:
        return None
    if broken.is_missing:
        return _missing(reading, broken)
    return _unexpected(reading, broken)


def _first_broken(node: Node) -> Node | None:
    while not (node.is_error or node.is_missing):
        node = next((child for child in node.children if child.has_error or child.is_missing), None)
        if node is None:
            return None
    return node


def _diagnostic(code: str, span: Span, message: str, hint: str) -> Diagnostic:
    return Diagnostic(code, CODES[code].severity, message, span, hint)


def _missing(reading: Reading, node: Node) -> Diagnostic:
    """A token that tree-sitter put in."""
    parent = node.parent
    if node.type in _CLOSERS:
        opener = _CLOSERS[node.type]
        for child in parent.children:
            if child.type == opener:
                return _diagnostic("unclosed", reading.span(child), f"this '{opener}' is never closed",
                                   f"add the '{node.type}' that belongs to it")
    what = {"name": "a name", "number": "a value", "string": "a text in quotes"}.get(node.type, f"'{node.type}'")
    hint = _EXPECTED.get(parent.type, "")
    return _diagnostic("missing", reading.after(_end_before(reading, node)), f"{what} is missing here", hint)


def _end_before(reading: Reading, node: Node) -> int:
    """Where the text before ``node`` ends, leaving out space."""
    return len(reading.data[: node.start_byte].rstrip())


def _unexpected(reading: Reading, node: Node) -> Diagnostic:
    text = reading.text(node)
    children = node.children
    # A character that belongs to no token stands between the tokens that tree-sitter did find.
    position = node.start_byte
    for child in [*children, None]:
        gap_end = child.start_byte if child is not None else node.end_byte
        gap = reading.data[position:gap_end].decode(errors="replace")
        for i, character in enumerate(gap):
            if not _KNOWN.match(character):
                start = position + len(gap[:i].encode())
                span = Span(reading.source, start, start + len(character.encode()))
                return _diagnostic("syntax", span, f"the character '{character}' has no meaning here",
                                   "names are made of the letters A to Z, digits and '_'" if character.isalpha() else "remove it")
        if child is not None:
            position = child.end_byte
    word = text.split()[0] if text.split() else text
    if len(word) > 20:
        word = word[:20] + "…"
    parent = node.parent
    hint = ""
    while parent is not None and not hint:
        hint = _EXPECTED.get(parent.type, "")
        parent = parent.parent
    span = Span(reading.source, node.start_byte, min(node.end_byte, node.start_byte + max(1, len(word.encode()))))
    return _diagnostic("syntax", span, f"'{word}' is unexpected here", hint)
