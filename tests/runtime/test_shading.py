"""What the runtime draws is what the reference model computes: every formula of runtime/SHADING.md.

The model itself is compared with POV-Ray in tests/povray. Both compute in double, and the picture is stored in single
precision: that is the difference allowed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import povray.model
import pytest
from plsys.compiler import compile
from plsys.runtime import Scene
from povray.antialias import adaptive, uniform
from povray.model import Light
from povray.shapes import Box, Disc, Plane, Sphere
from povray.test_shading import CASES, GLASS, MIRROR, SKY, SUN, ball, world
from povray.textures import Checker, Finish, Gradient, Object, Plain
from shading_scenes import opened, picture, spelled, text

WIDTH, HEIGHT = 80, 60


def largest_difference(ours, theirs) -> float:
    return float(np.abs(ours - theirs).max())


# The language has no keys outside 0 to 1.
CASES = {
    **{name: spelled(scene) for name, scene in CASES.items() if name != "gradient"},
    "gradient": replace(
        CASES["gradient"], objects=[o for i, o in enumerate(CASES["gradient"].objects) if i != 1]
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_picture_equals_model(name):
    scene = CASES[name]
    # Meshes keep their corners in single precision in the model, as in POV-Ray.
    tolerance = 2e-6 if name == "smooth triangles" else 2e-7
    assert largest_difference(picture(scene, WIDTH, HEIGHT), scene.render(WIDTH, HEIGHT)) <= tolerance


def test_first_of_two_equal_keys_has_the_edge():
    """Keys are float32: 0.7 is a little less there, so a plane at exactly 0.7 lies behind the edge, one at 0.3 before."""
    keys = [
        (0, (1, 0, 0)),
        (0.3, (1, 0, 0)),
        (0.3, (0, 1, 0)),
        (0.7, (0, 1, 0)),
        (0.7, (0, 0, 1)),
        (1, (0, 0, 1)),
    ]
    for height, colour in ((0.3, (1, 0, 0)), (0.7, (0, 0, 1))):
        body = Object(
            Disc((0, 0, height), (0, 0, 1), 4), Gradient((0, 0, 1), keys), Finish((1, 1, 1), diffuse=0.0)
        )
        scene = replace(world(), objects=[body], lights=[], location=(0, 0, 9), look_at=(0, 1, 0), angle=20)
        assert largest_difference(picture(scene, 8, 6), np.broadcast_to(colour, (6, 8, 3))) == 0


@pytest.mark.parametrize("count", [1, 2, 3])
def test_grid_antialiasing_equals_model(count):
    scene = world(ball(Plain((0.9, 0.2, 0.3)), MIRROR))
    ours = picture(scene, WIDTH, HEIGHT, antialias="grid", samples=count)
    assert largest_difference(ours, uniform(scene, WIDTH, HEIGHT, count, 0.0)) <= 2e-7


@pytest.mark.parametrize("depth, threshold", [(1, 0.1), (3, 0.1), (2, 0.0), (4, 0.3), (3, 100.0)])
def test_adaptive_antialiasing_equals_model(depth, threshold):
    scene = world(ball(Plain((0.9, 0.2, 0.3)), MIRROR))
    ours = picture(scene, WIDTH, HEIGHT, antialias="adaptive", samples=depth, threshold=threshold)
    assert largest_difference(ours, adaptive(scene, WIDTH, HEIGHT, depth, threshold)) <= 2e-7


@pytest.mark.parametrize("name", CASES)
def test_own_tolerances_are_none(name, monkeypatch):
    """Without POV-Ray's tolerances the picture is what the model gives when it has next to none."""
    monkeypatch.setattr(povray.model, "SMALLEST_HIT", 1e-10)
    monkeypatch.setattr(povray.model, "SHADOW_TOLERANCE", 1e-10)
    with opened(CASES[name], WIDTH, HEIGHT) as scene:
        ours = scene.render(WIDTH, HEIGHT)["color"]
    tolerance = 2e-6 if name == "smooth triangles" else 2e-7
    assert largest_difference(ours, CASES[name].render(WIDTH, HEIGHT)) <= tolerance


def scaled(model, factor: float):
    """The same view of the same things, all of them `factor` times as large."""

    def point(v):
        return tuple(factor * x for x in v)

    def larger(light):
        return replace(
            light,
            location=point(light.location),
            point_at=point(light.point_at),
            fade_distance=factor * light.fade_distance,
        )

    return replace(
        model,
        objects=[replace(o, modifiers=[*o.modifiers, ("scale", (factor,) * 3)]) for o in model.objects],
        lights=[larger(light) for light in model.lights],
        location=point(model.location),
        look_at=point(model.look_at),
    )


@pytest.mark.parametrize("factor", [2.0**-30, 1e-6, 1e6])
def test_no_size_is_special(factor):
    glass, mirror = ball(GLASS, MIRROR, x=-1.2), ball(Plain((0.3, 0.6, 0.9)), MIRROR, x=1.2)
    slab = Object(Box((-2, -2, 0.4), (2, -1.9, 0.6)), GLASS)
    fading = Light(
        (3, -2, 4), (0.3, 0.3, 0.2), "spotlight", point_at=(0, 0, 1), fade_distance=4.0, fade_power=2.0
    )
    model = world(glass, mirror, slab)
    model = replace(model, lights=[SUN, fading])
    with opened(model, WIDTH, HEIGHT) as scene:
        expected = scene.render(WIDTH, HEIGHT)["color"]
    with opened(scaled(model, factor), WIDTH, HEIGHT) as scene:
        ours = scene.render(WIDTH, HEIGHT)["color"]
    different = np.abs(ours - expected).max(axis=2) > 2e-7
    # A factor that isn't a power of two moves edges of checkers and spheres by rounding errors.
    assert different.sum() <= (0 if np.log2(factor) % 1 == 0 else 2)


def test_no_acne_on_surfaces_far_from_the_origin():
    """A lit plane is smooth: no point of it is in its own shadow, however flat the light comes in."""
    offset = (1234.5, -987.6, 345.7)
    for sun in ((0, 400, 0.2), (30, -20, 400), (3, 2, 0.05)):
        plane = Object(Plane((0, 0, 1), 0), Plain((1, 1, 1)), Finish((0, 0, 0)), [("translate", offset)])
        lamp = Light(tuple(np.add(sun, offset)))
        model = replace(
            world(),
            objects=[plane],
            lights=[lamp],
            location=tuple(np.add((0, -6, 3), offset)),
            look_at=tuple(np.add((0, 0, -1), offset)),
        )
        assert largest_difference(picture(model, 40, 30), model.render(40, 30)) <= 2e-6
        with opened(model, 40, 30) as scene:
            assert largest_difference(scene.render(40, 30)["color"], model.render(40, 30)) <= 2e-6


def test_opaque_scene_is_the_same_with_and_without_something_clear_in_it():
    """Two ways to test shadows: any occluder ends the light, or all of them filter it in order."""
    things = [ball(Plain((0.5, 0.6, 0.8)), MIRROR), Object(Box((1, -2, 0), (2, -1, 2)), Checker())]
    behind_the_camera = Object(Sphere((0, -40, 5), 0.1), GLASS)
    opaque = picture(world(*things), WIDTH, HEIGHT)
    assert np.array_equal(opaque, picture(world(*things, behind_the_camera), WIDTH, HEIGHT))


def test_thin_glass_filters_a_shadow_once_for_povray_and_twice_for_us():
    slab = Object(Box((-2, -2, 1.5), (2, 2, 1.5005)), GLASS)
    scene = replace(world(slab), background=SKY)
    theirs = picture(scene, WIDTH, HEIGHT)
    assert largest_difference(theirs, scene.render(WIDTH, HEIGHT)) <= 2e-7
    with opened(scene, WIDTH, HEIGHT) as ours:
        difference = np.abs(ours.render(WIDTH, HEIGHT)["color"] - theirs).max(axis=2)
    assert (difference > 0.01).sum() > 100


@pytest.mark.parametrize(
    "words, kind", [("spotlight shadowless", "shadowless"), ("shadowless spotlight", "spotlight")]
)
def test_last_of_spotlight_and_shadowless_counts(words, kind):
    lamp = Light((3, -2, 4), (0.5, 0.5, 0.4), kind, radius=10.0, falloff=15.0)
    model = replace(world(ball(Plain((0.5, 0.6, 0.8)))), lights=[lamp])
    line = next(line for line in text(model, 4 / 3).split("\n") if line.startswith("light_source"))
    both = text(model, 4 / 3).replace(line, line.replace(kind, words, 1))
    if kind == "shadowless":
        both = both.replace("shadowless", "radius 10 falloff 15 point_at <0, 0, 1> shadowless", 1)
    assert both.count("shadowless") == both.count("spotlight") == 1
    with Scene(compile(both), povray_epsilon=True) as scene:
        ours = scene.render(WIDTH, HEIGHT)["color"]
    assert np.array_equal(ours, picture(model, WIDTH, HEIGHT))
