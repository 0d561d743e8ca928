"""Scenes and rays of extremes: every way of tracing gives the same hits, shadows and pictures, bit for bit.

A few scenes in `make test`, thousands in `make stress`. Where one fails, its number is the test's name.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from extreme_scenes import kind_of, scene
from instruction_sets import available
from plsys.compiler import compile
from plsys.runtime import PlsysRuntimeError, Scene
from stress import rounds

FIELDS = ("t", "primitive", "symbol", "rule", "depth", "normal")
ALL = 2**64 - 1


def ways(data: bytes, number: int) -> Iterator[dict]:
    """Arguments of Scene, the plainest first."""
    r, sets = random.Random(number), available(data)
    for accelerator in ("none", "boxes", "grid", "bvh"):
        if (accelerator, kind_of(number)) != ("none", "endless"):  # where nothing is left out, rays come to the limit
            yield {"accelerator": accelerator, "threads": 1}
    for isa in sets:
        yield {"isa": isa, "front_items": r.choice((1, 2, 7, 50)), "threads": 1}
    yield {"isa": r.choice(sets), "front_items": ALL, "threads": 2}
    yield {"isa": r.choice(sets), "memory": r.choice((30_000, 70_000, 400_000)), "threads": r.choice((1, 2))}


@contextmanager
def limits_allowed(are_allowed: bool) -> Iterator[None]:
    """Endless scenes and little memory may bring a way of tracing to a limit, which it names."""
    try:
        yield
    except PlsysRuntimeError as error:
        assert are_allowed and error.kind in ("limit", "memory"), error


def placed(data: bytes, most: int = 3000) -> np.ndarray:
    """(n, 3, 4): the matrices of primitives, of the first ones where there are many."""
    found = [np.eye(3, 4)[None]]
    with Scene(data) as scene, limits_allowed(True):
        for batch in scene.unfold():
            found.append(batch.matrix[batch.kind != 9])
            if sum(map(len, found)) > most:
                break
    return np.concatenate(found)


def rays(data: bytes, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Towards and along primitives, from near and far, in bundles, along axes with both zeros, of all lengths."""
    r, matrices = np.random.default_rng(number), placed(data)
    picked = matrices[r.integers(0, len(matrices), 600)]
    local = 0.6 * r.normal(size=(600, 3))
    local[::5] = r.choice((0, 0.5, 1, -1), (120, 3))  # corners and centres
    targets = np.einsum("nij,nj->ni", picked[:, :, :3], local) + picked[:, :, 3]
    directions = r.normal(size=(600, 3))
    along_axes, along_local = r.random(600) < 0.2, r.random(600) < 0.15
    directions[along_axes] = np.eye(3)[r.integers(0, 3, along_axes.sum())] * r.choice((-1, 1), (along_axes.sum(), 1))
    directions[along_local] = picked[along_local][:, :, :3][np.arange(along_local.sum()), :, r.integers(0, 3, along_local.sum())]
    directions[(directions == 0).all(1)] = (0, 0, 1)
    directions = np.where((directions == 0) & (r.random((600, 1)) < 0.3), -0.0, directions)
    away = r.choice((0, 0.5, 3, 20, 1e4, 1e8), 600) * np.where(r.random(600) < 0.5, np.abs(picked[:, :, :3]).sum((1, 2)), 1)
    length = np.abs(directions).max(1)  # squares of tiny ones are 0
    origins = targets - directions * (away / length)[:, None]
    directions = directions * r.choice((1, 1, 1, 1e-5, 1e5, 1e-12), (600, 1))
    low, high = targets.min(0), targets.max(0)
    across = np.max(high - low) * np.stack(np.meshgrid(*2 * [np.linspace(-0.35, 0.35, 16)]), -1).reshape(-1, 2)
    lattice = (low + high) / 2 + np.insert(across, 1, 0, axis=1)
    fan = np.insert(across, 1, np.max(high - low), axis=1)
    origins = np.vstack([origins, lattice, lattice - fan])
    directions = np.vstack([directions, np.tile((-0.0, 1.0, 0.0), (256, 1)), fan])
    is_ray = np.isfinite(origins).all(1) & np.isfinite(directions).all(1) & (directions != 0).any(1)
    return origins[is_ray], directions[is_ray]


def with_those_from_surfaces(scene: Scene, origins: np.ndarray, directions: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    r, hits = np.random.default_rng(number), scene.intersect(origins, directions)
    found = np.flatnonzero(np.isfinite(hits.t))[:200]
    points, away = origins[found] + hits.t[found, None] * directions[found], r.normal(size=(len(found), 3))
    away[::3], away[1::3] = hits.normal[found][::3], directions[found][1::3]
    return np.vstack([origins, points]), np.vstack([directions, away])


class Questions:
    """What is asked of every way of tracing, and the answers of the first one."""

    def __init__(self, data: bytes, number: int, scene: Scene) -> None:
        r = np.random.default_rng(number)
        self.origins, self.directions = with_those_from_surfaces(scene, *rays(data, number), number)
        self.hits = scene.intersect(self.origins, self.directions)
        self.distances = r.choice((0.3, 1, 5, np.inf), len(self.origins))
        self.blocked = self.hits.t < self.distances
        self.order = r.permutation(len(self.origins))
        normals = self.hits.normal[np.isfinite(self.hits.t)]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-12)

    def ask(self, scene: Scene, who: str) -> None:
        order = self.order
        found, shuffled = scene.intersect(self.origins, self.directions), scene.intersect(self.origins[order], self.directions[order])
        for field in FIELDS:
            expected = getattr(self.hits, field)
            np.testing.assert_array_equal(getattr(found, field), expected, err_msg=f"{who}: {field}")
            np.testing.assert_array_equal(getattr(shuffled, field), expected[order], err_msg=f"{who}, shuffled: {field}")
        np.testing.assert_array_equal(scene.occluded(self.origins, self.directions, self.distances), self.blocked, err_msg=who)
        for i in order[:20]:
            assert scene.intersect(self.origins[i], self.directions[i]).t[0] == self.hits.t[i], who
            assert scene.occluded(self.origins[i], self.directions[i], self.distances[i])[0] == self.blocked[i], who


@pytest.mark.parametrize("number", [n for n in range(rounds(ci=48, stress=8000)) if kind_of(n) != "endless"])
def test_every_way_of_tracing_gives_the_same_hits(number):
    data, questions = compile(scene(number)), None
    for arguments in ways(data, number):
        with limits_allowed("memory" in arguments), Scene(data, **arguments) as traced:
            questions = questions or Questions(data, number, traced)
            questions.ask(traced, str(arguments))
    assert questions


@pytest.mark.parametrize("number", range(rounds(ci=16, stress=4000)))
def test_every_way_of_tracing_gives_the_same_picture(number):
    data, channels, expected = compile(scene(number)), ("color", "depth", "primitive", "normal"), None
    detail = random.Random(number).choice((0.3, 1, 10, 60)) if number % 2 or kind_of(number) == "endless" else 0
    for arguments in ways(data, number):
        with limits_allowed("memory" in arguments or kind_of(number) == "endless"), Scene(data, **arguments, detail=detail) as traced:
            picture = traced.render(32, 24, channels=channels)
            expected = expected or picture
            for channel in channels:
                np.testing.assert_array_equal(picture[channel], expected[channel], err_msg=f"{arguments}, detail {detail}: {channel}")
    assert expected
