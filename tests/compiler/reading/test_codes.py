"""Every code of the registry: a scene that has its message and one that hasn't, and a page that shows both."""

from __future__ import annotations

import os
import re

import pytest
from fixtures import DULL, FOLDER, found, load, report, save_messages

from plsys.compiler.reading.codes import CODES


def test_every_code_has_a_fixture_and_every_fixture_a_code():
    assert sorted(path.stem for path in FOLDER.glob("*.txt")) == sorted(CODES)


@pytest.mark.parametrize("code", CODES)
def test_the_wrong_scene_has_the_message(code):
    fixture = load(code)
    if os.environ.get("PLSYS_BLESS"):
        save_messages(code, report(fixture.wrong, code, patient=True))
        return
    said = report(fixture.wrong, code)
    assert f"{CODES[code].severity}[{code}]" in said
    if code.endswith("-limit"):  # met early here, at other numbers
        assert re.sub(r"[-\d,]+", "N", said) == re.sub(r"[-\d,]+", "N", fixture.messages)
    else:
        assert said == fixture.messages


@pytest.mark.parametrize("code", CODES)
def test_the_right_scene_has_no_message(code):
    assert [each.code for each in found(load(code).right) if each.code not in DULL or each.code == code] == []


@pytest.mark.parametrize("code", [code for code in CODES if load(code).fixes])
def test_fixes_mend_it(code):
    fixture = load(code)
    for text in fixture.fixes.values():
        before = [each.code for each in found(fixture.wrong)].count(code)
        assert [each.code for each in found(text)].count(code) < before


def test_summaries_are_sentences():
    assert [code for code, row in CODES.items() if not row.summary.endswith(".") or row.summary[0].islower()] == []

