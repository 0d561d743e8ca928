"""The fixes in tests/cases/diagnostics are what the editor offers; ``PLSYS_BLESS=1`` writes each code's first one."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import pytest

from plsys.compiler.analysis import CODES
from plsys.compiler.analysis.actions import Spot
from plsys.compiler.analysis.fixes import FIXES
from tests.compiler.analysis.edits import fixed, messages, opened
from tests.compiler.analysis.test_fixes import FIXTURES, HEAD, WHOLE

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


def test_every_code_with_a_fix_shows_it_in_its_fixture():
    """All rows of the registry; `encoding`'s message is about bytes that a file of text can't hold, see test_fixes."""
    shown = {code for code in CODES if fixtures.load(code).fixes}
    assert set(FIXES) - shown == {"encoding"}
    assert "encoding" in {code for code, _, _ in FIXTURES}


def test_every_row_of_the_registry_is_used():
    """Each pattern fits a message of the fixtures or of test_fixes, and makes a fix of it."""
    texts = [(code, fixtures.load(code).wrong) for code in CODES if code not in APART]
    texts += [(code, before) for code, before, _ in FIXTURES] + [(code, HEAD + before) for code, before, _ in WHOLE]
    texts += [("unsupported", "#local A = 1;"), ("syntax", "Selection A { A -> 1: box | ; }")]
    waiting = {(code, id(row)): row[0] for code, rows in FIXES.items() for row in rows}
    for code, text in texts:
        if not any(pair[0] == code for pair in waiting):
            continue
        scene, document = opened(text)
        for message in scene.messages(document):
            found = message.diagnostic
            spot = Spot(scene, document, message.start, message.end)
            for row in FIXES.get(found.code, ()):
                match = re.search(row[0], found.message)
                if match and (made := row[1](spot, match, message)) is not None and made[1]:
                    waiting.pop((found.code, id(row)), None)
    assert waiting == {}
