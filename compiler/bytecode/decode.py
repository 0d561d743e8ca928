"""Bytecode → program, everything checked as the runtime's loader does (runtime/load.c).

``decode(data) -> Program``. Example: ``decode(encode(graph)).nodes[0].row.name`` is ``'object'``.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable
from itertools import pairwise

from .layout import HEADER_SIZE, NODES_BY_ID, RECORDS_BY_ID
from .layout_rows import LIMITS, MAGIC, SECTIONS, SENTINEL_FLOAT, SENTINEL_INTEGER, VERSION
from .program import MeshValues, Place, Program, ProgramNode, RecordValues
from .reader import BytecodeError, Reader
from .verify import verify


def decode(data: bytes) -> Program:
    """Raises BytecodeError, with the section and the reason, for anything but valid bytecode."""
    _check_header(data)
    program = Program()
    file = Reader(data, HEADER_SIZE, len(data), "bytecode")
    for name, id in SECTIONS.items():
        found = file.u()
        if found != id:
            raise file.fail(f"section {found} stands where the {name} ({id}) should")
        length = file.count(1)
        section = Reader(data, file.at, file.at + length, name)
        READERS[name](section, program)
        if section.left:
            raise section.fail(f"{section.left} bytes too many")
        file.at = section.end
    if file.left:
        raise file.fail(f"{file.left} bytes after the last section")
    verify(program)
    return program


def _check_header(data: bytes) -> None:
    def fail(reason: str) -> BytecodeError:
        return BytecodeError(reason, "bytecode")

    if data[:4] != MAGIC:
        raise fail(f"this isn't plsys bytecode: it doesn't begin with {MAGIC.decode()}")
    if len(data) < HEADER_SIZE:
        raise fail(f"truncated: {len(data)} bytes, the header alone has {HEADER_SIZE}")
    _, version, flags, length, checksum, number, integer = struct.unpack_from("<4sHHIIdI", data)
    if version != VERSION:
        raise fail(f"version {version}, but this program reads version {VERSION}: compile again")
    if flags:
        raise fail(f"unknown flags {flags}")
    if len(data) > LIMITS["bytes"]:
        raise fail(f"{len(data)} bytes, more than {LIMITS['bytes']}")
    if length != len(data):
        kind = "truncated" if length > len(data) else "something follows the end"
        raise fail(f"{kind}: {len(data)} bytes, the header says {length}")
    found = zlib.crc32(data[HEADER_SIZE:])
    if found != checksum:
        raise fail(f"damaged: the checksum is {found:08x}, the header says {checksum:08x}")
    if number != SENTINEL_FLOAT or integer != SENTINEL_INTEGER:
        raise fail("damaged: the sentinels are wrong")


def _strings(r: Reader, program: Program) -> None:
    for i in range(r.count(1)):
        try:
            text = r.take(r.count(1)).decode()
        except UnicodeDecodeError:
            text = "\0"
        if any(c < " " or c == "\x7f" for c in text):
            raise r.fail(f"string {i} isn't UTF-8 text")
        program.strings.append(text)
    if not program.strings or program.strings[0]:
        raise r.fail("string 0 isn't empty")


def _constants(r: Reader, program: Program) -> None:
    for i in range(r.count(8)):
        value = r.f64()
        if value == 0 and math.copysign(1, value) < 0:
            raise r.fail(f"constant {i} is -0")
        program.constants.append(value)
    if len(set(program.constants)) < len(program.constants):
        twice = next(v for v in sorted(program.constants) if program.constants.count(v) > 1)
        raise r.fail(f"the constant {twice:.17g} stands there twice")


def _parameters(r: Reader, program: Program) -> None:
    program.parameters = [r.index(len(program.strings), "name") for _ in range(r.count(1))]


def _code(r: Reader, program: Program) -> None:
    program.code = r.take(r.count(1))


def _records(r: Reader, program: Program) -> None:
    numbers = 0
    for _ in range(r.count(3)):
        kind, entries = r.u(), r.u()
        row = RECORDS_BY_ID.get(kind)
        if row is None:
            raise r.fail(f"there is no record kind {kind}")
        if entries and not row.entry:
            raise r.fail(f"a {row.name} record has no entries, not {entries}")
        numbers += row.size + entries * len(row.entry)
        if numbers > LIMITS["record_numbers"]:
            raise r.fail(f"more than {LIMITS['record_numbers']} numbers in records")
        program.records.append(_record(r, program, row, entries))
    for name in ("settings", "camera"):
        if sum(record.row.name == name for record in program.records) > 1:
            raise r.fail(f"two {name} records")


def _record(r: Reader, program: Program, row: object, entries: int) -> RecordValues:
    values = [number for value in row.values.values() for number in value.default]
    values += [0.0] * (entries * len(row.entry))
    index = -1
    for _ in range(r.count(2)):
        index += 1 + r.u()
        constant = r.index(len(program.constants), "constant")
        if index >= len(values):
            raise r.fail(f"value {index} of a {row.name} record with {len(values)}")
        values[index] = program.constants[constant]
    return RecordValues(row, entries, tuple(values))


def _meshes(r: Reader, program: Program) -> None:
    for _ in range(r.count(4)):
        name = r.index(len(program.strings), "name")
        vertices, normals, triangles = r.u(), r.u(), r.u()
        if vertices + normals > r.left // 24:
            raise r.fail(f"a mesh says it has {vertices + normals} vectors, more than fit into its bytes")
        mesh = MeshValues(name, [], [], [], [])
        mesh.vertices.extend((r.f64(), r.f64(), r.f64()) for _ in range(vertices))
        mesh.normals.extend((r.f64(), r.f64(), r.f64()) for _ in range(normals))
        if triangles > r.left // (6 if normals else 3):
            raise r.fail(f"a mesh says it has {triangles} triangles, more than fit into its bytes")
        for _ in range(triangles):
            mesh.triangles.append(tuple(r.index(vertices, "vertex") for _ in range(3)))
            if normals:
                mesh.normal_triangles.append(tuple(r.index(normals, "normal") for _ in range(3)))
        program.meshes.append(mesh)


def _nodes(r: Reader, program: Program) -> None:
    count = r.count(1)
    if count == 0:
        raise r.fail("there is no root")
    if count > LIMITS["nodes"]:
        raise r.fail(f"{count} nodes, more than {LIMITS['nodes']}")
    sizes = {
        "node": (count, "node"),
        "string": (len(program.strings), "string"),
        "record": (len(program.records), "record"),
        "mesh": (len(program.meshes), "mesh"),
    }
    for i in range(count):
        kind = r.u()
        row = NODES_BY_ID.get(kind)
        if row is None:
            raise r.fail(f"node {i}: there is no node kind {kind}")
        fields = {}
        for name, type_ in row.fields:
            fields[name] = r.index(*sizes[type_]) if type_ in sizes else _field(r, program, type_, count)
        program.nodes.append(ProgramNode(row, fields))


def _field(r: Reader, program: Program, type_: str, nodes: int) -> int | list:
    if type_ == "nodes":
        return [r.index(nodes, "node") for _ in range(r.count(1))]
    if type_ == "cases":
        return [(r.u(), r.index(nodes, "node")) for _ in range(r.count(2))]
    if type_ == "matrix":
        return [program.constants[r.index(len(program.constants), "constant")] for _ in range(12)]
    if type_ == "slots":
        slots = [r.index(len(program.parameters), "parameter") for _ in range(r.count(1))]
        for last, slot in pairwise(slots):
            if slot <= last:
                raise r.fail(f"a symbol's live parameters don't rise: {slot} after {last}")
        return slots
    return r.u()  # u, code, shape: judged by verify


def _sourcemap(r: Reader, program: Program) -> None:
    files = [r.index(len(program.strings), "string") for _ in range(r.count(1))]
    for i, node in enumerate(program.nodes):
        file = r.index(len(files) + 1, "file")
        if file == 0:
            continue
        line, column, lines, end_column = r.u(), r.u(), r.u(), r.u()
        if 0 in (line, column, end_column) or line + lines > 2**32 - 1:
            raise r.fail(f"node {i} stands nowhere: line {line}, column {column}")
        node.place = Place(files[file - 1], line, column, line + lines, end_column)


READERS: dict[str, Callable[[Reader, Program], None]] = {
    "strings": _strings,
    "constants": _constants,
    "parameters": _parameters,
    "code": _code,
    "records": _records,
    "meshes": _meshes,
    "nodes": _nodes,
    "sourcemap": _sourcemap,
}
