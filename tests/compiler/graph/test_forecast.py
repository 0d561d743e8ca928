"""The forecast: counts, states and depth, bounds and expectation under draws, and what it reports."""

from __future__ import annotations

import random

import pytest
from hand_models import (
    apply,
    assign,
    branch,
    calculation,
    chain,
    choose,
    model,
    read,
    rule,
    transformation,
    tree,
    union,
)
from plsys.compiler.graph.forecast import forecast
from plsys.compiler.pipeline import build_graph
from plsys.compiler.reading.model import Calculate, Constant, Empty, Enter, Primitive, Variants

SPHERE, BOX = Primitive("sphere"), Primitive("box")


def forecast_of(made, **limits):
    return forecast(build_graph(made), **limits)


def minus(name: str, amount: float = 1):
    return apply("subtract", read(name), amount)


def rand(stream: float = 0):
    return apply("rand", stream)


def codes(result) -> list[str]:
    return [diagnostic.code for diagnostic in result.diagnostics]


# --- exact counts


def test_figure_2_1():
    result = forecast_of(tree())
    assert (result.primitives, result.states, result.depth) == (2049, 13, 13)
    assert result.by_kind == {"cylinder": 2049}
    assert result.primitives_range == (2049, 2049, 2049)
    assert not result.infinite and result.diagnostics == []


def test_order_1000_is_counted_to_the_last_digit():
    result = forecast_of(tree(1000))
    assert result.primitives == 2**1001 - 1 + 2
    assert len(str(result.primitives)) == 302
    assert (result.states, result.depth) == (1003, 1003)


@pytest.mark.parametrize("levels", [0, 1, 4])
def test_menger_has_20_to_the_n_boxes(levels):
    step = chain(assign(n=minus("n")), transformation("T", ("scale", 1 / 3, 1 / 3, 1 / 3)), Enter("M"))
    production = branch(apply("greater", read("n"), 0), rule(0, union(*[step] * 20)), rule(1, BOX))
    result = forecast_of(model([chain(assign(n=levels), Enter("M"))], M=production))
    assert (result.primitives, result.by_kind, result.depth) == (20**levels, {"box": 20**levels}, levels + 1)


def test_only_what_symbols_generate_counts():
    scene = model([union(SPHERE, BOX), Enter("A"), SPHERE], A=rule(0, union(BOX, BOX)))
    result = forecast_of(scene)
    assert result.primitives == 2 and result.by_kind == {"box": 2}


def test_objects_of_the_same_symbol_share_their_states():
    result = forecast_of(model([Enter("A"), Enter("A")], A=rule(0, SPHERE)))
    assert (result.primitives, result.states, result.depth) == (2, 1, 1)


def test_an_empty_scene():
    result = forecast_of(model([]))
    assert (result.primitives, result.states, result.depth, result.by_kind) == (0, 0, 0, {})


def test_what_a_singular_transformation_flattens_does_not_count():
    flat = transformation("T", ("scale", read("s"), 1, 1))
    result = forecast_of(model([chain(assign(s=0), Enter("A"))], A=rule(0, union(chain(flat, SPHERE), BOX))))
    assert result.by_kind == {"box": 1}


def test_states_differ_by_live_parameters_only():
    grow = chain(assign(n=minus("n"), hue=apply("multiply", read("hue"), 0.9)), Enter("A"))
    production = branch(apply("greater", read("n"), 0), rule(0, union(grow, grow)), rule(1, SPHERE))
    result = forecast_of(model([chain(assign(n=3, hue=1), Enter("A"))], A=production))
    assert (result.primitives, result.states) == (8, 4)


# --- draws


def random_tree(*operators):
    turn = transformation("T", ("rotz", apply("multiply", rand(), 360)))
    below = chain(assign(n=minus("n")), *operators, turn, Enter("A"))
    production = branch(apply("greater", read("n"), 0), rule(0, union(below, below)), rule(1, SPHERE))
    return model([chain(assign(n=6), Enter("A"))], A=production)


def test_random_angles_leave_the_count_exact_but_every_branch_a_state():
    result = forecast_of(random_tree())
    assert (result.primitives, result.primitives_range) == (64, (64, 64, 64))
    assert result.states == 127


def test_variants_share_states():
    result = forecast_of(random_tree(Calculate("V", (Variants(Constant(2.0)),))))
    assert result.primitives == 64 and 7 <= result.states <= 1 + 2 * 6


def test_too_many_states_are_told_and_the_count_stays_exact():
    result = forecast_of(random_tree(), max_states=20)
    assert result.states is None and codes(result) == ["state-limit"]
    assert (result.primitives, result.depth) == (64, 7)


def test_a_guard_that_draws_gives_bounds_and_the_exact_expectation():
    production = branch(apply("less", rand(), 0.25), rule(0, union(BOX, BOX, BOX)), rule(1, SPHERE))
    result = forecast_of(model([Enter("A")], A=production))
    assert result.primitives is None
    assert result.primitives_range == (1, pytest.approx(1.5), 3)
    assert result.by_kind == {"box": None, "sphere": None}


def test_weights_give_the_exact_expectation():
    production = choose(
        (3, rule(0, SPHERE)), (1, rule(1, union(BOX, SPHERE))), (0, rule(2, union(BOX, BOX, BOX)))
    )
    result = forecast_of(model([Enter("A")], A=production))
    assert result.primitives_range == (1, pytest.approx(1.25), 2)
    assert result.by_kind["sphere"] == 1


def test_weights_that_lead_to_the_same_number_leave_it_known():
    result = forecast_of(model([Enter("A")], A=choose((3, rule(0, SPHERE)), (1, rule(1, BOX)))))
    assert result.primitives == 1 and result.by_kind == {"box": None, "sphere": None}


def test_a_drawn_parameter_is_compared_twice():
    """x < 0.3, else x < 0.6, else: 0.3, 0.3 and 0.4 of the cases."""
    production = branch(
        apply("less", read("x"), 0.3),
        rule(0, SPHERE),
        branch(apply("less", read("x"), 0.6), rule(1, union(*[SPHERE] * 2)), rule(2, union(*[SPHERE] * 3))),
    )
    result = forecast_of(model([chain(assign(x=rand()), Enter("A"))], A=production))
    assert result.primitives_range == (1, pytest.approx(0.3 + 2 * 0.3 + 3 * 0.4), 3)


def test_a_loop_that_draws_ends_with_probability_one():
    """Figure 5.1's palm loop: a palm as long as a draw says so."""
    production = branch(apply("less_equal", rand(), 0.8), rule(0, union(SPHERE, Enter("A"))), rule(1, BOX))
    result = forecast_of(model([Enter("A")], A=production))
    low, expected, high = result.primitives_range
    assert (low, high) == (1, None) and expected == pytest.approx(5)
    assert not result.infinite and "endless" not in codes(result)


def test_chances_that_rounding_keeps_below_1_leave_the_expectation_within_its_bounds():
    two, three = union(SPHERE, SPHERE), union(SPHERE, SPHERE, SPHERE)
    never = apply("equal", rand(3), 0.5)
    either = choose((1, rule(1, two)), (2, rule(2, two)))
    low, expected, high = forecast_of(model([Enter("A")], A=branch(never, rule(0, three), either))).primitives_range
    assert (low, expected, high) == (2, 2, 3)


def test_a_branching_loop_may_have_no_finite_expectation():
    production = branch(apply("less", rand(), 0.6), rule(0, union(Enter("A"), Enter("A"))), rule(1, BOX))
    result = forecast_of(model([Enter("A")], seed=3, A=production), max_states=500)
    assert result.primitives_range == (1, None, None)


def test_a_recursion_that_no_draw_can_end_is_an_error():
    production = choose((1, rule(0, union(SPHERE, Enter("A")))), (1, rule(1, union(BOX, Enter("A")))))
    result = forecast_of(model([Enter("A")], A=production), max_states=500, max_depth=100)
    assert "endless" in codes(result)


@pytest.mark.parametrize("seed", range(20))
def test_bounds_hold_for_every_seed(seed):
    """The concrete derivation of a random scene lies within the bounds."""
    from plsys.compiler.graph.count import count, most
    from plsys.compiler.graph.explore import explore
    from plsys.compiler.graph.states import Derivation, objects_of

    pick = random.Random(seed)
    limit = apply("add", apply("multiply", rand(1), pick.choice([2, 3])), pick.choice([0, 1]))
    below = chain(assign(n=minus("n")), Enter("A"))
    production = branch(
        apply("greater", read("n"), 0),
        choose((pick.random(), rule(0, union(SPHERE, below))), (1, rule(1, union(below, below)))),
        branch(apply("less", rand(2), 0.5), rule(2, BOX), Empty()),
    )
    graph = build_graph(model([chain(assign(n=limit), Enter("A"))], seed=seed, A=production))
    result = forecast(graph)
    derivation = Derivation(graph)
    (start,) = derivation.start(objects_of(graph)[0]).enters
    found = count(explore([start], derivation.expand, 10_000, 1000), "", most)[start]
    low, expected, high = result.primitives_range
    assert low <= found <= high and low <= expected <= high


# --- recursion without end


def loop(*operators):
    return model([Enter("A")], A=rule(0, union(SPHERE, chain(*operators, Enter("A")))))


def test_a_contracting_recursion_is_infinite_and_legal():
    result = forecast_of(loop(transformation("T", ("trans", 0, 0, 1), ("scale", 0.5, 0.5, 0.5))))
    assert result.infinite and result.diagnostics == []
    assert result.primitives is None and result.depth is None and result.states == 1


def test_a_sheared_recursion_contracts_by_its_spectral_radius():
    result = forecast_of(loop(transformation("T", ("shear", 5, 0, 0, 0, 0, 0), ("scale", 0.5, 0.5, 0.5))))
    assert result.infinite and result.diagnostics == []


@pytest.mark.parametrize("scale", [1.0, 1.1])
def test_a_recursion_that_does_not_contract_is_an_error(scale):
    result = forecast_of(loop(transformation("T", ("trans", 1, 0, 0), ("scale", scale, scale, scale))))
    assert codes(result) == ["endless"] and "'A'" in result.diagnostics[0].message
    assert not result.infinite


def test_endless_recursion_names_symbol_and_values():
    production = branch(apply("greater", read("n"), 0), rule(0, union(SPHERE, Enter("A"))), rule(1, BOX))
    result = forecast_of(model([chain(assign(n=3), Enter("A"))], A=production))
    assert codes(result) == ["endless"] and "'A' with n = 3" in result.diagnostics[0].message


def test_growth_without_end_meets_a_named_limit():
    more = calculation("C", n=apply("add", read("n"), 1))
    production = branch(
        apply("greater", read("n"), 0), rule(0, union(SPHERE, chain(more, Enter("A")))), rule(1, BOX)
    )
    result = forecast_of(model([chain(assign(n=1), Enter("A"))], A=production), max_depth=500)
    assert codes(result) == ["depth-limit"]
    assert "more than 500 symbols" in result.diagnostics[0].message and result.primitives is None


# --- errors of the derivation


def test_division_by_zero_is_told_with_its_values():
    """The assignment stands in A, so that its circumstances are A's."""
    bad = calculation("C", m=apply("divide", 1, read("n")))
    production = rule(0, chain(bad, Primitive("cone", (read("m"),))))
    result = forecast_of(model([chain(assign(n=0), Enter("A"))], A=production))
    assert codes(result) == ["not-finite"]
    assert "'m' becomes infinite: division by zero (in 'A' with n = 0)" == result.diagnostics[0].message


def test_reading_before_assigning_is_told():
    result = forecast_of(model([Enter("A")], A=rule(0, Primitive("cone", (read("n"),)))))
    assert codes(result) == ["unassigned"] and "'n'" in result.diagnostics[0].message


def test_weights_that_are_all_zero_are_told():
    production = choose((read("n"), rule(0, SPHERE)), (read("n"), rule(1, BOX)))
    result = forecast_of(model([chain(assign(n=0), Enter("A"))], A=production))
    assert codes(result) == ["weights"]
