"""The bench gives every program the same rays and the same things; its report judges targets."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))
import peer_mitsuba as mitsuba
import peers
import turns
from prepare import (
    CURVES,
    QUADS,
    Case,
    box_quads,
    cone_curves,
    split_forest,
    split_tree,
    triangles_of,
    write_embree,
)
from report import Results, Row, labels_of, size

from plsys.runtime import Scene


@pytest.mark.parametrize("scene", ["tree", "menger", "fern"])
def test_coherent_rays_are_the_renderers(scene, tmp_path):
    case = Case(scene, scene, {}, tmp_path, size=(32, 24))
    with Scene(case.compilation.encode()) as traced:
        depth = traced.render(32, 24, channels=("depth",))["depth"]
        rays = case.rays["coherent"].astype(float)
        t = traced.intersect(rays[:, :3], rays[:, 3:]).t
    tiles = depth.reshape(6, 4, 8, 4).swapaxes(1, 2).ravel()
    assert np.isfinite(t).any()
    agree = np.isclose(t, tiles, rtol=1e-3)
    assert agree.mean() > 0.99


def test_the_ground_is_nobodys(tmp_path):
    assert "plane" not in Case("tree", "tree", {"order": 2}, tmp_path).path.read_text()


def test_geometry_has_the_size_of_the_unfolding(tmp_path):
    tree, sponge = (
        Case("tree", "tree", {"order": 3}, tmp_path),
        Case("sponge", "menger", {"level": 1}, tmp_path),
    )
    curves = cone_curves(tree.unfolded()[1])
    assert curves.shape == (17, 8)
    np.testing.assert_allclose(curves[0], [0, 0, 0, 0.15, 0, 0, 2, 0.15])
    quads = box_quads(sponge.unfolded()[1]).reshape(-1, 4, 3)
    assert quads.shape == (120, 4, 3)
    areas = np.linalg.norm(np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0]), axis=1)
    np.testing.assert_allclose(areas, 1 / 9)
    assert len(triangles_of(quads.reshape(-1, 12))) == 240


def test_triangles_are_those_of_the_runtime(tmp_path):
    case = Case("hills", "terrain", {"level": 3}, tmp_path, size=(32, 24))
    corners = case.triangles().reshape(-1, 3, 3).astype(float)
    assert corners.shape == (128, 3, 3)
    with Scene(case.compilation.encode()) as scene:
        centres = corners.mean(axis=1)
        hits = scene.intersect(centres + [0, 0, 100], np.array([[0.0, 0, -1]]))
    np.testing.assert_allclose(hits.t, 100, atol=1e-4)
    assert sorted(hits.primitive) == list(range(128))


def test_the_tree_split_by_hand_is_the_tree(tmp_path):
    case = Case("tree", "tree", {"order": 6}, tmp_path)
    lower, upper, places = split_tree(case)
    ends = np.einsum("pij,nj->pni", places[:, :, :3], upper[:, :3]) + places[:, None, :, 3]
    feet = np.concatenate([lower[:, :3], ends.reshape(-1, 3)])
    expected = cone_curves(case.unfolded()[1])[:, :3]
    order = [np.lexsort(np.round(a, 6).T) for a in (feet, expected)]
    np.testing.assert_allclose(feet[order[0]], expected[order[1]], atol=1e-9)


def test_the_forest_split_by_hand_is_the_forest(tmp_path):
    case = Case("forest", "forest", {"order": 1}, tmp_path)
    groups, instances = split_forest(case)
    assert len(groups) == 32 and len(instances) == 10_000 and all(len(g) == 4 for g in groups)
    feet = np.concatenate([groups[kind][:, :3] @ frame[:, :3].T + frame[:, 3] for kind, frame in instances])
    expected = cone_curves(case.unfolded()[1])[:, :3]
    np.testing.assert_allclose(feet, expected, atol=1e-9)


def test_embree_answers_like_us(tmp_path):
    if not peers.embree_compiled(tmp_path) or "3.13" not in peers.embree_libraries():
        pytest.skip("libembree-dev isn't installed")
    for case, group in (
        (Case("tree", "tree", {"order": 4}, tmp_path, size=(32, 24)), lambda m: (CURVES, cone_curves(m))),
        (Case("sponge", "menger", {"level": 2}, tmp_path, size=(32, 24)), lambda m: (QUADS, box_quads(m))),
    ):
        scene = write_embree(tmp_path / "scene.bin", [group(case.unfolded()[1])], [])
        answer, mine = turns.take_turns([turns.embree(case, scene), turns.ours(case)], 2)
        for name, rays in case.rays.items():
            with Scene(case.compilation.encode()) as traced:
                t = traced.intersect(rays[:, :3].astype(float), rays[:, 3:].astype(float)).t
            theirs = answer["t"][name]
            same = np.isclose(t, theirs, rtol=1e-3) | (np.isinf(t) & np.isinf(theirs))
            assert same.mean() > 0.98  # its curves have no caps
            assert np.isfinite(theirs).any()
            measured = answer["sets"][name]["single"], mine["sets"][name]["rates"]
            assert all(len(rates) == 2 and min(rates) > 0 for rates in measured)  # a rate a turn


def test_our_own_child_process_measures_and_counts(tmp_path):
    case = Case("tree", "tree", {"order": 3}, tmp_path, size=(16, 12))
    answer = turns.alone(turns.ours(case, options={"accelerator": "grid", "grid": [4, 4, 4]}), 2)
    with Scene(case.compilation.encode()) as traced:
        rays = case.rays["coherent"].astype(float)
        hits = np.isfinite(traced.intersect(rays[:, :3], rays[:, 3:]).t).sum()
    assert answer["sets"]["coherent"]["hits"] == hits and answer["primitives"] == 17
    assert answer["process_rss"] > 1e6 and all(rate > 0 for rate in answer["sets"]["random"]["rates"])


def test_a_program_that_fails_says_why(tmp_path):
    case = Case("tree", "tree", {"order": 3}, tmp_path, size=(16, 12))
    programs = [turns.ours(case), turns.ours(case, options={"accelerator": "kd"})]
    for run in (lambda: turns.alone(programs[1]), lambda: turns.take_turns(programs)):
        with pytest.raises(RuntimeError, match="'kd' is none of"):
            run()


def test_slow_programs_trace_some_of_the_rays(tmp_path):
    case = Case("tree", "tree", {"order": 3}, tmp_path, size=(64, 48))
    answer = turns.alone(turns.ours(case, most_seconds=0), 1)
    assert answer["sets"]["coherent"]["rays"] == 512 < len(case.rays["coherent"])


def test_a_process_is_measured_alone():
    """Peak memory doesn't include that of this process, which has NumPy."""
    assert peers.run([sys.executable, "-S", "-c", "pass"]).rss < 40e6


def test_mitsubas_files_have_every_instance(tmp_path):
    case = Case("tree", "tree", {"order": 4}, tmp_path)
    lower, upper, places = split_tree(case)
    groups = [mitsuba.Group("curves", lower), mitsuba.Group("curves", upper, True)]
    text = mitsuba.write_scene(tmp_path / "scene.xml", case, groups, [(1, p) for p in places]).read_text()
    assert text.count('type="instance"') == len(places) == 4 and text.count('type="shapegroup"') == 1
    assert (tmp_path / "group0.txt").read_text().count("\n\n") == len(lower)


def test_rows_are_judged_by_the_median(tmp_path, capsys):
    results = Results()
    results.row("a", "speed", [3.0, 1.0, 1.2], 1.1)
    results.row("a", "memory", [5.0], 4, " MB", at_most=True)
    results.row("a", "reported", 2.0)
    assert [row.met for row in results.rows] == [True, False, None]
    out = capsys.readouterr().out
    assert "1 … 3" in out and "≥ 1.1  met" in out and "NOT met" in out
    results.write(tmp_path / "bench.json", {"cores": 2})
    data = json.loads((tmp_path / "bench.json").read_text())
    assert data["rows"][0]["value"] == 1.2 and data["rows"][1]["met"] is False and data["cores"] == 2
    assert Row("", "", 1, 1, 1, "", None, False).met is None and size(2.5e6) == "2.5 MB"


def test_points_that_are_hardly_apart_share_a_label():
    at = [(1, 2.0e4, 5.0), (21, 2.1e4, 5.2), (256, 2.1e4, 5.3), (1024, 1e5, 6.0), (2**62, 1e7, 5.9)]
    points = [{"items": items, "bytes": size, "coherent": rate} for items, size, rate in at]
    assert [label for label, *_ in labels_of(points)] == ["1–256", "1024", "all"]


def test_curves_are_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    results = Results()
    assert results.plot(tmp_path / "none.png") == "no plot: no curve was measured"
    point = {
        "items": 21,
        "bytes": 2e4,
        "coherent": 1.0,
        "random": 0.5,
        "build_seconds": 0.1,
        "primitives": 400.0,
        "threads": 1,
        "rate": 2.0,
    }
    results.curves = {"fronts: tree": [point], "growth": [point], "threads: tree": [point]}
    assert results.plot(tmp_path / "all.png") is None and (tmp_path / "all.png").stat().st_size > 1000


def test_povray_draws_and_tells_its_seconds(tmp_path):
    case = Case("tree", "tree", {"order": 2}, tmp_path)
    answer = peers.povray(case, tmp_path, 32, 24)
    if answer is None:
        pytest.skip("povray isn't installed")
    assert {"parse", "trace"} <= set(answer) and answer["trace"] >= 0 and answer["rss"] > 1e6
