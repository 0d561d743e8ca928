"""Tiles that no ray can meet anything through are not traced, and nobody can tell by the picture."""

from __future__ import annotations

import numpy as np
import pytest
from plsys.compiler import compile
from plsys.runtime import Scene

BACKGROUND = (0.25, 0.5, 0.75)
SCENES = {
    "specks": "".join(
        f"sphere {{ <{x}, {y}, {z}>, 0.005 pigment {{ color rgb 1 }} finish {{ emission 1 }} }}\n"
        for x, y, z in np.random.default_rng(3).uniform(-1, 1, (60, 3)).round(3)
    ),
    "needles": "".join(
        f"cylinder {{ <{x}, {y}, -1>, <{y}, {x}, 1>, 0.004 pigment {{ color rgb 1 }} finish {{ emission 1 }} }}\n"
        for x, y in np.random.default_rng(4).uniform(-1, 1, (20, 2)).round(3)
    ),
    "half a space": "sphere { 0, 0.5 pigment { color rgb 1 } }\nplane { <0, 1, 0>, -0.8 pigment { color rgb 1 } }\n",
}
FRAMES = {
    "usual": "angle 40",
    "narrow": "angle 0.5",
    "wide": "angle 170",
    "mirrored": "right <-4/3, 0, 0> angle 60",
    "flat": "up <0, 0.01, 0> angle 60",
}


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("name", SCENES)
def test_pictures_are_the_same_as_those_whose_rays_are_all_traced(name, frame):
    """A channel beside colour has every ray traced."""
    random = np.random.default_rng(5)
    for distance in (0.0, 0.9, 3.0, 40.0, 5000.0):
        eye = random.normal(size=3)
        eye *= distance / np.linalg.norm(eye)
        at = random.uniform(-0.7, 0.7, 3)
        camera = "camera {{ location <{}, {}, {}> {} look_at <{}, {}, {}> }}\n".format(
            *eye, FRAMES[frame], *at
        )
        background = "background {{ color rgb <{}, {}, {}> }}\n".format(*BACKGROUND)
        with Scene(compile(background + camera + SCENES[name])) as scene:
            some = scene.render(150, 110)["color"]
            every = scene.render(150, 110, channels=("color", "depth"))
        assert np.array_equal(some, every["color"])
        assert (every["color"][~np.isfinite(every["depth"])] == BACKGROUND).all()


def test_what_is_not_there_is_not_traced():
    camera = "camera { location <0, 0, -3> look_at <0, 0, 0> angle 40 }\n"
    with Scene(compile(camera + SCENES["specks"])) as scene:
        scene.render(320, 240, channels=("color", "depth"))
        every = scene.statistics["box_tests"]
        scene.render(320, 240)
        some = scene.statistics["box_tests"] - every
        assert scene.statistics["rays"]["primary"] == 2 * 320 * 240
    assert 0 < some < every
