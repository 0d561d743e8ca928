"""The façade: ``plsys.compiler.compile`` and the pipeline behind it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import plsys.compiler
import pytest
from plsys.compiler.bytecode.decode import decode
from plsys.compiler.pipeline import build

TREE = Path(__file__).parents[2] / "scenes" / "tree.plsys"
SCENE = "Parameter n = 2 [0 to 9];\nobject { A(n) }\nSelection A(k) { if (k > 0) A -> box + A(k - 1); }\n"


def test_a_path_and_its_text_give_the_same_program():
    by_path = decode(plsys.compiler.compile(TREE))
    by_text = decode(plsys.compiler.compile(TREE.read_text(), name="tree.plsys"))
    assert by_path.code == by_text.code and by_path.constants == by_text.constants
    assert plsys.compiler.compile(str(TREE)) == plsys.compiler.compile(TREE)


def test_figure_2_1_takes_less_than_one_and_a_half_kilobytes():
    assert len(plsys.compiler.compile(TREE.read_text(), name="scenes/tree.plsys")) <= 1500


def test_parameters_and_seed_go_into_the_bytecode():
    assert plsys.compiler.compile(SCENE, {"n": 3}) != plsys.compiler.compile(SCENE)
    settings = decode(plsys.compiler.compile(SCENE, seed=5)).records[0]
    assert settings.values[settings.row.values["seed"].offset] == 5


def test_the_same_scene_gives_the_same_bytes():
    assert plsys.compiler.compile(SCENE) == plsys.compiler.compile(SCENE)


def test_errors_come_together_with_their_places():
    with pytest.raises(plsys.compiler.SceneError) as caught:
        plsys.compiler.compile("object { Tre }\nobject { Branc }\n", name="wrong.plsys")
    assert caught.value.place.startswith("wrong.plsys:1:")
    assert len([d for d in caught.value.diagnostics if d.severity == "error"]) >= 2


def test_a_file_that_is_not_there():
    with pytest.raises(plsys.compiler.PlsysError, match="nowhere.plsys: can't be read: No such file"):
        plsys.compiler.compile("nowhere.plsys")


def test_a_parameter_out_of_its_range_is_an_error():
    with pytest.raises(plsys.compiler.SceneError):
        plsys.compiler.compile(SCENE, {"n": 10})


def test_warnings_do_not_stop_and_stay_with_the_compilation():
    compilation = build(plsys.compiler.pipeline.Source.from_text(SCENE + "Selection B { B -> sphere; }\n"))
    assert any(d.severity == "warning" for d in compilation.diagnostics)
    assert any(row.what == "symbol B" for row in compilation.left_out)


def test_compiling_needs_neither_numpy_nor_the_runtime():
    code = (
        "import sys, plsys.compiler; quick = set(sys.modules);"
        f"plsys.compiler.compile({str(TREE)!r});"
        "loaded = set(sys.modules);"
        "print('plsys.compiler.pipeline' in quick, 'numpy' in loaded, 'plsys.runtime' in loaded)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"] * 3


def test_nesting_beyond_reason_is_one_clear_error():
    deep = "(" * 30_000 + "1" + ")" * 30_000
    with pytest.raises(plsys.compiler.PlsysError):
        plsys.compiler.compile(f"object {{ A }}\nSelection A {{ if ({deep}) A -> box; }}\n")
