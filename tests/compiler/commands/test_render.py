"""``plsys render``, ``check``, ``compile``, ``export`` and ``disassemble`` as a user sees them: pictures, JSON, text."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from plsys.compiler.cli import main
from plsys.runtime import Scene

TREE = "scenes/tree.plsys"
SMALL = ["--size", "48x36"]
CAMERA = "camera { location <0, -5, 1> sky <0, 0, 1> right <-4/3, 0, 0> look_at 0 }\n"


def pixels(path) -> np.ndarray:
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT))


def facts(capsys, *arguments: str) -> dict:
    assert main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_render_json(tmp_path, capsys):
    told = facts(capsys, "render", TREE, "-o", str(tmp_path / "t.png"), *SMALL)
    assert told["scene"] == TREE and (told["width"], told["height"]) == (48, 36)
    assert told["accelerator"] == "bvh" and told["povray_epsilon"] is False
    assert told["primitives"] == 2049 and told["states"] == 13
    assert told["rays"]["primary"] == 48 * 36 and told["rays"]["shadow"] > 0 and told["rays"]["reflection"] == 0
    assert set(told["seconds"]) == {"read", "verify", "states", "build", "trace", "trace_cpu", "write", "first_pixel"}
    assert told["seconds"]["read"] < told["seconds"]["first_pixel"] < sum(told["seconds"].values())
    assert told["seconds"]["trace_cpu"] > 0
    assert told["memory"]["scene_bytes"] > 0 and told["memory"]["peak_rss_bytes"] > 1e6
    assert all(set(row) == {"what", "why"} for row in told["left_out"])
    assert told["image"] == str(tmp_path / "t.png")


def test_a_thousand_else_ifs(tmp_path, capsys):
    """They are no nesting: such a scene checks and compiles, and the picture shows what the one that holds places."""
    rules = "".join(f"if (n == {i}) A -> box; else\n    " for i in range(999))
    text = """camera {{ location <0, 0, -5> look_at 0 }} object {{ A texture {{ pigment {{ color rgb 1 }} finish {{ ambient 1 }} }} }}
Calculation C {{ n = {n}; }}
Selection A
{{
    C A;
    {rules}if (n == 999) A -> sphere + [ trans 1 0 0 ] sphere;
}}
"""
    for n, count in ((998, 1), (999, 2), (1000, 0)):
        scene = tmp_path / "chain.plsys"
        scene.write_text(text.format(n=n, rules=rules))
        assert main(["check", str(scene)]) == 0
        assert main(["format", "--check", str(scene)]) in (0, 1)
        capsys.readouterr()
        told = facts(capsys, "render", str(scene), "-o", str(tmp_path / "c.png"), *SMALL)
        assert told["primitives"] == count
        assert bool(pixels(tmp_path / "c.png").any()) is (count > 0)


def test_statistics_add_up(tmp_path, capsys):
    told = facts(capsys, "render", TREE, "-o", str(tmp_path / "t.png"), "--threads", "1", *SMALL)
    rays, tests, each = sum(told["rays"].values()), told["tests"], told["tests_per_ray"]
    assert told["threads"] == 1 and told["rays_per_second"] == pytest.approx(rays / told["seconds"]["trace"], rel=0.01)
    assert set(each) == set(tests) == {"nodes", "instances", "primitives_filtered", "primitives"}
    assert all(each[name] == pytest.approx(tests[name] / rays, abs=1e-3) for name in tests) and tests["nodes"] > 0
    parts = [f"{name}_bytes" for name in ("program", "meshes", "states", "nodes", "items")]
    assert sum(told["memory"][part] for part in parts) == told["memory"]["scene_bytes"]
    assert told["front"]["items"] > 0 and told["lazy"]["found"] == told["lazy"]["unfolded"] == 0
    assert told["ended"] == {"bailout": 0, "trace_level": 0}


def test_statistics_of_states_that_are_unfolded_when_rays_come(tmp_path, capsys):
    unique = ["scenes/forest.plsys", "-D", "unique=1", "-D", "order=4", "-o", str(tmp_path / "t.png")]
    lazy = facts(capsys, "render", *unique, *SMALL)["lazy"]
    assert lazy["found"] > 0 and lazy["unfolded"] >= lazy["states"] > 0
    assert main(["render", *unique, "--statistics", *SMALL]) == 0
    assert re.search(r"^states unfolded +[\d,]+ ", capsys.readouterr().out, re.MULTILINE)


def test_tables_for_the_terminal(tmp_path, capsys):
    arguments = ["render", TREE, "-o", str(tmp_path / "t.png"), *SMALL]
    assert main([*arguments, "--explain"]) == 0
    built = capsys.readouterr().out
    assert re.search(r"^built: states +[\d,]+ bytes  13 in", built, re.MULTILINE) and "left out: transformation" in built
    assert main([*arguments, "--statistics"]) == 0
    table = dict(re.split(r"  +", line)[:2] for line in capsys.readouterr().out.splitlines())
    assert table["rays, primary"] == "1,728" and table["primitives of the scene"] == "2,049"
    assert float(table["nodes"].replace(",", "")) > 0 and float(table["seconds, first pixel"]) > 0
    assert "rays, reflection" not in table


@pytest.mark.parametrize(
    "command, file, options, message",
    [
        ("render", "t.png", ["--grid", "4x4x4"], "--grid: error: the voxels of --accel grid"),
        ("render", "t.png", ["--grid", "4x4x4", "--accel", "boxes"], "drawn with --accel boxes"),
        ("render", "t.png", ["--front", "21", "--accel", "none"], "--front: error: fronts are built by --accel bvh"),
        ("render", "t.jpg", ["--linear16"], "--linear16: error: '.jpg' doesn't hold 16-bit integers"),
        ("render", "t.exr", ["--linear16"], "these do: .png, .tif"),
        ("export", "t.pov", ["--tolerance", "0.1"], "--tolerance: error: the tolerance of meshes"),
    ],
)
def test_no_option_is_silently_ignored(tmp_path, capsys, command, file, options, message):
    assert main([command, TREE, "-o", str(tmp_path / file), *options]) == 2
    assert message in capsys.readouterr().err and not list(tmp_path.iterdir())


@pytest.mark.parametrize("names", ["", "depth,,normal", ","])
def test_a_channel_without_a_name_is_none(tmp_path, capsys, names):
    with pytest.raises(SystemExit) as end:
        main(["render", TREE, "-o", str(tmp_path / "t.png"), "--aov", names])
    assert end.value.code == 2 and "no channel ''" in capsys.readouterr().err


def test_small_pictures_start_quickly(tmp_path):
    """Libraries take longer to import than this picture takes to draw, and OpenImageIO and NumPy 36 and 17 MB."""
    code = (
        "import sys; from plsys.compiler.cli import main; status = main(sys.argv[1:])\n"
        "slow = {'numpy', 'rich', 'trimesh', 'OpenImageIO', 'PIL', 'PIL.JpegImagePlugin', 'plsys.compiler.reading.habits'}\n"
        "print(status, *sorted(slow & set(sys.modules)))"
    )
    for name, library in (("t.png", "PIL"), ("t.exr", "OpenImageIO"), ("t.jpg", "OpenImageIO")):
        command = [sys.executable, "-c", code, "render", TREE, "-o", str(tmp_path / name), *SMALL]
        done = subprocess.run(command, capture_output=True, text=True)
        assert (done.stdout, done.stderr) == (f"0 {library}\n", "")


def test_formats_hold_the_same_picture(tmp_path, capsys):
    for name in ("a.png", "a.exr", "a.tif"):
        assert main(["render", TREE, "-o", str(tmp_path / name), *SMALL]) == 0
    assert main(["render", TREE, "-o", str(tmp_path / "linear.png"), "--linear16", *SMALL]) == 0
    linear = pixels(tmp_path / "a.exr")
    np.testing.assert_array_equal(pixels(tmp_path / "a.tif"), linear)
    np.testing.assert_allclose(pixels(tmp_path / "linear.png"), np.clip(linear, 0, 1), atol=0.51 / 65535)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(pixels(tmp_path / "a.png"), np.clip(srgb, 0, 1), atol=0.51 / 255)


def test_the_file_says_where_it_is_from(tmp_path):
    path = tmp_path / "t.exr"
    assert main(["render", TREE, "-o", str(path), "-D", "order=3", *SMALL]) == 0
    spec = oiio.ImageInput.open(str(path)).spec()
    assert spec.getattribute("Software") == "plsys" and spec.getattribute("plsys:scene") == TREE
    assert spec.getattribute("plsys:parameters") == "order=3"


@pytest.mark.parametrize("options", [[], ["--linear16"]])
def test_a_png_says_where_it_is_from_and_what_its_numbers_mean(tmp_path, options):
    scene, path = tmp_path / "Bäume.plsys", tmp_path / "t.png"
    scene.write_text(Path(TREE).read_text())
    assert main(["render", str(scene), "-o", str(path), "-D", "order=3", *SMALL, *options]) == 0
    spec = oiio.ImageInput.open(str(path)).spec()
    assert spec.getattribute("Software") == "plsys" and spec.getattribute("plsys:scene") == str(scene)
    assert spec.getattribute("ImageDescription") == f"{scene}, rendered by plsys"
    assert spec.getattribute("plsys:parameters") == "order=3" and spec.format == ("uint16" if options else "uint8")
    assert ("srgb" in spec.getattribute("oiio:ColorSpace").lower()) == (not options)


def test_bytecode_renders_the_same_picture(tmp_path, capsys):
    compiled, direct, through = tmp_path / "t.plsb", tmp_path / "a.exr", tmp_path / "b.exr"
    told = facts(capsys, "compile", TREE, "-o", str(compiled))
    assert told["bytes"] == compiled.stat().st_size <= 1500
    assert main(["render", TREE, "-o", str(direct), *SMALL]) == 0
    assert main(["render", str(compiled), "-o", str(through), *SMALL]) == 0
    np.testing.assert_array_equal(pixels(direct), pixels(through))


def test_inputs_change_the_plant(tmp_path, capsys):
    told = facts(capsys, "render", TREE, "-o", str(tmp_path / "t.png"), "-D", "order=4", *SMALL)
    assert told["primitives"] == 2 + 2**5 - 1
    seeds = [tmp_path / f"{seed}.exr" for seed in (1, 2)]
    for seed, path in zip((1, 2), seeds):
        assert main(["render", "scenes/tree3d.plsys", "-o", str(path), "--seed", str(seed), *SMALL]) == 0
    assert not np.array_equal(pixels(seeds[0]), pixels(seeds[1]))


def test_extra_channels(tmp_path):
    path = tmp_path / "t.exr"
    names = "depth,normal,position,primitive,symbol,rule,recursion,boxes,picture1"
    assert main(["render", TREE, "-o", str(path), "--aov", names, *SMALL]) == 0
    channels = {name: layer for name, layer in zip(oiio.ImageBuf(str(path)).spec().channelnames, np.moveaxis(pixels(path), 2, 0))}
    hit = np.isfinite(channels["Z"]) & (channels["Z"] < 1e30)
    normal = np.stack([channels[f"N.{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(np.linalg.norm(normal, axis=0)[hit], 1, atol=1e-6)
    eye = np.array([0, -14, 5])[:, None, None]
    position = np.stack([channels[f"P.{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(np.linalg.norm(position - eye, axis=0)[hit], channels["Z"][hit], rtol=1e-5)
    assert channels["recursion"].max() > 3 and channels["boxes"].max() > 0
    assert set(np.unique(channels["symbol"][hit])) == {-1, 0}


def test_picture_1_colours_the_background_by_recursion_depth(tmp_path):
    path = tmp_path / "t.png"
    assert main(["render", TREE, "-o", str(path), "--aov", "picture1", "--size", "96x72"]) == 0
    shown = pixels(tmp_path / "t.picture1.png")
    red, blue = (shown[..., 0] > shown[..., 2]), (shown[..., 2] > shown[..., 0])
    assert red.sum() > 10 and blue.sum() > 10


def test_antialiasing_softens_edges_only(tmp_path):
    plain, fine = tmp_path / "a.exr", tmp_path / "b.exr"
    assert main(["render", TREE, "-o", str(plain), *SMALL]) == 0
    assert main(["render", TREE, "-o", str(fine), "--antialias", "grid=3", *SMALL]) == 0
    difference = np.abs(pixels(plain) - pixels(fine)).max(axis=2)
    assert 0.05 < np.mean(difference > 0.01) < 0.9


def test_check_json(capsys):
    told = facts(capsys, "check", TREE, "scenes/menger.plsys")
    tree, menger = told["files"]
    assert tree["path"] == TREE and tree["diagnostics"] == []
    forecast = tree["forecast"]
    assert forecast["primitives"] == 2049 and forecast["by_kind"] == {"cylinder": 2049}
    assert forecast["primitives_range"] == {"low": 2049, "expected": 2049, "high": 2049}
    assert (forecast["states"], forecast["depth"], forecast["infinite"]) == (13, 13, False)
    assert 0 < forecast["bytecode_bytes"] <= 1500
    assert menger["forecast"]["primitives"] == 8000


def test_a_picture_that_is_interrupted_leaves_the_old_one(tmp_path):
    """At once, and not only where a progress bar is shown."""
    old = tmp_path / "t.png"
    old.write_bytes(b"old")
    command = [sys.executable, "-m", "plsys.compiler.cli", "render", TREE, "-o", old, "--size", "8000x8000", "--antialias", "grid=9"]
    drawing = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    )
    # As soon as the runtime is loaded.
    while "libplsys" not in Path(f"/proc/{drawing.pid}/maps").read_text():
        time.sleep(0.01)
    time.sleep(0.5)
    drawing.send_signal(signal.SIGINT)
    try:
        told = drawing.communicate(timeout=120)[1]
    finally:
        drawing.kill()
    assert told == "plsys: interrupted\n" and drawing.returncode == 130
    assert list(tmp_path.iterdir()) == [old] and old.read_bytes() == b"old"


@pytest.mark.parametrize(
    "symbol, sentence",
    [
        ("A -> [ rotz 9 ] sphere + box;", "1 box and 1 sphere, 1 state, depth 1"),
        ("A -> 1: sphere + box | 1: sphere;", "1 to 2 primitives, about 2 expected, 1 state, depth 1"),
        ("A -> 1: sphere + [ scale 0.5 ] A | 1: box;", "1 primitive or more, about 2 expected, 1 state, depth 1"),
    ],
)
def test_check_says_what_a_scene_has(symbol, sentence, tmp_path, capsys):
    scene = tmp_path / "s.plsys"
    scene.write_text(CAMERA + "Selection A { " + symbol + " }\nobject { A }\n")
    assert main(["check", str(scene)]) == 0
    assert capsys.readouterr().out == f"{scene}: {sentence}\n"


def test_large_counts_are_decimal_strings(capsys):
    told = facts(capsys, "check", TREE, "-D", "order=1000")
    assert told["files"][0]["forecast"]["primitives"] == str(2 + 2**1001 - 1)


def test_draws_that_decide_the_count_give_a_range(tmp_path, capsys):
    scene = tmp_path / "s.plsys"
    scene.write_text(
        "Selection A { C A; if (n > 0) A -> 3: box + [ --n ] A | 1: box; else A -> ; }\n"
        "Calculation C { n = 2; }\nobject { A }\n"
    )
    forecast = facts(capsys, "check", str(scene))["files"][0]["forecast"]
    assert forecast["primitives"] is None
    assert forecast["primitives_range"] == {"low": 1, "expected": 1.75, "high": 2}


def test_check_tells_errors_with_places(tmp_path, capsys):
    scene = tmp_path / "s.plsys"
    scene.write_text("object { Tre }\nSelection Tree { Tree -> box; }\n")
    assert main(["check", str(scene), "--json"]) == 2
    entry = json.loads(capsys.readouterr().out)["files"][0]
    error = next(d for d in entry["diagnostics"] if d["severity"] == "error")
    assert (error["line"], error["column"], error["end_line"], error["end_column"]) == (1, 10, 1, 13)
    assert error["code"] == "unknown-name" and "Tree" in error["hint"] and entry["forecast"] is None


def test_both_disassemblers_print_the_same(tmp_path, capsys):
    data = tmp_path / "t.plsb"
    assert main(["compile", TREE, "-o", str(data)]) == 0
    capsys.readouterr()
    assert main(["disassemble", str(data)]) == 0
    text = capsys.readouterr().out
    from plsys.runtime import disassemble

    assert disassemble(data.read_bytes()) == text
    assert "symbol" in text and "Tree" in text


@pytest.mark.parametrize("command", ["render", "check", "compile", "export", "compare", "graph", "disassemble"])
def test_every_command_explains_itself(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code == 0
    shown = capsys.readouterr().out
    assert "--json" in shown and len(shown.splitlines()) > 8


def test_a_closed_pipe_is_no_error():
    code = "from plsys.compiler.cli import main; import sys; sys.exit(main(['disassemble', 'scenes/tower.plsys']))"
    shell = f'"{sys.executable}" -c "{code}" | head -1'
    done = subprocess.run(["bash", "-o", "pipefail", "-c", shell], capture_output=True, text=True)
    assert "Traceback" not in done.stderr and done.stdout.startswith("bytecode")


def test_the_same_seed_gives_the_same_bits_again(tmp_path):
    paths = [tmp_path / f"{i}.exr" for i in range(2)]
    for path, threads in zip(paths, "12"):
        assert main(["render", "scenes/bush.plsys", "-o", str(path), "--threads", threads, *SMALL]) == 0
    np.testing.assert_array_equal(pixels(paths[0]), pixels(paths[1]))


def test_a_scene_can_be_used_from_python():
    from plsys.compiler import compile

    with Scene(compile(TREE, parameters={"order": 3})) as scene:
        hits = scene.intersect(np.array([[0.0, -14, 1], [0, -14, 1]]), np.array([[0.0, 1, 0], [0, 0, 1]]))
        assert hits.t[0] == pytest.approx(14 - 0.15) and np.isinf(hits.t[1])
        assert np.isnan(hits.bound[0]) and hits.primitive[1] == -1
        assert scene.occluded(np.array([[0.0, -14, 1]]), np.array([[0.0, 1, 0]]), np.array([13.0])).tolist() == [False]
