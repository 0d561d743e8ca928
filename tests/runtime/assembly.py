"""Bytecode by hand: what a test wants to say, valid or not, in the form of the disassembly → bytes.

It shares nothing with the compiler's encoder but the table, and checks nothing, to make broken files:

    scene = Assembly(parameters=["n"])
    init = scene.code("const 10; store n; end")
    scene.node("object", name="Tree", ordinal=0, child=1)
    scene.node("calculate", name="init", code=init, child=2)
    scene.node("empty")
    data = scene.bytes()
"""

from __future__ import annotations

import struct
import zlib

from plsys.compiler.bytecode.layout_rows import (
    MAGIC,
    NODES,
    OPCODES,
    PATTERNS,
    RECORDS,
    SECTIONS,
    SENTINEL_FLOAT,
    SENTINEL_INTEGER,
    SHAPES,
    VERSION,
)

NONE = 0


def u(value: int) -> bytes:
    """Unsigned LEB128, shortest form."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes((*out, value))


def container(sections: dict[str, bytes], *, version: int = VERSION, flags: int = 0) -> bytes:
    """A file of these sections' contents, header and checksum made right."""
    body = b"".join(u(SECTIONS[name]) + u(len(content)) + content for name, content in sections.items())
    return seal(
        MAGIC
        + struct.pack("<HHIIdI", version, flags, 28 + len(body), 0, SENTINEL_FLOAT, SENTINEL_INTEGER)
        + body
    )


def seal(data: bytes) -> bytes:
    """The same file with its checksum made right."""
    return data[:12] + struct.pack("<I", zlib.crc32(data[28:])) + data[16:]


class Assembly:
    def __init__(self, parameters: list[str] | None = None, file: str = "") -> None:
        self.strings = [""]
        self.constants: list[float] = []
        self.slots = list(parameters or ())
        self.instructions = bytearray()
        self.records: list[bytes] = []
        self.meshes: list[bytes] = []
        self.nodes: list[bytes] = []
        self.places: list[tuple[int, int, int, int] | None] = []
        self.file = file

    def string(self, text: str) -> int:
        if text not in self.strings:
            self.strings.append(text)
        return self.strings.index(text)

    def constant(self, value: float) -> int:
        value = float(value) + 0.0
        if value not in self.constants:
            self.constants.append(value)
        return self.constants.index(value)

    def code(self, text: str) -> int:
        """Instructions separated by ';', each an opcode and its operand: a number for const and offsets,
        a name for load, store and variants. Returns what a node's code field holds."""
        start = len(self.instructions)
        for instruction in filter(None, map(str.strip, text.split(";"))):
            name, *rest = instruction.split()
            row = OPCODES[name]
            self.instructions.append(row.id)
            if row.operand == "constant":
                self.instructions += u(self.constant(float(rest[0])))
            elif row.operand == "slot":
                self.instructions += u(self.slots.index(rest[0]))
            elif row.operand == "string":
                self.instructions += u(self.string(rest[0]))
            elif row.operand:
                self.instructions += u(int(rest[0]))
        return start + 1

    def record(self, kind: str, entries: tuple = (), **values) -> int:
        """Values by name, numbers or tuples; a texture's entries as tuples of six."""
        row = RECORDS[kind]
        sets: dict[int, float] = {}
        for name, value in values.items():
            if name == "pattern" and isinstance(value, str):
                value = PATTERNS[value]
            numbers = value if isinstance(value, tuple) else (value,) * row.values[name].size
            sets |= {row.values[name].offset + i: number for i, number in enumerate(numbers)}
        for i, entry in enumerate(entries):
            sets |= {row.size + len(row.entry) * i + k: number for k, number in enumerate(entry)}
        content, previous = u(row.id) + u(len(entries)) + u(len(sets)), -1
        for index in sorted(sets):
            content += u(index - previous - 1) + u(self.constant(sets[index]))
            previous = index
        self.records.append(content)
        return len(self.records) - 1

    def mesh(self, name: str, vertices, triangles, normals=(), normal_triangles=()) -> int:
        content = u(self.string(name)) + u(len(vertices)) + u(len(normals)) + u(len(triangles))
        for vector in (*vertices, *normals):
            content += struct.pack("<3d", *vector)
        for i, triangle in enumerate(triangles):
            content += b"".join(map(u, triangle)) + b"".join(map(u, normal_triangles[i] if normals else ()))
        self.meshes.append(content)
        return len(self.meshes) - 1

    def node(self, kind: str, place: tuple[int, int, int, int] | None = None, **fields) -> int:
        """A node by its row's fields. place: line, column, end line, end column."""
        row = NODES[kind]
        content = u(row.id)
        for name, field in row.fields:
            content += self.field(field, fields[name])
        self.nodes.append(content)
        self.places.append(place)
        return len(self.nodes) - 1

    def field(self, kind: str, value) -> bytes:
        if kind == "string":
            return u(self.string(value))
        if kind == "shape":
            return u(SHAPES[value].id if isinstance(value, str) else value)
        if kind == "matrix":
            return b"".join(u(self.constant(number)) for number in value)
        if kind == "nodes":
            return u(len(value)) + b"".join(map(u, value))
        if kind == "slots":
            return u(len(value)) + b"".join(u(self.slots.index(name)) for name in value)
        if kind == "cases":
            return u(len(value)) + b"".join(u(weight) + u(body) for weight, body in value)
        return u(value)

    def sections(self) -> dict[str, bytes]:
        """The sections' contents by name, in file order."""
        names = [self.string(name) for name in self.slots]
        sourcemap = u(1) + u(self.string(self.file)) if self.file else u(0)
        for place in self.places:
            sourcemap += (
                u(1) + u(place[0]) + u(place[1]) + u(place[2] - place[0]) + u(place[3]) if place else u(0)
            )
        encoded = [text.encode() for text in self.strings]
        return {
            "strings": u(len(encoded)) + b"".join(u(len(text)) + text for text in encoded),
            "constants": u(len(self.constants)) + struct.pack(f"<{len(self.constants)}d", *self.constants),
            "parameters": u(len(names)) + b"".join(map(u, names)),
            "code": u(len(self.instructions)) + bytes(self.instructions),
            "records": u(len(self.records)) + b"".join(self.records),
            "meshes": u(len(self.meshes)) + b"".join(self.meshes),
            "nodes": u(len(self.nodes)) + b"".join(self.nodes),
            "sourcemap": sourcemap,
        }

    def bytes(self) -> bytes:
        return container(self.sections())


IDENTITY = (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)


def one_of_everything() -> Assembly:
    """A small scene with every node kind, every operand type, records, a mesh and places."""
    a = Assembly(["n", "angle"], file="every thing.plsys")
    init = a.code("const 3; store n; const 30; store angle; end")
    test = a.code("load n; const 0; greater; bool; end")
    weight = a.code("load n; end")
    steps = a.code("const 0; const 0; const 2; trans; load angle; roty; const 0.5; scale_uniform; end")
    less = a.code("load n; const 1; subtract; store n; const 4; variants Grow; end")
    colour = a.code("const 0; rand; texture_set 32; load n; const 2; hash 2; texture_set 22; end")
    radius = a.code("const 0.25; end")
    choice = a.code("load n; const 0; greater; jump_if_zero 4; const 0.5; jump 2; const 2; end")
    a.record("settings", seed=7, background=(0.78, 0.88, 1.0))
    a.record("camera", location=(0, -14, 5), sky=(0, 0, 1), look_at=(0, 0, 5), has_look_at=1, angle=45)
    a.record("light", location=(20, -30, 40))
    bark = a.record("texture", ((0, 0.45, 0.3, 0.15, 0, 0),), diffuse=0.7)
    ramp = a.record(
        "texture", ((0, 1, 0, 0, 0, 0), (1, 0, 0, 1, 0, 0.5)), pattern="gradient", direction=(0, 0, 1)
    )
    leaf = a.mesh("leaf.obj", ((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 1, 2),), ((0, 0, 1),), ((0, 0, 0),))
    place = (12, 1, 14, 2)
    a.node("union", place, children=(1, 2, 3))
    a.node("object", place, name="Tree", ordinal=0, child=4)
    a.node("object", None, name="", ordinal=0, child=20)
    a.node("empty")
    a.node("calculate", (30, 5, 30, 9), name="init", code=init, child=5)
    a.node("enter", None, symbol=6)
    a.node("symbol", (20, 1, 29, 2), name="Tree", live=("n", "angle"), draws=1, body=7)
    a.node("branch", (21, 5, 21, 20), test=test, then=8, otherwise=16)
    a.node("choose", (22, 5, 24, 9), cases=((weight, 9), (choice, 16)))
    a.node("rule", (22, 5, 22, 30), index=0, body=10)
    a.node("union", None, children=(11, 17))
    a.node("calculate", None, name="Grow", code=less, child=12)
    a.node("transform_code", (33, 1, 33, 40), name="T_up", code=steps, child=13)
    a.node("no_shadow", None, child=14)
    a.node("texture", None, name="Bark", texture=bark, code=colour, draws=1, child=15)
    a.node("enter", None, symbol=6)
    a.node("rule", None, index=1, body=18)
    a.node("mesh", None, mesh=leaf)
    a.node("transform", None, name="T_thin", matrix=(0.1, *IDENTITY[1:10], 2, 0.125), child=19)
    a.node("primitive", None, shape="torus", code=radius)
    a.node("texture", None, name="", texture=ramp, code=NONE, draws=0, child=21)
    a.node("primitive", None, shape="sphere", code=NONE)
    return a
