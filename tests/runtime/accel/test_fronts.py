"""Fronts: whatever the items that a front may have, the instruction set and the memory, the hits and the picture are the
same bits as those of the graph itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from instruction_sets import available
from plsys.compiler import compile
from plsys.runtime import PlsysRuntimeError, Scene
from random_scenes import scenes

ROOT = Path(__file__).resolve().parents[3]
ALL = 2**64 - 1
ITEMS = (1, 21, 256, 2048, ALL)
SCENES = {
    "tree": {"order": 6},
    "menger": {"level": 2},
    "palm": {},
    "shading": {},
    "mirrors": {},
    "koch": {},
}


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
    for kilobytes in (64, 256, 1024, 4096, 2**20):
        ours = answers(data, origins, directions, memory=kilobytes * 1024)
        assert_same(ours, expected, f"{kilobytes} KB")


def heaps(places: int) -> bytes:
    """Heaps of nine things; every heap stands at a place of its own, two symbols below."""
    row = " + ".join(f"[ trans {1.25 * i} {i % 7} 0 ] [ scale {1 + i / 100} ] Heap(1)" for i in range(places))
    things = " + ".join(f"[ trans 0 {0.1 * i} 0 ] [ scale 0.1 ] {('box', 'sphere')[i % 2]}" for i in range(9))
    return compile(f"object {{ Row }} Selection Row {{ Row -> {row}; }} Selection Heap(n) {{ if (n > 0) Heap -> [ roty 30 ] Nine; }}"
                   f" Selection Nine {{ Nine -> {things}; }}")  # fmt: skip


@pytest.mark.parametrize("places", [2, 40, 400])
def test_how_many_maps_a_front_has_does_not_show(places):
    data = heaps(places)
    origins, directions = rays(data, 1000, 3)
    expected = answers(data, origins, directions, accelerator="boxes")
    assert np.isfinite(expected["t"]).any()
    for isa in available(data):
        for options in ({}, {"front_items": 50}, {"front_items": ALL}):
            assert_same(answers(data, origins, directions, isa=isa, **options), expected, (isa, options))
    with Scene(data) as scene:
        most = scene.statistics["scene_bytes"]
    for memory in (most, most + 400, 2 * most):
        assert_same(answers(data, origins, directions, memory=memory), expected, memory)
        with Scene(data, memory=memory) as scene:
            assert scene.statistics["scene_bytes"] <= memory


@pytest.mark.parametrize("name", ["tree", "shading", "mirrors"])
def test_the_picture_is_the_same(name):
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=SCENES[name])
    with Scene(data, accelerator="boxes") as scene:
        expected = scene.render(48, 36)["color"]
    budgets = [{"memory": kilobytes * 1024} for kilobytes in (64, 1024, 2**20)]
    for options in [{"front_items": items} for items in ITEMS] + [{"isa": isa} for isa in available(data)] + budgets:
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


@pytest.mark.parametrize("shrink", [0.9, 0.5])
def test_maps_of_instances_hold_far_below_where_frames_are_magnified(shrink):
    """A spiral that ends in a point, seen from as near as its deepest parts are large; flattened maps at its leaves."""
    depth = round(30 / -np.log2(shrink))
    data = compile(
        f"""
        camera {{ location <0, -9, 2> look_at <0, 0, 0> }} light_source {{ <0, -9, 9> color rgb 1 }}
        object {{ Spiral({depth}) }}
        Selection Spiral(n)
        {{
            if (n > 0) Spiral -> cylinder + T_leaf Leaf + T_on Spiral(n - 1);
            else       Spiral -> sphere;
        }}
        Selection Leaf {{ Leaf -> sphere + [ trans 0 0 2 ] box; }}
        Transformation T_leaf {{ trans 0.3 0.2 0.5; roty 40; scale 0.2 0.1 0.004; }}
        Transformation T_on   {{ trans 0 0.1 1; rotz 33; roty 20; scale {shrink}; }}
        """
    )
    with Scene(data, accelerator="none") as scene:
        (batch,) = scene.unfold()
    random, size = np.random.default_rng(7), len(batch.matrix)
    chosen = random.integers(size, size=1500)
    targets = np.einsum("nij,nj->ni", batch.matrix[chosen], np.append(random.uniform(0, 1, (1500, 3)), np.ones((1500, 1)), axis=1))
    spans = np.linalg.norm(batch.matrix[chosen, :, 0], axis=1)[:, None]
    origins = targets + random.normal(size=(1500, 3)) * spans * random.choice([2.0, 30.0], (1500, 1))
    expected = answers(data, origins, targets - origins, accelerator="none")
    assert np.isfinite(expected["t"]).mean() > 0.5
    for items in (1, 8, 64):
        for isa in available(data):
            assert_same(answers(data, origins, targets - origins, front_items=items, isa=isa), expected, (items, isa))


@pytest.mark.parametrize("things", [1, 2, 5, 20])
def test_small_scenes_need_no_more_memory_than_they_take(things):
    row = " + ".join(f"[ trans {3 * i} 0 0 ] sphere" for i in range(things))
    data = compile(f"object {{ Row }} Selection Row {{ Row -> {row}; }}")
    with Scene(data) as scene:
        taken = scene.statistics["scene_bytes"]
    with Scene(data, memory=taken) as scene:
        assert scene.statistics["scene_bytes"] <= taken


@pytest.mark.parametrize("name, parameters", [("tree", {"order": 10}), ("tree", {"order": 16}), ("menger", {"level": 4})])
def test_memory_is_never_exceeded(name, parameters):
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=parameters)
    for kilobytes in (48, 64, 100, 200, 256, 512, 1024, 2048):
        with Scene(data, memory=kilobytes * 1024, threads=1) as scene:
            size = scene.statistics["bytes"]
            assert scene.statistics["front"]["count"] > 0
        assert size["states"] + size["nodes"] + size["items"] <= kilobytes * 1024, kilobytes


def test_memory_is_one_dial_from_graph_to_flat_scene():
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 12})
    limits, sizes = [], []
    for kilobytes in (40, 80, 200, 2**20):
        with Scene(data, memory=kilobytes * 1024) as scene:
            statistics = scene.statistics
        size = statistics["bytes"]
        sizes.append(size["states"] + size["nodes"] + size["items"])
        assert sizes[-1] <= kilobytes * 1024
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


def test_threads_build_the_same_fronts():
    """Large ones are opened and their trees built by all threads; where things stand in memory shows in no hit, but in counts."""
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 15})
    origins, directions = rays(compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 8}), 500, 3)
    seen = []
    for threads in (1, 2, 3, 7):
        with Scene(data, front_items=ALL, threads=threads) as scene:
            hits = scene.intersect(origins, directions)
            counts = scene.statistics
        seen.append((hits, [counts[name] for name in ("box_tests", "filtered", "primitive_tests", "bytes", "front")]))
    for hits, counts in seen:
        assert counts == seen[0][1]
        for ours, theirs in zip(hits, seen[0][0]):
            np.testing.assert_array_equal(ours, theirs)


def test_what_pays_is_opened_and_no_more():
    """By default: little of a sponge, where each level costs twenty copies, all of a small tree."""
    tree = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 6})
    sponge = compile(ROOT / "scenes" / "menger.plsys", parameters={"level": 5})
    with Scene(tree) as scene:
        assert scene.statistics["front"]["limit"] is None and scene.statistics["front"]["pilot_rays"] == 0
    with Scene(sponge) as scene:
        front, size = scene.statistics["front"], scene.statistics["scene_bytes"]
        assert front["pilot_rays"] > 0 and 0 < front["entries"] < 5
        assert size < front["flat_bytes"] / 100
    # What pays of a sponge is hardly more than its graph; of a tall tree less would do too.
    tall = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 16})
    with Scene(tall) as scene:
        front, size = scene.statistics["front"], scene.statistics["scene_bytes"]
    with Scene(tall, memory=size * 3 // 4) as less:
        assert less.statistics["front"]["entries"] > front["entries"] > 0


def test_fronts_that_are_not_needed_are_opened_for_good():
    """A sponge of level 4 by default: sponges of level 2 in one, no plates and rows between; a ray enters about one of them."""
    data = compile(ROOT / "scenes" / "menger.plsys", parameters={"level": 4})
    random = np.random.default_rng(2)
    targets = random.uniform(0, 1, (2000, 3))
    origins = targets + random.normal(size=targets.shape) * 3
    with Scene(data) as scene:
        assert scene.statistics["front"]["count"] <= 4
        scene.intersect(origins, targets - origins)
        assert scene.statistics["instances"] < 1.2 * len(targets)


def test_few_tall_fronts_stand_for_many_low_ones():
    """A tree of 20 levels has as many states; under a budget only every seventh or so needs a front, and all that is between
    stands opened. A ray then enters a sixth of the instances of the graph."""
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 20})
    with Scene(data, memory=128 * 1024) as scene, Scene(data, front_items=1) as graph:
        assert scene.statistics["front"]["count"] <= 4 < 20 <= graph.statistics["front"]["count"]
        origins, directions = rays(compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 8}), 300, 5)
        for ours, theirs in zip(scene.intersect(origins, directions), graph.intersect(origins, directions)):
            np.testing.assert_array_equal(ours, theirs)
        assert scene.statistics["instances"] < graph.statistics["instances"] / 6


def test_trees_are_improved_where_there_is_memory_for_that():
    """All of a tree in one front, whose 2,049 slanted cylinders are in each other's boxes: fewer nodes, in all and a ray."""
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 10})
    random = np.random.default_rng(4)
    origins, directions = random.uniform((-6, -5, 0), (6, 5, 12), (3000, 3)), random.normal(size=(3000, 3))
    with Scene(data, front_items=ALL) as improved, Scene(data, front_items=ALL, memory=256 * 1024) as plain:
        hits = [scene.intersect(origins, directions) for scene in (improved, plain)]
        for ours, theirs in zip(*hits):
            np.testing.assert_array_equal(ours, theirs)
        assert improved.statistics["bytes"]["nodes"] <= plain.statistics["bytes"]["nodes"]
        assert improved.statistics["box_tests"] < 0.97 * plain.statistics["box_tests"]


DIAMONDS = """
camera { location <0, 0, -9> look_at <0, 0, 0> }
light_source { <0, 5, -9> color rgb 1 }
object { Both }
Selection Both    { Both -> [ rotz 45 ] Diamond + [ trans 9 0 0; rotz 45 ] Diamond; }
Selection Diamond { Diamond -> Side + [ rotz 90 ] Side + [ rotz 180 ] Side + [ rotz 270 ] Side; }
Selection Side    { Side -> %s; }
""" % " + ".join(f"[ trans {i / 8} {1 - i / 8} 0; scale 0.05 ] sphere" for i in range(8))


def test_boxes_of_instances_turn_with_what_is_in_them(tmp_path):
    """A diamond that stands on its side is a square: nothing is entered where the corners of its box, turned, would be."""
    path = tmp_path / "diamonds.plsys"
    path.write_text(DIAMONDS)
    origins = np.array([(0, 1.2, -5), (0, -1.2, -5), (1.2, 0, -5), (-1.2, 0, -5)], float)
    corner = np.array([(0.7071, 0.7071, -5)])
    with Scene(compile(path), front_items=1, threads=1) as scene:
        scene.intersect(origins, np.tile((0.0, 0.0, 1.0), (4, 1)))
        assert scene.statistics["instances"] <= 4  # of Both
        assert np.isfinite(scene.intersect(corner, np.array([(0.0, 0.0, 1.0)])).t).all()


def test_what_occurs_once_needs_no_front():
    """A forest's ten thousand places stand in the scene's own front."""
    data = compile(ROOT / "scenes" / "forest.plsys", parameters={"order": 4})
    with Scene(data) as scene:
        front = scene.statistics["front"]
    assert front["limit"] > 10_000 and front["count"] < 300


PLACES = """camera { location <0,-9,5> look_at 0 }
light_source { <5,-9,9> color rgb 1 }
object { Garden }
Selection Garden { Garden -> {terms}; }
Selection Stone { Stone -> box + T_beside cone; }
Transformation T_beside { trans 1.5 0 0; }
{maps}
"""
# What of a map may be packed: turns about each axis, mirrors, and maps of more numbers than are packed.
MAPS = (
    "trans {x} {y} 0; rotz {a};",
    "trans {x} 0 {y}; roty -{a};",
    "rotx {a};",
    "trans {x} {y} 1; rotz {a}; scale 0.7;",
    "trans -{x} {y} 0; rotz 90; scale 1 -1 0.5;",
    "trans {x} {y} 0; rotx {a}; roty {a}; rotz 30;",
)


def garden(count: int) -> bytes:
    """Stones placed by maps that are computed, each in one place."""
    terms, maps = [], []
    for i in range(count):
        numbers = {"x": f"{i % 9} + rand({2 * i})", "y": f"{i // 9} + rand({2 * i + 1})", "a": f"(360*rand({i}))"}
        terms.append(f"T_{i} Stone")
        maps.append(f"Transformation T_{i} {{ {MAPS[i % len(MAPS)].format(**numbers)} }}")
    return PLACES.replace("{terms}", " + ".join(terms)).replace("{maps}", "\n".join(maps))


def test_maps_that_are_packed_are_the_same_maps():
    """Hits, normals and pictures through turned, mirrored and general places, in all accelerators."""
    data = compile(garden(36))
    origins, directions = rays(data, 1500, 8)
    expected = answers(data, origins, directions, accelerator="none")
    assert np.isfinite(expected["t"]).any()
    for options in [{"accelerator": name} for name in ("boxes", "grid", "bvh")] + [{"isa": isa} for isa in available(data)]:
        assert_same(answers(data, origins, directions, **options), expected, options)
    with Scene(data, accelerator="none") as scene, Scene(data) as ours:
        np.testing.assert_array_equal(ours.render(64, 48)["color"], scene.render(64, 48)["color"])


def test_places_that_turn_about_an_axis_take_few_bytes():
    """A tree of the forest is an item, a packed map and a pointer: no more than half of its map would be unpacked, besides."""
    with Scene(compile(ROOT / "scenes" / "forest.plsys", parameters={"order": 0})) as scene:
        assert scene.statistics["bytes"]["states"] < 10_000 * (56 + 8 + 48) + 400_000


def test_fronts_that_do_not_fit_are_left_for_unfolding_on_touch():
    data = compile(ROOT / "scenes" / "forest.plsys", parameters={"order": 3})
    origins = np.random.default_rng(1).uniform((0, 0, 3), (300, 300, 4), (40, 3))
    directions = np.tile((0.1, 0.2, -1.0), (40, 1))
    with Scene(data) as scene, Scene(data, memory=1 << 20) as less:
        assert less.statistics["front"]["count"] == 0 < scene.statistics["front"]["count"]
        for ours, theirs in zip(scene.intersect(origins, directions), less.intersect(origins, directions)):
            np.testing.assert_array_equal(ours, theirs)
        assert less.statistics["lazy"]["unfolded"] > 0


def test_a_budget_below_every_floor_names_the_need():
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 12})
    with pytest.raises(PlsysRuntimeError, match=r"needs at least \d+ KB; 10 KB are allowed|memory"):
        Scene(data, memory=10 * 1024)


PROBE = """
import resource, sys
from plsys.runtime import Scene
data, memory = open(sys.argv[1], "rb").read(), int(sys.argv[2])
with Scene(data, memory=memory, threads=1) as scene:
    scene.render(64, 48)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024, scene.statistics["front"]["count"])
"""


def peak(path: Path, memory: int) -> tuple[int, int]:
    done = subprocess.run([sys.executable, "-c", PROBE, path, str(memory)], capture_output=True, text=True, check=True)
    size, fronts = done.stdout.split()
    return int(size), int(fronts)


def test_the_process_stays_under_the_budget(tmp_path):
    """Its peak, building included, less that of a process with next to no scene."""
    for order in (0, 16):
        data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": order})
        (tmp_path / f"{order}.plsb").write_bytes(data)
    without, _ = peak(tmp_path / "0.plsb", 1 << 20)
    for budget in (64 << 10, 1 << 20, 4 << 20, 16 << 20, 1 << 30):
        with_, fronts = peak(tmp_path / "16.plsb", budget)
        assert fronts > 0
        assert with_ - without <= 1.1 * budget + (512 << 10), budget
