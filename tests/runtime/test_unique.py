"""Unique instances: more states than there is memory for, unfolded when rays come to them, with the same hits."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from instruction_sets import available
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source
from plsys.runtime import Scene
from plsys.runtime.errors import PlsysRuntimeError

SCENES = Path(__file__).resolve().parents[2] / "scenes"

FOREST = """
global_settings { assumed_gamma 1.0 seed 3 }
camera { location <-5, -30, 14> sky <0, 0, 1> right <-4/3, 0, 0> look_at <10, 10, 2> angle 50 }
light_source { <-40, -60, 80> color rgb 1 }
object { Forest texture { pigment { color rgb <0.45, 0.30, 0.15> } finish { ambient 0.1 diffuse 0.7 } } }
Selection Forest {
    C_start Forest;
    if (level > 0) Forest -> [ --level; side /= 2 ] (Forest + [ trans side 0 0 ] Forest + [ trans 0 side 0 ] Forest + [ trans side side 0 ] Forest);
    else           Forest -> [ trans rand(1) rand(2) 0; rotz 360*rand(3); scale 0.8 + 0.4*rand(4) ] Tree;
}
Calculation C_start { level = %d; side = 2.5*pow(2, level); }
Selection Tree {
    C_tree Tree;
    if (n > 0) Tree -> T_scale cylinder + [ --n; bend = mix(25, 35, rand(1)) ] (T_a Tree + T_b Tree);
    else       Tree -> 3: T_scale cylinder | 1: [ scale 0.2 ] sphere;
}
Calculation C_tree { n = %d; bend = 30; }
Transformation T_scale { scale 0.08 0.08 1; }
Transformation T_a { trans 0 0 0.98; roty bend; scale 0.7 + 0.1*rand(5); }
Transformation T_b { trans 0 0 0.98; rot -bend 0 1 0.1*sin(bend); rotz 90 + (rand(7) < 0.5 ? 30 : -30)*abs(rand(6)); scale exp(-0.3*max(rand(5), 0.5)); }
"""


def forest(level: int, order: int) -> bytes:
    return build(Source("forest.plsys", (FOREST % (level, order)).encode())).encode()


def picture(data: bytes, **options):
    with Scene(data, **options) as scene:
        return scene.render(40, 30, channels=("color", "depth", "primitive", "normal")), scene.statistics


@pytest.mark.parametrize("memory", [60_000, 400_000, 4_000_000])
def test_a_budget_changes_no_bit_of_a_picture(memory):
    data = forest(2, 5)
    expected, _ = picture(data, accelerator="none")
    found, counts = picture(data, memory=memory, threads=2)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
    if memory < 1_000_000:
        assert counts["lazy"]["unfolded"] > counts["lazy"]["states"] > 0
        assert counts["lazy"]["evicted"] > 0 and counts["lazy"]["bytes"] < memory
    else:
        assert counts["lazy"]["unfolded"] == 0 and counts["states"] > 1000


def test_more_states_than_can_be_built_are_unfolded_on_touch():
    """As hits of single rays; 256 trees of 255 primitives and more, no two alike."""
    data = forest(4, 7)
    random = np.random.default_rng(4)
    origins = random.uniform((0, 0, 8), (40, 40, 9), (60, 3))
    directions = random.uniform(-0.3, 0.3, (60, 3)) - (0, 0, 1)
    results = []
    for options in ({"accelerator": "none"}, {"memory": 1_000_000}, {"memory": 200_000}):
        with Scene(data, **options) as scene:
            results.append(scene.intersect(origins, directions))
            if "memory" in options:
                assert 0 < scene.statistics["lazy"]["unfolded"]
    assert np.isfinite(results[0].t).any()
    for result in results[1:]:
        for name, ours, expected in zip(result._fields, result, results[0]):
            np.testing.assert_array_equal(ours, expected, err_msg=name)


@pytest.mark.parametrize("px", [0.7, 3.0])
def test_cut_offs_are_the_same_in_every_accelerator_and_budget(px):
    """256 trees, no two alike, more states than are built: gates are those of classes, wherever they are asked."""
    data = forest(4, 7)
    expected, counts = picture(data, accelerator="none", detail=px, threads=2)
    assert counts["cut"]["instances"] > 0
    for options in ({"memory": 24_000_000, "threads": 2}, {"threads": 1}, {"accelerator": "boxes"}, {"accelerator": "grid"}):
        found, counts = picture(data, detail=px, **options)
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name], values, err_msg=f"{options} {name}")
        assert ("accelerator" in options) != (counts["lazy"]["unfolded"] > 0)


# What states of a symbol with the same parameters have in common, and what draws may change of it.
SWAYING = FOREST[: FOREST.index("Selection Tree {")].replace("] Tree;", "] Tree(%d, 30);") + """
Selection Tree(n, bend) {
    if (n > 0) Tree -> %s;
    else       Tree -> %s;
}
Transformation T_scale { scale 0.08 0.08 1; }
Transformation T_a { trans 0 0 0.98; roty bend; scale 0.75; }
Transformation T_b { trans 0 0 0.98; roty -bend; rotz 90; scale 0.7; }
Transformation T_sway { rotz 50*rand(0) - 25; roty 12*rand(1) - 6; }
Transformation T_maybe { scale floor(0.7 + rand(0)); }
"""
BELOW = "Tree(n - 1, bend - 1)"
APPLICATIONS = {
    "maps": (f"T_scale cylinder + T_a T_sway {BELOW} + T_b T_sway {BELOW}", "T_scale cylinder"),
    "maps of unions": (f"T_scale cylinder + [ rotz 9*rand(0) ] (T_a {BELOW} + T_b {BELOW})", "T_scale cylinder"),
    "several maps": (f"T_scale cylinder + T_sway (T_a T_sway {BELOW} + T_b T_sway T_sway {BELOW})", "T_scale cylinder"),
    "maps of leaves": (f"T_scale cylinder + T_a T_sway {BELOW} + T_b {BELOW}", "T_sway T_scale cylinder"),
    "what is there": (f"T_scale cylinder + T_a T_maybe {BELOW} + T_b T_maybe T_sway {BELOW}", "T_scale cylinder"),
    "choices": (f"1: T_scale cylinder + T_a T_sway {BELOW} + T_b {BELOW} | 2: T_b T_sway {BELOW}", "T_scale cylinder"),
    "parameters": (f"T_scale cylinder + [ bend = bend + rand(0) ] T_a T_sway {BELOW} + T_b T_sway {BELOW}", "T_scale cylinder"),
    "sizes": (f"T_scale cylinder + T_a T_sway {BELOW} + T_b T_sway {BELOW}", "[ scale 0.1 ] cone(0.5*rand(0))"),
    "variants": (f"T_scale cylinder + [ variants 50; ] T_a T_sway {BELOW} + T_b T_sway {BELOW}", "T_scale cylinder"),
}


@pytest.mark.parametrize("drawn", APPLICATIONS)
def test_states_that_differ_by_draws_are_the_same_in_every_accelerator_and_budget(drawn):
    fork, tip = APPLICATIONS[drawn]
    # Nothing has bounds that may be singular, so all of it is met by each ray.
    level, order, px, memory = (1, 4, 0.0, 200_000) if "T_maybe" in fork else (4, 7, 2.0, 24_000_000)
    data = build(Source("forest.plsys", (SWAYING % (level, order, fork, tip)).encode())).encode()
    expected, _ = picture(data, accelerator="none", detail=px, threads=2)
    found, counts = picture(data, memory=memory, detail=px, threads=2)
    assert counts["lazy"]["unfolded"] > 0
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


def test_states_of_each_depth_share_a_pattern():
    """Their parameters are whole numbers, which differ in few bits: patterns of all depths are remembered at once."""
    data = build(Source("forest.plsys", (SWAYING % (4, 7, *APPLICATIONS["maps"])).encode())).encode()
    _, counts = picture(data, memory=24_000_000, detail=2.0, threads=1)
    assert counts["lazy"]["evicted"] == 0 < counts["lazy"]["states"]
    assert counts["lazy"]["bytes"] < 400 * counts["lazy"]["states"]


@pytest.mark.parametrize("drawn", ["maps", "what is there", "sizes"])
def test_in_the_smallest_budgets_classes_are_bounded_once(drawn):
    """Else the graph below a state is followed again whenever that is unfolded, which took a minute."""
    data = build(Source("forest.plsys", (SWAYING % (1, 3, *APPLICATIONS[drawn])).encode())).encode()
    expected, _ = picture(data, accelerator="none")
    for memory in (32_000, 64_000):
        found, counts = picture(data, memory=memory, threads=2)
        assert counts["lazy"]["evicted"] > 100
        assert counts["lazy"]["visited"] < 500
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name], values, err_msg=f"{memory} {name}")


def test_where_classes_do_not_all_fit_those_that_took_work_stay():
    """The scene's 517 classes take 34,000 nodes once; 178,000 where all are let go at once for want of room."""
    data = build(SCENES / "forest.plsys").encode()
    expected, _ = picture(data, threads=1)
    found, counts = picture(data, memory=2_000_000, threads=1)
    assert counts["lazy"]["classes"] < 500 and counts["lazy"]["evicted"] > 0
    assert counts["lazy"]["visited"] < 130_000
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


def row_of_trees(count: int) -> bytes:
    """All of them in one production, whose state is large."""
    trees = " + ".join(f"[ trans {k % 20} {k // 20} 0; rotz 360*rand({k}) ] Tree" for k in range(count))
    start, end = FOREST.index("Selection Forest {"), FOREST.index("Selection Tree {")
    text = FOREST[:start] + f"Selection Forest {{ Forest -> {trees}; }}" + FOREST[end:] % 5
    return build(Source("row.plsys", text.encode())).encode()


def test_a_large_state_that_was_let_go_is_unfolded_once():
    """The item that enters it doesn't know of it any more; if each ray unfolded it again, nothing else would fit beside it."""
    data = row_of_trees(400)
    expected, _ = picture(data)
    found, counts = picture(data, memory=2_000_000, threads=1)
    assert counts["lazy"]["evicted"] > 0
    assert counts["lazy"]["unfolded"] < 80_000
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


def test_a_state_that_is_too_large_for_a_budget_names_the_need():
    """Nearly nothing would fit beside it, and it would be unfolded again for each of its items that a ray meets."""
    data = row_of_trees(200)
    with pytest.raises(PlsysRuntimeError, match=r"memory: a state of \d+ bytes .* takes about \d+ bytes") as raised:
        picture(data, memory=100_000)
    need = int(re.search(r"about (\d+)", str(raised.value))[1])
    expected, _ = picture(data)
    found, counts = picture(data, memory=need, threads=1)
    assert 0 < counts["lazy"]["bytes"] < need
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


# From above a tree is a thin upright pole; in its own frame that leans, so what is known of a tree reaches to where its twig
# would be, 3.4 from the pole. There, beyond a second pole, is room in what is known of the place.
EMPTY_TWIGS = FOREST[: FOREST.index("Selection Tree {")].replace("rotz 360*rand(3);", "roty -20; rotx -5;").replace(
    "] Tree;", "] Tree + [ trans -8 3 0; scale 0.05 0.05 20 ] cylinder;"
) + """
Selection Tree {
    Tree -> [ rotx 5; roty 20; scale 0.05 0.05 20 ] cylinder + [ x = 0.51 + 0.0001*rand(9); trans 0.1 -0.05 10.2; scale 0.1 ] Twig(x);
}
Selection Twig(x) { if (x > 0.515) Twig -> sphere; }
"""


def test_instances_that_may_be_empty_are_cut_the_same_in_every_accelerator():
    """No twig has anything in it, which isn't known of their class: cut, they stand far from all else in their tree."""
    data = build(Source("forest.plsys", (EMPTY_TWIGS % 7).encode())).encode()
    expected, counts = picture(data, accelerator="none", detail=1.0, threads=2)
    found, lazy = picture(data, detail=1.0)
    assert lazy["lazy"]["unfolded"] > 0 and lazy["cut"] == counts["cut"]
    assert counts["cut"]["instances"] > 0
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


def test_a_cut_off_is_the_same_while_states_are_thrown_out():
    """Rays let go of all states on their way and find them again, with the spans of what they had passed."""
    data = forest(4, 10)
    expected, _ = picture(data, accelerator="none", detail=0.2, threads=2)
    found, counts = picture(data, memory=20_000_000, detail=0.2, threads=2)
    assert counts["lazy"]["evicted"] > 0
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


@pytest.mark.parametrize(("level", "order", "px", "memory"), [(2, 5, 0.0, 60_000), (4, 7, 0.7, 24_000_000), (4, 10, 0.2, 20_000_000)])
def test_rays_that_go_together_see_what_each_sees_alone(level, order, px, memory):
    """Colours are traced in packets, shadows too, the other channels ray by ray."""
    data = forest(level, order)
    with Scene(data, accelerator="none", detail=px, threads=2) as scene:
        expected = scene.render(42, 31)["color"]
    for isa in available(data):
        with Scene(data, memory=memory, detail=px, isa=isa, threads=1) as scene:
            together = scene.render(42, 31)["color"]
            found = scene.statistics["lazy"]["found"]
            alone = scene.render(42, 31, channels=("color", "boxes"))["color"]
            assert found < 0.5 * (scene.statistics["lazy"]["found"] - found)
            assert memory == 24_000_000 or scene.statistics["lazy"]["evicted"] > 0
        np.testing.assert_array_equal(together, expected, err_msg=isa)
        np.testing.assert_array_equal(alone, expected, err_msg=isa)


def test_a_cut_off_keeps_what_a_forest_covers_and_unfolds_less():
    data = forest(4, 7)

    def seen(**options):
        with Scene(data, memory=30_000_000, **options) as scene:
            depth = scene.render(120, 90, channels=("depth",))["depth"]
            return np.isfinite(depth).mean(), scene.statistics

    whole, all_of_it = seen()
    for px, off in ((1.0, 0.05), (4.0, 0.1)):
        share, counts = seen(detail=px)
        assert share == pytest.approx(whole, rel=off)
        assert 0 < counts["cut"]["max_error"] < px
        assert counts["lazy"]["unfolded"] < all_of_it["lazy"]["unfolded"]


def test_a_cut_off_in_too_small_a_budget_names_the_need():
    """Whether there are too many states mustn't depend on the budget, so there has to be room to find out."""
    with pytest.raises(PlsysRuntimeError, match="memory: .* states need more than"):
        picture(forest(4, 7), detail=1.0, memory=400_000)


def test_gates_of_classes_tell_no_zero_from_its_negative():
    """Straight down, all sums of a direction's first two components are zeros: either sign of them is the same ray."""
    side = np.linspace(0.5, 79.5, 40)
    origins = np.stack([*np.meshgrid(side, side), np.full((40, 40), 30.0)], axis=-1).reshape(-1, 3)
    with Scene(forest(4, 7), detail=1.0) as scene:
        expected, *others = (
            scene.intersect(origins, np.broadcast_to([x, y, -1.0], origins.shape))
            for x in (0.0, -0.0)
            for y in (0.0, -0.0)
        )
        assert scene.statistics["lazy"]["unfolded"] > 0
    assert 0 < np.isfinite(expected.t).sum() < len(origins)
    for found in others:
        np.testing.assert_array_equal(found.primitive, expected.primitive)
        np.testing.assert_array_equal(found.t, expected.t)


PROBE = """
import resource, sys
from plsys.runtime import Scene
from plsys.runtime.errors import PlsysRuntimeError
data, memory = open(sys.argv[1], "rb").read(), int(sys.argv[2])
with Scene(data, memory=memory or None, threads=1) as scene:
    scene.render(64, 48)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024, scene.statistics["lazy"]["unfolded"])
"""


def peak(path, memory: int) -> tuple[int, int]:
    output = subprocess.run([sys.executable, "-c", PROBE, path, str(memory)], capture_output=True, text=True, check=True)
    bytes_, unfolded = output.stdout.split()
    return int(bytes_), int(unfolded)


def test_memory_stays_under_the_budget(tmp_path):
    (tmp_path / "forest.plsb").write_bytes(forest(4, 10))
    (tmp_path / "tree.plsb").write_bytes(forest(0, 0))
    without, _ = peak(tmp_path / "tree.plsb", 0)
    budget = 8 << 20
    with_, unfolded = peak(tmp_path / "forest.plsb", budget)
    assert unfolded > 0
    assert with_ - without <= 1.1 * budget
