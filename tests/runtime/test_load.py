"""Loading bytecode: what is valid loads, everything else gives one reason, and nothing crashes (the probe
runs under sanitizers)."""

import struct

import native
import pytest
from assembly import Assembly, container, one_of_everything, u

BYTECODE, LIMIT = 1, 3  # pl_error_code


def scene(*nodes, parameters=(), **kind_fields) -> Assembly:
    """An object above the given (kind, fields) nodes, the first of which is node 1."""
    a = Assembly(list(parameters))
    a.node("object", name="", ordinal=0, child=1)
    for kind, fields in nodes:
        a.node(kind, **fields)
    return a


def load(tmp_path, data: bytes):
    file = tmp_path / "scene.plsb"
    file.write_bytes(data)
    return native.probe("load", file)


def refusal(tmp_path, data: bytes, code: int = BYTECODE) -> str:
    done = load(tmp_path, data)
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stdout.startswith(f"error {code} "), done.stdout
    return done.stdout.split(" ", 2)[2].strip()


def test_one_of_everything_loads(tmp_path):
    done = load(tmp_path, one_of_everything().bytes())
    assert (done.returncode, done.stdout) == (0, "ok\n"), done.stdout + done.stderr


def test_an_empty_scene_loads(tmp_path):
    a = Assembly()
    a.node("empty")
    assert load(tmp_path, a.bytes()).stdout == "ok\n"


def test_every_flipped_bit_is_survived(tmp_path):
    file = tmp_path / "scene.plsb"
    file.write_bytes(one_of_everything().bytes())
    done = native.probe("flip", file)
    assert done.returncode == 0, done.stdout + done.stderr
    loaded, refused = map(int, done.stdout.split()[1::2])
    assert loaded + refused == 16 * file.stat().st_size and refused > loaded


def test_every_truncation_is_refused(tmp_path):
    file = tmp_path / "scene.plsb"
    file.write_bytes(one_of_everything().bytes())
    done = native.probe("cut", file)
    assert done.returncode == 0, done.stdout + done.stderr


def changed(at: int, new: bytes) -> bytes:
    data = one_of_everything().bytes()
    return data[:at] + new + data[at + len(new) :]


HEADERS = {
    "nothing": (b"", "this isn't plsys bytecode"),
    "another-format": (b"\x7fELF" + bytes(60), "this isn't plsys bytecode"),
    "header-only-begun": (one_of_everything().bytes()[:20], "truncated: 20 bytes"),
    "another-version": (changed(4, b"\x07\x00"), "version 7, but this program reads version 1"),
    "flags": (changed(6, b"\x01"), "unknown flags 1"),
    "truncated": (one_of_everything().bytes()[:-1], "truncated"),
    "something-after": (one_of_everything().bytes() + b"!", "something follows the end"),
    "checksum": (changed(100, b"\xfe"), "damaged: the checksum is"),
    "float-sentinel": (changed(16, struct.pack("<d", 1.5)), "damaged: the sentinels are wrong"),
    "integer-sentinel": (changed(24, b"\x01\x02\x03\x04"), "damaged: the sentinels are wrong"),
}


@pytest.mark.parametrize("case", HEADERS)
def test_bad_header(tmp_path, case):
    data, reason = HEADERS[case]
    assert f"bytecode: {reason}" in refusal(tmp_path, data)


def with_section(name: str, content: bytes) -> bytes:
    return container({**one_of_everything().sections(), name: content})


SECTIONS = {
    "long-number": (
        with_section("strings", b"\x81\x00"),
        "strings: has a number that isn't in its shortest form",
    ),
    "huge-number": (with_section("code", b"\xff\xff\xff\xff\x7f"), "code: has a number that isn't"),
    "endless-number": (with_section("code", b"\xff"), "code: ends in the middle of a number"),
    "too-many-bytes": (with_section("parameters", b"\x00\x00"), "parameters: 1 bytes too many"),
    "count-beyond-bytes": (with_section("strings", u(2**31)), "strings: says it has 2147483648 elements"),
    "first-string": (with_section("strings", u(1) + u(1) + b"a"), "strings: string 0 isn't empty"),
    "no-strings": (with_section("strings", u(0)), "strings: string 0 isn't empty"),
    "latin-1": (with_section("strings", u(2) + u(0) + u(1) + b"\xe9"), "string 1 isn't UTF-8"),
    "overlong-utf-8": (with_section("strings", u(2) + u(0) + u(2) + b"\xc0\xaf"), "string 1 isn't UTF-8"),
    "surrogate": (with_section("strings", u(2) + u(0) + u(3) + b"\xed\xa0\x80"), "string 1 isn't UTF-8"),
    "escape-sequence": (with_section("strings", u(2) + u(0) + u(4) + b"\x1b[2J"), "string 1 isn't UTF-8"),
    "nan": (
        with_section("constants", u(1) + struct.pack("<d", float("nan"))),
        "constants: has a number that is NaN",
    ),
    "infinity": (with_section("constants", u(1) + struct.pack("<d", float("inf"))), "NaN or infinite"),
    "minus-zero": (with_section("constants", u(1) + struct.pack("<d", -0.0)), "constant 0 is -0"),
    "twice": (
        with_section("constants", u(2) + struct.pack("<2d", 5, 5)),
        "the constant 5 stands there twice",
    ),
    "parameter-name": (with_section("parameters", u(1) + u(99)), "parameters: name 99, but there are"),
    "record-kind": (with_section("records", u(1) + u(9) + u(0) + u(0)), "records: there is no record kind 9"),
    "two-cameras": (with_section("records", u(2) + 2 * (u(2) + u(0) + u(0))), "records: two camera records"),
    "camera-entries": (with_section("records", u(1) + u(2) + u(1) + u(0)), "a camera record has no entries"),
    "value-index": (
        with_section("records", u(1) + u(2) + u(0) + u(1) + u(20) + u(0)),
        "value 20 of a camera record",
    ),
    "solid-colours": (
        with_section("records", u(5) + 5 * (u(4) + u(2) + u(0))),
        "2 colours don't fit the pattern solid",
    ),
    "mesh-vertices": (with_section("meshes", u(1) + u(0) + u(2**32 - 1) + u(0) + u(0)), "more than fit"),
    "mesh-triangle": (
        with_section("meshes", u(1) + u(0) + u(1) + u(0) + u(1) + bytes(24) + u(0) + u(1) + u(0)),
        "meshes: vertex 1, but there are 1",
    ),
    "no-root": (with_section("nodes", u(0)), "nodes: there is no root"),
    "node-kind": (with_section("nodes", u(1) + u(77)), "node 0: there is no node kind 77"),
    "file-index": (with_section("sourcemap", u(0) + u(3)), "sourcemap: file 3, but there are 1"),
    "line-zero": (with_section("sourcemap", u(1) + u(1) + u(1) + bytes((0, 1, 0, 1))), "stands nowhere"),
}


@pytest.mark.parametrize("case", SECTIONS)
def test_bad_section(tmp_path, case):
    data, reason = SECTIONS[case]
    assert reason in refusal(tmp_path, data)


def test_sections_out_of_order(tmp_path):
    sections = one_of_everything().sections()
    first = sections.pop("strings")
    assert "section 2 stands where the strings (1) should" in refusal(
        tmp_path, container({**sections, "strings": first})
    )


def test_colour_maps_without_end_hit_a_limit_with_a_name(tmp_path):
    content = u(1) + u(4) + u(2**31) + u(1) + u(0) + u(0)
    assert "more than 16777216 numbers in records" in refusal(
        tmp_path, with_section("records", content), LIMIT
    )


PRIMITIVE = ("primitive", {"shape": "sphere", "code": 0})


def calculation(code: str, kind: str = "calculate") -> Assembly:
    a = scene(parameters=("n",))
    fields = {"name": "", "code": a.code(code), "child": 2}
    if kind == "branch":
        fields = {"test": fields["code"], "then": 2, "otherwise": 2}
    a.node(kind, **fields)
    a.node("empty")
    return a


def raw(code: bytes) -> Assembly:
    a = calculation("end")
    a.instructions[:] = code
    return a


CODE = {
    "underflow": (calculation("const 1; add; store n; end"), "byte 2: add takes 2 values, the stack has 1"),
    "overflow": (calculation("const 1; " * 65 + "end"), "more than 64 values on the stack"),
    "left-over": (calculation("const 1; end"), "node 1 (calculate): its code leaves 1 values, not 0"),
    "no-end": (calculation("const 1; store n"), "no end follows store"),
    "opcode": (raw(b"\xfe\x00"), "byte 0: there is no opcode 254"),
    "constant": (raw(b"\x01\x09"), "code: constant 9, but there are 0"),
    "slot": (raw(b"\x02\x01"), "code: parameter 1, but there are 1"),
    "uneven-paths": (
        calculation("const 1; jump_if_zero 2; const 1; const 1; store n; end"),
        "values on the stack, another path with",
    ),
    "jump-outside": (calculation("jump 100; end"), "jump leaves the code"),
    "jump-into": (
        calculation("const 1; jump_if_zero 1; const 1; store n; end"),
        "a jump leads into the middle of",
    ),
    "unreachable": (calculation("jump 2; const 1; end"), "byte 2: const can't be reached"),
    "end-too-early": (calculation("const 1; jump_if_zero 1; end; end"), "end stands before the byte 5"),
    "hash-of-nothing": (calculation("hash 0; store n; end"), "hash of 0 arguments, not 1 to 16"),
    "transforms": (calculation("const 1; rotx; end"), "its code transforms, as only a transformation may"),
    "assigns": (
        calculation("const 1; store n; end", "transform_code"),
        "its code assigns, as only a calculation may",
    ),
    "paints": (calculation("const 1; texture_set 22; end"), "its code sets a texture, as only a texture may"),
    "pattern": (calculation("const 1; texture_set 0; end"), "texture_set changes the pattern"),
    "two-tests": (calculation("const 1; const 1; end", "branch"), "its code leaves 2 values, not 1"),
    "draws": (calculation("const 1; rand; store n; " * 65 + "end"), "more than 64 draws in one application"),
}


@pytest.mark.parametrize("case", CODE)
def test_bad_code(tmp_path, case):
    a, reason = CODE[case]
    assert reason in refusal(tmp_path, a.bytes())


def test_pieces_start_where_the_one_before_ends(tmp_path):
    a = scene(parameters=("n",))
    a.node("calculate", name="", code=a.code("const 1; store n; end") + 2, child=2)
    a.node("empty")
    assert "no code starts at byte 2" in refusal(tmp_path, a.bytes())


def test_draws_add_up_along_a_path_until_a_symbol_is_entered(tmp_path):
    def chain(entered: bool) -> Assembly:
        a = scene(parameters=("n",))
        code = a.code("const 1; rand; store n; " * 40 + "end")
        a.node("calculate", name="", code=code, child=2)
        a.node("enter", symbol=3) if entered else a.node("no_shadow", child=4)
        a.node("symbol", name="X", live=(), draws=1, body=4)
        a.node("calculate", name="", code=code, child=5)
        a.node("empty")
        return a

    assert load(tmp_path, chain(entered=True).bytes()).stdout == "ok\n"
    assert "more than 64 draws" in refusal(tmp_path, chain(entered=False).bytes())


def textured(entries, code="", draws=0, **values) -> Assembly:
    a = scene()
    texture = a.record("texture", entries, **values)
    a.node("texture", name="", texture=texture, code=a.code(code) if code else 0, draws=draws, child=2)
    a.node("empty")
    return a


COLOUR = (0, 1, 1, 1, 0, 0)
GRAPHS = {
    "child": (scene(("no_shadow", {"child": 7})), "nodes: node 7, but there are 2"),
    "cycle": (
        scene(("no_shadow", {"child": 2}), ("no_shadow", {"child": 1})),
        "contains itself without entering",
    ),
    "symbol-cycle": (
        scene(("symbol", {"name": "", "live": (), "draws": 0, "body": 1})),
        "contains itself without entering",
    ),
    "enter-nothing": (scene(("enter", {"symbol": 0})), "node 1 (enter): node 0 is no symbol"),
    "one-term": (scene(("union", {"children": (2,)}), PRIMITIVE), "1 terms, at least 2"),
    "no-cases": (scene(("choose", {"cases": ()})), "there are no cases"),
    "draws-flag": (
        scene(("symbol", {"name": "", "live": (), "draws": 2, "body": 2}), PRIMITIVE),
        "draws is 2, not 0 or 1",
    ),
    "shape": (scene(("primitive", {"shape": 99, "code": 0})), "there is no shape 99"),
    "missing-argument": (scene(("primitive", {"shape": "torus", "code": 0})), "leaves 0 values, not 1"),
    "no-texture": (textured((COLOUR,)), None),
    "texture-range": (textured((COLOUR,), "const 1; texture_set 37; end"), "its code sets value 37 of 37"),
    "texture-draws": (
        textured((COLOUR,), "const 1; rand; texture_set 22; end"),
        "draws is 0, but its code draws 1",
    ),
    "falling-map": (
        textured(((1, *COLOUR[1:]), COLOUR), pattern="gradient"),
        "the colour map's position 1 is below the one before it",
    ),
    "unknown-pattern": (textured((COLOUR,), pattern=1.5), "there is no pattern 1.5"),
    "inner-object": (
        scene(("object", {"name": "", "ordinal": 0, "child": 2}), PRIMITIVE),
        "an object stands below it",
    ),
    "live-order": (None, "a symbol's live parameters don't rise: 0 after 1"),
}


@pytest.mark.parametrize("case", GRAPHS)
def test_bad_graph(tmp_path, case):
    a, reason = GRAPHS[case]
    if case == "live-order":
        a = scene(("symbol", {"name": "", "live": ("m", "n"), "draws": 0, "body": 0}), parameters=("n", "m"))
    if reason is None:
        assert load(tmp_path, a.bytes()).stdout == "ok\n"
    else:
        assert reason in refusal(tmp_path, a.bytes())


def test_the_root_is_objects(tmp_path):
    a = Assembly()
    a.node(*PRIMITIVE[:1], **PRIMITIVE[1])
    assert "the root is no object" in refusal(tmp_path, a.bytes())


def test_deep_graphs_need_no_deep_stack(tmp_path):
    a = Assembly()
    a.node("object", name="", ordinal=0, child=1)
    for i in range(200_000):
        a.node("no_shadow", child=i + 2)
    a.node("empty")
    assert load(tmp_path, a.bytes()).stdout == "ok\n"


def test_random_bytes_in_a_right_container_are_refused_or_load(tmp_path):
    import random

    chosen = random.Random(5)
    sections = one_of_everything().sections()
    for _ in range(60):
        broken = dict(sections)
        name = chosen.choice(list(broken))
        content = bytearray(broken[name])
        for _ in range(chosen.randint(1, 6)):
            at = chosen.randrange(len(content) + 1)
            content[at : at + chosen.randint(0, 3)] = chosen.randbytes(chosen.randint(0, 4))
        broken[name] = bytes(content)
        done = load(tmp_path, container(broken))
        assert done.returncode in (0, 2), done.stdout + done.stderr
