"""Diagnostics while editing: published, and on request."""

from __future__ import annotations

from tests.lsp.editor import Editor

SCENE = "object { Tree }\nSelection Tree { Tree -> C_one sphere; }\nCalculation C_one { n = 1; }\n"


def test_an_edit_brings_a_message_and_takes_it_away():
    editor = Editor(SCENE)
    assert editor.published() == []
    editor.change("object { Tree }", "object { Tee }")
    (message,) = editor.published()
    assert message["code"] == "unknown-name" and "did you mean 'Tree'?" in message["message"]
    assert editor.text_of(message["range"]) == "Tee"
    editor.change("Tee", "Tree")
    assert editor.published() == []


def test_blocks_that_use_a_name_follow_its_definition():
    editor = Editor(SCENE)
    editor.change("Calculation C_one", "Calculation C_two")
    assert [editor.text_of(each["range"]) for each in editor.published()] == ["C_one"]
    editor.change("Calculation C_two { n = 1; }", "Selection C_one { C_one -> box; }")
    assert editor.codes() == ["wrong-kind"]


def test_a_constant_of_a_constant():
    editor = Editor("#declare A = 1;\n#declare B = A / 1;\nsphere { 0, 1/B }\n")
    assert editor.codes() == []
    editor.change("#declare A = 1", "#declare A = 0")
    assert editor.codes() == ["not-finite"]


def test_a_half_typed_block_does_not_flood_the_rest():
    editor = Editor(SCENE)
    editor.change("C_one { n = 1; }", "C_one { n = ")
    assert set(editor.codes()) <= {"missing", "syntax", "unclosed"}
    editor.change("Calculation C_one { n = ", "Calculat")
    assert "unknown-name" not in editor.codes()


def test_messages_move_with_the_text_above():
    editor = Editor("object { Tee }\n")
    editor.published()
    editor.change("object", "\n\nobject")
    assert editor.published()[0]["range"]["start"] == {"line": 2, "character": 9}


def test_two_cameras():
    editor = Editor("camera { angle 45 }\nobject { A }\nSelection A { A -> box; }\ncamera { angle 46 }\n")
    (message,) = editor.published()
    assert message["code"] == "duplicate-name" and message["range"]["start"]["line"] == 3


def test_duplicates_say_where_the_first_is():
    editor = Editor("Calculation C { n = 1; }\nCalculation C { n = 2; }\n")
    (message,) = editor.published()
    assert message["code"] == "duplicate-name" and message["range"]["start"]["line"] == 1
    assert message["relatedInformation"][0]["location"]["range"]["start"] == {"line": 0, "character": 12}
    editor.change("Calculation C { n = 1; }\n", "")
    assert editor.published() == []


def test_pull_says_when_nothing_changed():
    editor = Editor("object { Tee }\n", client={"textDocument": {"diagnostic": {}}})
    first = editor.in_file("textDocument/diagnostic")
    assert first["kind"] == "full" and len(first["items"]) == 1
    again = editor.in_file("textDocument/diagnostic", previousResultId=first["resultId"])
    assert again == {"kind": "unchanged", "resultId": first["resultId"]}
    editor.published()
    assert not any(m.get("method") == "textDocument/publishDiagnostics" for m in editor.sent)


def test_a_missing_include_and_its_arrival(tmp_path):
    editor = Editor({"main.plsys": '#include "lib.plsys"\nobject { Tree }\n'}, tmp_path)
    assert editor.codes("main.plsys") == ["include", "unknown-name"]
    (tmp_path / "lib.plsys").write_text("Selection Tree { Tree -> box; }\n")
    editor.notify("workspace/didChangeWatchedFiles", {"changes": [{"uri": editor.uri("lib.plsys"), "type": 1}]})
    assert editor.codes("main.plsys") == []
    (tmp_path / "lib.plsys").write_text("Selection Bush { Bush -> box; }\n")
    editor.notify("workspace/didChangeWatchedFiles", {"changes": [{"uri": editor.uri("lib.plsys"), "type": 2}]})
    assert editor.codes("main.plsys") == ["unknown-name"]


def test_errors_of_an_included_file_that_is_not_open(tmp_path):
    files = {
        "main.plsys": '#include "lib.plsys"\nobject { Tree }\n',
        "lib.plsys": '#include "deep.plsys"\nSelection Tree { Tree -> box; }\n',
        "deep.plsys": "\nTransformation T_up { trans 0 1; }\nTransformation T_right { trans 1 0 0 }\n",
    }
    editor = Editor(files, tmp_path)
    (found,) = [each for each in editor.published("main.plsys") if each["code"] == "include"]
    assert found["message"] == "'deep.plsys' has 2 errors, the first in line 2: trans takes 3 arguments, not 2"
    assert editor.text_of(found["range"], "main.plsys") == '"lib.plsys"' and found["severity"] == 1
    (related,) = found["relatedInformation"]
    assert related["location"]["uri"] == editor.uri("deep.plsys")
    editor.open("deep.plsys", files["deep.plsys"])  # now they are seen where they are
    assert "include" not in editor.codes("main.plsys") and editor.codes("deep.plsys").count("wrong-arguments") == 1


def test_an_included_file_is_seen_as_part_of_its_scene(tmp_path):
    files = {"main.plsys": '#include "lib.plsys"\n#declare Height = 2;\n', "lib.plsys": "sphere { 0, Height }\n"}
    editor = Editor(files, tmp_path)
    editor.open("lib.plsys", files["lib.plsys"])
    assert editor.codes("lib.plsys") == []
    editor.change("#declare Height = 2;", "", "main.plsys")
    assert editor.codes("lib.plsys") == ["unknown-name"]


def test_whole_file_checks_add_what_blocks_alone_do_not_show():
    editor = Editor("object { A }\nSelection A { A -> [ trans 0 0 1 ] A; }\nCalculation C { n = 1; }\n")
    assert editor.published() == []
    assert {each["code"] for each in editor.checked()} >= {"endless", "unused", "no-camera"}
    editor.change("C { n = 1; }", "C { n = 2; }")
    assert "unused" not in editor.codes() and "endless" in editor.codes()


def test_whole_file_checks_of_included_files(tmp_path):
    files = {"main.plsys": '#include "lib.plsys"\nobject { A }\n', "lib.plsys": "\nSelection A { A -> [ trans 0 0 1 ] A; }\n"}
    editor = Editor(files, tmp_path)
    editor.open("lib.plsys", files["lib.plsys"])
    editor.checked("main.plsys")
    (message,) = [each for each in editor.checked("lib.plsys") if each["code"] == "endless"]
    assert message["range"]["start"] == {"line": 1, "character": 10}


def test_a_change_that_makes_no_sense_loses_none_before_it():
    editor = Editor("object { A }\nSelection A { A -> box; }\n")
    place = {"line": 0, "character": 10}
    good = {"range": {"start": place, "end": place}, "text": "B"}
    document = {"uri": editor.uri("scene.plsys"), "version": 2}
    editor.notify("textDocument/didChange", {"textDocument": document, "contentChanges": [good, {"range": 3}]})
    assert editor.codes() == ["unknown-name"]


def test_of_very_many_messages_the_most_severe_are_told():
    unused = "".join(f"Transformation T{i} {{ scale 2; }}\n" for i in range(600))
    editor = Editor(unused + "object { S }\nSelection S { S -> Flat sphere; }\nTransformation Flat { scale 0; }\n")
    found = editor.checked()
    assert len(found) == 500 and "singular" in {each["code"] for each in found}
    places = [each["range"]["start"]["line"] for each in found]
    assert places == sorted(places)
