"""Hits through the public binding: what is hit, from which place of the derivation, the same by every accelerator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from assembly import IDENTITY, Assembly

from plsys.compiler import compile, elementary
from plsys.runtime import PlsysRuntimeError, Scene

ROOT = Path(__file__).resolve().parents[2]
ACCELERATORS = ("none", "boxes", "grid", "bvh")


def hits(data: bytes, origins, directions):
    """The hits, after checking that all accelerators give the same bits."""
    results = []
    for accelerator in ACCELERATORS:
        with Scene(data, accelerator=accelerator) as scene:
            results.append(scene.intersect(origins, directions))
    for accelerator, result in zip(ACCELERATORS[1:], results[1:]):
        for name, ours, expected in zip(result._fields, result, results[0]):
            np.testing.assert_array_equal(ours, expected, err_msg=f"{accelerator}: {name}")
    return results[0]


def moved(x: float, y: float, z: float) -> tuple:
    return (1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z)


def one_shape(shape: str, *arguments: float, matrix=IDENTITY) -> bytes:
    a = Assembly()
    code = a.code("; ".join([f"const {argument}" for argument in arguments] + ["end"])) if arguments else 0
    a.node("object", name="", ordinal=0, child=1)
    a.node("transform", name="T", matrix=matrix, child=2)
    a.node("primitive", shape=shape, code=code)
    return a.bytes()


def chain(depth: float, step: str, counts: str = "load n; const 1; subtract; store n; end") -> bytes:
    """X: a sphere + [counts] [step] X, while n > 0."""
    a = Assembly(["n"], file="chain.plsys")
    init, test = a.code(f"const {depth}; store n; end"), a.code("load n; const 0; greater; end")
    count, step_code = a.code(counts), a.code(step)
    a.node("object", name="X", ordinal=0, child=1)
    a.node("calculate", name="init", code=init, child=2)
    a.node("enter", symbol=3)
    a.node("symbol", (3, 1, 3, 2), name="X", live=("n",), draws=0, body=4)
    a.node("branch", test=test, then=5, otherwise=9)
    a.node("union", children=(9, 6))
    a.node("calculate", name="count", code=count, child=7)
    a.node("transform_code", (4, 5, 4, 9), name="T", code=step_code, child=8)
    a.node("enter", symbol=3)
    a.node("primitive", shape="sphere", code=0)
    return a.bytes()


@pytest.mark.parametrize(
    "shape, arguments, origin, t, normal",
    [
        ("sphere", (), (0.6, 0, 5), 4.2, (0.6, 0, 0.8)),
        ("cylinder", (), (0, 0, 5), 4, (0, 0, 1)),
        ("cone", (0.5,), (0.75, 0, 5), 4.5, (1 / np.sqrt(1.25), 0, 0.5 / np.sqrt(1.25))),
        ("box", (), (0.5, 0.5, 5), 4, (0, 0, 1)),
        ("torus", (0.25,), (1, 0, 5), 4.75, (0, 0, 1)),
        ("triangle", (), (0.2, 0.3, 5), 5, (0, 0, 1)),
        ("square", (), (0.9, 0.9, 5), 5, (0, 0, 1)),
        ("disc", (), (-0.5, 0.5, 5), 5, (0, 0, 1)),
        ("plane", (), (70, -80, 5), 5, (0, 0, 1)),
    ],
)
def test_each_shape_from_above(shape, arguments, origin, t, normal):
    result = hits(one_shape(shape, *arguments), origin, (0, 0, -1))
    np.testing.assert_allclose(result.t, [t], rtol=1e-12)
    np.testing.assert_allclose(result.normal, [normal], atol=1e-12)
    assert result.primitive.tolist() == [0] and result.depth.tolist() == [0] and result.symbol.tolist() == [-1]


@pytest.mark.parametrize("top", [0.0, 0.37, 0.5, 1.5, 3.0])
def test_rays_parallel_to_the_side_of_a_cone_meet_it_at_most_once(top):
    """Such a ray's equation has one root. Beside the cone it meets the other nappe, or (in a plane that touches the
    cone) nothing at all."""
    slope, steps, random = top - 1, np.arange(-2, 2.25, 0.25), np.random.default_rng(5)
    places = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    angles = np.concatenate([np.radians([0, 90, 180, 270, 17, 45, 101]).repeat(len(places)), random.uniform(0, 7, 20000)])
    across, along = np.stack([np.cos(angles), np.sin(angles), 0 * angles]), np.stack([-np.sin(angles), np.cos(angles), 0 * angles])
    directions = (slope * across + [[0], [0], [1]]).T * random.choice([-1, 1], (len(angles), 1))
    touching = (across + along * 5 * random.normal(size=len(angles))).T - directions * random.uniform(-3, 3, (len(angles), 1))
    origins = np.vstack([np.tile(places, (7, 1)), touching[-20000:]])
    result = hits(one_shape("cone", top), origins, directions)
    hit = np.isfinite(result.t)
    ends = origins[hit] + result.t[hit, None] * directions[hit]
    assert np.abs(ends[:, 2] - 0.5).max() <= 0.5 + 1e-9
    assert (np.hypot(ends[:, 0], ends[:, 1]) <= 1 + slope * ends[:, 2] + 1e-6).all()


def test_t_counts_directions_and_the_normal_is_mapped_by_the_inverse_transpose():
    squeezed = (2, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0.5, 3)
    result = hits(one_shape("sphere", matrix=squeezed), [[1, 0, 9], [0, -5, 3]], [[0, 0, -2], [0, 0.5, 0]])
    height = 0.5 * np.sqrt(0.75)
    np.testing.assert_allclose(result.t, [(6 - height) / 2, 8], rtol=1e-14)
    expected = np.array([1 / 4, 0, height / 0.25])
    np.testing.assert_allclose(result.normal[0], expected / np.linalg.norm(expected), rtol=1e-12)
    np.testing.assert_allclose(result.normal[1], [0, -1, 0], atol=1e-15)


@pytest.mark.parametrize("length", [1e-300, 1e-170, 1e-160, 1e-12, 1e12, 1e160, 1e300])
@pytest.mark.parametrize("accelerator", ACCELERATORS)
def test_a_direction_of_any_length_meets_the_same(accelerator, length):
    """Also where the squares of its numbers are too small, or too large, to be numbers."""
    random = np.random.default_rng(7)
    origins, directions = random.uniform(-3, 3, (400, 3)), random.normal(size=(400, 3))
    with Scene(compile(ROOT / "scenes/tree.plsys", parameters={"order": 4}), accelerator=accelerator) as scene:
        expected, found = scene.intersect(origins, directions), scene.intersect(origins, directions * length)
        np.testing.assert_array_equal(found.primitive, expected.primitive)
        np.testing.assert_allclose(found.t * length, expected.t, rtol=1e-9)
        for factor, is_met in ((1 + 1e-6, True), (1 - 1e-6, False)):
            hit = np.isfinite(expected.t)
            assert (scene.occluded(origins[hit], directions[hit] * length, factor * found.t[hit]) == is_met).all()


def test_a_miss_is_infinitely_far_and_nothing():
    result = hits(one_shape("sphere"), (0, 0, 5), (0, 0, 1))
    assert result.t[0] == np.inf and result.primitive[0] == result.symbol[0] == result.rule[0] == -1
    assert not result.normal.any() and np.isnan(result.bound[0])


def test_on_equal_t_the_first_in_the_derivation_is_hit():
    a = Assembly(["n"])
    deeper = a.code("const 0; store n; end")
    a.node("object", name="", ordinal=0, child=1)
    a.node("union", children=(2, 7, 6, 6))
    a.node("transform", name="away", matrix=moved(50, 0, 0), child=6)
    a.node("calculate", name="c", code=deeper, child=4)
    a.node("enter", symbol=5)
    a.node("symbol", name="S", live=(), draws=0, body=6)
    a.node("primitive", shape="box", code=0)
    a.node("union", children=(3, 6))
    result = hits(a.bytes(), (0.5, 0.5, 5), (0, 0, -1))
    assert result.primitive.tolist() == [1] and result.depth.tolist() == [1]


def test_planes_below_symbols_are_hit_at_any_distance():
    a = Assembly()
    tilt = a.code("const 0; const 0; const -3; trans; const 30; rotx; end")
    a.node("object", name="X", ordinal=0, child=1)
    a.node("enter", symbol=2)
    a.node("symbol", name="X", live=(), draws=0, body=3)
    a.node("union", children=(4, 5, 7))
    a.node("primitive", shape="sphere", code=0)
    a.node("transform_code", name="tilt", code=tilt, child=6)
    a.node("primitive", shape="plane", code=0)
    a.node("transform", name="T", matrix=moved(9, 0, 0), child=8)
    a.node("enter", symbol=9)
    a.node("symbol", name="Y", live=(), draws=0, body=10)
    a.node("union", children=(6, 11))
    a.node("primitive", shape="box", code=0)
    result = hits(a.bytes(), [[0, 0, 9], [1e6, 40, 99], [9.5, 0.5, 9], [20, 0, 5]], [[0, 0, -1]] * 4)
    assert result.primitive.tolist() == [0, 1, 3, 2]
    np.testing.assert_allclose(result.t, [8, 102 - 40 * np.tan(np.radians(30)), 8, 5], rtol=1e-9)


def test_a_mesh_is_one_primitive_with_smooth_normals_where_given():
    a = Assembly()
    corners = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0))
    tilted = ((0, 0, 1), (1, 0, 1))
    mesh = a.mesh("m", corners, ((0, 1, 2), (3, 2, 1)), tilted, ((0, 0, 0), (1, 1, 1)))
    a.node("object", name="", ordinal=0, child=1)
    a.node("union", children=(2, 3))
    a.node("mesh", mesh=mesh)
    a.node("transform", name="T", matrix=moved(5, 0, 0), child=2)
    result = hits(a.bytes(), [[0.2, 0.2, 1], [0.9, 0.9, 1], [5.5, 0.5, 1], [6.5, 0.5, 1]], [[0, 0, -1]] * 4)
    assert result.primitive.tolist() == [0, 0, 1, -1]
    np.testing.assert_allclose(result.normal[0], [0, 0, 1])
    np.testing.assert_allclose(result.normal[1], np.array([1, 0, 1]) / np.sqrt(2))


def test_draws_of_textures_count_for_what_follows():
    a = Assembly()
    colour, place = a.code("const 0; rand; texture_set 32; end"), a.code("const 0; rand; const 0; const 0; trans; end")
    bark = a.record("texture", ((0, 1, 1, 1, 0, 0),))
    a.node("object", name="S", ordinal=0, child=1)
    a.node("texture", name="Bark", texture=bark, code=colour, draws=1, child=2)
    a.node("transform_code", name="T", code=place, child=3)
    a.node("primitive", shape="sphere", code=0)
    key = elementary.mix(elementary.mix(elementary.seed_key(0.0), elementary.name_hash("S")), 0)
    expected = elementary.rand(key, elementary.bits(0.0), 1)
    with Scene(a.bytes()) as scene:
        (batch,) = scene.unfold()
    assert batch.matrix[0, 0, 3] == expected
    hits(a.bytes(), (expected, 0, 5), (0, 0, -1))


@pytest.mark.parametrize("change", [("-= 4.0", "-= 6.0"), ("scale 0.8 0.8 0.8", "scale 0.7 0.7 0.7"), ("scale 0.8 0.8 0.8", "scale 1.1 1.1 1.1")])
def test_deeper_instances_that_outgrow_the_first_are_not_cut_off(change):
    text = (ROOT / "scenes" / "tree.plsys").read_text()
    assert change[0] in text
    data = compile(text.replace(*change), parameters={"order": 6})
    random = np.random.default_rng(3)
    with Scene(data, accelerator="none") as scene:
        batch = next(iter(scene.unfold()))
    targets = batch.matrix[random.integers(1, len(batch.matrix), 3000)] @ [0.2, 0.1, 0.7, 1]
    origins = random.normal(size=(3000, 3)) * 60
    result = hits(data, origins, targets - origins)
    assert (result.primitive >= 0).all()


def test_a_derivation_100000_levels_deep_is_traced():
    data = chain(100000, "const 0.001; const 0; const 0; trans; end")
    result = hits(data, [[200, 0, 0], [-9, 0, 0]], [[-1, 0, 0], [1, 0, 0]])
    np.testing.assert_allclose(result.t, [99, 8], rtol=1e-9)
    assert result.primitive.tolist() == [100000, 0] and result.depth.tolist() == [100001, 1]


@pytest.mark.parametrize("factor", ["0.3333333333333333", "2", "8"])
def test_scales_that_leave_the_range_of_numbers_do_no_harm(factor):
    data = chain(1000, f"const 2; const 0; const 0; trans; const {factor}; scale_uniform; end")
    result = hits(data, [[2.0, 0, 9], [-5, 0.5, 0.25], [1e200, 3, 4]], [[0, 0, -1], [1, 0, 0], [-1, 0, 0]])
    assert np.isfinite(result.t[:2]).all()


def test_singular_transformations_drop_their_subtree_and_are_counted():
    data = chain(3, "const 1; const 0; const 1; scale; end")
    assert hits(data, (0, 0, 9), (0, 0, -1)).primitive.tolist() == [0]
    with Scene(data) as scene:
        assert scene.statistics["singular"] == 1 and scene.statistics["primitives"] == 1


@pytest.mark.parametrize("accelerator", ["boxes", "bvh"])
def test_endless_recursion_names_symbol_and_values(accelerator):
    data = chain(5, "const 1; rotx; end", counts="const 5; store n; end")
    with pytest.raises(PlsysRuntimeError, match=r"^chain.plsys:3:1: endless recursion: X with n = 5 contains itself$"):
        Scene(data, accelerator=accelerator)


def test_a_recursion_that_goes_on_too_long_reaches_a_named_limit():
    data = chain(1e9, "const 1; rotx; end")
    with pytest.raises(PlsysRuntimeError, match="^chain.plsys:3:1: depth: X is still being derived") as caught:
        Scene(data, accelerator="boxes")
    assert caught.value.kind == "limit"
    # bvh unfolds what is too much for a table of states when a ray touches it, and none derives it for every ray.
    for accelerator, message in (("bvh", "^chain.plsys:3:1: depth: a ray came"), ("none", "depth: X")):
        with Scene(data, accelerator=accelerator) as scene, pytest.raises(PlsysRuntimeError, match=message) as caught:
            scene.intersect((0, 0, 9), (0, 0, -1))
        assert caught.value.kind == "limit"


def test_the_memory_limit_is_named():
    with pytest.raises(PlsysRuntimeError, match="memory: .* more than the 100000 bytes allowed") as caught:
        Scene(chain(100000, "const 0.001; const 0; const 0; trans; end"), accelerator="boxes", memory=100000)
    assert caught.value.kind == "limit"


def test_a_ray_through_too_many_equal_things_reaches_a_named_limit():
    a = Assembly(["n"])
    init, test = a.code("const 60; store n; end"), a.code("load n; const 0; greater; end")
    count = a.code("load n; const 1; subtract; store n; end")
    a.node("object", name="X", ordinal=0, child=1)
    a.node("calculate", name="init", code=init, child=2)
    a.node("enter", symbol=3)
    a.node("symbol", name="X", live=("n",), draws=0, body=4)
    a.node("branch", test=test, then=5, otherwise=7)
    a.node("calculate", name="count", code=count, child=6)
    a.node("union", children=(2, 2))
    a.node("primitive", shape="sphere", code=0)
    with Scene(a.bytes()) as scene:
        assert scene.statistics["primitives"] == 2**60
        with pytest.raises(PlsysRuntimeError, match="ray: work: one ray took more than 16777216 steps") as caught:
            scene.intersect((0, 0, 9), (0, 0, -1))
    assert caught.value.kind == "limit"


def test_bad_arguments_of_shapes_stand_at_their_place():
    a = Assembly(file="bad.plsys")
    radius = a.code("const -0.5; end")
    a.node("object", name="", ordinal=0, child=1)
    a.node("primitive", (7, 3, 7, 13), shape="torus", code=radius)
    for accelerator in ACCELERATORS:
        with pytest.raises(PlsysRuntimeError, match="^bad.plsys:7:3: the minor radius of a torus must be above 0, not -0.5"):
            with Scene(a.bytes(), accelerator=accelerator) as scene:
                scene.intersect((0, 0, 9), (0, 0, -1))


def test_equal_subtrees_are_one_state():
    with Scene(compile(ROOT / "scenes" / "tree.plsys", parameters={"order": 200})) as scene:
        statistics = scene.statistics
    assert statistics["states"] == 203 and statistics["primitives"] is None  # about 2^201
    assert statistics["scene_bytes"] < 2_000_000


def test_what_casts_no_shadow_is_still_seen():
    """A lit floor below a ball: with no_shadow it is as bright as without the ball."""
    scene = """camera {{ location <0, 9, -1> look_at <0, 0, 4> }} light_source {{ <0, 50, 0> color rgb 1 }}
        plane {{ <0, 1, 0>, 0 pigment {{ color rgb 1 }} }} {ball}"""
    balls = ("", "sphere { <0, 3, 4>, 1 }", "sphere { <0, 3, 4>, 1 no_shadow }")
    images = []
    for ball in balls:
        data = compile(scene.format(ball=ball))
        for accelerator in ACCELERATORS:
            with Scene(data, accelerator=accelerator) as traced:
                images.append(traced.render(40, 30, channels=("color", "primitive")))
        np.testing.assert_array_equal(images[-1]["color"], images[-len(ACCELERATORS)]["color"])
    empty, solid, ghost = images[:: len(ACCELERATORS)]
    floor = ghost["primitive"] == 0
    np.testing.assert_array_equal(solid["primitive"], ghost["primitive"])
    assert 0 < (~floor).sum() < 1200
    np.testing.assert_array_equal(ghost["color"][floor], empty["color"][floor])
    assert (solid["color"][floor] < empty["color"][floor]).any()
