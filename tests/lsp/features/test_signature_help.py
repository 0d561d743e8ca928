"""Signature help."""

from __future__ import annotations

import pytest
from tests.lsp.editor import Editor


def shown(text: str) -> str:
    """The active signature with its active argument in brackets."""
    answer = Editor(text).at_cursor("textDocument/signatureHelp")
    if answer is None:
        return ""
    signature = answer["signatures"][answer["activeSignature"]]
    parameters = signature["parameters"]
    if answer["activeParameter"] >= len(parameters):
        return signature["label"]
    start, end = parameters[answer["activeParameter"]]["label"]
    label = signature["label"]
    return f"{label[:start]}[{label[start:end]}]{label[end:]}"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Calculation C { n = clamp(<cursor>", "clamp([x], low, high)"),
        ("Calculation C { n = clamp(1, 2, <cursor>3); }", "clamp(x, low, [high])"),
        ("Calculation C { n = 1 + clamp(1, sin(<cursor>2), 3); }", "sin([angle])"),
        ("Calculation C { n = min(1, 2, 3, 4, <cursor>", "min(a, b, [...])"),
        ("Transformation T { trans <cursor>", "trans [x] y z"),
        ("Transformation T { trans 0 <cursor>", "trans x [y] z"),
        ("Transformation T { trans 0, 1, <cursor>2; }", "trans x y [z]"),
        ("Transformation T { rotz 3; rot 30 0 <cursor>", "rot angle x [y] z"),
        ("Transformation T { scale <cursor>", "scale [s]"),
        ("Transformation T { scale 1 <cursor>", "scale x [y] z"),
        ("Selection A { A -> [ roty <cursor>", "roty [angle]"),
        ("Selection A { A -> cone(<cursor>", "cone([top_radius])"),
        ("Selection A { A -> mesh(<cursor>", 'mesh(["file.obj"])'),
        ("Selection B(length, width) { B -> box; }\nSelection A { A -> B(1, <cursor>", "B(length, [width])"),
        ("sphere { <cursor>", "sphere { [centre], radius ... }"),
        ("sphere { <0, 1, <cursor>", "sphere { [centre], radius ... }"),
        ("sphere { <0, 1, 2>, <cursor>", "sphere { centre, [radius] ... }"),
        ("cone { 0, 1, 2*z, <cursor>1 }", "cone { base, base_radius, cap, [cap_radius] ... }"),
        ("sphere { <0, 1, 2>, 1 texture { <cursor>", ""),
        ("sphere { <0, 1, 2>, 1 translate <0, <cursor>", ""),
        ("Selection A { A -> Nobody(<cursor>", ""),
        ("Calculation C { n = (<cursor>", ""),
        ("<cursor>", ""),
    ],
)
def test_signatures(text, expected):
    assert shown(text) == expected


def test_the_vocabulary_documents_the_signature():
    answer = Editor("Calculation C { a = sin(<cursor>").at_cursor("textDocument/signatureHelp")
    assert "degrees" in answer["signatures"][0]["documentation"]["value"]
