"""Each pass before and after, as golden cases: tests/cases/passes/<pass>[-<what>].txt.

A case is a scene, then the graph before the pass, the graph after it, and what it says that it left out. The name up
to the first dash is the pass's. ``PLSYS_BLESS=1`` rewrites what follows the scene.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from plsys.compiler.graph.lower import lower
from plsys.compiler.graph.passes import PASSES, run_passes
from plsys.compiler.graph.verify import verify
from plsys.compiler.reading.parse import parse
from plsys.compiler.reading.resolve import resolve
from plsys.compiler.reading.source import Source

CASES = sorted((Path(__file__).parents[2] / "cases" / "passes").glob("*.txt"))
BY_NAME = {apply_pass.__name__: apply_pass for apply_pass in PASSES}


def lowered(text: str):
    file, diagnostics = parse(Source.from_text(text, "case.plsys"))
    model = resolve(file, diagnostics)
    assert [d.message for d in diagnostics.items if d.severity == "error"] == []
    return lower(model)


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_pass_does_what_its_case_says(path: Path):
    expected = path.read_text()
    scene = expected.split("--- before\n")[0]
    graph = lowered(scene)
    before = str(graph)
    apply_pass = BY_NAME[path.stem.split("-")[0]]
    apply_pass(graph)
    verify(graph, apply_pass.__name__)
    left_out = "".join(f"{row.what}: {row.why}\n" for row in graph.left_out)
    found = f"{scene}--- before\n{before}\n--- after\n{graph}\n--- left out\n{left_out}"
    if os.environ.get("PLSYS_BLESS"):
        path.write_text(found)
    assert found == expected or os.environ.get("PLSYS_BLESS")


def test_every_pass_has_a_case():
    assert {path.stem.split("-")[0] for path in CASES} == set(BY_NAME)


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_all_passes_together_change_nothing_the_second_time(path: Path):
    graph = run_passes(lowered(path.read_text().split("--- before\n")[0]))
    once = str(graph)
    assert str(run_passes(graph)) == once
