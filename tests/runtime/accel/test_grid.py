"""The paper's grid (chapter 4): any resolution gives the hits of `none`; bad sizes are refused."""

from __future__ import annotations

import numpy as np
import pytest

from plsys.compiler import compile
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source
from plsys.runtime import PlsysRuntimeError, Scene
from test_agreement import around, rays

CAMERA = "camera { location <0, -9, 3> sky <0, 0, 1> look_at <0, 0, 0> }\n"
SIZES = [(1, 1, 1), (2, 1, 3), (5, 5, 5), (40, 40, 40), (1, 64, 2)]


def encode(text: str, **parameters: float) -> bytes:
    return build(Source.from_text(CAMERA + text), parameters=parameters).encode()


SCENES = {
    "scattered": """object { Field } Parameter level = 4 [0 to 8];
        Selection Field { C_all Field;
            if (n > 0) Field -> [ --n; s = s/2 ] (Field + [ trans 1.1*s 0 0 ] Field + [ trans 0 1.1*s 0 ] Field + [ trans s s rand(0)*s ] Field);
            else Field -> [ trans rand(0) rand(1) 0; scale 0.4 ] sphere; }
        Calculation C_all { n = level; s = 16; }""",
    "one on another": """object { Heap } Selection Heap { C_all Heap; if (n > 0) Heap -> sphere + [ --n; rotz 20; scale 0.97 1 0.9 ] Heap + box; }
        Calculation C_all { n = 12; }""",
    "with planes inside": """object { Steps } plane { <0, 0, 1>, -6 }
        Selection Steps { C_all Steps; if (n > 0) Steps -> Floor + [ trans 1 0 0; scale 0.5 ] cone(0.3) + [ --n; trans 0 1 1 ] Steps; }
        Selection Floor { Floor -> [ rotx 10*n ] square + [ trans 0 0 -9 + n/4; rotx 90 ] disc; }
        Calculation C_all { n = 6; }""",
    "a flat one": "object { Row } Selection Row { C_all Row; if (n > 0) Row -> disc + [ --n; trans 2.5 0 0 ] Row; } Calculation C_all { n = 20; }",
    "nothing": "object { No } Selection No { No -> ; }",
}


def assert_same(data: bytes, sizes) -> None:
    centre, size = around(data)
    origins, directions = rays(400, 5, centre, size)
    with Scene(data, accelerator="none") as scene:
        expected = scene.intersect(origins, directions)
        distance = np.where(np.isfinite(expected.t), expected.t * 1.2, 1.0)
        shadows = scene.occluded(origins, directions, distance)
    for grid in sizes:
        with Scene(data, accelerator="grid", grid=grid) as scene:
            hits = scene.intersect(origins, directions)
            for name, ours, theirs in zip(hits._fields, hits, expected):
                np.testing.assert_array_equal(ours, theirs, err_msg=f"{grid}: {name}")
            np.testing.assert_array_equal(scene.occluded(origins, directions, distance), shadows)


@pytest.mark.parametrize("name", SCENES)
def test_hits_are_those_of_none_at_any_resolution(name):
    assert_same(encode(SCENES[name]), [None, *SIZES])


@pytest.mark.parametrize(
    "scene, parameters",
    [("tree", {}), ("menger", {"level": 3}), ("conifer", {}), ("bush", {}), ("koch", {"level": 2})],
)
def test_hits_in_example_scenes(scene, parameters):
    assert_same(
        build(Source.read(f"scenes/{scene}.plsys"), parameters=parameters).encode(), [None, (64, 64, 64)]
    )


def test_rays_from_far_away_and_along_the_voxels_walls():
    data = encode(SCENES["scattered"])
    with Scene(data, accelerator="none") as plain, Scene(data, accelerator="grid", grid=(8, 8, 8)) as grid:
        low, high = (np.array(x) for x in ((0, 0, -2.0), (34, 34, 16.0)))
        walls = np.linspace(0, 1, 33)[:, None] * (high - low) + low
        for axis in range(3):
            origins = walls.copy()
            origins[:, axis] = -40.0
            direction = np.zeros(3)
            direction[axis] = 1.0
            for far in (0.0, 1e3, 1e9, 1e13):
                moved = origins - far * direction
                a, b = plain.intersect(moved, direction), grid.intersect(moved, direction)
                np.testing.assert_array_equal(a.t, b.t)
                np.testing.assert_array_equal(a.primitive, b.primitive)


def test_a_scene_through_glass_counts_every_hit_once():
    """Shadows through transparent things take all hits of a ray; a sphere that spans many voxels must count twice."""
    text = """light_source { <0, 0, 30> color rgb 1 } plane { <0, 0, 1>, -1 pigment { color rgb 1 } }
        object { Glasses texture { pigment { color rgbf <0.9, 0.8, 0.7, 0.8> } } }
        Selection Glasses { C_all Glasses; if (n > 0) Glasses -> [ scale 3 3 0.2 ] sphere + [ --n; trans 0.3 0.2 0.7 ] Glasses; }
        Calculation C_all { n = 5; }"""
    data = compile(CAMERA + text)
    images = []
    for options in (
        {"accelerator": "none"},
        {"accelerator": "grid"},
        {"accelerator": "grid", "grid": (31, 33, 29)},
    ):
        with Scene(data, **options) as scene:
            images.append(scene.render(60, 45)["color"])
    np.testing.assert_array_equal(images[1], images[0])
    np.testing.assert_array_equal(images[2], images[0])


@pytest.mark.parametrize("grid", [(0, 1, 1), (16, 16), (4096, 4096, 4096), "16x16x8", 3])
def test_bad_sizes_are_refused(grid):
    with pytest.raises(PlsysRuntimeError, match="grid"):
        Scene(encode("sphere { 0, 1 }"), accelerator="grid", grid=grid)


def test_more_voxels_take_more_memory_and_fewer_tests():
    """The paper's trade: memory for time."""
    data = encode(SCENES["scattered"], level=6)
    costs = []
    for options in (
        {"accelerator": "boxes"},
        {"accelerator": "grid"},
        {"accelerator": "grid", "grid": (128, 128, 16)},
    ):
        with Scene(data, **options) as scene:
            scene.render(40, 30)
            costs.append((scene.statistics["scene_bytes"], scene.statistics["box_tests"]))
    memory, tests = zip(*costs)
    assert memory[0] <= memory[1] < memory[2]
    assert tests[0] > 1.5 * tests[1] > 3 * tests[2]


def test_the_command_line_takes_a_size(tmp_path, capsys):
    from plsys.compiler.cli import main

    scene = tmp_path / "ball.plsys"
    scene.write_text(CAMERA + "sphere { 0, 1 }\n")
    picture = tmp_path / "ball.pfm"
    options = ["render", str(scene), "-o", str(picture), "--size", "16x12", "--accel", "grid", "--json"]
    assert main([*options, "--grid", "4x4x2"]) == 0
    assert '"accelerator": "grid"' in capsys.readouterr().out
    with pytest.raises(SystemExit) as stopped:
        main([*options, "--grid", "4x4"])
    assert stopped.value.code == 2 and "'4x4' isn't NxMxK" in capsys.readouterr().err
