"""Positions of the protocol against a naive count."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plsys.compiler.analysis import Text
from plsys.lsp.text import ENCODINGS, Positions, encode

texts = st.text(st.sampled_from("ab\n\r\0\f\ufeffé\u2028𝔸💡"), max_size=30)
CODECS = {"utf-8": ("utf-8", 1), "utf-16": ("utf-16-le", 2), "utf-32": ("utf-32-le", 4)}


def naive(text: str, index: int, encoding: str) -> tuple[int, int]:
    """Line and character of the character at ``index``."""
    starts = [0, *(match.end() for match in re.finditer(r"\r\n|\n|\r", text))]
    line = max(i for i, start in enumerate(starts) if start <= index)
    codec, width = CODECS[encoding]
    return line, len(text[starts[line] : index].encode(codec)) // width


@pytest.mark.parametrize("encoding", ENCODINGS)
@settings(max_examples=150, deadline=None)
@given(text=texts)
def test_positions_and_offsets(encoding, text):
    positions = Positions(Text("x", None, text.encode()), encoding)
    for index in range(len(text) + 1):
        if text[index - 1 : index + 1] == "\r\n":
            continue  # between the two is no place
        offset = len(text[:index].encode())
        line, character = naive(text, index, encoding)
        assert positions.position(offset) == {"line": line, "character": character}
        assert positions.offset(line, character) == offset


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_range_is_the_places_of_its_ends(encoding):
    text = "camera { }\r\nSelection A\n{ A -> b; }\n/* é💡 */\rCalculation B { n = 1; }".encode()
    positions = Positions(Text("x", None, text), encoding)
    places = [i for i in range(len(text) + 1) if i == len(text) or text[i] & 0xC0 != 0x80]
    for start in places:
        for end in places:
            if start <= end:
                assert positions.range(start, end) == {"start": positions.position(start), "end": positions.position(end)}


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_places_outside_of_the_text_are_taken_to_its_ends(encoding):
    positions = Positions(Text("x", None, b"ab\r\ncd"), encoding)
    assert [positions.offset(*place) for place in ((0, 99), (1, 99), (7, 0), (-1, 5), (0, -3))] == [2, 6, 6, 0, 0]


@pytest.mark.parametrize("encoding, character, offset", [("utf-16", 1, 0), ("utf-16", 2, 4), ("utf-8", 2, 0), ("utf-8", 4, 4)])
def test_inside_of_a_character_is_its_start(encoding, character, offset):
    assert Positions(Text("x", None, "𝔸b".encode()), encoding).offset(0, character) == offset


def test_half_a_surrogate_pair_keeps_its_length():
    assert encode("a\ud835b") == "a\ufffdb".encode()
    assert encode("\ud835\udd38") == "𝔸".encode()


def test_a_change_without_a_range_is_the_whole_text():
    positions = Positions(Text("x", None, b"abc"), "utf-16")
    assert positions.edit({"text": "x"}) == (0, 3, b"x")
