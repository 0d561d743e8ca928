"""Scene blocks mean what they mean in POV-Ray: one text, drawn by both, gives one picture.

``tests/cases/povray/*.plsys`` hold scenes of POV-Ray's blocks only. Here they go to POV-Ray as they stand, without
the exporter, so that it is the reading of blocks, modifiers and textures that is compared.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from plsys.compiler.cli import main

SCENES = sorted((Path(__file__).resolve().parents[2] / "cases/povray").glob("*.plsys"))
QUANTUM = 1 / 65535  # of the 16-bit files that are compared


def pixels(path: Path):
    import OpenImageIO

    return OpenImageIO.ImageBuf(str(path)).get_pixels()[..., :3]


@pytest.mark.povray
@pytest.mark.skipif(shutil.which("povray") is None, reason="povray isn't installed")
@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_one_text_one_picture(scene, tmp_path):
    text = '#version 3.7;\n#include "colors.inc"\n' + scene.read_text(encoding="utf-8")
    (tmp_path / "scene.pov").write_text(text, encoding="utf-8")
    flags = ["+W240", "+H180", "-A", "-D", "-V", "+FN16", "File_Gamma=1.0", "Dither=off"]
    command = ["povray", f"+I{tmp_path}/scene.pov", f"+O{tmp_path}/povray.png", *flags]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr[-1000:]
    ours = tmp_path / "plsys.png"
    assert (
        main(["render", str(scene), "-o", str(ours), "--size", "240x180", "--linear16", "--povray-epsilon"])
        == 0
    )
    difference = abs(pixels(tmp_path / "povray.png") - pixels(ours))
    assert difference.max() <= 1.01 * QUANTUM


def test_there_are_scenes():
    assert len(SCENES) >= 2
