"""The wiring: a real process on stdio."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from plsys.lsp.server import read_message
from tests.lsp.client import Client

URI = "untitled:scene.plsys"


@pytest.fixture
def client():
    with Client() as client:
        yield client


def insertion(line: int, character: int, text: str) -> dict:
    place = {"line": line, "character": character}
    return {"range": {"start": place, "end": place}, "text": text}


def test_a_session_from_start_to_exit(client):
    result = client.initialize()
    assert result["serverInfo"]["name"] == "plsys"
    assert result["capabilities"]["positionEncoding"] == "utf-16"
    client.open(URI, "object { Tre }\nSelection Tree { Tree -> box; }\n")
    published = client.wait_for("textDocument/publishDiagnostics")
    assert [each["code"] for each in published["diagnostics"]] == ["unknown-name"]
    client.change(URI, 2, insertion(0, 12, "e"))
    published = client.wait_for("textDocument/publishDiagnostics")
    assert published["diagnostics"] == [] and published["version"] == 2
    assert client.request("shutdown")["result"] is None
    client.notify("exit")
    assert client.process.wait(10) == 0


def test_exit_without_shutdown_is_a_failure(client):
    client.initialize()
    client.notify("exit")
    assert client.process.wait(10) == 1


def test_the_encoding_that_the_client_offers():
    with Client() as client:
        result = client.initialize({"general": {"positionEncodings": ["utf-8", "utf-16"]}})
        assert result["capabilities"]["positionEncoding"] == "utf-8"


def test_a_request_before_initialize_is_refused(client):
    assert client.request("textDocument/definition", {})["error"]["code"] == -32002


def test_unknown_methods_and_parameters_are_refused(client):
    client.initialize()
    assert client.request("textDocument/nonsense", {})["error"]["code"] == -32601
    assert client.request("textDocument/definition", {"textDocument": 3})["error"]["code"] == -32602
    unknown = {"textDocument": {"uri": "file:///nowhere/x.plsys"}, "position": {"line": 0, "character": 0}}
    assert "no such document" in client.request("textDocument/definition", unknown)["error"]["message"]


def test_what_is_no_message_is_answered_and_survived(client):
    client.initialize()
    for body in (b"{", b"\xff\xfe", b"[1, 2]", b"3", b'{"method": 4}', b"[" * 5000):
        client.send_bytes(body)
        assert client.wait(lambda message: "error" in message)["id"] is None
    client.notify("textDocument/didChange", {"textDocument": {}, "contentChanges": 7})
    client.notify("textDocument/didOpen", None)
    assert client.request("shutdown")["result"] is None


def test_a_cancelled_request_that_waits_is_not_begun(client):
    client.initialize()
    client.open(URI, "camera { angle 45 }\n" * 3000)
    number = 7
    burst = [
        {"jsonrpc": "2.0", "id": number, "method": "textDocument/documentSymbol", "params": {"textDocument": {"uri": URI}}},
        {"jsonrpc": "2.0", "method": "$/cancelRequest", "params": {"id": number}},
    ]
    bodies = [json.dumps(message).encode() for message in burst]
    client.process.stdin.write(b"".join(b"Content-Length: %d\r\n\r\n%s" % (len(body), body) for body in bodies))
    client.process.stdin.flush()
    assert client.wait(lambda message: message.get("id") == number)["error"]["code"] == -32800


def test_a_burst_of_edits_is_answered_for_the_last(client):
    client.initialize()
    client.open(URI, "object { Tree }\n")
    client.wait_for("textDocument/publishDiagnostics")
    for version in range(2, 60):
        client.change(URI, version, insertion(0, 13, "e"))
    while client.wait_for("textDocument/publishDiagnostics")["version"] < 59:
        pass


def test_whole_file_checks_come_from_their_own_process(client):
    client.initialize()
    client.open(URI, "object { A }\nSelection A { A -> [ trans 0 0 1 ] A; }\n")
    while "endless" not in [each["code"] for each in client.wait_for("textDocument/publishDiagnostics")["diagnostics"]]:
        pass
    client.change(URI, 2, insertion(1, 14, "A -> box;"))
    while "endless" in [each["code"] for each in client.wait_for("textDocument/publishDiagnostics")["diagnostics"]]:
        pass


def test_the_end_of_input_ends_the_server():
    client = Client()
    client.initialize()
    client.process.stdin.close()
    assert client.process.wait(10) == 1


INITIALIZE = json.dumps({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {"capabilities": {}}})


@contextmanager
def served(transport):
    """The port of a server on a socket."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    process = subprocess.Popen([sys.executable, "-m", "plsys.compiler.cli", "lsp", transport, str(port)])
    try:
        yield port
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("transport", ["--tcp", "--ws"])
def test_a_session_on_a_socket(transport):
    """One request and its answer; framing is the transport's."""
    with served(transport) as port:
        answer = over_tcp(port, INITIALIZE) if transport == "--tcp" else over_ws(port, INITIALIZE)
        assert answer["result"]["serverInfo"]["name"] == "plsys"


def test_pages_from_elsewhere_may_not_connect():
    refused = pytest.importorskip("websockets.exceptions").InvalidStatus
    with served("--ws") as port:
        with pytest.raises(refused):
            over_ws(port, INITIALIZE, origin="https://elsewhere.example")
        with pytest.raises(refused):
            over_ws(port, INITIALIZE, origin="https://localhost.elsewhere.example")
        assert over_ws(port, INITIALIZE, origin="http://localhost:3000")["id"] == 1


def until_served(connect):
    for _ in range(200):
        try:
            return connect()
        except OSError:
            time.sleep(0.05)
    raise AssertionError("nothing serves")


def over_tcp(port: int, body: str) -> dict:
    with until_served(lambda: socket.create_connection(("127.0.0.1", port))) as connection:
        connection.sendall(b"Content-Length: %d\r\n\r\n%s" % (len(body), body.encode()))
        with connection.makefile("rb") as stream:
            return json.loads(read_message(stream))


def over_ws(port: int, body: str, origin: str | None = None) -> dict:
    client = pytest.importorskip("websockets.sync.client")
    with until_served(lambda: client.connect(f"ws://127.0.0.1:{port}", origin=origin)) as connection:
        connection.send(body)
        return json.loads(connection.recv(timeout=20))
