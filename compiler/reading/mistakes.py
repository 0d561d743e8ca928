"""What the grammar doesn't accept: bytes that aren't text, unclosed comments, directives and words that plsys
doesn't have, and the places where tree-sitter gave up (ERROR) or filled a gap (MISSING).

Example: ``first_error(reading, node)`` on ``camera { location @ }`` is the diagnostic
"the character '@' has no meaning here".
"""

from __future__ import annotations

import re
import unicodedata
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from .codes import CODES
from .diagnostics import Diagnostic, Diagnostics, nearest
from .grammar import language
from .missing import is_value, leaf_before, missing
from .source import Source, Span
from .vocabulary import UNSUPPORTED_DIRECTIVES

if TYPE_CHECKING:
    from tree_sitter import Node, Query, Tree

    from .parse_values import Reading

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
DEFINITION_WORDS = ("Selection", "Calculation", "Transformation", "Texture", "Parameter")
CLOSERS = {")": "(", "}": "{", "]": "[", ">": "<"}
_CLOSER_OF = {opener: closer for closer, opener in CLOSERS.items()}

DEFINITION = (
    "a definition starts with Selection, Calculation, Transformation, Texture, Parameter, #declare, #include "
    "or a block: camera { … }"
)
RULE = "a rule looks like Name -> operators operand + …;"
STATEMENT = "a statement looks like count = 2; or --count; or trans 0 0 1;"

# What was expected, by the kind of node that an error stands in.
_EXPECTED = {
    "source_file": DEFINITION,
    "selection": "a Selection looks like Selection Name { Name -> …; }",
    "selection_body": RULE,
    "rule": RULE,
    "entry": RULE,
    "calculation": "a Calculation looks like Calculation Name { --count; }",
    "transformation": "a Transformation looks like Transformation Name { trans 0 0 1; }",
    "statements": STATEMENT,
    "block_body": "a block holds names, values and blocks: camera { location <0, 1, 2> }",
    "guard": "a condition looks like if (count > 0 && height < 2)",
    "vector": "a vector looks like <x, y, z>, with a comma between two values",
    "call": "a call looks like max(a, b), with a comma between two values",
    "range": "a range looks like [0 to 20]",
    "parameter": 'a Parameter looks like Parameter age = 10 [0 to 20] "Years";',
    "parameters": "parameters look like Branch(length, width)",
    "declare": "a declaration looks like #declare Bark = texture { … }",
    "include": 'an include looks like #include "forest.plsys"',
}

# Patterns are compiled when something went wrong: most texts are right.
# What may stand outside of strings and comments.
_KNOWN = r"[A-Za-z0-9_\s\"#%()*+,\-./:;<=>?\[\]{}!&|→\u00C0-\u1FFF\u2C00-\uD7FF]"

# So far is looked for the end of a block without a name.
MAX_BLOCK_BYTES = 1 << 16

# Strings and comments inside broken text, of which only the rest is judged.
_MASKED = r'(?s)"[^"\r\n]*"|//[^\r\n]*|/\*.*?\*/'

_OPERATOR = r"(?!\+\+|--)[-+*/%=<>!&|?]+"

# Habits from other languages: the text that went wrong → message and hint.
_HABITS = (
    (r"\*/", "this '*/' ends no comment", "comments don't nest: the first */ ended it"),
    (r"\^", "'^' is no operator", "write pow(a, b)"),
    (r"\band\b", "'and' is no operator", "write &&"),
    (r"\bor\b", "'or' is no operator", "write ||"),
    (r"\bnot\b", "'not' is no operator", "write !"),
    (r"(?<![&])&(?!&)", "'&' is no operator", "write &&"),
    ("[−–—]", "this dash is not the minus sign", "write -"),
    ("[“”„«»]|'", "this is not the quotation mark of a text", 'write "'),
)

# What stands in an operation's arguments only with brackets round it.
COMPARISON = re.compile(r"[=!<>]=|[<>?]|&&|\|\|")
IN_BRACKETS = (
    "in an operation's arguments, what compares or chooses stands in brackets: scale (n > 2 ? 1 : 0.5)"
)

# Directives: what to do instead.
_INSTEAD = {
    "while": "a Selection repeats: Selection Row { if (n > 0) Row -> …; }",
    "for": "a Selection repeats: Selection Row { if (n > 0) Row -> …; }",
    "macro": "a Selection with parameters is plsys' macro: Selection Leaf(size) { Leaf(size) -> …; }",
    "if": "a Selection chooses: if (n > 0) A -> …; else A -> …;",
    "switch": "a Selection chooses: if (n > 0) A -> …; else A -> …;",
    "define": "#declare Name = … gives a value a name",
}
_CONTINUING = ("else", "elseif", "end", "case", "range", "break")
_DIRECTIVES = ("declare", "include")


def clean(source: Source, diagnostics: Diagnostics) -> bytes:
    """The bytes to parse: like the source's, but with spaces for a byte order mark, for NUL bytes and for
    bytes that aren't UTF-8 (both reported, at the first one), so that every offset stays what it is."""
    data = source.data
    if data.startswith(BYTE_ORDER_MARK):
        data = b"   " + data[len(BYTE_ORDER_MARK) :]
    try:
        data.decode()
    except UnicodeDecodeError as error:
        span = Span(source, error.start, error.start + 1)
        message = f"the byte 0x{data[error.start]:02x} is not UTF-8 text"
        diagnostics.add("encoding", span, message, "save the file as UTF-8")
        escaped = data.decode(errors="surrogateescape")
        data = re.sub("[\udc80-\udcff]", " ", escaped).encode()
    if b"\0" in data:
        at = data.index(b"\0")
        hint = "remove it, or is this not a text file?"
        diagnostics.add("encoding", Span(source, at, at + 1), "a NUL byte stands in the text", hint)
        data = data.replace(b"\0", b" ")
    return data


@cache
def _directive_query() -> Query:
    from tree_sitter import Query

    return Query(language(), "(directive) @directive")


def _directives(tree: Tree) -> list[Node]:
    from tree_sitter import QueryCursor

    found = QueryCursor(_directive_query()).captures(tree.root_node)
    return sorted(found.get("directive", []), key=lambda node: node.start_byte)


def extras(reading: Reading, tree: Tree) -> None:
    """Report what may stand anywhere: a comment that the end of the file cuts off, and unknown directives."""
    directives = _directives(tree) if b"#" in reading.data else []
    if directives:
        # What follows a directive in its line may be its arguments.
        rows = {reading.span(node).start_position.line: node.end_byte for node in reversed(directives)}
        items = reading.diagnostics.items
        items[:] = [
            item
            for item in items
            if item.span.start < rows.get(item.span.start_position.line, item.span.start + 1)
        ]
    for i, node in enumerate(directives):
        _directive(reading, node, i > 0)
    last = tree.root_node if b"/*" in reading.data else None
    while last is not None and last.type != "comment":
        last = last.children[-1] if last.children else None
    if last is not None and _is_unclosed_comment(reading.text(last)):
        reading.complain(
            Span(reading.source, last.start_byte, last.start_byte + 2),
            "this comment is never closed",
            "add */ where it ends",
            "unclosed",
        )


def _is_unclosed_comment(text: str) -> bool:
    return text.startswith("/*") and not (len(text) >= 4 and text.endswith("*/"))


def _directive(reading: Reading, node: Node, seen: bool) -> None:
    word = re.match(r"#[ \t]*(\w*)", reading.text(node))
    if seen and word[1] in _CONTINUING:
        return  # belongs to a directive that has been reported
    span = Span(reading.source, node.start_byte, node.start_byte + len(word[0].encode()))
    if not word[1]:
        reading.complain(
            span, "a directive's name is missing after this '#'", "plsys has #declare and #include"
        )
        return
    hint = nearest(f"#{word[1]}", [f"#{each}" for each in _DIRECTIVES])
    hint = hint or _INSTEAD.get(word[1]) or UNSUPPORTED_DIRECTIVES.get(word[1], "plsys has #declare and #include")
    reading.complain(span, f"#{word[1]} isn't supported", hint, "unsupported")


class Break(NamedTuple):
    """Where a definition stops following the grammar."""

    diagnostic: Diagnostic
    is_gap: bool  # one token is missing, and all others are where they belong


def first_error(reading: Reading, node: Node, end: int | None = None) -> Break | None:
    """The first place in ``node`` (before the byte ``end``) where the text doesn't follow the grammar."""
    broken = _first_broken(node)
    if broken is None or (end is not None and broken.start_byte >= end):
        return None
    if broken.is_missing:
        return Break(_missing(reading, broken, leaf_before(node, broken.start_byte)), True)
    return Break(unexpected(reading, broken), False)


def _first_broken(node: Node) -> Node | None:
    while not (node.is_error or node.is_missing):
        node = next((child for child in node.children if child.has_error or child.is_missing), None)
        if node is None:
            return None
    return node


def _diagnostic(code: str, span: Span, message: str, hint: str) -> Diagnostic:
    return Diagnostic(code, CODES[code].severity, message, span, hint)


def _missing(reading: Reading, node: Node, before: Node | None) -> Diagnostic:
    """The message for a token that tree-sitter put in after the leaf ``before``."""
    parent = node.parent
    if node.type in CLOSERS:
        opener = next((child for child in parent.children if child.type == CLOSERS[node.type]), None)
        if opener is not None:
            return never_closed(reading, opener.start_byte, opener.type, node.type)
    found = missing(node, before)
    if found is None:
        what = "a value" if is_value(node) else "a name" if node.type == "name" else f"'{node.type}'"
        found = f"{what} is missing here", _expected(parent)
    end = before.end_byte if before is not None else node.start_byte
    return _diagnostic("missing", reading.after(end), *found)


def never_closed(reading: Reading, offset: int, opener: str, closer: str) -> Diagnostic:
    span = Span(reading.source, offset, offset + len(opener))
    hint = f"add the '{closer}' that belongs to it"
    return _diagnostic("unclosed", span, f"this '{opener}' is never closed", hint)


def _expected(node: Node | None) -> str:
    """What was expected in ``node`` or around it."""
    while node is not None:
        if node.type in _EXPECTED:
            return _EXPECTED[node.type]
        node = node.parent
    return DEFINITION


def unexpected(reading: Reading, node: Node, context: Node | None = None) -> Diagnostic:
    """The message for an ERROR node. ``context`` is the node that it should have become part of."""
    text = re.sub(_MASKED, lambda match: " " * len(match[0].encode()), reading.text(node))
    for pattern, message, hint in _HABITS:
        if match := re.search(pattern, text):
            return _diagnostic("syntax", _part(reading, node, match), message, hint)
    known = re.compile(_KNOWN)
    for match in re.finditer(r".", text):
        if match[0].isspace() and not match[0].isascii():
            message = f"the character U+{ord(match[0]):04X} ({unicodedata.name(match[0], 'white space').lower()}) is no space here"
            span = _part(reading, node, match)
            return Diagnostic("syntax", "error", message, span, "write a plain space", mend=" ")
        if not known.match(match[0]):
            shown = f"'{match[0]}'" if match[0].isprintable() else f"U+{ord(match[0]):04X}"
            message = f"the character {shown} has no meaning here"
            return _diagnostic("syntax", _part(reading, node, match), message, "remove it")
    if (opener := _last_open(text)) >= 0:
        start = node.start_byte + len(text[:opener].encode())
        if text[opener] == "{" and _is_closed(reading, start):
            hint = "a name stands before it: camera { … }, Selection Tree { … }"
            return _diagnostic("syntax", Span(reading.source, start, start + 1), "this '{' begins a block without a name", hint)
        rest = re.match(rb"[^;{}\r\n]*", reading.data[node.end_byte :])[0].decode(errors="replace")
        if _last_open(text[opener:] + rest) == 0:
            return never_closed(reading, start, text[opener], _CLOSER_OF[text[opener]])
    match = re.search(r'"[^"]*"|#?\w+|[^\w\s]+', reading.text(node)) or re.search(r"\s*", text)
    hint = _expected(context or node.parent)
    inside = node.parent.type if node.parent is not None else ""
    if inside in ("operation", "statements") and COMPARISON.fullmatch(match[0]):
        hint = IN_BRACKETS
    span = _part(reading, node, match)
    if re.fullmatch(_OPERATOR, match[0]) and re.match(rb"[ \t]*([;)}\],\r\n]|$)", reading.data[span.end :]):
        return _diagnostic("missing", span, f"nothing stands after this '{match[0]}'", hint)
    return _diagnostic("syntax", span, f"'{match[0][:30]}' is unexpected here", hint)


def _is_closed(reading: Reading, start: int) -> bool:
    """Whether the brace at ``start`` is closed further on."""
    text = re.sub(_MASKED, "", reading.data[start : start + MAX_BLOCK_BYTES].decode(errors="replace"))
    depth = 0
    for brace in re.findall(r"[{}]", text):
        depth += 1 if brace == "{" else -1
        if depth == 0:
            return True
    return False


def _last_open(text: str) -> int:
    """Where the innermost bracket of ``( [ {`` stands that ``text`` opens and doesn't close, or -1."""
    open_brackets: list[int] = []
    for i, character in enumerate(text):
        if character in "([{":
            open_brackets.append(i)
        elif character in ")]}" and open_brackets:
            open_brackets.pop()
    return open_brackets[-1] if open_brackets else -1


def _part(reading: Reading, node: Node, match: re.Match[str]) -> Span:
    """The place of a match in the node's text."""
    start = node.start_byte + len(match.string[: match.start()].encode())
    return Span(reading.source, start, min(start + len(match[0].encode()), len(reading.data)))


def unmatched_bracket(reading: Reading, tree: Tree) -> Diagnostic | None:
    """The innermost bracket that is never closed, for a text of which the parser could make nothing."""
    open_brackets: list[Node] = []
    cursor = tree.walk()
    while True:
        kind = "" if cursor.node.is_missing else cursor.node.type
        if kind in CLOSERS.values():
            open_brackets.append(cursor.node)
        elif kind in CLOSERS and open_brackets and open_brackets[-1].type == CLOSERS[kind]:
            open_brackets.pop()
        if cursor.goto_first_child() or cursor.goto_next_sibling():
            continue
        while cursor.goto_parent():
            if cursor.goto_next_sibling():
                break
        else:
            break
    if not open_brackets:
        return None
    opener = open_brackets[-1]
    return never_closed(reading, opener.start_byte, opener.type, _CLOSER_OF[opener.type])


def unknown_definition(word: str) -> tuple[str, str]:
    """Message and hint for ``Selction Tree { … }``."""
    hint = nearest(word.capitalize(), DEFINITION_WORDS)
    return f"'{word}' defines nothing", hint or "Selection, Calculation, Transformation and Texture do"


def stray_in_block(text: str) -> tuple[str, str]:
    """Message and hint for a token that has no place in a scene block."""
    message = f"'{text}' can't stand in a scene block"
    if text in ("->", "=>"):
        return message, "rules stand in a Selection: Selection Name { Name -> …; }"
    if text in (";", ":", "="):
        return message, "remove it: items stand side by side, camera { angle 45 }"
    return message, "comparisons stand in brackets, statements in a Calculation"
