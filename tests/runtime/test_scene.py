"""The binding: arguments, errors of one family, life and threads of a Scene, its unfolding and statistics."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from assembly import Assembly, one_of_everything

from plsys.compiler import compile
from plsys.runtime import PlsysRuntimeError, RuntimeArgumentError, Scene, disassemble, quantise

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tree() -> bytes:
    return compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 5})


@pytest.mark.parametrize(
    "options, message",
    [
        (dict(accelerator="grid2"), "accelerator: 'grid2' is none of auto, none, boxes, bvh"),
        (dict(threads=-1), "threads: -1 is not between 0 and 1024"),
        (dict(threads="two"), "threads: expected an integer, not 'two'"),
        (dict(memory=-5), "memory: -5 is not between"),
    ],
)
def test_bad_options_say_what_was_expected(tree, options, message):
    with pytest.raises(RuntimeArgumentError) as caught:
        Scene(tree, **options)
    assert str(caught.value).startswith(message)
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, PlsysRuntimeError)


@pytest.mark.parametrize(
    "origins, directions, message",
    [
        ([[0, 0]], [[0, 0, 1]], r"origins: expected an array of shape \(n, 3\), not \(1, 2\)"),
        ("here", [[0, 0, 1]], r"origins: expected numbers in an array of shape \(n, 3\)"),
        ([[0, 0, 0]] * 2, [[0, 0, 1]] * 3, "rays: 2 origins, but 3 directions"),
        ([[0, 0, 0]] * 2, [[0, 0, 1], [0, 0, 0]], "rays: the direction of ray 1 is zero"),
        ([[0, np.nan, 0]], [[0, 0, 1]], "rays: ray 0 has a number that isn't finite"),
    ],
)
def test_bad_rays_say_what_was_expected(tree, origins, directions, message):
    with Scene(tree) as scene:
        with pytest.raises(RuntimeArgumentError, match=message):
            scene.intersect(origins, directions)
        with pytest.raises(RuntimeArgumentError, match=message):
            scene.occluded(origins, directions)


def test_one_origin_serves_many_directions_and_no_rays_give_empty_arrays(tree):
    with Scene(tree) as scene:
        assert scene.intersect((0, -9, 1), np.eye(3)).t.shape == (3,)
        empty = scene.intersect(np.zeros((0, 3)), np.zeros((0, 3)))
        assert [array.shape for array in empty] == [(0,), (0,), (0,), (0, 3), (0,), (0,), (0,)]
        assert scene.occluded(np.zeros((0, 3)), (0, 0, 1)).shape == (0,)


def test_strided_and_integer_arrays_are_understood(tree):
    rays = np.arange(60, dtype=np.int32).reshape(10, 6)
    with Scene(tree) as scene:
        ours = scene.intersect(rays[::2, :3], rays[::2, 3:])
        plain = scene.intersect(rays[::2, :3].astype(float).copy(), rays[::2, 3:].astype(float).copy())
    np.testing.assert_array_equal(ours.t, plain.t)


def test_occluded_looks_as_far_as_the_distance(tree):
    with Scene(tree) as scene:
        t = scene.intersect((0, -9, 1), (0, 1, 0)).t[0]
        assert scene.occluded((0, -9, 1), (0, 1, 0)).tolist() == [True]
        assert scene.occluded([[0, -9, 1]] * 2, (0, 1, 0), [t, t + 1e-9]).tolist() == [False, True]
        with pytest.raises(RuntimeArgumentError, match="distance: expected a number or 1 of them"):
            scene.occluded((0, -9, 1), (0, 1, 0), [1, 2])


def test_a_closed_scene_says_so(tree):
    scene = Scene(tree)
    unfolding = scene.unfold(batch=1)
    first = next(unfolding)
    scene.close()
    scene.close()
    assert len(first.kind) == 1 and len(list(unfolding)) > 1  # what has begun may end
    calls = [lambda: scene.intersect((0, 0, 9), (0, 0, -1)), lambda: scene.statistics, lambda: next(scene.unfold())]
    for call in (*calls, lambda: scene.symbol_name(0), lambda: scene.render(4, 4)):
        with pytest.raises(PlsysRuntimeError, match="scene: it is closed"):
            call()


def test_threads_share_a_scene_and_give_the_same_bits(tree):
    random = np.random.default_rng(0)
    origins, targets = random.normal(size=(5000, 3)) * 20, random.uniform(-3, 6, (5000, 3))
    results = []
    for threads in (1, 2, 5):
        with Scene(tree, threads=threads) as scene, ThreadPoolExecutor(3) as pool:
            results += pool.map(lambda _: scene.intersect(origins, targets - origins), range(3))
    for result in results[1:]:
        for ours, expected in zip(result, results[0]):
            np.testing.assert_array_equal(ours, expected)


def test_the_first_bad_ray_is_reported_on_any_number_of_threads():
    a = Assembly()
    a.node("object", name="", ordinal=0, child=1)
    a.node("primitive", shape="sphere", code=0)
    directions = np.ones((20000, 3))
    directions[[700, 19000]] = 0
    for threads in (1, 4):
        with Scene(a.bytes(), threads=threads) as scene, pytest.raises(RuntimeArgumentError, match="ray 700 is zero"):
            scene.intersect(np.zeros((20000, 3)), directions)


def test_the_unfolding_gives_everything_in_batches():
    with Scene(one_of_everything().bytes()) as scene:
        whole = list(scene.unfold())
        parts = list(scene.unfold(batch=2))
        kinds = np.concatenate([batch.kind for batch in parts])
        np.testing.assert_array_equal(kinds, whole[0].kind)
        np.testing.assert_array_equal(np.concatenate([batch.matrix for batch in parts]), whole[0].matrix)
        generated = np.concatenate([batch.symbol for batch in whole]) >= 0
        assert np.count_nonzero(generated) == scene.statistics["primitives"] and whole[0].matrix.shape == (len(kinds), 3, 4)
        textures = whole[0].texture
        assert textures[-1] == 4 and scene.texture(4)[0] == 2.0  # the ramp: a gradient
        assert whole[0].symbol[-1] == -1 and scene.symbol_name(whole[0].symbol[0]) == "Tree"
        with pytest.raises(RuntimeArgumentError, match="there is no texture 0"):
            scene.texture(0)  # a record, but the settings


def test_names_and_places(tree):
    with Scene(tree) as scene:
        hit = scene.intersect((0, -9, 1), (0, 1, 0))
        assert scene.symbol_name(hit.symbol[0]) == "Tree" and scene.symbol_name(-1) == scene.symbol_name(99) == ""
        assert scene.rule_place(hit.rule[0]).split(":")[0].endswith("tree.plsys") and scene.rule_place(-1) == ""


def test_statistics_count_rays_and_costs(tree):
    with Scene(tree, threads=2) as scene:
        scene.render(32, 24)
        statistics = scene.statistics
    assert statistics["rays"]["primary"] == 32 * 24 and statistics["primitives"] == 65
    assert statistics["accelerator"] == "bvh" and statistics["threads"] == 2
    assert statistics["box_tests"] > 0 and statistics["seconds"]["trace"] > 0
    assert set(statistics["seconds"]) == {"verify", "states", "build", "trace", "trace_cpu", "first_pixel"}
    assert statistics["seconds"]["trace_cpu"] > 0
    assert 0 < statistics["seconds"]["first_pixel"] <= statistics["seconds"]["trace"]


@pytest.mark.parametrize("data", [b"", b"PLSB", b"x" * 100])
def test_what_is_no_bytecode_is_one_clear_error(data):
    for call in (Scene, disassemble):
        with pytest.raises(PlsysRuntimeError) as caught:
            call(data)
        assert caught.value.kind == "bytecode" and caught.value.reason
    with pytest.raises(RuntimeArgumentError, match="bytecode: expected bytes, not str"):
        Scene("tree.plsb")


def test_colours_as_picture_files_have_them(tree):
    with Scene(tree) as scene:
        image = scene.render(64, 48, channels=("color", "srgb", "linear16"))
    linear = np.clip(image["color"].astype(np.float64), 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert image["srgb"].dtype == np.uint8 and image["linear16"].dtype == np.uint16
    np.testing.assert_array_equal(image["srgb"], np.floor(255 * srgb + 0.5))
    np.testing.assert_array_equal(image["linear16"], np.floor(65535 * linear + 0.5))
    assert len(np.unique(image["srgb"])) > 10


def test_every_byte_has_its_stretch_of_light():
    linear = np.linspace(-0.1, 1.1, 100_001, dtype=np.float32)
    clipped = np.clip(linear.astype(np.float64), 0, 1)
    srgb = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    np.testing.assert_array_equal(quantise(linear, "srgb"), np.floor(255 * srgb + 0.5))
    np.testing.assert_array_equal(quantise(linear, "linear16"), np.floor(65535 * clipped + 0.5))
    odd = np.float32([[np.nan, np.inf, -np.inf], [0, 1, 1e-30]])
    assert quantise(odd, "srgb").tolist() == [[0, 255, 0], [0, 255, 0]]
    assert quantise(odd, "linear16").tolist() == [[0, 65535, 0], [0, 65535, 0]]
    with pytest.raises(RuntimeArgumentError, match="kind: 'gamma' is none of srgb, linear16"):
        quantise(odd, "gamma")


def test_pictures_go_into_any_buffer_that_fits(tree):
    with Scene(tree) as scene:
        expected = scene.render(16, 12, channels=("color", "depth", "srgb"))
        planes = {"color": bytearray(16 * 12 * 12), "depth": np.empty((12, 16), np.float32), "srgb": bytearray(16 * 12 * 3)}
        scene.render_into(planes, 16, 12)
        for name, plane in planes.items():
            assert bytes(plane) == expected[name].tobytes()
        for buffer, message in (
            (bytearray(5), "srgb: a buffer of 5 bytes, but the picture takes 576"),
            (bytes(576), "srgb: expected a writable, contiguous buffer"),
            (np.empty((12, 32, 3), np.uint8)[:, ::2], "srgb: expected a writable, contiguous buffer"),
            (None, "srgb: expected a writable, contiguous buffer"),
        ):
            with pytest.raises(RuntimeArgumentError, match=message):
                scene.render_into({"srgb": buffer}, 16, 12)
        with pytest.raises(RuntimeArgumentError, match="channel: 'colour' is none of color, depth"):
            scene.render_into({"colour": bytearray(576)}, 16, 12)


def test_progress_can_cancel_and_its_exceptions_come_back(tree):
    shares = []
    with Scene(tree, threads=1) as scene:
        scene.render(64, 64, progress=shares.append)
        with pytest.raises(PlsysRuntimeError) as caught:
            scene.render(64, 64, progress=lambda done: False)
        assert caught.value.kind == "cancelled"
        with pytest.raises(ZeroDivisionError):
            scene.render(64, 64, progress=lambda done: 1 / 0)
    assert shares == sorted(shares) and 0 <= shares[0] and shares[-1] <= 1


def test_importing_the_runtime_loads_neither_numpy_nor_the_compiler():
    program = "import sys, plsys.runtime; print([m for m in sys.modules if m == 'numpy' or m.startswith('plsys.compiler')])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "[]\n", done.stdout + done.stderr
