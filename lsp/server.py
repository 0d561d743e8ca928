"""Wiring: a session on stdio, TCP or a WebSocket.

pygls serves the sockets and frames what is sent; reading stdin is done here, by a thread, so that the event loop sees
all messages that wait: a request whose cancellation waits behind it is never begun, and diagnostics are worked out once
for a burst of edits.

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
from typing import Any, BinaryIO

from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol, default_converter

from .session import Session

logger = logging.getLogger(__name__)

_LENGTH = re.compile(rb"content-length:\s*(\d+)\s*$", re.IGNORECASE)
MAX_MESSAGE_BYTES = 1 << 30


class Protocol(LanguageServerProtocol):
    """pygls' protocol with the session in the place of its handlers: messages stay plain JSON, which is both quicker
    and more forgiving than classes."""

    def __init__(self, server: Any, converter: Any) -> None:
        super().__init__(server, converter)
        self.session = Session(self.send)
        self.inbox: deque[Any] = deque()
        self.cancelled: set[Any] = set()
        self._scheduled = False

    def structure_message(self, data: Any) -> Any:
        return data

    def handle_message(self, message: Any) -> None:
        """Put a message that was read into the queue. On the event loop's thread."""
        if isinstance(message, dict) and message.get("method") == "$/cancelRequest":
            params = message.get("params")
            number = params.get("id") if isinstance(params, dict) else None
            if any(isinstance(m, dict) and m.get("id") == number and "method" in m for m in self.inbox):
                self.cancelled.add(number)
            return
        self.inbox.append(message)
        if not self._scheduled:
            self._scheduled = True
            asyncio.get_running_loop().call_soon(self._drain)

    def _drain(self) -> None:
        """Handle the messages that wait, one a turn of the loop; when none does, do the work that edits left."""
        self._scheduled = False
        if self.inbox:
            message = self.inbox.popleft()
            number = message.get("id") if isinstance(message, dict) else None
            if isinstance(number, int | str) and number in self.cancelled:
                self.cancelled.discard(number)
                self.session.refuse_cancelled(number)
            else:
                self.session.receive(message)
        elif self.session.has_work:
            self.session.work()
        if self.session.exit_code is not None:
            self.leave()
        elif self.inbox or self.session.has_work:
            self._scheduled = True
            asyncio.get_running_loop().call_soon(self._drain)

    def leave(self) -> None:
        """The client said exit."""
        self._server.left.set()

    def send(self, message: dict) -> None:
        body = json.dumps(message, separators=(",", ":")).encode()
        if self._include_headers:
            body = b"Content-Length: %d\r\n\r\n%s" % (len(body), body)
        if self.writer is None:
            return
        try:
            result = self.writer.write(body)
        except (BrokenPipeError, ConnectionError, ValueError):
            self.leave()
            return
        if asyncio.iscoroutine(result):
            asyncio.ensure_future(result)


class Server(LanguageServer):
    def __init__(self) -> None:
        self.left = threading.Event()
        super().__init__("plsys", "1", protocol_cls=Protocol, converter_factory=default_converter)

    def report_server_error(self, error: Exception, source: Any) -> None:
        logger.error("%s: %s", source, error)


class _Pipe:
    """Standard output as pygls' writer."""

    def __init__(self, stream: BinaryIO) -> None:
        self.stream = stream

    def write(self, data: bytes) -> None:
        self.stream.write(data)
        self.stream.flush()

    def close(self) -> None:
        self.stream.close()


def serve_stdio() -> int:
    """Serve one client on standard input and output; the exit code."""
    server = Server()
    protocol: Protocol = server.protocol  # type: ignore[assignment]
    output = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    # Whatever prints by mistake must not end up among the messages.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    protocol.set_writer(_Pipe(output))
    gc.collect()
    gc.freeze()
    # A stream of its own: Python closes sys.stdin at exit, and aborts when a thread still reads it.
    asyncio.run(_pump(os.fdopen(os.dup(sys.stdin.fileno()), "rb"), protocol, server.left))
    code = protocol.session.exit_code
    return 1 if code is None else code


async def _pump(stream: BinaryIO, protocol: Protocol, left: threading.Event) -> None:
    """Read messages in a thread until the stream ends or the client leaves."""
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def read() -> None:
        try:
            while (body := read_message(stream)) is not None:
                loop.call_soon_threadsafe(deliver, body)
        except (OSError, ValueError, RuntimeError) as error:
            logger.info("the input ended: %s", error)
        try:
            loop.call_soon_threadsafe(ended.set)
        except RuntimeError:
            pass  # the loop is closed already

    def deliver(body: bytes) -> None:
        try:
            message = json.loads(body)
        except (ValueError, RecursionError):
            protocol.session.refuse_unreadable()
            return
        protocol.handle_message(message)

    threading.Thread(target=read, daemon=True, name="stdin").start()
    protocol.leave = lambda: (left.set(), ended.set())  # type: ignore[method-assign]
    await ended.wait()
    while not left.is_set() and (protocol.inbox or protocol.session.has_work):
        await asyncio.sleep(0)  # the client closed the pipe: answer what was asked before


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


def serve_tcp(host: str, port: int) -> None:
    """Serve one client that connects to ``host``:``port``."""
    Server().start_tcp(host, port)


def serve_ws(host: str, port: int) -> None:
    """Serve one client that connects by WebSocket, such as an editor in a browser."""
    Server().start_ws(host, port)
