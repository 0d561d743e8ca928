"""The fixtures of the diagnostics: ``tests/cases/diagnostics/<code>.txt``.

A file has sections, each after a line ``==== name``: ``wrong`` is a scene with the code's message, ``messages`` the messages
with that code (rewritten by ``PLSYS_BLESS=1``), ``right`` a scene like it about which nothing is said but that a camera or
light is missing, and ``fix TITLE``, where there is a quick fix, the wrong scene after it. Files that scenes include stand in ``tests/cases/resolve/files``.

Example: ``load("unused").wrong``
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

from plsys.compiler.graph.forecast import forecast
from plsys.compiler.pipeline import build
from plsys.compiler.reading.diagnostics import Diagnostic, SceneError, render
from plsys.compiler.reading.ignore import kept
from plsys.compiler.reading.source import Source

CASES = Path(__file__).resolve().parents[2] / "cases"
FOLDER = CASES / "diagnostics"
SCENE = CASES / "resolve/files/scene.plsys"  # where the scenes seem to stand
DULL = ("no-camera", "no-light", "no-object")
_HEADER = re.compile(r"^==== (.*)\n", re.MULTILINE)


class Fixture(NamedTuple):
    """``fixes`` by the titles of the quick fixes. Texts with ``surrogateescape`` for bytes that aren't UTF-8."""

    code: str
    wrong: str
    messages: str
    right: str
    fixes: dict[str, str]


def load(code: str) -> Fixture:
    text = (FOLDER / f"{code}.txt").read_bytes().decode(errors="surrogateescape")
    parts = _HEADER.split(text)[1:]
    sections = dict(zip(parts[::2], parts[1::2]))
    fixes = {name.removeprefix("fix "): part for name, part in sections.items() if name.startswith("fix ")}
    return Fixture(code, sections["wrong"], sections["messages"], sections["right"], fixes)


def save_messages(code: str, messages: str) -> None:
    """Put ``messages`` into the fixture's file."""
    path = FOLDER / f"{code}.txt"
    text = path.read_bytes().decode(errors="surrogateescape")
    head, rest = text.split("==== messages\n", 1)
    rest = rest[rest.index("==== right\n") :]
    path.write_bytes(f"{head}==== messages\n{messages}{rest}".encode(errors="surrogateescape"))


def save_fixes(code: str, fixes: dict[str, str]) -> None:
    """Put ``fixes`` by title into the fixture's file."""
    path = FOLDER / f"{code}.txt"
    text = path.read_bytes().decode(errors="surrogateescape").split("==== fix ")[0]
    for title, after in fixes.items():
        text += f"==== fix {title}\n{after}"
    path.write_bytes(text.encode(errors="surrogateescape"))


def found(scene: str, patient: bool = False) -> list[Diagnostic]:
    """What `plsys check` says about a scene; the forecast gives up early unless ``patient``."""
    source = Source("scene.plsys", scene.encode(errors="surrogateescape"), SCENE)
    try:
        compilation = build(source)
    except SceneError as error:
        return kept(error.diagnostics)
    prediction = forecast(compilation.graph) if patient else forecast(compilation.graph, 1000, 1000)
    return [*compilation.diagnostics, *kept(prediction.diagnostics)]


def report(scene: str, code: str, patient: bool = False) -> str:
    """The messages with ``code``, as text."""
    text = "".join(render(item) + "\n" for item in found(scene, patient) if item.code == code)
    return text.replace(f"{SCENE.parent}{os.sep}", "")
