"""What is said about scenes: golden cases, and the checks' finer distinctions.

``tests/cases/resolve/*.txt`` hold a scene, a line ``----``, and the messages it gets; ``PLSYS_BLESS=1`` rewrites
the messages. Files that cases include stand in ``tests/cases/resolve/files``.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from model_text import codes, read
from plsys.compiler.reading.check import check
from plsys.compiler.reading.diagnostics import render
from plsys.compiler.reading.parse import parse
from plsys.compiler.reading.resolve import resolve
from plsys.compiler.reading.source import Source

FOLDER = Path(__file__).resolve().parents[2] / "cases/resolve"
CASES = sorted(FOLDER.glob("*.txt"))
SEPARATOR = "----\n"


def report(scene: str) -> str:
    """The messages for a scene that stands in the folder of cases' files."""
    path = FOLDER / "files/scene.plsys"
    source = Source("scene.plsys", scene.encode(), path)
    file, diagnostics = parse(source)
    model = resolve(file, diagnostics)
    if not diagnostics.has_errors:
        check(model, diagnostics)
    text = "".join(render(item) + "\n" for item in diagnostics.sorted())
    return text.replace(f"{path.parent}{os.sep}", "")


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_golden(path):
    scene, _, expected = path.read_text(encoding="utf-8").partition(SEPARATOR)
    found = report(scene)
    if os.environ.get("PLSYS_BLESS"):
        path.write_text(scene + SEPARATOR + found, encoding="utf-8")
    else:
        assert found == expected


def test_there_are_cases():
    assert len(CASES) > 30


COUNTED = "Selection A { [ n = 3 ] A; if (n > 0) A -> box + [ --n; trans 0 0 1 ] A; else A -> sphere; } object { A } "


def test_a_good_scene_has_nothing_to_say():
    assert codes(COUNTED) == []


# --- read before assigned


def test_assigned_on_every_path():
    assert (
        codes("Selection A(n) { if (n > 0) A -> [ k = n ] B; } Selection B { B -> cone(k); } object { A(2) }")
        == []
    )


def test_assigned_on_no_path():
    text = "Calculation C { k = 1; } Selection A { A -> cone(k) + C box; } object { A }"
    assert codes(text) == ["unassigned"]


def test_assigned_on_some_path():
    text = "Selection A { A -> B + [ k = 1 ] B; } Selection B { B -> cone(k); } object { A }"
    assert codes(text) == ["maybe-unassigned"]


def test_siblings_do_not_see_what_a_calculation_assigns():
    assert codes("Selection A { A -> [ k = 1 ] cone(k) + cone(k); } object { A }") == ["unassigned"]


def test_what_is_evaluated_only_sometimes_is_not_certain():
    assert codes("Selection A { A -> [ k = 1 ] cone(k) + cone(rand(1) > 2 && k); } object { A }") == [
        "maybe-unassigned"
    ]


def test_a_read_for_a_dead_parameter_is_no_error():
    assert "unassigned" not in codes(
        "Calculation D { z1 = k; } Selection A { A -> D box + [ k = 1 ] cone(k); } object { A }"
    )


def test_arguments_are_in_the_callers_scope():
    assert codes("Selection A(p, q) { A -> cone(p + q); } Selection B { B -> A(1, p); } object { B }") == [
        "unassigned"
    ]


# --- recursion


def test_endless_recursion():
    assert codes("Selection A { A -> box + [ trans 0 0 1 ] A; } object { A }") == ["endless"]
    assert codes("Selection A { A -> B; } Selection B { B -> [ scale 2 ] A + box; } object { A }") == ["endless"]
    assert codes("Selection A { A -> 1: A | 2: [ trans 0 0 1 ] A + box; } object { A }") == ["endless"]
    assert codes("Selection A { if (1 > 0) A -> box + [ trans 0 0 1 ] A; else A -> box; } object { A }") == [
        "endless",
        "constant-guard",
    ]
    assert codes(
        "Selection A { if (rand(1) < 1) A -> box + [ trans 0 0 1 ] A; else A -> box; } object { A }"
    ) == ["endless", "constant-guard"]


def test_endless_recursion_is_legal_where_every_way_round_contracts():
    def is_endless(rules: str) -> bool:
        return "endless" in codes(rules + " object { A }")

    assert not is_endless("Selection A { A -> B; } Selection B { B -> [ scale 0.5 ] A + box; }")
    assert not is_endless("Selection A { A -> box + [ trans 0 0 1; rotx 45; scale 0.9 ] A; }")
    assert not is_endless("Selection A { A -> box + [ shear 5 0 0 0 0 0; scale 0.9 ] A; }")
    assert not is_endless("Selection A { A -> [ scale 3 ] B; } Selection B { B -> box + [ scale 0.3 ] A; }")
    assert is_endless("Selection A { A -> [ scale 3 ] B; } Selection B { B -> box + [ scale 0.4 ] A; }")
    assert is_endless("Selection A { A -> box + [ scale 0.5 ] A + [ scale 0.5 1.1 0.5 ] A; }")
    assert is_endless("Selection A { A -> box + [ roty 30; scale 1 ] A; }")


def test_recursion_that_ends_by_weights_is_fine():
    assert "endless" not in codes("Selection A { A -> 1: [ trans 0 0 1 ] A | 2: box; } object { A }")


def test_figure_51s_loop_is_an_info():
    text = "Selection A { if (rand(0) <= 0.8) A -> [ trans 0 0 1 ] box + A; else A -> disc; } object { A }"
    assert codes(text) == ["random-loop"]


def test_a_counter_that_nothing_changes():
    assert codes(COUNTED.replace("--n; ", "")) == ["counter"]


def test_a_counter_that_runs_away():
    assert codes(COUNTED.replace("--n", "++n")) == ["counter"]
    assert codes(COUNTED.replace("--n", "n -= 0.5")) == []
    assert codes(COUNTED.replace("n > 0", "n < 9")) == ["counter"]
    assert codes(COUNTED.replace("--n", "n = n*0.5 - 1")) == []


def test_a_cycle_that_changes_nothing():
    assert codes(COUNTED.replace("[ --n; trans 0 0 1 ] ", "")) == ["identity-cycle"]


def test_an_unplaced_endless_selection_is_only_unreachable():
    assert codes(COUNTED + "Selection B { B -> B; }") == ["unreachable"]


@pytest.mark.parametrize(
    "rules",
    [
        "if (n > 0) A -> box + [ --n; trans 0 0 1 ] A;",
        "if (0 < n && m != 3) A -> box + [ n -= 1 + rand(0); trans 0 0 1 ] A;",
        "if (!(n <= 0)) A -> box + [ n = n - 1; trans 0 0 1 ] A;",
        "if (n > 1) A -> box + [ n *= 0.5; trans 0 0 1 ] A;",
        "if (n < 100) A -> box + [ n *= 2; trans 0 0 1 ] A;",
        "if (n < m) A -> box + [ ++n; trans 0 0 1 ] A;",
        "if (n != 0) A -> box + [ --n; trans 0 0 1 ] A;",
        "if (n == 0) A -> box; else A -> box + [ --n; trans 0 0 1 ] A;",
        "if (n > 0) A -> box + [ --n; m = 7; trans 0 0 1 ] A; else if (m > 0) A -> [ --m; trans 0 0 1 ] A;",
        "if (n > 0) A -> box + [ n -= m > 2 ? 1 : 2; trans 0 0 1 ] A;",
    ],
)
def test_recursions_that_surely_end(rules):
    text = f"Selection A {{ [ n = 4; m = 9 ] A; {rules} }} object {{ A }}"
    if "m" not in rules:
        text = text.replace("; m = 9", "")
    assert [code for code in codes(text) if code != "unused"] == []


@pytest.mark.parametrize(
    "rules, code",
    [
        ("if (n > 0) A -> box + [ n *= 0.5; trans 0 0 1 ] A;", "unproven"),
        ("if (n > 0) A -> box + [ n -= rand(0); trans 0 0 1 ] A;", "unproven"),
        ("if (n > 0) A -> box + [ n = 8 - n; trans 0 0 1 ] A;", "unproven"),
        ("if (n > 0) A -> box + [ --n; trans 0 0 1 ] B; } Selection B { B -> [ ++n ] A; ", "unproven"),
        ("if (n != 0) A -> box + [ n -= 3; trans 0 0 1 ] A;", "steps-over"),
        ("if (n != 0) A -> box + [ n -= 0.1; trans 0 0 1 ] A;", "steps-over"),
        ("if (n != 0) A -> box + [ ++n; trans 0 0 1 ] A;", "steps-over"),
        ("if (n > 0) A -> B; } Selection B { B -> A; ", "identity-cycle"),
        ("if (n > 0) A -> box + [ trans 0 0 0 ] A;", "identity-cycle"),
        ("if (n > 0) A -> box + [ n = n ] A;", "identity-cycle"),
    ],
)
def test_recursions_without_a_proof(rules, code):
    assert codes(f"Selection A {{ [ n = 4 ] A; {rules} }} object {{ A }}") == [code]


def test_comparing_truths_is_exact():
    text = "Selection A { [ n = rand(0); m = 1 ] A; if ((n > 0.5) == (0.3 > m)) A -> box; else A -> sphere; } object { A }"
    assert codes(text) == []


def test_a_recursion_without_end_that_hardly_shrinks():
    text = "Selection A { A -> box + [ trans 0 0 1; scale 0.999 ] A; } object { A }"
    assert codes(text) == ["slow-contraction"]
    assert codes(text.replace("0.999", "0.9")) == []


def test_what_shrinks_needs_no_proof():
    text = "Selection A { [ n = 4 ] A; if (n > 0) A -> box + [ n -= rand(0); scale 0.5 ] A; } object { A }"
    assert codes(text) == []


def test_counters_one_after_the_other():
    """Figure 2.1: the trunk's counter first, then the tree's."""
    rules = "if (m > 0) A -> [ --m; trans 0 0 1 ] A; else if (n > 0) A -> [ --n; trans 0 0 1 ] A + box;"
    assert codes(f"Selection A {{ [ n = 4; m = 2 ] A; {rules} }} object {{ A }}") == []


@pytest.mark.parametrize(
    "first, second, said",
    [
        ("n > 0", "n > 0", True), ("n > 0", "n > 3", True), ("n >= 0", "n > -1", False), ("n > 0 || m > 0", "m > 1", True),
        ("!(n <= 0)", "5 < n", True), ("n == 0", "n == 0", False), ("n > 0", "m > 0", False), ("n > 0", "n < -3 && m > 0", False),
        ("n > 0", "n > 2 && m > 0", True),
    ],
)  # fmt: skip
def test_guards_that_earlier_ones_rule_out(first, second, said):
    rules = f"if ({first}) A -> box; else if ({second}) A -> cone; else A -> sphere;"
    text = f"Selection A {{ [ n = 9*rand(0) - 5; m = 9*rand(1) - 5 ] A; {rules} }} object {{ A }}"
    assert ("constant-guard" in codes(text)) == said


@pytest.mark.parametrize(
    "values, guard, said",
    [
        ("n = 5;", "n > 3", "true: 'n' is 5"), ("n = 5;", "n > 5", "false: 'n' is 5"), ("n = 5; n += 2;", "n > 4", "true: 'n' >= 5"),
        ("n = 5; --n;", "n > 5", "false: 'n' <= 5"), ("n = 5; --n;", "n > 4", ""), ("n = p;", "n > 0", ""), ("n = C;", "n == 2", ""),
        ("n = 5;", "n > C", ""), ("n = 2 + rand(0);", "n >= 2 && n <= 3", ""), ("n = 2 + rand(0);", "n < 2", "false: 'n' >= 2 and 'n' <= 3"),
        ("m = 3; n = m*2 - 1;", "n == 5 || m < 0", "true"), ("n = rand(0) < 0.5 ? 1 : 3;", "n > 3", "false"), ("n = max(4, hash(1));", "n <= 4", "true"),
        ("n = floor(rand(0)*3);", "n < 0", "false"), ("n = n0/2;", "n > 0", ""), ("n = -(-7);", "n != 7", "false: 'n' is 7"),
    ],
)  # fmt: skip
def test_guards_that_assignments_decide(values, guard, said):
    """Inputs and named constants are there to be switched."""
    head = "Parameter p = 3 [0 to 9];\n#declare C = 2;\nCalculation C_0 { n0 = 1; m = 0; }\n" if "n0" in values else "Parameter p = 3 [0 to 9];\n#declare C = 2;\n"
    start = "C_0 C_i" if "n0" in values else "C_i"
    text = f"{head}Calculation C_i {{ {values} }}\nSelection A {{ {start} A; if ({guard}) A -> box; else A -> cone; }}\nobject {{ A scale p*C }}"
    found = [each.message for each in read(text)[1].items if each.code == "constant-guard"]
    assert len(found) == bool(said) and all(f"always {said}" in each for each in found)


@pytest.mark.parametrize(
    "angle, said",
    [
        ("roty pi/2", True), ("rotz 1.5708", True), ("roty a", True), ("roty -a", True), ("roty 180*2/pi", False), ("roty b", False), ("roty 1.5", False),
        ("scale pi", False), ("rot 2*pi/5 0 0 1", True), ("roty sin(pi/3)", True),
    ],
)  # fmt: skip
def test_angles_that_look_like_radians(angle, said):
    text = f"object {{ A }} Selection A {{ [ a = pi/3; b = 180*a/pi ] A; A -> [ {angle}; scale a*b ] box; }}"
    assert codes(text).count("radians") == said


def test_modifiers_in_radians():
    _, diagnostics = read("object { A rotate <0, pi/2, 30> } object { A rotate 90*x } Selection A { A -> box; }")
    assert [each.span.text for each in diagnostics.items if each.code == "radians"] == ["pi/2"]


@pytest.mark.parametrize("values, said", [("k = 0;", True), ("k = 1; k -= 1;", False), ("k = 2;", False), ("k = 3; m = k - k*1;", False)])
def test_a_scale_that_is_always_zero(values, said):
    text = f"object {{ A }} Calculation C_i {{ m = 1; {values} }} Selection A {{ C_i A; A -> [ scale k*m 1 k ] box; }}"
    assert ("singular" in codes(text)) == said


@pytest.mark.parametrize(
    "placed, said",
    [
        ("sphere { 0, 20 }", True), ("sphere { 0, 5 }", False), ("sphere { 0, 200 }", False), ("object { A scale 20 }", True),
        ("box { -20, 20 }", True), ("cylinder { <0, -20, 0>, <0, 9, 0>, 1 }", True), ("torus { 10, 1 rotate 90*x }", True),
        ("torus { 5, 1 }", False), ("cone { <0, -20, 0>, 2, <0, 0, 0>, 0.1 }", True), ("plane { y, 0 }", False), ("plane { z, 5 }", True), ("plane { -z, 5 }", False),
    ],
)  # fmt: skip
def test_a_camera_inside(placed, said):
    scene = "camera { location <0, -10, 0> sky <0, 0, 1> look_at 0 } light_source { <30, -30, 40> color rgb 1 } "
    found = codes(f"{scene} {placed} object {{ A }} Selection A {{ A -> sphere; }}")
    assert ("camera-inside" in found) == said


# --- numbers


def test_a_division_that_is_never_reached_is_no_error():
    assert codes("Parameter n = 0; Selection A { A -> cone(n > 0 ? 1/n : 1); } object { A }") == []


def test_a_mesh_that_is_missing_or_broken(tmp_path):
    for name, content in (
        ("a.obj", b""),
        ("b.obj", b"\x00\xff garbage"),
        ("c.ply", b"ply\nnonsense"),
        ("d.stl", b"solid"),
    ):
        (tmp_path / name).write_bytes(content)
        path = tmp_path / "scene.plsys"
        source = Source("scene.plsys", f'object {{ mesh("{name}") }}'.encode(), path)
        file, diagnostics = parse(source)
        resolve(file, diagnostics)
        assert [item.code for item in diagnostics.items] == ["file"], name


def test_a_mesh_keeps_its_triangles_and_normals(tmp_path):
    plain = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
    (tmp_path / "flat.obj").write_text(plain)
    (tmp_path / "smooth.obj").write_text(plain.replace("f 1 2 3 4", "vn 0 0 1\nvn 0 1 1\nf 1//1 2//2 3//1"))
    source = Source(
        "scene.plsys",
        b'object { mesh("flat.obj") } object { mesh("smooth.obj") } object { mesh("flat.obj") }',
        tmp_path / "s.plsys",
    )
    file, diagnostics = parse(source)
    model = resolve(file, diagnostics)
    assert diagnostics.items == []
    flat, smooth = model.meshes
    assert (flat.vertices.shape, flat.triangles.shape, len(flat.normals)) == ((4, 3), (2, 3), 0)
    assert smooth.triangles.shape == smooth.normal_triangles.shape == (1, 3)
    assert smooth.normals[smooth.normal_triangles[0]].tolist() == [[0, 0, 1], [0, 1, 1], [0, 0, 1]]


def test_an_editors_open_files_are_what_is_included(tmp_path):
    opened = {tmp_path / "lib.plsys": "#declare R = 2;"}

    def loader(path):
        return Source(path.name, opened[path].encode(), path)

    file, diagnostics = parse(
        Source("scene.plsys", b'#include "lib.plsys" sphere { 0, R }', tmp_path / "scene.plsys")
    )
    model = resolve(file, diagnostics, loader=loader)
    assert diagnostics.items == [] and model.files == [tmp_path / "scene.plsys", tmp_path / "lib.plsys"]


@pytest.mark.parametrize(
    "text",
    ["object { }", "union { }", "sphere { }", "camera { location }", "#declare A = texture { }", "mesh { }"],
)
def test_empty_things_never_crash(text):
    read(text)


# --- bounded work on hostile scenes


def test_objects_that_double_are_bounded():
    lines = ["#declare A0 = union { sphere { 0, 1 } sphere { x, 1 } }"]
    lines += [
        f"#declare A{i + 1} = union {{ object {{ A{i} }} object {{ A{i} translate x }} }}" for i in range(40)
    ]
    assert "limit" in codes("\n".join(lines) + "\nobject { A40 }")


def test_guards_that_double_are_bounded():
    rules = " ".join(f"if (rand({i}) < 0.5) if (rand({i}) < 0.5) A -> box;" for i in range(40))
    assert codes(f"object {{ A }} Selection A {{ {rules} }}") == ["limit"]


def test_long_chains_of_constants():
    lines = ["#declare a0 = 1;"] + [f"#declare a{i + 1} = a{i} + 1;" for i in range(3000)]
    assert codes("\n".join(lines) + "\nsphere { 0, a3000 }") == []
