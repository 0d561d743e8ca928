"""Bytecode: what the encoder writes, the decoder reads back, and damaged bytes that it refuses."""

from __future__ import annotations

import ctypes
import struct
import zlib
from pathlib import Path

import numpy as np
import plsys.runtime
import pytest
from hand_models import (
    apply,
    assign,
    branch,
    chain,
    choose,
    model,
    number,
    paint,
    read,
    rule,
    transformation,
    tree,
    union,
)
from plsys.compiler.bytecode.decode import decode
from plsys.compiler.bytecode.disassemble import disassemble, number_text
from plsys.compiler.bytecode.encode import encode
from plsys.compiler.bytecode.reader import BytecodeError
from plsys.compiler.graph import graph as g
from plsys.compiler.pipeline import build_graph
from plsys.compiler.reading.diagnostics import PlsysError
from plsys.compiler.reading.model import (
    Calculate,
    Empty,
    Enter,
    Mesh,
    MeshLeaf,
    NoShadow,
    Paint,
    Primitive,
    TextureValue,
    Variants,
)

LIBRARY = Path(plsys.runtime.__file__).with_name("libplsys.so")


def everything() -> g.Graph:
    """A graph with every node kind and most opcodes."""
    n = read("n")
    test = apply(
        "or",
        apply("and", apply("greater", n, 0), apply("not", n)),
        apply("select", n, apply("hash", n, 2, 3), -1),
    )
    gradient = TextureValue(
        (("pattern", (number(2),)), ("direction", (number(0), number(0), number(1))), ("diffuse", (n,))),
        (
            tuple(map(number, (0, 1, 0, 0, 0, 0))),
            (number(1), apply("rand", n), *map(number, (0.5, 0, 0, 0.25))),
        ),
    )
    alternatives = choose(
        (
            3,
            rule(
                0,
                union(
                    chain(transformation("T", ("roty", n), ("scale_uniform", 0.5)), Enter("A")), MeshLeaf(0)
                ),
            ),
        ),
        (n, rule(1, chain(Paint("P", gradient), NoShadow(), Primitive("cone", (apply("sin", n),))))),
    )
    down = Calculate("C", (*assign(n=apply("subtract", n, 1)).statements, Variants(number(4))))
    scene = model(
        [
            chain(paint("Red", 1, 0, 0), assign(n=3), Enter("A")),
            chain(transformation("M", ("trans", 1, 2, 3)), Primitive("plane")),
        ],
        seed=-5.5,
        A=branch(test, alternatives, rule(2, chain(down, Enter("B")))),
        B=branch(n, rule(3, Primitive("torus", (number(0.25),))), Empty()),
    )
    corner = np.eye(3)
    triangle = np.array([[0, 1, 2]])
    scene.meshes.append(Mesh("leaf.obj", corner, corner[:1], triangle, np.zeros((1, 3), int)))
    return build_graph(scene)


def test_figure_2_1_takes_less_than_one_and_a_half_kilobytes():
    data = encode(build_graph(tree()))
    assert len(data) <= 1500
    assert len(encode(build_graph(tree()), sourcemap=False)) < len(data)


def test_the_header_is_as_documented():
    data = encode(build_graph(tree()))
    magic, version, flags, length, checksum, number_, integer = struct.unpack_from("<4sHHIIdI", data)
    assert (magic, version, flags, length) == (b"PLSB", 1, 0, len(data))
    assert checksum == zlib.crc32(data[28:])
    assert (number_, integer) == (1.25, 0x01020304)


def test_every_construct_is_read_back():
    graph = everything()
    program = decode(encode(graph))
    names = [node.row.name for node in program.nodes]
    assert len(names) == len(graph.nodes)
    assert {
        "symbol",
        "rule",
        "branch",
        "choose",
        "calculate",
        "transform",
        "transform_code",
        "texture",
    } < set(names)
    assert {"union", "enter", "primitive", "mesh", "object", "no_shadow", "empty"} < set(names)
    symbol = program.nodes[names.index("symbol")]
    assert program.strings[symbol.fields["name"]] == "A" and symbol.fields["draws"] == 1
    assert [program.strings[name] for name in program.parameters] == ["n"] and symbol.fields["live"] == [0]
    settings = program.records[0]
    assert settings.row.name == "settings" and settings.values[settings.row.values["seed"].offset] == -5.5
    (mesh,) = program.meshes
    assert mesh.vertices == [(1, 0, 0), (0, 1, 0), (0, 0, 1)] and mesh.triangles == [(0, 1, 2)]
    assert mesh.normals == [(1, 0, 0)] and mesh.normal_triangles == [(0, 0, 0)]


def test_places_are_those_of_the_source():
    program = decode(encode(everything()))
    place = program.nodes[1].place
    assert program.strings[place.file] == "hand.plsys"
    assert (place.line, place.column, place.end_line, place.end_column) == (1, 1, 1, 8)
    assert all(node.place is None for node in decode(encode(everything(), sourcemap=False)).nodes)


def test_equal_code_and_equal_textures_stand_once():
    turn = transformation("T", ("rotz", read("n")))
    red = chain(paint("Red", 1, 0, 0), turn, Primitive("box"))
    program = decode(
        encode(build_graph(model([chain(assign(n=1), Enter("A"))], A=rule(0, union(red, red, red)))))
    )
    assert len(program.pieces) == 2 and len(program.records) == 2


def test_minus_zero_and_what_is_not_finite_are_calculated():
    scene = model(
        [chain(assign(a=-0.0, b=float("inf"), c=float("nan")), Enter("A"))], A=rule(0, Primitive("box"))
    )
    graph = build_graph(scene)
    graph.parameters = ["a", "b", "c"]
    graph.nodes[0].child = graph.add(
        g.Calculate("", scene.objects[0].body.operator.statements, graph.nodes[0].child)
    )
    text = disassemble(encode(graph))
    assert "const 0\n        2  negate\n        3  store a" in text
    assert "const 1\n        7  const 0\n        9  divide\n       10  store b" in text


def test_an_expression_that_needs_too_many_values_is_refused():
    deep = read("n")
    for _ in range(64):
        deep = apply("add", 1, deep)
    scene = model(
        [chain(assign(n=0), assign(n=deep), Enter("A"))], A=rule(0, Primitive("cone", (read("n"),)))
    )
    with pytest.raises(PlsysError, match="hand.plsys:1:1: an expression needs more than 64 values"):
        encode(build_graph(scene))


# --- damage


def repaired(data: bytes) -> bytes:
    """The bytes with length and checksum put right."""
    return data[:8] + struct.pack("<II", len(data), zlib.crc32(data[28:])) + data[16:]


def refuses(data: bytes) -> bool:
    try:
        decode(data)
    except BytecodeError as error:
        return bool(error.reason and error.place)
    return False


def test_every_truncation_is_refused():
    data = encode(everything())
    assert all(refuses(data[:length]) for length in range(len(data)))
    assert all(refuses(repaired(data[:length])) for length in range(28, len(data)))


def test_every_changed_byte_is_refused():
    data = encode(everything())
    for i in range(len(data)):
        assert refuses(data[:i] + bytes([data[i] ^ 0xFF]) + data[i + 1 :])


@pytest.mark.parametrize("bit", [1, 2, 16, 128])
def test_changed_bytes_with_a_good_checksum_never_crash(bit):
    """They are refused, or they are other bytecode that is as sound."""
    data = encode(everything())
    for i in range(28, len(data)):
        changed = repaired(data[:i] + bytes([data[i] ^ bit]) + data[i + 1 :])
        assert refuses(changed) or disassemble(changed)


def test_what_follows_the_end_is_refused():
    data = encode(everything())
    assert refuses(data + b"\0") and refuses(repaired(data + b"\0"))


@pytest.mark.parametrize(
    ("data", "reason"), [(b"", "isn't plsys bytecode"), (b"PLSB", "truncated"), (b"\x89PNG", "isn't plsys")]
)
def test_other_files_are_told_from_bytecode(data, reason):
    with pytest.raises(BytecodeError, match=reason):
        decode(data)


# --- disassembly


def test_the_disassembly_shows_nodes_code_and_places():
    text = disassemble(encode(build_graph(tree())))
    assert text.startswith('bytecode version 1\nparameter 0 "betaBr"\n')
    assert 'node 0 object name="Tree" ordinal=0 child=1  ; hand.plsys:1:1-1:8\n' in text
    assert "        0  const 10\n        2  store cntTree\n" in text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1, "0.1"),
        (1 / 3, "0.3333333333333333"),
        (-0.0, "0"),
        (1e300, "1e+300"),
        (2.0**53 + 2, "9007199254740994"),
    ],
)
def test_numbers_are_the_shortest_that_read_back(value, text):
    assert number_text(value) == text


# --- beside the runtime


@pytest.fixture(scope="module")
def runtime_text():
    """The runtime's disassembly of bytes, or None where it refuses them."""
    if not LIBRARY.exists():
        pytest.skip("libplsys.so isn't built")
    library = ctypes.CDLL(str(LIBRARY))
    library.pl_disassemble.restype = ctypes.c_void_p

    def text(data: bytes) -> str | None:
        pointer = library.pl_disassemble(data, ctypes.c_size_t(len(data)), None)
        if not pointer:
            return None
        found = ctypes.string_at(pointer).decode()
        library.pl_free(ctypes.c_void_p(pointer))
        return found

    return text


def text_or_none(data: bytes) -> str | None:
    try:
        return disassemble(data)
    except BytecodeError:
        return None


def test_the_runtime_disassembles_alike(runtime_text):
    for graph in (everything(), build_graph(tree())):
        data = encode(graph)
        assert runtime_text(data) == disassemble(data)


@pytest.mark.parametrize("bit", [1, 4, 64])
def test_the_runtime_refuses_the_same_changes(runtime_text, bit):
    data = encode(everything())
    for i in range(28, len(data)):
        changed = repaired(data[:i] + bytes([data[i] ^ bit]) + data[i + 1 :])
        assert runtime_text(changed) == text_or_none(changed), f"byte {i}"
