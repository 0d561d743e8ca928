"""Building C tests: the runtime's lower half and a test's own file → a program, plain or with sanitizers."""

from __future__ import annotations

import os
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

ROOT = Path(__file__).resolve().parents[2]
RUNTIME = ROOT / "runtime"
LOWER = ("error", "reader", "load", "load_nodes", "load_records", "table", "verify", "expression", "elementary", "dump")
FLAGS = ("-std=gnu11", "-g", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", f"-I{RUNTIME}", f"-I{RUNTIME / 'include'}")
VARIANTS = {"plain": ("-O2",), "sanitized": ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")}


@cache
def build(source: str, variant: str) -> Path:
    """The program of tests/runtime/<source>, built once a session."""
    program = Path(mkdtemp(prefix="plsys-test-")) / Path(source).stem
    files = [str(RUNTIME / f"{name}.c") for name in LOWER]
    command = ["cc", *FLAGS, *VARIANTS[variant], "-o", str(program), str(Path(__file__).with_name(source)), *files, "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return program


def run(program: Path, *arguments: object) -> subprocess.CompletedProcess:
    """Output and exit code; a sanitizer's finding is an exit code above 2."""
    return subprocess.run(
        [str(program), *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, "ASAN_OPTIONS": "exitcode=99:detect_leaks=1:allocator_may_return_null=1"},
    )
