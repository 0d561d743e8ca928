"""Tokens → the gaps between them that change: line breaks, indentation, spaces.

Where a line breaks is the author's choice, but for three places: a definition begins a line, a `}` stands alone if
its `{` ends a line, and of several blank lines one is left. A line that

- starts a unit (definition, rule, statement, item) stands one level deeper than the bracket round it;
- starts with `+` or `|` stands so that its operand is below the first one;
- starts with a closer stands below the line of its opener;
- goes on with anything else stands one level deeper than the unit.

Example: ``A->x\\n+y;`` becomes ``A -> x\\n   + y;``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from .spacing import Gap, is_fixed, spaces
from .tokens import INDENT, LINE_END, Token, tokens_of

if TYPE_CHECKING:
    from tree_sitter import Node

BYTE_ORDER_MARK = b"\xef\xbb\xbf"

_BRACKETS = frozenset(("{", "[", "(", "<", "< ", "}", "]", ")", ">"))


class Edit(NamedTuple):
    """Bytes ``start`` to ``end``, which are white space or nothing, become ``data``."""

    start: int
    end: int
    data: bytes


@dataclass(slots=True)
class _Bracket:
    """An open bracket, or (``outermost``) the file: ``line_indent`` is the indentation of its line, ``body`` that of a
    unit in it, ``unit`` that of the line where its last unit starts (None before the first)."""

    line_indent: int
    body: int
    width_after: int = 0
    unit: int | None = None
    breaks: bool = False  # a line breaks after the opener
    is_empty: bool = True


def apply(data: bytes, edits: list[Edit]) -> bytes:
    """``data`` after ``edits``, which are in text order."""
    parts, at = [], 0
    for edit in edits:
        parts += (data[at : edit.start], edit.data)
        at = edit.end
    return b"".join((*parts, data[at:]))


def format_tree(
    text: bytes, root: Node, line_end: bytes = b"\n", is_first: bool = True, is_last: bool = True
) -> list[Edit]:
    """The edits that format ``text``, of which ``root`` is the tree; there must be no syntax error in it. Line breaks that
    are put in are ``line_end``. ``is_first`` and ``is_last`` say whether the text is the file's start and end."""
    return _Layout(text, root, line_end).run(is_first, is_last)


class _Layout:
    """Goes through the tokens once. Most gaps are as they should be and depend on nothing but the two tokens, so the loop
    in ``run`` is short for those."""

    def __init__(self, text: bytes, root: Node, line_end: bytes) -> None:
        self.text, self.line_end = text, line_end
        found = tokens_of(root, text)
        self.tokens, self.units, self.anchors = found.items, found.units, found.anchors
        self.columns = dict.fromkeys(
            found.anchors.values(), 0
        )  # where the operands stand that others align with
        self.open = [_Bracket(0, 0, is_empty=False)]
        self.edits: list[Edit] = []
        self.indent = 0  # of the line that is being laid out
        self.line_start = 0  # where the author's line starts, behind its indentation
        self.shift = 0  # how much further right the line goes than the author's, counted from the indentation

    def run(self, is_first: bool, is_last: bool) -> list[Edit]:
        text, tokens = self.text, self.tokens
        start = len(BYTE_ORDER_MARK) if is_first and text.startswith(BYTE_ORDER_MARK) else 0
        if not tokens:
            if is_first:
                self._put(start, len(text), b"")
            return self.edits
        self.widths = widths = self._widths()
        self.line_start = tokens[0].start
        self._put(start, self.line_start, b"")
        units, columns, before = self.units, self.columns, tokens[0]
        for i, token in enumerate(tokens):
            kind = token.kind
            if i:
                width = widths[i]
                if (
                    width < 0
                    or _FIXED.get((before.kind, before.parent, kind, token.parent)) != width
                    or (kind == "}" and self.open[-1].breaks)
                    or (len(self.open) == 1 and token.start in units)
                ):
                    self._between(i)
            if token.start in units or token.start in columns or kind in _BRACKETS or self.open[-1].is_empty:
                self._enter(i)
            before = token
        self._tail(is_last)
        return self.edits

    def _widths(self) -> list[int]:
        """The width of the gap before each token, and one more: -1 and less for a line break and more of them;
        a tab counts as two."""
        text, widths, end = self.text, [0], self.tokens[0].end
        for token in self.tokens[1:]:
            width = token.start - end
            if width > 1 or (width and text[end] != 0x20):
                breaks = len(LINE_END.findall(text, end, token.start))
                width = -breaks if breaks else max(width, 2)
            widths.append(width)
            end = token.end
        widths.append(1)
        return widths

    # --- gaps

    def _put(self, start: int, end: int, data: bytes) -> None:
        if self.text[start:end] != data:
            self.edits.append(Edit(start, end, data))

    def _tail(self, is_last: bool) -> None:
        end = self.tokens[-1].end
        breaks = len(LINE_END.findall(self.text[end:]))
        self._put(end, len(self.text), self.line_end * (1 if is_last else min(breaks, 2)))

    def _between(self, i: int) -> None:
        """Lay out the gap before the token at ``i``."""
        before, token, width, bracket = self.tokens[i - 1], self.tokens[i], self.widths[i], self.open[-1]
        if width < 0 or self._must_break(before, token, bracket):
            may_be_blank = width < -1 and before.kind not in ("{", "[", "(") and not _closes(token)
            self.indent = self._indentation(i)
            self.line_start, self.shift = token.start, 0
            self._put(
                before.end, token.start, self.line_end * (2 if may_be_blank else 1) + b" " * self.indent
            )
            return
        key = (before.kind, before.parent, token.kind, token.parent)
        comment_follows = i + 1 < len(self.tokens) and self.tokens[i + 1].is_comment
        gap = Gap(
            before,
            token,
            width,
            abs(self.widths[i - 1]),
            abs(self.widths[i + 1]),
            bracket.width_after,
            comment_follows,
        )
        count, may_align = spaces(gap)
        if key not in _FIXED and is_fixed(before, token):
            _FIXED[key] = count
        if may_align and width > 1 and b"\t" not in self.text[before.end : token.start]:
            count = max(count, width - self.shift)
        self.shift += count - (token.start - before.end)
        self._put(before.end, token.start, b" " * count)

    def _must_break(self, before: Token, token: Token, bracket: _Bracket) -> bool:
        if token.kind == "}":
            return bracket.breaks
        return len(self.open) == 1 and token.start in self.units and not before.is_comment

    # --- structure

    def _enter(self, i: int) -> None:
        """Take note of what the token at ``i``, whose place is now known, means for those after it."""
        token, bracket = self.tokens[i], self.open[-1]
        if bracket.is_empty and not token.is_comment:
            bracket.is_empty = False
            bracket.breaks = self.widths[i] < 0
        if token.start in self.units:
            bracket.unit = self.indent
        if token.start in self.columns:
            self.columns[token.start] = self._column(token.start)
        if _closes(token):
            self.open.pop()
        elif (
            token.kind in _BRACKETS and (token.kind != "<" or token.parent == "vector") and token.kind != ">"
        ):
            self.open.append(_Bracket(self.indent, self.indent + INDENT, abs(self.widths[i + 1])))

    def _column(self, start: int) -> int:
        """The column at which what the author has at ``start`` is laid out."""
        line = self.text[self.line_start : start]
        if (broken := max(line.rfind(b"\n"), line.rfind(b"\r"))) >= 0:  # a comment of several lines
            return len(line) - broken - 1
        return self.indent + self.shift + len(line if line.isascii() else line.decode(errors="replace"))

    def _indentation(self, i: int) -> int:
        """The indentation of the token at ``i`` where it begins a line."""
        token, bracket = self.tokens[i], self.open[-1]
        if token.is_comment:
            while token.is_comment:
                i += 1
                if i == len(self.tokens) or _closes(self.tokens[i]):
                    return bracket.body
                token = self.tokens[i]
        if _closes(token):
            return bracket.line_indent
        if token.start in self.anchors:
            return max(0, self.columns[self.anchors[token.start]] - 2)
        if token.start in self.units:
            return bracket.body + self.units[token.start]
        if bracket.unit is None:
            return bracket.body
        return bracket.unit + (0 if token.kind == "{" else INDENT)


def _closes(token: Token) -> bool:
    return token.kind in ("}", "]", ")") or (token.kind == ">" and token.parent == "vector")


# Spaces between two kinds of tokens wherever they meet, as found out so far; at most all pairs of kinds there are.
_FIXED: dict[tuple[str, str, str, str], int] = {}
