"""Folding ranges."""

from __future__ import annotations

from tests.lsp.editor import Editor


def test_bodies_and_comments():
    text = "// one\n// two\nSelection A\n{\n    A -> box;\n}\ncamera {\n  angle 45\n}\n/* a\n b */\n"
    answer = Editor(text).in_file("textDocument/foldingRange")
    assert [(each["startLine"], each["endLine"], each.get("kind")) for each in answer] == [
        (0, 1, "comment"), (3, 5, None), (6, 8, None), (9, 10, "comment"),
    ]


def test_one_line_folds_nothing():
    assert Editor("camera { angle 45 }\n// one\n").in_file("textDocument/foldingRange") == []
