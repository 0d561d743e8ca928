"""The vocabulary: its rows are whole, agree with the bytecode's table, and their examples compile."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from model_text import good
from plsys.compiler.reading import vocabulary
from plsys.compiler.reading.vocabulary import ALL, PROPERTIES, Interval

ROOT = Path(__file__).resolve().parents[3]
BYTECODE = tomllib.loads((ROOT / "runtime/bytecode.toml").read_text(encoding="utf-8"))


def test_generated_files_are_current():
    result = subprocess.run(
        [sys.executable, ROOT / "grammar/generate.py", "--check"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize("key", [key for key, row in ALL.items() if row.example])
def test_every_example_compiles(key):
    good(ALL[key].example)


def test_only_rows_that_need_another_file_lack_an_example():
    assert [key for key, row in ALL.items() if not row.example] == ["directive.include", "primitive.mesh"]


def test_examples_show_what_they_document():
    assert [key for key, row in ALL.items() if row.example and row.name not in row.example] == []


def test_the_bytecodes_rows_exist():
    rows = {row["row"] for table in ("opcode", "shape") for row in BYTECODE[table] if "row" in row}
    assert rows <= set(ALL)


def test_what_runs_has_its_row_in_the_bytecode():
    rows = {row["row"] for table in ("opcode", "shape") for row in BYTECODE[table] if "row" in row}
    needed = {key for key, row in ALL.items() if row.kind in ("function", "operation", "primitive")}
    assert needed - rows == {"primitive.mesh"}  # a node kind of its own


def test_properties_agree_with_the_records():
    records = {
        record["name"]: {value["name"]: value for value in record["values"]} for record in BYTECODE["record"]
    }
    blocks = {"camera": "camera", "light": "light_source", "settings": "global_settings", "texture": "finish"}
    for kind, block in blocks.items():
        for name, row in PROPERTIES[block].items():
            value = records[kind].get(name)
            if value is not None:
                assert value["default"] == row.default, (block, name)
                assert row.type in (
                    ("number", "integer", "flag") if value["size"] == 1 else ("vector", "colour")
                ), name
    assert set(records["camera"]) - set(PROPERTIES["camera"]) == {"has_look_at"}
    assert set(records["light"]) - set(PROPERTIES["light_source"]) == {"location"}
    assert set(records["texture"]) - set(PROPERTIES["finish"]) == {"pattern", "direction", "matrix"}


def test_patterns_and_steps_agree_with_the_bytecode():
    from plsys.compiler.reading.resolve_textures import PATTERNS

    assert {row["name"]: row["id"] for row in BYTECODE["pattern"]} == PATTERNS


def test_what_blocks_hold():
    """A row's words are rows themselves, and a scene is read as they say."""
    for name, row in vocabulary.BLOCKS.items():
        assert row.makes in ("object", "scene", "texture"), name
        assert set(row.holds) <= set(vocabulary.BLOCKS) and set(row.modifiers) <= set(vocabulary.MODIFIERS), name
        for modifier in row.modifiers:
            value = "<1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0>" if modifier == "matrix" else "<1, 2, 3>"
            inside = {"light_source": "<0, 0, 9> color rgb 1", "pigment": "checker", "texture": "pigment { checker }"}[name]
            block = f"{name} {{ {inside} {modifier} {value} }}"
            good(block if row.makes == "scene" else f"sphere {{ 0, 1 {block} }}")
    for name in vocabulary.OBJECT_BLOCKS:
        example = vocabulary.BLOCKS[name].example.rpartition("\n")[2]
        if name != "object":
            good(f"union {{ {example} }}")
            good(f"#declare Thing = {example}\nobject {{ Thing }}")


def test_intervals():
    interval = Interval.parse("(0, 180)")
    assert (0 in interval, 1 in interval, 180 in interval) == (False, True, False)
    assert str(interval) == "above 0 and below 180"
    assert str(Interval.parse("[0, inf)")) == "at least 0"


def test_unsupported_names_are_not_names_of_ours():
    ours = {row.name for row in ALL.values()}
    assert set(vocabulary.UNSUPPORTED) & ours == set()
    assert all(hint for hint in vocabulary.UNSUPPORTED.values())


def test_every_colour_is_linear_and_in_range():
    assert len(vocabulary.COLOURS) > 100
    assert all(
        len(parts) in (3, 5) and all(0 <= part <= 1 for part in parts)
        for parts in vocabulary.COLOURS.values()
    )
