"""The language server seen by pytest-lsp, a client with types of its own for every message."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

pytest_lsp = pytest.importorskip("pytest_lsp", reason="pytest-lsp isn't installed: see tests/editors/README.md")

from lsprotocol import types  # noqa: E402

from test_editors import SCENE  # noqa: E402

TIMEOUT_S = 60


async def session(path: Path) -> dict:
    """Open a scene, and what the server says about it."""
    config = pytest_lsp.ClientServerConfig([sys.executable, "-m", "plsys.compiler.cli", "lsp"])
    client = await config.start()
    try:
        parameters = types.InitializeParams(capabilities=pytest_lsp.client_capabilities("visual-studio-code"), process_id=None,
                                            root_uri=path.parent.as_uri())  # fmt: skip
        await client.initialize_session(parameters)
        uri = path.as_uri()
        document = types.TextDocumentIdentifier(uri)
        item = types.TextDocumentItem(uri, "plsys", 1, SCENE)
        client.text_document_did_open(types.DidOpenTextDocumentParams(item))
        await client.wait_for_notification("textDocument/publishDiagnostics")
        at = types.Position(1, SCENE.split("\n")[1].index("T_up") + 2)
        return {
            "diagnostics": list(client.diagnostics.get(uri, ())),
            "completion": await client.text_document_completion_async(types.CompletionParams(document, at)),
            "hover": await client.text_document_hover_async(types.HoverParams(document, at)),
            "rename": await client.text_document_rename_async(types.RenameParams(document, at, "T_high")),
        }
    finally:
        await client.shutdown_session()
        await client.stop()


def test_a_session(tmp_path):
    path = tmp_path / "scene.plsys"
    path.write_text(SCENE)
    found = asyncio.run(asyncio.wait_for(session(path), TIMEOUT_S))
    assert "unknown-name" in [each.code for each in found["diagnostics"]]
    items = found["completion"]
    assert "T_up" in [item.label for item in getattr(items, "items", items)]
    assert "Transformation" in found["hover"].contents.value
    edits = found["rename"]
    changed = [edit for change in edits.document_changes for edit in change.edits] if edits.document_changes else edits.changes[path.as_uri()]
    assert [edit.new_text for edit in changed] == ["T_high", "T_high"]
