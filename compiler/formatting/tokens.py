"""A syntax tree's leaves as tokens, with what the layout of lines must know about each.

Example: in ``A -> x + y;`` the token ``A`` starts a unit (a rule), and ``+`` stands below the start of ``x`` when a
line breaks before it.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tree_sitter import Node

INDENT = 4

LINE_END = re.compile(rb"\r\n|\n|\r")

# Nodes whose children are units: each of them may stand on a line of its own, one level deeper than the bracket.
CONTAINERS = frozenset(("source_file", "block_body", "map_entry", "selection_body", "statements", "inline"))
_PIECES = frozenset(("guard", "rule", "entry"))


class Role:
    """What a token is: its ``kind`` and that of its ``parent``, which are types of nodes (a comment up to the line's end is
    a ``line_comment``; the opener of a vector such as ``< 1, 2>``, aligned with ``<-1, 2>``, is ``< ``).

    There is one for each pair, so that what follows from the pair is found out once: ``fixed`` has the spaces before the
    tokens that may follow, where nothing else decides how many, as far as found out."""

    def __init__(self, kind: str, parent: str, is_leaf: bool = True) -> None:
        self.kind, self.parent, self.is_leaf = kind, parent, is_leaf
        self.is_comment = kind in ("comment", "line_comment")
        # The sign of a ``binary`` or ``unary`` node.
        self.is_operator = parent in ("binary", "unary") and not kind.isalpha() and not self.is_comment
        in_vector = parent == "vector"
        self.opens = kind in ("{", "[", "(", "< ") or (kind == "<" and in_vector)
        self.closes = kind in ("}", "]", ")") or (kind == ">" and in_vector)
        self.is_bracket = self.opens or self.closes
        self.is_special = kind in ("-", "+", "comment") or (kind == "<" and in_vector)  # see _special
        self.is_container, self.aligns = kind in CONTAINERS, kind in ("union", "rule")
        self.fixed: dict[Role, int] = {}

        self.children: dict[int, Role] = {}  # by the number of a child's type: reading it as text takes longer

    def of_child(self, node: Node) -> Role:
        """The role of a child of such a node, from now on in ``children``."""
        found = self.children[node.kind_id] = _role(node.type, self.kind, not node.is_named)
        return found


@cache
def _role(kind: str, parent: str, is_leaf: bool = True) -> Role:
    return Role(kind, parent, is_leaf)


class Tokens:
    """The tokens as (role, start, end), without white space at the end. ``units`` has the start of each unit and how many
    columns deeper than its container it stands; ``anchors`` the start of each `+` and `|` and that of the operand that it
    aligns with."""

    __slots__ = "items", "units", "anchors"

    def __init__(self) -> None:
        self.items: list[tuple[Role, int, int]] = []
        self.units: dict[int, int] = {}
        self.anchors: dict[int, int] = {}


def tokens_of(root: Node, text: bytes) -> Tokens:
    found = Tokens()
    _walk(root, _role(root.type, "", False), text, found)
    return found


def _walk(node: Node, own: Role, text: bytes, found: Tokens) -> None:
    children, known, is_container, items = node.children, own.children, own.is_container, found.items
    if own.aligns:
        _align(children, found)
    for child in children:
        role = known.get(child.kind_id) or own.of_child(child)
        start = child.start_byte
        if not role.is_leaf:
            if is_container and not role.is_comment:
                found.units[start] = 0
            if child.child_count:
                _walk(child, role, text, found)
                continue
        end = child.end_byte
        if role.is_special:
            role, end = _special(role, start, end, node, text)
        if end > start:
            items.append((role, start, end))
    if own.kind == "selection_body":
        _Guards([child for child in children if child.type in _PIECES], text, found.units).read()


def _align(children: list[Node], found: Tokens) -> None:
    signs = [child for child in children if child.type in ("+", "|")]
    if signs:
        anchor = next((child.start_byte for child in children if child.type in ("term", "alternative")), None)
        found.anchors.update((sign.start_byte, anchor) for sign in signs)


def _special(role: Role, start: int, end: int, parent: Node, text: bytes) -> tuple[Role, int]:
    """Role and end of a token that holds more than its node's type says."""
    kind = role.kind
    if kind == "<":
        if text[end : end + 1] == b" " and not text[parent.end_byte - 2 : parent.end_byte - 1].isspace():
            return _role("< ", role.parent), end
        return role, end
    # The grammar's binary minus between operands that stand side by side has its space with it, and so does a line
    # comment that ends with spaces.
    end = start + len(text[start:end].rstrip())
    if kind == "comment" and text[start + 1] == 0x2F:
        return _role("line_comment", role.parent), end
    return role, end


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
        while True:
            self.units[self.pieces[i].start_byte] = depth
            if self._word(i) != "if":
                return i + 1
            i = self._guarded(i, depth)
            if self._word(i) != "else":
                return i
            self.units[self.pieces[i].start_byte] = depth
            if self._word(i + 1) != "if":
                return self._guarded(i, depth)
            depth = self._depth_after(i, depth)  # an `else if` is no nesting: there may be very many
            i += 1

    def _guarded(self, i: int, depth: int) -> int:
        """Indent what the guard at ``pieces[i]`` is for."""
        if self._word(i + 1) in ("", "else"):
            return i + 1
        return self._production(i + 1, self._depth_after(i, depth))

    def _depth_after(self, i: int, depth: int) -> int:
        between = self.text[self.pieces[i].end_byte : self.pieces[i + 1].start_byte]
        return depth + INDENT if LINE_END.search(between) else depth

    def _word(self, i: int) -> str:
        """How the piece at ``i`` begins if it is a guard: `if` or `else`; `rule` for others, nothing behind the last."""
        if i >= len(self.pieces):
            return ""
        piece = self.pieces[i]
        return "rule" if piece.type != "guard" else "else" if piece.children[0].type == "else" else "if"
