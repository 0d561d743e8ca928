"""What surfaces remember of the way to a hit: more ways than are kept at once, and longer ones."""

from __future__ import annotations

import numpy as np
import pytest
from test_fronts import ALL, ROOT

from plsys.compiler import compile
from plsys.runtime import Scene

FIELDS = ("t", "primitive", "symbol", "rule", "depth", "normal")


@pytest.mark.parametrize("name, parameters", [("tree3d", {"order": 8}), ("menger", {"level": 4})])
@pytest.mark.parametrize("front_items", [1, 30, ALL])
def test_surfaces_are_those_of_the_graph(name, parameters, front_items):
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=parameters)
    random = np.random.default_rng(1)
    with Scene(data, accelerator="none") as scene:
        places = np.concatenate([batch.matrix[batch.kind != 9][:, :, 3] for batch in scene.unfold()])
        targets = places[random.integers(0, len(places), 4000)]
        origins = places.mean(0) + random.normal(size=targets.shape) * 3 * np.ptp(places, axis=0)
        expected = scene.intersect(origins, targets - origins)
    assert len(np.unique(expected.primitive)) > 1000
    with Scene(data, accelerator="bvh", front_items=front_items) as scene:
        found = scene.intersect(origins, targets - origins)
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(found, field), getattr(expected, field), err_msg=field)
