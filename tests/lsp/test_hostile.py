"""Random and hostile messages: every request gets one answer, and the server lives.

Requests with right parameters, at random places, get results and no excuses; with wrong ones, anything but silence.
"""

from __future__ import annotations

import json
import logging
import random
from pathlib import Path
from typing import Any

import pytest
from plsys.lsp.session import Session
from stress import rounds
from tests.lsp.client import Client

ROOT = Path(__file__).resolve().parents[2]
SCENE = (ROOT / "scenes/tree.plsys").read_text()
URIS = ("untitled:a.plsys", "untitled:b", "file:///nowhere/c.plsys")
INTERNAL_ERROR = -32603
JUNK: tuple[Any, ...] = (
    None, True, 0, -1, 1 << 31, 1 << 70, 1.5, 1e300, "", "x", "\0", "\ud83c", "é\U0001f333", "file://", "file:///%00", "http://[", [], {}, [[]],
    {"line": -5}, {"start": None}, [None, 1], "a" * 5000, {"uri": URIS[0]}, {"line": 1 << 40, "character": 1 << 40},
)  # fmt: skip
TEXTS = ("", "{", "}", "Selection", "/*", "\r", "\u2028", "\U0001f333", "object { Tree }\n", "x" * 300, "((((", "\0")


class Fuzzer:
    def __init__(self, seed: int, methods: list[str]) -> None:
        self.rng = random.Random(seed)
        self.methods = methods
        self.number = 1_000_000  # apart from the test client's own

    def position(self) -> dict:
        return {"line": self.rng.randrange(40), "character": self.rng.randrange(90)}

    def range(self) -> dict:
        start = self.position()
        end = {"line": start["line"] + self.rng.randrange(3), "character": self.rng.randrange(90)}
        return {"start": start, "end": max(start, end, key=lambda p: (p["line"], p["character"]))}

    def params(self) -> dict:
        """Parameters that suit every method about a document."""
        return {
            "textDocument": {"uri": URIS[0]}, "position": self.position(), "range": self.range(), "positions": [self.position()],
            "newName": self.rng.choice(("Fir", "n2", "T_x")), "query": self.rng.choice(("", "tr", "C_")), "ch": self.rng.choice(";}\n"),
            "options": {"tabSize": 4, "insertSpaces": True}, "context": {"diagnostics": [], "includeDeclaration": True, "triggerKind": 1},
            "color": {"red": 0.5, "green": 0.25, "blue": 1, "alpha": 1}, "ranges": [self.range()], "previousResultId": "1",
        }  # fmt: skip

    def broken(self, value: Any, depth: int = 0) -> Any:
        """``value`` with something in it replaced or lost."""
        rng = self.rng
        if not isinstance(value, dict | list) or not value or rng.random() < 0.2:
            return rng.choice(JUNK)
        if isinstance(value, list):
            return [self.broken(each) for each in value]
        key = rng.choice(list(value))
        rest = {name: each for name, each in value.items() if name != key}
        return rest if rng.random() < 0.3 else {**rest, key: self.broken(value[key])}

    def change(self) -> dict:
        change = {"text": self.rng.choice(TEXTS)}
        if self.rng.random() < 0.97:
            change["range"] = self.range()
        else:
            change["text"] = SCENE
        document = {"uri": URIS[0], "version": self.number}
        return {"textDocument": document, "contentChanges": [change]}

    def message(self) -> tuple[Any, bool]:
        """A message, and whether it is a right one."""
        rng, self.number = self.rng, self.number + 1
        chance = rng.random()
        if chance < 0.3:
            return self.notification("textDocument/didChange", self.change()), True
        if chance < 0.33:
            document = {"uri": rng.choice(URIS), "languageId": "plsys", "version": 1, "text": SCENE}
            return self.notification("textDocument/didOpen", {"textDocument": document}), True
        if chance < 0.6:
            method = rng.choice(self.methods)  # those of items (resolve, calls) need an item of ours
            return self.request(method, self.params()), method.startswith(("textDocument/", "workspace/symbol"))
        if chance < 0.85:
            return self.request(rng.choice(self.methods), self.broken(self.params())), False
        if chance < 0.93:
            method = rng.choice(("textDocument/didChange", "textDocument/didOpen", "workspace/didChangeWatchedFiles", "textDocument/didClose",
                                 "workspace/didChangeWorkspaceFolders", "$/cancelRequest", "$/setTrace", "initialized"))  # fmt: skip
            return self.notification(method, self.broken(self.change())), False
        if chance < 0.97:
            return self.request(rng.choice(("x", "", "initialize", "workspace/nothing")), rng.choice(JUNK)), False
        return rng.choice(JUNK), False

    def request(self, method: str, params: Any) -> dict:
        return {"jsonrpc": "2.0", "id": self.number, "method": method, "params": params}

    @staticmethod
    def notification(method: str, params: Any) -> dict:
        return {"jsonrpc": "2.0", "method": method, "params": params}


def initialize(send: Any) -> None:
    send({"jsonrpc": "2.0", "id": 0, "method": "initialize", "params": {"capabilities": {}}})
    send({"jsonrpc": "2.0", "method": "initialized", "params": {}})
    document = {"uri": URIS[0], "languageId": "plsys", "version": 1, "text": SCENE}
    send({"jsonrpc": "2.0", "method": "textDocument/didOpen", "params": {"textDocument": document}})


@pytest.fixture
def quiet():
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


def test_every_request_is_answered_once(quiet):
    sent: list[dict] = []
    session = Session(sent.append)
    initialize(session.receive)
    fuzzer = Fuzzer(1, sorted(session.features))
    for _ in range(rounds(ci=1000, stress=100_000)):
        message, right = fuzzer.message()
        sent.clear()
        session.receive(message)
        while session.has_work:
            session.work()
        json.dumps(sent)  # what isn't JSON can't be sent
        if not isinstance(message, dict) or not isinstance(message.get("id"), int) or "method" not in message:
            continue
        answers = [each for each in sent if each.get("id") == message["id"] and "method" not in each]
        assert len(answers) == 1, message
        error = answers[0].get("error", {})
        assert error.get("code") != INTERNAL_ERROR, (message, error)
        if right:
            assert "can't be answered" not in error.get("message", ""), (message, error)
    assert session.exit_code is None


def test_the_process_lives():
    with Client() as client:
        initialize(client.send)
        client.wait(lambda message: message.get("id") == 0)
        fuzzer = Fuzzer(2, sorted(Session(lambda message: None).features))
        for _ in range(rounds(ci=300, stress=20_000)):
            client.send(fuzzer.message()[0])
        for body in (b"", b"{", b"[" * 100_000, b'{"id": 1e999}', b"\xff" * 50, b"null", b'"x"'):
            client.send_bytes(body)
        client.process.stdin.write(b"Content-Length: x\r\nContent-Type: y\r\n\r\nContent-Length: -4\r\n\r\n\r\n")
        assert client.request("shutdown")["result"] is None
