"""Symbols of all known files."""

from __future__ import annotations

from tests.lsp.editor import Editor

FILES = {
    "main.plsys": '#include "lib.plsys"\ncamera { angle 4 }\nobject { Tree }\nCalculation C_tree { n = 1; }\n',
    "lib.plsys": "Selection Tree { Tree -> box; }\nSelection TallBush { TallBush -> box; }\nTransformation T_branch { scale 2; }\n",
}


def names(editor: Editor, query: str) -> list[str]:
    return [editor.spot(each["location"]) for each in editor.request("workspace/symbol", {"query": query})]


def test_included_files_and_best_first(tmp_path):
    editor = Editor(FILES, tmp_path)
    assert names(editor, "tree") == ["lib.plsys:1:11 Tree", "main.plsys:4:13 C_tree"]


def test_letters_in_order(tmp_path):
    editor = Editor(FILES, tmp_path)
    assert names(editor, "tb") == ["lib.plsys:3:16 T_branch", "lib.plsys:2:11 TallBush"]
    assert names(editor, "xyz") == []


def test_all(tmp_path):
    answer = Editor(FILES, tmp_path).request("workspace/symbol", {"query": ""})
    assert {each["name"] for each in answer} == {"Tree", "TallBush", "T_branch", "C_tree"}
    assert {each["containerName"] for each in answer} == {"main.plsys", "lib.plsys"}
