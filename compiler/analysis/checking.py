"""Whole-file checks, as the worker does them: part by part, so that an edit costs the checks of its own part.

Requests with what changed in a scene's text → :class:`Answer`\\ s with messages, insights and the forecast of the parts
that this touched (parts.py). A scene that includes others is one part.

Example::

    Work().run(request, answers.append)     # first the messages, then also what takes longer
"""

from __future__ import annotations

import os
import pickle
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Callable, Iterable, Iterator, NamedTuple

from ..reading import syntax
from ..reading.diagnostics import Diagnostic, Diagnostics, PlsysError
from ..reading.model import Empty, Model, SceneObject
from ..reading.source import Source, Span
from .facts import facts_of
from .insights import Placed, placed
from .parts import Part, Parts
from .split import Shape
from .text import Block

# Messages of resolving that need work which blocks alone don't do: loading meshes.
LATE_CODES = frozenset(("file",))

# After so long the worker looks whether the text has changed.
SLICE_S = 0.2

# Said once of a scene, not of each part.
_MISSING = frozenset(("no-camera", "no-object", "no-light"))

# What isn't sure while a block that can't be read may hold a use.
_UNSURE = frozenset(("unused", "unreachable"))


class FileText(NamedTuple):
    """A file of a snapshot: the first ``start`` and the last ``end`` blocks are those of the last request; ``blocks``
    are the texts of those in between."""

    name: str
    path: Path | None
    start: int
    end: int
    blocks: tuple[bytes, ...]


class Request(NamedTuple):
    """What the worker gets: the scene's root first, then included files."""

    key: int
    scene: int
    files: tuple[FileText, ...]


class Finding(NamedTuple):
    """A message: in the block with number ``block`` of file ``file``, or with offsets in the whole file where that
    is -1. ``notes`` are (file, block, start, end, message)."""

    file: int
    block: int
    start: int
    end: int
    code: str
    severity: str
    message: str
    hint: str
    notes: tuple[tuple[int, int, int, int, str], ...]


class Answer(NamedTuple):
    """``findings`` are all about ``blocks`` of the root file (None: about all blocks), ``general`` all about what parts
    share. ``forecast`` is None until it is known and where the scene has errors: a dict with the numbers of
    graph.forecast.Forecast; so are ``insights``, what is shown beside the text. ``more``: parts are left to be checked,
    for which another request has to ask."""

    key: int
    blocks: tuple[int, ...] | None
    findings: tuple[Finding, ...]
    general: tuple[Finding, ...]
    forecast: dict[str, Any] | None
    is_last: bool
    insights: tuple[Placed, ...] | None = None
    more: bool = False


@dataclass
class Outcome:
    """What is known about a part. ``is_broken``: names in it have no meaning, or it can't be read. ``model`` is None after
    an error or when all is worked out."""

    diagnostics: list[Diagnostic]
    is_broken: bool
    model: Model | None
    forecast: Any = None
    insights: Any = None


@dataclass
class _Scene:
    """A scene as the worker knows it: the blocks of the root file, the other files' texts."""

    texts: dict[str, list[bytes]] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    parts: Parts = field(default_factory=Parts)
    files: dict[Path, bytes] = field(default_factory=dict)
    unsure: set[Part] = field(default_factory=set)  # told without what isn't sure


class Work:
    """Checks requests; keeps what it found out from one request to the next."""

    def __init__(self) -> None:
        self.scenes: dict[int, _Scene] = {}

    def run(self, request: Request, answer: Callable[[Answer], None], seconds: float | None = None) -> None:
        """Give ``answer`` the messages of the checks, and then also forecasts and insights; of the parts that changed
        last first, and after ``seconds`` of what is done by then (Answer.more)."""
        from ..pipeline import deep_nesting

        deadline = None if seconds is None else time.perf_counter() + seconds
        scene = self.scenes.setdefault(request.scene, _Scene())
        while len(self.scenes) > 8:
            del self.scenes[next(iter(self.scenes))]
        is_whole = self._take(scene, request)
        with deep_nesting(request.files[0].name):
            order = {block: i for i, block in enumerate(scene.blocks)}
            has_objects = any(map(_places, scene.blocks))
            parts = list(scene.parts)
            parts[1:] = reversed(parts[1:])
            told = _Told(request, scene, order, is_whole)
            for part in _until(deadline, [part for part in parts if part.outcome is None]):
                part.outcome = self._checked(scene, part, order, has_objects)
                told.new.add(part)
            answer(told.answer(None, False))
            for part in _until(deadline, [part for part in parts if part.outcome is not None and part.outcome.model is not None]):
                _predict(part.outcome)
                told.new.add(part)
        more = any(part.outcome is None or part.outcome.model is not None for part in parts)
        answer(told.answer(None if more else _total(parts), True)._replace(more=more))

    @staticmethod
    def _take(scene: _Scene, request: Request) -> bool:
        """Bring ``scene`` up to date; whether it can't be taken apart."""
        root = request.files[0]
        old = scene.blocks
        added = [Block(root.name, data, root.path, Shape(False, 0, 0, False)) for data in root.blocks]
        removed = old[root.start : len(old) - root.end]
        scene.blocks = [*old[: root.start], *added, *old[len(old) - root.end :]]
        scene.files = {}
        for file in request.files[1:]:
            known = scene.texts.get(file.name, [])
            scene.texts[file.name] = [*known[: file.start], *file.blocks, *known[len(known) - file.end :]]
            if file.path is not None:
                scene.files[file.path] = b"".join(scene.texts[file.name])
        if any(facts_of(block).includes for block in scene.blocks if b"include" in block.data):
            scene.parts = Parts()
            scene.parts.base.blocks = scene.blocks
            return True
        if scene.parts.base.blocks:
            removed, added, scene.parts = [], scene.blocks, Parts()
        scene.parts.change(removed, added)
        return False

    def _checked(self, scene: _Scene, part: Part, order: dict[Block, int], has_objects: bool) -> Outcome:
        from ..reading.check import check
        from ..reading.resolve import resolve

        blocks = part.blocks
        if blocks is not scene.blocks:
            blocks = sorted((*part.blocks, *scene.parts.needed(part)), key=order.__getitem__)
        diagnostics = Diagnostics()
        definitions: list[syntax.Definition] = []
        for block in blocks:
            facts = facts_of(block)
            diagnostics.items += facts.syntax
            definitions += facts.file.definitions

        def loader(path: Path) -> Source:
            same = (text for known, text in scene.files.items() if known == path or known.resolve() == path.resolve())
            data = next(same, None)
            return Source.read(path) if data is None else Source(str(path), data, path)

        try:
            start = Span(scene.blocks[0], 0, len(scene.blocks[0].data))
            model = resolve(syntax.File(start, tuple(definitions)), diagnostics, loader=loader)
            late = [each for each in diagnostics.items if each.code in LATE_CODES]
            before, is_broken = len(diagnostics.items), diagnostics.has_errors
            if not is_broken:
                if blocks is not scene.blocks and not model.objects and has_objects:
                    # The scene has objects, though this part has none.
                    model.objects.append(SceneObject("", 0, Empty(), start))
                check(model, diagnostics)
        except (PlsysError, RecursionError):
            return Outcome([], True, None)  # a limit of the compiler's that `plsys check` reports
        found = [*late, *diagnostics.items[before:]]
        return Outcome(found, is_broken, None if diagnostics.has_errors else model)


def _until(deadline: float | None, parts: Iterable[Part]) -> Iterator[Part]:
    """One part at least, and more until ``deadline``."""
    for part in parts:
        yield part
        if deadline is not None and time.perf_counter() > deadline:
            return


def _places(block: Block) -> bool:
    from ..reading.resolve_names import OBJECT_BLOCKS

    facts = facts_of(block)
    return any(each.name.name in OBJECT_BLOCKS for each in facts.blocks)


def _predict(outcome: Outcome) -> None:
    """Work out forecast and insights."""
    from ..graph.forecast import forecast
    from ..graph.insights import insights
    from ..pipeline import build_graph

    model, outcome.model = outcome.model, None
    if model is None:
        return
    try:
        outcome.insights = insights(model)
        outcome.forecast = forecast(build_graph(model))
    except (PlsysError, RecursionError):
        return
    outcome.diagnostics += outcome.forecast.diagnostics


def _total(parts: Iterable[Part]) -> dict[str, Any] | None:
    """The forecasts of all parts together; None where one isn't known."""
    found = [part.outcome.forecast for part in parts if part.outcome is not None]
    if None in found:
        return None
    kinds = dict.fromkeys(kind for each in found for kind in each.by_kind)
    bounds = zip(*(each.primitives_range for each in found))
    return {
        "primitives": _sum(each.primitives for each in found),
        "by_kind": {kind: _sum(each.by_kind.get(kind, 0) for each in found) for kind in kinds},
        "primitives_range": tuple(_sum(values) for values in bounds),
        "states": _sum(each.states for each in found),
        "depth": None if any(each.depth is None for each in found) else max((each.depth for each in found), default=0),
        "infinite": any(each.infinite for each in found),
    }


def _sum(values: Iterable[Any]) -> Any:
    values = list(values)
    return None if None in values else sum(values)


class _Told:
    """What an answer says: spans as numbers."""

    def __init__(self, request: Request, scene: _Scene, order: dict[Block, int], is_whole: bool) -> None:
        self.request, self.scene, self.order, self.is_whole = request, scene, order, is_whole
        self.new: set[Part] = set()
        self.parts = list(scene.parts)
        self.files = {str(file.path): number for number, file in enumerate(request.files)}

    def answer(self, forecast: dict[str, Any] | None, is_last: bool) -> Answer:
        scene = self.scene
        outcomes = [part.outcome for part in self.parts if part.outcome is not None]
        is_unsure = any(outcome.is_broken for outcome in outcomes) and not self.is_whole
        scene.unsure.intersection_update([part for part in self.parts if part.outcome is not None])
        told = self.new if is_unsure else self.new | scene.unsure
        scene.unsure = scene.unsure | self.new if is_unsure else set()
        own, general = self._diagnostics(told)
        findings = [each for each in own if not (is_unsure and each.code in _UNSURE)]
        shown = [part.outcome.insights for part in self.new if part.outcome.insights is not None]
        insights = tuple(each for found in shown for each in placed(found, self.of)) if is_last else None
        blocks = None if self.is_whole else tuple(self.order[block] for part in told for block in part.blocks)
        return Answer(
            self.request.key, blocks, tuple(map(self.finding, findings)), tuple(map(self.finding, general)),
            forecast, is_last, insights,
        )  # fmt: skip

    def _diagnostics(self, told: set[Part]) -> tuple[list[Diagnostic], list[Diagnostic]]:
        """Those about the blocks of parts that are told, and all those about what parts share."""
        own: list[Diagnostic] = []
        general: dict[tuple, Diagnostic] = {}
        missing: dict[str, Diagnostic] = {}
        for part in self.parts:
            if part.outcome is None or not part.outcome.diagnostics:
                continue
            blocks = set(part.blocks)
            for each in part.outcome.diagnostics:
                if self.is_whole:
                    own.append(each)
                elif each.code in _MISSING:
                    if part is self.scene.parts.base or each.code == "no-object":
                        missing[each.code] = each
                elif each.span.source not in blocks:
                    general.setdefault((each.code, each.span.source, each.span.start), each)
                elif part in told:
                    own.append(each)
        return own, [*missing.values(), *general.values()]

    def of(self, span: Span) -> tuple[int, int, int, int]:
        number = self.order.get(span.source)
        if number is not None:
            return 0, number, span.start, span.end
        return self.files.get(str(span.source.path), 0), -1, span.start, span.end

    def finding(self, d: Diagnostic) -> Finding:
        notes = tuple((*self.of(note.span), note.message) for note in d.notes)
        return Finding(*self.of(d.span), d.code, d.severity, d.message, d.hint, notes)


# --- the process


def main() -> None:
    """The worker: pickled Requests on standard input → pickled Answers on standard output."""
    try:
        os.nice(5)
    except (AttributeError, OSError):
        pass
    stream: BinaryIO = sys.stdin.buffer
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    work = Work()

    def send(answer: Answer) -> None:
        output.write(pickle.dumps(answer))
        output.flush()

    while True:
        try:
            request = pickle.load(stream)
        except EOFError:
            return
        try:
            work.run(request, send, SLICE_S)
        except Exception:
            send(Answer(request.key, (), (), (), None, True))
