"""Scalar evaluation: the language's meaning, case by case."""

from __future__ import annotations

import math

import pytest
from hand_models import apply, assign, choose, read, rule, transformation
from plsys.compiler import elementary
from plsys.compiler.graph import graph as g
from plsys.compiler.graph.evaluate import (
    EvaluationError,
    Scope,
    calculate,
    evaluate,
    transform,
)
from plsys.compiler.graph.evaluate import (
    choose as choose_case,
)
from plsys.compiler.reading.model import Assign, Constant, Empty, Variants


def scope(**values) -> Scope:
    made = Scope.of_object(elementary.seed_key(7.0), "A", 0).entered("A")
    made.values.update(values)
    return made


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        (apply("divide", 7, 2), 3.5),
        (apply("divide", -1, 0), -math.inf),
        (apply("modulo", -7, 3), -1.0),
        (apply("less_equal", 2, 2), 1.0),
        (apply("not", -0.0), 1.0),
        (apply("sin", 30), 0.5),
        (apply("round", -2.5), -3.0),
        (apply("clamp", 5, 0, 1), 1.0),
        (apply("select", 2, 3, apply("divide", 1, 0)), 3.0),
        (apply("and", 2, 3), 1.0),
        (apply("or", 0, 0), 0.0),
    ],
)
def test_values(expression, value):
    assert evaluate(expression, scope()) == value


def test_nan_comes_from_zero_by_zero():
    assert math.isnan(evaluate(apply("divide", 0, 0), scope()))


def test_draws_count_on_their_stream_and_terms_differ():
    made = scope()
    first, second, other = (evaluate(apply("rand", stream), made) for stream in (0, 0, 1))
    key = made.key
    assert first == elementary.rand(key, elementary.bits(0.0), 0)
    assert second == elementary.rand(key, elementary.bits(0.0), 1)
    assert other == elementary.rand(key, elementary.bits(1.0), 0)
    assert evaluate(apply("rand", 0), made.term(0)) != evaluate(apply("rand", 0), made.term(1))


def test_what_is_not_evaluated_does_not_draw():
    made = scope()
    evaluate(apply("and", 0, apply("rand", 0)), made)
    evaluate(apply("or", 1, apply("rand", 0)), made)
    evaluate(apply("select", 1, 0, apply("rand", 0)), made)
    assert made.drawn == {}


def test_minus_zero_is_the_stream_zero():
    assert evaluate(apply("rand", -0.0), scope()) == evaluate(apply("rand", 0.0), scope())


def test_symbol_arguments_are_evaluated_before_they_are_assigned():
    made = scope(a=1.0, b=2.0)
    swapped = assign(a=read("b"), b=read("a")).statements
    calculate(g.Calculate("", swapped, 0, together=True), made)
    assert (made.values["a"], made.values["b"]) == (2.0, 1.0)
    calculate(g.Calculate("", swapped, 0), made)
    assert (made.values["a"], made.values["b"]) == (1.0, 1.0)


def test_variants_give_few_keys():
    def key(ordinal: int) -> int:
        made = Scope.of_object(elementary.seed_key(7.0), "A", ordinal)
        calculate(g.Calculate("V", (Variants(Constant(4.0)),), 0), made)
        return made.key

    assert len({key(ordinal) for ordinal in range(100)}) == 4


@pytest.mark.parametrize(
    ("statement", "code"),
    [
        (Assign("a", apply("divide", 1, 0)), "not-finite"),
        (Assign("a", apply("log", -1)), "not-finite"),
        (Assign("a", read("nobody")), "unassigned"),
        (Assign("a", apply("rand", apply("divide", 1, 0))), "not-finite"),
        (Assign("a", apply("hash", apply("divide", 0, 0))), "not-finite"),
        (Variants(Constant(0.0)), "wrong-value"),
        (Variants(Constant(1.5)), "wrong-value"),
    ],
)
def test_errors(statement, code):
    with pytest.raises(EvaluationError) as caught:
        calculate(g.Calculate("C", (statement,), 0), scope())
    assert caught.value.code == code


def test_transformations_report_what_has_no_matrix():
    with pytest.raises(EvaluationError, match="axis"):
        transform(
            g.TransformCode("T", transformation("T", ("rot", 30, read("a"), 0, 0)).steps, 0), scope(a=0.0)
        )
    with pytest.raises(EvaluationError, match="isn't finite"):
        transform(
            g.TransformCode("T", transformation("T", ("scale_uniform", apply("exp", 1e4))).steps, 0), scope()
        )


def test_weights_decide_how_often():
    node = g.Choose(((Constant(3.0), 10), (Constant(0.0), 11), (Constant(1.0), 12)))
    taken = [
        choose_case(node, Scope.of_object(elementary.seed_key(float(seed)), "A", 0)) for seed in range(2000)
    ]
    assert taken.count(11) == 0
    assert abs(taken.count(10) / 2000 - 0.75) < 0.04  # four standard deviations


@pytest.mark.parametrize("weights", [(-1, 2), (0, 0), (math.inf, 1), (math.nan, 1)])
def test_bad_weights(weights):
    node = g.Choose(tuple((Constant(float(weight)), i) for i, weight in enumerate(weights)))
    with pytest.raises(EvaluationError):
        choose_case(node, scope())


def test_a_choice_stands_on_a_stream_of_its_own():
    made = scope()
    before = evaluate(apply("rand", 0), scope())
    choose_case(g.Choose(tuple((w, 0) for w, _ in choose((1, rule(0, Empty()))).cases)), made)
    assert evaluate(apply("rand", 0), made) == before
