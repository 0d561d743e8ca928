"""The POV-Ray export: what stands in the file, that POV-Ray draws it as we do, and that it is written whole
or not at all."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest
from plsys.compiler.export.povray import export_povray
from plsys.compiler.export.povray_run import draw
from plsys.compiler.export.unfold import unfold
from plsys.compiler.pipeline import build
from plsys.compiler.reading.diagnostics import PlsysError
from plsys.compiler.reading.source import Source
from plsys.runtime import Scene

HEAD = """global_settings { assumed_gamma 1.0 }
background { color rgb <0.2, 0.3, 0.4> }
camera { location <1, -9, 4>  sky <0, 0, 1>  right <-4/3, 0, 0>  look_at <0.5, 0, 0.6>  angle 35 }
light_source { <4, -8, 9> color rgb 1 }
#declare Lacquer = texture { pigment { color rgb <0.8, 0.2, 0.1> } finish { phong 0.4 } }
"""

needs_povray = pytest.mark.skipif(
    shutil.which("povray") is None, reason="povray isn't installed: apt-get install povray"
)


def exported(text: str, tmp_path, **parameters: float) -> str:
    path = tmp_path / "scene.pov"
    export_povray(build(Source.from_text(text), parameters=parameters).graph, path)
    return path.read_text()


def test_one_union_a_texture_and_short_forms_where_the_transform_allows(tmp_path):
    path = tmp_path / "tree.pov"
    result = export_povray(build("scenes/tree.plsys").graph, path)
    text = path.read_text()
    assert result.primitives == 2050 and result.by_kind == {"cylinder": 2049, "plane": 1}
    assert text.startswith("#version 3.7;\n"), "otherwise POV-Ray takes an older version's opacity"
    assert text.count("union {") == 1
    assert len(re.findall(r"^cylinder\{<[^>]*>,<[^>]*>,[^,}]*\}$", text, re.MULTILINE)) == 2049
    assert "matrix" not in text


@pytest.mark.parametrize(
    "body, expected",
    [
        ("[ trans 1 2 3; rotz 90; scale 2 ] sphere", "sphere{<1.0,2.0,3.0>,2.0}"),
        ("[ scale 1 2 3 ] sphere", "sphere{0,1 matrix<1.0,0.0,0.0,0.0,2.0,0.0,0.0,0.0,3.0,0.0,0.0,0.0>}"),
        ("[ trans 0 0 1; scale 2 2 5 ] cylinder", "cylinder{<0.0,0.0,1.0>,<0.0,0.0,6.0>,2.0}"),
        (
            "[ scale 1 2 1 ] cylinder",
            "cylinder{0,z,1 matrix<1.0,0.0,0.0,0.0,2.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0>}",
        ),
        ("[ scale 2 2 1 ] cone(0.25)", "cone{<0.0,0.0,0.0>,2.0,<0.0,0.0,1.0>,0.5}"),
        ("[ trans 1 0 0; scale -2 3 1 ] box", "box{<-1.0,0.0,0.0>,<1.0,3.0,1.0>}"),
        ("[ rotz 90 ] box", "box{<-1.0,0.0,0.0>,<0.0,1.0,1.0>}"),
        ("[ scale 2 ] triangle", "triangle{<0.0,0.0,0.0>,<2.0,0.0,0.0>,<0.0,2.0,0.0>}"),
        ("[ trans 0 0 0.1; scale 3 3 1 ] disc", "disc{<0.0,0.0,0.1>,<0.0,0.0,1.0>,3.0}"),
    ],
)
def test_spelling_of_each_shape(body, expected, tmp_path):
    text = exported(f"{HEAD}object {{ S texture {{ Lacquer }} }}\nSelection S {{ S -> {body}; }}", tmp_path)
    assert expected in text.replace("-0.0", "0.0").splitlines()


def test_numbers_are_read_back_as_the_same_doubles(tmp_path):
    graph = build("scenes/tree.plsys", parameters={"order": 4}).graph
    export_povray(graph, tmp_path / "tree.pov")
    written = re.findall(r"^cylinder\{<([^>]*)>,", (tmp_path / "tree.pov").read_text(), re.MULTILINE)
    batch = next(iter(unfold(graph)))
    origins = batch.matrix[np.array(batch.kinds) == "cylinder"][:, :, 3]
    assert [tuple(map(float, row.split(","))) for row in written] == [tuple(row) for row in origins.tolist()]


def test_textures_of_every_kind_are_spelled_out(tmp_path):
    text = exported(
        HEAD
        + """#declare Tiles = texture { pigment { checker color rgb 1, color rgbt <0, 0, 0, 0.5> scale 2 } finish { reflection 0.2 } }
Texture Leaf { pigment { color rgb <0.1, n/10, 0> } }
sphere { <0, 0, 1>, 1 texture { Tiles } no_shadow }
object { S }
Selection S { C S; if (n > 0) S -> Leaf sphere + Leaf [ trans 1 0 0 ] sphere + [ --n ] S; }
Calculation C { n = 3; }""",
        tmp_path,
    )
    assert "checker rgb<1.0,1.0,1.0> rgbft<0.0,0.0,0.0,0.0,0.5> matrix<2.0,0.0,0.0,0.0,2.0" in text
    assert "reflection { rgb<0.2,0.2,0.2> }" in text
    assert text.count("no_shadow") == 1
    assert text.count("union {") == 3  # one a colour of Leaf; the one sphere with Tiles needs none


def test_singular_subtrees_are_listed_as_lost(tmp_path):
    text = f"{HEAD}object {{ S }}\nSelection S {{ C S; S -> sphere + [ scale a 1 1 ] box; }}\nCalculation C {{ a = rand(0)*0; }}"
    path = tmp_path / "scene.pov"
    result = export_povray(build(Source.from_text(text)).graph, path)
    assert len(result.lost) == 1 and "singular" in result.lost[0]
    assert result.lost[0] in path.read_text()


def test_a_scene_that_fails_while_it_is_written_leaves_no_file(tmp_path):
    text = f"{HEAD}object {{ S }}\nSelection S {{ C S; if (n > 0) S -> [ scale 1/(n - 1) ] sphere + [ --n ] S; }}\nCalculation C {{ n = 5; }}"
    with pytest.raises(PlsysError):
        export_povray(build(Source.from_text(text)).graph, tmp_path / "scene.pov")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "rule, message",
    [
        ("if (n > 0) S -> [ scale 0.5 ] (sphere + S); else S -> box;", "without end"),
        ("if (n > -60) S -> [ --n ] (S + S + S); else S -> box;", "a number of 30 digits"),
        ("if (n > -20) S -> [ --n ] (S + S + S); else S -> box;", "10,460,353,203 primitives"),
    ],
)
def test_scenes_too_large_for_any_file_are_refused_at_once(rule, message, tmp_path):
    text = f"{HEAD}object {{ S }}\nSelection S {{ C S; {rule} }}\nCalculation C {{ n = 1; }}"
    with pytest.raises(PlsysError, match=message):
        export_povray(build(Source.from_text(text)).graph, tmp_path / "scene.pov")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_does_not_exist_is_one_clear_error(tmp_path):
    with pytest.raises(PlsysError, match="can't be written"):
        export_povray(build("scenes/tree.plsys").graph, tmp_path / "missing" / "tree.pov")


EVERY_SHAPE = [
    "sphere", "[ scale 1 0.5 1.5 ] sphere", "cylinder", "[ shear 0.3 0 0 0 0 0.2 ] cylinder", "cone(0.4)", "cone(0)",
    "[ rotx 20; scale 1 0.7 1 ] cone(1.5)", "box", "[ rotz 30; roty 20 ] box", "torus(0.3)", "[ rotx 70; scale 1 0.5 2 ] torus(0.2)",
    "triangle", "[ roty 200 ] square", "[ rotx 30; scale 1 0.5 1 ] square", "disc", "[ rotx 30; scale 1 0.5 1 ] disc",
    "[ scale -1 1 1; rotz 40 ] box", "[ trans 0 0 0.5; scale 0.0001 ] sphere",
]  # fmt: skip


@needs_povray
@pytest.mark.povray
def test_povray_draws_every_shape_as_we_do(tmp_path):
    """All on one chart, three rows of six; a pixel or two may lie on an edge to the last bit."""
    terms = [
        f"[ trans {3 * (i % 6) - 7.5} 0 {3 * (i // 6) - 3} ] {body}" for i, body in enumerate(EVERY_SHAPE)
    ]
    text = HEAD.replace("<1, -9, 4>", "<1, -30, 6>")
    text += f"object {{ S texture {{ Lacquer }} rotate <10, 20, 30> }}\nSelection S {{ S -> {' + '.join(terms)}; }}"
    compilation = build(Source.from_text(text))
    export_povray(compilation.graph, tmp_path / "scene.pov")
    theirs = draw(tmp_path / "scene.pov", 320, 240).pixels
    with Scene(compilation.encode(), povray_epsilon=True) as scene:
        image = scene.render(320, 240, channels=("color", "primitive"))
    differing = np.abs(np.clip(image["color"], 0, 1) - theirs).max(axis=2) > 1e-5
    assert np.count_nonzero(differing) <= 2
    assert len(np.unique(image["primitive"])) >= len(EVERY_SHAPE)


@needs_povray
@pytest.mark.povray
def test_a_scene_that_povray_refuses_is_told_with_its_own_words(tmp_path):
    (tmp_path / "bad.pov").write_text("sphere { nonsense }")
    with pytest.raises(PlsysError, match="nonsense"):
        draw(tmp_path / "bad.pov", 8, 6)


def test_more_textures_than_unions_are_written_with_their_primitives(tmp_path, monkeypatch):
    """A scene in which everything has a colour of its own is still written, only longer."""
    monkeypatch.setattr("plsys.compiler.export.povray.MOST_UNIONS", 5)
    text = f"""{HEAD}Texture Own {{ pigment {{ color rgb <n/20, rand(0), 0> }} }}
object {{ S }}
Selection S {{ C S; if (n > 0) S -> Own (sphere + [ trans 1 0 0 ] sphere) + [ --n; trans 2 0 0 ] S; }}
Calculation C {{ n = 20; }}"""
    written = exported(text, tmp_path)
    assert written.count("union {") == 5
    assert written.count("object{sphere") == 30
    assert written.count("sphere{") == 40
