"""What ends the resolution of one construct, and what is said of names that other programs have.

Example: ``raise unsupported(name)`` for POV-Ray's ``blob``; ``synonym("cube", ("primitive",))`` is ``"did you mean 'box'?"``.
"""

from __future__ import annotations

from typing import Iterable

from . import syntax, vocabulary
from .diagnostics import Diagnostics, Note
from .source import Span


class Problem(Exception):
    """Ends the resolution of one construct. Without a code it has been reported already."""

    def __init__(
        self,
        code: str = "",
        span: Span | None = None,
        message: str = "",
        hint: str = "",
        notes: Iterable[Note] = (),
        mend: str | None = None,
    ) -> None:
        super().__init__(message)
        self.code, self.span, self.message, self.hint, self.notes = code, span, message, hint, tuple(notes)
        self.mend = mend

    def report(self, diagnostics: Diagnostics) -> None:
        if self.code:
            assert self.span is not None
            diagnostics.add(self.code, self.span, self.message, self.hint, self.notes, self.mend)


_TRUTHS = {"true": "1", "yes": "1", "on": "1", "false": "0", "no": "0", "off": "0"}


def unsupported(name: syntax.Name) -> Problem:
    """What to say of a POV-Ray feature that plsys doesn't have."""
    hint = vocabulary.UNSUPPORTED[name.name]
    mend = _TRUTHS.get(name.name)
    return Problem("unsupported", name.span, f"POV-Ray's '{name.name}' isn't supported", hint, mend=mend)


def truth(name: syntax.Name, wanted: str) -> Problem | None:
    """What to say of True and False, however they are written, where ``wanted`` is needed."""
    number = _TRUTHS.get(name.name.lower())
    if number is None:
        return None
    message = f"unknown name '{name.name}': {wanted} is needed here"
    return Problem("unknown-name", name.span, message, f"write {number}: 0 is false, the rest is true", mend=number)


def synonym(name: str, kinds: tuple[str, ...]) -> str:
    """A hint that names what plsys calls it, where another program's name stands."""
    ours = vocabulary.SYNONYMS.get(name.lower(), "")
    return f"did you mean '{ours}'?" if ours and vocabulary.kind_of(ours) in kinds else ""
