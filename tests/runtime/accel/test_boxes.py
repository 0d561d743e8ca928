"""The paper's boxes (chapter 3): tight through the whole chain of transformations, and what Picture 1 shows of them."""

from __future__ import annotations

import numpy as np

from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source
from plsys.runtime import Scene
from test_agreement import around, rays

CAMERA = "camera { location <0, -9, 3> sky <0, 0, 1> look_at <0, 0, 0> }\n"


def encode(text: str) -> bytes:
    return build(Source.from_text(CAMERA + text)).encode()


def box_tests(data: bytes, origin, direction) -> int:
    with Scene(data, accelerator="boxes", threads=1) as scene:
        assert scene.intersect([origin], [direction]).primitive[0] == -1
        return scene.statistics["box_tests"]


TURNING = """object { Turn } Selection Turn { C_all Turn; if (n > 0) Turn -> [ --n; rotz 13; rotx 7 ] Turn; else Turn -> sphere + [ scale 0.5 0.5 2 ] box; }
    Calculation C_all { n = 30; }"""


def test_boxes_come_from_the_geometry_not_from_boxes():
    """Thirty turns: a box of a box of a box … would be a thousand times as large as the sphere and the rod."""
    data = encode(TURNING)
    assert box_tests(data, (2.6, -9, 0), (0, 1, 0)) <= 2
    assert box_tests(data, (0, 2.6, -9), (0, 0, 1)) <= 2


def test_a_subgraphs_box_holds_for_all_its_instances():
    """Leaves grow along the twig: the first instance's box would cut the later ones off."""
    data = encode("""object { Twig } Selection Twig { C_all Twig; if (n > 0) Twig -> T_leaf Leaf + [ --n; s *= 1.5; trans 1 0 0 ] Twig; }
        Selection Leaf { Leaf -> [ scale s ] (sphere + [ trans 0 0 1 ] cone(0.2)); }
        Calculation C_all { n = 8; s = 0.1; } Transformation T_leaf { roty 20; }""")
    centre, size = around(data)
    origins, directions = rays(500, 3, centre, size)
    with Scene(data, accelerator="none") as plain, Scene(data, accelerator="boxes") as boxes:
        np.testing.assert_array_equal(
            boxes.intersect(origins, directions).t, plain.intersect(origins, directions).t
        )


def test_picture_1_shows_rays_that_miss_boxes_on_deeper_levels():
    text = Source.read("scenes/tree.plsys").data.decode()
    text = "\n".join(line for line in text.splitlines() if not line.startswith("plane"))
    data = build(Source.from_text(text.replace("location <0, -14, 5>", "location <0, -34, 5>"))).encode()
    with Scene(data, accelerator="boxes") as scene:
        image = scene.render(80, 60, channels=("miss_depth", "primitive"))
    missed = image["miss_depth"][image["primitive"] < 0]
    assert image["miss_depth"][0, 0] == 0  # the corner misses the outermost box
    assert len(np.unique(missed)) >= 10 and missed.max() == 13
