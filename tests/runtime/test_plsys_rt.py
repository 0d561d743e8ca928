"""plsys-rt, the stand-alone renderer: pictures, --dump, and one clear message for bad input."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import whole
from assembly import one_of_everything

from plsys.compiler import compile
from plsys.runtime import Scene, disassemble

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def plsys_rt() -> Path:
    return whole.program(str(whole.RUNTIME / "tools" / "plsys-rt.c"), "sanitized")


@pytest.fixture
def tree(tmp_path) -> Path:
    path = tmp_path / "tree.plsb"
    path.write_bytes(compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 4}))
    return path


def read_pfm(path: Path) -> np.ndarray:
    """Rows from the top down."""
    kind, size, scale, pixels = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert kind == b"PF" and scale == (b"-1.0" if struct.pack("=H", 1) == b"\1\0" else b"1.0")
    return np.frombuffer(pixels, np.float32).reshape(height, width, 3)[::-1]


@pytest.mark.parametrize("accelerator", ["auto", "none", "boxes", "bvh", "grid"])
def test_the_picture_is_the_binding_s(plsys_rt, tree, tmp_path, accelerator):
    output = tmp_path / "tree.pfm"
    done = whole.run(plsys_rt, tree, "-o", output, "--size", "40x30", "--threads", 2, "--accel", accelerator)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    with Scene(tree.read_bytes()) as scene:
        np.testing.assert_array_equal(read_pfm(output), scene.render(40, 30)["color"])


def test_antialiasing_is_the_binding_s(plsys_rt, tree, tmp_path):
    output = tmp_path / "tree.pfm"
    assert whole.run(plsys_rt, tree, "-o", output, "--size", "20x15", "--antialias", "grid=2").returncode == 0
    with Scene(tree.read_bytes()) as scene:
        expected = scene.render(20, 15, antialias="grid", samples=2)["color"]
    np.testing.assert_array_equal(read_pfm(output), expected)


@pytest.mark.parametrize("name, detail", [("tree", "0"), ("tree", "6.5"), ("fern_endless", "0"), ("fern_endless", "3")])
def test_the_detail_cut_off_is_the_binding_s(plsys_rt, tmp_path, name, detail):
    path, output = tmp_path / "scene.plsb", tmp_path / "scene.pfm"
    path.write_bytes(compile(ROOT / "scenes" / f"{name}.plsys"))
    done = whole.run(plsys_rt, path, "-o", output, "--size", "64x48", "--detail", detail)
    assert (done.returncode, done.stderr) == (0, "")
    with Scene(path.read_bytes(), detail=float(detail)) as scene:
        expected = scene.render(64, 48)["color"]
        assert scene.statistics["cut"]["instances"] > 0 or detail == "0"
    np.testing.assert_array_equal(read_pfm(output), expected)


def test_dump_prints_the_disassembly(plsys_rt, tmp_path):
    path = tmp_path / "all.plsb"
    path.write_bytes(one_of_everything().bytes())
    done = whole.run(plsys_rt, path, "--dump")
    assert done.returncode == 0 and done.stdout == disassemble(path.read_bytes())


@pytest.mark.parametrize(
    "arguments, message",
    [
        ([], "no scene given"),
        (["tree.plsb"], "no picture given"),
        (["tree.plsb", "-o"], "-o needs a value"),
        (["tree.plsb", "-o", "x.pfm", "--size", "640"], "--size 640: expected WxH, such as 640x480"),
        (["tree.plsb", "-o", "x.pfm", "--size", "0x5"], "--size 0x5: expected WxH"),
        (["tree.plsb", "-o", "x.pfm", "--threads", "many"], "--threads many: expected a number from 1 to 1024"),
        (["tree.plsb", "-o", "x.pfm", "--accel", "kd"], "--accel kd: expected auto, none, boxes, grid or bvh"),
        (["tree.plsb", "-o", "x.pfm", "--grid", "16x16"], "--grid 16x16: expected NxMxK"),
        (["tree.plsb", "-o", "x.pfm", "--detail", "fine"], "--detail fine: expected a number of pixels, 0 or more"),
        (["tree.plsb", "-o", "x.pfm", "--detail", "-1"], "--detail -1: expected a number of pixels, 0 or more"),
        (["tree.plsb", "-o", "x.pfm", "--colour", "red"], "no option '--colour'"),
        (["tree.plsb", "other.plsb", "-o", "x.pfm"], "one scene at a time"),
        (["missing.plsb", "-o", "x.pfm"], "missing.plsb can't be read: No such file or directory"),
        (["tree.plsb", "-o", "no/where/x.pfm"], "no/where/x.pfm can't be written: No such file or directory"),
    ],
)
def test_bad_arguments_get_one_message(plsys_rt, tree, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    done = whole.run(plsys_rt, *arguments)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(f"plsys-rt: error: {message}") and done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["tree.plsb"]


def test_damaged_bytecode_leaves_no_file(plsys_rt, tree, tmp_path):
    data = bytearray(tree.read_bytes())
    data[60] ^= 4
    tree.write_bytes(data)
    done = whole.run(plsys_rt, tree, "-o", tmp_path / "x.pfm")
    assert done.returncode == 2 and done.stderr.startswith(f"{tree}: error: ") and done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["tree.plsb"]


def test_a_device_stays_what_it_is(plsys_rt, tree, tmp_path):
    """No file takes its place, and what can't be written to it is an error: that of a full one."""
    full = tmp_path / "full"
    full.symlink_to("/dev/full")
    done = whole.run(plsys_rt, tree, "-o", full, "--size", "4x3")
    assert done.returncode == 2 and done.stderr == f"plsys-rt: error: {full} can't be written: No space left on device\n"
    assert full.is_char_device()


def test_a_pipe_gets_the_picture(plsys_rt, tree, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE)
    done = whole.run(plsys_rt, tree, "-o", pipe, "--size", "4x3")
    assert (done.returncode, done.stderr) == (0, "") and pipe.is_fifo()
    assert reader.communicate()[0].startswith(b"PF\n4 3\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_picture_that_is_broken_off_leaves_no_file(plsys_rt, tree, tmp_path, number):
    command = [plsys_rt, tree, "-o", tmp_path / "x.pfm", "--size", "8000x8000", "--antialias", "grid=9"]
    # What ignores a signal hands that on, as shells do to what they put in the background.
    drawing = subprocess.Popen(command, preexec_fn=lambda: signal.signal(number, signal.SIG_DFL))
    while drawing.poll() is None and len(list(tmp_path.iterdir())) < 2:
        time.sleep(0.01)
    drawing.send_signal(number)
    assert drawing.wait() == -number
    assert [path.name for path in tmp_path.iterdir()] == ["tree.plsb"]


def test_help_explains(plsys_rt):
    done = whole.run(plsys_rt, "--help")
    assert done.returncode == 0 and "--accel A" in done.stdout
