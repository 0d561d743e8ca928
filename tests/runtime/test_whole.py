"""The C tests of shapes and tracing: plain, under the address and undefined-behaviour sanitizers, and, where threads
are used, under the thread sanitizer."""

from __future__ import annotations

from pathlib import Path

import pytest
import whole
from assembly import one_of_everything

from plsys.compiler import compile

ROOT = Path(__file__).resolve().parents[2]
SCENES = ("tree", "tree3d", "mirrors", "shading", "palm")


@pytest.mark.parametrize("variant", ["plain", "sanitized"])
@pytest.mark.parametrize("source", ["shapes/test_shapes.c", "shapes/test_mesh.c"])
def test_shapes(source, variant):
    done = whole.run(whole.program(source, variant))
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("variant", ["plain", "sanitized", "threads"])
@pytest.mark.parametrize("scene", ["everything", *SCENES])
def test_every_way_of_tracing_gives_the_same_hits(scene, variant, tmp_path):
    data = one_of_everything().bytes() if scene == "everything" else compile(ROOT / "scenes" / f"{scene}.plsys")
    path = tmp_path / "scene.plsb"
    path.write_bytes(data)
    done = whole.run(whole.program("accel/rays.c", variant), path)
    assert done.returncode == 0, done.stdout + done.stderr
