"""Streams: rays that go different ways are traced a step of each in turn, and nobody can tell by the hits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_fronts import ALL, ROOT, SCENES, answers, assert_same, available
from test_packets import bundles

from plsys.compiler import compile
from plsys.runtime import Scene
from random_scenes import scenes


def scattered(data: bytes, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The packets' rays in an order in which neighbours have nothing in common."""
    origins, directions = bundles(data, seed)
    order = np.random.default_rng(seed).permutation(len(origins))
    return origins[order], directions[order]


@pytest.mark.parametrize("name", SCENES)
def test_streams_do_not_show(name):
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=SCENES[name])
    origins, directions = scattered(data, 4)
    expected = answers(data, origins, directions, accelerator="boxes")
    assert np.isfinite(expected["t"]).any()
    for items in (1, 256, ALL):
        for isa in available(data):
            assert_same(answers(data, origins, directions, front_items=items, isa=isa), expected, (items, isa))


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(text=scenes(), seed=st.integers(0, 2**32))
def test_random_scenes_are_the_same_by_streams(text, seed):
    data = compile(text)
    origins, directions = scattered(data, seed)
    expected = answers(data, origins, directions, accelerator="none")
    for items in (1, ALL):
        assert_same(answers(data, origins, directions, front_items=items), expected, items)


@pytest.mark.parametrize("name, parameters", [("menger", {"level": 12}), ("tree", {"order": 40})])
def test_a_ray_in_company_meets_what_it_meets_alone(name, parameters):
    """Deep scenes: each ray's stack and frames grow while others are on their way."""
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=parameters)
    random = np.random.default_rng(2)
    origins = random.normal(size=(200, 3)) * 4
    directions = random.uniform(0, 1, (200, 3)) - origins
    for isa in available(data):
        with Scene(data, isa=isa, front_items=1, threads=1) as scene:
            together = scene.intersect(origins, directions)
            assert np.isfinite(together.t).any()
            for i in range(len(origins)):
                alone = scene.intersect(origins[i : i + 1], directions[i : i + 1])
                assert (together.t[i], together.primitive[i]) == (alone.t[0], alone.primitive[0]), (isa, i)
