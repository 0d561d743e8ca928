"""Completion, hover, signature help and the whole-file features have an answer at every place of every scene, whole and
half-typed."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.lsp.editor import Editor, position_of

ROOT = Path(__file__).resolve().parents[3]
SCENES = sorted(path.name for path in (ROOT / "scenes").glob("*.plsys"))
AT_A_PLACE = ("textDocument/completion", "textDocument/hover", "textDocument/signatureHelp")
OF_A_FILE = ("textDocument/documentColor", "textDocument/codeLens", "textDocument/documentLink", "textDocument/inlayHint")
STEP = 23


@pytest.mark.parametrize("name", SCENES)
def test_whole(name):
    text = (ROOT / "scenes" / name).read_text()
    editor = Editor(text)
    editor.published()
    editor.check_whole()
    for at in range(0, len(text), STEP):
        for method in AT_A_PLACE:
            editor.in_file(method, position=position_of(text, at))
    for method in OF_A_FILE:
        assert editor.in_file(method) is not None


@pytest.mark.parametrize("name", ["tree.plsys", "bush.plsys", "shading.plsys"])
def test_half_typed(name):
    text = (ROOT / "scenes" / name).read_text()[:3000]
    editor = Editor("")
    for at in range(STEP, len(text), STEP):
        before = editor.texts["scene.plsys"]
        end = position_of(before, len(before))
        editor.texts["scene.plsys"] = text[:at]
        change = {"range": {"start": end, "end": end}, "text": text[len(before) : at]}
        document = {"uri": editor.uri("scene.plsys"), "version": at}
        editor.notify("textDocument/didChange", {"textDocument": document, "contentChanges": [change]})
        for method in AT_A_PLACE:
            editor.in_file(method, position=position_of(text, at))
        for method in OF_A_FILE:
            assert editor.in_file(method) is not None
