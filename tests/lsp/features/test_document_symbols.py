"""The outline."""

from __future__ import annotations

from tests.lsp.editor import Editor


def test_definitions_and_blocks_in_text_order():
    editor = Editor("camera { angle 45 }\nSelection Branch(a, b) { Branch -> box; }\n#declare Red2 = rgb 1;\nParameter age = 1;\n")
    answer = editor.in_file("textDocument/documentSymbol")
    assert [(each["name"], each["detail"]) for each in answer] == [
        ("camera", ""), ("Branch(a, b)", "selection"), ("Red2", "constant"), ("age", "Parameter"),
    ]
    assert [editor.text_of(each["selectionRange"]) for each in answer] == ["camera", "Branch", "Red2", "age"]


def test_a_broken_block_costs_no_neighbour():
    editor = Editor("Selection A { A -> \nSelection B { B -> box; }\n")
    assert [each["name"] for each in editor.in_file("textDocument/documentSymbol")] == ["A", "B"]
