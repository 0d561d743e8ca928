"""The formulas of runtime/SHADING.md against POV-Ray: every case is one scene, drawn by both.

The largest difference allowed is 1e-5; what remains is the 16-bit file's own step of 7.6e-6.
"""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from .antialias import adaptive, uniform
from .model import Light, Scene, povray
from .shapes import Box, Cone, Cylinder, Disc, Mesh, Plane, Sphere, Torus, Triangle
from .textures import Checker, Finish, Gradient, Object, Plain

pytestmark = [
    pytest.mark.povray,
    pytest.mark.skipif(not shutil.which("povray"), reason="povray is not installed: nothing to compare with"),
]

WIDTH, HEIGHT = 160, 120
SKY = (0.2, 0.3, 0.5)
SUN = Light((4, -6, 9), (0.9, 0.8, 0.7))
FLOOR = Object(Plane((0, 0, 1), 0.0), Plain((0.8, 0.7, 0.6)))
TILES = Object(Plane((0, 0, 1), 0.0), Checker((0.8, 0.7, 0.6), (0.2, 0.3, 0.4)))
GLOSS = Finish(phong=0.5, phong_size=20.0)
GLASS = Plain((0.9, 0.5, 0.3, 0.4, 0.2))
MIRROR = Finish(reflection=(0.2, 0.3, 0.4), specular=0.4)


def ball(pigment, finish=None, x=0.0, **options):
    return Object(Sphere((x, 0, 1.2), 1.0), pigment, finish or Finish(), **options)


def shells(colour):
    return [Object(Sphere((0, 0, 1.7), r), Plain(colour)) for r in (1.6, 1.3, 1.0, 0.7, 0.4)]


def cards(*colours):
    shapes = (
        Box((-2, -2, 1.5), (1, 2, 1.7)),
        Disc((0, 0, 2.5), (0, 0, 1), 1.2),
        Box((-1, -2, 3.5), (2, 2, 3.7)),
    )
    return [Object(shape, Plain(c)) for shape, c in zip(shapes, colours)]


def lit(*lights):
    body = ball(Plain((0.5, 0.6, 0.8)), Finish(phong=0.4, phong_size=80.0, specular=0.3, brilliance=2.5))
    return Scene([FLOOR, body], lights, background=SKY)


def spot(x=3, **options):
    return Light((x, -2, 4), (0.5, 0.5, 0.4), "spotlight", point_at=(0, 0, 1), **options)


def world(*objects, **options):
    return Scene([TILES, *objects], [SUN], background=SKY, **options)


CASES = {
    "finish": world(
        ball(Plain((0.9, 0.5, 0.3, 0.2, 0.1)), Finish((0.3, 0.1, 0.2), (0.1, 0.2, 0.05), 0.5, 0.7), x=-1.2),
        ball(Plain((0.9, 0.5, 0.3)), Finish(specular=0.4, roughness=0.01, phong=0.3, phong_size=90.0), x=1.2),
        ambient_light=(0.5, 0.8, 1.2),
    ),
    "no pigment": world(ball(None, GLOSS)),
    "filter and transmit": world(
        ball(Plain((0.9, 0.5, 0.3, 0.6, 0)), MIRROR, x=-2.2),
        ball(Plain((0.9, 0.5, 0.3, 0, 0.6)), GLOSS),
        ball(Plain((0.2, 0.9, 0.4, 1.2, 0.1)), x=2.2),
    ),
    "surfaces behind each other": world(*shells((0.9, 0.8, 0.7, 0.5, 0.3))),
    "transmitted rays and max_trace_level": world(*shells((0.9, 0.8, 0.7, 0.5, 0.3)), max_trace_level=2),
    "last level transmits nothing": world(*shells((0.9, 0.8, 0.7, 0.5, 0.3)), max_trace_level=1),
    "adc_bailout of transmitted rays": world(*shells((0, 0, 0.9, 0.4, 0)), adc_bailout=0.045),
    "adc_bailout of products": world(*shells((0.9, 0.8, 0.7, 0.2, 0.05)), adc_bailout=0.05),
    "reflection and transmission": world(
        ball(Plain((0.9, 0.6, 0.5, 0.3, 0.2)), MIRROR, x=-1.2), ball(GLASS, MIRROR, x=1.2), max_trace_level=3
    ),
    "filtered shadows": world(
        *cards((0.9, 0.2, 0.2, 0.8, 0), (0.2, 0.9, 0.2, 0.5, 0.3), (0.2, 0.2, 0.9, 0, 0.7)),
        location=(0, -14, 6),
    ),
    "shadow of a pattern": world(
        Object(Box((-2, -2, 2), (2, 2, 2.3)), Checker((0.9, 0.2, 0.3), (0.9, 0.9, 0.2, 0.5, 0.4))),
        Object(
            Box((-1, -2, 3), (2, 2, 3.3)),
            Gradient(
                (1, 2, 0.5),
                [(0, (0.9, 0.2, 0.3, 0, 0.1)), (0.3, (0.2, 0.9, 0.3, 0.9, 0.05)), (1, (0.4, 0.5, 1))],
            ),
        ),
        location=(0, -14, 6),
    ),
    "no_shadow": world(
        ball(Plain((0.5, 0.3, 0.9)), x=-1.2, no_shadow=True), ball(GLASS, x=1.2, no_shadow=True)
    ),
    "thin slab": world(
        *(
            Object(Box((x, -1, 1.5), (x + 1, 1, 1.5 + h)), GLASS, MIRROR)
            for x, h in ((-2, 2e-5), (0, 5e-4), (2, 2e-3))
        )
    ),
    "contact shadow": world(
        *(Object(Disc((x, -1, h), (0, 0, 1), 0.6), GLASS) for x, h in ((-1, 5e-4), (1, 2e-3)))
    ),
    "spotlight": lit(spot(-2), spot(1, radius=10.0, falloff=20.0, tightness=10.0)),
    "spotlight, odd cones": lit(
        spot(-2, radius=25.0, falloff=15.0), spot(1, radius=95.0, falloff=99.0, tightness=3.0)
    ),
    "fade": lit(
        Light((3, -2, 4), (0.5, 0.5, 0.4), fade_distance=3.0, fade_power=1.0),
        Light((-3, -2, 4), (0.3, 0.5, 0.4), fade_distance=1.0, fade_power=3.0),
        spot(0, fade_distance=4.0, fade_power=2.0),
    ),
    "parallel": lit(
        Light((0.7, -0.2, 1.2), (0.3, 0.4, 0.2), "parallel", point_at=(0, 0, 0)),
        Light(
            (-3, -2, 9), (0.5, 0.4, 0.4), "parallel", point_at=(0, 0, 0), fade_distance=8.0, fade_power=2.0
        ),
        Light((1, -1, 1.5), (0.2, 0.1, 0.3), "spotlight parallel", point_at=(0, 0, 0)),
    ),
    "shadowless": lit(
        Light((3, -2, 4), (0.3, 0.4, 0.2), "shadowless", fade_distance=4.0, fade_power=2.0),
        Light((-3, -2, 4), (0.5, 0.4, 0.4), "parallel shadowless", point_at=(0, 0, 0)),
    ),
    "checker": world(
        Object(Box((-2, -1, 0), (-1, 0, 1)), Checker(given=0)),
        Object(
            Box((0, -1, 0), (1, 0, 1)),
            Checker(
                (0.9, 0.1, 0.3), modifiers=[("scale", (0.3, 0.4, 0.5)), ("rotate", (10, 20, 30))], given=1
            ),
            modifiers=[("rotate", (0, 0, 25)), ("scale", (1, 2, 1.5)), ("translate", (0, 0, 0.3))],
        ),
        Object(Box((2, -1, 0), (3, 0, 1)), Checker(), modifiers=[("rotate", (0, 0, 25))], texture_last=True),
    ),
    "gradient": Scene(
        [
            Object(Plane((0, 0, 1), 0.0), Gradient((1, 0.7, 0))),
            Object(Plane((0, -1, 0), -3.0), Gradient((1, 0, 2), [(-0.5, (1, 0, 0)), (1.5, (0, 0, 1))])),
            Object(
                Sphere((0, 0, 1), 1),
                Gradient(
                    (0, 0, 1),
                    [(0.2, (1, 0, 0)), (0.5, (0, 1, 0)), (0.5, (0, 0, 1, 0.3, 0.2)), (0.8, (1, 1, 0))],
                    [("scale", (1, 1, 0.6))],
                ),
            ),
        ],
        [SUN],
    ),
    "gradient far on the negative side": world(
        ball(Gradient((1, 2, 0), modifiers=[("translate", (2000, 0, 0))]), Finish(ambient=(0.5, 0.5, 0.5)))
    ),
    "cylinders, cones, discs": world(
        Object(Cylinder((-2.5, 0, 0.2), (-1.8, 0.3, 1.6), 0.6), GLASS, MIRROR),
        Object(Cylinder((-1, -1, 0.3), (-0.6, -2, 0.6), 0.3, is_open=True), Plain((0.9, 0.4, 0.3)), GLOSS),
        Object(Cone((0.5, 0, 0.1), 0.9, (0.8, 0.3, 1.6), 0.0), GLASS, GLOSS),
        Object(Cone((2, -0.7, 0.6), 0.2, (2.1, 0.8, 1.3), 0.7, is_open=True), Plain((0.2, 0.4, 0.9)), MIRROR),
        Object(Disc((0, 0, 2.2), (0, -1, 0.5), 0.6, 0.2), GLASS, GLOSS),
    ),
    "torus": world(
        Object(
            Torus(1.0, 0.35),
            GLASS,
            MIRROR,
            modifiers=[("rotate", (70, 20, 10)), ("scale", (1, 0.7, 1.3)), ("translate", (0, 0, 1.4))],
        )
    ),
    "ellipsoid and mirrored box": world(
        Object(
            Sphere((-1, 0, 0.5), 0.6),
            GLASS,
            GLOSS,
            modifiers=[("scale", (1, 2, 1.5)), ("rotate", (30, 40, 50))],
        ),
        Object(
            Box((0, 0, 0.2), (0.5, 0.7, 1)),
            Plain((0.3, 0.4, 0.9)),
            MIRROR,
            modifiers=[("scale", (-1, 2, 1.5)), ("rotate", (30, 40, 50)), ("translate", (1.5, 0, 0.5))],
        ),
    ),
    "smooth triangles": world(
        Object(
            Triangle(
                [(-3, 0, 0.2), (-1, 0.2, 0.3), (-2, 0.3, 2)], [(0, -1, 0.2), (1, -2, 0.2), (-0.8, -1.6, 1)]
            ),
            Plain((0.9, 0.8, 0.7)),
            GLOSS,
        ),
        Object(
            Mesh(
                [
                    Triangle(
                        [(0, 0, 0.2), (1, 0.2, 0.3), (0.4, 0.3, 2)], [(1, 0, -0.2), (-1, 0, 0.1), (0, 0.3, 1)]
                    )
                ],
                True,
            ),
            Plain((0.9, 0.8, 0.7)),
            MIRROR,
        ),
        Object(
            Mesh(
                [
                    Triangle(
                        [(0, 0, 0.2), (1, 0.2, 0.3), (0.4, 0.3, 2)],
                        [(0, 1, 0.2), (1, 2, 0.2), (-0.8, 1.6, 1)],
                    )
                ]
            ),
            Plain((0.9, 0.8, 0.7)),
            GLOSS,
            modifiers=[("rotate", (0, 0, 30)), ("scale", (1, 1, 1.2)), ("translate", (2, 0, 0))],
        ),
    ),
    "camera inside": world(Object(Sphere((0, -8, 4), 1.0), GLASS, GLOSS), ball(Plain((0.3, 0.6, 0.9)))),
}


def largest_difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    return float(np.abs(np.clip(ours, 0, 1) - theirs).max())


@pytest.mark.parametrize("name", CASES)
def test_model_equals_povray(name):
    scene = CASES[name]
    assert largest_difference(scene.render(WIDTH, HEIGHT), povray(scene, WIDTH, HEIGHT)) <= 1e-5


def test_union_carries_texture_pattern_and_no_shadow():
    lift = [("translate", (0.3, 0.2, 0.1))]
    squares, blue = Checker((0.9, 0.2, 0.3), (0.2, 0.9, 0.5)), Plain((0.2, 0.4, 0.9))
    parts = (
        (Sphere((0, 0, 1), 1), squares),
        (Box((1, 0, 0), (2, 1, 1)), squares),
        (Sphere((-2, 0, 1), 0.5), blue),
    )
    apart = world(*(Object(shape, pigment, modifiers=lift, no_shadow=True) for shape, pigment in parts))
    text = world().pov() + (
        "union { sphere { <0, 0, 1>, 1 } box { <1, 0, 0>, <2, 1, 1> } "
        "sphere { <-2, 0, 1>, 0.5 pigment { rgb <0.2, 0.4, 0.9> } } "
        "pigment { checker rgb <0.9, 0.2, 0.3>, rgb <0.2, 0.9, 0.5> } translate <0.3, 0.2, 0.1> no_shadow }"
    )
    assert largest_difference(apart.render(WIDTH, HEIGHT), povray(text, WIDTH, HEIGHT)) <= 1e-5


def test_scene_without_version_directive_has_another_opacity():
    scene = CASES["filter and transmit"]
    theirs = povray(scene.pov(version=False), WIDTH, HEIGHT)
    assert largest_difference(scene.render(WIDTH, HEIGHT), theirs) > 0.01


@pytest.mark.parametrize("threshold, depth, gamma", [(0.1, 3, 2.5), (0.3, 4, 1.0), (0.0, 2, 2.5)])
def test_adaptive_antialiasing(threshold, depth, gamma):
    scene = world(ball(Plain((0.9, 0.2, 0.3)), MIRROR))
    options = f"+A{threshold}", "+AM2", f"+R{depth}", "-J", f"Antialias_Gamma={gamma}"
    ours = adaptive(scene, WIDTH, HEIGHT, depth, threshold, gamma)
    assert largest_difference(ours, povray(scene, WIDTH, HEIGHT, *options)) <= 1e-5


@pytest.mark.parametrize("threshold, count, gamma", [(0.0, 3, 2.5), (0.3, 3, 2.5), (0.1, 2, 1.0)])
def test_uniform_antialiasing(threshold, count, gamma):
    scene = world(ball(Plain((0.9, 0.2, 0.3)), MIRROR))
    options = f"+A{threshold}", "+AM1", f"+R{count}", "-J", f"Antialias_Gamma={gamma}"
    ours = uniform(scene, WIDTH, HEIGHT, count, threshold, gamma)
    assert largest_difference(ours, povray(scene, WIDTH, HEIGHT, *options)) <= 1e-5


SAME = {
    "reflection of a number": ("reflection rgb <0.2, 0.3, 0.4>", "reflection { rgb <0.2, 0.3, 0.4> }"),
    "cone of a spotlight": ("radius 30.0 falloff 45.0 tightness 0.0", ""),
    "trace limits": ("max_trace_level 5 adc_bailout 0.00392156862745098", ""),
    "moved light": (
        "<3.0, -2.0, 4.0>, rgb <0.5, 0.5, 0.4>",
        "<2, 0, 3>, rgb <0.5, 0.5, 0.4> translate <1, -2, 1>",
    ),
    "background behind itself": ("rgb <0.2, 0.3, 0.5>", "rgbft <0.4, 0.6, 1, 0.3, 0.5>"),
}


@pytest.mark.parametrize("what", SAME)
def test_two_spellings_of_the_same(what):
    light = spot()
    if what == "moved light":
        light = Light(light.location, light.colour, fade_distance=4.0, fade_power=2.0)
    body = Object(Torus(1.0, 0.35), GLASS, MIRROR, modifiers=[("translate", (0, 0, 1))])
    scene = Scene([TILES, body], [light], background=SKY)
    text, (long, short) = scene.pov(), SAME[what]
    assert long in text
    theirs = povray(text.replace(long, short, 1), WIDTH, HEIGHT)
    assert largest_difference(scene.render(WIDTH, HEIGHT), theirs) <= 1e-5


def test_texture_follows_only_the_modifiers_after_it():
    moved = [("rotate", (0, 0, 30)), ("translate", (-0.5, 0, 0.2))]
    shifted = Checker(modifiers=[("scale", (0.3, 0.3, 0.3)), ("translate", (-0.5, 0, 0.2))])
    scene = world(Object(Box((0, 0, 0), (1, 1, 1)), shifted, modifiers=moved, texture_last=True))
    text = world().pov() + (
        "box { <0, 0, 0>, <1, 1, 1> rotate <0, 0, 30> "
        "pigment { checker rgb <0, 0, 1>, rgb <0, 1, 0> scale 0.3 } translate <-0.5, 0, 0.2> }"
    )
    assert largest_difference(scene.render(WIDTH, HEIGHT), povray(text, WIDTH, HEIGHT)) <= 1e-5


def test_smooth_triangle_beyond_a_right_angle_is_dropped_but_a_mesh_keeps_it():
    corners = [(-1, 0, 0.2), (1, 0.2, 0.3), (0.1, 0.3, 2)]
    triangle = Triangle(corners, [(1, 0, -0.2), (-1, 0, 0.1), (0, 0.3, 1)])
    alone = povray(world(Object(triangle, GLASS, GLOSS)), WIDTH, HEIGHT)
    assert largest_difference(world().render(WIDTH, HEIGHT), alone) <= 1e-5
    meshed = world(Object(Mesh([triangle]), GLASS, GLOSS))
    assert largest_difference(meshed.render(WIDTH, HEIGHT), povray(meshed, WIDTH, HEIGHT)) <= 1e-5
