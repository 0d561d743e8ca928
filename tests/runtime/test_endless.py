"""Recursions without end and the detail cut-off, as a user sees them: pictures, counts, errors."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import whole
from instruction_sets import available

from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source
from plsys.runtime import PlsysRuntimeError, Scene

SCENES = Path(__file__).resolve().parents[2] / "scenes"
ACCELERATORS = ("none", "boxes", "grid", "bvh")
CHANNELS = ("color", "depth", "normal", "primitive", "symbol", "rule", "recursion")

HEAD = """
global_settings { assumed_gamma 1.0 }
camera { location <%s> sky <0, 0, 1> right <-1, 0, 0> look_at <%s> angle %s }
"""
WHITE = "texture { pigment { color rgb 1 } finish { ambient 0 diffuse 0 emission 1 } }"
SPONGE = """
Selection Sponge  { Sponge  -> [ scale 1/3 ] (Plate + [ trans 0 0 1 ] Pillars + [ trans 0 0 2 ] Plate); }
Selection Plate   { Plate   -> Row + [ trans 0 1 0 ] Ends + [ trans 0 2 0 ] Row; }
Selection Pillars { Pillars -> Ends + [ trans 0 2 0 ] Ends; }
Selection Row     { Row     -> Ends + [ trans 1 0 0 ] Sponge; }
Selection Ends    { Ends    -> Sponge + [ trans 2 0 0 ] Sponge; }
"""
FERN = """
Selection Frond { Frond -> T_stalk cone(0.6) + T_tip Frond + T_left Frond + T_right Frond; }
Transformation T_tip   { matrix 0.85 0 -0.04   0 0.85 0   0.04 0 0.85    0 0 1.6; }
Transformation T_left  { matrix 0.20 0 0.23    0 0.3 0    -0.26 0 0.22   0 0 1.6; }
Transformation T_right { matrix -0.15 0 0.26   0 0.3 0    0.28 0 0.24    0 0 0.44; }
Transformation T_stalk { scale 0.06 0.06 1.7; }
"""


def compiled(text: str) -> bytes:
    return build(Source("scene.plsys", text.encode())).encode()


def view(location, look_at, angle=40) -> str:
    return HEAD % (", ".join(repr(float(x)) for x in location), ", ".join(repr(float(x)) for x in look_at), angle)


def picture(data: bytes, size=64, channels=CHANNELS, antialias=0, **options):
    with Scene(data, **options) as scene:
        aa = dict(antialias="grid", samples=antialias) if antialias else {}
        return scene.render(size, size, channels=channels, **aa), scene.statistics


def brightness(data: bytes, size: int, antialias: int, detail: float) -> float:
    return float(picture(data, size, ("color",), antialias, detail=detail)[0]["color"].mean())


@pytest.mark.parametrize("name", ["fern_endless", "menger_endless"])
def test_every_accelerator_draws_the_same(name):
    data = build(SCENES / f"{name}.plsys").encode()
    expected, counts = picture(data, 48, accelerator="none", threads=1)
    assert counts["cut"]["instances"] > 10 and 0 < counts["cut"]["max_error"] < 1
    assert counts["primitives"] is None and counts["depth"] is None and counts["detail"] == 0.5
    for accelerator in ACCELERATORS[1:]:
        found, other = picture(data, 48, accelerator=accelerator, threads=2)
        for channel in CHANNELS:
            np.testing.assert_array_equal(found[channel], expected[channel], err_msg=f"{accelerator}: {channel}")
        assert other["cut"] == counts["cut"]


@pytest.mark.parametrize("rest", ["sphere", "[ scale 0.3 ] triangle + [ trans 0 1 0 ] square", "[ trans 0 1 0; scale 0.5 ] sphere"])
def test_what_no_rounding_can_tell_apart_is_met_by_every_accelerator(rest):
    """Rays to the point that copies shrink to: boxes there stick out of each other by a rounding."""
    symbol = "Selection A { A -> [ trans -0.6 -0.1 -0.9; roty 15; scale 0.5 ] A + %s; }\n" % rest
    data = compiled(view((1, -8, 2), (0, 0, 0)) + symbol + 2 * "object { A }\n")
    turn = np.radians(15)
    step = 0.5 * np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    point = np.linalg.solve(np.eye(3) - step, [-0.6, -0.1, -0.9])
    random = np.random.default_rng(1)
    origins = random.normal(size=(5000, 3)) + point
    directions = point - origins + random.normal(size=(5000, 3)) * 10 ** random.uniform(-15, -10, (5000, 1))
    hits = []
    for accelerator in ACCELERATORS:
        with Scene(data, accelerator=accelerator) as scene:
            hits.append(scene.intersect(origins, directions))
    assert np.count_nonzero(hits[0].depth > 20) > 500
    for name, found in zip(ACCELERATORS[1:], hits[1:]):
        for field in ("t", "primitive", "depth", "normal"):
            np.testing.assert_array_equal(getattr(found, field), getattr(hits[0], field), err_msg=f"{name}: {field}")


# A map that lacks little of being singular, met from far away: rounding moves hits out of the boxes around them.
SINGULAR = """
object { Root scale 0.5 translate <-1, 0, 0> }
Selection S0
{
    S0 -> [ trans -0.926 -0.885 -0.0252; roty 34.9; scale 0.42 ] S1 + box
        + [ scale -0.141309 -0.168093 0.459518; scale 20.8551 0.00359772 0.0107109; ] cylinder + [ scale 0.495 ] S1;
}
Selection S1
{
    S1 -> [ rotx 28.44; matrix 1 1 0  1 1.00000024838 0  0 0 1  0 0 0.78; ] sphere
        + [ shear 0.485 0 -0.185 0 0 -0.429; ] [ trans -0.264 -0.323 0.421; roty -33.1; scale 0.562 ] S0 + sphere;
}
Selection Root { Root -> S0 + [ trans 1 0 1; scale -1 1 0.6 ] S0; }
"""
FROM_AFAR = (
    [(-21.63878374809666, -0.6145833049407701, 0.3014733739382358), (74862662.11732459, -38007733.32436264, 54323050.93011382),
     (-43745340.97026751, -77820719.04695381, 45058640.6431775), (-52407209.71277015, 51946515.56630968, -67491065.76328897)],
    [(1e-05, 0.0, 0.0), (-0.822050746867668, 0.4173547065144534, -0.5965096898887777),
     (0.6826245380373616, 1.214354095349309, -0.7031179553729191), (1.366791073061848, -1.3547761310328221, 1.7601812803787436)],
)  # fmt: skip

# Flat cones, 27 levels down: in their frames a packet's rays are farther away than the square of a single precision number tells.
FLAT = """
object { Root scale 0.5 translate <-1, 0, 0> }
object { Root scale <1, -1, 1> }
Selection S0 { S0 -> sphere + [ a = rand(1) ] [ scale 0.412 ] S1; }
Selection S1
{
    S1 -> [ scale 1e6 1e-6 1; rotz -52.9; ] cone
        + [ shear 0.427 0 -0.118 0 0 -0.314; ] [ trans 0.819 0.738 0.293; roty 20.2; scale 0.375 ] S1
        + [ scale 0.3 + abs(a)*0.2; ] sphere;
}
Selection Root { Root -> S0 + [ a = 1; trans 1 0 1; scale -1 1 0.6 ] S1; }
"""
TOGETHER = (
    [(-0.6115223026085055, 0.1878348925860158, -0.09227328015633551), (-0.6115223026344314, 0.1878348925860158, -0.09227328013040959),
     (-0.6115223026603573, 0.1878348925860158, -0.09227328010448366), (-0.6115223027122092, 0.1878348925860158, -0.09227328002670589)],
    [(0.0, -1.0, 0.0)] * 4,
)  # fmt: skip


@pytest.mark.parametrize("text, rays, found", [(SINGULAR, FROM_AFAR, 1), (FLAT, TOGETHER, 4)], ids=["singular", "flat"])
def test_hits_that_rounding_moves_far_are_the_same_by_every_accelerator(text, rays, found):
    data = compiled(view((3, -6, 1), (0, 0, 0)) + text)
    with Scene(data, accelerator="none") as scene:
        expected = scene.intersect(*rays)
    assert np.count_nonzero(np.isfinite(expected.t)) == found
    ways = [{"accelerator": name} for name in ("boxes", "grid")]
    ways += [{"isa": isa, "front_items": items} for isa in available(data) for items in (1, 7, 2**64 - 1)]
    for way in ways:
        with Scene(data, **way) as scene:
            for field in ("t", "depth", "normal"):
                np.testing.assert_array_equal(getattr(scene.intersect(*rays), field), getattr(expected, field), err_msg=f"{way}: {field}")


@pytest.mark.parametrize("name", ["tree", "menger", "palm"])
def test_a_cut_off_of_a_finite_scene_is_the_same_by_every_accelerator(name):
    data = build(SCENES / f"{name}.plsys").encode()
    expected, counts = picture(data, 40, accelerator="none", detail=3)
    assert counts["cut"]["instances"] > 0
    for accelerator in ACCELERATORS[1:]:
        found, other = picture(data, 40, accelerator=accelerator, detail=3)
        for channel in CHANNELS:
            np.testing.assert_array_equal(found[channel], expected[channel], err_msg=f"{accelerator}: {channel}")
        assert other["cut"] == counts["cut"]


@pytest.mark.parametrize("name", ["fern_endless", "menger_endless", "tree", "bush", "koch"])
def test_how_far_fronts_are_unfolded_changes_no_cut(name):
    data = build(SCENES / f"{name}.plsys").encode()
    expected, counts = picture(data, 40, accelerator="none", detail=3)
    assert counts["cut"]["instances"] > 0
    for options in (dict(front_items=1), dict(front_items=8), dict(front_items=300), dict(isa="scalar", front_items=32)):
        found, other = picture(data, 40, detail=3, threads=2, **options)
        for channel in CHANNELS:
            np.testing.assert_array_equal(found[channel], expected[channel], err_msg=f"{options}: {channel}")
        assert other["cut"] == counts["cut"]


def test_memory_bounds_the_fronts_of_a_scene_with_a_cut_off():
    data = build(SCENES / "menger.plsys", parameters={"level": 10}).encode()
    taken = []
    for memory in (100_000, 150_000, 300_000, 1_000_000):
        with Scene(data, detail=1, memory=memory) as scene:
            counts = scene.statistics
        taken.append(counts["scene_bytes"] - counts["bytes"]["program"])
        assert taken[-1] <= memory
    assert taken == sorted(taken) and taken[-1] > 2 * taken[0]
    with Scene(data, detail=1) as scene:
        assert scene.statistics["scene_bytes"] < 300_000


def test_finite_scenes_are_not_cut_unless_asked():
    data = build(SCENES / "tree.plsys").encode()
    plain, counts = picture(data, 32)
    assert counts["detail"] == 0 and counts["cut"] == {"instances": 0, "max_error": 0}
    same, _ = picture(data, 32, detail=0)
    np.testing.assert_array_equal(plain["color"], same["color"])


def test_the_error_bound_of_what_is_cut_is_reported():
    data = compiled(view((0.5, -9, 0.5), (0.5, 0, 0.5), 12) + SPONGE + f"object {{ Sponge {WHITE} }}")
    _, coarse = picture(data, detail=4)
    _, fine = picture(data, detail=1)
    pixel = 10 * 2 * np.tan(np.radians(6)) / 64  # at the far side of the sponge
    assert 0 < fine["cut"]["max_error"] <= 1.001 * pixel
    assert fine["cut"]["max_error"] < coarse["cut"]["max_error"] <= 4.004 * pixel


@pytest.mark.parametrize("text, middle, extent", [(SPONGE, (0.5, 0.5, 0.5), 1.0), (FERN, (0.9, 0, 4.9), 10.0)])
def test_brightness_stays_when_details_are_cut(text, middle, extent):
    """Zoomed out until a thing is `pixels` high, what is cut is as bright as what isn't. Of the fern a few hundred of 10^5
    rays hit anything: with fewer the reference itself would be off by the tolerance."""
    name = re.search(r"Selection (\w+)", text).group(1)
    for pixels, antialias in ((40, 9), (12, 30)):
        distance = 20 * extent
        angle = 2 * np.degrees(np.arctan(extent * 32 / pixels / distance))
        eye = (middle[0] - 0.3 * distance, middle[1] - 0.9 * distance, middle[2] + 0.25 * distance)
        data = compiled(view(eye, middle, angle) + text + f"object {{ {name} {WHITE} }}")
        reference = brightness(data, 64, antialias, 0.06)
        for detail, within in ((0.5, 0.06), (1, 0.06), (2, 0.06), (4, 0.2)):
            assert brightness(data, 64, antialias, detail) == pytest.approx(reference, rel=within), (pixels, detail)


def test_pictures_converge_as_the_cut_off_goes_to_zero():
    data = compiled(view((0.9, -24, 5), (0.9, 0, 4.9), 30) + FERN + f"object {{ Frond {WHITE} }}")
    reference = picture(data, 96, ("color",), 8, detail=0.05)[0]["color"][..., 0]
    errors = []
    for detail in (8, 4, 2, 1, 0.5):
        ours = picture(data, 96, ("color",), 8, detail=detail)[0]["color"][..., 0]
        errors.append(float(np.sqrt(np.mean((ours - reference) ** 2))))
    assert errors == sorted(errors, reverse=True), errors


def test_boxes_hold_the_limit_set():
    """A small ball stands wherever the maps take the origin (the chaos game): rays at its centre must not miss a box."""
    maps = [
        np.array([[0.85, 0, 0.04, 0], [0, 0.85, 0, 0], [-0.04, 0, 0.85, 1.6]]),
        np.array([[0.20, 0, -0.26, 0], [0, 0.3, 0, 0], [0.23, 0, 0.22, 1.6]]),
        np.array([[-0.15, 0, 0.28, 0], [0, 0.3, 0, 0], [0.26, 0, 0.24, 0.44]]),
    ]
    random = np.random.default_rng(1)
    points = []
    for length in random.integers(0, 25, 300):
        p = np.zeros(3)
        for k in random.choice(3, length, p=(0.6, 0.2, 0.2)):
            p = maps[k][:, :3] @ p + maps[k][:, 3]
        points.append(p)
    text = FERN.replace("T_stalk cone(0.6)", "[ scale 0.01 ] sphere")
    data = compiled(view((0, -24, 5), (0, 0, 5)) + text + f"object {{ Frond {WHITE} }}")
    with Scene(data, detail=0) as scene:
        for direction in ((0, 1, 0), (1, 0, 0), (0, 0, -1), (0.3, -0.7, 0.2)):
            hits = scene.intersect(np.array(points) - 30 * np.array(direction), direction)
            assert (hits.t <= 30).all()


@pytest.mark.parametrize("turn", [45, 33])
def test_spirals_have_boxes_though_boxes_of_boxes_would_grow(turn):
    text = f"Selection A {{ A -> sphere + [ trans 3 0 0; rotz {turn}; scale 0.9 ] A; }} object {{ A {WHITE} }}"
    result, counts = picture(compiled(view((0, -20, 60), (0, 9, 0), 40) + text), 32)
    assert np.isfinite(result["depth"]).any() and not np.isfinite(result["depth"]).all()
    assert counts["scene_bytes"] < 20_000


def test_a_shear_that_shrinks_in_the_end_is_legal():
    text = f"Selection A {{ A -> sphere + [ trans 1 0 0; shear 3 0 0 0 0 0; scale 0.6 ] A; }} object {{ A {WHITE} }}"
    result, _ = picture(compiled(view((0, -20, 60), (0, 0, 0), 8) + text), 16)
    assert np.isfinite(result["depth"]).any()


def test_what_does_not_contract_by_parameters_is_an_error_of_the_runtime():
    text = "Parameter s = 1.0 [0 to 2] \"step\"; Selection A { C_a A; A -> box + T A; } Calculation C_a { k = s; }"
    text += " Transformation T { trans 0 0 1; scale k; } object { A }"
    data = compiled(view((0, -20, 6), (0, 0, 0)) + text)
    for accelerator in ("boxes", "bvh"):
        with pytest.raises(PlsysRuntimeError, match="endless recursion: A.* contains itself"):
            Scene(data, accelerator=accelerator)


def test_no_detail_ends_where_rounding_does():
    data = compiled(view((0.5, -3, 0.5), (0.5, 0, 0.5)) + SPONGE + f"object {{ Sponge {WHITE} }}")
    rays = np.random.default_rng(2).uniform(-0.4, 0.4, (50, 3)) * [1, 0, 1] + [0, 1, 0]
    results = []
    for accelerator in ("none", "bvh"):
        with Scene(data, accelerator=accelerator, detail=0) as scene:
            results.append(scene.intersect((0.5, -3, 0.5), rays))
    for name, ours, theirs in zip(results[0]._fields, *results):
        np.testing.assert_array_equal(ours, theirs, err_msg=name)
    hit = np.isfinite(results[0].t)
    assert hit.any() and results[0].bound[hit].max() < 1e-9


def test_what_was_on_the_stack_before_changes_no_hit(tmp_path):
    path = tmp_path / "sponge.plsb"
    path.write_bytes(compiled(view((0.5, -3, 0.5), (0.5, 0, 0.5)) + SPONGE + f"object {{ Sponge {WHITE} }}"))
    done = whole.run(whole.program("accel/stale.c", "plain"), path)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_texture_is_that_of_the_first_primitive():
    text = "Selection A { A -> Ruby sphere + Sea [ trans 3 0 0 ] box + [ trans 1 0 0; scale 0.5 ] A; } object { A }"
    for name, color in (("Ruby", "<1, 0, 0>"), ("Sea", "<0, 0, 1>")):
        text += f"Texture {name} {{ pigment {{ color rgb {color} }} finish {{ ambient 0 diffuse 0 emission 1 }} }}"
    data = compiled(view((0, -4000, 0), (0, 0, 0), 0.5) + text)
    result, counts = picture(data, 24, detail=60)
    assert counts["cut"]["instances"] > 0
    assert result["color"][..., 0].max() == 1 and result["color"][..., 2].max() == 0


@pytest.mark.parametrize("levels", [0, 30])
def test_deep_zoom_draws_what_the_magnified_scene_shows(levels):
    """The sponge is its own magnification by 3^19: from 1e-9 of its size it looks like the large one from nearby."""
    if levels:
        sponge = SPONGE.replace("Sponge  -> [ scale 1/3 ] (", "if (n > 0) Sponge -> [ --n ] [ scale 1/3 ] (")
        sponge = sponge.replace("Plate); }", "Plate); else Sponge -> box; }", 1)
        sponge = sponge.replace("{ if", "{ C_n Sponge; if", 1) + "Calculation C_n { n = %d; }"
    else:
        sponge = SPONGE
    zoom = 3.0**19
    eye, at = np.array([-0.9, -1.4, 0.8]), np.array([0.3, 0.35, 0.4])
    near = view(tuple(eye / zoom), tuple(at / zoom), 50) + (sponge % 30 if levels else sponge)
    far = view(tuple(eye), tuple(at), 50) + (sponge % 30 if levels else sponge)
    detail = 1
    small, counts = picture(compiled(near + f"object {{ Sponge {WHITE} }}"), 64, detail=detail)
    large, other = picture(compiled(far + f"object {{ Sponge scale {zoom!r} {WHITE} }}"), 64, detail=detail)
    assert counts["scene_bytes"] == pytest.approx(other["scene_bytes"], rel=0.05) and counts["scene_bytes"] < 300_000
    ours, theirs = small["depth"] * zoom, large["depth"]
    agree = np.isclose(ours, theirs, rtol=1e-3) | (np.isinf(ours) & np.isinf(theirs))
    assert np.isfinite(theirs).mean() > 0.3
    assert agree.mean() > 0.9, agree.mean()
