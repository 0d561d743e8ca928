"""Whole-file checks, as the worker does them: part by part, so that an edit costs the checks of its own part.

Requests with what changed in a scene's files → :class:`Answer`\\ s with messages, insights and the forecast of the parts
that this touched (parts.py). A part may have blocks of several files. What an edit touched comes first, and a request that
waits is looked at after each part, or even in the middle of a forecast: the latest text hardly waits for an older one.

Example::

    work = Work()
    work.take(request)
    work.go_on(answers.append)      # first the messages about what changed, then its forecast, then other parts
"""

from __future__ import annotations

import gc
import pickle
import signal
import time
from _thread import interrupt_main
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, Callable, Iterator

from ..reading.diagnostics import Diagnostic, Diagnostics, PlsysError
from ..reading.model import Empty, Model, SceneObject
from ..reading.resolve_names import _identity
from ..reading.source import Span
from . import telling
from .exchange import Answer, NewBlock, Request
from .facts import drop_facts, facts_of
from .interruption import Interrupted, Interruption
from .keeping import Kept, hand_over
from .parts import Part, Parts, role_of
from .split import Shape
from .text import Block
from .worker import streams

# Messages of resolving that need work which blocks alone don't do: loading meshes.
LATE_CODES = frozenset(("file",))

# How often the worker tells what it has found out about parts that no edit touched.
SLICE_S = 0.2


@dataclass
class Outcome:
    """What is known about a part. ``is_broken``: names in it have no meaning, or it can't be read. ``model`` is None after
    an error or when all is worked out. ``is_news``: more is known than was told."""

    diagnostics: list[Diagnostic]
    is_broken: bool
    model: Model | None
    forecast: Any = None
    insights: Any = None
    is_news: bool = True


@dataclass
class SceneState:
    """A scene as the worker knows it: the blocks of its files by the files' names, the root first. ``request`` is the last
    one about it, and ``fresh`` the parts that it touched."""

    blocks: dict[str, list[Block]] = field(default_factory=dict)
    parts: Parts = field(default_factory=Parts)
    request: Request | None = None
    fresh: list[Part] = field(default_factory=list)
    unsure: set[Part] = field(default_factory=set)  # told without what isn't sure
    partless: set[Block] = field(default_factory=set)  # that were parts of their own; what was said of that has to go
    objects: set[Block] = field(default_factory=set)  # blocks that place something
    including: set[Block] = field(default_factory=set)
    wrong: set[Block] = field(default_factory=set)  # blocks with errors, as far as the server knows
    is_complete: bool = True  # every file that is included was found

    def take(self, request: Request) -> None:
        """Bring the scene up to date."""
        removed, added, before, had_objects = [], [], self.blocks, bool(self.objects)
        self.blocks, self.request = {}, request
        for file in request.files:
            old, new = before.pop(file.name, []), self.blocks.setdefault(file.name, [])
            kept = 0
            for piece in file.pieces:
                if isinstance(piece, NewBlock):
                    new.append(Block(file.name, piece.text, file.path, Shape(False, 0, 0, False)))
                    new[-1].__dict__["role"] = piece.role
                    added.append(new[-1])
                else:
                    removed += old[kept : piece[0]]
                    new += old[piece[0] : piece[1]]
                    kept = piece[1]
            removed += old[kept:]
        self.wrong = {self.blocks[file.name][number] for file in request.files for number in file.wrong}
        removed += [block for blocks in before.values() for block in blocks]
        self.objects = self.objects.difference(removed).union(block for block in added if role_of(block).places)
        self.including = self.including.difference(removed).union(block for block in added if role_of(block).includes)
        parts = set(self.parts)
        if removed or added:
            self.parts.change(removed, added)
            hand_over(parts, self.parts, removed, added)
        alone = {part.blocks[0] for part in parts.difference(self.parts) if len(part.blocks) == 1}
        self.partless = {block for block in self.partless | alone if self.parts.part_of(block) is None}.difference(removed)
        for block in removed:
            block.__dict__["is_gone"] = True
            drop_facts(block)
        if bool(self.objects) is not had_objects:
            for part in self.parts:
                part.outcome = None
        self.fresh = [part for part in self.parts if part not in parts or part in self.parts.touched]
        self.parts.touched.clear()
        if self.parts.base.outcome is None:
            self.fresh.append(self.parts.base)

    def drop(self) -> None:
        """Let go of what was read."""
        for blocks in self.blocks.values():
            for block in blocks:
                block.__dict__["is_gone"] = True
                drop_facts(block)

    def in_order(self) -> dict[Block, int]:
        """The blocks of all files, those of an included file before the block that includes it, with their numbers. Notes
        whether all files were found."""
        files = self.request.files
        by_path = {_identity(file.path): file.name for file in files if file.path is not None}
        found: list[Block] = []
        waiting = {file.name for file in files}
        self.is_complete = True

        def walk(name: str) -> None:
            waiting.discard(name)
            blocks, start = self.blocks[name], 0
            for end in [i for i, block in enumerate(blocks) if block in self.including] if self.including else ():
                found.extend(blocks[start:end])
                start = end
                for node in facts_of(blocks[end]).includes:
                    above = blocks[end].path.parent if blocks[end].path else Path()
                    target = by_path.get(_identity(above / node.path.value))
                    if target is None:
                        self.is_complete = False
                    elif target in waiting:
                        walk(target)
            found.extend(blocks[start:])

        walk(files[0].name)
        found += [block for name in self.blocks if name in waiting for block in self.blocks[name]]
        return dict(zip(found, range(len(found))))

    def places(self) -> dict[Block, tuple[int, int]]:
        """The number of each block's file, and its own number there."""
        files = enumerate(self.blocks[file.name] for file in self.request.files)
        return {block: (number, i) for number, blocks in files for i, block in enumerate(blocks)}


class Work:
    """Checks scenes, the one that was asked about last first; keeps what it found out from one request to the next."""

    def __init__(self) -> None:
        self.scenes: dict[int, SceneState] = {}
        self._due: dict[int, None] = {}  # scenes with parts that are to be checked, the last one first to come
        self.interruption = Interruption()

    def take(self, request: Request) -> None:
        for number in request.forget:
            self._due.pop(number, None)
            if number in self.scenes:
                self.scenes.pop(number).drop()
        self._due.pop(request.scene, None)
        self._due[request.scene] = None
        self.scenes.setdefault(request.scene, SceneState()).take(request)

    @property
    def is_done(self) -> bool:
        return not self._due

    def go_on(self, answer: Callable[[Answer], None], must_pause: Callable[[], bool] = lambda: False) -> None:
        """Check what is due, up to where all is known or, after a part, ``must_pause`` (or the work was interrupted); each
        ``answer`` holds what is known since the one before."""
        while self._due:
            number = next(reversed(self._due))
            if not self._check(self.scenes[number], answer, must_pause):
                return
            del self._due[number]

    def give_up(self) -> Answer:
        """Leave the scene that is being checked until it is asked about again; the answer that says so."""
        number, _ = self._due.popitem()
        return Answer(self.scenes[number].request.key)

    def run(self, request: Request, answer: Callable[[Answer], None]) -> None:
        """Check the scene of ``request`` to the end."""
        self.take(request)
        self.go_on(answer)

    def _check(self, scene: SceneState, answer: Callable[[Answer], None], must_pause: Callable[[], bool]) -> bool:
        """False where something is left."""
        from ..pipeline import deep_nesting

        began = told_at = time.perf_counter()
        new: dict[Part, None] = {}
        is_all_told = is_paused = False
        with deep_nesting(scene.request.files[0].name):
            order, places = scene.in_order(), scene.places()
            for part in _steps(scene, order, self.interruption):
                now = time.perf_counter()
                if part is not None and part.outcome is not None and part.outcome.is_news:
                    new[part] = None
                is_paused = part is not None and must_pause()
                if new and (part is None or is_paused or now - told_at > SLICE_S):
                    found = telling.answer(scene, scene.request, order, places, new)
                    answer(found._replace(share=_share(scene) if now - began > SLICE_S else None))
                    for each in new:
                        each.outcome.is_news = False
                    new, told_at, is_all_told = {}, now, not found.more
                if is_paused:
                    return False
            if not is_all_told:
                answer(telling.answer(scene, scene.request, order, places, new))
        return not any(map(_is_due, scene.parts))


def _steps(scene: SceneState, order: dict[Block, int], interruption: Interruption) -> Iterator[Part | None]:
    """Works out what is due: first of what an edit touched, then of other parts, those that changed last first. Yields each
    part of which more is known (or might be, but for the ``interruption``), and None where it should be told."""
    every = list(scene.parts)
    for parts in (scene.fresh, [every[0], *reversed(every[1:])]):
        for part in parts:
            if part.outcome is None:
                _check(scene, part, order, interruption)
                yield part
        yield None
        for part in parts:
            if part.outcome is not None and part.outcome.model is not None:
                _predict(part.outcome, interruption)
                yield part
        if any(map(_is_due, every)):
            yield None


def _is_due(part: Part) -> bool:
    return part.outcome is None or part.outcome.model is not None


def _share(scene: SceneState) -> float:
    parts = list(scene.parts)
    return 1 - sum(map(_is_due, parts)) / len(parts)


def _check(scene: SceneState, part: Part, order: dict[Block, int], interruption: Interruption) -> None:
    """Work out messages; where most of that is kept, unless interrupted."""
    if part.memory is None:
        part.outcome = _checked(scene, part, order)
        return
    try:
        with interruption.allowed():
            part.outcome = _checked(scene, part, order)
    except Interrupted:
        part.outcome = None


def _checked(scene: SceneState, part: Part, order: dict[Block, int]) -> Outcome:
    from ..reading.check import check

    every = *part.blocks, *scene.parts.needed(part)
    if not scene.wrong.isdisjoint(every) and not any(b"mesh" in block.data for block in every):
        return Outcome([], True, None)  # nothing is said while there are errors, but about mesh files
    blocks = sorted(every, key=order.__getitem__)
    diagnostics, kept = Diagnostics(), part.memory or Kept(None)
    try:
        first = next(iter(scene.blocks.values()))[0]  # the root's: of other files, what nothing uses isn't said
        model = kept.resolved(blocks, first, order, diagnostics)
        late = [each for each in diagnostics.items if each.code in LATE_CODES]
        before, is_broken = len(diagnostics.items), diagnostics.has_errors
        if not is_broken:
            if not model.objects and scene.objects:
                # The scene has objects, though this part has none.
                model.objects.append(SceneObject("", 0, Empty(), Span(first, 0, len(first.data))))
            check(model, diagnostics, kept.answers)
            kept.answers.end_round()
    except (PlsysError, RecursionError):
        return Outcome([], True, None)  # a limit of the compiler's that `plsys check` reports
    found = [*late, *diagnostics.items[before:]]
    return Outcome(found, is_broken, None if diagnostics.has_errors else model)


def _predict(outcome: Outcome, interruption: Interruption) -> None:
    """Work out forecast and insights, unless interrupted."""
    from ..graph.forecast import forecast
    from ..graph.insights import insights
    from ..pipeline import build_graph

    try:
        with interruption.allowed():
            found = insights(outcome.model)
            outcome.insights = found
            outcome.forecast = forecast(build_graph(outcome.model, is_verified=False))
    except Interrupted as broken_off:
        outcome.insights, interruption.left = None, broken_off
        return
    except (PlsysError, RecursionError):
        outcome.model, outcome.is_news = None, True
        return
    outcome.model, outcome.is_news = None, True
    outcome.diagnostics += outcome.forecast.diagnostics


# --- the process


def main() -> None:
    """The worker: pickled Requests on standard input → pickled Answers on standard output."""
    stream, output = streams()
    work, requests = Work(), SimpleQueue()

    def read() -> None:
        try:
            while True:
                requests.put(pickle.load(stream))
                interrupt_main(signal.SIGINT)
        except EOFError:
            requests.put(None)

    def interrupt(*_: object) -> None:
        if has_news():  # and hasn't been taken before the signal came
            work.interruption.interrupt()

    def has_news() -> bool:
        return not requests.empty()

    signal.signal(signal.SIGINT, interrupt)
    work.interruption.has_news = has_news

    def send(answer: Answer) -> None:
        for piece in telling.in_pieces(answer):
            output.write(pickle.dumps(piece))
            output.flush()
        work.interruption.left = None
        _tidy()

    gc.disable()
    Thread(target=read, daemon=True).start()
    _load()
    while True:
        while work.is_done or not requests.empty():
            request = requests.get()
            if request is None:
                return
            work.take(request)
        try:
            work.go_on(send, has_news)
        except Exception:  # a mistake of ours must not end all checks
            send(work.give_up())


def _tidy() -> None:
    """Search for garbage in cycles among what is new since the last answer; the rest, of a large scene, is many objects that
    stay and takes a quarter of a second. (What blocks and their facts say of each other, facts.drop_facts takes apart.)"""
    gc.collect(0)
    gc.freeze()


def _load() -> None:
    """Load what checks need, before the first one is asked for."""
    from .. import pipeline  # noqa: F401
    from ..graph import forecast, insights, lower, passes  # noqa: F401
    from ..reading import check, resolve  # noqa: F401
