"""The text store against a string: any edits, any line ends; and incremental = from scratch."""

from __future__ import annotations

import random
import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from plsys.compiler.analysis.text import Text
from stress import rounds

PIECES = [
    "\n", "\r\n", "\r", "\ufeff", "\0", "𝔸", "é", " ", "{", "}", "/*", "*/", "// x", '"', ";", "#declare A = ", "1",
    "\nSelection A\n{ A -> box; }\n", "\ncamera {\n angle 45 }\n", "\nsphere {\n", "box", "\nunion {\nbox { }\n}\n",
    "\nTexture T {", "\f", "\u2028", "Calculation C {}", "y", "Selection", " a b ", "-",
    "\nobject { A  scale 2 }\n\n// Plant 2; a }\n// b\n", "Parameter a = 2 // b; c\n",
]  # fmt: skip

texts = st.lists(st.sampled_from(PIECES), max_size=12).map("".join)
edits = st.lists(st.tuples(st.floats(0, 1), st.floats(0, 0.3), texts), max_size=8)


def lines_of(data: bytes) -> list[bytes]:
    return re.split(rb"\r\n|\n|\r", data)


def characters(data: bytes) -> list[int]:
    """The offsets between characters."""
    return [i for i in range(len(data) + 1) if i == len(data) or data[i] & 0xC0 != 0x80]


LINES = [
    "object { A  scale 2 }\n", "// Plant 2; a }\n", "// b\n", "\n", "Selection A\n{ A -> box; }\n", "Calculation C { a = 1; }\n", "/* x; */\n",
    "Parameter a = 2 // b; c\n", "#declare B = 2\n", "camera { angle 45 }\n", "union {\nbox { }\n}\n", "// }\n", "sphere\n", '"a;//b"\n',
]  # fmt: skip


@pytest.mark.parametrize("seed", range(rounds(200, 20_000)))
def test_small_edits_of_lines(seed):
    """Where definitions end is seen in spite of comments and strings, and where one begins in spite of its neighbours."""
    rng = random.Random(seed)
    data = "".join(rng.choices(LINES, k=rng.randint(2, 7))).encode()
    text = Text("x", None, data)
    for _ in range(6):
        first = rng.randrange(len(data) + 1)
        last = min(len(data), first + rng.choice((0, 0, 0, 1, 2)))
        new = rng.choice((b"x", b" ", b"1", b"", b"box", b"Selection", b"-"))
        text.replace(first, last, new)
        data = data[:first] + new + data[last:]
        fresh = Text("x", None, data)
        assert [(block.data, block.shape) for block in text.blocks] == [(block.data, block.shape) for block in fresh.blocks]


@settings(max_examples=300, deadline=None)
@given(texts, edits)
@example("\nSelection A\n{ A -> box; }\n#declare A = ", [(0.0, 0.0, "\nCalculation C {}/*"), (0.0, 0.0, "/*"), (1.0, 0.0, "*/")])
@example(
    "\nSelection A\n{ A -> box; }\n*/",
    [(0.0, 0.0, "\nSelection A\n{ A -> box; }\n"), (0.0, 0.0, 2 * "\nSelection A\n{ A -> box; }\n" + "/*")],
)
@example("camera { }\nsphere\nCalculation C { a = 1; }\n", [(0.69, 0.05, ""), (0.72, 0.0, "-")])  # `sphere Calculation {` for a while
def test_edits_and_lines_as_of_a_string(start, changes):
    data = start.encode()
    text = Text("x", None, data)
    for at, length, new in changes:
        places = characters(data)
        first = places[int(at * (len(places) - 1))]
        last = places[min(len(places) - 1, int((at + length) * (len(places) - 1)))]
        text.replace(first, last, new.encode())
        data = data[:first] + new.encode() + data[last:]
        fresh = Text("x", None, data)
        assert text.data == data
        assert [block.data for block in text.blocks] == [block.data for block in fresh.blocks]
        assert [block.shape for block in text.blocks] == [block.shape for block in fresh.blocks]
        assert [text.order[block] for block in text.blocks] == list(range(len(text.blocks)))
    lines = lines_of(data)
    assert text.line_count == len(lines)
    assert [text.line_bytes(line) for line in range(len(lines))] == lines
    for offset in characters(data):
        line = text.line_of(offset)
        assert text.line_start(line) <= offset
        assert line == len(lines) - 1 or offset < text.line_start(line + 1)
    assert text.line_start(len(lines) + 3) == len(data)


def blocks(text: str) -> list[str]:
    return [block.data.decode() for block in Text("x", None, text.encode()).blocks]


def test_definitions_that_start_a_line_are_blocks():
    text = "camera { }\nSelection A\n{ A -> box; }\n#declare B = 1;\nTexture T { }\n"
    assert blocks(text) == ["camera { }\n", "Selection A\n{ A -> box; }\n", "#declare B = 1;\n", "Texture T { }\n"]


def test_a_block_that_is_not_indented_stays_whole():
    assert len(blocks("union {\nsphere { 0, 1 }\nbox { 0, 1 }\n}\ncamera { }\n")) == 2


def test_a_declaration_keeps_its_value():
    assert len(blocks("#declare Bark = // brown\ntexture {\n}\ncamera { }\n")) == 2


def test_an_open_brace_costs_no_neighbour():
    assert len(blocks("sphere {\n  0, 1;\ncamera { }\nlight_source { }\n")) == 3


def test_comments_and_strings_hide_what_is_in_them():
    assert len(blocks('/*\ncamera { }\n*/\n#include "{"\ncamera { }\n')) == 3


def test_an_edit_replaces_the_blocks_that_it_touches():
    text = Text("x", None, b"camera { }\nbackground { }\nobject { A }\n")
    first, _, last = text.blocks
    change = text.replace(13, 14, b"x")
    assert [block.data for block in change.removed] == [b"background { }\n"]
    assert [block.data for block in change.added] == [b"baxkground { }\n"]
    assert text.blocks[0] is first and text.blocks[2] is last


def test_a_closing_brace_joins_what_an_open_one_held_apart():
    text = Text("x", None, b"union {\nbox { }\nsphere { }\n;camera { }\n")
    assert len(text.blocks) > 1
    text.replace(len(text) - 12, len(text) - 11, b"}\n")
    assert [block.data for block in text.blocks] == [b"union {\nbox { }\nsphere { }\n}\n", b"camera { }\n"]


def test_a_comment_that_swallows_a_block_joins_the_one_after_it():
    text = Text("x", None, b"\nunion {\nbox { }\n}\n/**/\ncamera {\n angle 45 }\n")
    text.replace(0, 0, "\ufeff/*".encode())
    assert [block.data for block in text.blocks] == [block.data for block in Text("x", None, text.data).blocks]
