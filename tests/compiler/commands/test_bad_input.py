"""Bad input by way of the command line: one clear message with place, source line and carets, exit code 2, no output
file, never a traceback. What each message says word for word is in tests/cases/syntax and tests/cases/resolve."""

from __future__ import annotations

import json
import os
import struct
import zlib
from pathlib import Path

import pytest
from plsys.compiler import compile
from plsys.compiler.cli import main
from plsys.runtime import PlsysRuntimeError, Scene

CAMERA = "camera { location <0, -5, 1> sky <0, 0, 1> right <-4/3, 0, 0> look_at 0 }\n"

# name: (text behind the camera, what the message says, what the hint says)
CASES = {
    "missing semicolon": ("Selection A { A -> sphere }\nobject { A }", "missing ';'", "add ';'"),
    "missing arrow": ("Selection A { A sphere; }\nobject { A }", "missing '->'", "Name ->"),
    "unclosed brace": ("Selection A { A -> sphere;\nobject { A }", "never closed", "'}'"),
    "= in a condition": ("Selection A { C A; if (n = 1) A -> box; }\nCalculation C { n = 1; }\nobject { A }", "'='", "'=='"),
    "unknown primitive": ("Selection A { A -> spere; }\nobject { A }", "unknown name 'spere'", "'sphere'"),
    "unknown symbol": ("Selection Tree { Tree -> box; }\nobject { Tre }", "unknown name 'Tre'", "'Tree'"),
    "an operator as operand": ("Selection A { A -> T; }\nTransformation T { trans 0 0 1; }\nobject { A }", "'T'", "operand"),
    "unsupported pattern": ("sphere { 0, 1 pigment { bozo } }", "'bozo' isn't supported", "checker"),
    "unsupported solid": ("difference { box { 0, 1 } sphere { 0, 1 } }", "'difference' isn't supported", "union"),
    "unsupported directive": ("#while (1) #end\nsphere { 0, 1 }", "#while", ""),
    "stock include": ('#include "colors.inc"\nsphere { 0, 1 }', "stock files", "built in"),
    "missing include": ('#include "nowhere.plsys"\nsphere { 0, 1 }', "can't read 'nowhere.plsys'", "relative"),
    "missing mesh": ('Selection A { A -> mesh("nowhere.obj"); }\nobject { A }', "nowhere.obj", ""),
    "division by zero": ("Selection A { C A; A -> [ scale s ] box; }\nCalculation C { s = 1/0; }\nobject { A }", "division by zero", "guard"),
    "not a number": ("Selection A { C A; A -> [ scale s ] box; }\nCalculation C { s = sqrt(-1); }\nobject { A }", "sqrt(-1)", ""),
    "infinite on the way": (
        "Selection A { C A; if (n > 0) A -> [ --n; s = 1/n; trans s 0 0 ] A; else A -> box; }\nCalculation C { n = 2; }\nobject { A }",
        "s would become infinity (n = 0", "",
    ),
    "endless": (
        "Selection A { C A; if (n > 0) A -> box + [ trans 0 0 1 ] A; else A -> box; }\nCalculation C { n = 2; }\nobject { A }",
        "endless", "",
    ),
    "too deep": (
        "Selection A { C A; if (n > 0) A -> box + [ ++n; trans 0 0 1 ] A; else A -> box; }\nCalculation C { n = 2; }\nobject { A }",
        "depth", "",
    ),
    "read before assigned": ("Selection A { A -> [ scale q ] box; }\nobject { A }", "'q'", "assigns"),
    "out of range": ("Parameter p = 5 [0 to 3];\nsphere { 0, p }", "must be from 0 to 3", ""),
    "nested too deeply": ("sphere { " + "(" * 5000 + "0" + ")" * 5000 + ", 1 }", "nested too deeply", "limit"),
    "not text": ("sphere { 0, 1 }\0", "NUL", ""),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_one_message_exit_code_2_and_no_file(name, tmp_path, capsys):
    text, message, hint = CASES[name]
    scene, output = tmp_path / "scene.plsys", tmp_path / "out.png"
    scene.write_text(CAMERA + text)
    assert main(["render", str(scene), "-o", str(output), "--size", "16x12"]) == 2
    told = capsys.readouterr().err
    errors = [line for line in told.splitlines() if ": error" in line]
    assert any(message in line and line.startswith(f"{scene}:") for line in errors), told
    assert hint in told and "^" in told
    assert sorted(os.listdir(tmp_path)) == ["scene.plsys"]


def test_files_that_include_each_other(tmp_path, capsys):
    (tmp_path / "a.plsys").write_text('#include "b.plsys"\nsphere { 0, 1 }\n')
    (tmp_path / "b.plsys").write_text('#include "a.plsys"\n')
    assert main(["check", str(tmp_path / "a.plsys")]) == 2
    assert "includes itself" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text, missing", [("sphere { 0, 1 }", "camera"), (CAMERA, "object")], ids=["no camera", "no object"]
)
def test_what_a_picture_needs(text, missing, tmp_path, capsys):
    scene = tmp_path / "scene.plsys"
    scene.write_text(text)
    assert main(["check", str(scene)]) == 0
    assert f"info[no-{missing}]" in capsys.readouterr().err
    assert main(["render", str(scene), "-o", str(tmp_path / "out.png")]) == 2
    assert capsys.readouterr().err == f"{scene}: error: the scene has no {missing}, so there is nothing to render\n"
    assert not (tmp_path / "out.png").exists()


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["render", "nowhere.plsys", "-o", "x.png"], "nowhere.plsys: error: can't be read: No such file"),
        (["render", "nowhere.plsb", "-o", "x.png"], "nowhere.plsb: error: can't be read: No such file"),
        (["render", "scenes/tree.plsys", "-o", "/nowhere/x.png"], "/nowhere/x.png: error: can't be written"),
        (["render", "scenes/tree.plsys", "-o", "/dev/null"], "format"),
        (["render", "scenes/tree.plsys", "-o", "scenes"], "scenes: error"),
        (["render", "scenes/tree.plsys", "-o", "x.pgn"], "use .png"),
        (["render", "scenes/tree.plsys", "-o", "x.png", "-D", "ordr=3"], "-D:1:1: error[unknown-name]: the scene has no Parameter 'ordr'\n 1 | ordr=3\n"),
        (["render", "scenes/tree.plsys", "-o", "x.png", "-D", "ordr=3"], "did you mean 'order'?"),
        (["render", "scenes/tree.plsys", "-o", "x.png", "--memory", "64"], "KB; 64 bytes are allowed"),
        (["render", "scenes/terrain.plsys", "-o", "x.png", "--memory", "64K"], "KB; 64 KB are allowed"),
        (["render", "scenes/tree.plsys", "-o", "x.png", "-D", "order=-3"], "from 0 to 2,000"),
        (["compile", "scenes/tree.plsys", "-o", "/dev/null"], "not an ordinary file"),
        (["compile", "scenes/tree.plsys", "-o", "/nowhere/x.plsb"], "can't be written"),
        (["export", "scenes/tree.plsys", "-o", "x.fbx"], "known: .pov, .obj"),
        (["graph", "scenes/tree.plsys", "-o", "x.gif"], ".svg"),
        (["disassemble", "LICENSE.plsb"], "can't be read"),
    ],
)
def test_bad_arguments_are_one_message(arguments, message, capsys):
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert message.replace(",", "") in told.replace(",", ""), told
    assert len([line for line in told.splitlines() if "error" in line]) == 1


def test_more_memory_than_there_is_may_be_allowed(tmp_path):
    """It is a limit, not an order."""
    assert main(["render", "scenes/tree.plsys", "-o", str(tmp_path / "x.png"), "--size", "8x6", "--memory", "1T"]) == 0


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["rendr", "a"], "no command 'rendr': did you mean 'render'?"),
        (["plant"], "no command 'plant': known: render check format"),
        (["--verson"], "no option '--verson': did you mean '--version'?"),
        (["render", "a", "-o", "b.png", "--memry=4M"], "no option '--memry': did you mean '--memory'?"),
        (["render", "a", "b", "-o", "b.png"], "'b' is one argument too many"),
        (["lsp", "--tcp", "65536"], "'65536' isn't a port, 0 to 65535"),
        (["render", "a", "-o", "b.png", "-D", "n=1", "-D", "n=2"], "'n' is set to 1 and to 2"),
        (["render", "a", "-o", "b.png", "--seed", "x"], "'x' isn't a whole number"),
    ],
)
def test_arguments_that_are_not_known_are_one_message(arguments, message, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    told = capsys.readouterr().err
    assert ended.value.code == 2 and told.count(": error: ") == 1 and message in told


def test_messages_show_no_control_characters(tmp_path, capsys):
    """Terminals would obey them."""
    scene = tmp_path / "scene.plsys"
    scene.write_bytes(b"object { \x1b[31m } // \x9b \xc2\x9b\n")
    assert main(["check", str(scene)]) == 2
    told = capsys.readouterr().err
    assert "U+001B" in told and all(c.isprintable() for c in told.replace("\n", ""))


def test_broken_bytecode_is_told_by_its_name(tmp_path, capsys):
    path = tmp_path / "cut.plsb"
    path.write_bytes(compile("scenes/tree.plsys")[:100])
    assert main(["render", str(path), "-o", str(tmp_path / "x.png")]) == 2
    assert capsys.readouterr().err.startswith(f"{path}: error: bytecode: truncated: 100 bytes")


@pytest.mark.parametrize("arguments", [["render"], ["nonsense"], ["render", "a", "-o", "b", "--size", "9"], []])
def test_usage_errors_exit_with_2(arguments, capsys):
    try:
        code = main(arguments)
    except SystemExit as stop:
        code = stop.code
    assert code == 2


def test_json_tells_wrong_arguments_too(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["render", "scene.plsys", "-o", "x.png", "--size", "4", "--json"])
    written = capsys.readouterr()
    told = json.loads(written.out)
    assert ended.value.code == 2 and told["diagnostics"] == [] and told["error"]["place"] == "arguments"
    assert "'4' isn't WIDTHxHEIGHT" in told["error"]["reason"] and "'4' isn't WIDTHxHEIGHT" in written.err


def test_check_json_names_the_included_file_that_is_wrong(tmp_path, capsys):
    (tmp_path / "plants.plsys").write_text("Selection A { A -> spher; }\n")
    (tmp_path / "scene.plsys").write_text('#include "plants.plsys"\n' + CAMERA + "object { A }\n")
    assert main(["check", str(tmp_path / "scene.plsys"), "--json"]) == 2
    (entry,) = json.loads(capsys.readouterr().out)["files"]
    assert Path(entry["path"]).name == "scene.plsys"
    assert [(Path(d["path"]).name, d["code"], d["line"]) for d in entry["diagnostics"]] == [("plants.plsys", "unknown-name", 1)]


@pytest.mark.parametrize("command", ["check", "format", "compile", "export", "compare", "graph"])
def test_bytecode_where_a_scene_is_needed_is_one_message(command, tmp_path, capsys):
    bytecode, output = tmp_path / "scene.plsb", {"compile": "x.plsb", "export": "x.obj", "graph": "x.svg"}
    bytecode.write_bytes(b"PLSB\x01\0\x1b\xf4")
    options = ["-o", str(tmp_path / output[command])] if command in output else []
    assert main([command, str(bytecode), *options]) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1 and "is bytecode" in told[0]


def test_json_tells_errors_too(tmp_path, capsys):
    scene = tmp_path / "scene.plsys"
    scene.write_text(CAMERA + "object { Tre }\nSelection Tree { Tree -> box; }\n")
    assert main(["render", str(scene), "-o", str(tmp_path / "x.png"), "--json"]) == 2
    told = json.loads(capsys.readouterr().out)
    assert told["error"]["place"] == f"{scene}:2:10" and "Tre" in told["error"]["reason"]
    assert {"code", "severity", "message", "line", "column", "end_line", "end_column", "hint"} <= set(told["diagnostics"][0])


def test_truncated_bytecode(tmp_path, capsys):
    data = compile("scenes/tree.plsys")
    path = tmp_path / "tree.plsb"
    for length in range(0, len(data), 97):
        path.write_bytes(data[:length])
        assert main(["render", str(path), "-o", str(tmp_path / "x.png")]) == 2
    assert not (tmp_path / "x.png").exists()
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("mended", [False, True], ids=["checksum left", "checksum recomputed"])
def test_flipped_bytes_are_refused_or_drawn(mended):
    """A damaged file is refused, or it is another valid scene: then it draws, or ends in an error of the family."""
    data = compile("global_settings { seed 3 }\n" + CAMERA + "object { A } Selection A { C A; if (n > 0) A -> sphere + [ --n; trans rand(0) 0 1 ] A; } Calculation C { n = 3; }\n", sourcemap=False)
    accepted = 0
    for i in range(len(data)):
        damaged = bytearray(data)
        damaged[i] ^= 1 << (i % 8)
        if mended:
            struct.pack_into("<I", damaged, 12, zlib.crc32(damaged[28:]))
        try:
            with Scene(bytes(damaged), threads=1) as scene:
                scene.render(4, 3)
            accepted += 1
        except PlsysRuntimeError as error:
            assert error.place and error.reason
    assert (accepted > 0) == mended


def test_nothing_is_left_of_an_output_that_fails(tmp_path, monkeypatch, capsys):
    import plsys.compiler.export.files as files

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "replace", full)
    assert main(["compile", "scenes/tree.plsys", "-o", str(tmp_path / "tree.plsb")]) == 2
    assert "No space left" in capsys.readouterr().err
    assert list(Path(tmp_path).iterdir()) == []


@pytest.mark.parametrize("command", ["render", "check", "compile", "export", "format"])
@pytest.mark.parametrize("data", [b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)), "camera {}".encode("utf-16")])
def test_files_that_are_no_text_are_one_message(tmp_path, capsys, command, data):
    (tmp_path / "s.plsys").write_bytes(data)
    output = {"render": "s.png", "compile": "s.plsb", "export": "s.obj"}.get(command)
    options = ["-o", str(tmp_path / output)] if output else []
    assert main([command, str(tmp_path / "s.plsys"), *options]) == 2
    out, err = capsys.readouterr()
    assert (out + err).count("\n") == 1 and "isn't text in UTF-8" in out + err


def test_text_is_text_wherever_the_look_at_it_ends(tmp_path, capsys):
    scene = tmp_path / "s.plsys"
    scene.write_bytes(b"// \0" + b"a" * 1019 + "é\nobject { A }\n".encode())  # é is bytes 1024 and 1025
    assert main(["check", str(scene)]) == 2
    assert "unknown name 'A'" in capsys.readouterr().err
