"""A session on a TCP socket or a WebSocket, by pygls, for clients in a browser and for looking at what happens.

Example: ``serve_ws("127.0.0.1", 8080)`` serves the first client that connects, and returns when it leaves.
"""

from __future__ import annotations

import asyncio
import inspect
import json
import logging
import re
from threading import Event
from typing import Any

from pygls.io_ import run_websocket
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol, default_converter
from websockets.asyncio.server import ServerConnection, serve

from .server import Dispatcher

logger = logging.getLogger(__name__)

# Which pages may connect: those of this machine and of editors. Any other page that is open in a browser could read files with
# what the server tells. What is no page has no origin.
ORIGINS = (None, re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?"), re.compile(r"vscode-webview://[\w.-]+"))


class Protocol(LanguageServerProtocol):
    """pygls' protocol with a session in the place of its handlers: messages stay plain JSON."""

    def __init__(self, server: Any, converter: Any) -> None:
        super().__init__(server, converter)
        self.dispatcher = Dispatcher(self.write, lambda: server.shutdown())

    def structure_message(self, data: Any) -> Any:
        return data

    def handle_message(self, message: Any) -> None:
        self.dispatcher.deliver(json.dumps(message).encode())

    def write(self, body: bytes) -> None:
        if self.writer is None:
            return
        header = b"Content-Length: %d\r\n\r\n" % len(body) if self._include_headers else b""
        result = self.writer.write(header + body)
        if inspect.isawaitable(result):
            asyncio.ensure_future(result)


class Server(LanguageServer):
    def __init__(self) -> None:
        super().__init__("plsys", "1", protocol_cls=Protocol, converter_factory=default_converter)

    def start_ws(self, host: str, port: int) -> None:
        """As pygls', which lets pages from anywhere connect."""
        self._stop_event = stop = Event()

        async def connected(websocket: ServerConnection) -> None:
            await run_websocket(websocket, stop, self.protocol, logger, self.report_server_error)
            self.shutdown()

        async def served() -> None:
            self._server = await serve(connected, host, port, origins=ORIGINS)
            async with self._server:
                await self._server.serve_forever()

        try:
            asyncio.run(served())
        except asyncio.CancelledError:
            logger.debug("the session is over")

    def report_server_error(self, error: Exception, source: Any) -> None:
        logger.error("%s: %s", source, error)


def serve_tcp(host: str, port: int) -> None:
    """Serve one client that connects to ``host``:``port``."""
    Server().start_tcp(host, port)


def serve_ws(host: str, port: int) -> None:
    """Serve one client that connects by WebSocket, such as an editor in a browser."""
    Server().start_ws(host, port)
