"""Comments that silence messages: ``// plsys-ignore: code``.

A comment alone on its line speaks of the next line of code, one behind code of its own line; several codes stand with
commas between them. Warnings and infos that begin on that line are dropped; errors can't be ignored, and a code that
doesn't exist is a warning.

Example::

    // plsys-ignore: singular
    Transformation T_stem { matrix 0 0 0  0 0 0  0 0 0.16  0 0 0; }
    kept(diagnostics.sorted())          # without the message about T_stem
"""

from __future__ import annotations

import re
from typing import Iterable, Iterator, NamedTuple

from .codes import CODES
from .diagnostics import Diagnostic, Diagnostics, nearest
from .source import Source, Span

WORD = b"plsys-ignore"
_TOKEN = re.compile(rb'"[^"\r\n]*"?|//[^\r\n]*|/\*.*?(?:\*/|\Z)', re.DOTALL)
_CODES = re.compile(rb"\A/[/*]\s*plsys-ignore\b[ \t]*:?[ \t]*([^\r\n]*?)\s*(?:\*/)?\Z")
_CODE = re.compile(rb"[^\s,]+")


class Ignore(NamedTuple):
    """The bytes ``start`` to ``end`` in which messages may begin that are dropped, and a code (or what was written
    instead of one) with its place."""

    start: int
    end: int
    code: str
    code_start: int
    code_end: int


def ignores(data: bytes) -> list[Ignore]:
    """What the comments in ``data`` say. A comment without a code gives one with the code ''."""
    if WORD not in data:
        return []
    return list(_ignores(data))


def _ignores(data: bytes) -> Iterator[Ignore]:
    comments = [match for match in _TOKEN.finditer(data) if not match[0].startswith(b'"')]
    ends = {match.start(): match.end() for match in comments}
    for match in comments:
        found = _CODES.match(match[0])
        if found is None:
            continue
        start, end = _reach(data, match.start(), match.end(), ends)
        base = match.start()
        codes = list(_CODE.finditer(found[1]))
        for code in codes:
            at = base + found.start(1) + code.start()
            yield Ignore(start, end, code[0].decode(errors="replace"), at, at + len(code[0]))
        if not codes:
            yield Ignore(start, end, "", match.start(), match.end())


def _reach(data: bytes, start: int, end: int, comments: dict[int, int]) -> tuple[int, int]:
    """The line that a comment speaks of: its own, or where it stands alone the next one with something on it."""
    first = max(data.rfind(b"\n", 0, start), data.rfind(b"\r", 0, start)) + 1
    if data[first:start].strip():
        return first, _line_end(data, start)
    at = end
    while at < len(data) and (data[at : at + 1].isspace() or at in comments):
        at = comments.get(at, at + 1)
    return start, _line_end(data, at)


def _line_end(data: bytes, offset: int) -> int:
    found = [at for at in (data.find(b"\n", offset), data.find(b"\r", offset)) if at >= 0]
    return min(found, default=len(data))


def check_ignores(source: Source, data: bytes, diagnostics: Diagnostics) -> None:
    """Report the codes that comments can't mean."""
    for each in ignores(data):
        span = Span(source, each.code_start, each.code_end)
        if not each.code:
            hint = "write the code that a message shows in brackets: // plsys-ignore: unused"
            diagnostics.add("ignore", span, "this comment ignores nothing", hint)
        elif each.code not in CODES:
            hint = nearest(each.code, CODES) or "codes stand in brackets in messages, such as unused"
            diagnostics.add("ignore", span, f"no message has the code '{each.code}'", hint)
        elif CODES[each.code].severity == "error":
            diagnostics.add(
                "ignore", span, f"'{each.code}' is an error: it can't be ignored", "mend it instead"
            )


def is_ignored(code: str, severity: str, offset: int, found: Iterable[Ignore]) -> bool:
    """Whether one of ``found`` speaks of a message that begins at ``offset``."""
    return severity != "error" and any(
        each.code == code and each.start <= offset <= each.end for each in found
    )


def kept(diagnostics: Iterable[Diagnostic]) -> list[Diagnostic]:
    """The messages that no comment silences."""
    known: dict[Source, list[Ignore]] = {}
    found = []
    for each in diagnostics:
        source = each.span.source
        if source not in known:
            known[source] = ignores(source.data)
        if not is_ignored(each.code, each.severity, each.span.start, known[source]):
            found.append(each)
    return found
