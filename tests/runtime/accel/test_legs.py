"""What surfaces remember of the way to a hit: more ways than are kept at once, and longer ones."""

from __future__ import annotations

import numpy as np
import pytest
from test_fronts import ALL, ROOT

from plsys.compiler import compile
from plsys.runtime import Scene

# A sphere of radius 4^levels, or 4^-levels, somewhat turned and drawn out.
CHAIN = """camera {{ location <0, 0, -5> look_at <0, 0, 0> }}
light_source {{ <0, 9, 0> color rgb 1 }}
object {{ Chain }}
Selection Chain
{{
    C_begin Chain;
    if (left > 0) Chain -> C_next T_grow Chain;
    else Chain -> sphere;
}}
Calculation C_begin {{ left = {levels}; }}
Calculation C_next {{ --left; }}
Transformation T_grow {{ scale {size} {size} {size}; rotz 7; scale 1 1 1.001; }}
"""

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


@pytest.mark.parametrize("levels, size", [(20, 4.0), (250, 4.0), (250, 0.25)])
@pytest.mark.parametrize("front_items", [1, 30, ALL])
def test_normals_of_the_very_large_and_the_very_small(levels, size, front_items, tmp_path):
    """Their lengths leave the range of numbers on the way up, unless they are kept in it where the graph does."""
    (tmp_path / "chain.plsys").write_text(CHAIN.format(levels=levels, size=size))
    data = compile(tmp_path / "chain.plsys")
    origins = np.random.default_rng(1).normal(size=(300, 3))
    origins *= 3 * size**levels / np.linalg.norm(origins, axis=1)[:, None]
    results = []
    for options in ({"accelerator": "none"}, {"accelerator": "bvh", "front_items": front_items}):
        with Scene(data, **options) as scene:
            results.append(scene.intersect(origins, -origins))
    assert np.isfinite(results[0].t).all() and np.allclose(np.linalg.norm(results[0].normal, axis=1), 1.0)
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(results[1], field), getattr(results[0], field), err_msg=field)
