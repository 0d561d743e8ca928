"""The unfolder: counts in closed form, derivation order, scopes, random streams, limits, and bounded
memory."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from plsys.compiler import elementary
from plsys.compiler.export.unfold import unfold
from plsys.compiler.pipeline import build
from plsys.compiler.reading.diagnostics import PlsysError
from plsys.compiler.reading.source import Source


def graph_of(text: str, **parameters: float):
    return build(Source.from_text(text), parameters=parameters).graph


def batches(text: str, **options):
    unfolding = unfold(graph_of(text), **options)
    return unfolding, list(unfolding)


def all_of(text: str, field: str, **options) -> np.ndarray:
    return np.concatenate([getattr(batch, field) for batch in batches(text, **options)[1]])


@pytest.mark.parametrize("level", range(4))
def test_menger_has_20_to_the_n_boxes(level):
    graph = build("scenes/menger.plsys", parameters={"level": level}).graph
    assert sum(int((np.array(batch.kinds) == "box").sum()) for batch in unfold(graph)) == 20**level


def test_the_papers_tree_has_2049_cylinders_and_13_levels():
    unfolding = unfold(build("scenes/tree.plsys").graph)
    kinds = np.concatenate([batch.kinds for batch in unfolding])
    assert (kinds == "cylinder").sum() == 2049 and (kinds == "plane").sum() == 1
    assert unfolding.depth == 13


BINARY = """object { S }
Selection S { C_begin S; if (n > 0) S -> sphere + [ --n ] ([ trans 1 0 0 ] S + [ trans 0 0 1 ] S); else S -> box; }
Calculation C_begin { n = 9; }"""


@pytest.mark.parametrize("chunk", [1, 2, 7, 100, 10**6])
def test_order_is_that_of_the_paths_for_any_chunk(chunk):
    _, found = batches(BINARY, chunk=chunk, paths=True)
    paths = [path for batch in found for path in batch.path]
    assert paths == sorted(paths)
    assert len(paths) == len(set(paths)) == 2**10 - 1
    np.testing.assert_array_equal(
        np.concatenate([batch.matrix for batch in found]), all_of(BINARY, "matrix", chunk=10**6)
    )


def test_memory_is_bounded_by_depth_times_chunk():
    """4,194,303 primitives in chunks of 1,024: what is held at once doesn't grow with the scene."""
    text = BINARY.replace("n = 9", "n = 16")
    unfolding = unfold(graph_of(text), chunk=1024)
    largest = max(len(batch) for batch in unfolding)
    assert unfolding.primitives == 2**17 - 1
    assert unfolding.widest < 20 * 3 * 1024
    assert largest < 4 * 1024


def test_transformations_compose_outside_in():
    text = "object { S }\nSelection S { S -> [ trans 0 0 2; roty 90 ] [ scale 1 2 3 ] sphere; }"
    expected = [[0, 0, 3, 0], [0, 2, 0, 0], [-1, 0, 0, 2]]
    np.testing.assert_array_equal(all_of(text, "matrix")[0], expected)


def test_a_calculation_reaches_its_own_operand_only():
    text = """object { S }
Selection S { C S; S -> [ a = 5; a += 1 ] [ scale a ] sphere + [ scale a ] sphere; }
Calculation C { a = 2; }"""
    assert all_of(text, "matrix")[:, 0, 0].tolist() == [6, 2]


def test_symbol_arguments_are_evaluated_before_any_is_assigned():
    text = """object { Start }
Selection Start { Start -> Pair(1, 2); }
Selection Pair(a, b) { if (a < 2) Pair -> Pair(b, a); else Pair -> [ scale a b 1 ] sphere; }"""
    matrix = all_of(text, "matrix")[0]
    assert (matrix[0, 0], matrix[1, 1]) == (2, 1)


def test_draws_are_counted_on_their_streams_along_the_path():
    text = """global_settings { seed 11 }
object { S }
Selection S { S -> [ trans rand(0) rand(0) rand(3) ] sphere + [ trans rand(0) 0 0 ] sphere; }"""
    key = elementary.mix(elementary.mix(elementary.seed_key(11.0), elementary.name_hash("S")), 0)
    key = elementary.mix(key, elementary.name_hash("S"))
    first, second = (elementary.mix(key, elementary.TERM + i) for i in (0, 1))

    def draw(key, stream, ordinal):
        return elementary.rand(key, elementary.bits(stream), ordinal)

    found = all_of(text, "matrix")[:, :, 3]
    assert found[0].tolist() == [draw(first, 0.0, 0), draw(first, 0.0, 1), draw(first, 3.0, 0)]
    assert found[1].tolist() == [draw(second, 0.0, 0), 0, 0]


def test_short_circuits_draw_only_where_they_are_evaluated():
    text = """object { S }
Selection S { C S; S -> [ a = n > 0 && rand(0) > 2; trans rand(0) 0 0 ] sphere + [ --n ] T; }
Selection T { T -> [ a = n > 0 && rand(0) > 2; trans rand(0) 0 0 ] sphere; }
Calculation C { n = 1; }"""
    key = elementary.mix(elementary.mix(elementary.seed_key(0.0), elementary.name_hash("S")), 0)
    key = elementary.mix(key, elementary.name_hash("S"))
    stream = elementary.bits(0.0)
    first = elementary.rand(elementary.mix(key, elementary.TERM), stream, 1)
    inner = elementary.mix(elementary.mix(key, elementary.TERM + 1), elementary.name_hash("T"))
    assert all_of(text, "matrix")[:, 0, 3].tolist() == [first, elementary.rand(inner, stream, 0)]


def test_weighted_alternatives_come_as_often_as_their_weights():
    text = """object { S }
Selection S { C S; if (n > 0) S -> A + [ --n ] S; }
Selection A { A -> 3: sphere | 1: box | 0: cone(0); }
Calculation C { n = 4000; }"""
    kinds = np.concatenate([batch.kinds for batch in batches(text)[1]])
    share = (kinds == "sphere").mean()
    assert len(kinds) == 4000 and "cone" not in kinds
    assert abs(share - 0.75) < 4 * np.sqrt(0.75 * 0.25 / 4000)


def test_variants_share_whole_plants():
    text = """object { S }
Selection S { C S; if (n > 0) S -> [ variants 3 ] A + [ --n ] S; }
Selection A { A -> [ trans rand(0) 0 0 ] sphere; }
Calculation C { n = 200; }"""
    assert len(np.unique(all_of(text, "matrix")[:, 0, 3])) == 3


def test_a_texture_keeps_the_frame_where_it_stands_and_replaces_the_inherited_one():
    text = """Texture Tiles { pigment { checker color rgb n, color rgb 0 } }
#declare Plain = texture { pigment { color rgb 1 } }
object { S texture { Plain } }
Selection S { C S; S -> sphere + [ trans 1 2 3 ] Tiles [ scale 5 ] sphere; }
Calculation C { n = 0.5; }"""
    unfolding, (batch,) = batches(text)
    names = [unfolding.graph.nodes[node].name for node in batch.texture]
    assert names[1] == "Tiles" and batch.texture[0] != batch.texture[1]
    assert batch.frame[1][:, 3].tolist() == [1, 2, 3] and batch.frame[1][0, 0] == 1


def test_singular_transformations_drop_their_subtrees_and_are_counted():
    text = "object { S }\nSelection S { C S; S -> sphere + [ scale 1 a 1 ] (sphere + box); }\nCalculation C { a = 0; }"
    unfolding, found = batches(text.replace("a = 0", "a = rand(0)*0"))
    assert unfolding.primitives == 1 and unfolding.singular == 1


@pytest.mark.parametrize(
    "body, limit",
    [
        ("S", "max_depth"),
        ("(sphere + S)", "max_depth"),
        ("(S + S + S)", "max_pending|max_depth"),
        ("(sphere + sphere + sphere + sphere + [ scale 1 ] S + sphere + S)", "max_primitives|max_pending"),
    ],
)
def test_endless_derivations_end_with_a_limit_that_has_a_name(body, limit):
    text = f"object {{ S }}\nSelection S {{ C S; if (n + rand(0) > 0) S -> [ scale 0.5 ] {body}; }}\nCalculation C {{ n = 1; }}"
    with pytest.raises(PlsysError, match=limit):
        for _ in unfold(graph_of(text), max_depth=200, max_pending=20_000, max_primitives=5_000, chunk=512):
            pass


@pytest.mark.parametrize(
    "body, message",
    [
        ("S -> [ a = 1/z; scale a ] sphere", "'a'.*inf"),
        ("S -> [ scale sqrt(z - 1) ] sphere", r": scale nan gives .* not finite \(z = 0\)"),
        ("S -> [ trans 1/z 0 0 ] sphere", r"trans inf 0 0 .* not finite \(z = 0\)"),
        ("S -> z: sphere | z: box", r"weights are 0 \(z = 0\)"),
        ("S -> min(z - 1, 2): sphere | 2: box", "weight"),
        ("S -> [ variants z + 0.5 ] sphere", "variants"),
    ],
)
def test_bad_values_are_errors_with_a_place(body, message):
    text = f"object {{ S }}\nSelection S {{ C S; {body}; }}\nCalculation C {{ z = rand(0)*0; }}"
    with warnings.catch_warnings(), pytest.raises(PlsysError, match=message) as caught:
        warnings.simplefilter("error")
        list(unfold(graph_of(text)))
    assert ":2:" in caught.value.place
