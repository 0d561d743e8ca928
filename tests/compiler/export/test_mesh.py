"""Meshes: watertight, outward, within their tolerance, and with the volume and bounds of closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from plsys.compiler.export.mesh import agrees, export_mesh, read_back
from plsys.compiler.export.meshers import MESHERS, segments_for
from plsys.compiler.pipeline import build
from plsys.compiler.reading.diagnostics import PlsysError
from plsys.compiler.reading.source import Source

ARGUMENTS = {"cone": (0.0, 0.4, 1.0, 1.7), "torus": (0.2, 0.9)}
SOLIDS = [(name, a) for name, m in MESHERS.items() if m.solid for a in ARGUMENTS.get(name, (0.0,))]

# Distance of points from the surface of each unit shape, from inside or outside.
DISTANCES = {
    "sphere": lambda p, _: np.abs(np.linalg.norm(p, axis=1) - 1),
    "cylinder": lambda p, _: np.minimum(np.abs(np.hypot(p[:, 0], p[:, 1]) - 1), np.minimum(np.abs(p[:, 2]), np.abs(p[:, 2] - 1))),
    "cone": lambda p, top: np.minimum(
        np.abs(np.hypot(p[:, 0], p[:, 1]) - (1 + (top - 1) * p[:, 2])) / np.hypot(1, top - 1),
        np.minimum(np.abs(p[:, 2]), np.abs(p[:, 2] - 1)),
    ),
    "torus": lambda p, r: np.abs(np.hypot(np.hypot(p[:, 0], p[:, 1]) - 1, p[:, 2]) - r),
    "box": lambda p, _: np.minimum(np.abs(p), np.abs(p - 1)).min(axis=1),
}  # fmt: skip


@pytest.mark.parametrize("name, argument", SOLIDS)
@pytest.mark.parametrize("n", [6, 16, 50])
def test_solids_are_watertight_outward_and_have_their_closed_forms_volume(name, argument, n):
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(*MESHERS[name].build(n, argument), process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(MESHERS[name].volume(n, argument), rel=1e-12)


@pytest.mark.parametrize("name, argument", SOLIDS)
def test_no_facet_is_further_from_the_surface_than_the_stated_error(name, argument):
    for n in (6, 24):
        vertices, faces = MESHERS[name].build(n, argument)
        weights = np.random.default_rng(5).dirichlet((1, 1, 1), 40)
        points = np.einsum("wk,fkc->fwc", weights, vertices[faces]).reshape(-1, 3)
        assert DISTANCES[name](vertices, argument).max() < 1e-12
        assert DISTANCES[name](points, argument).max() <= MESHERS[name].error(n, argument) + 1e-12


@pytest.mark.parametrize("relative", [0.5, 0.1, 1e-2, 1e-4])
def test_segments_are_as_few_as_the_tolerance_allows(relative):
    mesher = MESHERS["sphere"]
    n = segments_for(mesher, relative, 0.0)
    assert mesher.error(n, 0.0) <= relative
    assert n == 6 or mesher.error(n - 2, 0.0) > relative


SHAPES = """object { S texture { pigment { color rgb <0.25, 0.5, 0.125> } finish { phong 0.5 } } }
object { Thin }
Selection S { S -> [ trans 1 2 3; rotx 25; scale 1 2 3 ] sphere + [ trans -4 0 0; shear 0.2 0 0 0 0.1 0 ] cylinder
  + [ trans 0 5 0; scale -2 1 1 ] cone(0.3) + [ trans 0 -5 0; rotz 20 ] box + [ trans 5 0 0; roty 50 ] torus(0.3); }
Selection Thin { Thin -> [ trans 0 0 6 ] (triangle + [ trans 2 0 0 ] square + [ trans 4 0 0 ] disc); }
plane { <0, 0, 1>, -9 }"""


def test_a_file_has_the_scenes_volume_and_bounds(tmp_path):
    exported = export_mesh(build(Source.from_text(SHAPES)).graph, tmp_path / "shapes.obj", tolerance=0.01)
    read = read_back(tmp_path / "shapes.obj")
    volume = 4 / 3 * np.pi * 6 + np.pi + 2 * np.pi / 3 * (1 + 0.3 + 0.09) + 1 + 2 * np.pi**2 * 0.09
    assert exported.volume == pytest.approx(volume, rel=1e-12)
    assert 0 < exported.error <= 0.01
    assert read.watertight and agrees(exported, read)
    assert read.volume == pytest.approx(exported.volume, rel=0.02)
    assert any("plane" in line for line in exported.lost)
    assert "not carried: 1 plane" in (tmp_path / "shapes.obj").read_text()


def test_a_finer_tolerance_comes_closer(tmp_path):
    graph = build(Source.from_text(SHAPES)).graph
    off = []
    for tolerance in (0.1, 0.01, 0.001):
        exported = export_mesh(graph, tmp_path / "shapes.obj", tolerance=tolerance)
        assert exported.error <= tolerance
        off.append(abs(read_back(tmp_path / "shapes.obj").volume - exported.volume))
    assert off[0] > 5 * off[1] > 25 * off[2]


def test_a_moved_vertex_is_noticed(tmp_path):
    exported = export_mesh(build(Source.from_text(SHAPES)).graph, tmp_path / "shapes.obj", tolerance=0.01)
    text = (tmp_path / "shapes.obj").read_text()
    first = next(line for line in text.splitlines() if line.startswith("v "))
    (tmp_path / "shapes.obj").write_text(text.replace(first, "v 1.0 1.0 1.0", 1))
    assert not agrees(exported, read_back(tmp_path / "shapes.obj"))


def test_materials_carry_colour_and_highlight(tmp_path):
    export_mesh(build(Source.from_text(SHAPES)).graph, tmp_path / "shapes.obj")
    materials = (tmp_path / "shapes.mtl").read_text()
    assert "Kd 0.25 0.5 0.125" in materials and "Ks 0.5 0.5 0.5" in materials and "Ns 40.0" in materials
    assert "mtllib shapes.mtl" in (tmp_path / "shapes.obj").read_text()


@pytest.mark.parametrize("tolerance", [0.0, -1.0, float("nan"), float("inf")])
def test_a_tolerance_must_be_positive(tolerance, tmp_path):
    with pytest.raises(PlsysError, match="tolerance"):
        export_mesh(build(Source.from_text(SHAPES)).graph, tmp_path / "shapes.obj", tolerance=tolerance)
    assert list(tmp_path.iterdir()) == []


def test_a_scene_of_planes_only_has_no_mesh(tmp_path):
    with pytest.raises(PlsysError, match="nothing"):
        export_mesh(build(Source.from_text("plane { <0, 0, 1>, 0 }")).graph, tmp_path / "plane.obj")
