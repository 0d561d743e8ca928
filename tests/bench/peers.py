"""The other programs, each as a process of its own with its time and peak memory; None where one isn't installed.

    >>> run(["povray", "+Itree.pov", …]).cpu
    0.31

Where a program is missing, MISSING says what to install; nothing is silently left out.
"""

from __future__ import annotations

import ctypes.util
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

HERE = Path(__file__).resolve().parent
MISSING: dict[str, str] = {}
PINNED = ("taskset", "-c", str(max(os.sched_getaffinity(0))))


@dataclass
class Run:
    """wall, cpu: seconds · rss: peak bytes · text, errors: what it printed."""

    wall: float
    cpu: float
    rss: int
    text: str
    errors: str


@cache
def launcher() -> subprocess.Popen:
    command = [sys.executable, "-S", "-E", str(HERE / "launcher.py")]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def on_one_core(pinned: bool) -> tuple[str, ...]:
    """What a pinned command begins with."""
    return PINNED if pinned and shutil.which("taskset") else ()


def run(command: list, text: str = "", pinned: bool = True, folder: Path | None = None) -> Run:
    """Runs a program, which reads a text, to its end. RuntimeError with its last words if it fails."""
    prefix = on_one_core(pinned)
    with tempfile.TemporaryDirectory() as place:
        given, said, complained = (Path(place) / name for name in ("in", "out", "err"))
        given.write_text(text)
        order = {
            "command": [*prefix, *map(str, command)],
            "stdin": str(given),
            "stdout": str(said),
            "stderr": str(complained),
            "folder": folder and str(folder),
        }
        print(json.dumps(order), file=launcher().stdin, flush=True)
        answer = json.loads(launcher().stdout.readline())
        text, errors = (path.read_text(errors="replace") for path in (said, complained))
    if answer["status"]:
        raise RuntimeError(
            f"{Path(order['command'][len(prefix)]).name} failed ({answer['status']}): {(text + errors)[-600:]}"
        )
    return Run(answer["wall"], answer["cpu"], answer["rss"], text, errors)


def plsys(*arguments: object, pinned: bool = False) -> Run:
    """The command as users run it, where it is installed beside this Python."""
    script = Path(sys.executable).with_name("plsys")
    command = [script] if script.exists() else [sys.executable, "-m", "plsys.compiler.cli"]
    return run([*command, *arguments], pinned=pinned)


# --- Embree ---


@cache
def embree_compiled(folder: Path) -> Path | None:
    program = folder / "embree"
    compiler = shutil.which("cc")
    done = compiler and subprocess.run(
        [compiler, "-O2", "-std=gnu11", "-o", program, HERE / "embree.c", "-ldl"],
        capture_output=True,
        text=True,
    )
    if not done or done.returncode:
        MISSING["embree"] = "Embree's header is missing: apt-get install libembree-dev"
        return None
    return program


@cache
def embree_libraries() -> dict[str, str]:
    """Version → library."""
    found = {}
    library = ctypes.util.find_library("embree3")
    if library:
        found["3.13"] = library
    else:
        MISSING["embree 3.13"] = "apt-get install libembree-dev"
    package = importlib.util.find_spec("embreex")
    if package:
        for path in Path(package.origin).parents[1].glob("embreex.libs/libembree4*"):
            found["4.4"] = str(path)
    if "4.4" not in found:
        MISSING["embree 4.4"] = "pip install embreex"
    return found


# --- POV-Ray ---


def povray(case, folder: Path, width: int = 640, height: int = 480, threads: int | None = 1) -> dict | None:
    """{"parse", "bounding", "trace": CPU-seconds, "wall", "cpu", "rss", "file_bytes"} for a case's export."""
    if not shutil.which("povray"):
        MISSING["povray"] = "apt-get install povray"
        return None
    scene = folder / "povray.pov"
    parameters = [x for name, value in case.parameters.items() for x in ("-D", f"{name}={value}")]
    plsys("export", case.path, "-o", scene, *parameters)
    command = [
        "povray",
        f"+I{scene}",
        f"+O{folder / 'povray.png'}",
        f"+W{width}",
        f"+H{height}",
        "-A",
        "-D",
        "+FN8",
    ]
    done = run([*command, *([f"+WT{threads}"] if threads else [])], pinned=threads == 1)
    # CPU-seconds: those of one thread and of several can be compared.
    seconds = {
        name.lower(): float(value)
        for name, value in re.findall(
            r"(Parse|Bounding|Trace) Time:.*\n.*?with ([\d.]+) CPU-seconds", done.text + done.errors
        )
    }
    return seconds | {"wall": done.wall, "cpu": done.cpu, "rss": done.rss, "file_bytes": scene.stat().st_size}
