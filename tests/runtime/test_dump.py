"""The disassembly of a scene with one of everything, against tests/cases/disassembly/."""

import os
from pathlib import Path

import native
from assembly import Assembly, one_of_everything

CASES = Path(__file__).resolve().parents[1] / "cases" / "disassembly"


def dump(tmp_path, data: bytes) -> str:
    file = tmp_path / "scene.plsb"
    file.write_bytes(data)
    done = native.probe("dump", file)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_one_of_everything(tmp_path):
    text = dump(tmp_path, one_of_everything().bytes())
    expected = CASES / "everything.txt"
    if os.environ.get("PLSYS_BLESS"):
        expected.write_text(text)
    assert text == expected.read_text()


def test_numbers_read_back_and_are_short(tmp_path):
    numbers = [
        0.1,
        1 / 3,
        1e-7,
        5e-324,
        1.7976931348623157e308,
        -2.5,
        123456789.0,
        1e22,
        0.1 + 0.2,
        1e15,
        1e16,
    ]
    a = Assembly(["n"])
    a.node("object", name="", ordinal=0, child=1)
    a.node(
        "calculate",
        name="",
        code=a.code("; ".join(f"const {v!r}; store n" for v in numbers) + "; end"),
        child=2,
    )
    a.node("empty")
    shown = [line.split()[-1] for line in dump(tmp_path, a.bytes()).splitlines() if "  const " in line]
    assert [float(text) for text in shown] == numbers
    assert shown[:3] == ["0.1", "0.3333333333333333", "1e-07"] and shown[8] == "0.30000000000000004"


def test_code_that_nodes_share_stands_below_the_first(tmp_path):
    a = Assembly(["n"])
    code = a.code("const 1; store n; end")
    a.node("object", name="", ordinal=0, child=1)
    a.node("calculate", name="A", code=code, child=2)
    a.node("calculate", name="B", code=code, child=3)
    a.node("empty")
    lines = dump(tmp_path, a.bytes()).splitlines()
    assert sum("store n" in line for line in lines) == 1
    assert lines[-2:] == ['node 2 calculate name="B" code=@0 child=3', "node 3 empty"]
