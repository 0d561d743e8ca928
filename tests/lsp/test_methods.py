"""lsp/METHODS.md says what the server answers."""

from __future__ import annotations

import re
from pathlib import Path

from plsys.lsp.session import Session

TABLE = Path(__file__).resolve().parents[2] / "lsp/METHODS.md"
ROW = re.compile(r"^\| `([^`]+)` \| (\S+) \|", re.MULTILINE)

# Answered without a feature, or notifications of the session's life that every server takes.
ALSO = {"textDocument/publishDiagnostics", "$/cancelRequest"}
PLAIN = {"textDocument/didOpen", "textDocument/didChange", "textDocument/didClose", "initialized", "exit"}


def test_the_table_is_what_the_server_answers():
    session = Session(lambda message: None)
    answered = {*session.features, *session._notifications, *ALSO} - PLAIN
    assert {method for method, mark in ROW.findall(TABLE.read_text(encoding="utf-8")) if mark == "●"} == answered


def test_what_is_answered_is_announced():
    sent: list[dict] = []
    session = Session(sent.append)
    session.receive({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {"capabilities": {}}})
    announced = sent[0]["result"]["capabilities"]
    for feature in session.features.values():
        at = announced
        for key in feature.capability.split(".") if feature.capability else ():
            at = at[key]
        assert at, feature.method
