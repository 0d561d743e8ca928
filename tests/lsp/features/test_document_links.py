"""Document links."""

from __future__ import annotations

from tests.lsp.editor import Editor


def test_includes_and_meshes_that_exist(tmp_path):
    (tmp_path / "leaf.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    text = (
        '#include "lib.plsys"\n#include "gone.plsys"\nobject { A }\n'
        'Selection A { A -> [ trans 0 0 1 ] mesh("leaf.obj") + mesh("gone.obj"); }\n'
    )
    editor = Editor({"main.plsys": text, "lib.plsys": ""}, tmp_path)
    answer = editor.in_file("textDocument/documentLink", "main.plsys")
    assert [(editor.text_of(each["range"], "main.plsys"), each["target"]) for each in answer] == [
        ("lib.plsys", editor.uri("lib.plsys")), ("leaf.obj", editor.uri("leaf.obj")),
    ]


def test_a_scene_without_files_has_no_links():
    assert Editor('object { A }\nSelection A { A -> mesh(" \\0"); }\n').in_file("textDocument/documentLink") == []
    assert Editor('#include "\n').in_file("textDocument/documentLink") == []
