"""A syntax tree's leaves as tokens, with what the layout of lines must know about each.

Example: in ``A -> x + y;`` the token ``A`` starts a unit (a rule), and ``+`` stands below the start of ``x`` when a
line breaks before it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from tree_sitter import Node

INDENT = 4

LINE_END = re.compile(rb"\r\n|\n|\r")

# Nodes whose children are units: each of them may stand on a line of its own, one level deeper than the bracket.
CONTAINERS = frozenset(("source_file", "block_body", "map_entry", "selection_body", "statements", "inline"))
_PIECES = frozenset(("guard", "rule", "entry"))


class Token(NamedTuple):
    """``kind`` and ``parent`` are types of nodes (a comment up to the line's end is a ``line_comment``; the opener of
    a vector such as ``< 1, 2>``, aligned with ``<-1, 2>``, is ``< ``); bytes ``start`` to ``end`` hold no white space at the
    end."""

    kind: str
    parent: str
    start: int
    end: int

    @property
    def is_comment(self) -> bool:
        return self.kind in ("comment", "line_comment")

    @property
    def is_operator(self) -> bool:
        """Whether this is the sign of a ``binary`` or ``unary`` node."""
        return self.parent in ("binary", "unary") and not self.kind.isalpha() and not self.is_comment


@dataclass
class Tokens:
    """``units`` has the start of each unit and how many columns deeper than its container it stands; ``anchors`` the
    start of each `+` and `|` and that of the operand that it aligns with."""

    items: list[Token] = field(default_factory=list)
    units: dict[int, int] = field(default_factory=dict)
    anchors: dict[int, int] = field(default_factory=dict)


def tokens_of(root: Node, text: bytes) -> Tokens:
    found = Tokens()
    _walk(root, root.type, text, found)
    return found


def _walk(node: Node, kind: str, text: bytes, found: Tokens) -> None:
    children = node.children
    if kind in CONTAINERS:
        for child in children:
            if child.is_named and child.type != "comment":
                found.units[child.start_byte] = 0
        if kind == "selection_body":
            _Guards([child for child in children if child.type in _PIECES], text, found.units).read()
    elif kind in ("union", "rule"):
        anchor = next((child.start_byte for child in children if child.type in ("term", "alternative")), None)
        for child in children:
            if child.type in ("+", "|"):
                found.anchors[child.start_byte] = anchor
    for child in children:
        name = child.type
        if child.child_count:
            _walk(child, name, text, found)
        else:
            start, end = child.start_byte, child.end_byte
            # The grammar's binary minus between operands that stand side by side has its space with it, and so does a
            # line comment that ends with spaces.
            if name in ("-", "+") or name == "comment":
                end = start + len(text[start:end].rstrip())
            if name == "comment" and text[start + 1] == 0x2F:
                name = "line_comment"
            elif (
                name == "<"
                and kind == "vector"
                and text[end : end + 1] == b" "
                and text[node.end_byte - 2] != 0x20
            ):
                name = "< "
            if end > start:
                found.items.append(Token(name, kind, start, end))


class _Guards:
    """Gives rules below a guard their indentation: one level if a line breaks between the two; and `else` that of its
    `if`."""

    def __init__(self, pieces: list[Node], text: bytes, units: dict[int, int]) -> None:
        self.pieces, self.text, self.units = pieces, text, units

    def read(self) -> None:
        i = 0
        while i < len(self.pieces):
            i = self._production(i, 0)

    def _production(self, i: int, depth: int) -> int:
        """Indent the production at ``pieces[i]``; where the next one is."""
        node = self.pieces[i]
        self.units[node.start_byte] = depth
        if node.type != "guard" or node.children[0].type == "else":
            return i + 1
        i = self._guarded(i, depth)
        if i < len(self.pieces) and self._is_else(i):
            self.units[self.pieces[i].start_byte] = depth
            i = self._guarded(i, depth)
        return i

    def _guarded(self, i: int, depth: int) -> int:
        """Indent what the guard at ``pieces[i]`` is for."""
        if i + 1 == len(self.pieces) or self._is_else(i + 1):
            return i + 1
        between = self.text[self.pieces[i].end_byte : self.pieces[i + 1].start_byte]
        return self._production(i + 1, depth + INDENT if LINE_END.search(between) else depth)

    def _is_else(self, i: int) -> bool:
        return self.pieces[i].type == "guard" and self.pieces[i].children[0].type == "else"
