"""Fronts: whatever the items that a front may have, the instruction set and the memory, the hits and the picture are the
same bits as those of the graph itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from plsys.compiler import compile
from plsys.runtime import PlsysRuntimeError, Scene
from random_scenes import scenes

ROOT = Path(__file__).resolve().parents[3]
ALL = 2**64 - 1
ITEMS = (1, 21, 256, 2048, ALL)
SETS = ("scalar", "avx2", "avx512")
SCENES = {
    "tree": {"order": 6},
    "menger": {"level": 2},
    "palm": {},
    "shading": {},
    "mirrors": {},
    "koch": {},
}


def available(data: bytes) -> list[str]:
    """The instruction sets of this machine."""
    found = []
    for isa in SETS:
        try:
            Scene(data, isa=isa).close()
        except PlsysRuntimeError:
            continue
        found.append(isa)
    assert "scalar" in found
    return found


def rays(data: bytes, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """From around the scene and from within, towards its primitives, some along axes."""
    random = np.random.default_rng(seed)
    with Scene(data, accelerator="none") as scene:
        matrices = [batch.matrix[batch.kind != 9] for batch in scene.unfold()]
    matrices = np.concatenate(matrices) if matrices else np.zeros((0, 3, 4))
    if len(matrices) == 0:
        matrices = np.eye(3, 4)[None]
    targets = matrices[random.integers(len(matrices), size=count)] @ np.append(random.uniform(0, 1, 3), 1.0)
    size = 1.0 + np.abs(targets).max()
    origins = targets + random.normal(size=(count, 3)) * size * random.choice([0.01, 0.3, 3.0], (count, 1))
    directions = targets - origins
    directions[::9] = np.eye(3)[random.integers(3, size=len(directions[::9]))] * -1.0
    return origins, directions


def answers(data: bytes, origins, directions, **options) -> dict[str, np.ndarray]:
    with Scene(data, **options) as scene:
        found = scene.intersect(origins, directions)._asdict()
        found["occluded"] = scene.occluded(origins, directions, 0.8)
        return found


def assert_same(ours: dict, expected: dict, what: object) -> None:
    for name in expected:
        np.testing.assert_array_equal(ours[name], expected[name], err_msg=f"{what}: {name}")


@pytest.mark.parametrize("name", SCENES)
def test_items_instruction_sets_and_memory_do_not_show(name):
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=SCENES[name])
    origins, directions = rays(data, 1500, 5)
    expected = answers(data, origins, directions, accelerator="boxes")
    assert np.isfinite(expected["t"]).any()
    for items in ITEMS:
        for isa in available(data):
            assert_same(answers(data, origins, directions, front_items=items, isa=isa), expected, (items, isa))
    for kilobytes in (1024, 4096, 2**20):
        ours = answers(data, origins, directions, memory=kilobytes * 1024)
        assert_same(ours, expected, f"{kilobytes} KB")


@pytest.mark.parametrize("name", ["tree", "shading", "mirrors"])
def test_the_picture_is_the_same(name):
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=SCENES[name])
    with Scene(data, accelerator="boxes") as scene:
        expected = scene.render(48, 36)["color"]
    for options in [{"front_items": items} for items in ITEMS] + [{"isa": isa} for isa in available(data)]:
        with Scene(data, **options) as scene:
            np.testing.assert_array_equal(scene.render(48, 36)["color"], expected, err_msg=str(options))


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(text=scenes(), seed=st.integers(0, 2**32))
def test_random_scenes_are_the_same(text, seed):
    data = compile(text)
    origins, directions = rays(data, 60, seed)
    expected = answers(data, origins, directions, accelerator="none")
    for items in ITEMS:
        assert_same(answers(data, origins, directions, front_items=items), expected, items)
    for isa in available(data):
        assert_same(answers(data, origins, directions, isa=isa), expected, isa)


def test_memory_is_one_dial_from_graph_to_flat_scene():
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 12})
    limits, sizes = [], []
    for kilobytes in (40, 80, 200, 2**20):
        with Scene(data, memory=kilobytes * 1024) as scene:
            statistics = scene.statistics
        size = statistics["bytes"]
        sizes.append(size["states"] + size["nodes"] + size["items"])
        assert sizes[-1] <= kilobytes * 1024 * 1.1
        limits.append(statistics["front"]["limit"] or ALL)
    assert limits == sorted(limits) and limits[-1] == ALL
    assert sizes == sorted(sizes)


def test_the_flat_scene_has_an_item_for_every_primitive_and_the_graph_few():
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 8})
    with Scene(data, front_items=ALL) as flat, Scene(data, front_items=1) as graph:
        assert flat.statistics["front"]["count"] == 1 and flat.statistics["front"]["instances"] == 0
        assert flat.statistics["front"]["items"] == flat.statistics["primitives"] + 1  # and the plane
        assert graph.statistics["front"]["items"] < 60


def test_an_instruction_set_that_is_not_one_is_refused():
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 1})
    with pytest.raises(PlsysRuntimeError, match="isa"):
        Scene(data, isa="mmx")
