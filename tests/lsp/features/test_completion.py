"""Completion."""

from __future__ import annotations

import re

import pytest
from plsys.compiler.analysis import Document, Project, vocabulary
from plsys.lsp import snippets
from tests.lsp.editor import Editor

SNIPPETS = {"textDocument": {"completion": {"completionItem": {"snippetSupport": True}}}}
NAMES = """
Parameter order = 10 [0 to 20] "Age";
#declare Size = 2.5;
#declare Bark = texture { pigment { color Red } }
Selection Tree { C_begin Tree; Tree -> box; }
Selection Branch(length, width) { Branch -> box; }
Calculation C_begin { n = 3; angle2 = 60; }
Transformation T_up { trans 0 0 1; }
Texture X_leaf { pigment { color Green } }
Texture X_old { pigment { color rgb <n, 0, 0> } }
object { Tree texture { Bark } }
"""


def items(text: str, client: dict | None = None) -> list[dict]:
    editor = Editor(text + NAMES, client=client)
    return editor.at_cursor("textDocument/completion")["items"]


def labels(text: str) -> set[str]:
    return {each["label"] for each in items(text)}


@pytest.mark.parametrize(
    ("text", "some", "none"),
    [
        ("<cursor>", {"Selection", "camera", "#declare", "sphere", "scene", "recursion"}, {"location", "roty", "Tree", "sin"}),
        ("#<cursor>", {"#declare", "#include"}, {"camera"}),
        ("Selection A { A -> <cursor>", {"Tree", "Branch", "T_up", "C_begin", "X_leaf", "Bark", "sphere", "cone"}, {"order", "n", "sin", "camera", "roty", "plane"}),
        ("Selection A { A -> box + T<cursor>", {"Tree", "T_up", "torus", "triangle"}, {"Branch", "sphere"}),
        ("Selection A { <cursor>", {"A", "if", "C_begin"}, {"sphere", "roty", "else"}),
        ("Selection A { if (n > 0) A -> box; <cursor>", {"A", "if", "else", "else if"}, {"C_begin"}),
        ("Selection A(age) { if (<cursor>", {"age", "n", "order", "Size", "sin", "pi"}, {"Tree", "sphere", "roty", "Bark"}),
        ("Calculation C { <cursor>", {"n", "angle2", "variants"}, {"order", "roty", "Tree", "sin"}),
        ("Calculation C { n = <cursor>", {"n", "order", "Size", "clamp", "rand"}, {"roty", "variants", "Tree"}),
        ("Transformation T { <cursor>", {"trans", "roty", "scale"}, {"variants", "n", "translate"}),
        ("Transformation T { roty <cursor>", {"n", "order", "sin"}, {"trans", "Tree"}),
        ("Selection A { A -> [ <cursor>", {"trans", "n", "variants"}, {"Tree", "sphere"}),
        ("Selection A { A -> Branch(<cursor>", {"n", "order"}, {"Tree", "sphere"}),
        ("camera { <cursor>", {"location", "look_at", "angle"}, {"translate", "pigment", "radius", "sphere"}),
        ("camera { location <0, <cursor>", {"order", "Size", "sin"}, {"look_at", "n"}),
        ("camera { location <cursor>", {"<x, y, z>", "y"}, {"look_at", "n"}),
        ("light_source { <0, 1, 2> <cursor>", {"color", "spotlight", "translate"}, {"location", "pigment"}),
        ("sphere { 0, 1 <cursor>", {"texture", "pigment", "translate", "no_shadow"}, {"location", "Bark", "sphere"}),
        ("sphere { 0, 1 texture { <cursor>", {"Bark", "pigment", "finish", "scale"}, {"Tree", "X_leaf2", "ambient"}),
        ("sphere { 0, 1 pigment { color <cursor>", {"rgb", "rgbt", "Red", "SkyBlue"}, {"checker", "Bark", "n"}),
        ("sphere { 0, 1 pigment { <cursor>", {"color", "checker", "gradient", "color_map", "Red"}, {"ambient", "Bark"}),
        ("sphere { 0, 1 finish { <cursor>", {"ambient", "diffuse", "phong_size"}, {"color", "translate"}),
        ("object { <cursor>", {"Tree", "Branch", "sphere"}, {"Bark", "location", "T_up", "translate", "texture"}),
        ("object { Tree <cursor>", {"translate", "texture", "no_shadow"}, {"Tree", "sphere", "object"}),
        ("Texture Y { pigment { color rgb <<cursor>", {"n", "order"}, {"Tree"}),
        ("#declare B = <cursor>", {"texture", "pigment", "rgb", "sin", "Size"}, {"camera", "n", "Tree"}),
        ("union { <cursor>", {"sphere", "object"}, {"location", "texture", "translate", "Tree"}),
        ("union { sphere { 0, 1 } <cursor>", {"sphere", "object", "texture", "translate"}, {"location"}),
        ("union { sphere { 0, 1 } scale 2 <cursor>", {"texture", "translate"}, {"sphere", "object"}),
        ("sphere { <cursor>", {"<x, y, z>", "Size", "x"}, {"texture", "translate", "n"}),
        ("sphere { <0, 0, 1>, <cursor>", {"Size", "order", "sin"}, {"texture", "x", "<x, y, z>", "rand"}),
        ("sphere { <0, 0, 1> <cursor>", {"Size"}, {"texture", "x"}),
        ("cylinder { 0, <cursor>", {"<x, y, z>", "x"}, {"texture"}),
        ("torus { <cursor>", {"Size"}, {"x", "texture"}),
        ("light_source { <cursor>", {"<x, y, z>", "Size"}, {"color", "spotlight", "Red"}),
        ("camera { angle <cursor>", {"Size", "sin"}, {"x", "rand", "n", "location"}),
        ("camera { look_at 0 <cursor>", {"angle"}, {"location", "sky", "right"}),
        ("sphere { 0, 1 pigment { gradient x color_map { <cursor>", {"[ ]"}, {"Red", "color", "n"}),
        ("sphere { 0, 1 pigment { gradient x color_map { [<cursor>", {"Size"}, {"Red", "n", "x"}),
        ("sphere { 0, 1 pigment { gradient x color_map { [0.5 <cursor>", {"Red", "color", "rgb"}, {"Size", "[ ]"}),
        ("sphere { 0, 1 finish { phong <cursor>", {"Size", "sin"}, {"x", "n"}),
        ("object { Tree texture { <cursor>", {"Bark", "X_leaf", "pigment"}, {"X_old"}),
        ("Texture X_old2 { <cursor>", {"Bark", "X_old", "pigment"}, {"X_old2"}),
        ("#declare B = hash(<cursor>", {"Size", "order"}, {"n", "rand"}),
        ("#declare B = 3 <cursor>", set(), {"Size", "texture", "+"}),
        ("#declare B = 3;\n<cursor>", {"camera", "Selection"}, {"Size", "texture", "sin"}),
        ("#declare B = 3\nSel<cursor>", {"Selection"}, {"Size"}),
        ("Parameter p = <cursor>", {"order", "Size", "sqrt"}, {"n", "rand", "p", "texture"}),
        ("Parameter p = 3 [<cursor>", {"order", "Size"}, {"n", "p", "to"}),
        ("Parameter p = 3 [0 <cursor>", {"to"}, {"Size", "order"}),
        ("Parameter p = 3 [0 to <cursor>", {"Size"}, {"to", "n"}),
        ("Parameter p = 3;\n<cursor>", {"camera", "Selection"}, {"Size", "sin"}),
        ("Selection A { A -> box <cursor>", {"+"}, {"sphere", "T_up", "Tree"}),
        ("Selection A { A -> Branch(1, 2) <cursor>", {"+"}, {"sphere", "T_up", "Tree"}),
        ("Selection A { A -> T_up (<cursor>", {"Tree", "T_up", "sphere"}, {"n", "sin", "order"}),
        ("Selection A { A -> T_up (box + <cursor>", {"Tree", "T_up", "sphere"}, {"n", "sin", "order"}),
        ("Selection A { A -> 3: box | <cursor>", {"n", "Size", "max"}, {"Tree", "sphere"}),
        ("Selection A { A -> 3: <cursor>", {"Tree", "sphere"}, {"n", "Size"}),
        ("Selection A { A -> box; <cursor>", {"A", "if"}, {"else", "else if"}),
        ("Selection A { C_begin <cursor>", {"A", "C_begin"}, {"if", "sphere", "T_up"}),
        ("Calculation C { ++<cursor>", {"n", "angle2"}, {"order", "Size", "sin", "variants"}),
        ("Calculation C { n = 1<cursor>", set(), {"n", "sin"}),
        ("Transformation T { roty n <cursor>", set(), {"n", "sin"}),
        ("Transformation T { trans n*2 <cursor>", {"n", "sin"}, {"trans"}),
        ("// plsys-ignore: un<cursor>", {"unused", "unreachable", "unproven"}, {"unknown-name", "unassigned"}),
        ("// cam<cursor>", set(), {"camera"}),
        ('Parameter a = 1 "ca<cursor>', set(), {"camera"}),
        ("Selection A { A -> Twig + sphere; }\nSelection <cursor>", {"Twig"}, {"A", "sphere", "camera"}),
    ],
)
def test_only_what_can_stand_here(text, some, none):
    found = labels(text)
    assert some <= found, some - found
    assert not none & found, none & found


def test_what_fits_best_comes_first():
    found = [each["label"] for each in items("Selection A { A -> T<cursor>")]
    assert found[:2] == ["Tree", "T_up"] and found.index("torus") > 1
    assert [each["sortText"] for each in items("Selection A { A -> T<cursor>")] == sorted(f"{i:04d}" for i in range(len(found)))


def test_half_typed_text_is_replaced():
    (found,) = [each for each in items("camera { loc<cursor>") if each["label"] == "location"]
    assert found["textEdit"]["range"] == {"start": {"line": 0, "character": 9}, "end": {"line": 0, "character": 12}}
    (found,) = [each for each in items("#dec<cursor>") if each["label"] == "#declare"]
    assert found["textEdit"]["range"]["start"]["character"] == 0


@pytest.mark.parametrize(
    ("text", "label", "expected"),
    [
        ("Calculation C { n = cl<cursor>", "clamp", "clamp(${1:x}, ${2:low}, ${3:high})"),
        ("Calculation C { n = mi<cursor>", "min", "min(${1:a}, ${2:b})"),
        ("Transformation T { tr<cursor>", "trans", "trans ${1:0} ${2:0} ${3:1.99};$0"),
        ("Selection A { A -> [ ro<cursor>", "roty", "roty ${1:30}$0"),
        ("Selection A { A -> Br<cursor>", "Branch", "Branch(${1:length}, ${2:width})"),
        ("Selection A { A -> to<cursor>", "torus", "torus(${1:minor_radius})"),
        ("Selection A { A<cursor>", "A", "A -> $0;"),
        ("Calculation C { n<cursor>", "n", "n = $0;"),
        ("camera { lo<cursor>", "location", "location <${1:0}, ${2:0}, ${3:-5}>"),
        ("camera { an<cursor>", "angle", "angle ${1:45}"),
        ("sphere { 0, 1 pi<cursor>", "pigment", "pigment { $0 }"),
        ("background { co<cursor>", "color", "color rgb <${1:1}, ${2:1}, ${3:1}>"),
    ],
)
def test_snippets(text, label, expected):
    found = next(each for each in items(text, SNIPPETS) if each["label"] == label)
    assert (found["insertTextFormat"], found["textEdit"]["newText"]) == (2, expected)
    plain = next(each for each in items(text) if each["label"] == label)
    assert "insertTextFormat" not in plain and "$" not in plain["textEdit"]["newText"]


def test_snippets_of_blocks_and_definitions_make_scenes():
    texts = [snippets.block(vocabulary.BLOCKS[name]) for name in ("camera", "light_source", "background", "sphere", "box", "cone")]
    texts += [text for _, text in snippets.WHOLE.values()]
    texts += [text for name, text in snippets.DEFINITIONS.items() if not name.startswith("#")]
    for snippet in texts:
        known = dict(re.findall(r"\$\{(\d+):((?:[^{}\\]|\\.)*)\}", snippet))
        filled = re.sub(r"\$\{\d+:((?:[^{}\\]|\\.)*)\}", r"\1", snippet)
        filled = re.sub(r"\$(\d+)", lambda match: known.get(match[1], ""), filled)
        project = Project()
        document = project.open(None, filled.encode(), name="snippet")
        project.work()
        errors = [each.diagnostic.message for each in project.messages(document) if each.diagnostic.severity == "error"]
        errors = [each for each in errors if "nothing assigns" not in each]
        assert errors == [], filled
        assert isinstance(document, Document)


def test_documentation_is_resolved_lazily():
    editor = Editor("Calculation C { n = cl<cursor>" + NAMES, client=SNIPPETS)
    item = next(each for each in editor.at_cursor("textDocument/completion")["items"] if each["label"] == "clamp")
    assert "documentation" not in item and item["detail"] == "clamp(x, low, high)"
    text = editor.request("completionItem/resolve", item)["documentation"]["value"]
    assert "not below low" in text
    editor = Editor("camera { an<cursor>" + NAMES)
    item = next(each for each in editor.at_cursor("textDocument/completion")["items"] if each["label"] == "angle")
    text = editor.request("completionItem/resolve", item)["documentation"]["value"]
    assert "degrees" in text and "above 0 and below 180" in text
    editor = Editor("Transformation T { roty or<cursor>" + NAMES)
    item = next(each for each in editor.at_cursor("textDocument/completion")["items"] if each["label"] == "order")
    assert "Parameter order = 10" in item["detail"]
    assert "Age" in editor.request("completionItem/resolve", item)["documentation"]["value"]


def test_parameters_have_their_values():
    text = "object { A }\nSelection A { C_a A; if (n > 0) A -> box + [ --n; rotz <cursor> ] A; }\nCalculation C_a { n = 3; }\n"
    editor = Editor(text.replace("<cursor>", "0"))
    editor.check_whole()
    position = {"line": 1, "character": text.split("\n")[1].index("<cursor>")}
    editor.change("rotz 0", "rotz ")
    answer = editor.in_file("textDocument/completion", position=position)["items"]
    assert next(each["detail"] for each in answer if each["label"] == "n") == "parameter, always 3"


def test_file_paths(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "leaf.obj").write_text("")
    (tmp_path / "lib.plsys").write_text("")
    (tmp_path / "notes.txt").write_text("")

    def found(text: str) -> list[str]:
        editor = Editor({"main.plsys": text}, tmp_path)
        return [each["label"] for each in editor.at_cursor("textDocument/completion")["items"]]

    assert found('#include "<cursor>') == ["lib.plsys", "parts/"]
    assert found('#include "li<cursor>"') == ["lib.plsys"]
    assert found('Selection A { A -> mesh("<cursor>') == ["parts/"]
    assert found('Selection A { A -> mesh("parts/<cursor>") + box; }') == ["parts/leaf.obj"]
    assert found('Parameter a = 1 "<cursor>') == []


def test_long_lists_are_cut():
    text = "Selection A { A -> <cursor>; }\n" + "".join(f"Selection S{i} {{ S{i} -> box; }}\n" for i in range(500))
    editor = Editor(text)
    editor.published()  # all of the file is read
    answer = editor.at_cursor("textDocument/completion")
    assert answer["isIncomplete"] and len(answer["items"]) == 200
    editor = Editor(text.replace("<cursor>", "S49<cursor>"))
    editor.published()
    answer = editor.at_cursor("textDocument/completion")
    assert not answer["isIncomplete"] and {"S49", "S490", "S499"} <= {each["label"] for each in answer["items"]}


def test_every_place_of_a_scene_has_an_answer():
    text = NAMES.strip()
    editor = Editor(text)
    line = 0
    for line, content in enumerate(text.split("\n")):
        for character in range(len(content) + 1):
            position = {"line": line, "character": character}
            assert editor.in_file("textDocument/completion", position=position)["items"] is not None
    assert line > 5
