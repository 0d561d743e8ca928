"""Lowering, printing and the verifier of the graph."""

from __future__ import annotations

import pytest
from hand_models import (
    SPAN,
    apply,
    assign,
    branch,
    chain,
    choose,
    model,
    paint,
    read,
    rule,
    transformation,
    tree,
    union,
)
from plsys.compiler.bytecode.layout_rows import OPCODES
from plsys.compiler.graph import graph as g
from plsys.compiler.graph import limits, passes
from plsys.compiler.graph.lower import lower
from plsys.compiler.graph.matrices import STEPS, determinant, is_singular, matrix_of
from plsys.compiler.graph.printing import print_expression
from plsys.compiler.graph.verify import InvalidGraph, verify
from plsys.compiler.pipeline import build_graph
from plsys.compiler.reading.diagnostics import Diagnostics
from plsys.compiler.reading.model import Constant, Empty, Enter, NoShadow, Primitive, Read

FIGURE_2_1 = """\
0 object Tree 0 -> 1
1 texture Bark { entry 0 0.45 0.3 0.15 0 0 } -> 2
2 calculate C_initialize { cntTree = 10; cntTrunk = 2; betaBr = 60 } -> 3
3 enter -> 4
4 symbol Tree -> 5
5 branch (cntTrunk > 0) then 6 else 13
6 rule 0 -> 7
7 union 8 10
8 transform T_scaleCyl <0.15 0 0 0 0 0.15 0 0 0 0 2 0> -> 9
9 primitive cylinder
10 calculate C_Trunk { cntTrunk = cntTrunk - 1 } -> 11
11 transform T_shiftTrunk <1 0 0 0 0 1 0 0 0 0 1 1.99> -> 12
12 enter -> 4
13 branch (cntTree > 0) then 14 else 24
14 rule 1 -> 15
15 union 16 18
16 transform T_scaleCyl <0.15 0 0 0 0 0.15 0 0 0 0 2 0> -> 17
17 primitive cylinder
18 calculate C_Tree { cntTree = cntTree - 1; betaBr = betaBr - 4 } -> 19
19 union 20 22
20 transform_code T_attach_Branch1 { trans 0 0 1.99; roty betaBr; scale 0.8 0.8 0.8 } -> 21
21 enter -> 4
22 transform_code T_attach_Branch2 { trans 0 0 1.99; roty (-betaBr); rotz 90; scale 0.8 0.8 0.8 } -> 23
23 enter -> 4
24 rule 2 -> 25
25 transform T_scaleCyl <0.15 0 0 0 0 0.15 0 0 0 0 2 0> -> 26
26 primitive cylinder"""


def test_figure_2_1_becomes_the_graph_of_figure_2_2():
    assert str(lower(tree())) == FIGURE_2_1


def test_several_objects_stand_under_one_union():
    scene = model(
        [Enter("A"), chain(NoShadow(), paint("P"), Primitive("box")), Enter("A")], A=rule(0, Empty())
    )
    graph = lower(scene)
    verify(graph, "lower")
    assert [str(graph).splitlines()[i] for i in graph.nodes[0].children_] == [
        "1 object A 0 -> 2",
        "6 object 1 -> 7",
        "10 object A 2 -> 11",
    ]


def test_a_scene_without_objects_is_empty():
    assert str(lower(model([]))) == "0 empty"


def test_deep_productions_need_no_deep_stack():
    deep = rule(0, chain(*[assign(n=1)] * 20_000, Primitive("box")))
    for i in range(5000):
        deep = branch(read("n"), rule(i, Empty()), deep)
    verify(lower(model([chain(assign(n=0), Enter("A"))], A=deep)), "lower")


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (apply("subtract", 1, apply("subtract", 2, read("a"))), "1 - (2 - a)"),
        (apply("subtract", apply("subtract", 1, 2), read("a")), "1 - 2 - a"),
        (apply("multiply", apply("add", read("a"), 1), 2), "(a + 1) * 2"),
        (apply("negate", apply("add", read("a"), 1)), "-(a + 1)"),
        (apply("or", apply("and", 1, read("a")), apply("not", 0)), "1 && a || !0"),
        (apply("select", read("a"), 1, apply("select", 0, 2, 3)), "a ? 1 : 0 ? 2 : 3"),
        (apply("less", apply("select", read("a"), 1, 2), -0.5), "(a ? 1 : 2) < -0.5"),
        (apply("clamp", apply("rand", 0), 0, 1e300), "clamp(rand(0), 0, 1e+300)"),
    ],
)
def test_expressions_print_as_source(expression, text):
    assert print_expression(expression) == text


# --- matrices


@pytest.mark.parametrize(
    ("step", "point", "image"),
    [
        (("trans", (1, 2, 3)), (0, 0, 0), (1, 2, 3)),
        (("rotx", (90,)), (0, 1, 0), (0, 0, 1)),
        (("roty", (90,)), (0, 0, 1), (1, 0, 0)),
        (("rotz", (90,)), (1, 0, 0), (0, 1, 0)),
        (("scale", (2, 3, 4)), (1, 1, 1), (2, 3, 4)),
        (("scale_uniform", (2,)), (1, 1, 1), (2, 2, 2)),
        (("shear", (1, 2, 3, 4, 5, 6)), (1, 10, 100), (1 + 10 + 200, 10 + 3 + 400, 100 + 5 + 60)),
        (("matrix", tuple(range(1, 13))), (1, 0, 0), (1 + 10, 2 + 11, 3 + 12)),
    ],
)
def test_steps_map_points(step, point, image):
    m = matrix_of([step])
    assert tuple(sum(a * b for a, b in zip(m[4 * r : 4 * r + 4], (*point, 1))) for r in range(3)) == image


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 3, 0), (0, 0, 1e-200)])
def test_rodrigues_about_an_axis_is_the_rotation_about_it(axis):
    name = "rot" + "xyz"[[bool(value) for value in axis].index(True)]
    assert matrix_of([("rot", (30, *axis))]) == pytest.approx(matrix_of([(name, (30,))]), abs=1e-15)


def test_the_last_line_acts_on_the_object_first():
    assert matrix_of([("trans", (1, 0, 0)), ("scale_uniform", (2,))])[3] == 1
    assert matrix_of([("scale_uniform", (2,)), ("trans", (1, 0, 0))])[3] == 2


def test_singular_matrices():
    assert is_singular(matrix_of([("scale", (1, 0, 1))]))
    assert is_singular(matrix_of([("scale_uniform", (1e-300,))]))  # the determinant underflows
    assert not is_singular(matrix_of([("scale_uniform", (-1e-100,))]))
    assert determinant(matrix_of([("scale", (2, 3, 4))])) == 24


# --- the verifier


def broken(graph: g.Graph, index: int, node: g.Node) -> g.Graph:
    graph.nodes[index] = node
    return graph


@pytest.mark.parametrize(
    ("index", "node", "rule_broken"),
    [
        (9, g.Primitive("ball"), "known shape"),
        (9, g.Primitive("cone"), "its arguments"),
        (9, g.Transform("T", (1.0,) * 11, 8), "twelve finite numbers"),
        (7, g.Union((8,)), "two or more terms"),
        (7, g.Union((8, 99)), "every child is a node"),
        (12, g.Enter(5), "leads to a symbol"),
        (10, g.Calculate("C", (), 4), "only an enter node leads back"),
        (10, g.Calculate("C", (), 7), "only an enter node leads back"),
        (5, g.Branch(Read("nobody"), 6, 13), "has a slot"),
        (5, g.Branch(apply("add", 1), 6, 13), "its arguments"),
        (5, g.Branch(Constant(1.0), 9, 13), "guards and rules"),
        (4, g.Symbol("Tree", 5, ("cntTrunk", "betaBr")), "slot order"),
        (0, g.Enter(4), "the root"),
        (9, g.MeshLeaf(0), "has a mesh"),
        (20, g.TransformCode("T", transformation("T", ("scale", 1)).steps, 21), "known steps"),
    ],
)
def test_the_verifier_names_the_pass_and_the_rule(index, node, rule_broken):
    with pytest.raises(InvalidGraph, match=f"after merge: .*{rule_broken}"):
        verify(broken(lower(tree()), index, node), "merge")


def test_a_pass_that_makes_a_wrong_graph_is_named(monkeypatch):
    def spoil(graph: g.Graph) -> None:
        graph.nodes[0] = g.Enter(4)

    monkeypatch.setattr(passes, "PASSES", (*passes.PASSES[:2], spoil, *passes.PASSES[2:]))
    with pytest.raises(InvalidGraph, match="after spoil: .*the root"):
        build_graph(tree())


def test_every_transformation_of_the_bytecode_has_its_matrix():
    assert set(STEPS) == {name for name, row in OPCODES.items() if 60 <= row.id < 70}


# --- limits


def messages(scene) -> list[str]:
    diagnostics = Diagnostics()
    limits.check_limits(lower(scene), diagnostics)
    return [f"{d.code}: {d.message}" for d in diagnostics.items]


def draws(count: int):
    expression = apply("rand", 0)
    for _ in range(count - 1):
        expression = apply("add", expression, apply("rand", 0))
    return expression


def test_too_many_draws_in_one_application():
    def scene(count):
        return model(
            [Enter("A")],
            A=choose((1, rule(0, chain(assign(n=draws(count)), Enter("A")))), (1, rule(1, Empty()))),
        )

    assert messages(scene(63)) == []
    assert messages(scene(64)) == [
        "limit: 'A' draws up to 65 times in one application, at most 64 are possible"
    ]


def test_too_many_values_at_a_time():
    def nested(depth):
        expression = read("n")
        for _ in range(depth - 1):
            expression = apply("add", 1, expression)
        return model(
            [chain(assign(n=0), assign(n=expression), Enter("A"))], A=rule(0, union(Empty(), Empty(SPAN)))
        )

    assert messages(nested(64)) == []
    assert messages(nested(65)) == ["limit: an expression here needs more than 64 values at a time"]
