"""The fixes in tests/cases/diagnostics are what the editor offers; ``PLSYS_BLESS=1`` writes each code's first one."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from plsys.compiler.analysis import CODES
from tests.compiler.analysis.edits import fixed, messages

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "reading"))
import fixtures  # noqa: E402

# Their messages come from a forecast that an editor's test has no patience for, or are no UTF-8 text.
APART = ("limit", "depth-limit", "state-limit", "expansion", "encoding")


def offered(code: str) -> dict[str, str]:
    text = fixtures.load(code).wrong
    return fixed(text, code) if any(each.diagnostic.code == code for each in messages(text)) else {}


@pytest.mark.parametrize("code", [code for code in CODES if code not in APART])
def test_the_fixes_of_a_fixture(code):
    fixes, found = fixtures.load(code).fixes, offered(code)
    if os.environ.get("PLSYS_BLESS"):
        fixtures.save_fixes(code, dict(list(found.items())[:1]))
        return
    assert bool(fixes) == bool(found), "a code with a quick fix has a fixture of it"
    for title, text in fixes.items():
        assert found.get(title) == text
        assert [each.diagnostic.code for each in messages(text)].count(code) < [
            each.diagnostic.code for each in messages(fixtures.load(code).wrong)
        ].count(code)


def test_codes_with_fixes_have_fixtures():
    shown = {code for code in CODES if fixtures.load(code).fixes}
    assert len(shown) > 25
