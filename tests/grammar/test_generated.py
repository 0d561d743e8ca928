"""The committed parser is what grammar.js generates. Needs tree-sitter's command line; skipped without it."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

GRAMMAR = Path(__file__).resolve().parents[2] / "grammar"


@pytest.mark.skipif(not shutil.which("tree-sitter"), reason="tree-sitter's command line isn't installed")
def test_parser_is_current(tmp_path: Path) -> None:
    command = ["tree-sitter", "generate", "--abi", "15", "--output", str(tmp_path), "grammar.js"]
    done = subprocess.run(command, cwd=GRAMMAR, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for name in ("parser.c", "grammar.json", "node-types.json"):
        assert (tmp_path / name).read_text() == (GRAMMAR / "src" / name).read_text(), (
            f"{name}: generate it again"
        )


def test_reserved_words_are_the_languages_six() -> None:
    grammar = json.loads((GRAMMAR / "src/grammar.json").read_text())
    words = {rule["value"] for rule in grammar["reserved"]["global"]}
    assert words == {"Selection", "Calculation", "Transformation", "Parameter", "if", "else"}
