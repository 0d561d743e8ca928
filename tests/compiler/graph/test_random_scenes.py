"""Random scenes: passes don't change what is derived, and the forecast agrees with the runtime."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, given, settings
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


@RANDOM
@given(text=scenes())
def test_passes_leave_the_unfolding_as_it_is(text):
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
def test_states_and_depth_are_the_runtimes(text):
    compilation = build(Source.from_text(text))
    found = forecast(compilation.graph)
    with Scene(compilation.encode()) as scene:
        assert (found.states, found.depth) == (scene.statistics["states"], scene.statistics["depth"])
    low, expected, high = found.primitives_range
    assert found.primitives is None or found.primitives == low == expected == high
    assert high is None or low <= expected <= high
