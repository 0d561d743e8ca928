"""Definition, references, highlights."""

from __future__ import annotations

from tests.lsp.editor import Editor

SCENE = """\
object { Tree }
Selection Tree
{
    C_init Tree;
    if (n > 0) Tree -> T_up C_less Tr<cursor>ee + sphere;
}
Calculation C_init { n = 3; }
Calculation C_less { --n; }
Transformation T_up { trans 0 0 n; }
"""


def spots(editor, answer):
    return [editor.spot(location) for location in answer]


def test_definition_of_a_symbol():
    editor = Editor(SCENE)
    assert spots(editor, editor.at_cursor("textDocument/definition")) == ["scene.plsys:2:11 Tree"]


def test_definition_of_a_parameter_is_where_it_is_assigned():
    editor = Editor(SCENE.replace("<cursor>", "").replace("trans 0 0 n", "trans 0 0 <cursor>n"))
    assert spots(editor, editor.at_cursor("textDocument/definition")) == ["scene.plsys:7:22 n", "scene.plsys:8:24 n"]


def test_references_include_rules_entry_actions_and_objects():
    editor = Editor(SCENE)
    answer = editor.at_cursor("textDocument/references", context={"includeDeclaration": True})
    assert [spot.split()[0] for spot in spots(editor, answer)] == [
        "scene.plsys:1:10", "scene.plsys:2:11", "scene.plsys:4:12", "scene.plsys:5:16", "scene.plsys:5:36",
    ]
    without = editor.at_cursor("textDocument/references", context={"includeDeclaration": False})
    assert len(without) == 4


def test_a_property_is_no_reference_to_a_constant_of_the_same_name():
    editor = Editor("#declare an<cursor>gle = 30;\ncamera { angle 45 }\nsphere { 0, angle }\n")
    answer = editor.at_cursor("textDocument/references", context={"includeDeclaration": False})
    assert spots(editor, answer) == ["scene.plsys:3:13 angle"]


def test_highlights_tell_reading_from_writing():
    editor = Editor(SCENE.replace("<cursor>", "").replace("trans 0 0 n", "trans 0 0 <cursor>n"))
    answer = editor.at_cursor("textDocument/documentHighlight")
    assert [(each["range"]["start"]["line"], each["kind"]) for each in answer] == [(4, 2), (6, 3), (7, 3), (8, 2)]


def test_definition_in_an_included_file(tmp_path):
    editor = Editor({"main.plsys": '#include "lib.plsys"\nobject { Tr<cursor>ee }\n', "lib.plsys": "Selection Tree { Tree -> box; }\n"}, tmp_path)
    assert spots(editor, editor.at_cursor("textDocument/definition")) == ["lib.plsys:1:11 Tree"]
    assert editor.codes("main.plsys") == []


def test_definition_of_an_include_is_the_file(tmp_path):
    editor = Editor({"main.plsys": '#include "li<cursor>b.plsys"\n', "lib.plsys": ""}, tmp_path)
    (answer,) = editor.at_cursor("textDocument/definition")
    assert answer["uri"] == (tmp_path / "lib.plsys").as_uri()


def test_nothing_is_found_on_a_word_of_the_language():
    editor = Editor("cam<cursor>era { angle 45 }\n")
    assert editor.at_cursor("textDocument/definition") == []
    assert editor.at_cursor("textDocument/references") == []
