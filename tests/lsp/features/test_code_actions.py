"""Code actions over the protocol; what each does to a text is tested with the compiler's."""

from __future__ import annotations

from tests.lsp.editor import Editor
from tests.lsp.features.test_formatting import applied


def actions(editor: Editor, **context) -> dict[str, dict]:
    """The actions at the cursor, by title."""
    position = editor.cursor["position"]
    range_ = {"start": position, "end": position}
    answer = editor.in_file("textDocument/codeAction", range=range_, context={"diagnostics": [], **context})
    return {each["title"]: each for each in answer}


def after(editor: Editor, action: dict) -> str:
    return applied(editor.texts["scene.plsys"], action["edit"]["changes"]["untitled:scene.plsys"])


def test_a_quick_fix_with_its_diagnostic():
    editor = Editor("object { Te<cursor>e }\nSelection Tree { Tree -> box; }\n")
    (sent,) = [each for each in editor.published() if each["code"] == "unknown-name"]
    found = actions(editor, diagnostics=[sent])
    action = found["Replace by 'Tree'"]
    assert action["kind"] == "quickfix" and action["isPreferred"] and action["diagnostics"] == [sent]
    assert after(editor, action) == "object { Tree }\nSelection Tree { Tree -> box; }\n"
    assert not found["Define the Selection 'Tee'"]["isPreferred"]


def test_a_refactoring():
    editor = Editor("object { A }\nSelection A { A -> [ trans 0 <cursor>0 1 ] box; }\n")
    action = actions(editor)["Extract Transformation 'T_new'"]
    assert action["kind"] == "refactor.extract" and "diagnostics" not in action
    assert after(editor, action) == "object { A }\nSelection A { A -> T_new box; }\nTransformation T_new { trans 0 0 1; }\n"


def test_lines_end_as_in_the_document():
    for line_break in ("\r\n", "\r"):
        text = f"object {{ A }}{line_break}Selection A {{ A -> [ trans 0 0 <cursor>1 ] box; }}{line_break}"
        edits = actions(Editor(text))["Extract Transformation 'T_new'"]["edit"]["changes"]["untitled:scene.plsys"]
        assert [edit["newText"] for edit in edits] == ["T_new", f"{line_break}Transformation T_new {{ trans 0 0 1; }}"]


def test_only_the_wanted_kinds():
    editor = Editor("object { A }\nSelection A { A -> [ trans 0 <cursor>0 1 ] Box; }\n")
    assert {each["kind"] for each in actions(editor, only=["refactor"]).values()} == {"refactor.extract"}
    assert actions(editor, only=["source.organizeImports"]) == {}


def test_edits_in_other_files(tmp_path):
    files = {
        "main.plsys": '#include "lib.plsys"\nobject { A }\nSelection A { A -> T_<cursor>up box; }\n',
        "lib.plsys": "Transformation T_up { trans 0 0 1; }\n",
    }
    editor = Editor(files, tmp_path, client={"workspace": {"workspaceEdit": {"documentChanges": True}}})
    position = editor.cursor["position"]
    (action,) = editor.in_file("textDocument/codeAction", "main.plsys", range={"start": position, "end": position}, context={})
    changes = {change["textDocument"]["uri"]: change["edits"] for change in action["edit"]["documentChanges"]}
    assert set(changes) == {editor.uri("main.plsys"), editor.uri("lib.plsys")}
    assert [edit["newText"] for edit in changes[editor.uri("main.plsys")]] == ["[ trans 0 0 1 ]"]


def test_what_another_scene_uses_stays(tmp_path):
    """Neither is what the scene `other` uses taken away, nor are its arguments left behind."""
    files = {
        "main.plsys": '#include "lib.plsys"\nobject { Tree }\nSelection Tree { Tree -> T_<cursor>up Leaf; }\n',
        "lib.plsys": "Transformation T_up { trans 0 0 1; }\nSelection Leaf { [ n = 3 ] Leaf; if (n > 0) Leaf -> box + [ --n; trans 1 0 0 ] Leaf; }\n",
        "other.plsys": '#include "lib.plsys"\nobject { Leaf }\nobject { Q }\nSelection Q { Q -> T_up Leaf; }\n',
    }
    editor = Editor({name: files[name] for name in ("main.plsys", "lib.plsys")}, tmp_path)
    where = {"range": dict.fromkeys(("start", "end"), editor.cursor["position"]), "context": {}}
    assert [each["title"] for each in editor.in_file("textDocument/codeAction", "main.plsys", **where)] == ["Inline 'T_up'"]
    editor.open("other.plsys", files["other.plsys"])
    assert editor.in_file("textDocument/codeAction", "main.plsys", **where) == []
    editor.open("lib.plsys", files["lib.plsys"])
    head = dict.fromkeys(("start", "end"), {"line": 1, "character": 12})
    found = editor.in_file("textDocument/codeAction", "lib.plsys", range=head, context={})
    assert not [each for each in found if each["title"].startswith("Turn into")]
