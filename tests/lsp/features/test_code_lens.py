"""Code lenses."""

from __future__ import annotations

from tests.lsp.editor import Editor

SCENE = "camera { angle 45 }\nobject { A }\nobject { A }\nSelection A { A -> T box; }\nTransformation T { scale 2; }\nParameter p = 1;\n"


def lenses(editor: Editor) -> list[tuple[str, str]]:
    """The text under each lens, and its title."""
    found = []
    for lens in editor.in_file("textDocument/codeLens"):
        if "command" not in lens:
            lens = editor.request("codeLens/resolve", lens)
        found.append((editor.text_of(lens["range"]), lens["command"]["title"]))
    return found


def test_references_and_preview():
    assert lenses(Editor(SCENE)) == [
        ("camera", "▶ Preview"), ("A", "3 references"), ("T", "1 reference"), ("p", "0 references"),
    ]


def test_counts_follow_edits():
    editor = Editor(SCENE)
    editor.change("object { A }\n", "")
    assert ("A", "2 references") in lenses(editor)


def test_references_can_be_shown():
    editor = Editor(SCENE)
    lens = next(each for each in editor.in_file("textDocument/codeLens") if editor.text_of(each["range"]) == "A")
    command = editor.request("codeLens/resolve", lens)["command"]
    uri, position, locations = command["arguments"]
    assert command["command"] == "plsys.showReferences" and uri == editor.uri("scene.plsys")
    assert position == lens["range"]["start"] and [editor.spot(each) for each in locations][0] == "scene.plsys:2:10 A"


def test_what_is_whole_is_answered_as_it_is():
    editor = Editor(SCENE)
    preview = next(each for each in editor.in_file("textDocument/codeLens") if "command" in each)
    assert editor.request("codeLens/resolve", preview) == preview


def test_a_library_has_no_preview():
    assert lenses(Editor("Transformation T { scale 2; }\n")) == [("T", "0 references")]


def test_a_long_file_has_lenses_on_selections_only():
    text = "".join(f"Selection S{i} {{ S{i} -> T{i} box; }}\nTransformation T{i} {{ scale 2; }}\n" for i in range(600))
    editor = Editor(text)
    editor.published()
    answer = editor.in_file("textDocument/codeLens")
    assert len(answer) == 600 and all(each["data"]["name"].startswith("S") for each in answer)
