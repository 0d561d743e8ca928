"""Quick fixes: each row a text with a message, and what its first fix makes of it. After it the message is gone."""

from __future__ import annotations

import pytest

from plsys.compiler.analysis import CODES
from plsys.compiler.analysis.fixes import FIXES, fix_all, ignoring
from tests.compiler.analysis.edits import applied, fixed, messages, opened

HEAD = "camera { location <0, -9, 0> sky <0, 0, 1> look_at <0, 0, 0> }\nlight_source { <2, -3, 4> color rgb 1 }\n"

FIXTURES = [
    # how it is written
    ("missing", "Calculation C { n = 1 }", "Calculation C { n = 1; }"),
    ("missing", "Selection A { A box; }", "Selection A { A -> box; }"),
    ("missing", "#declare A 1;", "#declare A = 1;"),
    ("missing", "Parameter p;", "Parameter p = 1;"),
    ("missing", "Calculation C", "Calculation C { --count; }"),
    ("syntax", "Selection A { A => box; }", "Selection A { A -> box; }"),
    ("syntax", "Selection A { if n > 0 A -> box; }", "Selection A { if (n > 0) A -> box; }"),
    ("syntax", "Selection A { if (n > 0) A -> box; elseif (n < 0) A -> disc; }", "Selection A { if (n > 0) A -> box; else if (n < 0) A -> disc; }"),
    ("syntax", "Selection A { A -> box +; }", "Selection A { A -> box ; }"),
    ("syntax", "Selection A { A -> 1: box | disc; }", "Selection A { A -> 1: box | 1: disc; }"),
    ("syntax", "Selection A { if (n > 0) { A -> box; } }", "Selection A { if (n > 0) A -> box; }"),
    ("syntax", "camera { location (0, 0, 1) }", "camera { location <0, 0, 1> }"),
    ("unknown-name", "Transformation T { trans 0 0 2*height; }", "Transformation T { trans 0 0 2*height; }\n#declare height = 1;"),
    ("syntax", "Calculation C { n = .5; }", "Calculation C { n = 0.5; }"),
    ("syntax", "Calculation C { n = 5.; }", "Calculation C { n = 5.0; }"),
    ("syntax", "Calculation C { n = 2x; }", "Calculation C { n = 2*x; }"),
    ("syntax", "Calculation C { n = sin (x); }", "Calculation C { n = sin(x); }"),
    ("syntax", "Transformation T { trans(0, 0, 1); }", "Transformation T { trans 0, 0, 1; }"),
    ("syntax", "Parameter p = 1 [0, 2];", "Parameter p = 1 [0 to  2];"),
    ("syntax", "camera { angle 45; }", "camera { angle 45 }"),
    ("syntax", "Calculation C { n = 1;; }", "Calculation C { n = 1; }"),
    ("syntax", "Selction A { A -> box; }", "Selection A { A -> box; }"),
    ("assignment-in-condition", "Selection A { if (n = 0) A -> box; }", "Selection A { if (n == 0) A -> box; }"),
    ("unclosed", "Calculation C { n = 1;\n", "Calculation C { n = 1; }\n"),
    ("unclosed", "Calculation C {\n    n = 1;\n", "Calculation C {\n    n = 1;\n}\n"),
    ("unclosed", 'Parameter p = 1 "Age;\n', 'Parameter p = 1 "Age;"\n'),
    ("unclosed", "Calculation C { n = 1; } /* done\n", "Calculation C { n = 1; } /* done */\n"),
    ("unclosed", "Selection A { A -> (box + disc; }", "Selection A { A -> (box + disc); }"),
    ("unclosed", "Selection A { A -> [ scale 2 box; }", None),
    ("syntax", "Selection A { A ->\u00a0box; }", "Selection A { A -> box; }"),
    ("syntax", "Selection A {\u2003A -> box; }", "Selection A { A -> box; }"),
    ("encoding", "Calculation C { n =\0 1; }", "Calculation C { n = 1; }"),
    ("unsupported", "#local A = 1;", "#declare A = 1;"),
    # names
    ("unknown-name", "object { Tee }\nSelection Tree { Tree -> box; }", "object { Tree }\nSelection Tree { Tree -> box; }"),
    ("unknown-name", "object { Fern }", "object { Fern }\nSelection Fern { Fern -> ; }"),
    ("unknown-name", "Selection A { A -> T_up box; }", "Selection A { A -> T_up box; }\nTransformation T_up { trans 0 0 1; }"),
    ("unknown-name", "sphere { 0, 1 rotat 3 }", "sphere { 0, 1 rotate 3 }"),
    ("duplicate-name", "Calculation C { n = 1; }\nCalculation C { n = 2; }\n", "Calculation C { n = 1; }\n"),
    ("duplicate-name", "Selection sphere { sphere -> box; }", "Selection my_sphere { my_sphere -> box; }"),
    ("syntax", "camera { location <0 0, 1> }", "camera { location <0, 0, 1> }"),
    ("wrong-kind", "Transformation T { rotx 3 roty 4; }", "Transformation T { rotx 3; roty 4; }"),
    ("wrong-kind", "Selection A { A -> box sphere; }", "Selection A { A -> box + sphere; }"),
    ("wrong-kind", "Selection A { B -> box; }\nSelection B { B -> box; }", "Selection A { A -> box; }\nSelection B { B -> box; }"),
    ("wrong-arguments", "object { A(1) }\nSelection A { A -> box; }", "object { A }\nSelection A { A -> box; }"),
    ("wrong-order", "camera { look_at 0 location <0, -9, 0> angle 45 }", "camera { location <0, -9, 0> look_at 0 angle 45 }"),
    ("unsupported", "global_settings { assumed_gamma 2.2 }", "global_settings { assumed_gamma 1.0 }"),
    ("unsupported", "sphere { 0, 1 hollow }", "sphere { 0, 1 }"),
    ("unsupported", "#version 3.7;\nsphere { 0, 1 }\n", "sphere { 0, 1 }\n"),
    ("unsupported", "#undef A\nsphere { 0, 1 }\n", "sphere { 0, 1 }\n"),
    ("wrong-kind", "Selection A { A -> box [ trans 0 0 1 ] T_up + disc; }\nTransformation T_up { scale 2; }",
     "Selection A { A -> [ trans 0 0 1 ] T_up box + disc; }\nTransformation T_up { scale 2; }"),
    ("wrong-kind", "Selection A { A -> box; }\nunion { A }", "Selection A { A -> box; }\nunion { object { A } }"),
    ("syntax", "Selection A { A -> box | T A | disc; }\nTransformation T { scale 0.5; }",
     "Selection A { A -> 1: box | 1: T A | 1: disc; }\nTransformation T { scale 0.5; }"),
    ("unclosed", "Selection A { A -> [ trans 0 0 1 box; }", "Selection A { A -> [ trans 0 0 1 ] box; }"),
    ("unclosed", "Selection A { A -> box + [ --n A(n - 1); }", None),
    ("wrong-arguments", "Selection A { A -> torus; }", "Selection A { A -> torus(0.2); }"),
    ("wrong-arguments", "Selection A { A -> [ n = rand() ] [ scale n ] box; }", "Selection A { A -> [ n = rand(1) ] [ scale n ] box; }"),
    ("wrong-arguments", "Selection A { A -> [ trans 0 2 ] box; }", "Selection A { A -> [ trans 0 2 0 ] box; }"),
    ("wrong-arguments", "Transformation T { trans 0, 2, n*3, 4; }\nCalculation C { n = 1; }", "Transformation T { trans 0, 2, n*3; }\nCalculation C { n = 1; }"),
    ("wrong-arguments", "Transformation T { scale 2 3; }", "Transformation T { scale 2 3 1; }"),
    ("wrong-arguments", "Selection A(a, b) { A -> [ scale a b 1 ] A(2*a); }", "Selection A(a, b) { A -> [ scale a b 1 ] A(2*a, 1); }"),
    ("wrong-arguments", "Selection A(a) { A -> [ scale a ] A(a, 2); }", "Selection A(a) { A -> [ scale a ] A(a); }"),
    ("wrong-arguments", "object { A }\nSelection A(a) { A -> [ scale a ] box; }", "object { A(1) }\nSelection A(a) { A -> [ scale a ] box; }"),
    ("wrong-arguments", "sphere { <1, 2, 3> }", "sphere { <1, 2, 3>, 1 }"),
    ("wrong-arguments", "#declare A = cylinder { <1, 2, 3> }", "#declare A = cylinder { <1, 2, 3>, <1, 1, 1>, 1 }"),
    ("syntax", "Selection A { A -> 2: box | disc; }", "Selection A { A -> 2: box | 1: disc; }"),
    ("unknown-name", "sphere { 0, 1 phong 0.5 }", "sphere { 0, 1 finish { phong 0.5 } }"),
    ("unknown-name", "sphere { 0, 1 color rgb <1, 0, 0> no_shadow }", "sphere { 0, 1 pigment { color rgb <1, 0, 0> } no_shadow }"),
    ("unknown-name", "sphere { 0, 1 texture { color Red } }", "sphere { 0, 1 texture { pigment { color Red } } }"),
    ("unknown-name", "sphere { 0, 1 pigment { color red } }", "sphere { 0, 1 pigment { color Red } }"),
    ("unknown-name", "Selection A { [ n = True ] A; A -> [ scale n ] box; }", "Selection A { [ n = 1 ] A; A -> [ scale n ] box; }"),
    ("unknown-name", "Selection A { A -> cube; }", "Selection A { A -> box; }"),
    ("unknown-name", "Selection A { A -> [ rotateX 30 ] box; }", "Selection A { A -> [ rotx 30 ] box; }"),
    ("unknown-name", "Selection A { A -> [ translate 0 0 1 ] box; }", "Selection A { A -> [ trans 0 0 1 ] box; }"),
    ("unknown-name", "Selection A { A -> [ rotate 30 0 0 1 ] box; }", "Selection A { A -> [ rot 30 0 0 1 ] box; }"),
    ("include", '#include "colors.inc"\nsphere { 0, 1 }\n', "sphere { 0, 1 }\n"),
    # what POV-Ray has, in the wrong place or not at all
    ("wrong-value", "object { big-tree }\nSelection big_tree { big_tree -> box; }", "object { big_tree }\nSelection big_tree { big_tree -> box; }"),
    ("unknown-name", "Parameter tree_age = 1;\nTransformation T { trans 0 0 2*tree-age; }", "Parameter tree_age = 1;\nTransformation T { trans 0 0 2*tree_age; }"),
    ("wrong-kind", "Selection A { A -> sphere { <1, 2, -3>, 0.5 }; }", "Selection A { A -> [ trans 1 2 -3; scale 0.5 ] sphere; }"),
    ("wrong-kind", "Selection A { A -> box { <0, 0, 0>, 1 } + disc; }", "Selection A { A -> box + disc; }"),
    ("wrong-kind", "Selection A { A -> box { <1, 1, 2>, <0, 0, 0> }; }", "Selection A { A -> [ scale 1 1 2 ] box; }"),
    ("wrong-kind", "Selection A { A -> cylinder { <0, 0, 1>, <0, 0, 3>, 0.5 }; }", "Selection A { A -> [ trans 0 0 1; scale 0.5 0.5 2 ] cylinder; }"),
    ("wrong-kind", "Selection A { A -> object { B(2) }; }\nSelection B(n) { B -> [ scale n ] box; }", "Selection A { A -> B(2); }\nSelection B(n) { B -> [ scale n ] box; }"),
    ("wrong-kind", "Selection A { A -> union(box, sphere); }", "Selection A { A -> (box + sphere); }"),
    ("unsupported", "merge { sphere { 0, 1 } box { 0, 1 } }", "union { sphere { 0, 1 } box { 0, 1 } }"),
    ("unsupported", "sphere { 0, 1 rotate 360*clock*z }", 'sphere { 0, 1 rotate 360*time*z }\nParameter time = 0 [0 to 1] "Time";'),
    ("unsupported", "sphere { 0, 1 rotate clock*z }\nParameter time = 0;", "sphere { 0, 1 rotate time*z }\nParameter time = 0;"),
    # values
    ("degenerate", "sphere { 0, 1 scale <1, 0, 1> }", "sphere { 0, 1 scale <1, 1, 1> }"),
    ("colour-range", "background { color rgb <135, 206, 235> }", "background { color rgb <135/255, 206/255, 235/255> }"),
]  # fmt: skip

# These are found by the checks of whole scenes.
WHOLE = [
    ("radians", "object { A }\nSelection A { A -> [ roty 1.5708 ] box; }", "object { A }\nSelection A { A -> [ roty 90 ] box; }"),
    ("radians", "object { A }\nSelection A { A -> [ roty pi/4 ] box; }", "object { A }\nSelection A { A -> [ roty 180/4 ] box; }"),
    ("float-equality", "object { A }\nSelection A { [ n = rand(0) ] A; if (n == 0.1) A -> box; }",
     "object { A }\nSelection A { [ n = rand(0) ] A; if (abs(n - 0.1) < 0.001) A -> box; }"),
    ("unreachable-rule", "object { A }\nSelection A { A -> box; A -> disc; }", "object { A }\nSelection A { A -> box; }"),
    ("unused", "sphere { 0, 1 }\nTransformation T { scale 2; }\n", "sphere { 0, 1 }\n"),
    ("unreachable", "sphere { 0, 1 }\nSelection A { A -> box; } // a\n", "sphere { 0, 1 }\nSelection A { A -> box; } // a\nobject { A }\n"),
    ("unassigned", "object { A }\nSelection A { A -> [ trans 0 0 n ] box + [ n = 1 ] sphere; }",
     "object { A }\nSelection A { [ n = 0 ] A; A -> [ trans 0 0 n ] box + [ n = 1 ] sphere; }"),
    ("counter", "object { A }\nSelection A { [ n = 3; k = 3 ] A; if (n > 0) A -> box + [ --k; trans 0 0 k ] A; }",
     "object { A }\nSelection A { [ n = 3; k = 3 ] A; if (n > 0) A -> box + [ --k; trans 0 0 k ] [ --n ] A; }"),
    ("counter", "object { A }\nSelection A { [ n = 3 ] A; if (n > 0) A -> box + [ ++n; scale 0.9 ] A; }",
     "object { A }\nSelection A { [ n = 3 ] A; if (n > 0) A -> box + [ --n; scale 0.9 ] A; }"),
    ("endless", "object { A }\nSelection A { A -> box + [ trans 0 0 1 ] A; }",
     "object { A }\nSelection A { [ rounds = 10 ] A; if (rounds > 0) A -> box + [ trans 0 0 1 ] [ --rounds ] A; }"),
    ("identity-cycle", "object { A }\nSelection A { [ n = 3 ] A; if (n > 0) A -> box + A; else A -> sphere; }",
     "object { A }\nSelection A { [ rounds = 10 ] [ n = 3 ] A; if (rounds > 0 && n > 0) A -> box + [ --rounds ] A; else A -> sphere; }"),
    ("steps-over", "object { A }\nSelection A { [ n = 5 ] A; if (n != 0) A -> box + [ n -= 2; trans 0 0 1 ] A; }",
     "object { A }\nSelection A { [ n = 5 ] A; if (n > 0) A -> box + [ n -= 2; trans 0 0 1 ] A; }"),
    ("steps-over", "object { A }\nSelection A { [ n = 5 ] A; if (n == 0) A -> sphere; else A -> box + [ n -= 2; trans 0 0 1 ] A; }",
     "object { A }\nSelection A { [ n = 5 ] A; if (n <= 0) A -> sphere; else A -> box + [ n -= 2; trans 0 0 1 ] A; }"),
    ("steps-over", "object { A }\nSelection A { [ n = 5 ] A; if (0 == n) A -> sphere; else A -> box + [ n -= 2; trans 0 0 1 ] A; }",
     "object { A }\nSelection A { [ n = 5 ] A; if (n <= 0) A -> sphere; else A -> box + [ n -= 2; trans 0 0 1 ] A; }"),
    ("steps-over", "object { A }\nSelection A { [ n = 5 ] A; if (!(n == 10)) A -> box + [ n += 2; trans 0 0 1 ] A; }",
     "object { A }\nSelection A { [ n = 5 ] A; if (!(n >= 10)) A -> box + [ n += 2; trans 0 0 1 ] A; }"),
    ("float-equality", "object { A }\nSelection A { [ n = rand(0); m = rand(1) ] A; if (n == m - 0.1) A -> box; }",
     "object { A }\nSelection A { [ n = rand(0); m = rand(1) ] A; if (abs(n - (m - 0.1)) < 0.001) A -> box; }"),
    ("float-equality", "object { A }\nSelection A { [ n = rand(0) ] A; if (n > 0.5 != n) A -> box; }",
     "object { A }\nSelection A { [ n = rand(0) ] A; if (abs((n > 0.5) - n) >= 0.001) A -> box; }"),
]  # fmt: skip


@pytest.mark.parametrize("code, before, after", FIXTURES, ids=[f"{i}-{row[0]}" for i, row in enumerate(FIXTURES)])
def test_fixes(code, before, after):
    found = fixed(before, code)
    if after is None:
        assert found
        return
    assert next(iter(found.values()), None) == after
    gone = len([each for each in messages(before) if each.diagnostic.code == code])
    assert len([each for each in messages(after) if each.diagnostic.code == code]) < gone


@pytest.mark.parametrize("rule, code", [
    ("sphere { <0, 0, Height>, 1 }", "wrong-kind"), ("cylinder { <0, 0, 0>, <1, 0, 0>, 1 }", "wrong-kind"), ("sphere { 0, 1 pigment { color Red } }", "wrong-kind"),
    ("box { <0, 0, 0>, <1, 0, 1> }", "wrong-kind"), ("sphere { 0 }", "wrong-kind"), ("sphere { 0, 1, 2 }", "wrong-kind"), ("union { B }", "wrong-kind"),
    ("difference { B }", "unsupported"),
])  # fmt: skip
def test_no_fix_where_only_the_author_knows(rule, code):
    assert fixed(f"#declare Height = 2;\nSelection A {{ A -> {rule}; }}\nSelection B {{ B -> box; }}", code) == {}


def test_a_matrix_isnt_filled_with_ones():
    text = "object { A }\nSelection A { A -> [ matrix 1 0 0  0 0 0  0 0 1  0 0 0 ] box + disc; }"
    assert "singular" in [each.diagnostic.code for each in messages(HEAD + text)]
    assert fixed(HEAD + text, "singular") == {}


@pytest.mark.parametrize("code, before, after", WHOLE, ids=[f"{i}-{row[0]}" for i, row in enumerate(WHOLE)])
def test_fixes_of_whole_scenes(code, before, after):
    found = fixed(HEAD + before, code)
    if after is not None:
        assert next(iter(found.values()), None) == HEAD + after
    assert code not in [each.diagnostic.code for each in messages(next(iter(found.values())))]


def test_what_a_scene_lacks():
    empty = "Selection Tree { Tree -> box; }\n"
    assert set(fixed(empty, "no-camera")) == {"Add a camera"}
    placed = fixed(empty, "no-object")["Place it: object { Tree }"]
    assert placed == empty + "object { Tree }\n"
    lit = fixed("camera { angle 45 }\n" + placed, "no-light")["Add a light"]
    assert "no-light" not in [each.diagnostic.code for each in messages(lit)]


def test_an_unknown_name_can_be_defined_as_what_stands_there():
    titles = list(fixed("Selection A { A -> M_up box; }", "unknown-name"))
    assert titles == ["Define the Transformation 'M_up'", "Define the Calculation 'M_up'"]
    assert list(fixed("Transformation T { trans 0 0 2*height; }", "unknown-name")) == ["Define the value 'height'"]


def test_all_that_is_sure_is_fixed_at_once():
    text = "Selection A { if (n = 0) A --> box }\nCalculation C { n = 2 ** 3; k = .5 }\ncamera { angle: 45; }\nobject { Aa }\n"
    scene, document = opened(text)
    (action,) = fix_all(scene, document)
    after = applied(text, action)
    # A block whose text doesn't follow the grammar tells its first mistake: once that is mended, the next.
    while (found := next(fix_all(*opened(after)), None)) is not None:
        after = applied(after, found)
    assert after.splitlines() == [
        "Selection A { if (n == 0) A -> box; }", "Calculation C { n = pow(2, 3); k = 0.5; }", "camera { angle 45 }", "object { Aa }",
    ]  # fmt: skip
    assert {each.diagnostic.code for each in messages(after)} & {"syntax", "missing", "assignment-in-condition"} == set()
    assert list(fix_all(*opened("object { Aa }\n"))) == []


def test_warnings_can_be_ignored():
    text = HEAD + "sphere { 0, 1 }\nTransformation T { scale 2; }\n"
    scene, document = opened(text)
    (message,) = scene.messages(document)
    (action,) = ignoring(scene, document, message)
    after = applied(text, action)
    assert "// plsys-ignore: unused\nTransformation T" in after and messages(after) == []
    (error,) = (each for each in messages("object { Tee }") if each.diagnostic.code == "unknown-name")
    assert list(ignoring(scene, document, error)) == []


def test_the_registry_knows_codes_only():
    assert set(FIXES) <= set(CODES)
    assert {"missing", "unknown-name", "unused", "endless", "counter"} <= set(FIXES)
