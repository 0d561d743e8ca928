"""Random scenes: passes don't change what is derived, and the forecast agrees with the runtime."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from plsys.compiler.bytecode.encode import encode
from plsys.compiler.graph.forecast import forecast
from plsys.compiler.graph.lower import lower
from plsys.compiler.graph.passes import run_passes
from plsys.compiler.graph.passes.liveness import liveness
from plsys.compiler.graph.passes.prune import prune
from plsys.compiler.pipeline import build, build_model
from plsys.compiler.reading.source import Source
from plsys.runtime import Scene
from random_scenes import scenes

RANDOM = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))


def unfolding(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Kinds and matrices of all primitives, in derivation order."""
    with Scene(data) as scene:
        batches = list(scene.unfold())
    kinds = [np.zeros(0)] + [batch.kind for batch in batches]
    return np.concatenate(kinds), np.concatenate([np.zeros((0, 3, 4))] + [batch.matrix for batch in batches])


OPERATORS = st.sampled_from(["[ trans 1 0 0 ]", "[ roty 30 ]", "[ scale 0.5 ]", "[ scale 1 1 0 ]", "[ trans m 0 0 ]",
                             "[ rotz 9*rand(1) ]", "C_more", "T_up"])  # fmt: skip


@st.composite
def arrangements(draw) -> str:
    """Scenes of symbols that mostly do nothing but enter later ones, of which `passes/inline.py` makes fewer."""
    names = "ABCDE"

    def terms(below: str, brackets: int) -> str:
        return " + ".join(term(below, brackets) for _ in range(draw(st.integers(1, 3))))

    def term(below: str, brackets: int) -> str:
        operators = " ".join(draw(st.lists(OPERATORS, max_size=2)))
        if brackets and draw(st.integers(0, 3)) == 0:
            return f"{operators} ({terms(below, brackets - 1)})"
        return f"{operators} {draw(st.sampled_from(below or ['box', 'sphere']))}"

    rules = [f"Selection {name} {{ {name} -> {terms(names[i + 2:], 2)}; }}" for i, name in enumerate(names[1:])]
    first = f"if (n > 0) A -> [ --n; ] ({terms(names[1:], 2)} + [ scale 0.9 ] A); else A -> box;"
    return "\n".join(
        ["object { A }", f"Selection A {{ C_start A; {first} }}", *rules, "Calculation C_start { n = 2; m = 1; }",
         "Calculation C_more { ++m; }", "Transformation T_up { trans 0 1 0; scale 0.7; }"]
    )  # fmt: skip


def assert_passes_leave_the_unfolding(text: str) -> None:
    model, diagnostics = build_model(Source.from_text(text))
    assert not diagnostics.has_errors
    plain = lower(model)
    prune(plain)
    liveness(plain)
    kinds, matrices = unfolding(encode(plain))
    found_kinds, found_matrices = unfolding(encode(run_passes(lower(model))))
    np.testing.assert_array_equal(found_kinds, kinds)
    np.testing.assert_allclose(found_matrices, matrices, rtol=1e-9, atol=1e-9)


@RANDOM
@given(text=scenes())
def test_passes_leave_the_unfolding_as_it_is(text):
    assert_passes_leave_the_unfolding(text)


@RANDOM
@given(text=arrangements())
def test_symbols_that_only_arrange_others_unfold_as_written(text):
    assert_passes_leave_the_unfolding(text)


@RANDOM
@given(text=scenes())
def test_states_and_depth_are_the_runtimes(text):
    compilation = build(Source.from_text(text))
    found = forecast(compilation.graph)
    with Scene(compilation.encode()) as scene:
        assert (found.states, found.depth) == (scene.statistics["states"], scene.statistics["depth"])
    low, expected, high = found.primitives_range
    assert found.primitives is None or found.primitives == low == expected == high
    assert high is None or low <= expected <= high
