"""What can stand at a place."""

from __future__ import annotations

import pytest
from plsys.compiler.analysis import Document
from plsys.compiler.analysis.context import Context, context_at

CASES = [
    ("|", Context("top")),
    ("cam|", Context("top", prefix="cam")),
    ("camera { } |", Context("top", previous="}")),
    ("#inc|", Context("top", prefix="#inc")),
    ('#include "tr|', Context("include", prefix="tr", previous="#include")),
    ("camera { loc|", Context("block", blocks=("camera",), prefix="loc", previous="{")),
    ("camera { location <0, |", Context("block", blocks=("camera",), previous=",")),
    ("sphere { 0, 1 texture { pigment { col|", Context("block", blocks=("sphere", "texture", "pigment"), prefix="col", previous="{")),
    ("Selection |", Context("name", previous="Selection")),
    ("Selection A { |", Context("selection", "A", previous="{")),
    ("Selection A { C_i|", Context("selection", "A", prefix="C_i", previous="{")),
    ("Selection A { A -> T|", Context("production", "A", prefix="T", previous="->")),
    ("Selection A { if (n > |", Context("expression", "A", previous=">")),
    ("Selection A { A -> (box + |", Context("production", "A", previous="+")),
    ("Selection A { A -> [ tr|", Context("statement", "inline", prefix="tr", previous="[")),
    ("Selection A { A -> [ trans 0 |", Context("arguments", "inline", (), "trans", 1, "", "0")),
    ("Selection A { A -> B(1, |", Context("call", "A", (), "B", 1, "", ",")),
    ("Calculation C { |", Context("statement", "calculation", previous="{")),
    ("Calculation C { n = si|", Context("expression", "calculation", prefix="si", previous="=")),
    ("Calculation C { n = clamp(1, 2, |", Context("call", "C", (), "clamp", 2, "", ",")),
    ("Transformation T { trans 0 0 1; ro|", Context("statement", "transformation", prefix="ro", previous=";")),
    ("Transformation T { rot 30*n |", Context("arguments", "transformation", (), "rot", 1, "", "n")),
    ("Transformation T { rot 30 * |", Context("arguments", "transformation", (), "rot", 0, "", "*")),
    ("Transformation T { rot 30 -n (2) max(1, 2) |", Context("arguments", "transformation", (), "rot", 4, "", ")")),
    ("Calculation C { --|", Context("step", "calculation", previous="--")),
    ("Selection A { A -> T (|", Context("production", "A", previous="(")),
    ("Parameter p = |", Context("input", "p", previous="=")),
    ("Parameter p = 3 [0 |", Context("input", "p", (), "[", 0, "", "0")),
    ("Parameter p = 3;\nca|", Context("top", prefix="ca", previous=";")),
    ("// plsys-ignore: unused, no-|", Context("ignore", prefix="no-")),
    ("Transformation T { rot 30 |", Context("arguments", "transformation", (), "rot", 1, "", "30")),
    ("Texture T { pig|", Context("block", "T", ("texture",), prefix="pig", previous="{")),
    ("#declare A = |", Context("declare", "A", previous="=")),
    ("// cam|", Context("comment")),
    ("/* cam|", Context("comment")),
    ('Parameter a = 1 "te|', Context("string", prefix="te", previous="1")),
]  # fmt: skip


@pytest.mark.parametrize("text, expected", CASES, ids=lambda value: value if isinstance(value, str) else "")
def test_context(text, expected):
    before = text[: text.index("|")]
    document = Document(None, before.encode())
    assert context_at(document, len(before)) == expected
    after = Document(None, (before + "\nSelection Z { Z -> box; }\n").encode())
    assert context_at(after, len(before)) == expected


def test_a_place_after_any_text_has_a_context():
    for text in ["}", ")", "]]", '"', "\0", "é", "{" * 50, "Selection", "#declare", "Selection (", "A -> B(", "[trans 0"]:
        assert context_at(Document(None, text.encode()), len(text.encode())).kind
