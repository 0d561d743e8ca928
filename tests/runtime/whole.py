"""Building C tests against the whole runtime: plain, with the address and undefined-behaviour sanitizers, or with the
thread sanitizer. The runtime is compiled once a variant and session.

    >>> done = run(program("shapes/test_shapes.c", "sanitized"))
    >>> assert done.returncode == 0, done.stdout + done.stderr
"""

from __future__ import annotations

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

HERE = Path(__file__).resolve().parent
RUNTIME = HERE.parents[1] / "runtime"
FLAGS = ["-std=gnu11", "-g", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-ffp-contract=off", "-fno-math-errno"]
FLAGS += [f"-I{RUNTIME}", f"-I{RUNTIME / 'include'}", f"-I{HERE}"]
# Under sanitizers steps are slow, so rays that would never end come to their limit sooner.
FEW_STEPS = ["-DPL_LIMIT_RAY_STEPS=(UINT64_C(1)<<13)", "-DPL_LIMIT_WALK_STEPS=(UINT64_C(1)<<24)",
             "-DPL_LIMIT_UNFOLD_STEPS=(UINT64_C(1)<<18)"]
VARIANTS = {
    "plain": ["-O2"],
    "sanitized": ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", *FEW_STEPS],
    "threads": ["-O1", "-fsanitize=thread"],
}


@cache
def archive(variant: str) -> Path:
    """The whole runtime as a static library."""
    folder = Path(mkdtemp(prefix="plsys-runtime-"))
    sources = sorted(path for pattern in ("*.c", "shapes/*.c", "accel/*.c") for path in RUNTIME.glob(pattern))
    objects = [folder / ("_".join(source.relative_to(RUNTIME).parts) + ".o") for source in sources]

    def compile_one(pair: tuple[Path, Path]) -> None:
        _checked(["cc", *FLAGS, *VARIANTS[variant], "-c", "-o", pair[1], pair[0]])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compile_one, zip(sources, objects)))
    _checked(["ar", "rc", folder / "libplsys.a", *objects])
    return folder / "libplsys.a"


@cache
def program(source: str, variant: str) -> Path:
    """The program of tests/runtime/<source>, or of an absolute path, linked with the runtime."""
    path = Path(mkdtemp(prefix="plsys-test-")) / Path(source).stem
    _checked(["cc", *FLAGS, *VARIANTS[variant], "-o", path, HERE / source, archive(variant), "-lm", "-lpthread"])
    return path


def run(program: Path, *arguments: object) -> subprocess.CompletedProcess:
    """Output and exit code; a sanitizer's finding is exit code 99."""
    options = {"ASAN_OPTIONS": "exitcode=99:detect_leaks=1", "TSAN_OPTIONS": "exitcode=99"}
    return subprocess.run(
        [str(program), *map(str, arguments)], capture_output=True, text=True, env={**os.environ, **options}
    )


def _checked(command: list) -> None:
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
