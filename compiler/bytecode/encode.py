"""The graph → bytecode (runtime/bytecode.toml): strings, constants, code and records once each, nodes field by
field as the table's rows say.

``encode(graph) -> bytes``. Example: ``Path("tree.plsb").write_bytes(encode(graph))``; Figure 2.1 takes about a
kilobyte with its source map.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable

from ..graph import graph as g
from ..reading.diagnostics import PlsysError
from ..reading.model import Constant, Mesh, Record
from ..reading.source import Span
from .assemble import Assembler, texture_values
from .layout import GRAPH_ROWS, HEADER_SIZE, write_u
from .layout_rows import LIMITS, MAGIC, RECORDS, SECTIONS, SENTINEL_FLOAT, SENTINEL_INTEGER, SHAPES, VERSION

MAX_LENGTH = LIMITS["bytes"]


def encode(graph: g.Graph, sourcemap: bool = True) -> bytes:
    """Bytecode of a graph that the verifier accepts. Without ``sourcemap`` the section is there, without places.

    PlsysError if an expression needs a deeper stack than the runtime has, or the file would exceed 4 GiB."""
    return _Encoder(graph, sourcemap).run()


class _Pool:
    """Distinct items in the order of their first use."""

    def __init__(self, *items: object) -> None:
        self.indices: dict[object, int] = {item: i for i, item in enumerate(items)}

    def __call__(self, item: object) -> int:
        return self.indices.setdefault(item, len(self.indices))


class _Encoder:
    def __init__(self, graph: g.Graph, sourcemap: bool) -> None:
        self.graph = graph
        self.sourcemap = sourcemap
        self.strings = _Pool("")
        self.constants = _Pool()
        self.records = _Pool()
        slots = {name: slot for slot, name in enumerate(graph.parameters)}
        self.slots = slots
        self.assembler = Assembler(self.constants, slots.__getitem__, self.strings)

    def run(self) -> bytes:
        for record in (self.graph.settings, self.graph.camera, *self.graph.lights):
            if record is not None:
                self.record(record)
        sections = {"nodes": self.nodes(), "meshes": self.meshes(), "sourcemap": self.places()}
        sections["parameters"] = _listed(_u(self.strings(name)) for name in self.graph.parameters)
        sections["code"] = _u(len(self.assembler.code)) + self.assembler.code
        sections["records"] = _listed(self.records.indices)
        sections["constants"] = _listed(struct.pack("<d", value) for value in self.constants.indices)
        sections["strings"] = _listed(_u(len(s.encode())) + s.encode() for s in self.strings.indices)
        body = b"".join(
            bytes([id]) + _u(len(sections[name])) + sections[name] for name, id in SECTIONS.items()
        )
        return _header(body) + body

    def record(self, record: Record) -> int:
        row = RECORDS[record.kind]
        numbers = {
            row.values[name].offset + i: v for name, values in record.values for i, v in enumerate(values)
        }
        return self.add_record(record.kind, 0, numbers)

    def texture(self, node: g.Texture) -> int:
        numbers = {i: v.value for i, v in texture_values(node.texture) if isinstance(v, Constant)}
        return self.add_record("texture", len(node.texture.entries), numbers)

    def add_record(self, kind: str, entries: int, numbers: dict[int, float]) -> int:
        """A record that sets only what differs from the defaults (0 in entries)."""
        row = RECORDS[kind]
        defaults = [number for value in row.values.values() for number in value.default]
        sets = [(i, v) for i, v in sorted(numbers.items()) if v != (defaults[i] if i < row.size else 0)]
        out = bytearray()
        for number in (row.id, entries, len(sets)):
            write_u(out, number)
        previous = -1
        for index, value in sets:
            write_u(out, index - previous - 1)
            write_u(out, self.constants(float(value) + 0.0))  # -0 becomes 0
            previous = index
        # Lights count one by one, however alike; equal textures are one record.
        return self.records(bytes(out)) if kind == "texture" else self.records(_Distinct(out))

    def nodes(self) -> bytes:
        return _listed(self.node(node) for node in self.graph.nodes)

    def node(self, node: g.Node) -> bytes:
        row = GRAPH_ROWS[type(node)]
        out = bytearray()
        write_u(out, row.id)
        for name, kind in row.fields:
            for number in self.field(node, name, kind):
                write_u(out, number)
        return bytes(out)

    def field(self, node: g.Node, name: str, kind: str) -> Iterable[int]:
        """The numbers that a field is written as."""
        if kind == "code":
            # Only guards keep their expression under the field's own name.
            return [
                self.assembler.of_value(node.test, node.span)
                if name == "test"
                else self.assembler.of_node(node)
            ]
        if kind == "cases":
            pairs = [(self.assembler.of_value(weight, node.span), body) for weight, body in node.cases]
            return [len(pairs), *(number for pair in pairs for number in pair)]
        if kind == "record":
            return [self.texture(node)]
        if kind == "nodes":
            return [len(node.children_), *node.children_]
        value = getattr(node, name)
        if kind == "string":
            return [self.strings(value)]
        if kind == "shape":
            return [SHAPES[value].id]
        if kind == "slots":
            slots = sorted(self.slots[parameter] for parameter in value)
            return [len(slots), *slots]
        if kind == "matrix":
            return [self.constants(number + 0.0) for number in value]
        return [int(value)]  # node, u, mesh

    def meshes(self) -> bytes:
        return _listed(_mesh(mesh, self.strings(mesh.name)) for mesh in self.graph.meshes)

    def places(self) -> bytes:
        """The source map. Positions are looked up once a distinct span."""
        files = _Pool()
        rows = [self.place(node.span, files) for node in self.graph.nodes]
        out = bytearray(_listed(_u(self.strings(name)) for name in files.indices))
        for row in rows:
            for number in row:
                write_u(out, number)
        return bytes(out)

    def place(self, span: Span | None, files: _Pool) -> tuple[int, ...]:
        if span is None or not self.sourcemap:
            return (0,)
        start, end = span.start_position, span.end_position
        return (files(span.source.name) + 1, start.line, start.column, end.line - start.line, end.column)


class _Distinct(bytearray):
    """Bytes that are equal to themselves only."""

    __hash__ = object.__hash__

    def __eq__(self, other: object) -> bool:
        return self is other


def _mesh(mesh: Mesh, name: int) -> bytes:
    """One mesh: counts, coordinates, and per triangle its vertex and normal indices."""
    import numpy as np

    vertices = np.ascontiguousarray(mesh.vertices, dtype="<f8").reshape(-1, 3)
    normals = np.ascontiguousarray(mesh.normals, dtype="<f8").reshape(-1, 3)
    out = bytearray()
    for number in (name, len(vertices), len(normals), len(mesh.triangles)):
        write_u(out, number)
    out += vertices.tobytes() + normals.tobytes()
    indices = np.asarray(mesh.triangles).reshape(-1, 3)
    if len(normals):
        indices = np.hstack([indices, np.asarray(mesh.normal_triangles).reshape(-1, 3)])
    for index in indices.ravel().tolist():
        write_u(out, index)
    return bytes(out)


def _header(body: bytes) -> bytes:
    length = HEADER_SIZE + len(body)
    if length > MAX_LENGTH:
        raise PlsysError(
            f"the scene's bytecode would take {length:,} bytes, at most {MAX_LENGTH:,} are possible"
        )
    return struct.pack(
        "<4sHHIIdI", MAGIC, VERSION, 0, length, zlib.crc32(body), SENTINEL_FLOAT, SENTINEL_INTEGER
    )


def _u(value: int) -> bytes:
    out = bytearray()
    write_u(out, value)
    return bytes(out)


def _listed(items: Iterable[bytes]) -> bytes:
    """Count and items."""
    rows = list(items)
    return _u(len(rows)) + b"".join(rows)
