"""Building C tests: the runtime's files and a test's own file → a program, plain or with sanitizers.

Example: ``probe("load", "scene.plsb").stdout == "ok\\n"``.
"""

from __future__ import annotations

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

ROOT = Path(__file__).resolve().parents[2]
RUNTIME = ROOT / "runtime"
INCLUDES = (f"-I{RUNTIME}", f"-I{RUNTIME / 'include'}")
FLAGS = ("-std=gnu11", "-g", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", *INCLUDES)
VARIANTS = {
    "plain": ("-O2",),
    "sanitized": ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
}
EVERYTHING = tuple(
    sorted(str(path.relative_to(RUNTIME)) for path in RUNTIME.rglob("*.c") if path.parent.name != "tools")
)
LOWER = tuple(
    f"{name}.c"
    for name in (
        *("error", "reach", "reader", "load", "load_nodes", "load_records", "table", "verify"),
        *("expression", "elementary", "dump"),
    )
)
"""What loading, running code and disassembling take."""


def compile_c(*arguments: str) -> None:
    done = subprocess.run(["cc", *FLAGS, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@cache
def folder(variant: str) -> Path:
    """Where a session's objects and programs are."""
    return Path(mkdtemp(prefix=f"plsys-{variant}-"))


@cache
def object_file(name: str, variant: str) -> str:
    """runtime/<name>, compiled once a session."""
    target = folder(variant) / (name.replace("/", "_") + ".o")
    compile_c(*VARIANTS[variant], "-c", "-o", str(target), str(RUNTIME / name))
    return str(target)


@cache
def build(source: str, variant: str, files: tuple[str, ...] = EVERYTHING) -> Path:
    """The program of tests/runtime/<source> and these files of the runtime."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = list(pool.map(lambda name: object_file(name, variant), files))
    program = folder(variant) / Path(source).stem
    compile_c(
        *VARIANTS[variant],
        "-o",
        str(program),
        str(Path(__file__).with_name(source)),
        *objects,
        "-lm",
        "-lpthread",
    )
    return program


def run(program: Path, *arguments: object) -> subprocess.CompletedProcess:
    """Output and exit code; a sanitizer's finding is exit code 99."""
    return subprocess.run(
        [str(program), *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, "ASAN_OPTIONS": "exitcode=99:detect_leaks=1:allocator_may_return_null=1"},
    )


def probe(*arguments: object) -> subprocess.CompletedProcess:
    """Runs probe.c under sanitizers."""
    return run(build("probe.c", "sanitized", LOWER), *arguments)
