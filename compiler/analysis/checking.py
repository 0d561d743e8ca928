"""Whole-file checks, as the worker does them: part by part, so that an edit costs the checks of its own part.

Requests with what changed in a scene's files → :class:`Answer`\\ s with messages, insights and the forecast of the parts
that this touched (parts.py). A part may have blocks of several files.

Example::

    Work().run(request, answers.append)     # first the messages, then also what takes longer
"""

from __future__ import annotations

import pickle
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Iterable, Iterator, NamedTuple

from ..reading import syntax
from ..reading.diagnostics import Diagnostic, Diagnostics, PlsysError
from ..reading.model import Empty, Model, SceneObject
from ..reading.resolve_names import _identity
from ..reading.source import Span
from .facts import facts_of
from .insights import Placed, placed
from .parts import Part, Parts
from .split import Shape
from .text import Block
from .worker import streams

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
    """What the worker gets: the scene's root first, then included files. ``forget`` are scenes that aren't asked about
    again, unless with all their text."""

    key: int
    scene: int
    files: tuple[FileText, ...]
    forget: tuple[int, ...] = ()


class Finding(NamedTuple):
    """A message in the block with number ``block`` of file ``file``. ``notes`` are (file, block, start, end, message)."""

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
    """``findings`` are all about ``blocks`` (file, number), ``general`` all about what parts share. ``forecast`` is None until
    it is known and where the scene has errors: a dict with the numbers of graph.forecast.Forecast. ``insights`` are what
    is shown beside the text of the blocks ``forecast_of``. ``more``: parts are left to be checked, for which another
    request has to ask."""

    key: int
    blocks: tuple[tuple[int, int], ...]
    findings: tuple[Finding, ...]
    general: tuple[Finding, ...]
    forecast: dict[str, Any] | None
    is_last: bool
    insights: tuple[Placed, ...] | None = None
    more: bool = False
    forecast_of: tuple[tuple[int, int], ...] = ()
    share: float = 1.0  # of the parts that are done


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
    """A scene as the worker knows it: the blocks of its files by the files' names, the root first."""

    blocks: dict[str, list[Block]] = field(default_factory=dict)
    parts: Parts = field(default_factory=Parts)
    unsure: set[Part] = field(default_factory=set)  # told without what isn't sure
    has_objects: bool = False
    is_complete: bool = True  # every file that is included was found


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
        for number in request.forget:
            self.scenes.pop(number, None)
        self._take(scene, request)
        with deep_nesting(request.files[0].name):
            places = _places_of(scene, request)
            order = {block: i for i, block in enumerate(_in_reading_order(scene, request))}
            has_objects = any(map(_has_object, order))
            parts = list(scene.parts)
            if has_objects is not scene.has_objects:
                scene.has_objects = has_objects
                for part in parts:
                    part.outcome = None
            parts[1:] = reversed(parts[1:])
            told = _Told(request, scene, places)
            for part in _until(deadline, [part for part in parts if part.outcome is None]):
                part.outcome = self._checked(scene, part, order)
                told.new.add(part)
            answer(told.answer(None, False))
            for part in _until(deadline, [part for part in parts if part.outcome is not None and part.outcome.model is not None]):
                _predict(part.outcome)
                told.new.add(part)
        left = sum(part.outcome is None or part.outcome.model is not None for part in parts)
        last = told.answer(None if left else _total(parts), True)
        answer(last._replace(more=left > 0, share=1 - left / len(parts)))

    @staticmethod
    def _take(scene: _Scene, request: Request) -> None:
        """Bring ``scene`` up to date."""
        removed, added, before = [], [], scene.blocks
        scene.blocks = {}
        for file in request.files:
            old = before.pop(file.name, [])
            new = [Block(file.name, data, file.path, Shape(False, 0, 0, False)) for data in file.blocks]
            removed += old[file.start : len(old) - file.end]
            added += new
            scene.blocks[file.name] = [*old[: file.start], *new, *old[len(old) - file.end :]]
        removed += [block for blocks in before.values() for block in blocks]
        if removed or added:
            scene.parts.change(removed, added)

    def _checked(self, scene: _Scene, part: Part, order: dict[Block, int]) -> Outcome:
        from ..reading.check import check
        from ..reading.resolve import resolve

        blocks = sorted((*part.blocks, *scene.parts.needed(part)), key=order.__getitem__)
        diagnostics = Diagnostics()
        definitions: list[syntax.Definition] = []
        for block in blocks:
            facts = facts_of(block)
            diagnostics.items += facts.syntax
            definitions += [each for each in facts.file.definitions if not isinstance(each, syntax.Include)]
        try:
            first = next(iter(scene.blocks.values()))[0]  # the root's: of other files, what nothing uses isn't said
            start = Span(first, 0, len(first.data))
            model = resolve(syntax.File(start, tuple(definitions)), diagnostics)
            late = [each for each in diagnostics.items if each.code in LATE_CODES]
            before, is_broken = len(diagnostics.items), diagnostics.has_errors
            if not is_broken:
                if not model.objects and scene.has_objects:
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


def _has_object(block: Block) -> bool:
    from ..reading.resolve_names import OBJECT_BLOCKS

    facts = facts_of(block)
    return any(each.name.name in OBJECT_BLOCKS for each in facts.blocks)


def _places_of(scene: _Scene, request: Request) -> dict[Block, tuple[int, int]]:
    """The number of each block's file, and its own number there."""
    files = enumerate(scene.blocks[file.name] for file in request.files)
    return {block: (number, i) for number, blocks in files for i, block in enumerate(blocks)}


def _in_reading_order(scene: _Scene, request: Request) -> list[Block]:
    """The blocks of all files, those of an included file before the block that includes it. Notes whether all were found."""
    by_path = {_identity(file.path): file.name for file in request.files if file.path is not None}
    found: list[Block] = []
    waiting = {file.name for file in request.files}
    scene.is_complete = True

    def walk(name: str) -> None:
        waiting.discard(name)
        for block in scene.blocks[name]:
            for node in facts_of(block).includes if b"include" in block.data else ():
                target = by_path.get(_identity((block.path.parent if block.path else Path()) / node.path.value))
                if target is None:
                    scene.is_complete = False
                elif target in waiting:
                    walk(target)
            found.append(block)

    walk(request.files[0].name)
    return found + [block for name in scene.blocks if name in waiting for block in scene.blocks[name]]


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

    def __init__(self, request: Request, scene: _Scene, places: dict[Block, tuple[int, int]]) -> None:
        self.request, self.scene, self.places = request, scene, places
        self.new: set[Part] = set()
        self.parts = list(scene.parts)

    def answer(self, forecast: dict[str, Any] | None, is_last: bool) -> Answer:
        scene = self.scene
        outcomes = [part.outcome for part in self.parts if part.outcome is not None]
        is_unsure = not scene.is_complete or any(outcome.is_broken for outcome in outcomes)
        scene.unsure.intersection_update([part for part in self.parts if part.outcome is not None])
        told = self.new if is_unsure else self.new | scene.unsure
        scene.unsure = scene.unsure | self.new if is_unsure else set()
        own, general = self._diagnostics(told)
        findings = [each for each in own if not (is_unsure and each.code in _UNSURE)]
        shown = [part for part in self.new if part.outcome.insights is not None] if is_last else []
        insights = tuple(each for part in shown for each in placed(part.outcome.insights, self.of)) if is_last else None
        blocks = tuple(self.places[block] for part in told for block in part.blocks)
        return Answer(
            self.request.key, blocks, tuple(map(self.finding, findings)), tuple(map(self.finding, general)),
            forecast, is_last, insights, forecast_of=tuple(self.places[block] for part in shown for block in part.blocks),
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
                if each.code in _MISSING:
                    if self.scene.is_complete and (part is self.scene.parts.base or each.code == "no-object"):
                        missing[each.code] = each
                elif each.span.source not in blocks:
                    general.setdefault((each.code, each.span.source, each.span.start), each)
                elif part in told:
                    own.append(each)
        return own, [*missing.values(), *general.values()]

    def of(self, span: Span) -> tuple[int, int, int, int]:
        return (*self.places.get(span.source, (0, 0)), span.start, span.end)  # type: ignore[call-overload]

    def finding(self, d: Diagnostic) -> Finding:
        notes = tuple((*self.of(note.span), note.message) for note in d.notes)
        return Finding(*self.of(d.span), d.code, d.severity, d.message, d.hint, notes)


# --- the process


def main() -> None:
    """The worker: pickled Requests on standard input → pickled Answers on standard output."""
    stream, output = streams()
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
