"""Regular subdivisions: triangles that cost bytes give the bits that the derivation gives, and what is no regular
subdivision isn't taken for one."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_fronts import answers, assert_same
from test_together import bundles
from wooded_hills import WOODED
from instruction_sets import available
from plsys.compiler import compile
from plsys.runtime import PlsysRuntimeError, Scene

SCENE = Path(__file__).resolve().parents[3] / "scenes" / "terrain.plsys"
PREFIX = """
global_settings { assumed_gamma 1.0  seed 4 }
camera { location <4, -9, 8>  sky <0, 0, 1>  right <-4/3, 0, 0>  look_at <4, 4, 0> }
light_source { <-20, -9, 12> color rgb 1 }
Transformation T_corners { matrix xb - xa, yb - ya, zb - za, xc - xa, yc - ya, zc - za, 0, 0, 1, xa, ya, za; }
"""
# The triangle's longest side is halved: two triangles.
HALVES = (
    PREFIX
    + """
object { Half(9, 0, 0, 0, 8, 8, 1, 8, 0, 2) }
Selection Half(n, xa, ya, za, xb, yb, zb, xc, yc, zc)
{
    if (n > 0) Half -> C_middle (Half(n - 1, xc, yc, zc, xa, ya, za, x, y, z) + Half(n - 1, xb, yb, zb, xc, yc, zc, x, y, z));
    else       Half -> T_corners triangle;
}
Calculation C_middle { x = (xa + xb) / 2; y = (ya + yb) / 2; z = (za + zb) / 2 + 0.1*n*(hash(x, y) - 0.5); }
"""
)
# Three triangles around a point; 3^5 = 243 of them, 27 a tile.
THIRDS = (
    PREFIX
    + """
object { Third(5, 0, 0, 0, 8, 0, 1, 8, 8, 2) rotate <0, 0, 20> translate <1, 2, 0.5> no_shadow }
sphere { <4, 4, 3>, 0.5 }
plane  { <0, 0, 1>, -1 }
object { Third(5, 0, 0, 0, 0, 8, 1, 8, 8, 2) scale <1, 1, 1.5> }
Selection Third(n, xa, ya, za, xb, yb, zb, xc, yc, zc)
{
    if (n > 0)
        Third -> C_point (Third(n - 1, xa, ya, za, xb, yb, zb, x, y, z) + Third(n - 1, xb, yb, zb, xc, yc, zc, x, y, z)
                        + Third(n - 1, xc, yc, zc, xa, ya, za, x, y, z));
    else
        Third -> T_corners triangle;
}
Calculation C_point { x = (xa + xb + xc) / 3; y = (ya + yb + yc) / 3; z = (za + zb + zc) / 3 + 0.1*n*(hash(x, y) - 0.5); }
"""
)
# Heights are 0 but for a few: what is the same in the tiles looked at isn't in all of them.
FLAT = SCENE.read_text().replace(
    "rough*(hash(xab, yab) - 0.5)", "(hash(xab, yab) > 0.999 ? 1 : 0)"
).replace("rough*(hash(xbc, ybc) - 0.5)", "(hash(xbc, ybc) > 0.999 ? 1 : 0)").replace(
    "rough*(hash(xca, yca) - 0.5)", "(hash(xca, yca) > 0.999 ? 1 : 0)"
).replace("-3", "0").replace("64, 64, 8", "64, 64, 0").replace("0, 64, 1", "0, 64, 0")  # fmt: skip


def rays(data: bytes, count: int = 600) -> tuple[np.ndarray, np.ndarray]:
    """From all around, from within, straight down, and through corners and middles of edges."""
    random = np.random.default_rng(3)
    with Scene(data, accelerator="none") as scene:
        matrices = np.concatenate([batch.matrix[batch.kind == 6] for batch in scene.unfold()])
    weights = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0.3, 0.3], [0.1, 0.6]])[random.integers(7, size=count)]
    chosen = matrices[random.integers(len(matrices), size=count)]
    targets = np.einsum("nij,nj->ni", chosen[:, :, :2], weights) + chosen[:, :, 3]
    size = np.ptp(targets, axis=0).max()
    origins = targets + random.normal(size=(count, 3)) * size * random.choice([0.01, 0.3, 3.0], (count, 1))
    origins[::5, :2] = targets[::5, :2]
    origins[1::5, 2] = targets[1::5, 2]
    return origins, (targets - origins) * random.choice([1.0, 1e-3, 50.0], (count, 1))


def tiles(data: bytes, **options) -> int:
    with Scene(data, **options) as scene:
        return scene.statistics["terrain"]["tiles"]


def texts() -> dict[str, str]:
    return {"terrain": SCENE.read_text(), "halves": HALVES, "thirds": THIRDS, "flat": FLAT}


@pytest.mark.parametrize("name", texts())
def test_the_hits_are_those_of_the_derivation(name):
    data = compile(texts()[name], parameters={"level": 4} if name in ("terrain", "flat") else {})
    assert tiles(data) >= 8
    origins, directions = rays(data)
    expected = answers(data, origins, directions, accelerator="none")
    assert np.isfinite(expected["t"]).mean() > 0.5
    assert_same(answers(data, origins, directions, accelerator="boxes"), expected, "boxes")
    assert_same(answers(data, origins, directions, front_items=21), expected, "fronts")
    for isa in available(data):
        for threads in (1, 3):
            assert_same(answers(data, origins, directions, isa=isa, threads=threads), expected, (isa, threads))


@pytest.mark.parametrize("name", texts())
def test_rays_that_go_together_do_not_show(name):
    data = compile(texts()[name], parameters={"level": 4} if name in ("terrain", "flat") else {})
    assert tiles(data) >= 8
    origins, directions = bundles(data, 7)
    # Among those that go together some that don't, in packets that aren't full.
    origins, directions = np.insert(origins, 100, origins[500:505], 0), np.insert(directions, 100, directions[500:505], 0)
    expected = answers(data, origins, directions, accelerator="boxes")
    assert np.isfinite(expected["t"]).mean() > 0.2
    steps = {}
    for isa in available(data):
        assert_same(answers(data, origins, directions, isa=isa), expected, isa)
        with Scene(data, isa=isa) as scene:
            scene.intersect(origins, directions)
            steps[isa] = scene.statistics["box_tests"]
    assert all(steps[isa] < 0.6 * steps["scalar"] for isa in steps if isa != "scalar")


@pytest.mark.parametrize("name", ["terrain", "thirds"])
def test_the_picture_is_the_same(name):
    data = compile(texts()[name], parameters={"level": 4} if name == "terrain" else {})
    with Scene(data, accelerator="boxes") as scene:
        expected = scene.render(64, 48)["color"]
    with Scene(data) as scene:
        np.testing.assert_array_equal(scene.render(64, 48)["color"], expected)
        assert scene.statistics["terrain"]["tiles"]


# What a texture reads, and where it stands: as scene.plsys has it, parameters that aren't a corner's, draws, upper levels.
GROUND = "Patch -> C_ground Ground T_corners triangle;"
LOOKS = {
    "what stays the same": {"height = (za + zb + zc) / 3;": "height = (za + zb + zc) / 3 + n + rough;"},
    "a parameter from above": {"height = (za + zb + zc) / 3;": "height = zab + xbc + yca;"},
    "a draw": {"height = (za + zb + zc) / 3;": "height = 9*rand(0);"},
    "a draw of the texture's": {"ambient 0.12": "ambient rand(3)"},
    "a texture above some": {"Patch -> C_middles (": "Patch -> C_middles Ground2 (", GROUND: "Patch -> C_ground T_corners triangle;",
                             "Texture Ground\n": "Texture Ground2 { pigment { color rgb <n/4, rough/14, 0.5> } }\nTexture Ground\n"},
    "the object's texture": {GROUND: "Patch -> T_corners triangle;",
                             "object { Hills }": "object { Hills texture { pigment { checker color rgb 1 color rgb 0 } } rotate <0, 0, 20> }"},
    "another symbol at the end": {GROUND: "Patch -> C_ground Ground [ n = za; ] End;",
                                  "Calculation C_ground": "Selection End { End -> [ zc = zc; ] T_corners triangle; }\nCalculation C_ground"},
    "a texture in some rules": {GROUND: "if (za > 0) Patch -> C_ground Ground End; else Patch -> End;",
                                "Calculation C_ground": "Selection End { End -> T_corners triangle; }\nCalculation C_ground"},
    "a pattern": {GROUND: "Patch -> C_ground Chequers T_corners triangle;",
                  "Texture Ground\n": "Texture Chequers { pigment { checker color rgb 1 color rgb 0.2 } finish { phong grass } }\nTexture Ground\n"},
}  # fmt: skip


@pytest.mark.parametrize("what", LOOKS)
def test_surfaces_are_those_of_the_derivation(what):
    text = SCENE.read_text()
    for old, new in LOOKS[what].items():
        assert old in text
        text = text.replace(old, new, 1)
    data = compile(text, parameters={"level": 4})
    assert tiles(data) == 8
    with Scene(data, accelerator="none") as scene:
        expected = scene.render(48, 36, channels=("color", "normal", "symbol", "rule", "recursion"))
    with Scene(data) as scene:
        found = scene.render(48, 36, channels=("color", "normal", "symbol", "rule", "recursion"))
    assert len(np.unique(expected["color"].reshape(-1, 3), axis=0)) > 50
    for channel, values in expected.items():
        np.testing.assert_array_equal(found[channel], values, channel)


def test_what_few_tiles_do_not_show_is_learnt_from_more():
    data = compile(FLAT, parameters={"level": 7})
    assert tiles(data) == 512
    origins, directions = rays(data, 3000)
    with Scene(data) as scene, Scene(data, front_items=21) as fronts:
        ours, theirs = scene.intersect(origins, directions), fronts.intersect(origins, directions)
        assert scene.statistics["bytes"]["items"] < 22 * 2 * 4**7
    assert_same(ours._asdict(), theirs._asdict(), "flat")


def test_a_triangle_costs_a_few_bytes_and_is_counted():
    data = compile(SCENE, parameters={"level": 8})
    with Scene(data) as scene:
        statistics = scene.statistics
    assert statistics["primitives"] == 2 * 4**8 and statistics["depth"] == 10
    assert statistics["terrain"]["tiles"] == 2 * 4**5
    assert statistics["bytes"]["items"] + statistics["bytes"]["nodes"] < 20 * statistics["primitives"]
    assert statistics["scene_bytes"] < 20 * statistics["primitives"] + 20_000


def memory_needed(data: bytes, memory: int) -> int:
    """KB that a scene says it needs where it is given less; the last of what it says, where there is more than one thing."""
    for _ in range(4):
        try:
            Scene(data, memory=memory * 1024).close()
        except PlsysRuntimeError as error:
            needs, allowed = map(int, re.findall(r"(\d+) KB", str(error)))
            assert needs > memory == allowed
            memory = needs
        else:
            return memory
    raise AssertionError(f"{memory} KB aren't enough either")


def test_memory_that_is_not_enough_for_tiles():
    data = compile(SCENE, parameters={"level": 5})
    origins, directions = rays(data, 40)
    expected = answers(data, origins, directions)
    assert tiles(data, memory=64 * 1024) == 32
    needed = memory_needed(data, 32)
    assert 32 < needed <= 64 and tiles(data, memory=needed * 1024) == 32
    assert_same(answers(data, origins, directions, memory=needed * 1024), expected, needed)


# What departs from the shape, and how.
DEPARTURES = {
    "ends early at a place": ("if (n > 0)", "if (n > (hash(xa, ya) > 0.9 ? 1 : 0))"),
    "leaves a triangle out": ("else\n", "else if (hash(xa, ya) < 0.9)\n"),
    "a transformation on the way": ("Patch -> C_middles (", "Patch -> C_middles [ scale 1 1 0.99 ] ("),
    "two shapes a triangle": ("T_corners triangle", "T_corners (triangle + sphere)"),
    "another shape": ("T_corners triangle", "T_corners square"),
    "a matrix that isn't of differences": ("zb - za, xc", "(zb - za)*1.01, xc"),
    "every patch the same": ("matrix xb - xa, yb - ya, zb - za, xc - xa, yc - ya, zc - za, 0, 0, 1, xa, ya, za;",
                             "matrix n - 1, n, n, n, n - 1, n, n, n, n - 1, n, n, n;"),
}  # fmt: skip


@pytest.mark.parametrize("what", DEPARTURES)
def test_what_is_no_regular_subdivision_is_not_taken_for_one(what):
    text = SCENE.read_text()
    assert DEPARTURES[what][0] in text
    data = compile(text.replace(*DEPARTURES[what], 1), parameters={"level": 4})
    assert tiles(data) == 0
    with Scene(data, accelerator="none") as scene:
        batches = [batch.matrix[:, :, 3] for batch in scene.unfold()]
    targets = np.concatenate(batches)[1:60]
    origins = targets + [3.0, 5.0, 40.0]
    assert_same(
        answers(data, origins, targets - origins), answers(data, origins, targets - origins, accelerator="none"), what
    )


def test_trees_stand_on_hills():
    data = compile(WOODED, parameters={"level": 4})
    with Scene(data) as scene:
        statistics = scene.statistics
        assert statistics["terrain"]["tiles"] == 16 and statistics["front"]["count"] and not statistics["lazy"]["unfolded"]
    assert statistics["terrain"]["triangles"] == 2 * 2 * 4**4
    with Scene(data, accelerator="boxes") as scene:
        assert scene.statistics["primitives"] == statistics["primitives"] and scene.statistics["depth"] == statistics["depth"]
        expected = scene.render(60, 45, channels=("color", "primitive", "symbol", "rule", "normal", "recursion"))
    origins, directions = (np.concatenate(pair) for pair in zip(rays(data, 400), bundles(data, 2)))
    hits = answers(data, origins, directions, accelerator="none")
    for isa in available(data):
        assert_same(answers(data, origins, directions, isa=isa), hits, isa)
        with Scene(data, isa=isa) as scene:
            found = scene.render(60, 45, channels=("color", "primitive", "symbol", "rule", "normal", "recursion"))
        for channel, values in expected.items():
            np.testing.assert_array_equal(found[channel], values, channel)


@pytest.mark.parametrize("memory", [50, 100, 200, 1000])
def test_trees_on_hills_in_little_memory(memory):
    data = compile(WOODED, parameters={"level": 4})
    memory = memory_needed(data, memory)
    origins, directions = rays(data, 60)
    expected = answers(data, origins, directions, accelerator="boxes")
    with Scene(data, memory=memory * 1024) as scene:
        size = scene.statistics["bytes"]
        assert size["states"] + size["nodes"] + size["items"] <= memory * 1024
    assert_same(answers(data, origins, directions, memory=memory * 1024), expected, memory)


def test_what_has_too_many_states_beside_hills_is_unfolded_on_touch():
    text = WOODED.replace("Wood(2,", "Wood(12,").replace("object { Woods translate <3, 2, 4> }", "")
    data = compile(text, parameters={"level": 4})
    with Scene(data) as scene:
        assert scene.statistics["terrain"]["tiles"] == scene.statistics["front"]["count"] == 0


PROBE = """
import resource, sys
from plsys.runtime import PlsysRuntimeError, Scene
with Scene(open(sys.argv[1], "rb").read(), memory=int(sys.argv[2]), threads=1) as scene:
    scene.render(64, 48)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024, scene.statistics["terrain"]["tiles"])
"""


def peak(path: Path, level: int, memory: int) -> tuple[int, int]:
    path.write_bytes(compile(SCENE, parameters={"level": level}))
    done = subprocess.run([sys.executable, "-c", PROBE, path, str(memory)], capture_output=True, text=True, check=True)
    return tuple(map(int, done.stdout.split()))


def test_the_process_stays_under_the_budget(tmp_path):
    """Its peak, building included, less that of a process with next to no scene."""
    without, _ = peak(tmp_path / "small.plsb", 0, 1 << 20)
    for level, budget in ((6, 256 << 10), (8, 3 << 20), (9, 11 << 20)):
        with_, found = peak(tmp_path / "large.plsb", level, budget)
        assert found == 2 * 4 ** (level - 3)
        assert with_ - without <= 1.1 * budget + (512 << 10), budget
