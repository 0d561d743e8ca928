"""Expressions: nodes of tree-sitter's tree → nodes of :mod:`syntax`.

The grammar accepts common mistakes; each is explained here, where it is read, and read on as what was
probably meant. What can't be used at all (a gap that tree-sitter filled in) becomes None and is left out by
the caller.

Example::

    reading = Reading(source, clean(source, diagnostics), diagnostics)
    expression(reading, node)       # Binary('*', Name('len'), Number(0.9))
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from . import mistakes, syntax
from .diagnostics import Diagnostics, Note
from .source import Source, Span

if TYPE_CHECKING:
    from collections.abc import Callable

    from tree_sitter import Node

# Brackets, operators, blocks and guards nest no deeper, so that this and all later stages, which recurse with
# up to five frames a level, stay below Python's own limit of 1000.
MAX_DEPTH = 128

_NUMBER = re.compile(r"\d+(\.\d+)?([eE][+-]?\d+)?")
_ESCAPE = re.compile(r"\\(.)")
_ESCAPES = {'"': '"', "\\": "\\", "n": "\n", "t": "\t"}


# How numbers are written elsewhere: pattern, message, hint (empty: to write the number that the last column makes of it).
_MALFORMED: tuple[tuple[re.Pattern[str], str, str, Callable[[re.Match[str]], str] | None], ...] = (
    (
        re.compile(r"\.\d+([eE]\d+)?"),
        "'{0}' lacks a digit before the point",
        "",
        lambda match: f"0{match[0]}",
    ),
    (
        re.compile(r"(\d+)\.([eE]\d+)?"),
        "'{0}' lacks a digit after the point",
        "",
        lambda match: f"{match[1]}.0{match[2] or ''}",
    ),
    (
        re.compile(r"0[xX]([0-9a-fA-F]{1,16})"),
        "'{0}' isn't written in tens",
        "",
        lambda match: str(int(match[1], 16)),
    ),
    (
        re.compile(r"\d+(_\d+)+(\.\d+)?"),
        "'_' can't stand in the number {0}",
        "",
        lambda match: match[0].replace("_", ""),
    ),
    (
        re.compile(r"(\d+(?:\.\d+)?)[fFlLdD]"),
        "'{0}' ends with a letter: all numbers are of one kind",
        "",
        lambda match: match[1],
    ),
    (re.compile(r"(\d+(?:\.\d+)?)deg"), "an angle has no unit: all are degrees", "", lambda match: match[1]),
    (
        re.compile(r"(\d+(?:\.\d+)?)([A-Za-z_]\w*)"),
        "the number {1} touches the name {2}",
        "write {1}*{2} for the product, or a space between two values",
        None,
    ),
    (re.compile(r".*", re.DOTALL), "'{0}' is no number", "a number looks like 2, 0.5 or 1.5e-3", None),
)


class Abandon(Exception):
    """Raised where nothing more can be made of a definition: it is left out, and only this is said of it."""

    def __init__(self, span: Span, message: str, hint: str) -> None:
        self.span, self.message, self.hint = span, message, hint


class TooDeep(Abandon):
    """Brackets, blocks, operators or guards nested deeper than MAX_DEPTH."""

    def __init__(self, span: Span) -> None:
        super().__init__(span, "this is nested too deeply", f"the limit is {MAX_DEPTH} levels")


class Reading:
    """One file being read: its text (the bytes that were parsed), what is said about it, and the shorthands
    that all readers use. ``spans`` get those of all nodes of a syntax tree without mistakes."""

    def __init__(
        self, source: Source, text: bytes, diagnostics: Diagnostics, spans: list[Span] | None = None
    ) -> None:
        self.source, self.data, self.diagnostics = source, text, diagnostics
        self.foreign_names: set[str] = set()
        self.spans: list[Span] = [] if spans is None else spans

    def span(self, node: Node) -> Span:
        return self.between(node.start_byte, node.end_byte)

    def between(self, start: int, end: int) -> Span:
        span = Span(self.source, start, end)
        self.spans.append(span)
        return span

    def text(self, node: Node) -> str:
        return self.data[node.start_byte : node.end_byte].decode(errors="replace")

    def complain(
        self,
        node: Node | Span,
        message: str,
        hint: str = "",
        code: str = "syntax",
        notes: tuple[Note, ...] = (),
        mend: str | None = None,
    ) -> None:
        span = node if isinstance(node, Span) else self.span(node)
        self.diagnostics.add(code, span, message, hint, notes, mend)

    def after(self, offset: int) -> Span:
        """The empty place at ``offset``, for what is missing there."""
        return Span(self.source, offset, offset)

    def need_semicolon(self, node: Node, what: str) -> None:
        """Complain unless ``node`` ends with ';' (or its unclosed string or bracket does)."""
        if self.data[node.end_byte - 1 : node.end_byte] == b";":
            return
        # A stray token where the ';' belongs is a mistake of its own.
        last, following = node, node.next_sibling
        while last.children:
            last = last.children[-1]
        if not is_stray(last) and (following is None or following.type not in ("stray", "ERROR")):
            self.missing_semicolon(node.end_byte, what)

    def missing_semicolon(self, offset: int, what: str) -> None:
        self.complain(self.after(offset), f"missing ';' after {what}", "add ';' here", "missing")

    def need_closer(self, node: Node, opener: str, closer: str) -> bool:
        """Complain unless ``node`` ends with ``closer``; the message points at the opener."""
        if node.children[-1].type == closer and not node.children[-1].is_missing:
            return True
        end = len(self.data) - len(self.data[node.end_byte :].lstrip())
        after = mistakes.COMPARISON.match(self.data[end : end + 2].decode(errors="replace"))
        if opener == "[" and after:
            span = Span(self.source, end, end + len(after[0]))
            self.complain(span, f"'{after[0]}' is unexpected here", mistakes.IN_BRACKETS)
        else:
            self.never_closed(node.start_byte, opener, closer)
        return False

    def never_closed(self, offset: int, opener: str, closer: str) -> None:
        span = Span(self.source, offset, offset + len(opener))
        self.complain(
            span, f"this '{opener}' is never closed", f"add the '{closer}' that belongs to it", "unclosed"
        )


def is_stray(node: Node) -> bool:
    """Whether ``node`` is a token in the wrong place (and not one that tree-sitter put in)."""
    return node.type == "stray" and not node.is_missing


# --- expressions


def expression(reading: Reading, node: Node | None, depth: int = 0) -> syntax.Expression | None:
    """The expression at ``node``, or None where the text has none. Raises TooDeep."""
    if node is None:
        return None
    read = _EXPRESSIONS.get(node.type)
    if read is None:
        return None
    if depth > MAX_DEPTH:
        raise TooDeep(reading.span(node))
    return read(reading, node, depth)


def expressions(reading: Reading, nodes: list[Node], depth: int) -> tuple[syntax.Expression, ...]:
    """All of ``nodes`` that are expressions."""
    found = []
    for node in nodes:
        value = expression(reading, node, depth + 1)
        if value is not None:
            found.append(value)
    return tuple(found)


def name(reading: Reading, node: Node | None) -> syntax.Name:
    """The name at ``node``; an empty one where it is missing (which has been reported)."""
    if node is None:
        return syntax.Name(reading.after(0), "")
    text = reading.text(node)
    if not text.isascii() and text not in reading.foreign_names:
        reading.foreign_names.add(text)
        reading.complain(
            node, f"the name '{text}' has letters outside of A to Z", "use the letters A to Z, digits and '_'"
        )
    return syntax.Name(reading.span(node), text)


def _name(reading: Reading, node: Node, depth: int) -> syntax.Name | None:
    return None if node.is_missing else name(reading, node)


def number(reading: Reading, node: Node, depth: int = 0) -> syntax.Number | None:
    return None if node.is_missing else number_at(reading, reading.span(node))


def number_at(reading: Reading, span: Span) -> syntax.Number:
    """The number that the token at ``span`` is; what is wrong with it is said of this very span."""
    text = reading.data[span.start : span.end].decode(errors="replace")
    if not _NUMBER.fullmatch(text):
        return _malformed_number(reading, span, text)
    value = float(text)
    if math.isinf(value):
        reading.complain(span, f"the number {text} is too large", "the largest is 1.7976931348623157e308")
        value = 0.0
    return syntax.Number(span, value, text)


def _malformed_number(reading: Reading, span: Span, text: str) -> syntax.Number:
    """Explain ``.5``, ``5.``, ``2x`` or ``1.5.2``, and read on with the number at its start."""
    read = text
    for pattern, message, hint, mend in _MALFORMED:
        if match := pattern.fullmatch(text):
            read = mend(match) if mend else text
            parts = match[0], *match.groups()
            hint = hint.format(*parts) or f"write {read}"
            reading.complain(span, message.format(*parts), hint, mend=read if mend else None)
            break
    text = read
    start = _NUMBER.match(text)
    return syntax.Number(span, float(start[0]) if start else 0.0, text)


def string(reading: Reading, node: Node | None, depth: int = 0) -> syntax.String | None:
    """The text between the quotes; ``\\"`` ``\\\\`` ``\\n`` ``\\t`` are escapes, any other backslash is itself."""
    if node is None or node.is_missing:
        return None
    text = reading.text(node)
    if not re.fullmatch(r'"([^"\\]|\\.)*"', text):
        reading.complain(
            node, "this string is never closed", "add '\"' at its end, on the same line", "unclosed"
        )
        text += '"'
    value = _ESCAPE.sub(lambda match: _ESCAPES.get(match[1], match[0]), text[1:-1])
    return syntax.String(reading.span(node), value)


def call(reading: Reading, node: Node, depth: int = 0) -> syntax.Call:
    callee = node.child_by_field_name("name")
    bracket = node.children[1]
    if bracket.start_byte > callee.end_byte:
        text = reading.text(callee)
        reading.complain(
            Span(reading.source, callee.start_byte, bracket.end_byte),
            "a space stands between a function and its bracket",
            f"write {text}(…)",
        )
    need_parenthesis(reading, node, bracket)
    arguments = expressions(reading, node.children_by_field_name("argument"), depth)
    return syntax.Call(reading.span(node), name(reading, callee), arguments)


def need_parenthesis(reading: Reading, node: Node, opener: Node) -> None:
    """Complain unless ``node`` ends with ')'; tree-sitter may have put in a missing one itself."""
    last = node.children[-1]
    if last.type != ")" or last.is_missing:
        reading.never_closed(opener.start_byte, "(", ")")


def _vector(reading: Reading, node: Node, depth: int) -> syntax.Vector:
    last = node.children[-1]
    if last.type != ">" or last.is_missing:
        reading.never_closed(node.start_byte, "<", ">")
    components = expressions(reading, node.named_children, depth)
    if len(components) not in (2, 3, 4, 5, 12) and not node.has_error:
        reading.complain(
            node,
            f"a vector has 2 to 5 components, or a matrix's 12; this one has {len(components)}",
            "write <x, y, z>; a comparison in it stands in brackets",
        )
    return syntax.Vector(reading.span(node), components)


def _parenthesized(reading: Reading, node: Node, depth: int) -> syntax.Expression | None:
    need_parenthesis(reading, node, node.children[0])
    inside = [child for child in node.named_children if child.type in _EXPRESSIONS]
    if len(inside) > 1:
        reading.complain(node.children[0], "a vector stands in angle brackets", "write <x, y, z>")
        return syntax.Vector(reading.span(node), expressions(reading, inside, depth))
    return expression(reading, inside[0], depth + 1) if inside else None


def _unary(reading: Reading, node: Node, depth: int) -> syntax.Unary | None:
    operand = expression(reading, node.child_by_field_name("operand"), depth + 1)
    operator = reading.text(node.children[0]).strip()
    return operand and syntax.Unary(reading.span(node), operator, operand)


def _binary(reading: Reading, node: Node, depth: int) -> syntax.Expression | None:
    """Long sums lean left, so the left spine is walked in a loop."""
    spine = []
    while node.type == "binary":
        spine.append(node)
        node = node.children[0]
    if depth + len(spine) > MAX_DEPTH:
        raise TooDeep(reading.span(spine[0]))
    left = expression(reading, node, depth + len(spine))
    for node in reversed(spine):
        sign = node.children[1]
        operator = reading.text(sign).strip()
        if operator == "=":
            reading.complain(
                sign,
                "'=' assigns a value and can't stand inside an expression",
                "'==' compares",
                "assignment-in-condition",
            )
            operator = "=="
        right = expression(reading, node.children[-1], depth + 1)
        if left is None or right is None:
            return left or right
        left = syntax.Binary(reading.span(node), operator, left, right)
    return left


def _conditional(reading: Reading, node: Node, depth: int) -> syntax.Conditional | None:
    parts = [
        expression(reading, node.child_by_field_name(field), depth + 1)
        for field in ("test", "then", "otherwise")
    ]
    return None if None in parts else syntax.Conditional(reading.span(node), *parts)


_EXPRESSIONS = {
    "number": number,
    "string": string,
    "name": _name,
    "call": call,
    "vector": _vector,
    "unary": _unary,
    "binary": _binary,
    "conditional": _conditional,
    "parenthesized": _parenthesized,
}
