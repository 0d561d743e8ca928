"""A new primitive is one row in each table, one C file, one mesher and a test. What is forgotten is named here."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from plsys.compiler.export.intersect import ROOTS
from plsys.compiler.export.meshers import MESHERS
from plsys.compiler.export.povray_text import WRITERS

import oracle

ROOT = Path(__file__).resolve().parent.parent
VOCABULARY = tomllib.loads((ROOT / "grammar/vocabulary.toml").read_text(encoding="utf-8"))["primitive"]
SHAPES = {row["name"]: row for row in tomllib.loads((ROOT / "runtime/bytecode.toml").read_text(encoding="utf-8"))["shape"]}
UNIT_SHAPES = sorted(set(VOCABULARY) - {"mesh"})  # a mesh is a node of its own


def missing(name: str) -> list[str]:
    """What the primitive lacks, in words that say what to write and where."""
    tests = [(ROOT / "tests/runtime/shapes/test_shapes.c").read_text(), (ROOT / "tests/compiler/export/test_povray.py").read_text()]
    shape = (ROOT / "runtime/shapes/shape.c").read_text()
    row = SHAPES.get(name)
    needed = {
        f"a [primitive.{name}] row in grammar/vocabulary.toml": name in VOCABULARY,
        f"a [[shape]] row in runtime/bytecode.toml with row = \"primitive.{name}\"": row is not None
        and row["row"] == f"primitive.{name}",
        f"runtime/shapes/{name}.c: bounds, hit, normal": (ROOT / f"runtime/shapes/{name}.c").is_file(),
        f"a case PL_SHAPE_{name.upper()} in runtime/shapes/shape.c": f"case PL_SHAPE_{name.upper()}:" in shape,
        f"a mesher MESHERS[\"{name}\"] in compiler/export/meshers.py": name in MESHERS,
        "a POV-Ray form in WRITERS in compiler/export/povray_text.py": row is not None and row["id"] in WRITERS,
        f"ROOTS[\"{name}\"] in compiler/export/intersect.py, which checks hits in higher precision": name in ROOTS,
        f"ROOTS[\"{name}\"] in tests/oracle.py": name in oracle.ROOTS,
        "a test in tests/runtime/shapes/test_shapes.c": f"PL_SHAPE_{name.upper()}" in tests[0],
        "its place in tests/compiler/export/test_povray.py, where POV-Ray draws it too": bool(re.search(rf"\b{name}\b", tests[1])),
    }
    return [what for what, there in needed.items() if not there]


@pytest.mark.parametrize("name", sorted({*UNIT_SHAPES, *SHAPES} - {"plane"}))  # a plane is a scene block only
def test_a_primitive_is_whole(name):
    assert not missing(name), f"the primitive '{name}' still needs: " + "; ".join(missing(name))


def test_a_forgotten_part_is_named():
    lacking = missing("pyramid")
    assert any("runtime/shapes/pyramid.c" in what for what in lacking)
    assert any("MESHERS" in what for what in lacking) and len(lacking) == 10


def test_meshers_and_c_files_belong_to_primitives():
    files = {path.stem for path in (ROOT / "runtime/shapes").glob("*.c")} - {"shape", "mesh", "plane"}
    assert files == set(MESHERS) == set(UNIT_SHAPES)
