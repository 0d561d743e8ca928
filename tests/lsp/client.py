"""A client of a real server process over stdio, for tests of the wiring and for the bench.

Example::

    with Client() as client:
        client.request("initialize", {"capabilities": {}})
        client.wait_for("textDocument/publishDiagnostics")
"""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
from typing import Any

TIMEOUT_S = 60.0


class Client:
    def __init__(self, command: list[str] | None = None) -> None:
        command = command or [sys.executable, "-m", "plsys.compiler.cli", "lsp"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.inbox: queue.Queue[dict | None] = queue.Queue()
        self.skipped: list[dict] = []
        self.errors: list[bytes] = []
        self._id = 0
        threading.Thread(target=self._read, daemon=True).start()
        threading.Thread(target=lambda: self.errors.extend(self.process.stderr), daemon=True).start()

    def _read(self) -> None:
        stream = self.process.stdout
        while header := stream.readline():
            if header.lower().startswith(b"content-length:"):
                length = int(header.split(b":")[1])
                while stream.readline().strip():
                    pass
                self.inbox.put(json.loads(stream.read(length)))
        self.inbox.put(None)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.stdin.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise

    # --- messages

    def send_bytes(self, body: bytes) -> None:
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self.process.stdin.flush()

    def send(self, message: Any) -> None:
        self.send_bytes(json.dumps(message).encode())

    def notify(self, method: str, params: Any = None) -> None:
        self.send({"jsonrpc": "2.0", "method": method, "params": params})

    def start(self, method: str, params: Any = None) -> int:
        """Send a request; its id."""
        self._id += 1
        self.send({"jsonrpc": "2.0", "id": self._id, "method": method, "params": params})
        return self._id

    def request(self, method: str, params: Any = None) -> dict:
        """Send a request and wait for its answer: the whole message."""
        number = self.start(method, params)
        return self.wait(lambda message: message.get("id") == number and "method" not in message)

    def wait(self, fits: Any) -> dict:
        """The next message that ``fits``; others are kept in ``skipped``."""
        while True:
            message = self.inbox.get(timeout=TIMEOUT_S)
            if message is None:
                raise EOFError(b"".join(self.errors).decode(errors="replace"))
            if fits(message):
                return message
            self.skipped.append(message)

    def wait_for(self, method: str) -> dict:
        return self.wait(lambda message: message.get("method") == method)["params"]

    # --- shorthands

    def initialize(self, capabilities: dict | None = None) -> dict:
        answer = self.request("initialize", {"processId": None, "rootUri": None, "capabilities": capabilities or {}})
        self.notify("initialized", {})
        return answer["result"]

    def open(self, uri: str, text: str) -> None:
        document = {"uri": uri, "languageId": "plsys", "version": 1, "text": text}
        self.notify("textDocument/didOpen", {"textDocument": document})

    def change(self, uri: str, version: int, *changes: dict) -> None:
        params = {"textDocument": {"uri": uri, "version": version}, "contentChanges": list(changes)}
        self.notify("textDocument/didChange", params)
