"""`plsys format`: files in place, standard input, --check, broken files, JSON."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from plsys.compiler.cli import main

ROUGH = "Calculation C{n=1;}\n"
NEAT = "Calculation C { n = 1; }\n"


def test_files_are_written_anew(tmp_path, capsys):
    rough, neat = tmp_path / "rough.plsys", tmp_path / "neat.plsys"
    rough.write_text(ROUGH)
    neat.write_text(NEAT)
    rough.chmod(0o640)
    assert main(["format", str(rough), str(neat)]) == 0
    assert rough.read_text() == neat.read_text() == NEAT
    assert rough.stat().st_mode & 0o777 == 0o640
    assert capsys.readouterr().out == f"{rough}: formatted\n"


def test_check_writes_nothing(tmp_path, capsys):
    scene = tmp_path / "scene.plsys"
    scene.write_text(ROUGH)
    assert main(["format", str(scene), "--check"]) == 1
    assert scene.read_text() == ROUGH
    scene.write_text(NEAT)
    assert main(["format", str(scene), "--check"]) == 0


def test_a_broken_definition_is_left_as_it_is(tmp_path, capsys):
    scene = tmp_path / "scene.plsys"
    scene.write_text(ROUGH + "Calculation D{n=;}\n")
    assert main(["format", str(scene)]) == 2
    assert scene.read_text() == NEAT + "Calculation D{n=;}\n"
    assert "error[missing]" in capsys.readouterr().err


def test_json(tmp_path, capsys):
    scene = tmp_path / "scene.plsys"
    scene.write_text(ROUGH)
    assert main(["format", str(scene), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"files": [{"path": str(scene), "changed": True, "errors": 0}]}


def test_an_unreadable_file(tmp_path, capsys):
    assert main(["format", str(tmp_path / "none.plsys")]) == 2
    assert "can't be read" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text, options, code, out, err",
    [
        (ROUGH, (), 0, NEAT, ""),
        (NEAT, (), 0, NEAT, ""),
        (ROUGH, ("--check",), 1, "<stdin>: would change\n", ""),
        (NEAT, ("--check",), 0, "", ""),
        (ROUGH + "Calculation D{n=;}\n", (), 2, NEAT + "Calculation D{n=;}\n", "<stdin>:2:16: error[missing]"),
        (ROUGH, ("other.plsys",), 2, "", "-: error: standard input goes to standard output, which has no room for other files"),
        (ROUGH, ("--json",), 2, "", "-: error: standard input goes to standard output, which has no room for --json"),
    ],
)
def test_standard_input_goes_to_standard_output(text, options, code, out, err):
    """As editors want a formatter."""
    command = [sys.executable, "-m", "plsys.compiler.cli", "format", "-", *options]
    done = subprocess.run(command, input=text.encode(), capture_output=True, timeout=60)
    assert done.returncode == code, done.stderr
    assert done.stdout.decode() == out or "--json" in options
    assert done.stderr.decode().startswith(err) and bool(err) == bool(done.stderr)
