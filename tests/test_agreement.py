"""The strongest tests there are: different ways to the same answer must agree.

graph traced = unfolded scene traced · none = boxes = bvh · one thread = two · the runtime's unfolding = the NumPy
unfolder's · counts = closed forms.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import oracle
from plsys.compiler import compile
from plsys.compiler.export.unfold import unfold
from plsys.compiler.graph.forecast import forecast
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source
from plsys.runtime import Scene
from random_scenes import scenes

ACCELERATORS = ("none", "boxes", "grid", "bvh")
TREE = "scenes/tree.plsys"
RANDOM = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))


def rays(count: int, seed: int, centre, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Rays from a sphere around `centre` to points near it, and some from within: at no round distance, where a scene's sphere
    may be, since a ray that begins on a surface has a root at t = 0 but for rounding."""
    random = np.random.default_rng(seed)
    origins = random.normal(size=(count, 3))
    origins *= (3 * size / np.linalg.norm(origins, axis=1))[:, None]
    origins[::7] *= random.uniform(0.05, 0.15, (len(origins[::7]), 1))
    targets = random.uniform(-size, size, (count, 3))
    return origins + centre, targets - origins


def around(data: bytes) -> tuple[np.ndarray, float]:
    """Centre and half size of a scene's finite primitives."""
    with Scene(data, accelerator="none") as scene:
        points = [batch.matrix[batch.kind != 9][:, :, 3] for batch in scene.unfold()]
    points = np.concatenate(points) if points else np.zeros((0, 3))
    if len(points) == 0:
        return np.zeros(3), 1.0
    low, high = points.min(0), points.max(0)
    return (low + high) / 2, float(np.max(high - low) / 2 + 1)


def same_hits(data: bytes, origins, directions):
    """All accelerators' hits, after checking that they are the same bits."""
    results = []
    for accelerator in ACCELERATORS:
        with Scene(data, accelerator=accelerator) as scene:
            results.append(scene.intersect(origins, directions))
    for name, result in zip(ACCELERATORS[1:], results[1:]):
        for field in ("t", "primitive", "symbol", "depth", "normal"):
            np.testing.assert_array_equal(getattr(result, field), getattr(results[0], field), err_msg=f"{name}: {field}")
    return results[0]


@RANDOM
@given(text=scenes(), seed=st.integers(0, 2**32))
def test_random_scenes_traced_as_graph_and_unfolded(text, seed):
    compilation = build(Source.from_text(text))
    data = compilation.encode()
    centre, size = around(data)
    origins, directions = rays(60, seed, centre, size)
    hits = same_hits(data, origins, directions)

    primitives = [
        (batch.kinds[i], batch.matrix[i], batch.argument[i]) for batch in unfold(compilation.graph) for i in range(len(batch.matrix))
    ]
    t, which, gap = oracle.nearest(origins, directions, primitives)
    clear = (gap > 1e-9) & ~_grazing(origins, directions, primitives, hits)
    np.testing.assert_array_equal(hits.primitive[clear], which[clear])
    found = clear & np.isfinite(t)
    np.testing.assert_allclose(hits.t[found], t[found], rtol=1e-9)


def _grazing(origins, directions, primitives, hits) -> np.ndarray:
    """Rays whose answer a shift by 1e-9 of the origin changes: outside what rounding can decide."""
    shift = 1e-9 * (1 + np.abs(origins))
    first = oracle.nearest(origins + shift, directions, primitives)
    second = oracle.nearest(origins - shift, directions, primitives)
    return first[1] != second[1]


@RANDOM
@given(text=scenes())
def test_the_two_unfoldings_agree(text):
    compilation = build(Source.from_text(text))
    with Scene(compilation.encode(), accelerator="none") as scene:
        ours = list(scene.unfold())
    theirs = list(unfold(compilation.graph))
    matrices = np.concatenate([b.matrix for b in ours]) if ours else np.zeros((0, 3, 4))
    expected = np.concatenate([b.matrix for b in theirs]) if theirs else np.zeros((0, 3, 4))
    assert len(matrices) == len(expected)
    np.testing.assert_allclose(matrices, expected, rtol=1e-12, atol=1e-12)


@RANDOM
@given(text=scenes(), seed=st.integers(0, 2**32))
def test_images_are_the_same_bits_on_any_accelerator_and_thread_count(text, seed):
    data = compile(text)
    images = []
    for accelerator in ACCELERATORS:
        for threads in (1, 2):
            with Scene(data, accelerator=accelerator, threads=threads) as scene:
                images.append(scene.render(24, 18, channels=("color", "primitive", "depth")))
    for image in images[1:]:
        for name in image:
            np.testing.assert_array_equal(image[name], images[0][name])


@RANDOM
@given(text=scenes())
def test_the_forecast_counts_what_the_unfolder_finds(text):
    graph = build(Source.from_text(text)).graph
    prediction = forecast(graph)
    generated = sum(int(np.count_nonzero(batch.symbol >= 0)) for batch in unfold(graph))
    low, _, high = prediction.primitives_range
    assert low <= generated <= high
    if prediction.primitives is not None:
        assert prediction.primitives == generated


@pytest.mark.parametrize(
    "scene, parameters, count",
    [("tree", {}, 2049), *[("menger", {"level": n}, 20**n) for n in range(4)], *[("sierpinski", {"level": n}, 4**n) for n in range(6)]],
)
def test_counts_equal_closed_forms(scene, parameters, count):
    compilation = build(Source.read(f"scenes/{scene}.plsys"), parameters=parameters)
    assert forecast(compilation.graph).primitives == count
    assert sum(int(np.count_nonzero(batch.symbol >= 0)) for batch in unfold(compilation.graph)) == count
    with Scene(compilation.encode()) as traced:
        assert sum(int(np.count_nonzero(batch.symbol >= 0)) for batch in traced.unfold()) == count
        assert traced.statistics["primitives"] == count


def test_the_tree_has_thirteen_states():
    compilation = build(Source.read(TREE))
    assert forecast(compilation.graph).states == 13
    with Scene(compilation.encode()) as scene:
        assert scene.statistics["states"] == 13


def test_a_tree_of_order_1000_is_counted_exactly():
    count = forecast(build(Source.read(TREE), parameters={"order": 1000}).graph).primitives
    assert count == 2 + 2**1001 - 1
    assert len(str(count)) == 302


@pytest.mark.parametrize("change", [("betaBr -= 4.0", "betaBr -= 6.0"), ("scale 0.8 0.8 0.8", "scale 0.7 0.7 0.7"), ("scale 0.8 0.8 0.8", "scale 1.1 1.1 1.1")])
def test_nothing_is_cut_off_when_deeper_branches_outgrow_the_first(change):
    """The paper's own root-level boxes would cut geometry off here."""
    text = Source.read(TREE).data.decode()
    assert change[0] in text
    text = text.replace(*change).replace("order = 10", "order = 6")
    compilation = build(Source.from_text(text))
    data = compilation.encode()
    centre, size = around(data)
    origins, directions = rays(400, 1, centre, size)
    hits = same_hits(data, origins, directions)
    primitives = [(b.kinds[i], b.matrix[i], b.argument[i]) for b in unfold(compilation.graph) for i in range(len(b.matrix))]
    t, which, gap = oracle.nearest(origins, directions, primitives)
    clear = gap > 1e-9
    np.testing.assert_array_equal(hits.primitive[clear], which[clear])


@pytest.mark.parametrize("detail", [0, 0.01])
@pytest.mark.parametrize("items", [1, 7])
def test_copies_too_thin_for_single_precision_block_the_same_rays(items, detail):
    """Their frames' rays meet everything, and what lies behind them must not be taken for something before."""
    text = """camera { location <1, -5, 2> look_at 0 }
    Selection A { if (n <= 0) A -> sphere; else A -> [ --n; scale 1 1e-08 0.0001; trans 0.3 0.1 0.2; ] A
        + [ --n; scale 0.1 1 1; trans -0.4 0.3 0.1 ] A + torus(0.3); }
    Selection Root { Root -> [ n = 3 ] A; }
    object { Root }
    """
    random, data = np.random.default_rng(3), compile(text)
    with Scene(data, accelerator="none") as scene:
        matrices = np.concatenate([batch.matrix for batch in scene.unfold()])
        matrices = matrices[random.integers(0, len(matrices), 3000)]
        origins = np.einsum("nij,nj->ni", matrices[:, :, :3], 0.7 * random.normal(size=(3000, 3))) + matrices[:, :, 3]
        directions = np.einsum("nij,nj->ni", matrices[:, :, :3], random.normal(size=(3000, 3)))
        distances = random.uniform(0, 1, 3000)
        expected = scene.occluded(origins, directions, distances)
    with Scene(data, accelerator="bvh", front_items=items, detail=detail) as scene:
        np.testing.assert_array_equal(scene.occluded(origins, directions, distances), expected)
        one_by_one = [scene.occluded(o, d, t)[0] for o, d, t in zip(origins, directions, distances)]
        np.testing.assert_array_equal(one_by_one, expected)


def test_adding_a_rule_elsewhere_leaves_a_random_plant_unchanged():
    text = Source.read("scenes/bush.plsys").data.decode()
    addition = "Selection Pebbles { Pebbles -> [ trans 5*rand(0) 3 0; scale 0.1 ] sphere; }\nobject { Pebbles }\n"
    plant, with_pebbles = (build(Source.from_text(t)).graph for t in (text, addition + text))
    of_plant = np.concatenate([b.matrix for b in unfold(plant)])
    of_both = np.concatenate([b.matrix for b in unfold(with_pebbles)])
    assert len(of_both) == len(of_plant) + 1
    rows = {row.tobytes() for row in of_both}
    assert all(row.tobytes() in rows for row in of_plant)
