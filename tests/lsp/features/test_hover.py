"""Hover."""

from __future__ import annotations

import pytest
from tests.lsp.editor import CURSOR, Editor
from tests.lsp.features.test_inlay_hints import TREE


def hovered(text: str, check: bool = True) -> str:
    editor = Editor(text)
    if check:
        editor.check_whole()
    answer = editor.at_cursor("textDocument/hover")
    return answer["contents"]["value"] if answer else ""


def at(text: str, before: str) -> str:
    """``text`` with the cursor behind the first ``before``."""
    assert before in text
    return text.replace(before, before + CURSOR, 1)


def test_a_symbol_has_its_forecast():
    text = hovered(at(TREE, "object { Tr"))
    assert "**2,049 cylinders · depth 13 · ×0.80–1.00 per level**" in text
    assert "Selection Tree" in text


def test_a_constant_transformation():
    text = hovered("Transformation T_<cursor>a { trans 0 0 1.99; roty 60; scale 0.8; }\n")
    assert "Shrinks to 0.8, turns by 60° about y and moves by (0, 0, 1.99)." in text
    assert "determinant 0.512 · lengths ×0.8: contracts" in text
    assert "`scale 0.8 rotate <0, 60, 0> translate <0, 0, 1.99>`" in text
    assert [line.split() for line in text.splitlines() if line.endswith("1.99")] == [["-0.6928", "0", "0.4", "1.99"]]


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("rotz 90; rotx 90;", "Turns by 120° about (0.5774, 0.5774, 0.5774)."),
        ("roty -30;", "Turns by -30° about y."),
        ("rotz 180;", "Turns by 180° about z."),
        ("scale 2;", "Grows to 2."),
        ("scale 0.15 0.15 2;", "Scales x, y and z by 0.15, 0.15 and 2."),
        ("scale 1 1 -1; rotx 20;", "Mirrors."),
        ("scale 1 1 0;", "Flattens what it acts on, which is dropped."),
        ("trans 0 0 0;", "Changes nothing."),
    ],
)
def test_sentences(body, sentence):
    assert sentence in hovered(f"Transformation T_<cursor>a {{ {body} }}\n")


def test_a_transformation_with_parameters_counts_at_its_first_level():
    text = hovered(at(TREE, "Transformation T_le"))
    assert "At its first level it shrinks to 0.8, turns by 56° about y and moves by (0, 0, 1.99)." in text
    assert "rotate <0, betaBr, 0>" in text
    before = hovered(at(TREE, "Transformation T_le"), check=False)
    assert "first level" not in before and "rotate <0, betaBr, 0>" in before


def test_a_calculation_says_what_it_assigns():
    text = hovered(at(TREE, "Calculation    C_Tr").replace("C_Tr<cursor>unk", "C_Trunk").replace("C_Tree       ", "C_Tr<cursor>ee "))
    assert "- assigns `cntTree`: 9 → 0" in text and "- assigns `betaBr`: 56 → 20" in text


def test_a_parameter():
    text = hovered(at(TREE, "roty beta"))
    assert "parameter, from 20 to 60; assigned in 2 places" in text and "betaBr -= 4.0" in text


def test_an_input():
    text = hovered('Parameter or<cursor>der = 10 [0 to 20] "Age";\n')
    assert "Age · from 0 to 20 · default 10" in text


def test_a_constant():
    text = hovered("#declare Size = 2 * 3;\nsphere { 0, Si<cursor>ze }\n")
    assert "#declare Size = 2 * 3" in text and "= 6" in text.splitlines()
    assert "= 3" not in hovered("#declare Si<cursor>ze = 3;\n").splitlines()


def test_a_declared_colour_has_its_swatch():
    text = "#declare Rust = color rgb <1, 0, 0>;\n#declare Paint = pigment { color Red }\nbackground { color Ru<cursor>st }\n"
    assert "#ff0000" in hovered(text)
    assert "#ff0000" not in hovered(text.replace("<cursor>", "").replace("Paint", "Pai<cursor>nt"))


def test_a_transformation_by_chance_says_what_is_sure():
    text = hovered("Transformation T_<cursor>a { trans rand(0) 0 1; roty 30*rand(1); scale 0.8 0.7 0.5; }\n")
    assert "determinant 0.28 · lengths ×0.5 to ×0.8: contracts, whatever the other values are" in text
    assert "determinant" not in hovered("Transformation T_<cursor>a { roty 30; scale rand(0); }\n")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("camera { ang<cursor>le 45 }\n", "above 0 and below 180"),
        ("ca<cursor>mera { angle 45 }\n", "perspective"),
        ("Selection A { A -> [ ro<cursor>ty 3 ] box; }\n", "from z to x"),
        ("Selection A { A -> bo<cursor>x; }\n", "The cube from 0 to 1"),
        ("bo<cursor>x { 0, 1 }\n", "between two opposite corners"),
        ("Calculation C { a = cl<cursor>amp(1, 2, 3); }\n", "clamp(x, low, high)"),
        ("#decl<cursor>are A = 1;\n", "Names a constant"),
        ("Sele<cursor>ction A { A -> box; }\n", "Defines a symbol"),
        ("background { color rg<cursor>b <1, 0, 0> }\n", "#ff0000"),
        ("sphere { 0, 1 pigment { color R<cursor>ed } }\n", "#ff0000"),
        ("background { color rg<cursor>b <1, 0, 0> }\n", "#ff0000"),
        ("sphere { 0, 1 pigment { co<cursor>lor Red } }\n", "One colour for all of the surface"),
    ],
)
def test_words_of_the_language(text, expected):
    assert expected in hovered(text)


def test_a_guard():
    assert "**runs 10×** on the longest path, 1,023 times" in hovered(at(TREE, "else i"))


def test_nothing_is_said_where_nothing_is():
    assert hovered("// a cam<cursor>era\n") == ""
    assert hovered("camera { angle 4<cursor>5 }\n") == ""
    assert hovered("object { Nobo<cursor>dy }\n") == ""
    assert hovered("<cursor>") == ""
