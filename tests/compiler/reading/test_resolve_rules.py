"""What rules, operators and expressions mean (DESIGN, section 2: rules, scope, entry actions, values)."""

from __future__ import annotations

from pathlib import Path

import pytest
from model_text import codes, good, objects, operand, production, read, rules
from plsys.compiler.reading.parse import parse
from plsys.compiler.reading.resolve import resolve
from plsys.compiler.reading.source import Source

ROOT = Path(__file__).resolve().parents[3]
P = "Parameter n = 3; "


def test_the_papers_tree():
    file, diagnostics = parse(Source.read(ROOT / "scenes/tree.plsys"))
    model = resolve(file, diagnostics)
    assert diagnostics.items == []
    assert model.parameters == ["cntTree", "cntTrunk", "betaBr"]
    assert production(model.symbols["Tree"].production) == (
        "if (cntTrunk > 0) {0: (T_scaleCyl[scale 0.15 0.15 2] cylinder"
        " + C_Trunk{cntTrunk = (cntTrunk - 1)} T_shiftTrunk[trans 0 0 1.99] >Tree)}"
        " else {if (cntTree > 0) {1: (T_scaleCyl[scale 0.15 0.15 2] cylinder"
        " + C_Tree{cntTree = (cntTree - 1); betaBr = (betaBr - 4)}"
        " (T_attach_Branch1[trans 0 0 1.99; roty betaBr; scale 0.8 0.8 0.8] >Tree"
        " + T_attach_Branch2[trans 0 0 1.99; roty negate(betaBr); rotz 90; scale 0.8 0.8 0.8] >Tree))}"
        " else {2: T_scaleCyl[scale 0.15 0.15 2] cylinder}}"
    )
    tree = model.objects[1]
    assert (tree.symbol, tree.ordinal) == ("Tree", 0)
    assert operand(tree.body).endswith("C_initialize{cntTree = 10; cntTrunk = 2; betaBr = 60} >Tree")


# --- rules


def test_rules_in_sequence_first_that_applies():
    assert rules(P + "Selection A { if (n > 2) A -> box; if (n > 1) A -> disc; A -> sphere; }") == (
        "if (3 > 2) {0: box} else {if (3 > 1) {1: disc} else {2: sphere}}"
    )


def test_a_nested_if_falls_through_to_the_next_rule():
    assert rules(P + "Selection A { if (n > 2) if (n > 3) A -> box; else A -> disc; A -> sphere; }") == (
        "if (3 > 2) {if (3 > 3) {0: box} else {1: disc}} else {2: sphere}"
    )
    assert rules(P + "Selection A { if (n > 2) if (n > 3) A -> box; A -> sphere; }") == (
        "if (3 > 2) {if (3 > 3) {0: box} else {1: sphere}} else {1: sphere}"
    )


def test_no_rule_applies_nothing_is_produced():
    assert rules(P + "Selection A { if (n > 2) A -> box; }") == "if (3 > 2) {0: box} else {nothing}"


def test_an_empty_production():
    assert rules("Selection A { A -> ; }") == "0: nothing"


def test_weighted_alternatives_each_have_a_number():
    text = P + "Selection A { A -> n: box | 0.5: disc | rand(1): ; } Selection B { B -> sphere; }"
    assert rules(text) == "3 => 0: box | 0.5 => 1: disc | rand(1) => 2: nothing"
    assert rules(text, "B") == "3: sphere"


def test_a_rule_after_one_that_always_applies_is_an_error():
    assert codes("object { A } Selection A { A -> box; A -> disc; }") == ["unreachable-rule"]
    assert codes(P + "object { A } Selection A { if (n > 1) A -> box; else A -> disc; A -> sphere; }") == [
        "unreachable-rule"
    ]


@pytest.mark.parametrize("weights", ["0: box | 0: disc", "w: box | 2: disc"])
def test_weights_below_0_or_all_0_are_errors(weights):
    assert "weights" in codes(f"#declare w = -2; object {{ A }} Selection A {{ A -> {weights}; }}")


def test_the_name_left_of_the_arrow_is_the_selections():
    assert codes("object { A } Selection A { B -> box; }") == ["wrong-kind"]


# --- terms


def test_union_is_flat_and_operators_bind_tighter():
    text = "Calculation C { a = 1; } Transformation T { scale 2; } Selection A { A -> C T box + T (disc + C sphere); }"
    assert rules(text) == "0: (C{a = 1} T[scale_uniform 2] box + T[scale_uniform 2] (disc + C{a = 1} sphere))"


def test_inline_lines_are_operators_in_order():
    assert rules("Selection A { A -> [ a = 1; ++a; trans 0 0 a; roty 90; a *= 2 ] box; }") == (
        "0: {a = 1; a = (a + 1)} [trans 0 0 a; roty 90] {a = (a * 2)} box"
    )


def test_every_assignment_operator():
    text = "Calculation C { a = 1; a += 2; a -= 3; a *= 4; a /= 5; a++; --a; variants 8; } Selection A { A -> C box; }"
    assert rules(text) == (
        "0: C{a = 1; a = (a + 2); a = (a - 3); a = (a * 4); a = (a / 5); a = (a + 1); a = (a - 1); variants 8} box"
    )


def test_primitives_with_arguments():
    text = "Selection A { A -> cone + cone(0.3) + torus(0.2) + [ r = 1 ] torus(r/2); }"
    assert rules(text) == "0: (cone(0) + cone(0.3) + torus(0.2) + {r = 1} torus((r / 2)))"


def test_every_operation():
    text = """Transformation T { trans 1 2 3; rotx 1; roty 2; rotz 3; rot 30 0 0 1; scale 2; scale 1, 2, 3;
        shear 1 0 0 0 0 0; matrix 1 0 0  0 1 0  0 0 1  4 5 6; } Selection A { A -> T box; }"""
    assert rules(text) == (
        "0: T[trans 1 2 3; rotx 1; roty 2; rotz 3; rot 30 0 0 1; scale_uniform 2; scale 1 2 3; shear 1 0 0 0 0 0; "
        "matrix 1 0 0 0 1 0 0 0 1 4 5 6] box"
    )


def test_expressions():
    text = """#declare k = 2 * 3; Calculation C { a = 1;
        b = min(a, k, pi) + hash(1, a); c = a > 0 && !b || a % 2 != 0 ? rand(1) : -a; } Selection A { A -> C cone(b + c); }"""
    shown = rules(text)
    assert "b = (min(min(a, 6), 3.14159265359) + hash(1, a))" in shown
    assert "c = select(or(and((a > 0), not(b)), not_equal(modulo(a, 2), 0)), rand(1), negate(a))" in shown


def test_a_texture_operator_may_read_parameters():
    text = """Texture Leaf { pigment { color rgb <a/10, 0.5, 0> } finish { ambient a diffuse 1 } }
        Selection A { A -> [ a = 2 ] Leaf disc; }"""
    assert rules(text) == "0: {a = 2} Leaf(ambient a a a | diffuse 1 | 0,(a / 10),0.5,0,0,0) disc"


def test_a_declared_texture_is_an_operator_too():
    text = "#declare T = texture { pigment { color Red } } Selection A { A -> T disc; }"
    assert rules(text) == "0: T(0,1,0,0,0,0) disc"


# --- arguments and entry actions


def test_arguments_are_assigned_together():
    assert (
        rules("Selection A(p, q) { if (p > 0) A -> A(q, p - 1); }")
        == "if (p > 0) {0: <p = q; q = (p - 1)> >A} else {nothing}"
    )


ENTRY = "Calculation C { k = 1; } "


def test_the_object_runs_the_entry_action_after_the_arguments():
    text = ENTRY + "Selection A(p) { C A; if (k > p) A -> [ ++p ] A(p); } object { A(7) }"
    assert objects(text) == ["A#0 <p = 7> C{k = 1} >A"]
    assert rules(text) == "if (k > p) {0: {p = (p + 1)} <p = p> >A} else {nothing}"


def test_a_reference_runs_the_entry_action_unless_it_leads_back():
    text = (
        ENTRY
        + """object { Plant }
        Selection Plant { if (rand(1) < 0.5) Plant -> Leaf + Stem; }
        Selection Stem  { C Stem; if (k > 0) Stem -> [ --k ] Side; else Stem -> Leaf; }
        Selection Side  { C Side; Side -> Stem + Leaf; }
        Selection Leaf  { C Leaf; Leaf -> [ scale k ] disc; }"""
    )
    # Plant → Stem: Plant isn't reached from Stem, so the action runs. Stem ⇄ Side reach each other: it doesn't.
    assert rules(text, "Plant").startswith("if (rand(1) < 0.5) {0: (C{k = 1} >Leaf + C{k = 1} >Stem)}")
    assert rules(text, "Stem") == "if (k > 0) {1: {k = (k - 1)} >Side} else {2: C{k = 1} >Leaf}"
    assert rules(text, "Side") == "3: (>Stem + C{k = 1} >Leaf)"


def test_reachability_ignores_guards():
    text = (
        ENTRY
        + """object { A } Selection A { C A; A -> B; } Selection B { C B; if (0) B -> A; else B -> box; }"""
    )
    assert rules(text, "A") == "0: >B"
    assert rules(text, "B").startswith("if 0 {1: >A}")


def test_an_entry_action_takes_calculations_only():
    assert codes("Transformation T { scale 2; } Selection A { T A; A -> box; } object { A }") == [
        "wrong-kind"
    ]


def test_objects_that_place_a_symbol_are_counted():
    text = "Selection A { A -> box; } Selection B { B -> disc; } object { A } object { B } object { A translate 1 }"
    assert objects(text) == ["A#0 >A", "B#0 >B", "A#1 [trans 1 1 1] >A"]


def test_a_symbol_in_a_union_has_a_key_of_its_own():
    text = "Selection A { A -> box; } union { object { A } object { A translate z } sphere { 0, 1 } scale 2 }"
    assert objects(text) == [
        "A#0 [scale_uniform 2] >A",
        "A#1 [scale_uniform 2] [trans 0 0 1] >A",
        "#0 [scale_uniform 2] sphere",
    ]


# --- names


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("Selection A { A -> box; } Calculation A { a = 1; }", "duplicate-name"),
        ("Calculation sphere { a = 1; }", "duplicate-name"),
        ("#declare Red = 1;", "duplicate-name"),
        ("Calculation C { sin = 1; }", "wrong-kind"),
        ("Parameter p = 1; Calculation C { p = 2; }", "wrong-kind"),
        ("#declare p = 1; Calculation C { ++p; }", "wrong-kind"),
        ("Selection A { A -> A(1); }", "wrong-arguments"),
        ("Selection A(x1) { A -> A; }", "wrong-arguments"),
        ("Selection A { A -> Bx; } Selection Box2 { Box2 -> box; }", "unknown-name"),
        ("Calculation C { a = 1; } Selection A { A -> C; }", "missing"),
        ("Selection A { A -> box sphere; }", "wrong-kind"),
        ("Selection A { A -> plane; }", "wrong-kind"),
        ("Selection A { A -> trans box; }", "wrong-kind"),
        ("Selection A { A -> torus; }", "wrong-arguments"),
        ("Selection A { A -> cone(-1); }", "wrong-value"),
        ("Transformation T { trans 1 2; }", "wrong-arguments"),
        ("Transformation T { trans <1, 2, 3>; }", "wrong-arguments"),
        ("Transformation T { translate 1 2 3; }", "unknown-name"),
        ("Transformation T { a = 1; }", "wrong-kind"),
        ("Calculation C { scale 2; }", "wrong-kind"),
        ("Calculation C { a = sin(1, 2); }", "wrong-arguments"),
        ("Calculation C { a = min(1); }", "wrong-arguments"),
        ("Calculation C { a = sine(1); }", "unknown-name"),
        ("Calculation C { a = b; }", "unknown-name"),
        ("Calculation C { a = C; }", "wrong-kind"),
        ("Calculation C { variants 0; }", "wrong-value"),
        ("Calculation C { a = Red; }", "wrong-kind"),
    ],
)  # fmt: skip
def test_names_and_arguments_that_do_not_fit(text, code):
    assert code in codes(text)


def test_property_names_are_free_for_parameters():
    assert rules("Selection A { A -> [ angle = 30; radius = 2; x = 1; roty angle ] cone(radius + x); }") == (
        "0: {angle = 30; radius = 2; x = 1} [roty angle] cone((radius + x))"
    )


def test_every_use_is_a_reference():
    model = good("Calculation C { a = 1; } Selection A { A -> C C cone(a); } object { A }")
    assert [len(model.definitions[name].references) for name in ("C", "A", "a")] == [2, 1, 1]
    assert model.definitions["a"].assignments[0].start_position == (1, 17)


# --- inputs


INPUT = 'Parameter n = 3 [0 to 10] "count"; Parameter m = 2*n; Selection A { A -> cone(m); }'


def test_inputs_are_constants_that_may_be_set():
    model = good(INPUT)
    assert [(each.name, each.value, each.default, each.low, each.high, each.text) for each in model.inputs] == [
        ("n", 3, 3, 0, 10, "count"), ("m", 6, 6, None, None, ""),
    ]  # fmt: skip
    model = good(INPUT, parameters={"n": 5})
    assert [(each.name, each.value, each.default) for each in model.inputs] == [("n", 5, 3), ("m", 10, 10)]
    assert production(model.symbols["A"].production) == "0: cone(10)"


def test_inputs_out_of_range_or_unknown():
    assert "wrong-value" in codes(INPUT, parameters={"n": 11})
    _, diagnostics = read(INPUT, parameters={"nn": 1})
    assert [(item.code, item.hint) for item in diagnostics.items if item.code == "unknown-name"] == [
        ("unknown-name", "did you mean 'n'?")
    ]
    assert "wrong-value" in codes("Parameter n = 30 [0 to 10]; sphere { 0, n }")
    assert "wrong-value" in codes("Parameter n = 3 [10 to 0]; sphere { 0, n }")


def test_constants_in_any_order_but_not_through_themselves():
    assert rules("Selection A { A -> cone(a); } #declare a = b + 1; #declare b = 2;") == "0: cone(3)"
    assert codes("#declare a = b; #declare b = a;")[0] == "wrong-value"


def test_hash_in_a_constant_takes_the_seed():
    text = "#declare a = hash(1); Selection A { A -> cone(a); } object { A }"
    of = [production(good(text, seed=seed).symbols["A"].production) for seed in (1, 1, 2)]
    assert of[0] == of[1] != of[2]
    scene = good("global_settings { seed 2 } " + text)
    assert production(scene.symbols["A"].production) == of[2]
