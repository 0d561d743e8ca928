"""Neovim and Emacs open a scene with the language server: see README.md."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
SERVER = f"{sys.executable} -m plsys.compiler.cli lsp"
SCENE = """\
object { Tre }
Selection Tree { Tree -> T_up cylinder; }
Transformation T_up { trans 0 0 1; }
"""
TIMEOUT_S = 90
# pip's Neovim stands beside the interpreter, Debian's in /usr/bin.
NEOVIMS = {"0.11": Path(sys.executable).with_name("nvim"), "0.7": Path("/usr/bin/nvim")}


def run(command: list[str], folder: Path) -> dict:
    """What the editor's script prints: JSON on the last line."""
    scene = folder / "scene.plsys"
    scene.write_text(SCENE)
    environment = {
        **os.environ, "PLSYS_SERVER": SERVER, "PLSYS_SCENE": str(scene), "HOME": str(folder), "XDG_CONFIG_HOME": str(folder),
        "XDG_DATA_HOME": str(folder), "XDG_STATE_HOME": str(folder), "TERM": "dumb",
    }  # fmt: skip
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S, stdin=subprocess.DEVNULL)
    line = next((line for line in reversed((done.stdout + "\n" + done.stderr).splitlines()) if line.startswith("{")), None)
    assert line is not None, done.stdout + done.stderr
    result = json.loads(line)
    assert "failure" not in result, result["failure"]
    return result


def check(result: dict) -> None:
    messages = json.dumps(result["diagnostics"])
    assert "unknown name 'Tre'" in messages and "did you mean 'Tree'?" in messages
    assert {"T_up", "cylinder", "Tree"} & set(result["completion"]) >= {"T_up"}, result["completion"]
    assert "T_up" in json.dumps(result["hover"]) and "Transformation" in json.dumps(result["hover"])
    renamed = "\n".join(result["renamed"])
    assert renamed.count("T_high") == 2 and "T_up" not in renamed
    assert "unknown" not in json.dumps(result["mended"])


@pytest.mark.parametrize("version", NEOVIMS)
def test_neovim(version, tmp_path):
    program = NEOVIMS[version]
    if not program.exists():
        pytest.skip(f"Neovim {version} isn't installed: see tests/editors/README.md")
    script = f"luafile {HERE / 'session.lua'}"
    result = run([str(program), "--headless", "-u", "NONE", "--cmd", "set noswapfile", "-c", script], tmp_path)
    check(result)


def test_emacs(tmp_path):
    program = shutil.which("emacs")
    if program is None:
        pytest.skip("Emacs isn't installed: see tests/editors/README.md")
    probe = subprocess.run([program, "-q", "--batch", "--eval", "(progn (package-initialize) (require 'eglot))"], capture_output=True)
    if probe.returncode != 0:
        pytest.skip("this Emacs has no eglot: see tests/editors/README.md")
    check(run([program, "-q", "--batch", "-l", str(HERE / "session.el")], tmp_path))
