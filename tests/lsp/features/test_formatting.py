"""Formatting of documents, ranges, and on type."""

from __future__ import annotations

from tests.lsp.editor import Editor, offset_of


def applied(text: str, edits: list[dict]) -> str:
    """``text`` after the protocol's edits, all in the coordinates of ``text``."""
    for edit in reversed(sorted(edits, key=lambda each: offset_of(text, each["range"]["start"]))):
        start, end = (offset_of(text, edit["range"][side]) for side in ("start", "end"))
        text = text[:start] + edit["newText"] + text[end:]
    return text


def after(editor: Editor, edits: list[dict]) -> str:
    return applied(editor.texts["scene.plsys"], edits)


def typed(marked: str, character: str) -> str:
    editor = Editor(marked)
    edits = editor.at_cursor("textDocument/onTypeFormatting", ch=character, options={"tabSize": 4, "insertSpaces": True})
    return after(editor, edits)


def test_a_document():
    editor = Editor("camera{angle 45}\nSelection A{A->box;}\n")
    edits = editor.in_file("textDocument/formatting", options={})
    assert after(editor, edits) == "camera { angle 45 }\nSelection A { A -> box; }\n"


def test_a_formatted_document_needs_no_edit():
    assert Editor("camera { angle 45 }\n").in_file("textDocument/formatting", options={}) == []


def test_only_what_changed_is_edited():
    editor = Editor("camera { angle 45 }\nCalculation C { n=1; }\n")
    edits = editor.in_file("textDocument/formatting", options={})
    assert [(each["range"]["start"]["line"], each["newText"]) for each in edits] == [(1, " "), (1, " ")]


def test_broken_blocks_stay():
    editor = Editor("Calculation C{n=1;}\nCalculation D{n=;}\nCalculation E{n=1;}\n")
    edits = editor.in_file("textDocument/formatting", options={})
    assert after(editor, edits) == "Calculation C { n = 1; }\nCalculation D{n=;}\nCalculation E { n = 1; }\n"


def test_a_range():
    editor = Editor("Calculation C {\n  n=1;\n  m=2;\n}\n")
    range_ = {"start": {"line": 2, "character": 3}, "end": {"line": 2, "character": 4}}
    edits = editor.in_file("textDocument/rangeFormatting", range=range_, options={})
    assert after(editor, edits) == "Calculation C {\n  n=1;\n    m = 2;\n}\n"


def test_a_semicolon_formats_its_statement():
    assert typed("Calculation C\n{\n  n=1;\n  m=2;<cursor>\n}\n", ";") == "Calculation C\n{\n  n=1;\n    m = 2;\n}\n"


def test_a_brace_formats_its_body():
    assert typed("object { A }\nSelection A\n{\nA->box;\n  }<cursor>\ncamera{}\n", "}") == "object { A }\nSelection A\n{\n    A -> box;\n}\ncamera{}\n"


def test_a_new_line_is_indented():
    assert typed("Calculation C\n{\n<cursor>\n}\n", "\n") == "Calculation C\n{\n    \n}\n"
    assert typed("Calculation C {\n    n = \n<cursor>", "\n") == "Calculation C {\n    n = \n    "
    assert typed("Calculation C { }\n<cursor>\n", "\n") == "Calculation C { }\n\n"


def test_a_brace_in_broken_text_goes_below_its_opener():
    assert typed("Calculation C\n{\n    n = ;\n    }<cursor>\n", "}") == "Calculation C\n{\n    n = ;\n}\n"


def test_braces_in_comments_and_strings_do_not_count():
    assert typed('Parameter p = 1 "{"; // {\n<cursor>\n', "\n") == 'Parameter p = 1 "{"; // {\n\n'


def test_what_was_prepared_in_a_pause_is_what_formats(monkeypatch):
    monkeypatch.setattr("plsys.lsp.updates.SLICE", 0.0)
    text = "".join(f"Calculation C{i}{{n=1;}}\n" for i in range(20)) + "Calculation D{ n = ; }\n"
    prepared, fresh = Editor(text), Editor(text)
    prepared.published()
    slices = 1
    while not prepared.session.prepare():
        slices += 1
    assert slices > 1
    options = {"tabSize": 4, "insertSpaces": True}
    for old, new in (("n=1", "n=1"), ("C0{n=1;}\n", ""), ("n=1", "n  =  1"), ("n = ;", "n=2;")):
        for editor in (prepared, fresh):
            editor.change(old, new)
        answers = [editor.in_file("textDocument/formatting", options=options) for editor in (prepared, fresh)]
        assert answers[0] == answers[1] and answers[0]
        prepared.published()
        while not prepared.session.prepare():
            pass


def test_a_closed_file_is_not_prepared_further(monkeypatch):
    monkeypatch.setattr("plsys.lsp.updates.SLICE", 0.0)
    editor = Editor("".join(f"Calculation C{i}{{n=1;}}\n" for i in range(40)))
    editor.published()
    assert not editor.session.prepare()
    editor.notify("textDocument/didClose", {"textDocument": {"uri": editor.uri("scene.plsys")}})
    assert editor.session.prepare()
