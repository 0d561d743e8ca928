"""bytecode.toml: its rows match the vocabulary, its mistakes are found, the generated files say the same."""

import importlib.util
import tomllib
from pathlib import Path

import pytest
from plsys.compiler.bytecode import layout_rows

ROOT = Path(__file__).resolve().parents[2]
TABLE = tomllib.loads((ROOT / "runtime" / "bytecode.toml").read_text())
VOCABULARY = tomllib.loads((ROOT / "grammar" / "vocabulary.toml").read_text())
ROWS = [(row["row"], row) for kind in ("opcode", "shape") for row in TABLE[kind] if "row" in row]


def load_generator():
    spec = importlib.util.spec_from_file_location("generate_bytecode", ROOT / "runtime" / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def vocabulary_row(name: str) -> dict | None:
    row = VOCABULARY
    for part in name.split("."):
        row = row.get(part, {})
    return row or None


def numbers_allowed(arity) -> range:
    """What `arity` allows: one number, several, or [least, most]."""
    numbers = arity if isinstance(arity, list) else [arity]
    return range(min(numbers), max(numbers) + 1)


@pytest.mark.parametrize(("name", "row"), ROWS, ids=[name for name, _ in ROWS])
def test_a_row_refers_to_one_of_the_vocabulary(name, row):
    assert vocabulary_row(name) is not None


@pytest.mark.parametrize("name", [n for n, row in ROWS if n.startswith(("function.", "operation."))])
def test_an_opcode_takes_as_many_arguments_as_the_vocabulary_says(name):
    row = next(row for n, row in ROWS if n == name and row["name"] != "scale_uniform")
    allowed = numbers_allowed(vocabulary_row(name)["arity"])
    if row["pops"] < 0:
        assert max(allowed) == TABLE["limits"]["hash_arguments"]
    else:
        assert row["pops"] in allowed


@pytest.mark.parametrize("kind", ["function", "operation", "primitive"])
def test_every_function_operation_and_primitive_is_carried_out(kind):
    carried_out = {name for name, _ in ROWS}
    elsewhere = {"primitive.mesh"}  # a node of its own
    assert {f"{kind}.{name}" for name in VOCABULARY[kind]} - carried_out - elsewhere == set()


def test_the_rows_say_what_the_table_says():
    for row in TABLE["opcode"]:
        found = layout_rows.OPCODES[row["name"]]
        assert (found.id, found.pops, found.pushes, found.row) == (
            row["id"],
            row["pops"],
            row["pushes"],
            row.get("row", ""),
        )
    for row in TABLE["node"]:
        assert [f"{name}: {kind}" for name, kind in layout_rows.NODES[row["name"]].fields] == row["fields"]
    texture = layout_rows.RECORDS["texture"]
    assert texture.values["matrix"].default == (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)
    assert texture.size == sum(value["size"] for value in TABLE["record"][3]["values"])


def changed(kind: str, index: int, **fields) -> dict:
    rows = [dict(row) for row in TABLE[kind]]
    rows[index] |= fields
    return {**TABLE, kind: rows}


def test_mistakes_in_the_table_are_found():
    generate = load_generator()
    with pytest.raises(ValueError, match="two opcode rows have the same id"):
        generate.check_ids(changed("opcode", 3, id=TABLE["opcode"][4]["id"]))
    with pytest.raises(ValueError, match="field name has the unknown type 'text'"):
        generate.header(changed("node", 1, fields=["name: text"]))
    with pytest.raises(ValueError, match="at most one operand"):
        generate.header(changed("opcode", 1, operands=["u", "u"]))
    with pytest.raises(ValueError, match="location has 2 defaults, not 3"):
        generate.header(changed("record", 1, values=[{"name": "location", "size": 3, "default": [0, 1]}]))
