"""``plsys compare``: agreement with POV-Ray, the facts and their classes, the picture, exit codes; and the
mesh way."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from plsys.compiler.cli import main
from plsys.compiler.commands.comparison import passes
from plsys.compiler.commands.differences import Camera, classify, edges, statistics
from plsys.compiler.export.povray import values_of
from plsys.compiler.export.retrace import Retracer
from plsys.compiler.pipeline import build
from plsys.runtime import Scene

needs_povray = pytest.mark.skipif(
    shutil.which("povray") is None, reason="povray isn't installed: apt-get install povray"
)

FACTS = {
    "scene", "width", "height", "pixels", "max_abs", "rmse", "over_1e5", "interior_over_1_255", "edge_pixels",
    "ours_seconds", "povray_seconds", "ours_rss", "povray_rss",
}  # fmt: skip


@needs_povray
@pytest.mark.povray
def test_the_tree_is_povrays_tree(tmp_path, capsys):
    picture = tmp_path / "side.png"
    assert main(["compare", "scenes/tree.plsys", "--size", "160x120", "-o", str(picture), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert set(facts) >= FACTS
    assert facts["pixels"] == 160 * 120 and facts["interior_over_1_255"] == 0
    assert facts["over_1e5"] <= 1 and facts["classes"]["ours_wrong"] == 0
    assert 0 < facts["rmse"] <= facts["max_abs"]
    oiio = pytest.importorskip("OpenImageIO")
    spec = oiio.ImageInput.open(str(picture)).spec()
    assert (spec.width, spec.height) == (3 * 160 + 8, 120 + 24)


@needs_povray
@pytest.mark.povray
def test_inputs_and_seed_reach_both_pictures(capsys):
    arguments = ["compare", "scenes/tree3d.plsys", "--size", "80x60", "--seed", "5", "--json"]
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["passed"]


@needs_povray
@pytest.mark.povray
def test_a_scene_may_have_any_name(tmp_path, capsys):
    """POV-Ray itself opens no file whose path isn't ASCII."""
    scene = tmp_path / "größe ☂" / "kürbis 1.plsys"
    scene.parent.mkdir()
    scene.write_text(Path("scenes/shading.plsys").read_text())
    assert main(["compare", str(scene), "--size", "40x30", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["passed"]


def test_without_povray_there_is_a_clear_message(monkeypatch, capsys):
    monkeypatch.setenv("PATH", "/nonexistent")
    assert main(["compare", "scenes/tree.plsys"]) == 2
    assert "POV-Ray isn't installed" in capsys.readouterr().err


def test_a_mesh_is_checked_against_closed_forms(tmp_path, capsys):
    arguments = [
        "compare",
        "scenes/tower.plsys",
        "--through",
        "obj",
        "--size",
        "64x48",
        "--tolerance",
        "0.02",
        "--json",
    ]
    assert main([*arguments, "-o", str(tmp_path / "side.png")]) == 0
    facts = json.loads(capsys.readouterr().out)
    mesh = facts["mesh"]
    assert facts["passed"] and mesh["watertight"] and 0 < mesh["error"] <= 0.02
    assert mesh["volume"] == pytest.approx(mesh["facets_volume"], rel=1e-3)
    assert mesh["volume"] == pytest.approx(mesh["exact_volume"], rel=0.1)
    assert any("plane" in line for line in facts["lost"])
    assert (tmp_path / "side.png").exists()


# --- statistics, edges, classes ---


def flat_image(height: int = 8, width: int = 10) -> dict[str, np.ndarray]:
    return {
        "primitive": np.zeros((height, width), np.int64),
        "normal": np.broadcast_to(np.float32([0, 0, 1]), (height, width, 3)).copy(),
        "depth": np.full((height, width), 5, np.float32),
    }


def test_one_surface_has_no_edge():
    assert not edges(flat_image()).any()


@pytest.mark.parametrize(
    "channel, value, found",
    [
        ("primitive", 1, True),
        ("normal", (0, np.sin(np.radians(11)), np.cos(np.radians(11))), True),
        ("normal", (0, np.sin(np.radians(9)), np.cos(np.radians(9))), False),
        ("depth", 5.06, True),
        ("depth", 5.04, False),
    ],
)
def test_edges_are_where_primitive_normal_or_depth_change(channel, value, found):
    image = flat_image()
    image[channel][3, 4] = value
    expected = np.zeros((8, 10), bool)
    expected[2:5, 3:6] = found
    np.testing.assert_array_equal(edges(image), expected)


def test_statistics_of_known_differences():
    ours = np.full((8, 10, 3), 0.5, np.float32)
    theirs = ours.copy()
    theirs[1, 2, 0] += 0.125
    theirs[5, 5] -= 0.25
    edge = np.zeros((8, 10), bool)
    edge[5, 5] = True
    facts = statistics(ours, theirs, edge)
    assert facts["max_abs"] == pytest.approx(0.25) and facts["pixels"] == 80
    assert facts["rmse"] == pytest.approx(np.sqrt((0.125**2 + 3 * 0.25**2) / 240))
    assert (facts["over_1e5"], facts["interior_over_1_255"], facts["edge_pixels"]) == (2, 1, 1)


def test_a_wrong_decision_of_ours_is_called_so():
    """The retracer confirms what the runtime decides; a runtime that decided otherwise would be told
    apart."""
    compilation = build("scenes/tree.plsys", parameters={"order": 5})
    graph = compilation.graph
    camera = Camera(values_of(graph.camera, "camera"), 64, 48)
    pixels = np.array([[40, 10], [30, 32], [2, 3]])
    with Scene(compilation.encode(), povray_epsilon=True) as scene:

        def agrees(ray) -> bool:
            origin, direction = (np.asarray(v, np.float64)[None] for v in (ray.origin, ray.direction))
            if ray.is_shadow:
                return bool(scene.occluded(origin, direction, np.array([ray.end]))[0]) == (ray.primitive >= 0)
            return int(scene.intersect(origin, direction).primitive[0]) == ray.primitive

        confirmed = classify(pixels, Retracer(graph), camera, agrees)
    denied = classify(pixels, Retracer(graph), camera, lambda ray: False)
    assert {pixel["class"] for pixel in confirmed} == {"theirs_wrong"}
    assert {pixel["class"] for pixel in denied} == {"ours_wrong"}


def test_the_camera_sends_the_runtimes_rays():
    compilation = build("scenes/tree.plsys")
    camera = Camera(values_of(compilation.graph.camera, "camera"), 64, 48)
    y, x = np.mgrid[0:48, 0:64]
    rays = camera.rays(x.ravel() + 0.5, y.ravel() + 0.5)
    with Scene(compilation.encode()) as scene:
        hits = scene.intersect(np.broadcast_to(camera.origin, rays.shape).copy(), rays)
        image = scene.render(64, 48, channels=("primitive",))["primitive"]
    assert np.count_nonzero(hits.primitive.reshape(48, 64) != image) <= 1


@pytest.mark.parametrize(
    "change, expected",
    [
        ({}, True),
        ({"over_1e5": 10}, True),
        ({"over_1e5": 11}, False),
        ({"interior_over_1_255": 1}, False),
        ({"classes": {"ours_wrong": 1}}, False),
        ({"classes": {"ambiguous": 5, "theirs_wrong": 5}}, True),
    ],
)
def test_what_passes(change, expected):
    facts = {"pixels": 100_000, "over_1e5": 0, "interior_over_1_255": 0, "classes": {}} | change
    assert passes(facts) is expected
