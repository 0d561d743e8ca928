"""Colours in the text, and their presentations."""

from __future__ import annotations

import pytest
from tests.lsp.editor import Editor


def colours(text: str) -> list[tuple[str, tuple[float, ...]]]:
    editor = Editor(text)
    answer = editor.in_file("textDocument/documentColor")
    return [
        (editor.text_of(each["range"]), tuple(round(each["color"][k], 2) for k in ("red", "green", "blue", "alpha")))
        for each in answer
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("background { color rgb <1, 0, 0> }", [("rgb <1, 0, 0>", (1, 0, 0, 1))]),
        ("background { rgb 1 }", [("rgb 1", (1, 1, 1, 1))]),
        # linear light is encoded, as in the picture
        ("background { color rgb <0.45, 0.30, 0.15> }", [("rgb <0.45, 0.30, 0.15>", (0.7, 0.58, 0.42, 1))]),
        ("sphere { 0, 1 pigment { color Red } }", [("Red", (1, 0, 0, 1))]),
        ("#declare Glass = texture { pigment { rgbt <1, 1, 1, 0.75> } }", [("rgbt <1, 1, 1, 0.75>", (1, 1, 1, 0.25))]),
        (
            "sphere { 0, 1 pigment { gradient z color_map { [0 color Black] [1 color rgb <1, 1, 0>] } } }",
            [("Black", (0, 0, 0, 1)), ("rgb <1, 1, 0>", (1, 1, 0, 1))],
        ),
        ("#declare half = 1/2;\nbackground { color rgb <half*2, 0, 0> }", [("rgb <half*2, 0, 0>", (1, 0, 0, 1))]),
        ("Texture T { pigment { color rgb <0.1*n, 0, 0> } }", []),
        ("// rgb <1, 0, 0>\nSelection Red2 { Red2 -> box; }", []),
        ("background { color rgb <1, 0> }", []),
    ],
)
def test_colours(text, expected):
    assert colours(text + "\n") == expected


def labels(**color: float) -> list[str]:
    editor = Editor("background { color rgb <1, 0, 0> }\n")
    (each,) = editor.in_file("textDocument/documentColor")
    answer = editor.in_file("textDocument/colorPresentation", color={"alpha": 1, **color}, range=each["range"])
    assert all(each["textEdit"]["newText"] == each["label"] for each in answer)
    return [each["label"] for each in answer]


def test_presentations():
    assert labels(red=1, green=1, blue=1) == ["rgb <1, 1, 1>", "White"]
    assert labels(red=0.5, green=0, blue=0) == ["rgb <0.214, 0, 0>"]
    assert labels(red=0, green=0, blue=0, alpha=0.25) == ["rgbt <0, 0, 0, 0.75>", "rgbf <0, 0, 0, 0.75>"]


def test_a_colour_follows_the_constant_that_it_is_made_of():
    editor = Editor("#declare r = 1;\ncamera { }\nbackground { color rgb <r, 0, 0> }\nlight_source { 0 color rgb 1 }\n")
    before = editor.in_file("textDocument/documentColor")
    editor.change("= 1", "= 0")
    after = editor.in_file("textDocument/documentColor")
    assert [round(each["color"]["red"], 6) for each in before] == [1, 1]
    assert [round(each["color"]["red"], 6) for each in after] == [0, 1]
