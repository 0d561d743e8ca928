"""What follows from edits: diagnostics, whole-file checks, and what workers found, told to the client when no message waits.

Documents that changed → notifications and requests to the client. It knows no message from the client (session.py does).

Example::

    class Session(Updates): …           # with ``notify`` and ``ask``
    session._edited(document)
    while session.has_work:
        session.update()                # a slice of the work
    session.start_checks()              # the client has paused
"""

from __future__ import annotations

import time
from collections import deque
from itertools import chain
from typing import Any, Callable, Iterator

from plsys.compiler.analysis import Checker, Deadline, Document, Found, Result, preparing_format

from .progress import Progress
from .workspace import Workspace

# How long update() may go on before waiting messages are looked at, and how often diagnostics are published while it isn't
# done; in seconds of processor time, so that a busy machine doesn't change what is published. After an edit the first ones
# are published at once; after opening a file, those of the first slice would be a part of those of a short file.
SLICE = 0.004
PUBLISH_S = 0.1


class Updates:
    """With ``wake``, whole-file checks run in a process of their own; it is called, in any thread, when their results wait for
    update(). ``is_message_waiting`` breaks off what update() does. ``client`` are the client's capabilities."""

    def __init__(self, wake: Callable[[], None] | None, is_message_waiting: Callable[[], bool]) -> None:
        self._wake, self._is_message_waiting = wake, is_message_waiting
        self._arrived: deque[Callable[[], None]] = deque()  # what workers found, to be taken in
        self._checker = Checker(lambda result: self._later(self._take, result)) if wake is not None else None
        self.workspace = Workspace()
        self.client: dict[str, Any] = {}
        self.progress = Progress(self.ask, self.notify, self.client)
        self._changed: dict[Document, None] = {}  # open documents whose diagnostics may be out of date
        self._published: dict[str, tuple[int | None, list[dict]]] = {}
        self._published_at: dict[Document, float] = {}  # of those with work left
        self._has_opened = False  # a file was opened that the checks don't know yet
        self._preparing: Iterator[None] = iter(())  # the steps that are left of what is prepared

    def notify(self, method: str, params: Any) -> None:
        raise NotImplementedError

    def ask(self, method: str, params: Any = None, then: Callable[[dict], None] | None = None) -> None:
        """Send the client a request; ``then`` gets the answer's message."""
        raise NotImplementedError

    def _refresh(self, what: str, capability: str) -> None:
        """Have the client ask again for what it shows, if it can."""
        if ((self.client.get("workspace") or {}).get(capability) or {}).get("refreshSupport"):
            self.ask(f"workspace/{what}/refresh")

    # --- what has changed

    def _opened(self, document: Document) -> None:
        self._published_at[document] = time.thread_time()
        self._has_opened = True
        self._touch(document)

    def _edited(self, document: Document) -> None:
        self._published_at.pop(document, None)
        self._touch(document)

    def _closed(self, document: Document | None, uri: str) -> None:
        if document is not None:
            self._changed.pop(document, None)
            self._preparing = iter(())  # it would keep what is known of the document
            self._touch_all()
        if self._published.pop(uri, (None, []))[1]:
            self.notify("textDocument/publishDiagnostics", {"uri": uri, "diagnostics": []})

    def _touch(self, document: Document) -> None:
        """Remember that ``document`` and those that share a scene with it need new diagnostics."""
        self._changed[document] = None
        self._preparing = chain.from_iterable(preparing_format(each) for each in list(self.workspace.uris))
        for scene in document.scenes:
            if self._checker is not None:
                self._checker.want(scene)
            for other in scene.documents:
                if other in self.workspace.uris:
                    self._changed[other] = None

    def _touch_all(self) -> None:
        for document in self.workspace.uris:
            self._touch(document)

    # --- work

    @property
    def has_work(self) -> bool:
        return bool(self._changed or self._arrived) or self.workspace.is_opening

    def update(self) -> bool:
        """Read and resolve for a moment what edits touched, and publish what is known. False: a message has come first."""
        if self._arrived:
            self._arrived.popleft()()  # one at a time: a message may come
        finished = self.workspace.project.work(Deadline(SLICE, self._is_message_waiting))
        if not finished and self._is_message_waiting():
            return False  # what is known now is about to be out of date
        documents, now = self._with_neighbours(), time.thread_time()
        if finished:
            self._changed.clear()
        if not self._pulls_diagnostics:
            for document in documents:
                if finished or now - self._published_at.get(document, -PUBLISH_S) >= PUBLISH_S:
                    self._publish(document)
                    self._published_at[document] = now
        if finished:
            self._published_at.clear()
        if self._has_opened and not self.workspace.is_opening and self._checker is not None:
            self._has_opened = False
            self._checker.go()  # before anything is typed: the worker has a lot to read
        return True

    @property
    def _pulls_diagnostics(self) -> bool:
        """Whether the client asks for diagnostics itself."""
        return (self.client.get("textDocument") or {}).get("diagnostic") is not None

    def _with_neighbours(self) -> list[Document]:
        """The open documents that changed or are in a scene with one that did: an edit may have changed which."""
        found = dict(self._changed)
        for document in self._changed:
            for scene in document.scenes:
                found.update((other, None) for other in scene.documents if other in self.workspace.uris)
        return list(found)

    def start_checks(self) -> None:
        """Have what changed checked as a whole. To be called when the client has paused."""
        if self._checker is not None and not self._changed:
            self._checker.go()
            if self._checker.is_idle:
                self.progress.end("checks")

    def prepare(self) -> bool:
        """Do for a moment what a request would have to wait for; whether nothing is left of that. To be called when nothing else
        is to do."""
        deadline = Deadline(SLICE, lambda: self._is_message_waiting() or bool(self._arrived))
        return not any(deadline.has_passed() for _ in self._preparing)

    def _later(self, take: Callable[[Any], None], what: Any) -> None:
        """Have ``update`` take in what a worker found. In any thread."""
        self._arrived.append(lambda: take(what))
        self._wake()

    def _take_found(self, found: Found) -> None:
        """Something was found in the folders: other scenes may include what is open."""
        self.workspace.take(found)
        if found.is_last and not self.workspace.scans.is_reading:
            self.progress.end("scan")
        elif found.total:
            said = f"{found.done:,} of {found.total:,} files"
            self.progress.report("scan", "Reading scenes", said, 100 * found.done // found.total)
        self._touch_all()

    def _take(self, result: Result) -> None:
        """Show what the whole-file checks found."""
        result.apply()
        if result.answer.is_piece:
            return
        if not result.answer.more:
            self.progress.end("checks")
        elif result.answer.share is not None:
            name = result.snapshot.scene.root.text.name.rpartition("/")[2]
            self.progress.report("checks", "Checking", name, int(100 * result.answer.share))
        for document in result.snapshot.scene.documents:
            if document in self.workspace.uris:
                self._changed[document] = None
        if self._pulls_diagnostics:
            self._refresh("diagnostic", "diagnostics")
        if result.answer.insights or not result.answer.more:
            self._refresh("inlayHint", "inlayHint")

    def _publish(self, document: Document) -> None:
        uri = self.workspace.uris.get(document)
        if uri is None:
            return
        found = self.workspace.diagnostics(document)
        if self._published.get(uri) == (document.version, found):
            return
        self._published[uri] = document.version, found
        params = {"uri": uri, "version": document.version, "diagnostics": found}
        self.notify("textDocument/publishDiagnostics", params)
