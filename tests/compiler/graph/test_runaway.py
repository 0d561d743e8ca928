"""Recursions without an end are known after some rounds; those that end late are not taken for them."""

from __future__ import annotations

import pytest

from plsys.compiler.graph import forecast as forecasts
from plsys.compiler.graph.forecast import forecast
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source

LIMIT = 3000


def derived(rules: str, limit: int = LIMIT) -> tuple[list[str], int]:
    """The messages about a scene, and how many states were looked at."""
    graph = build(Source.from_text(f"object {{ A }}\n{rules}")).graph
    forecaster = forecasts._Forecaster(graph, 1000, limit)
    expand, count = forecaster.expand, 0

    def counted(state):
        nonlocal count
        count += 1
        return expand(state)

    forecaster.expand = counted
    return [each.code for each in forecaster.run().diagnostics], count


@pytest.mark.parametrize(
    "rules",
    [
        "Selection A { [ n = 3 ] A; if (n > 0) A -> box + [ ++n; trans 0 0 1 ] A; }",
        "Selection A { [ n = 5 ] A; if (n != 0) A -> box + [ n -= 2; trans 0 0 n ] A; }",
        "Selection A { [ n = 5; k = 1 ] A; if (n > 0 || k == 2) A -> box + [ n -= 1; k += 0.5; rotz k ] A; else A -> [ ++k ] A; }",
        "Selection A { [ n = 0 ] A; if (n >= 0) A -> box + [ trans 0 0 1 ] B; }\nSelection B { B -> [ n += 0.1 ] A; }",
    ],
)
def test_what_runs_away_is_known_soon(rules):
    codes, count = derived(rules, 100_000)
    assert "depth-limit" in codes and count < 5000


@pytest.mark.parametrize(
    "rules",
    [
        "Selection A { [ n = 2500 ] A; if (n > 0) A -> box + [ --n; trans 0 0 1 ] A; }",  # a guard that ends it
        "Selection A { [ n = 0 ] A; if (n != 2500) A -> box + [ ++n; trans 0 0 1 ] A; }",  # by one value only
        "Selection A { [ n = 1 ] A; if (n % 2500 != 0) A -> box + [ ++n; trans 0 0 1 ] A; }",  # by no straight line
        "Selection A { [ n = 2500 ] A; A -> box + [ --n; scale n ] A; }",  # by a transformation that flattens
        "Selection A { [ n = 2500 ] A; A -> box + [ --n; m = 1/n; trans m 0 0 ] A; }",  # by an error
        "Selection A { [ n = 1 ] A; if (min(n, 9) < 2500 && n < 2500) A -> box + [ ++n; trans 0 0 1 ] A; }",
    ],
)
def test_what_ends_late_is_followed_to_its_end(rules):
    codes, count = derived(rules)
    assert "depth-limit" not in codes and count >= 2500


def test_a_long_chain_is_counted():
    scene = "object { A }\nSelection A { [ n = 2500 ] A; if (n > 0) A -> box + [ --n; trans 0 0 1 ] A; }"
    assert forecast(build(Source.from_text(scene)).graph).primitives == 2500
