"""Quick fixes: a diagnostic → what to do about it, by its code.

:data:`FIXES` is the registry. A row is a pattern that the message (or its hint) has, and a function that makes the
action; one code may have several. A message that brings its mend along needs no row. What every message with a certain hint gets ("did you mean …?", "remove it") stands
in :data:`BY_HINT`.

Example: ``fixes(scene, document, message)`` of "missing ';' after this rule" is ``[Action("Add ';'", …)]``.
"""

from __future__ import annotations

import re
from typing import Callable, Iterator

from ..reading.codes import CODES
from .actions import Action, Spot, TextEdit
from .document import Document, Message
from .fixes_arguments import ARGUMENT_FIXES
from .fixes_scene import SCENE_FIXES
from .fixes_text import HINT_FIXES, TEXT_FIXES, short
from .scene import Scene

# Messages whose first fix is right whatever was meant.
SURE = re.compile(
    r"^missing: missing '(?:;|->|=)'|^assignment-in-condition:"
    r"|^syntax: .*(?:stands where a rule has|stands where a range has|written as two words|condition stands in brackets"
    r"|(?:ends|closes|separates) nothing|can't stand in a scene block|a vector stands in|arguments stand without brackets"
    r"|a space stands between a function)"
)

Found = tuple[str, list[TextEdit]] | None
Fix = Callable[[Spot, re.Match, Message], Found]

FIXES: dict[str, tuple[tuple[str, Fix], ...]] = {
    code: (*TEXT_FIXES.get(code, ()), *SCENE_FIXES.get(code, ()), *ARGUMENT_FIXES.get(code, ()))
    for code in {**TEXT_FIXES, **SCENE_FIXES, **ARGUMENT_FIXES}
}
BY_HINT = HINT_FIXES  # the first, the nearest name, comes before what a code has


def fixes(scene: Scene, document: Document, message: Message) -> Iterator[Action]:
    """The quick fixes of a message; the first one is the likeliest."""
    spot = Spot(scene, document, message.start, message.end)
    found = message.diagnostic
    preferred = True
    seen: set[tuple] = set()
    sources = [
        (found.hint, BY_HINT[:1]),
        (found.message, FIXES.get(found.code, ())),
        (found.hint, BY_HINT[1:]),
    ]
    if found.mend is not None:
        yield _mended(spot, found.mend, message)
        return
    for text, rows in sources:
        for pattern, fix in rows:
            match = re.search(pattern, text)
            made = fix(spot, match, message) if match else None
            if made is None or not made[1] or tuple(made[1]) in seen:
                continue
            seen.add(tuple(made[1]))
            yield Action(made[0], "quickfix", tuple(made[1]), preferred, message)
            preferred = False


def fix_all(scene: Scene, document: Document) -> Iterator[Action]:
    """The one action that does what is sure about all messages; none where nothing is."""
    edits: list[TextEdit] = []
    for message in scene.messages(document):
        found = message.diagnostic
        if found.mend is None and not SURE.search(f"{found.code}: {found.message}"):
            continue
        first = next(fixes(scene, document, message), None)
        if first is not None and not any(_touch(new, old) for new in first.edits for old in edits):
            edits += first.edits
    if edits:
        yield Action("Fix all that is sure", "source.fixAll", tuple(edits))


def _touch(first: TextEdit, second: TextEdit) -> bool:
    return first.document is second.document and first.start <= second.end and second.start <= first.end


def _mended(spot: Spot, mend: str, message: Message) -> Action:
    """The action for a message that brings its mend along."""
    if not mend:
        return Action(
            f"Remove '{spot.text.strip()}'", "quickfix", (spot.cut(spot.start, spot.end),), True, message
        )
    written = mend.strip() or mend
    return Action(f"Write '{short(written)}'", "quickfix", (spot.replace(mend),), True, message)


def ignoring(scene: Scene, document: Document, message: Message) -> Iterator[Action]:
    """The action that silences a warning or info by a comment in the line before."""
    code = message.diagnostic.code
    if CODES[code].severity == "error" or code == "ignore":
        return
    text = document.text
    line = text.line_of(message.start)
    start, written = text.line_start(line), text.line_bytes(line)
    indent = written[: len(written) - len(written.lstrip(b" \t"))].decode()
    edit = TextEdit(document, start, start, f"{indent}// plsys-ignore: {code}\n")
    yield Action(f"Ignore '{code}' in this line", "quickfix", (edit,), False, message)
