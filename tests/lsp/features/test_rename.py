"""Renaming: everywhere, and refused with a sentence."""

from __future__ import annotations

import pytest

from tests.lsp.editor import Editor, Refusal
from tests.lsp.features.test_formatting import applied

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


def renamed(editor: Editor, new: str) -> dict[str, str]:
    """The texts after a rename, by file."""
    changes = editor.at_cursor("textDocument/rename", newName=new)["changes"]
    return {uri.rsplit("/", 1)[-1].removeprefix("untitled:"): edits for uri, edits in changes.items()}


def test_every_occurrence_changes():
    editor = Editor(SCENE)
    edits = renamed(editor, "Oak")["scene.plsys"]
    text = SCENE.replace("<cursor>", "")
    assert applied(text, edits) == text.replace("Tree", "Oak")


def test_a_parameter():
    marked = SCENE.replace("<cursor>", "").replace("trans 0 0 n", "trans 0 0 <cursor>n")
    editor = Editor(marked)
    text = marked.replace("<cursor>", "")
    expected = text.replace("(n >", "(k >").replace("n = 3", "k = 3").replace("--n", "--k").replace("0 0 n", "0 0 k")
    assert applied(text, renamed(editor, "k")["scene.plsys"]) == expected


def test_other_files_of_the_scene(tmp_path):
    files = {"main.plsys": '#include "lib.plsys"\nobject { Tr<cursor>ee }\n', "lib.plsys": "Selection Tree { Tree -> box; }\n"}
    editor = Editor(files, tmp_path)
    found = renamed(editor, "Oak")
    assert {name: len(edits) for name, edits in found.items()} == {"main.plsys": 1, "lib.plsys": 2}


def test_scenes_that_share_a_file(tmp_path):
    files = {
        "lib.plsys": "Selection Tr<cursor>ee { Tree -> box; }\n",
        "one.plsys": '#include "lib.plsys"\nobject { Tree }\n',
        "two.plsys": '#include "lib.plsys"\nobject { Tree }\nSelection Oak { Oak -> box; }\n',
    }
    editor = Editor(files, tmp_path)
    for name in ("one.plsys", "two.plsys"):
        editor.open(name, files[name])
    assert set(renamed(editor, "Elm")) == set(files)
    with pytest.raises(Refusal, match="'Oak' is in this scene already: a Selection"):
        renamed(editor, "Oak")


def test_versions_where_the_client_wants_them():
    editor = Editor(SCENE, client={"workspace": {"workspaceEdit": {"documentChanges": True}}})
    (change,) = editor.at_cursor("textDocument/rename", newName="Oak")["documentChanges"]
    assert change["textDocument"] == {"uri": "untitled:scene.plsys", "version": 1} and len(change["edits"]) == 5


@pytest.mark.parametrize(
    "new, message",
    [
        ("C_less", "'C_less' is in this scene already: a Calculation"),
        ("n", "'n' is in this scene already: a parameter"),
        ("sphere", "'sphere' is a primitive of plsys"),
        ("trans", "'trans' is an operation of plsys"),
        ("if", "'if' is a .*word.* of plsys"),
        ("Bäume", "the letters A to Z"),
        ("2x", "is no name"),
        ("", "is no name"),
        ("a b", "is no name"),
    ],
)
def test_refused(new, message):
    with pytest.raises(Refusal, match=message):
        renamed(Editor(SCENE), new)


def test_a_name_that_is_used_but_not_defined():
    with pytest.raises(Refusal, match="'Fern' is already used"):
        renamed(Editor(SCENE + "object { Fern }\n"), "Fern")


def test_a_name_that_means_something_else_there():
    editor = Editor("#declare P<cursor>aint = pigment { color rgb 1 }\nsphere { 0, 1 texture { pigment { Paint } } }\n")
    with pytest.raises(Refusal, match="'color' has a meaning of its own where 'Paint' stands in line 2"):
        renamed(editor, "color")
    editor = Editor("#declare A<cursor> = 30;\ncamera { angle A }\n")
    assert len(renamed(editor, "angle")["scene.plsys"]) == 2


def test_prepare():
    editor = Editor(SCENE)
    answer = editor.at_cursor("textDocument/prepareRename")
    assert answer["placeholder"] == "Tree" and editor.text_of(answer["range"]) == "Tree"
    assert Editor("object { Tr<cursor>ee }  <cursor>".replace("<cursor>", "", 1)).at_cursor("textDocument/prepareRename") is None
    with pytest.raises(Refusal, match="'sphere' is a primitive of plsys and can't be renamed"):
        Editor(SCENE.replace("<cursor>", "").replace("sphere", "sph<cursor>ere")).at_cursor("textDocument/prepareRename")
    with pytest.raises(Refusal, match="nothing defines 'Tee'"):
        Editor("object { Te<cursor>e }\n").at_cursor("textDocument/prepareRename")


DRAWING = """\
object { Tree }
Selection Tree { C_kind Tree; Tree -> [ trans 0 0 1 ] Twig + Leaf; }
Selection Twig { Twig -> T_lean box; }
Selection Leaf { Leaf -> sphere; }
Calculation C_kind { variants 3; }
Transformation T_lean { roty 90*rand(0); }
"""


@pytest.mark.parametrize("name, asks", [("Tree", True), ("Twig", True), ("C_kind", True), ("Leaf", False), ("T_lean", False)])
def test_a_name_that_enters_random_keys_is_renamed_after_a_question(name, asks):
    """The editor shows the annotation and asks; one that has none for edits renames as ever."""
    marked = DRAWING.replace(f" {name} {{", f" <cursor>{name} {{", 1) if name != "Tree" else DRAWING.replace("Selection Tree", "Selection <cursor>Tree")
    client = {"workspace": {"workspaceEdit": {"documentChanges": True, "changeAnnotationSupport": {}}}}
    answer = Editor(marked, client=client).at_cursor("textDocument/rename", newName="Other")
    edits = [edit for change in answer["documentChanges"] for edit in change["edits"]]
    assert len(edits) >= 2 and all(("annotationId" in edit) == asks for edit in edits)
    assert ("changeAnnotations" in answer) == asks
    plain = Editor(marked).at_cursor("textDocument/rename", newName="Other")
    assert all("annotationId" not in edit for edits in plain["changes"].values() for edit in edits)
