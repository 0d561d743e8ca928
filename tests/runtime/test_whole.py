"""The C tests of shapes and tracing: plain, under the address and undefined-behaviour sanitizers, and, where threads
are used, under the thread sanitizer."""

from __future__ import annotations

from pathlib import Path

import pytest
import whole
from assembly import one_of_everything
from wooded_hills import WOODED

from plsys.compiler import compile

ROOT = Path(__file__).resolve().parents[2]
SCENES = {"tree": {"order": 5}, "tree3d": {"order": 4}, "mirrors": {}, "shading": {}, "palm": {"rings": 6, "fronds": 4},
          "terrain": {"level": 4}}  # fmt: skip


# Fewer states than there are kinds of shapes.
FEW_STATES = """camera { location <1, -5, 2> look_at 0 }
Selection Rings { Rings -> torus(0.3) + [ scale 0.5 ] Discs; }
Selection Discs { Discs -> disc + [ rotx 90 ] disc + [ trans 0 0 1 ] torus(0.1); }
object { Rings }
"""


@pytest.mark.parametrize("variant", ["plain", "sanitized"])
@pytest.mark.parametrize("source", ["shapes/test_shapes.c", "shapes/test_mesh.c"])
def test_shapes(source, variant):
    done = whole.run(whole.program(source, variant))
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("variant", ["plain", "sanitized", "threads"])
@pytest.mark.parametrize("scene", ["everything", "few states", "wooded hills", *SCENES])
def test_every_way_of_tracing_gives_the_same_hits(scene, variant, tmp_path):
    path = tmp_path / "scene.plsb"
    if scene == "everything":
        path.write_bytes(one_of_everything().bytes())
    elif scene == "few states":
        path.write_bytes(compile(FEW_STATES))
    elif scene == "wooded hills":
        path.write_bytes(compile(WOODED, parameters={"level": 4}))
    else:
        path.write_bytes(compile(ROOT / "scenes" / f"{scene}.plsys", parameters=SCENES[scene]))
    # Without an accelerator a ray tries all of the hills' triangles, which sanitizers make slow.
    fewer = ["150"] if variant != "plain" and scene in ("wooded hills", "terrain") else []
    done = whole.run(whole.program("accel/rays.c", variant), path, *fewer)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("scene", ["everything", "tree"])
def test_changed_bytecode_is_refused_or_traced(scene, tmp_path):
    tree = ROOT / "scenes" / "tree.plsys"
    path = tmp_path / "scene.plsb"
    path.write_bytes(one_of_everything().bytes() if scene == "everything" else compile(tree, parameters={"order": 3}))
    done = whole.run(whole.program("accel/hostile.c", "sanitized"), path)
    assert done.returncode == 0, done.stdout + done.stderr
    refused, traced = map(int, done.stdout.split()[1::2])
    assert refused > 0 and traced > 0 and refused + traced == 8 * (path.stat().st_size - 28)
