"""Re-tracing: what is clear is decided, what rounding may turn is said to be ambiguous."""

from __future__ import annotations

import numpy as np
import pytest
from plsys.compiler.export.intersect import LONG, ROOTS
from plsys.compiler.export.retrace import Retracer
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source

LIGHT = "light_source { <0, -50, 0> color rgb 1 }\n#declare Dull = texture { pigment { color rgb 0.5 } }\n"
TILES = "#declare Tiles = texture { pigment { checker color rgb 1, color rgb 0 } }\n"


def verdict_of(scene: str, target: tuple[float, float, float], step: float = 1e-8):
    """The verdict on a ray from (0, -10, 0), and on eight neighbours."""
    angle = 2 * np.pi * np.arange(8) / 8
    directions = np.array(target) - (0, -10.0, 0) + np.zeros((9, 3))
    directions[1:, 0] += step * np.cos(angle)
    directions[1:, 2] += step * np.sin(angle)
    return Retracer(build(Source.from_text(scene)).graph).decide(np.array([0, -10.0, 0]), directions)


def test_a_clear_hit_and_its_shadow_ray_are_decided():
    verdict = verdict_of(LIGHT + "sphere { <0, 0, 0>, 1 texture { Dull } }", (0.1, 0, 0.1))
    assert not verdict.is_ambiguous
    assert [(ray.primitive, ray.is_shadow) for ray in verdict.rays] == [(0, False), (-1, True)]


def test_a_clear_miss_is_decided():
    verdict = verdict_of(LIGHT + "sphere { <0, 0, 0>, 1 texture { Dull } }", (2, 0, 0))
    assert [ray.primitive for ray in verdict.rays] == [-1] and not verdict.is_ambiguous


def test_an_occluder_is_found():
    scene = LIGHT + "sphere { <0, 0, 0>, 1 texture { Dull } }\nsphere { <0, -30, 0>, 3 texture { Dull } }"
    assert verdict_of(scene, (0.1, 0, 0.1)).rays[1].primitive >= 0
    assert (
        verdict_of(scene.replace("3 texture", "3 no_shadow texture"), (0.1, 0, 0.1)).rays[1].primitive == -1
    )


@pytest.mark.parametrize(
    "scene, target, why",
    [
        ("sphere { <0, 0, 0>, 1 texture { Dull } }", (10 / np.sqrt(99), 0, 0), "something else"),
        ("box { <-1, 0, -1>, <0, 1, 1> texture { Dull } }\nbox { <-1, 0, -1>, <1, 2, 1> texture { Tiles } }", (-0.5, 0, 0), "coincide"),
        ("box { <-1, 0, -1>, <1, 2, 1> texture { Tiles } }", (0, 0, 0.5), "pattern"),
        ("box { <-1, 0, -1>, <1, 2, 1> texture { Dull } }\nbox { <0, -20, -1>, <1, -15, 1> texture { Dull } }", (0, 0, 0.5), "shadow"),
    ],
)  # fmt: skip
def test_what_rounding_may_turn_is_ambiguous(scene, target, why):
    assert why in verdict_of(LIGHT + TILES + scene, target).why


def test_reflections_are_followed_as_deep_as_the_scene_allows():
    mirror = "texture { pigment { color rgb 0 } finish { reflection 1 } }"
    scene = f"global_settings {{ max_trace_level 4 }}\nplane {{ <0, 1, 0>, 0 {mirror} }}\nplane {{ <0, 1, 0>, -20 {mirror} }}"
    assert len(verdict_of(scene, (0.5, 0, 0.3)).rays) == 4


def test_transparent_things_are_looked_through():
    scene = "sphere { <0, 0, 0>, 1 texture { pigment { color rgbt <1, 1, 1, 0.5> } } }\nplane { <0, 1, 0>, 5 texture { pigment { color rgb 1 } } }"
    assert [ray.primitive for ray in verdict_of(scene, (0.1, 0, 0.1)).rays] == [0, 0, 1]


@pytest.mark.parametrize(
    "kind, argument", [("sphere", 0), ("cylinder", 0), ("cone", 0.5), ("cone", 0), ("box", 0), ("torus", 0.3)]
)
def test_roots_lie_on_the_surface(kind, argument):
    random = np.random.default_rng(3)
    o, d = random.normal(size=(2, 200, 3)).astype(LONG)
    with np.errstate(all="ignore"):
        roots = np.array(ROOTS[kind](o, d, LONG(argument)))
    rays = np.argwhere(np.isfinite(roots))
    assert len(rays) > 20
    p = np.array([o[i] + roots[k, i] * d[i] for k, i in rays], float)
    r = np.hypot(p[:, 0], p[:, 1])
    z = p[:, 2]
    caps = np.minimum(np.abs(z), np.abs(z - 1))
    top = {"cylinder": 1.0}.get(kind, argument)
    off = {
        "sphere": np.abs(np.linalg.norm(p, axis=1) - 1),
        "box": np.minimum(np.abs(p), np.abs(p - 1)).min(axis=1),
        "torus": np.abs(np.hypot(r - 1, z) - argument),
    }.get(kind, np.minimum(caps, np.abs(r - (1 + (top - 1) * z))))
    assert off.max() < 1e-12


def test_reflections_of_smooth_meshes_use_the_interpolated_normal(tmp_path):
    """A flat triangle whose normals all lean to the right throws a straight ray to the left of the mirror's own way."""
    (tmp_path / "leaning.obj").write_text(
        "v -2 0 -2\nv 2 0 -2\nv 0 0 3\nvn 0.6 -0.8 0\nvn 0.6 -0.8 0\nvn 0.6 -0.8 0\nf 1//1 2//2 3//3\n"
    )
    (tmp_path / "scene.plsys").write_text(
        "object { S texture { pigment { color rgb 0 } finish { reflection 1 } } }\n"
        'Selection S { S -> mesh("leaning.obj"); }'
    )
    retracer = Retracer(build(tmp_path / "scene.plsys").graph)
    verdict = retracer.decide(np.array([0, -10.0, 0]), np.array([[0, 1.0, 0]]))
    np.testing.assert_allclose(verdict.rays[1].direction.astype(float), [0.96, -0.28, 0], atol=1e-12)
