"""The scenes that come with the project: each has a picture, and the picture is what the renderer draws today.

`make bless` draws them again. tree.png is what `make render` makes; the others are small and antialiased.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from plsys.compiler.cli import main
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source

SCENES = sorted(Path("scenes").glob("*.plsys"))
NAMES = {
    "tree", "tree3d", "menger", "sierpinski", "koch", "fern", "bush", "flower", "palm", "conifer", "tower", "shading",
    "mirrors", "terrain",
}  # fmt: skip


def test_the_scenes_of_the_readme_are_there():
    assert NAMES <= {scene.stem for scene in SCENES}


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_a_scene_has_no_errors_and_says_what_it_is(scene):
    compilation = build(Source.read(scene))
    severities = {d.severity for d in compilation.diagnostics if d.code != "singular"}
    assert severities <= {"info"}, [d.message for d in compilation.diagnostics]
    assert scene.read_text().startswith(("//", "global_settings")), "a first line that says what the scene shows"


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_the_committed_picture_is_current(scene, tmp_path):
    picture, drawn = scene.with_suffix(".png"), tmp_path / "drawn.png"
    how = [] if scene.stem == "tree" else ["--size", "320x240", "--antialias", "grid=3"]
    assert main(["render", str(scene), "-o", str(drawn), *how]) == 0
    if os.environ.get("PLSYS_BLESS"):
        shutil.copy(drawn, picture)
    committed, now = (np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8)).astype(int) for path in (picture, drawn))
    assert committed.shape == now.shape
    assert np.mean(np.abs(committed - now).max(axis=2) > 1) < 1e-4


@pytest.mark.povray
@pytest.mark.skipif(shutil.which("povray") is None, reason="povray isn't installed: apt-get install povray")
@pytest.mark.parametrize("name", sorted(NAMES))
def test_our_picture_is_povrays(name, capsys):
    assert main(["compare", f"scenes/{name}.plsys", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["width"], facts["height"]) == (640, 480)
    assert facts["over_1e5"] <= 1e-4 * facts["pixels"] and facts["interior_over_1_255"] == 0
    assert facts["classes"]["ours_wrong"] == 0 and facts["classes"].get("unclassified", 0) == 0
    assert sum(facts["classes"].values()) == facts["over_1e5"]
    if name in ("shading", "mirrors"):
        assert facts["max_abs"] <= 1e-5
