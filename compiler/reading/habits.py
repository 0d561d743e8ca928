"""Habits from other languages: where a line doesn't follow the grammar and looks like something known, the one message that
says so, in the place of what the parser stumbled over.

Text and its syntax messages → the messages, sharper. The habits themselves are the table :mod:`habit_rows`; only lines
that have a message already are looked at, so that a habit's pattern never makes an error of what is none.

Example: for ``A -> F[+A];`` the parser says that a bracket holds nothing and that another closes nothing; now it is
"in plsys '[' … ']' doesn't branch", once, at ``[+``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import Iterator

from .codes import CODES
from .diagnostics import Diagnostic, Diagnostics
from .habit_rows import HABITS, Habit
from .source import Source, Span

# So far from a message, to both sides, is looked for what it comes from; and so many messages are looked at.
REACH = 200
MAX_MESSAGES = 100

_CODES = ("syntax", "missing", "unclosed", "assignment-in-condition", "unsupported")
# What the parser says where it stumbles. Other messages know already what they are about.
_VAGUE = re.compile(
    "is unexpected here|can't stand in a|never closed|hold nothing|missing|(?:closes|ends|separates|defines) nothing|nothing stands"
    "|braces don't|don't nest|isn't supported|is no operator|action ends with|has no body|assigns a value|quotation mark"
    "|stands where a rule|in brackets|commas stand between|nothing to act on|no name"
)
_MASKED = re.compile(rb'"[^"\r\n]*"|//[^\r\n]*|/\*.*?(?:\*/|\Z)', re.DOTALL)
# Python's quotient, which hides the statement's end in a comment.
_FLOOR = re.compile(r"[-+*/(=,\s](([\w.]+|\([^()\r\n]*\))//([\w.]+|\([^()\r\n]*\)))[^\r\n]*[;\])}]", re.ASCII)
_LINE_END = re.compile(r"[\r\n]|\Z")
_HEAD = re.compile(
    r"\b(?:Selection|Calculation|Transformation|Parameter|Texture)\b|^(?:#[ \t]*)?\w+", re.MULTILINE
)
_INSIDE = {"Selection": "rules", "Calculation": "statements", "Transformation": "statements"}


@dataclass(frozen=True)
class _Text:
    """A text with a character a byte: ``masked`` has no comments, and nothing but letters in strings."""

    source: Source
    data: bytes
    masked: str

    def context(self, offset: int) -> str:
        """What stands round a place: top, head, rules, statements, parameter or block."""
        found = None
        for found in _HEAD.finditer(self.masked, max(0, self.masked.rfind("\n\n", 0, offset)), offset + 1):
            pass
        if found is None:
            return "top"
        word, between = found[0], self.masked[found.end() : offset]
        is_inside = between.count("{") > between.count("}")
        if "{" in between and not is_inside:
            return "top"
        if word == "Parameter":
            return "parameter"
        if word in _INSIDE:
            return _INSIDE[word] if is_inside else "head"
        return "block" if is_inside else "head" if word == "Texture" else "top"

    def window(self, offset: int) -> tuple[int, int]:
        """Of the line of a place, what is in reach."""
        start = max(self.masked.rfind("\n", 0, offset), self.masked.rfind("\r", 0, offset)) + 1
        end = _LINE_END.search(self.masked, offset)
        assert end is not None
        return max(start, offset - REACH), min(end.start(), offset + REACH)

    def part(self, match: re.Match[str], group: int | str) -> str:
        return self.data[match.start(group) : match.end(group)].decode(errors="replace")


def sharpen(source: Source, data: bytes, diagnostics: Diagnostics) -> None:
    """Put the messages about habits in the place of those that come from them. ``data`` is the text that was parsed."""
    waiting = [item for item in diagnostics.items if item.code in _CODES]
    vague = [item for item in waiting if _VAGUE.search(item.message) and not _is_unclosed_text(item)]
    if not vague:
        return
    masked = _MASKED.sub(_mask, data).decode("latin-1")
    text = _Text(source, data, masked)
    items, gone = diagnostics.items, set()
    for item in vague[:MAX_MESSAGES]:
        found = _habit_at(text, item) if id(item) not in gone else None
        if found is None:
            continue
        message, (start, end) = found
        gone |= {id(each) for each in waiting if start <= each.span.start <= end}
        items.append(message)
    items[:] = [item for item in items if id(item) not in gone]


def _is_unclosed_text(item: Diagnostic) -> bool:
    return item.code == "unclosed" and item.span.text[:1] in ('"', "/")


def _mask(match: re.Match[bytes]) -> bytes:
    if match[0].startswith(b'"'):
        return b'"' + b"_" * (len(match[0]) - 2) + b'"'
    return re.sub(rb"[^\r\n]", b" ", match[0])


@cache
def _habits_in(context: str) -> tuple[dict[int, Habit], frozenset[int], dict[str, list[int]]]:
    """The habits of a context by their numbers, those that need no text, and which need each."""
    habits = {number: habit for number, habit in enumerate(HABITS) if context in habit.where}
    needing: dict[str, list[int]] = {}
    for number, habit in habits.items():
        for need in habit.needs:
            needing.setdefault(need, []).append(number)
    return habits, frozenset(number for number, habit in habits.items() if not habit.needs), needing


def _habits_for(context: str, line: str) -> Iterator[Habit]:
    """The habits that ``line`` may show, in the table's order."""
    habits, always, needing = _habits_in(context)
    found = [number for need, numbers in needing.items() if need in line for number in numbers]
    for number in sorted(always.union(found)):
        yield habits[number]


def _habit_at(text: _Text, item: Diagnostic) -> tuple[Diagnostic, tuple[int, int]] | None:
    """The message for the habit that an item comes from, and from where to where it explains all that is wrong."""
    offset = item.span.start
    context, (low, high) = text.context(offset), text.window(offset)
    is_code, line = context in ("rules", "statements"), text.masked[low:high]
    if is_code and b"//" in text.data and (found := _FLOOR.search(text.data[low:high].decode("latin-1"))):
        span = Span(text.source, low + found.start(1), low + found.end(1))
        mend = f"floor({found[2]}/{found[3]})"
        message = Diagnostic("syntax", "error", "'//' starts a comment", span, f"write {mend}", mend=mend)
        return message, (low, high)
    for habit in _habits_for(context, line):
        for match in habit.pattern.finditer(text.masked, low, high):
            if match.start() <= offset <= match.end():
                end = text.masked.find(";", match.end() - 1, high)
                return _message(text, habit, match), (match.start(), end if end >= 0 else high)
    return None


def _message(text: _Text, habit: Habit, match: re.Match[str]) -> Diagnostic:

    def filled(template: str) -> str:
        return re.sub(r"\\(\d)", lambda number: text.part(match, int(number[1]) or "at").strip(), template)

    mend = habit.mend(text.part(match, "at")) if callable(habit.mend) else habit.mend and filled(habit.mend)
    hint = filled(habit.hint)
    if not hint:
        hint = f"write {mend.strip()}" if mend and mend.strip() else "remove it"
    span = Span(text.source, *match.span("at"))
    return Diagnostic(habit.code, CODES[habit.code].severity, filled(habit.message), span, hint, mend=mend)
