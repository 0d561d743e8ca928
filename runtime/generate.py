"""Writes what bytecode.toml says in C and in Python: runtime/bytecode.toml → runtime/bytecode.h and
compiler/bytecode/layout_rows.py.

    python runtime/generate.py            writes both files
    python runtime/generate.py --check    writes nothing; exit code 1 and a message if one is out of date

Nothing else reads bytecode.toml: the runtime includes the header, the compiler imports the rows.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "runtime" / "bytecode.toml"
HEADER = ROOT / "runtime" / "bytecode.h"
ROWS = ROOT / "compiler" / "bytecode" / "layout_rows.py"

# How many 32-bit words a node's field takes in memory, by type, and the suffixes of their names: a list is
# the index of its first element in a pool of the program, and a count.
FIELD_WORDS = {"nodes": ("_first", "_count"), "slots": ("_first", "_count"), "cases": ("_first", "_count")}
FIELD_TYPES = ("node", "nodes", "code", "string", "slots", "record", "mesh", "shape", "u", "matrix", "cases")
OPERANDS = ("u", "slot", "constant", "string", "offset")
C_KEYWORDS = ("union",)


def fields_of(node: dict) -> list[tuple[str, str]]:
    """The (name, type) of a node row's fields; ValueError for a type that the format doesn't have."""
    pairs = [tuple(text.split(": ")) for text in node["fields"]]
    for name, kind in pairs:
        if kind not in FIELD_TYPES:
            raise ValueError(f"node {node['name']}: field {name} has the unknown type {kind!r}")
    return pairs


def words_of(node: dict) -> list[str]:
    """The names of the 32-bit words that a node's fields take in memory."""
    return [name + suffix for name, kind in fields_of(node) for suffix in FIELD_WORDS.get(kind, ("",))]


def operand_of(opcode: dict) -> str:
    """'' or the type of an opcode's operand; no opcode has two."""
    operands = opcode.get("operands", [])
    if len(operands) > 1 or any(operand not in OPERANDS for operand in operands):
        raise ValueError(f"opcode {opcode['name']}: at most one operand of {', '.join(OPERANDS)}")
    return operands[0] if operands else ""


def values_of(record: dict) -> list[tuple[str, int, int, tuple[float, ...]]]:
    """(name, offset, size, default) of each value of a record, the default written out."""
    rows, offset = [], 0
    for value in record["values"]:
        size, default = value["size"], value["default"]
        numbers = tuple(map(float, default if isinstance(default, list) else [default] * size))
        if len(numbers) != size:
            raise ValueError(
                f"record {record['name']}: {value['name']} has {len(numbers)} defaults, not {size}"
            )
        rows.append((value["name"], offset, size, numbers))
        offset += size
    return rows


def numbers_of(random: dict) -> list[tuple[str, int]]:
    """The constants of the random functions; what else stands there are test vectors."""
    return [(name, value) for name, value in random.items() if isinstance(value, int)]


def check_ids(table: dict) -> None:
    """ValueError if two rows of one kind share an id or a name."""
    for kind in ("section", "node", "opcode", "shape", "record", "pattern"):
        for key in ("id", "name"):
            seen = [row[key] for row in table[kind]]
            if len(set(seen)) != len(seen):
                raise ValueError(f"two {kind} rows have the same {key}")


# --- C ---


def c_enum(prefix: str, rows: list[dict], comment: str) -> list[str]:
    members = [f"    PL_{prefix}_{row['name'].upper()} = {row['id']}," for row in rows]
    return [f"/* {comment} */", f"enum pl_{prefix.lower()}_id {{", *members, "};", ""]


def c_table(name: str, comment: str, rows: list[str]) -> list[str]:
    """An X-macro: name(X) expands to X(row) for each row."""
    lines = [f"/* {comment} */", f"#define {name}(X) \\"]
    return lines + [f"    X({row}) \\" for row in rows[:-1]] + [f"    X({rows[-1]})", ""]


def c_nodes(table: dict) -> list[str]:
    """The node kinds, their fields' types, and the union that holds a node's fields in memory."""
    nodes = table["node"]
    structs = []
    for node in nodes:
        if words := words_of(node):
            member = node["name"] + ("_" if node["name"] in C_KEYWORDS else "")
            structs.append(f"    struct {{ uint32_t {', '.join(words)}; }} {member};")
    firsts = {node["name"]: sum(len(fields_of(n)) for n in nodes[:i]) for i, node in enumerate(nodes)}
    field_rows = [
        f'{node["name"].upper()}, "{name}", PL_FIELD_{kind.upper()}'
        for node in nodes
        for name, kind in fields_of(node)
    ]
    return [
        *c_enum("NODE", nodes, "Node kinds."),
        *c_table(
            "PL_NODES",
            "Node kinds: X(ENUM, name, id, letter in pictures, first field in PL_NODE_FIELDS, fields).",
            [
                f'{row["name"].upper()}, "{row["name"]}", {row["id"]}, "{row["letter"]}", '
                f"{firsts[row['name']]}, {len(fields_of(row))}"
                for row in nodes
            ],
        ),
        "/* Types of node fields. */",
        "enum pl_field_id {",
        *(f"    PL_FIELD_{kind.upper()}," for kind in FIELD_TYPES),
        "};",
        "",
        *c_table("PL_NODE_FIELDS", "Fields of nodes in file order: X(NODE, name, type).", field_rows),
        "/* A node's fields in memory. A list is the index of its first element in a pool and a count.",
        " * `words` are the same numbers in file order; a list takes two of them, every other field one. */",
        f"enum {{ PL_NODE_WORDS = {max(len(words_of(node)) for node in nodes)} }};",
        "typedef union pl_node_fields {",
        "    uint32_t words[PL_NODE_WORDS];",
        *structs,
        "} pl_node_fields;",
        "",
    ]


def c_opcodes(table: dict) -> list[str]:
    rows = [
        f'{row["name"].upper()}, "{row["name"]}", {row["id"]}, '
        f"PL_OPERAND_{(operand_of(row) or 'none').upper()}, {row['pops']}, {row['pushes']}"
        for row in table["opcode"]
    ]
    return [
        *c_enum("OP", table["opcode"], "Opcodes."),
        "/* Types of operands. */",
        "enum pl_operand_id {",
        *(f"    PL_OPERAND_{kind.upper()}," for kind in ("none", *OPERANDS)),
        "};",
        "",
        *c_table(
            "PL_OPCODES",
            "Opcodes: X(ENUM, name, id, operand, pops, pushes); pops is -1 where the operand says how many.",
            rows,
        ),
    ]


def c_records(table: dict) -> list[str]:
    lines = c_enum("RECORD", table["record"], "Record kinds.")
    for record in table["record"]:
        prefix, rows = f"PL_{record['name'].upper()}", values_of(record)
        lines += [f"/* Offsets of the values of a {record['name']} record. */", "enum {"]
        lines += [f"    {prefix}_{name.upper()} = {offset}, /* {size} */" for name, offset, size, _ in rows]
        lines += [f"    {prefix}_VALUES = {rows[-1][1] + rows[-1][2]},"]
        for i, name in enumerate(record.get("entry", [])):
            lines += [f"    {prefix}_ENTRY_{name.upper()} = {i}, /* in an entry */"]
        lines += [f"    {prefix}_ENTRY = {len(record.get('entry', []))} /* numbers an entry */", "};"]
        lines += [f"#define {prefix}_DEFAULTS \\", "    { \\"]
        lines += [f"        {', '.join(map(repr, default))}, \\" for _, _, _, default in rows]
        lines += ["    }", ""]
    names = [row["name"].upper() for row in table["record"]]
    rows = [f'{name}, "{name.lower()}", PL_{name}_VALUES, PL_{name}_ENTRY' for name in names]
    lines += c_table("PL_RECORDS", "Records: X(ENUM, name, numbers, numbers an entry).", rows)
    rows = [
        f'{record["name"].upper()}, "{name}", {offset}, {size}'
        for record in table["record"]
        for name, offset, size, _ in values_of(record)
    ]
    lines += c_table("PL_RECORD_FIELDS", "Values of records: X(RECORD, name, offset, size).", rows)
    rows = [
        f'{record["name"].upper()}, "{name}", {i}'
        for record in table["record"]
        for i, name in enumerate(record.get("entry", []))
    ]
    return lines + c_table(
        "PL_RECORD_ENTRIES", "Numbers of an entry: X(RECORD, name, offset in the entry).", rows
    )


def c_shapes(table: dict) -> list[str]:
    rows = [
        f'{row["name"].upper()}, "{row["name"]}", {row["id"]}, {len(row["arguments"])}, '
        f"{str(row.get('unbounded', False)).lower()}"
        for row in table["shape"]
    ]
    most = max(len(row["arguments"]) for row in table["shape"])
    return [
        *c_enum("SHAPE", table["shape"], "Shapes."),
        f"enum {{ PL_SHAPE_ARGUMENTS = {most} }}; /* most that one has */",
        "",
        *c_table("PL_SHAPES", "Shapes: X(ENUM, name, id, arguments, unbounded).", rows),
    ]


def header(table: dict) -> str:
    """The text of runtime/bytecode.h."""
    random, limits = table["random"], table["limits"]
    lines = [
        "/* bytecode.h - the bytecode's sections, nodes, opcodes, shapes and records.",
        " *",
        " * Generated from bytecode.toml by generate.py, which documents every row: don't edit. */",
        "#ifndef PL_BYTECODE_H",
        "#define PL_BYTECODE_H",
        "",
        "#include <stdbool.h>",
        "#include <stdint.h>",
        "",
        f"#define PL_VERSION {table['version']}",
        f'#define PL_MAGIC "{table["magic"]}"',
        f"#define PL_SENTINEL_FLOAT {table['sentinel_float']!r}",
        f"#define PL_SENTINEL_INTEGER {table['sentinel_integer']:#010x}u",
        "",
        "/* Limits. */",
        "enum {",
        *(f"    PL_LIMIT_{name.upper()} = {value}," for name, value in limits.items()),
        "};",
        "",
        "/* Constants of the random functions (random.h). */",
        *(f"#define PL_RANDOM_{name.upper()} UINT64_C(0x{value:016X})" for name, value in numbers_of(random)),
        "",
        *c_enum("SECTION", table["section"], "Sections, in file order."),
        *c_table(
            "PL_SECTIONS",
            "Sections in file order: X(ENUM, name, id).",
            [f'{row["name"].upper()}, "{row["name"]}", {row["id"]}' for row in table["section"]],
        ),
        *c_nodes(table),
        *c_opcodes(table),
        *c_shapes(table),
        *c_enum("PATTERN", table["pattern"], "Values of a texture's `pattern`."),
        *c_table(
            "PL_PATTERNS",
            "Patterns: X(ENUM, name, id).",
            [f'{row["name"].upper()}, "{row["name"]}", {row["id"]}' for row in table["pattern"]],
        ),
        *c_records(table),
        "#endif",
    ]
    return "\n".join(lines) + "\n"


# --- Python ---

PYTHON_HEAD = '''"""The bytecode's sections, nodes, opcodes, shapes and records as plain rows by name, in the order of ids.

Generated from runtime/bytecode.toml by runtime/generate.py, which documents every row: don't edit.

Example: ``OPCODES["pow"]`` is ``Opcode("pow", 39, "", 2, 1, "function.pow")``.
"""

from __future__ import annotations

from typing import NamedTuple


class NodeRow(NamedTuple):
    name: str
    id: int
    letter: str  # in pictures of the graph
    fields: tuple[tuple[str, str], ...]  # (name, type) in file order


class Opcode(NamedTuple):
    name: str
    id: int
    operand: str  # '' u slot constant string offset
    pops: int  # -1: as many as the operand says
    pushes: int
    row: str  # of grammar/vocabulary.toml, or ''


class ShapeRow(NamedTuple):
    name: str
    id: int
    arguments: tuple[str, ...]
    unbounded: bool
    row: str


class Value(NamedTuple):
    name: str
    offset: int  # of its first number in the record
    size: int  # numbers
    default: tuple[float, ...]


class RecordRow(NamedTuple):
    name: str
    id: int
    size: int  # numbers without entries
    values: dict[str, Value]
    entry: tuple[str, ...]  # names of an entry's numbers (defaults are 0), or ()

'''


def literal(name: str, rows: dict[str, str]) -> list[str]:
    return ["", f"{name} = {{", *(f'    "{key}": {value},' for key, value in rows.items()), "}"]


def text(value: object) -> str:
    """A Python literal with double quotes, tuples for lists."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, (list, tuple)):
        return "(" + ", ".join(map(text, value)) + ("," if len(value) == 1 else "") + ")"
    return repr(value)


def call(kind: str, *values: object) -> str:
    return f"{kind}({', '.join(map(text, values))})"


def python_records(table: dict) -> list[str]:
    lines = ["", "RECORDS = {"]
    for record in table["record"]:
        rows = values_of(record)
        size = rows[-1][1] + rows[-1][2]
        lines += [f'    "{record["name"]}": RecordRow(', f'        "{record["name"]}",']
        lines += [f"        {record['id']},", f"        {size},", "        {"]
        lines += [f'            "{row[0]}": {call("Value", *row)},' for row in rows]
        lines += ["        },", f"        {text(record.get('entry', []))},", "    ),"]
    return [*lines, "}"]


def python_rows(table: dict) -> str:
    """The text of compiler/bytecode/layout_rows.py."""
    nodes = {r["name"]: call("NodeRow", r["name"], r["id"], r["letter"], fields_of(r)) for r in table["node"]}
    opcodes = {
        r["name"]: call("Opcode", r["name"], r["id"], operand_of(r), r["pops"], r["pushes"], r.get("row", ""))
        for r in table["opcode"]
    }
    shapes = {
        r["name"]: call("ShapeRow", r["name"], r["id"], r["arguments"], r.get("unbounded", False), r["row"])
        for r in table["shape"]
    }
    numbers = {key: f"0x{value:016X}" for key, value in numbers_of(table["random"])}
    lines = [
        f"VERSION = {table['version']}",
        f'MAGIC = b"{table["magic"]}"',
        f"SENTINEL_FLOAT = {table['sentinel_float']!r}",
        f"SENTINEL_INTEGER = {table['sentinel_integer']:#010x}",
        *literal("SECTIONS", {r["name"]: repr(r["id"]) for r in table["section"]}),
        *literal("NODES", nodes),
        *literal("OPCODES", opcodes),
        *literal("SHAPES", shapes),
        *literal("PATTERNS", {r["name"]: repr(r["id"]) for r in table["pattern"]}),
        *python_records(table),
        *literal("RANDOM", numbers),
        *literal("LIMITS", {key: repr(value) for key, value in table["limits"].items()}),
    ]
    return PYTHON_HEAD + "\n".join(lines) + "\n"


def main(arguments: list[str]) -> int:
    if arguments not in ([], ["--check"]):
        print("usage: generate.py [--check]", file=sys.stderr)
        return 2
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    check_ids(table)
    stale = 0
    for path, content in ((HEADER, header(table)), (ROWS, python_rows(table))):
        if arguments and (not path.exists() or path.read_text(encoding="utf-8") != content):
            print(f"{path.relative_to(ROOT)} is out of date: run python runtime/generate.py", file=sys.stderr)
            stale = 1
        elif not arguments:
            path.write_text(content, encoding="utf-8")
    return stale


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
