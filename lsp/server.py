"""Wiring: a session on standard input and output (sockets.py has TCP and WebSockets).

Reading is done by a thread, so that the event loop sees all messages that wait: a request whose cancellation waits behind
it is never begun, and diagnostics are worked out once for a burst of edits.

Example: ``serve_stdio()`` returns the process's exit code when the client leaves.
"""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import os
import re
import sys
import threading
from collections import deque
from typing import Any, BinaryIO, Callable

from plsys.compiler.analysis import give_turns

from .session import Session

logger = logging.getLogger(__name__)

_LENGTH = re.compile(rb"content-length:\s*(\d+)\s*$", re.IGNORECASE)
MAX_MESSAGE_BYTES = 1 << 30
_ENCODER = json.JSONEncoder(separators=(",", ":"), check_circular=False)  # no message holds itself

# Edits leave no garbage in cycles (facts.drop_facts), and searching a large file for it takes a tenth of a second. So it is
# looked for after so many new objects only, and what there is by then, in each pause or after fewer, is taken out of the search.
GARBAGE_THRESHOLDS = 200_000, 10, 1_000
MANY_OBJECTS = 50_000

# The thread that reads takes what has come in one go: each turn that it waits for is a delay.
INPUT_BUFFER_BYTES = 1 << 18

# Whole-file checks begin when nothing came for so long: messages that belong together come within some milliseconds.
CHECKS_S = 0.005
# Garbage, which makes nobody wait but the next key, is looked for in longer pauses.
PAUSE_S = 0.1
# When a pause is looked for again where something was to do just then.
BUSY_S = 0.005


class Dispatcher:
    """The messages of one client that wait, and the session that takes them, one a turn of the event loop. ``write``
    sends the bytes of a message; ``leave`` is called when the session is over."""

    def __init__(
        self, write: Callable[[bytes], object], leave: Callable[[], object], loop: asyncio.AbstractEventLoop | None = None
    ) -> None:
        self.write, self.leave, self.loop = write, leave, loop
        self.session = Session(self.send, self._wake, lambda: self.arrived > self._delivered)
        self.inbox: deque[Any] = deque()
        self.arrived = self._delivered = 0  # messages that a thread has read, and those of them that deliver() has seen
        self.cancelled: set[Any] = set()
        self._scheduled = self._prepares = self._has_opened = self._has_closed = self._has_heard = False
        self._pause: asyncio.TimerHandle | None = None

    def deliver(self, body: bytes) -> None:
        """Take the bytes of a message. On the event loop's thread."""
        self._delivered += 1
        self.loop = self.loop or asyncio.get_running_loop()
        try:
            message = json.loads(body)
        except (ValueError, RecursionError):
            self.session.refuse_unreadable()
            return
        if isinstance(message, dict) and message.get("method") == "$/cancelRequest":
            self._cancel(message.get("params"))
            return
        self.inbox.append(message)
        self._schedule()

    def _wake(self) -> None:
        """Results of the whole-file checks wait. In any thread."""
        if self.loop is not None and not self.loop.is_closed():
            self.loop.call_soon_threadsafe(self._schedule)

    def _cancel(self, params: Any) -> None:
        number = params.get("id") if isinstance(params, dict) else None
        waiting = (each for each in self.inbox if isinstance(each, dict) and "method" in each)
        if isinstance(number, int | str) and any(each.get("id") == number for each in waiting):
            self.cancelled.add(number)
        else:
            self.session.cancel(number)

    def _schedule(self) -> None:
        if not self._scheduled:
            self._scheduled = True
            asyncio.get_running_loop().call_soon(self._turn)

    @property
    def is_busy(self) -> bool:
        return bool(self.inbox) or self.session.has_work

    def _turn(self) -> None:
        """Handle a message; where none waits, do some of the work that edits left."""
        self._scheduled = False
        if self.inbox:
            self._handle(self.inbox.popleft())
        elif self.session.has_work:
            self.session.work()
            if self._has_opened and not self.session.has_work:
                # A large file is many objects that stay; searching them for garbage takes longer than a key may.
                gc.freeze()
                gc.enable()
                self._has_opened = False
            self._await_pause()
        if gc.get_count()[0] > MANY_OBJECTS and gc.isenabled():
            gc.freeze()  # what the checks found, or what is kept of answers
        if self.session.exit_code is not None:
            self.leave()
        elif self.is_busy:
            self._schedule()
        elif not self._prepares:
            self._prepares = True
            asyncio.get_running_loop().call_soon(self._prepare)

    def _await_pause(self) -> None:
        """Have ``_check`` called when the client has said nothing for a while. Work that workers left is no reason to wait."""
        if self._pause is not None and self._has_heard:
            self._pause.cancel()
            self._pause = None
        if self._pause is None:
            self._pause = asyncio.get_running_loop().call_later(CHECKS_S, self._check)
        self._has_heard = False

    def _check(self) -> None:
        """All that came together is there: have it checked."""
        if self.is_busy:
            self._pause = asyncio.get_running_loop().call_later(BUSY_S, self._check)
            return
        self.session.start_checks()
        self._pause = asyncio.get_running_loop().call_later(PAUSE_S - CHECKS_S, self._rest)

    def _rest(self) -> None:
        """The client has paused: look for garbage."""
        if self.is_busy:
            self._pause = asyncio.get_running_loop().call_later(BUSY_S, self._rest)
            return
        self._pause = None
        if self._has_closed:  # what was known about a file refers to itself
            self._has_closed = False
            gc.unfreeze()
            gc.collect()
        gc.freeze()

    def _prepare(self) -> None:
        """Go on with what can be prepared as long as nothing else is to do; after that, the next turn begins again."""
        self._prepares = not self.is_busy and not self.session.prepare()
        if self._prepares:
            asyncio.get_running_loop().call_soon(self._prepare)

    def _handle(self, message: Any) -> None:
        number = message.get("id") if isinstance(message, dict) else None
        if isinstance(number, int | str) and number in self.cancelled:
            self.cancelled.discard(number)
            self.session.refuse_cancelled(number)
            return
        self._has_heard = True
        self.session.receive(message)
        if isinstance(message, dict) and message.get("method") == "textDocument/didOpen":
            self._has_opened = True
            gc.disable()  # until it is read: nearly all of it stays
        self._has_closed |= isinstance(message, dict) and message.get("method") == "textDocument/didClose"

    def send(self, message: dict) -> None:
        try:
            self.write(_ENCODER.encode(message).encode())
        except (ConnectionError, ValueError):  # the client is gone
            self.leave()


def serve_stdio() -> int:
    """Serve one client on standard input and output; the exit code."""
    output = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    # Whatever prints by mistake must not end up among the messages.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # A stream of its own: Python closes sys.stdin at exit, and aborts when a thread still reads it.
    stream = os.fdopen(os.dup(sys.stdin.fileno()), "rb", INPUT_BUFFER_BYTES)
    give_turns()
    return asyncio.run(_serve(stream, output))


async def _serve(stream: BinaryIO, output: BinaryIO) -> int:
    """Read messages in a thread until the stream ends or the client leaves."""
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def write(body: bytes) -> None:
        output.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        output.flush()

    dispatcher = Dispatcher(write, ended.set, loop)

    def read() -> None:
        try:
            while (body := read_message(stream)) is not None:
                dispatcher.arrived += 1
                loop.call_soon_threadsafe(dispatcher.deliver, body)
        except (OSError, ValueError, RuntimeError) as error:
            logger.info("the input ended: %s", error)
        try:
            loop.call_soon_threadsafe(ended.set)
        except RuntimeError:
            pass  # the loop is closed already

    gc.freeze()
    gc.set_threshold(*GARBAGE_THRESHOLDS)
    threading.Thread(target=read, daemon=True, name="stdin").start()
    await ended.wait()
    while dispatcher.session.exit_code is None and dispatcher.is_busy:
        await asyncio.sleep(0)  # the client closed the pipe: answer what was asked before
    dispatcher.session.close()
    code = dispatcher.session.exit_code
    return 1 if code is None else code


def read_message(stream: BinaryIO) -> bytes | None:
    """The body of the next message; None at the end. Headers that make no sense are skipped."""
    length = None
    while line := stream.readline(4096):
        if match := _LENGTH.match(line.strip()):
            length = int(match[1])
        elif not line.strip() and length is not None:
            if length > MAX_MESSAGE_BYTES:
                raise ValueError("a message of more than a gigabyte")
            body = stream.read(length)
            return body if len(body) == length else None
    return None
