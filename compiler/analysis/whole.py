"""Whole-file checks: what only shows when a scene is looked at together, in a process of its own.

A :class:`Checker` keeps a worker process, which runs the compiler's checks and forecast on a snapshot of a scene; one
interpreter can't do that and answer keys in time. Of snapshots that wait, only the latest of each scene is checked.
:func:`run` is the work itself, for tests and tools that have the time.

Example::

    checker = Checker(lambda result: …)          # called in a thread of the checker's
    checker.submit(Snapshot.of(scene, number=1))
    result.apply()                               # on the thread that owns the scene: messages go to their blocks
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Callable, NamedTuple

from ..reading import syntax
from ..reading.diagnostics import Diagnostic, Diagnostics, Note, PlsysError
from ..reading.source import Source, Span
from .facts import facts_of
from .insights import Placed, kept, placed
from .scene import Scene
from .split import Shape
from .text import Block

# Messages of resolving that need work which blocks alone don't do: loading meshes.
LATE_CODES = frozenset(("file",))


class FileText(NamedTuple):
    """A file of a snapshot: its blocks' texts."""

    name: str
    path: Path | None
    blocks: tuple[bytes, ...]


class Request(NamedTuple):
    """What the worker gets: the scene's root first, then included files."""

    key: int
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
    """``findings`` of the checks; ``forecast`` is None until it is known and where the scene has errors: a dict
    with the numbers of graph.forecast.Forecast; so are ``insights``, what is shown beside the text."""

    key: int
    findings: tuple[Finding, ...]
    forecast: dict[str, Any] | None
    is_last: bool
    insights: tuple[Placed, ...] | None = None


@dataclass
class Snapshot:
    """A scene's text at one moment, with the blocks that messages belong to."""

    scene: Scene
    blocks: list[list[Block]]
    request: Request

    @classmethod
    def of(cls, scene: Scene, number: int) -> Snapshot:
        blocks = [list(document.text.blocks) for document in scene.documents]
        files = tuple(
            FileText(document.text.name, document.path, tuple(block.data for block in several))
            for document, several in zip(scene.documents, blocks)
        )
        return cls(scene, blocks, Request(number, files))


@dataclass
class Result:
    snapshot: Snapshot
    answer: Answer

    def apply(self) -> None:
        """Give the scene its messages; those of blocks that have changed since are dropped."""
        scene = self.snapshot.scene
        scene.whole.clear()
        scene.forecast = self.answer.forecast or scene.forecast
        if self.answer.insights is not None:
            scene.insights = kept(self.answer.insights, self._span)
        for finding in self.answer.findings:
            block, span = self._span(*finding[:4])
            if scene.document_of(block) is None:
                continue
            notes = tuple(Note(self._span(*note[:4])[1], note[4]) for note in finding.notes)
            message = Diagnostic(finding.code, finding.severity, finding.message, span, finding.hint, notes)
            scene.whole.setdefault(block, []).append(message)

    def _span(self, file: int, number: int, start: int, end: int) -> tuple[Block, Span]:
        blocks = self.snapshot.blocks[file]
        if number < 0:
            number = 0
            while number < len(blocks) - 1 and start >= len(blocks[number].data):
                start, end = start - len(blocks[number].data), end - len(blocks[number].data)
                number += 1
        return blocks[number], Span(blocks[number], start, end)


# --- the work


class Work:
    """Checks requests; keeps the syntax of blocks from one request to the next."""

    def __init__(self) -> None:
        self.known: dict[tuple[str, bytes], Block] = {}

    def run(self, request: Request, answer: Callable[[Answer], None], is_stale: Callable[[], bool] = lambda: False) -> None:
        """Give ``answer`` the findings of the checks, and again with the forecast unless the request ``is_stale``."""
        from ..pipeline import build_graph, deep_nesting

        findings: tuple[Finding, ...] = ()
        prediction = None
        try:
            with deep_nesting(request.files[0].name):
                blocks = self._blocks(request.files[0])
                model, diagnostics, before = self._model(request, blocks)
                place = _Places(request, blocks)
                late = [d for d in diagnostics.items[:before] if d.code in LATE_CODES]
                findings = tuple(place.finding(d) for d in (*late, *diagnostics.items[before:]))
                if diagnostics.has_errors or is_stale():
                    answer(Answer(request.key, findings, None, True))
                    return
                answer(Answer(request.key, findings, None, False))
                from ..graph.forecast import forecast
                from ..graph.insights import insights

                shown = placed(insights(model), place.of)
                answer(Answer(request.key, findings, None, False, shown))
                prediction = forecast(build_graph(model))
                findings += tuple(place.finding(d) for d in prediction.diagnostics)
        except PlsysError:
            pass  # a limit of the compiler's that `plsys check` reports
        answer(Answer(request.key, findings, _numbers(prediction), True))

    def _blocks(self, file: FileText) -> list[Block]:
        known, blocks, seen = self.known, [], {}
        for data in file.blocks:
            block = known.get((file.name, data))
            if block is None or block in seen:  # the same text twice is two places
                block = Block(file.name, data, file.path, Shape(False, 0, 0, False))
            seen[block] = None
            blocks.append(block)
        self.known = {(file.name, block.data): block for block in blocks}
        return blocks

    @staticmethod
    def _model(request: Request, blocks: list[Block]):
        """The model, all diagnostics, and how many of them the editor has itself."""
        from ..reading.check import check
        from ..reading.resolve import resolve

        diagnostics = Diagnostics()
        definitions: list[syntax.Definition] = []
        for block in blocks:
            facts = facts_of(block)
            diagnostics.items += facts.syntax
            definitions += facts.file.definitions
        texts = {file.path: b"".join(file.blocks) for file in request.files if file.path is not None}

        def loader(path: Path) -> Source:
            data = next((text for known, text in texts.items() if known == path or known.resolve() == path.resolve()), None)
            return Source.read(path) if data is None else Source(str(path), data, path)

        file = syntax.File(Span(blocks[0], 0, len(blocks[0].data)), tuple(definitions))
        model = resolve(file, diagnostics, loader=loader)
        before = len(diagnostics.items)
        if not diagnostics.has_errors:
            check(model, diagnostics)
        return model, diagnostics, before


class _Places:
    """Spans as numbers."""

    def __init__(self, request: Request, blocks: list[Block]) -> None:
        self.numbers = {id(block): number for number, block in enumerate(blocks)}
        self.files = {str(file.path): number for number, file in enumerate(request.files)}

    def of(self, span: Span) -> tuple[int, int, int, int]:
        number = self.numbers.get(id(span.source))
        if number is not None:
            return 0, number, span.start, span.end
        return self.files.get(str(span.source.path), 0), -1, span.start, span.end

    def finding(self, d: Diagnostic) -> Finding:
        notes = tuple((*self.of(note.span), note.message) for note in d.notes)
        return Finding(*self.of(d.span), d.code, d.severity, d.message, d.hint, notes)


def _numbers(prediction) -> dict[str, Any] | None:
    if prediction is None:
        return None
    names = ("primitives", "by_kind", "primitives_range", "states", "depth", "infinite")
    return {name: getattr(prediction, name) for name in names}


def run(scene: Scene) -> None:
    """Check ``scene`` here and now."""
    scene.work()
    snapshot = Snapshot.of(scene, 0)
    Work().run(snapshot.request, lambda answer: Result(snapshot, answer).apply())


# --- the process


class Checker:
    """``deliver`` is called with each Result, in a thread of the checker's."""

    def __init__(self, deliver: Callable[[Result], None]) -> None:
        self.deliver = deliver
        self._process: subprocess.Popen | None = None
        self._number = 0
        self._wanted: dict[Scene, None] = {}
        self._running: Snapshot | None = None
        self._lock = threading.Lock()

    def want(self, scene: Scene) -> None:
        """Note that ``scene`` has changed; :meth:`go` then checks its latest text."""
        self._wanted[scene] = None

    def go(self) -> None:
        """Send the worker a scene that was asked for, unless it is at work. On the thread that owns the scenes."""
        with self._lock:
            if self._running is not None or not self._wanted:
                return
            scene = next(iter(self._wanted))
            del self._wanted[scene]
            self._number += 1
            self._running = snapshot = Snapshot.of(scene, self._number)
        try:
            process = self._process or self._start()
        except OSError:
            return  # no process to be had: editing goes on without these checks
        data = pickle.dumps(snapshot.request)
        # The pipe may be full while the worker works.
        threading.Thread(target=self._write, args=(process, data), daemon=True).start()

    @property
    def is_idle(self) -> bool:
        return self._running is None and not self._wanted

    def close(self) -> None:
        """End the worker."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()

    def _start(self) -> subprocess.Popen:
        command = [sys.executable, "-c", f"from {__name__} import main; main()"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(each for each in sys.path if each)}
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment)
        threading.Thread(target=self._read, args=(self._process,), daemon=True).start()
        return self._process

    @staticmethod
    def _write(process: subprocess.Popen, data: bytes) -> None:
        try:
            process.stdin.write(data)
            process.stdin.flush()
        except (OSError, ValueError):
            pass  # it ended; _read notices

    def _read(self, process: subprocess.Popen) -> None:
        while True:
            try:
                answer: Answer = pickle.load(process.stdout)
            except (EOFError, OSError, pickle.UnpicklingError, ValueError):
                break
            with self._lock:
                snapshot = self._running
                if snapshot is None or answer.key != snapshot.request.key:
                    continue
                if answer.is_last:
                    self._running = None
            self.deliver(Result(snapshot, answer))
        with self._lock:
            if self._process is process:  # it died of a scene; the next one gets another
                self._process = self._running = None


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
            work.run(request, send)
        except Exception:
            send(Answer(request.key, (), None, True))
