"""What the reader has to say about a scene: one message, one place, one hint.

Every kind of message has a code and a row in :data:`CODES` (severity and a one-line description), so that the
command line, the language server, the documentation and the tests speak of the same thing.

Example::

    diagnostics = Diagnostics()
    diagnostics.add("unknown-name", span, "unknown name 'Tee'", hint="did you mean 'Tree'?")
    print(render(diagnostics.items[0]))
    # scenes/tree.plsys:14:12: error[unknown-name]: unknown name 'Tee'
    #   14 | object { Tee }
    #      |          ^^^
    #      = did you mean 'Tree'?
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Iterable

from .codes import CODES
from .nearest import nearest as nearest
from .records import record
from .source import Source, Span

SEVERITIES = ("error", "warning", "info")


@record
class Note:
    """A second place that explains the first: ``message`` reads well on its own."""

    span: Span
    message: str


@record
class Diagnostic:
    """``mend`` is the text that, in the place of ``span``, surely says what was meant; None where nothing is sure."""

    code: str
    severity: str
    message: str
    span: Span
    hint: str = ""
    notes: tuple[Note, ...] = ()
    mend: str | None = None

    def as_json(self) -> dict:
        """``{path, code, severity, message, line, column, end_line, end_column, hint}``; lines and columns from 1."""
        start, end = self.span.start_position, self.span.end_position
        return {
            "path": self.span.source.name,
            "code": self.code,
            "severity": self.severity,
            "message": self.message,
            "line": start.line,
            "column": start.column,
            "end_line": end.line,
            "end_column": end.column,
            "hint": self.hint,
        }


class PlsysError(Exception):
    """The family of all errors that plsys reports: ``place`` ('file:line:column' or a file) and a reason."""

    def __init__(self, reason: str, place: str = "") -> None:
        super().__init__(f"{place}: {reason}" if place else reason)
        self.reason, self.place = reason, place


class SceneError(PlsysError):
    """A scene that can't be compiled; ``diagnostics`` holds every message, errors first in file order."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        first = next(d for d in self.diagnostics if d.severity == "error")
        super().__init__(first.message, str(first.span))


@dataclass
class Diagnostics:
    """The list that all stages of reading add to."""

    items: list[Diagnostic] = field(default_factory=list)

    def add(
        self,
        code: str,
        span: Span,
        message: str,
        hint: str = "",
        notes: Iterable[Note] = (),
        mend: str | None = None,
    ) -> None:
        """Add a message; its severity is the code's. A code without a row in CODES is a KeyError."""
        self.keep(Diagnostic(code, CODES[code].severity, message, span, hint, tuple(notes), mend))

    def keep(self, diagnostic: Diagnostic) -> None:
        self.items.append(diagnostic)

    @property
    def has_errors(self) -> bool:
        return any(item.severity == "error" for item in self.items)

    def sorted(self) -> list[Diagnostic]:
        return sorted(
            self.items, key=lambda d: (d.span.source.name, d.span.start, SEVERITIES.index(d.severity))
        )


def render(diagnostic: Diagnostic) -> str:
    """The message as the command line prints it: head line, source line with carets, hint, notes."""
    lines = [f"{diagnostic.span}: {diagnostic.severity}[{diagnostic.code}]: {diagnostic.message}"]
    lines += _excerpt(diagnostic.span)
    gutter = " " * (len(str(diagnostic.span.start_position.line)) + 2)
    if diagnostic.hint:
        lines += [f"{gutter} = {line}" for line in diagnostic.hint.splitlines()]
    for note in diagnostic.notes:
        lines += [f"{gutter} = {note.span}: {note.message}", *_excerpt(note.span)]
    return "\n".join(lines)


def excerpt_at(path: str, line: int, column: int) -> list[str]:
    """The source line at a place that isn't a span of ours (the runtime's), with carets under the word there; [] if the
    file can't be read."""
    try:
        source = Source.read(path)
    except OSError:
        return []
    if line > len(source.line_starts):
        return []
    text = source.line_text(line)
    start = source.line_starts[line - 1] + len(text[: column - 1].encode())
    word = re.match(r"\w+|.?", text[column - 1 :])
    return _excerpt(Span(source, start, start + len(word[0].encode())))


# Terminals would obey them.
_CONTROLS = {code: "\ufffd" for code in (*range(32), 127, *range(128, 160)) if chr(code) != "\t"}


def _excerpt(span: Span) -> list[str]:
    (line, column), end = span.start_position, span.end_position
    text = span.source.line_text(line)
    width = max(1, (end.column if end.line == line else len(text) + 1) - column)
    gutter = " " * (len(str(line)) + 2)
    # Tabs stay tabs, so that carets stand under what they mean at any tab width.
    pad = "".join("\t" if c == "\t" else " " for c in text[: column - 1])
    return [f" {line} | {text.translate(_CONTROLS)}", f"{gutter}| {pad}{'^' * width}"]
