"""Rays are traced together, and nobody can tell by the hits: in packets where they go about the same way, in streams, a
step of each in turn, where they don't."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_fronts import ALL, ROOT, SCENES, answers, assert_same

from instruction_sets import available
from plsys.compiler import compile
from plsys.runtime import PlsysRuntimeError, Scene
from random_scenes import scenes

SIDE = 12


def middle(data: bytes) -> tuple[np.ndarray, float]:
    """Where the primitives are: a point among them, and their extent."""
    with Scene(data, accelerator="none") as scene:
        places = [batch.matrix[batch.kind != 9][:, :, 3] for batch in scene.unfold()]
    places = np.concatenate([*places, np.zeros((1, 3))])
    return np.median(places, axis=0), 1.0 + float(np.ptp(places, axis=0).max())


def bundles(data: bytes, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Small pictures from all around, tile by tile: narrow and wide, from one eye or from a surface; sixteen rays that are
    neighbours lie together."""
    random = np.random.default_rng(seed)
    centre, size = middle(data)
    tile = np.arange(SIDE * SIDE).reshape(SIDE // 4, 4, SIDE // 4, 4).transpose(0, 2, 1, 3).ravel()
    across, up = (grid.ravel()[tile, None] / SIDE - 0.5 for grid in np.meshgrid(range(SIDE), range(SIDE)))
    origins, directions = [], []
    for width in (1e-3, 0.03, 0.3, 2.0):
        for apart in (0.0, 0.01):
            outward = random.normal(size=3)
            eye = centre + outward * size * random.choice([0.05, 0.7, 20.0]) / np.linalg.norm(outward)
            ahead = centre + random.uniform(-0.4, 0.4, 3) * size - eye
            sideways = np.cross(ahead, random.normal(size=3))
            sideways /= np.linalg.norm(sideways) / np.linalg.norm(ahead)
            upward = np.cross(sideways, ahead) / np.linalg.norm(ahead)
            spread = across * sideways + up * upward
            origins.append(eye + apart * spread)
            directions.append(ahead + width * spread)
    return np.concatenate(origins), np.concatenate(directions)


def scattered(data: bytes, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The same rays in an order in which neighbours have nothing in common."""
    origins, directions = bundles(data, seed)
    order = np.random.default_rng(seed).permutation(len(origins))
    return origins[order], directions[order]


@pytest.mark.parametrize("arranged", [bundles, scattered])
@pytest.mark.parametrize("name", SCENES)
def test_company_does_not_show(name, arranged):
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=SCENES[name])
    origins, directions = arranged(data, 3)
    expected = answers(data, origins, directions, accelerator="boxes")
    assert np.isfinite(expected["t"]).any()
    for items in (1, 21, 256, ALL):
        for isa in available(data):
            assert_same(answers(data, origins, directions, front_items=items, isa=isa), expected, (items, isa))


@pytest.mark.parametrize("arranged", [bundles, scattered])
@pytest.mark.parametrize("far, length", [(30, 1), (1e3, 1e-9), (1e5, 1e9), (1e9, 1), (1e14, 1)])
@pytest.mark.parametrize("name", ["tree", "menger"])
def test_company_from_far_away_does_not_show(name, far, length, arranged):
    """Rays to the same points from eyes that are `far` times as far away; a direction's length counts in t only."""
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=SCENES[name])
    eyes, directions = arranged(data, 4)
    centre, _ = middle(data)
    origins = centre + far * (eyes - centre)
    directions = length * (eyes + directions - origins)
    expected = answers(data, origins, directions, accelerator="boxes")
    assert np.isfinite(expected["t"]).any()
    for items in (1, 21, ALL):
        for isa in available(data):
            assert_same(answers(data, origins, directions, front_items=items, isa=isa), expected, (items, isa))


@pytest.mark.parametrize("arranged", [bundles, scattered])
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(text=scenes(), seed=st.integers(0, 2**32))
def test_random_scenes_are_the_same_in_company(arranged, text, seed):
    data = compile(text)
    origins, directions = arranged(data, seed)
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


def test_a_ray_that_is_refused_is_named_wherever_it_stands():
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 4})
    origins, directions = bundles(data, 1)
    directions[37] = 0.0
    with Scene(data) as scene, pytest.raises(PlsysRuntimeError, match="ray 37 is zero"):
        scene.intersect(origins, directions)


def test_packets_share_their_steps():
    """Neighbours through a tree take fewer box tests together than each alone."""
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 8})
    origins, directions = bundles(data, 5)
    narrow = slice(0, SIDE * SIDE)
    tests = {}
    for isa in available(data):
        with Scene(data, isa=isa, threads=1, front_items=ALL) as scene:
            scene.intersect(origins[narrow], directions[narrow])
            tests[isa] = scene.statistics["box_tests"]
    for isa, count in tests.items():
        assert isa == "scalar" or count < 0.5 * tests["scalar"]


def test_rays_that_part_share_their_steps():
    """Where neighbours are farther apart than branches are thick, a node is still visited once for all that come to it."""
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 12})
    origins, directions = bundles(data, 5)
    apart, tests = slice(3 * SIDE * SIDE, 4 * SIDE * SIDE), {}
    for isa in available(data):
        with Scene(data, isa=isa, threads=1, front_items=8) as scene:
            scene.intersect(origins[apart], directions[apart])
            tests[isa] = scene.statistics["box_tests"]
    for isa, count in tests.items():
        assert isa == "scalar" or count < 0.6 * tests["scalar"]


@pytest.mark.parametrize("size", [(32, 32), (19, 13), (3, 2), (1, 1)])
def test_pictures_are_the_same_whose_rays_go_together(size):
    """Blocks of pixels at the picture's edges are smaller; with another channel pixels come one by one."""
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 6})
    with Scene(data) as scene:
        together = scene.render(*size)["color"]
        alone = scene.render(*size, channels=("color", "boxes"))["color"]
    with Scene(data, accelerator="boxes") as scene:
        expected = scene.render(*size)["color"]
    np.testing.assert_array_equal(together, expected)
    np.testing.assert_array_equal(alone, expected)


ANTIALIAS = [dict(antialias="off"), dict(antialias="grid", samples=2), dict(antialias="adaptive", samples=3, threshold=0.05)]


@pytest.mark.parametrize("options", ANTIALIAS, ids=lambda options: options["antialias"])
@pytest.mark.parametrize("name", ["shading", "mirrors", "menger"])
def test_shadows_and_samples_go_together_unseen(name, options):
    """Patterns, transparent things, several lights, mirrors: by packets, one by one, and by another accelerator."""
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=SCENES[name])
    with Scene(data, accelerator="boxes") as scene:
        expected = scene.render(37, 29, **options)["color"]
    for isa in available(data):
        with Scene(data, isa=isa) as scene:
            np.testing.assert_array_equal(scene.render(37, 29, **options)["color"], expected, err_msg=isa)
            alone = scene.render(37, 29, channels=("color", "boxes"), **options)["color"]
            np.testing.assert_array_equal(alone, expected, err_msg=isa)


def test_shadow_packets_share_their_steps():
    data = compile(ROOT / "scenes" / "menger.plsys", parameters={"level": 3})
    origins, directions = bundles(data, 5)
    narrow, tests = slice(0, SIDE * SIDE), {}
    for isa in available(data):
        with Scene(data, isa=isa, threads=1) as scene:
            scene.occluded(origins[narrow], directions[narrow])
            tests[isa] = scene.statistics["box_tests"]
    for isa, count in tests.items():
        assert isa == "scalar" or count < 0.5 * tests["scalar"]


CUT = [("menger", {"level": 9}), ("tree", {"order": 12}), ("menger_endless", {}), ("fern_endless", {}), ("mirrors", {})]


@pytest.mark.parametrize("options", ANTIALIAS, ids=lambda options: options["antialias"])
@pytest.mark.parametrize("name, parameters", CUT, ids=[name for name, _ in CUT])
def test_company_does_not_show_where_details_are_cut(name, parameters, options):
    """Each ray has a gate of its own: above the cut-off, near it, in shadows and behind mirrors."""
    data = compile(ROOT / "scenes" / f"{name}.plsys", parameters=parameters)
    for detail in (0.5, 4.0):
        with Scene(data, accelerator="boxes", detail=detail) as scene:
            expected, cut = scene.render(45, 35, channels=("color", "depth"), **options), scene.statistics["cut"]
        for isa in available(data):
            for items in (1, 21, 256):
                with Scene(data, isa=isa, detail=detail, front_items=items, threads=1) as scene:
                    together = scene.render(45, 35, channels=("color", "depth"), **options)
                    assert scene.statistics["cut"] == cut, (detail, isa, items)
                for channel, values in expected.items():
                    np.testing.assert_array_equal(together[channel], values, err_msg=f"{detail} {isa} {items} {channel}")


def test_packets_share_their_steps_where_details_are_cut():
    data = compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 12})
    tests = {}
    for isa in available(data):
        with Scene(data, isa=isa, threads=1, detail=1) as scene:
            scene.render(160, 120)
            tests[isa] = scene.statistics["box_tests"]
    for isa, count in tests.items():
        assert isa == "scalar" or count < 0.5 * tests["scalar"]


@pytest.mark.parametrize("count", [1, 16])
def test_a_ray_along_a_cylinder_s_axis_and_beside_it_is_free(count):
    """It meets the cylinder's box, and its distance from the axis is all that tells."""
    data = compile("camera { location -9 look_at 0 } cylinder { 0, <0, 0, 1>, 1 pigment { color rgb 1 } }")
    for isa in available(data):
        with Scene(data, isa=isa) as scene:
            for x, blocked in ((0.9, False), (0.5, True)):
                origins = np.tile([x, x, -5.0], (count, 1))
                assert scene.occluded(origins, (0, 0, 1)).tolist() == [blocked] * count, isa


def test_a_plane_is_met_by_those_who_go_towards_it():
    """Rays of one packet from both sides of it, from upon it, and along it, zeros of either sign included."""
    beside = "".join(f"sphere {{ <9, {y}, 0>, 1 pigment {{ color rgb 1 }} }}" for y in (-40, 40))  # packets begin close together
    data = compile("camera { location -9 look_at 0 } plane { <0, 0, 1>, 0 pigment { color rgb 1 } }" + beside)
    heights, climbs = (2.0, 1e-300, 0.0, -0.0, -1e-300, -2.0), (0.05, 1e-300, 0.0, -0.0, -1e-300, -0.05)
    origins = np.array([(0.0, 0.0, z) for z in heights for _ in climbs])
    directions = np.array([(1.0, 0.0, z) for _ in heights for z in climbs])
    expected = answers(data, origins, directions, accelerator="none")
    assert 0 < np.isfinite(expected["t"]).sum() < len(origins)
    tests = {}
    for isa in available(data):
        assert_same(answers(data, origins, directions, isa=isa), expected, isa)
        with Scene(data, isa=isa) as scene:
            scene.intersect(origins, directions)
            tests[isa] = scene.statistics["box_tests"]
        assert isa == "scalar" or tests[isa] < 0.5 * tests["scalar"]
