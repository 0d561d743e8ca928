"""When a session works, and when it lets go."""

from __future__ import annotations

from plsys.lsp.session import Session

URI = "untitled:a.plsys"


def test_a_message_that_waits_breaks_off_what_follows_from_the_edit_before_it():
    sent: list[dict] = []
    waits = False
    session = Session(sent.append, is_message_waiting=lambda: waits)
    session.receive({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {"capabilities": {}}})
    opened = {"uri": URI, "languageId": "plsys", "version": 1, "text": "object { Tree }\n" * 50}
    session.receive({"jsonrpc": "2.0", "method": "textDocument/didOpen", "params": {"textDocument": opened}})
    sent.clear()
    waits = True
    session.work()
    assert session.has_work and not sent
    waits = False
    while session.has_work:
        session.work()
    assert sent[-1]["params"]["version"] == 1
    assert len(sent[-1]["params"]["diagnostics"]) == 50
