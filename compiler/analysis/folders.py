"""The scenes in an editor's folders that aren't open: which there are, what they define and include.

Folders → :class:`Entry`\\ s, read in a process of its own (a folder may hold more text than an editor can wait for). With
them symbols are found in all files, and a library that is opened is looked at in the scenes that include it.

Example::

    folders = Folders(deliver)              # called with each Found, in a thread
    folders.scan([Path("scenes")])
    folders.take(found)                     # on the thread that owns the folders
    folders.scenes_above(Path("scenes/bark.plsys"))     # [Path("scenes/forest.plsys")]
"""

from __future__ import annotations

import os
import pickle
import threading
import time
from pathlib import Path
from typing import Any, Callable, Iterable, Iterator, NamedTuple, Sequence

from . import worker
from .document import Document

# No folder of scenes has more; a scan of someone's home ends there.
MAX_FILES = 5_000
MAX_FILE_BYTES = 4 << 20
# A library may be part of many scenes; it is looked at in so many.
MAX_SCENES = 8

SUFFIX = ".plsys"
_SKIPPED = frozenset(("node_modules", "build", "dist", "target", "venv", "__pycache__"))

# So often the worker tells what it has found.
TELL_S = 0.2


class Symbol(NamedTuple):
    """A definition: ``before`` is its line's text before the name."""

    name: str
    kind: str
    line: int
    before: bytes


class Entry(NamedTuple):
    path: Path
    symbols: tuple[Symbol, ...]
    includes: tuple[Path, ...]


class Found(NamedTuple):
    """``entries`` are new, ``gone`` are files that are no more; ``done`` of ``total`` files are read."""

    entries: tuple[Entry, ...]
    gone: tuple[Path, ...]
    done: int
    total: int
    is_last: bool


def paths_below(root: Path) -> Iterator[Path]:
    """The scenes of a folder, without hidden folders and those that tools fill."""
    for folder, names, files in os.walk(root):
        names[:] = sorted(name for name in names if not name.startswith(".") and name not in _SKIPPED)
        yield from (Path(folder, name) for name in sorted(files) if name.endswith(SUFFIX))


def entry_of(path: Path) -> Entry | None:
    """What the file at ``path`` defines and includes; None if it can't be read or is too long."""
    try:
        if not path.is_file() or path.stat().st_size > MAX_FILE_BYTES:
            return None
        document = Document(path, path.read_bytes())
    except OSError:
        return None
    symbols = []
    for each in document.outline():
        if each.kind != "block":
            symbols.append(Symbol(each.name, each.kind, *document.text.locate(each.name_start)))
    includes = dict.fromkeys(identity(included) for _, included in document.included_paths())
    return Entry(identity(path), tuple(symbols), tuple(includes))


def read(roots: Iterable[Path], files: Sequence[Path]) -> Iterator[Found]:
    """The entries of ``files`` and of all scenes below ``roots``."""
    waiting = dict.fromkeys(files)
    for path in (path for root in roots for path in paths_below(root)):
        if len(waiting) >= MAX_FILES:
            break
        waiting[path] = None
    entries: list[Entry] = []
    gone: list[Path] = []
    told = time.perf_counter()
    for done, path in enumerate(waiting, 1):
        entry = entry_of(path)
        if entry is not None:
            entries.append(entry)
        else:
            gone.append(identity(path))
        if time.perf_counter() - told > TELL_S:
            yield Found(tuple(entries), tuple(gone), done, len(waiting), False)
            entries, gone, told = [], [], time.perf_counter()
    yield Found(tuple(entries), tuple(gone), len(waiting), len(waiting), True)


def identity(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):
        return path


class Folders:
    """What was found by now. Without ``deliver`` scans are done at once, for tests and tools that have the time."""

    def __init__(self, deliver: Callable[[Found], None] | None = None) -> None:
        self.entries: dict[Path, Entry] = {}
        self._including: dict[Path, dict[Path, None]] = {}
        self._deliver = deliver
        self._jobs: list[tuple[list[Path], list[Path]]] = []
        self._process: Any = None

    # --- reading

    @property
    def is_reading(self) -> bool:
        return self._process is not None or bool(self._jobs)

    def scan(self, roots: Iterable[Path]) -> None:
        self._add(list(roots), [])

    def look_at(self, files: Iterable[Path]) -> None:
        """Files came, changed or went."""
        self._add([], list(files))

    def _add(self, roots: list[Path], files: list[Path]) -> None:
        if not roots and not files:
            return
        if self._deliver is None:
            for found in read(roots, files):
                self.take(found)
            return
        self._jobs.append((roots, files))
        self._next()

    def _next(self) -> None:
        if self._process is None and self._jobs:
            job = self._jobs.pop(0)
            try:
                self._process = worker.start(__name__)
            except OSError:
                self._jobs.clear()  # no process to be had: open files are all there is
                return
            threading.Thread(target=self._listen, args=(self._process, pickle.dumps(job)), daemon=True).start()

    def _listen(self, process: Any, job: bytes) -> None:
        worker.write(process, job)
        is_last = False
        for found in worker.answers(process):
            is_last = found.is_last
            self._deliver(found)
        process.wait()
        if not is_last:
            self._deliver(Found((), (), 0, 0, True))

    def take(self, found: Found) -> None:
        """Keep what was found. On the thread that owns the folders."""
        for path in (*found.gone, *(entry.path for entry in found.entries)):
            old = self.entries.pop(path, None)
            for included in old.includes if old is not None else ():
                self._including[included].pop(path, None)
        for entry in found.entries:
            self.entries[entry.path] = entry
            for included in entry.includes:
                self._including.setdefault(included, {})[entry.path] = None
        if found.is_last:
            self._process = None
            self._next()

    def remove(self, root: Path, others: Iterable[Path]) -> None:
        """The folder ``root`` was closed; what also lies in ``others`` stays."""
        kept = [identity(other) for other in others]
        root = identity(root)
        gone = [path for path in self.entries if root in path.parents and not any(other in path.parents for other in kept)]
        self.take(Found((), tuple(gone), 0, 0, False))

    def close(self) -> None:
        """End the worker."""
        self._jobs.clear()
        if self._process is not None:
            self._process.kill()

    # --- asking

    def scenes_above(self, path: Path, limit: int | None = MAX_SCENES) -> list[Path]:
        """The files that nobody includes and that lead to ``path`` by includes; at most ``limit``."""
        start = identity(path)
        found, seen, queue = [], {start}, [start]
        while queue and (limit is None or len(found) < limit):
            above = self._including.get(queue.pop(0), {})
            for each in above:
                if each not in seen:
                    seen.add(each)
                    queue.append(each)
                    if not self._including.get(each):
                        found.append(each)
        return found[:limit]


def main() -> None:
    """The worker: a pickled (roots, files) on standard input → pickled Founds on standard output."""
    stream, output = worker.streams()
    roots, files = pickle.load(stream)
    for found in read(roots, files):
        output.write(pickle.dumps(found))
        output.flush()
