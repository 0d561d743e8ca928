"""Neovim and Emacs open a scene with the language server: see README.md."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from plsys.compiler.reading import grammar

HERE = Path(__file__).resolve().parent
SERVER = f"{sys.executable} -m plsys.compiler.cli lsp"
SCENE = """\
object { Tre }
Selection Tree { Tree -> T_up cylinder; }
Transformation T_up { trans 0 0 1; }
"""
TIMEOUT_S = 90
ROOT = HERE.parents[1]
# How Neovim shows words of scenes/tree.plsys at their first place.
SEEN = {
    "camera": "type.builtin", "location": "property", "#declare": "keyword.directive", "Bark": "constant", "Parameter": "keyword",
    "order": "constant", "Selection": "keyword", "Tree": "property", "if": "keyword.conditional", "cylinder": "type.builtin",
    "scale": "function.builtin", "Calculation": "keyword", "C_initialize": "variable", "betaBr": "variable", "0": "number",
}  # fmt: skip
# pip's Neovim stands beside the interpreter, Debian's in /usr/bin.
NEOVIMS = {"0.11": Path(sys.executable).with_name("nvim"), "0.7": Path("/usr/bin/nvim")}


def run(command: list[str], folder: Path, **more: str) -> dict:
    """What the editor's script prints: JSON on the last line."""
    scene = folder / "scene.plsys"
    scene.write_text(SCENE)
    environment = {
        **os.environ, **more, "PLSYS_SERVER": SERVER, "PLSYS_SCENE": str(scene), "HOME": str(folder), "XDG_CONFIG_HOME": str(folder),
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


def test_neovim_highlights_and_folds(tmp_path):
    """The grammar and its queries as Neovim itself uses them, without a language server."""
    program = NEOVIMS["0.11"]
    if not program.exists():
        pytest.skip("Neovim 0.11 isn't installed: see tests/editors/README.md")
    (tmp_path / "parser").mkdir()
    shutil.copy(next(Path(grammar.__file__).parents[1].glob("libgrammar.*")), tmp_path / "parser/plsys.so")
    shutil.copytree(ROOT / "grammar/queries/neovim", tmp_path / "queries/plsys")
    scenes = sorted((ROOT / "scenes").glob("*.plsys"))
    script = f"luafile {HERE / 'highlight.lua'}"
    command = [str(program), "--headless", "-u", "NONE", "--cmd", "set noswapfile", "-c", script]
    names = "\n".join(map(str, [ROOT / "scenes/tree.plsys", *scenes]))
    result = run(command, tmp_path, PLSYS_RUNTIME=str(tmp_path), PLSYS_SCENES=names)
    assert {"indent.begin", "indent.branch"} <= set(result["queries"]["indents"])
    assert len(result["scenes"]) == len(scenes) + 1
    for scene in result["scenes"]:
        assert [word for word, capture in scene["words"] if not capture] == []
    assert max(result["scenes"][0]["folds"]) >= 1
    seen = {word: capture for word, capture in reversed(result["scenes"][0]["words"])}
    assert {word: seen[word] for word in SEEN} == SEEN


def emacs_with_eglot() -> str:
    program = shutil.which("emacs")
    if program is None:
        pytest.skip("Emacs isn't installed: see tests/editors/README.md")
    probe = subprocess.run([program, "-q", "--batch", "--eval", "(progn (package-initialize) (require 'eglot))"], capture_output=True)
    if probe.returncode != 0:
        pytest.skip("this Emacs has no eglot: see tests/editors/README.md")
    return program


def test_emacs(tmp_path):
    check(run([emacs_with_eglot(), "-q", "--batch", "-l", str(HERE / "session.el")], tmp_path))


def settings(language: str, folder: Path) -> Path:
    """The set-up in README.md for an editor whose settings are in that language, with a path that exists."""
    (text,) = re.findall(rf"^```{language}\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    program = folder / "plsys"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -P -m plsys.compiler.cli "$@"\n')
    program.chmod(0o755)
    path = folder / f"init.{language}"
    path.write_text(text.replace("/path/to/plsys/.venv/bin/plsys", str(program)))
    assert str(program) in path.read_text()
    return path


def test_neovim_with_the_settings_in_the_readme(tmp_path):
    program = NEOVIMS["0.11"]
    if not program.exists():
        pytest.skip("Neovim 0.11 isn't installed: see tests/editors/README.md")
    say = (
        "lua vim.wait(20000, function() return #vim.diagnostic.get(0) > 0 end, 20); io.stdout:write(vim.fn.json_encode({"
        "diagnostics = vim.diagnostic.get(0), filetype = vim.bo.filetype, hints = vim.lsp.inlay_hint.is_enabled()})"
        " .. '\\n'); vim.cmd('qall!')"
    )
    init = settings("lua", tmp_path)
    result = run([str(program), "--headless", "-u", str(init), "--cmd", "set noswapfile", "-c", say, "scene.plsys"], tmp_path)
    assert result["filetype"] == "plsys"
    assert "did you mean 'Tree'?" in json.dumps(result["diagnostics"])
    assert result["hints"]


def test_emacs_with_the_settings_in_the_readme(tmp_path):
    program = emacs_with_eglot()
    say = """(progn
      (find-file "scene.plsys")
      (run-hooks 'post-command-hook)
      (let ((end (+ (float-time) 20)))
        (while (and (progn (flymake-start) (null (flymake-diagnostics))) (< (float-time) end)) (accept-process-output nil 0.05)))
      (princ (concat (json-encode `((mode . ,major-mode) (messages . ,(vconcat (mapcar (lambda (each)
        (substring-no-properties (flymake-diagnostic-text each))) (flymake-diagnostics)))))) "\\n"))
      (kill-emacs 0))"""
    init = settings("elisp", tmp_path)
    start = "(progn (require 'package) (package-initialize) (require 'json) (require 'cl-lib))"
    result = run([program, "-q", "--batch", "--eval", start, "-l", str(init), "--eval", say], tmp_path)
    assert result["mode"] == "plsys-mode"
    assert any("did you mean 'Tree'?" in message for message in result["messages"])
