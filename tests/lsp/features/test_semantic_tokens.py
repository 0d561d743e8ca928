"""Semantic tokens: each word's meaning; ranges and deltas agree with the whole."""

from __future__ import annotations

from tests.lsp.editor import Editor

SCENE = """\
// größe 🌳
camera { location <0, -14, 5> }
#declare Bark = texture { pigment { color Red } }
Parameter order = 10 [0 to 20];
object { Tree(2) texture { Bark } }
Selection Tree(k) { if (n > pi) Tree -> C_one [ roty max(n, k) ] Bark sphere; }
Calculation C_one { n = order; }
/* two
lines */
"""


def tokens(editor: Editor, data: list[int]) -> list[str]:
    """``line:text type modifiers`` of each token."""
    legend = editor.server["semanticTokensProvider"]["legend"]
    found, line, column = [], 0, 0
    lines = editor.texts["scene.plsys"].splitlines()
    for i in range(0, len(data), 5):
        delta_line, delta_column, length, kind, modifiers = data[i : i + 5]
        column = delta_column if delta_line else column + delta_column
        line += delta_line
        units = lines[line].encode("utf-16-le")[2 * column : 2 * (column + length)].decode("utf-16-le")
        names = [name for bit, name in enumerate(legend["tokenModifiers"]) if modifiers >> bit & 1]
        found.append(" ".join([f"{line + 1}:{units}", legend["tokenTypes"][kind], *names]))
    return found


def full(editor: Editor) -> list[str]:
    return tokens(editor, editor.in_file("textDocument/semanticTokens/full")["data"])


def test_all_kinds():
    found = full(Editor(SCENE))
    assert found[:5] == [
        "1:// größe 🌳 comment",
        "2:camera type defaultLibrary",
        "2:location property defaultLibrary",
        "2:0 number",
        "2:14 number",
    ]
    for expected in (
        "3:Bark struct declaration", "3:pigment type defaultLibrary", "3:color property defaultLibrary",
        "3:Red enumMember defaultLibrary", "4:order variable declaration readonly", "4:to keyword", "5:Tree class",
        "5:Bark struct", "6:Selection keyword", "6:Tree class declaration", "6:k parameter modification",
        "6:pi variable readonly defaultLibrary", "6:C_one function", "6:roty method defaultLibrary",
        "6:max function defaultLibrary", "6:sphere type defaultLibrary", "7:n parameter modification", "7:order variable readonly",
        "8:/* two comment", "9:lines */ comment",
    ):  # fmt: skip
        assert expected in found, expected


def test_a_name_without_meaning_has_no_colour():
    assert not any("Tee" in each for each in full(Editor("object { Tee }\n")))


def test_a_range_is_part_of_the_whole():
    editor = Editor(SCENE)
    range_ = {"start": {"line": 4, "character": 3}, "end": {"line": 6, "character": 0}}
    part = tokens(editor, editor.in_file("textDocument/semanticTokens/range", range=range_)["data"])
    assert part == [each for each in full(editor) if each[0] in "567"]


def test_a_delta_gives_the_whole():
    editor = Editor(SCENE)
    before = editor.in_file("textDocument/semanticTokens/full")
    editor.change("Selection Tree(k)", "\n\nSelection Tree(k)")
    answer = editor.in_file("textDocument/semanticTokens/full/delta", previousResultId=before["resultId"])
    data = before["data"]
    (edit,) = answer["edits"]
    assert len(edit["data"]) <= 5
    data[edit["start"] : edit["start"] + edit["deleteCount"]] = edit["data"]
    assert data == editor.in_file("textDocument/semanticTokens/full")["data"]
    again = editor.in_file("textDocument/semanticTokens/full/delta", previousResultId="unknown")
    assert "data" in again


def test_no_change_is_no_edit():
    editor = Editor(SCENE)
    first = editor.in_file("textDocument/semanticTokens/full")
    assert editor.in_file("textDocument/semanticTokens/full/delta", previousResultId=first["resultId"])["edits"] == []


def test_broken_text_has_colours_too():
    assert "1:Calculation keyword" in full(Editor("Calculation C { n = \n"))
    assert full(Editor("")) == []
