"""Random and hostile messages: each is answered or refused, and the session lives."""

from __future__ import annotations

import os
import random

from plsys.lsp.session import Session

COUNT = int(os.environ.get("PLSYS_HOSTILE_MESSAGES", "1000"))
URIS = ["untitled:a", "untitled:b", "file:///nowhere/x.plsys", "file:///", "", "http://[", "file:///%00", 7, None]
TEXTS = ["", "object { A }\nSelection A { A -> box; }\n", "{" * 3000, "/*" * 500, "\r\r\n\0\ufeff𝔸", "\ud800", "#include \"a\"\n", "A" * 70000]
NUMBERS = [0, 1, 2, 5, -1, 10**9, 2**63, 1.5, "1", None, True, [], float("inf")]


def value(random_: random.Random, depth: int = 2) -> object:
    kind = random_.randrange(6 if depth else 4)
    if kind < 2:
        return random_.choice(NUMBERS)
    if kind < 4:
        return random_.choice([*TEXTS[:2], *URIS])
    if kind == 4:
        return [value(random_, depth - 1) for _ in range(random_.randrange(3))]
    keys = ["uri", "range", "position", "line", "character", "text", "version", "context", "changes", "newName"]
    return {random_.choice(keys): value(random_, depth - 1) for _ in range(random_.randrange(4))}


def position(random_: random.Random) -> object:
    if random_.random() < 0.1:
        return value(random_)
    return {"line": random_.choice([0, 0, 1, 1, 2, *NUMBERS]), "character": random_.choice([0, 1, 5, 12, *NUMBERS])}


def params(random_: random.Random) -> object:
    if random_.random() < 0.1:
        return value(random_)
    range_ = {"start": position(random_), "end": position(random_)}
    change = {"text": random_.choice(TEXTS), **({"range": range_} if random_.random() < 0.8 else {})}
    document = {"uri": random_.choice(URIS[:2] * 8 + URIS), "version": random_.choice(NUMBERS), "text": random_.choice(TEXTS)}
    return {
        "textDocument": document, "position": position(random_), "range": range_, "positions": [position(random_)],
        "contentChanges": [change] * random_.randrange(3), "context": value(random_), "newName": random_.choice(["B", "camera", "", 3]),
        "changes": [{"uri": random_.choice(URIS), "type": 1}], "event": value(random_), "query": random_.choice(["", "A", 3]),
        "options": {"tabSize": random_.choice(NUMBERS), "insertSpaces": True}, "item": value(random_),
    }  # fmt: skip


def test_each_message_is_answered_or_refused():
    random_ = random.Random(4)
    sent: list[dict] = []
    session = Session(sent.append)
    session.receive({"jsonrpc": "2.0", "id": "start", "method": "initialize", "params": {"capabilities": {}}})
    methods = ["textDocument/didOpen", "textDocument/didChange", "textDocument/didClose", "workspace/didChangeWatchedFiles",
               "workspace/didChangeWorkspaceFolders", "initialized", "nonsense", *session.features]  # fmt: skip
    for number in range(COUNT):
        method = random_.choice(methods)
        message = {"jsonrpc": "2.0", "method": method, "params": params(random_)}
        if method in session.features or random_.random() < 0.05:
            message["id"] = number
        session.receive(message)
        if "id" in message:
            assert [each for each in sent if each.get("id") == number], message
        if random_.random() < 0.3:
            session.work()
        sent.clear()
    session.receive({"jsonrpc": "2.0", "method": "textDocument/didOpen", "params": {"textDocument": {"uri": "untitled:z", "text": "object { X }\n", "version": 1}}})
    while session.has_work:
        session.work()
    published = [each["params"] for each in sent if each.get("method") == "textDocument/publishDiagnostics"]
    assert any(each["uri"] == "untitled:z" and each["diagnostics"][0]["code"] == "unknown-name" for each in published)
