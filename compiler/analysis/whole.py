"""Whole-file checks: what only shows when a scene is looked at together, in a process of its own.

A :class:`Checker` keeps a worker process (checking.py), which runs the compiler's checks and forecast on a snapshot of a
scene; one interpreter can't do that and answer keys in time. The worker is sent only what differs from the snapshot before,
at once: it turns to the latest text as soon as it is done with a part (checking.py).
:func:`run` is the work itself, for tests and tools that have the time.

Example::

    checker = Checker(lambda result: …)          # called in a thread of the checker's
    checker.want(scene)
    checker.go()
    result.apply()                               # on the thread that owns the scene: messages go to their blocks
"""

from __future__ import annotations

import pickle
import queue
import subprocess
import threading
from dataclasses import dataclass
from typing import Callable

from ..reading.diagnostics import Diagnostic, Note
from ..reading.source import Span
from . import worker
from .checking import Work
from .exchange import Answer, FileText, Finding, NewBlock, Request
from .insights import kept
from .parts import role_of
from .scene import Scene
from .text import Block

# The worker keeps what it found out about so many scenes.
MAX_KNOWN = 16


@dataclass
class Snapshot:
    """A scene's text at one moment, with the blocks that messages belong to."""

    scene: Scene
    blocks: list[list[Block]]
    request: Request

    @classmethod
    def of(cls, scene: Scene, number: int, before: Snapshot | None = None) -> Snapshot:
        """``before`` is the last snapshot of the scene that the worker has seen."""
        blocks = [list(document.text.blocks) for document in scene.documents]
        known = dict(zip([file.name for file in before.request.files], before.blocks)) if before is not None else {}
        files = []
        wrong = scene.wrong_blocks()
        for document, several in zip(scene.documents, blocks):
            pieces, order = _pieces(known.get(document.text.name, []), several), document.text.order
            numbers = tuple(order[block] for block in wrong if block in order)
            files.append(FileText(document.text.name, document.path, pieces, numbers))
        return cls(scene, blocks, Request(number, scene.number, tuple(files)))


def _pieces(old: list[Block], new: list[Block]) -> tuple[NewBlock | tuple[int, int], ...]:
    """``new`` as blocks that ``old`` hasn't, and ranges of those that it has."""
    start, end = _same(old, new)
    numbers = {block: i for i, block in enumerate(old[start : len(old) - end], start)}
    pieces: list[NewBlock | tuple[int, int]] = [(0, start)]
    for block in new[start : len(new) - end]:
        number, last = numbers.get(block), pieces[-1]
        if number is None:
            pieces.append(NewBlock(block.data, role_of(block)))
        elif not isinstance(last, NewBlock) and last[1] == number:
            pieces[-1] = last[0], number + 1
        else:
            pieces.append((number, number + 1))
    return *pieces, (len(old) - end, len(old))


def _same(old: list[Block], new: list[Block]) -> tuple[int, int]:
    """How many blocks at the start and at the end are the same."""
    shorter, step = min(len(old), len(new)), 256
    start = next((i for i in range(0, shorter, step) if old[i : i + step] != new[i : i + step]), shorter)
    while start < shorter and old[start] is new[start]:
        start += 1
    end = 0
    while end + step <= shorter - start and old[len(old) - end - step : len(old) - end] == new[len(new) - end - step : len(new) - end]:
        end += step
    while end < shorter - start and old[-1 - end] is new[-1 - end]:
        end += 1
    return start, end


@dataclass
class Result:
    snapshot: Snapshot
    answer: Answer

    def apply(self) -> None:
        """Give the scene its messages; those of blocks that have changed since are dropped."""
        scene, answer = self.snapshot.scene, self.answer
        for file, number in answer.forecast_of:
            scene.insights.pop(self.snapshot.blocks[file][number], None)
        scene.insights.update(kept(answer.insights, self._span))
        if answer.is_piece:
            return
        scene.forecast = answer.forecast or scene.forecast
        for file, number in answer.blocks:
            scene.whole.pop(self.snapshot.blocks[file][number], None)
        scene.general.clear()
        for finding in answer.findings:
            self._keep(finding, scene.whole)
        for finding in answer.general:
            self._keep(finding, scene.general)

    def _keep(self, finding: Finding, table: dict[Block, list[Diagnostic]]) -> None:
        block, span = self._span(*finding[:4])
        if self.snapshot.scene.document_of(block) is not None:
            notes = tuple(Note(self._span(*note[:4])[1], note[4]) for note in finding.notes)
            message = Diagnostic(finding.code, finding.severity, finding.message, span, finding.hint, notes)
            table.setdefault(block, []).append(message)

    def _span(self, file: int, number: int, start: int, end: int) -> tuple[Block, Span]:
        block = self.snapshot.blocks[file][number]
        return block, Span(block, start, end)


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
        self._outbox: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._number = 0
        self._wanted: dict[Scene, None] = {}
        self._sent: dict[Scene, Snapshot] = {}  # what the worker knows
        self._unanswered: dict[int, Snapshot] = {}  # by number: those that answers may still be about
        self._lock = threading.Lock()

    def prepare(self) -> None:
        """Start the worker, before there is something to check."""
        with self._lock:
            self._has_process()

    def want(self, scene: Scene) -> None:
        """Note that ``scene`` has changed; :meth:`go` then checks its latest text."""
        self._wanted[scene] = None

    def go(self) -> None:
        """Send the worker the scenes that were asked for. On the thread that owns the scenes."""
        wanted, self._wanted = [scene for scene in self._wanted if scene.is_alive], {}
        with self._lock:
            for scene in wanted:
                if not self._has_process():
                    return  # editing goes on without these checks
                self._send(scene)

    def _has_process(self) -> bool:
        """Whether the worker runs; where it doesn't, it is started if there is a process to be had."""
        try:
            self._process = self._process or self._start()
        except OSError:
            return False
        return True

    def _send(self, scene: Scene) -> None:
        self._number += 1
        snapshot = Snapshot.of(scene, self._number, self._sent.pop(scene, None))
        gone = [other for other in self._sent if not other.is_alive]
        gone += [other for other in self._sent if other.is_alive][: max(0, len(self._sent) - len(gone) - MAX_KNOWN)]
        for other in gone:
            self._unanswered.pop(self._sent.pop(other).request.key, None)
        snapshot.request = snapshot.request._replace(forget=tuple(other.number for other in gone))
        self._sent[scene] = self._unanswered[self._number] = snapshot
        self._outbox.put(pickle.dumps(snapshot.request))

    @property
    def is_idle(self) -> bool:
        return not self._unanswered and not self._wanted

    def close(self) -> None:
        """End the worker."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            self._outbox.put(None)

    def _start(self) -> subprocess.Popen:
        process, self._outbox = worker.start(Work.__module__), queue.SimpleQueue()
        # The pipe may be full while the worker works.
        threading.Thread(target=self._write, args=(process, self._outbox), daemon=True).start()
        threading.Thread(target=self._read, args=(process,), daemon=True).start()
        return process

    @staticmethod
    def _write(process: subprocess.Popen, outbox: queue.SimpleQueue[bytes | None]) -> None:
        for data in iter(outbox.get, None):
            worker.write(process, data)

    def _read(self, process: subprocess.Popen) -> None:
        for answer in worker.answers(process):
            with self._lock:
                snapshot = self._unanswered.get(answer.key)
                if snapshot is None:
                    continue
                self._answered(snapshot, answer.more)
            self.deliver(Result(snapshot, answer))
        with self._lock:
            if self._process is process:  # it died of a scene; the next one gets another
                self._process = None
                self._outbox.put(None)
                self._sent.clear()
                self._unanswered.clear()

    def _answered(self, snapshot: Snapshot, more: bool) -> None:
        """Of earlier texts of the scene nothing will be said, and of this one not unless there is ``more``."""
        number = snapshot.request.key
        for other in [n for n, each in self._unanswered.items() if each.scene is snapshot.scene]:
            if other < number or (other == number and not more):
                del self._unanswered[other]
