"""Selections grow along the syntax."""

from __future__ import annotations

from tests.lsp.editor import Editor


def ranges(marked: str) -> list[str]:
    editor = Editor(marked)
    (answer,) = editor.in_file("textDocument/selectionRange", positions=[editor.cursor["position"]])
    found = []
    while answer:
        found.append(editor.text_of(answer["range"]))
        answer = answer.get("parent")
    return found


def test_from_a_name_to_the_file():
    assert ranges("Transformation T { scale 2; roty -be<cursor>ta; }\ncamera { }\n") == [
        "beta", "-beta", "roty -beta;", " scale 2; roty -beta; ", "{ scale 2; roty -beta; }",
        "Transformation T { scale 2; roty -beta; }", "Transformation T { scale 2; roty -beta; }\ncamera { }\n",
    ]  # fmt: skip


def test_behind_a_word():
    assert ranges("object { Tree<cursor> }\n")[0] == "Tree"


def test_each_range_holds_the_one_before():
    found = ranges("Selection A { if (n > 0) A -> [ trans 0 0 m<cursor>ax(1, 2) ] box + A; }\n")
    assert all(inner in outer and inner != outer for inner, outer in zip(found, found[1:]))


def test_an_empty_file():
    assert ranges("<cursor>") == [""]
