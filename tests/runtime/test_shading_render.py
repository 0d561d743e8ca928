"""Pictures as a whole: the same bits whoever draws them, the channels beside colour, limits, errors, cancelling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plsys.compiler import compile
from plsys.runtime import PlsysRuntimeError, Scene
from povray.shapes import Box, Plane
from povray.test_shading import CASES, GLASS, MIRROR, ball, world
from povray.textures import Finish, Object, Plain
from shading_scenes import opened, text

WIDTH, HEIGHT = 70, 50
CHANNELS = ("color", "depth", "normal", "position", "primitive", "symbol", "rule", "recursion")
TREE = "scenes/tree.plsys"


def mixed():
    return world(ball(GLASS, MIRROR, x=-1.2), ball(Plain((0.3, 0.6, 0.9)), MIRROR, x=1.2))


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"antialias": "grid", "samples": 2},
        {"antialias": "adaptive", "samples": 3, "threshold": 0.1},
    ],
)
def test_same_bits_for_any_threads_and_accelerator(options):
    tree = compile(TREE, parameters={"order": 4})
    for data in (compile(text(mixed(), WIDTH / HEIGHT)), tree):
        pictures = [
            Scene(data, accelerator=accelerator, threads=threads).render(
                WIDTH, HEIGHT, channels=CHANNELS, **options
            )
            for accelerator, threads in (("bvh", 1), ("bvh", 2), ("bvh", 5), ("boxes", 2), ("none", 1))
        ]
        for other in pictures[1:]:
            for name in CHANNELS:
                assert np.array_equal(pictures[0][name], other[name]), name


def test_pixels_do_not_depend_on_the_size_of_tiles_around_them():
    """Quarters of pixels are the pixels of a picture twice as large."""
    with opened(mixed(), WIDTH, HEIGHT) as scene:
        large = scene.render(2 * WIDTH, 2 * HEIGHT, antialias="adaptive", samples=1)["color"]
        small = scene.render(WIDTH, HEIGHT, antialias="adaptive", samples=2, threshold=0.0)["color"]
    means = large.astype(float).reshape(HEIGHT, 2, WIDTH, 2, 3).mean(axis=(1, 3))
    assert np.abs(means - small).max() <= 2e-7


def test_channels_are_those_of_the_rays_through_pixel_centres():
    model = replace(mixed(), look_at=(0, 0, 2.5))
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    origins, directions = model.rays(x.ravel(), y.ravel(), WIDTH, HEIGHT)
    for options in ({}, {"antialias": "grid", "samples": 2}, {"antialias": "adaptive", "samples": 2}):
        with opened(model, WIDTH, HEIGHT) as scene:
            planes = scene.render(WIDTH, HEIGHT, channels=CHANNELS, **options)
            hits = scene.intersect(origins, directions)
        found = np.isfinite(hits.t)
        assert np.array_equal(np.isfinite(planes["depth"]).ravel(), found) and 0 < found.sum() < found.size
        assert np.allclose(planes["depth"].ravel()[found], hits.t[found], rtol=1e-6)
        for name in ("primitive", "symbol", "rule"):
            assert np.array_equal(planes[name].ravel(), getattr(hits, name)), name
        assert np.array_equal(planes["recursion"].ravel(), hits.depth)
        assert np.allclose(planes["normal"].reshape(-1, 3), hits.normal, atol=1e-6)
        positions = np.where(found[:, None], origins + np.where(found, hits.t, 0)[:, None] * directions, 0)
        assert np.allclose(planes["position"].reshape(-1, 3), positions, rtol=1e-5, atol=1e-5)


def test_box_channels_follow_the_paper():
    with Scene(compile(TREE, parameters={"order": 4}), accelerator="boxes") as scene:
        planes = scene.render(WIDTH, HEIGHT, channels=("boxes", "miss_depth", "recursion"))
    assert planes["boxes"].min() >= 0 and planes["boxes"].max() > 10
    assert planes["miss_depth"].min() == 0 and planes["miss_depth"].max() > 3


def test_statistics_count_rays():
    with opened(mixed(), WIDTH, HEIGHT) as scene:
        scene.render(WIDTH, HEIGHT)
        rays, seconds = scene.statistics["rays"], scene.statistics["seconds"]
    assert rays["primary"] == WIDTH * HEIGHT
    assert rays["shadow"] > 1000 and rays["reflection"] > 100 and rays["transmitted"] > 100
    assert seconds["trace"] > 0
    with opened(replace(mixed(), max_trace_level=1), WIDTH, HEIGHT) as scene:
        scene.render(WIDTH, HEIGHT)
        assert scene.statistics["trace_level"] > 100 and scene.statistics["rays"]["reflection"] == 0
    with opened(replace(mixed(), adc_bailout=0.9), WIDTH, HEIGHT) as scene:
        scene.render(WIDTH, HEIGHT)
        assert scene.statistics["bailout"] > 100 and scene.statistics["rays"]["reflection"] == 0


def facing_mirrors(reflection: float, **options):
    walls = [
        Object(Plane((0, 1, 0), y), Plain((0, 0, 0)), Finish(reflection=(reflection,) * 3))
        for y in (3.0, -20.0)
    ]
    return replace(world(*walls), adc_bailout=0.0, location=(0, 0, 4), look_at=(0, 3, 4), **options)


def test_most_trace_levels_end():
    with opened(facing_mirrors(1.0, max_trace_level=256), 8, 6) as scene:
        scene.render(8, 6)
        assert scene.statistics["rays"]["reflection"] >= 255 and scene.statistics["trace_level"] > 0


def test_endless_reflections_are_a_limit_with_a_name():
    """Bytecode can ask for more levels than the language allows: each sample's rays are limited, and no stack grows."""
    data = raised_level(compile(text(facing_mirrors(1.0, max_trace_level=250), 4 / 3)))
    with (
        Scene(data) as scene,
        pytest.raises(PlsysRuntimeError, match="more than 262144 rays came of one sample"),
    ):
        scene.render(8, 6)


def raised_level(data: bytes) -> bytes:
    """The same bytecode with a max_trace_level of 1e9 for its 250, checksum made right."""
    import struct
    import zlib

    old, new = struct.pack("<d", 250.0), struct.pack("<d", 1e9)
    assert data.count(old) == 1
    data = data.replace(old, new)
    return data[:12] + struct.pack("<I", zlib.crc32(data[28:])) + data[16:]


def test_hundreds_of_panes_one_behind_the_other():
    """Transmitted rays cost no level."""
    panes = [
        Object(Box((-9, y, -9), (9, y + 0.01, 9)), Plain((1, 1, 1, 0, 1))) for y in np.linspace(1, 20, 300)
    ]
    model = replace(world(*panes, max_trace_level=1), location=(0, 0, 4), look_at=(0, 3, 4), angle=5.0)
    with opened(model, 4, 3) as scene:
        black = scene.render(4, 3)["color"]
    with opened(replace(model, max_trace_level=2), 4, 3) as scene:
        clear = scene.render(4, 3)["color"]
        assert scene.statistics["rays"]["transmitted"] == 600 * 12
    bare = replace(model, objects=model.objects[:1])
    with opened(bare, 4, 3) as scene:
        assert np.allclose(clear, scene.render(4, 3)["color"], atol=1e-6)
    assert not black.any()


def test_error_of_the_first_tile_wins_whatever_the_threads():
    """Both balls have no colour; the left one is the first in tile order, though the right one is seen at once, too."""
    source = """
    camera { location <0, -9, 2> sky <0, 0, 1> right <-4/3, 0, 0> look_at <0, 0, 2> angle 50 }
    Texture Left  { pigment { color rgb <sqrt(h), 0, 0> } }
    Texture Right { pigment { color rgb <0, log(h), 0> } }
    object { Pair }
    Selection Pair
    {
        C_first Pair;
        Pair -> [ trans 2 0 2 ] Right sphere + [ trans -2 0 2.1 ] Left sphere;
    }
    Calculation C_first { h = 0 - 1; }
    """
    data = compile(source, name="balls")
    for threads in (1, 2, 4, 7, 2, 2):
        with (
            Scene(data, threads=threads) as scene,
            pytest.raises(PlsysRuntimeError, match="red would become") as error,
        ):
            scene.render(160, 120)
        assert str(error.value).startswith("balls:9:67: Pair, Left:")


def test_cancelling():
    calls = []

    def stop(done: float) -> bool:
        calls.append(done)
        return len(calls) < 3

    with opened(mixed(), WIDTH, HEIGHT, threads=2) as scene:
        with pytest.raises(PlsysRuntimeError, match="stopped"):
            scene.render(640, 480, progress=stop)
        assert len(calls) == 3
        shares = []
        scene.render(WIDTH, HEIGHT, progress=shares.append)
    assert shares == sorted(shares) and shares[-1] == 1.0


@pytest.mark.parametrize(
    "options, words",
    [
        ({"antialias": "grid", "samples": 0}, "not 1 to 256"),
        ({"antialias": "adaptive", "samples": 10}, "not 1 to 9"),
        ({"antialias": "adaptive", "samples": 2, "threshold": -1.0}, "threshold"),
        ({"antialias": "adaptive", "samples": 2, "threshold": float("nan")}, "threshold"),
    ],
)
def test_bad_options_are_refused(options, words):
    with opened(mixed(), WIDTH, HEIGHT) as scene, pytest.raises(PlsysRuntimeError, match=words):
        scene.render(WIDTH, HEIGHT, **options)


def test_a_scene_without_camera_cannot_be_drawn():
    with (
        Scene(compile("sphere { <0, 0, 0>, 1 }")) as scene,
        pytest.raises(PlsysRuntimeError, match="no camera"),
    ):
        scene.render(WIDTH, HEIGHT)


def test_a_picture_has_65536_pixels_a_side_at_most():
    with opened(mixed(), WIDTH, HEIGHT) as scene, pytest.raises(PlsysRuntimeError, match="65536"):
        scene.render(65537, 1)


def test_camera_without_look_at():
    body = "sphere { <0.3, 0.2, 5>, 1 pigment { rgb <1, 0, 0> } finish { ambient 1 } }"
    plain = Scene(compile(f"camera {{ location <0, 0, 0> }} {body}")).render(40, 30)["color"]
    same = Scene(compile(f"camera {{ location <0, 0, 0> look_at <0, 0, 2> }} {body}")).render(40, 30)["color"]
    assert plain.max() == 1.0 and np.array_equal(plain, same)


def test_textures_by_parameter_are_drawn():
    with Scene(compile("scenes/bush.plsys")) as scene:
        color = scene.render(64, 48)["color"]
    assert np.isfinite(color).all() and color.std() > 0.05


def test_cases_are_drawn_alike_by_povray_tolerance_and_threads():
    model = CASES["filtered shadows"]
    pictures = [
        opened(model, WIDTH, HEIGHT, povray_epsilon=True, threads=n).render(WIDTH, HEIGHT)["color"]
        for n in (1, 3)
    ]
    assert np.array_equal(*pictures)
