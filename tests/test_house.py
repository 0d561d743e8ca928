"""The structure that ARCHITECTURE.md promises: arrows point one way, and generated files are what their tables give."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# Headers of the runtime by layer, lowest first: a header includes its own layer and those below. trace.h stands low because
# it is a contract only: rays and hits, which the derivation knows too.
LAYERS = [
    ["include/plsys.h", "bytecode.h", "affine.h", "array.h", "random.h", "elementary.h", "double_double.h", "circular.h", "error.h", "box.h", "table.h", "vector.h"],
    ["program.h", "reader.h", "expression.h", "derive_memo.h", "trace.h"],
    ["shapes/*.h"],
    ["derive.h", "state.h", "reach.h", "coverage.h", "coverage_rays.h", "cut.h", "interval.h", "hull.h", "class.h"],
    ["scene.h"],
    ["accel/*.h"],
    ["texture.h", "light.h", "camera.h", "shade.h", "shading.h", "quantise.h"],
    ["render.h", "antialias.h"],
]
SHADING = ["texture.c", "light.c", "camera.c", "shade.c", "shadow.c", "render.c", "antialias.c"]


def layer_of(path: Path) -> int | None:
    relative = path.relative_to(ROOT / "runtime")
    for index, patterns in enumerate(LAYERS):
        if any(relative.match(pattern) for pattern in patterns):
            return index
    return None


def includes(path: Path) -> list[Path]:
    """The project's headers that a C file includes."""
    found = []
    for name in re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(), re.MULTILINE):
        for folder in (path.parent, ROOT / "runtime", ROOT / "runtime" / "include"):
            if (folder / name).is_file():
                found.append((folder / name).resolve())
                break
        else:
            pytest.fail(f"{path.relative_to(ROOT)} includes {name}, which doesn't exist")
    return found


def test_python_imports_point_one_way():
    result = subprocess.run(
        [str(Path(sys.executable).with_name("lint-imports")), "--config", str(ROOT / "pyproject.toml")],
        cwd=ROOT, capture_output=True, text=True,
    )
    assert result.returncode == 0, result.stdout[-3000:]


def test_every_header_has_a_layer():
    headers = sorted((ROOT / "runtime").rglob("*.h"))
    assert headers
    assert [str(h.relative_to(ROOT)) for h in headers if layer_of(h) is None] == []


def test_c_includes_point_one_way():
    wrong = []
    for path in sorted((ROOT / "runtime").rglob("*.h")):
        for header in includes(path):
            if layer_of(header) > layer_of(path):
                wrong.append(f"{path.relative_to(ROOT)} includes {header.relative_to(ROOT)}")
    assert wrong == []


def test_shading_sees_the_scene_through_trace_h_only():
    hidden = {ROOT / "runtime" / name for name in ("program.h", "expression.h", "derive.h", "state.h")}
    hidden |= set((ROOT / "runtime").glob("accel/*.h")) | set((ROOT / "runtime").glob("shapes/*.h"))
    for name in SHADING:
        path = ROOT / "runtime" / name
        assert path.is_file(), name
        assert hidden.isdisjoint(includes(path)), name


def test_the_runtime_uses_libc_libm_and_threads_only():
    allowed = re.compile(r"^(std\w+|string|math|float|limits|inttypes|errno|fcntl|pthread|time|unistd|assert|ctype|fenv|sched|immintrin|sys/\w+|locale|signal)\.h$")
    for path in (ROOT / "runtime").rglob("*.[ch]"):
        for name in re.findall(r"^\s*#\s*include\s+<([^>]+)>", path.read_text(), re.MULTILINE):
            assert allowed.match(name), f"{path.relative_to(ROOT)} includes <{name}>"


@pytest.mark.parametrize("generator", ["runtime/generate.py", "grammar/generate.py"])
def test_generated_files_are_current(generator):
    result = subprocess.run([sys.executable, str(ROOT / generator), "--check"], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr


def test_no_file_is_too_long():
    """Python near 350 lines, C near 500: a longer file is two rooms."""
    generated = {"vocabulary_rows.py", "layout_rows.py"}
    limits = {".py": 450, ".c": 650, ".h": 500}
    files = [p for folder in ("compiler", "runtime", "grammar") for p in (ROOT / folder).rglob("*") if p.suffix in limits]
    long = [
        f"{p.relative_to(ROOT)}: {count}"
        for p in files
        if p.name not in generated and "src" not in p.parts and p.name != "bytecode.h"
        and (count := len(p.read_text().splitlines())) > limits[p.suffix]
    ]
    assert long == []
