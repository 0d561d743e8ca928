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
from .tokens import INDENT, LINE_END, tokens_of

if TYPE_CHECKING:
    from tree_sitter import Node

BYTE_ORDER_MARK = b"\xef\xbb\xbf"


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
    """Goes through the tokens that something follows from. Most gaps are as they should be and depend on nothing but the two
    tokens, and most tokens mean nothing for those after them: these are left out first."""

    def __init__(self, text: bytes, root: Node, line_end: bytes) -> None:
        self.text, self.line_end = text, line_end
        found = tokens_of(root, text)
        self.roles, self.starts, self.ends = zip(*found.items) if found.items else ((), (), ())
        self.units, self.anchors = found.units, found.anchors
        # where the operands stand that others align with
        self.columns = dict.fromkeys(found.anchors.values(), 0)
        self.open = [_Bracket(0, 0)]
        self.edits: list[Edit] = []
        self.indent = 0  # of the line that is being laid out
        self.line_start = 0  # where the author's line starts, behind its indentation
        self.shift = 0  # how much further right the line goes than the author's, counted from the indentation

    def run(self, is_first: bool, is_last: bool) -> list[Edit]:
        text, roles = self.text, self.roles
        start = len(BYTE_ORDER_MARK) if is_first and text.startswith(BYTE_ORDER_MARK) else 0
        if not roles:
            if is_first:
                self._put(start, len(text), b"")
            return self.edits
        self.widths = widths = self._widths()
        self.line_start = self.starts[0]
        self._put(start, self.line_start, b"")
        marks = {*self.units, *self.columns}
        self._enter(0)
        pairs = zip(range(1, len(roles)), roles, roles[1:], self.starts[1:], widths[1:])
        matter = [
            (i, role, start, is_wrong)
            for i, before, role, start, width in pairs
            if (is_wrong := before.fixed.get(role) != width) or role.is_bracket or start in marks
        ]
        for i, role, start, is_wrong in matter:
            if is_wrong or ((role.closes or len(self.open) == 1) and self._must_break(i)):
                self._between(i)
            if role.is_bracket or start in marks:
                self._enter(i)
        self._tail(is_last)
        return self.edits

    def _widths(self) -> list[int]:
        """The width of the gap before each token, and one more: -1 and less for a line break and more of them;
        a tab counts as two."""
        text = self.text
        gaps = zip(self.ends, self.starts[1:])
        widths = [
            0 if start == end else 1 if start == end + 1 and text[end] == 0x20 else self._width(end, start)
            for end, start in gaps
        ]
        return [0, *widths, 1]

    def _width(self, start: int, end: int) -> int:
        breaks = len(LINE_END.findall(self.text, start, end))
        return -breaks if breaks else max(end - start, 2)

    # --- gaps

    def _put(self, start: int, end: int, data: bytes) -> None:
        if self.text[start:end] != data:
            self.edits.append(Edit(start, end, data))

    def _tail(self, is_last: bool) -> None:
        end = self.ends[-1]
        if self.text[end:] == self.line_end:
            return
        breaks = len(LINE_END.findall(self.text[end:]))
        self._put(end, len(self.text), self.line_end * (1 if is_last else min(breaks, 2)))

    def _between(self, i: int) -> None:
        """Lay out the gap before the token at ``i``."""
        before, role, width, bracket = self.roles[i - 1], self.roles[i], self.widths[i], self.open[-1]
        end, start = self.ends[i - 1], self.starts[i]
        if width < 0 or self._must_break(i):
            may_be_blank = width < -1 and before.kind not in ("{", "[", "(") and not role.closes
            self.indent = self._indentation(i)
            self.line_start, self.shift = start, 0
            self._put(end, start, self.line_end * (2 if may_be_blank else 1) + b" " * self.indent)
            return
        comment_follows = i + 1 < len(self.roles) and self.roles[i + 1].is_comment
        around = abs(self.widths[i - 1]), abs(self.widths[i + 1])
        count, may_align = spaces(Gap(before, role, width, *around, bracket.width_after, comment_follows))
        if role not in before.fixed and is_fixed(before, role):
            before.fixed[role] = count
        if may_align and width > 1 and b"\t" not in self.text[end:start]:
            count = max(count, width - self.shift)
        self.shift += count - (start - end)
        self._put(end, start, b" " * count)

    def _must_break(self, i: int) -> bool:
        if self.roles[i].kind == "}":
            return self.open[-1].breaks
        return len(self.open) == 1 and self.starts[i] in self.units and not self.roles[i - 1].is_comment

    # --- structure

    def _enter(self, i: int) -> None:
        """Take note of what the token at ``i``, whose place is now known, means for those after it."""
        role, start = self.roles[i], self.starts[i]
        if start in self.units:
            self.open[-1].unit = self.indent
        if start in self.columns:
            self.columns[start] = self._column(start)
        if role.closes:
            self.open.pop()
        elif role.opens:
            self.open.append(_Bracket(self.indent, self.indent + INDENT, abs(self.widths[i + 1]), None, self._breaks(i)))

    def _breaks(self, i: int) -> bool:
        """Whether a line breaks between the opener at ``i`` and the first token after it that is no comment."""
        i += 1
        while i < len(self.roles) and self.roles[i].is_comment:
            i += 1
        return self.widths[i] < 0

    def _column(self, start: int) -> int:
        """The column at which what the author has at ``start`` is laid out."""
        line = self.text[self.line_start : start]
        if (broken := max(line.rfind(b"\n"), line.rfind(b"\r"))) >= 0:  # a comment of several lines
            return len(line) - broken - 1
        return self.indent + self.shift + len(line if line.isascii() else line.decode(errors="replace"))

    def _indentation(self, i: int) -> int:
        """The indentation of the token at ``i`` where it begins a line."""
        role, start, bracket = self.roles[i], self.starts[i], self.open[-1]
        while role.is_comment:  # it stands as what follows it
            i += 1
            if i == len(self.roles) or self.roles[i].closes:
                return bracket.body
            role, start = self.roles[i], self.starts[i]
        if role.closes:
            return bracket.line_indent
        if start in self.anchors:
            return max(0, self.columns[self.anchors[start]] - 2)
        if start in self.units:
            return bracket.body + self.units[start]
        if bracket.unit is None:
            return bracket.body
        return bracket.unit + (0 if role.kind == "{" else INDENT)
