"""What all programs of the bench are given: scene texts without ground, rays, and unfolded or hand-split geometry.

    case = Case("order 20", "tree", {"order": 20}, folder)
    case.rays                         # {"coherent": (n, 6) float32, "random": …}, written to case.rays_path
    write_embree(case.folder / "flat.bin", [curves(case)], [])

The peers' geometry comes from the compiler's unfolder, not from the runtime.
"""

from __future__ import annotations

import re
import struct
from functools import cached_property
from pathlib import Path

import numpy as np

from plsys.compiler.export.unfold import unfold
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source
from plsys.runtime import Scene

SCENES = Path(__file__).resolve().parents[2] / "scenes"
TRIANGLES, CURVES, QUADS = 0, 1, 2
TILE = 4  # coherent rays come in tiles of TILE x TILE pixels, so that 16 neighbours are a packet
QUAD_CORNERS = np.array(
    [[[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]], [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
     [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]],
     [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]]], np.float64
)  # fmt: skip


def without_ground(text: str) -> str:
    """The peers have the generated primitives only, so nobody gets the plane."""
    return re.sub(r"^plane .*$", "", text, flags=re.MULTILINE)


class Case:
    """One scene with parameters: its text in `folder`, camera, and rays (seeded, in single precision so that all
    programs get the same bits)."""

    def __init__(
        self, name: str, scene: str, parameters: dict, folder: Path, text: str | None = None, size=(640, 480)
    ) -> None:
        self.name, self.parameters, self.size = name, parameters, size
        self.folder = folder / name.replace(" ", "-")
        self.folder.mkdir(parents=True, exist_ok=True)
        self.path = self.folder / f"{scene}.plsys"
        self.text = text or without_ground((SCENES / f"{scene}.plsys").read_text())
        self.path.write_text(self.text)

    @cached_property
    def compilation(self):
        return build(Source.read(str(self.path)), parameters=self.parameters)

    @cached_property
    def camera(self) -> dict[str, np.ndarray]:
        record = {"sky": (0, 1, 0), "right": (4 / 3, 0, 0), "up": (0, 1, 0)} | dict(
            self.compilation.graph.camera.values
        )
        return {name: np.array(value, float) for name, value in record.items()}

    @cached_property
    def rays(self) -> dict[str, np.ndarray]:
        coherent = camera_rays(self.camera, *self.size)
        with Scene(self.compilation.encode(), threads=1) as scene:
            few = coherent[:: max(1, len(coherent) // 10_000)].astype(float)
            o, d = few[:, :3], few[:, 3:]
            t = scene.intersect(o, d).t
        points = (o + np.where(np.isfinite(t), t, 0)[:, None] * d)[np.isfinite(t)]
        if len(points) == 0:
            raise RuntimeError(f"{self.name}: its camera sees nothing")
        return {"coherent": coherent, "random": random_rays(points.min(0), points.max(0), len(coherent) // 4)}

    @cached_property
    def rays_path(self) -> Path:
        path = self.folder / "rays.npz"
        np.savez(path, **self.rays)
        return path

    @cached_property
    def binary_rays_path(self) -> Path:
        path = self.folder / "rays.bin"
        with open(path, "wb") as file:
            file.write(struct.pack("<I", len(self.rays)))
            for name, rays in self.rays.items():
                file.write(struct.pack("<II", len(rays), name == "coherent"))
                file.write(rays.astype("<f4").tobytes())
        return path

    def triangles(self) -> np.ndarray:
        """(n, 9): the corners of generated triangles, in single precision as Embree has them."""
        parts = []
        for batch in unfold(self.compilation.graph):
            m = batch.matrix[np.asarray(batch.symbol) >= 0]
            foot = m[:, :, 3]
            parts.append(np.hstack([foot, foot + m[:, :, 0], foot + m[:, :, 1]]).astype(np.float32))
        return np.concatenate(parts)

    def unfolded(self):
        """kinds (n,) names, matrices (n, 3, 4), arguments (n,), parameters (n, slots) of all generated primitives."""
        batches = [b.take(b.symbol >= 0) for b in unfold(self.compilation.graph)]
        kinds = sum((b.kinds for b in batches), [])
        return kinds, *(
            np.concatenate([getattr(b, f) for b in batches]) for f in ("matrix", "argument", "parameters")
        )


def camera_rays(camera: dict, width: int, height: int) -> np.ndarray:
    """(width*height, 6) unit rays through pixel centres (POV-Ray's perspective camera), tile by tile."""
    d = camera["look_at"] - camera["location"]
    d /= np.linalg.norm(d)
    r = np.cross(camera["sky"], d)
    r /= np.linalg.norm(r)
    u = np.cross(d, r)
    right, up = np.linalg.norm(camera["right"]), np.linalg.norm(camera["up"])
    distance = right / np.tan(np.radians(camera["angle"].item()) / 2) / 2
    hand = np.sign(np.dot(np.cross(camera["up"], [0, 0, 1]), camera["right"])) or 1.0
    y, x = np.mgrid[0:height, 0:width]
    order = np.lexsort((x.ravel() % TILE, y.ravel() % TILE, x.ravel() // TILE, y.ravel() // TILE))
    x, y = (v.ravel()[order, None] for v in (x, y))
    directions = (
        distance * d + ((x + 0.5) / width - 0.5) * hand * right * r + (0.5 - (y + 0.5) / height) * up * u
    )
    return as_rays(np.broadcast_to(camera["location"], directions.shape), directions)


def random_rays(low: np.ndarray, high: np.ndarray, count: int) -> np.ndarray:
    """From a sphere around the box to points in it: no two rays have anything in common."""
    random = np.random.default_rng(1)
    centre, radius = (low + high) / 2, 0.75 * np.linalg.norm(high - low)
    outward = random.normal(size=(count, 3))
    origins = centre + radius * outward / np.linalg.norm(outward, axis=1)[:, None]
    return as_rays(origins, random.uniform(low, high, (count, 3)) - origins)


def as_rays(origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    return np.hstack([origins, directions / np.linalg.norm(directions, axis=1)[:, None]]).astype(np.float32)


# --- geometry ---


def cone_curves(matrices: np.ndarray) -> np.ndarray:
    """(n, 8): p0, r0, p1, r1 of unit cylinders under matrices that keep them round."""
    foot, axis, radius = matrices[:, :, 3], matrices[:, :, 2], np.linalg.norm(matrices[:, :, 0], axis=1)
    return np.column_stack([foot, radius, foot + axis, radius])


def box_quads(matrices: np.ndarray) -> np.ndarray:
    """(6n, 12): the sides of unit boxes."""
    corners = np.einsum("nij,qcj->nqci", matrices[:, :, :3], QUAD_CORNERS) + matrices[:, None, None, :, 3]
    return corners.reshape(-1, 12)


def triangles_of(quads: np.ndarray) -> np.ndarray:
    """(2n, 9): each quad as two triangles."""
    q = quads.reshape(-1, 4, 3)
    return np.stack([q[:, [0, 1, 2]], q[:, [0, 2, 3]]], axis=1).reshape(-1, 9)


def write_embree(
    path: Path, groups: list[tuple[int, np.ndarray]], instances: list[tuple[int, np.ndarray]]
) -> Path:
    """embree.c's scene file."""
    with open(path, "wb") as file:
        file.write(struct.pack("<I", len(groups)))
        for kind, data in groups:
            file.write(struct.pack("<II", kind, len(data)))
            file.write(data.astype("<f4").tobytes())
        file.write(struct.pack("<I", len(instances)))
        for group, matrix in instances:
            file.write(struct.pack("<I", group) + matrix.astype("<f4").tobytes())
    return path


def split_forest(case: Case) -> tuple[list[np.ndarray], list[tuple[int, np.ndarray]]]:
    """The forest by hand: curves of each kind of tree, and 10,000 instances (kind, (3, 4) matrix).

    Trees of order 0 give places and habits; a scene with one tree of each habit gives its geometry."""
    seedlings = Case("seedlings", "forest", {"order": 0}, case.folder)
    _, matrices, _, parameters = seedlings.unfolded()
    slots = {name: i for i, name in enumerate(seedlings.compilation.graph.parameters)}
    root, stem = matrices[0::2], matrices[1::2]
    del root
    # A stem is placed by its tree's frame and made thin by T_wood: scale 0.06 0.06 1.
    frames = stem.copy()
    frames[:, :, :2] /= 0.06
    habits = parameters[1::2][:, [slots[name] for name in ("spread", "ratio", "turn")]]
    kinds, which = np.unique(habits, axis=0, return_inverse=True)
    groups = []
    for i, (spread, ratio, turn) in enumerate(kinds):
        text = re.sub(r"object \{ Forest .*\}", "object { Alone }", case.text)
        text += f"\nSelection Alone {{ Alone -> T_root cylinder + Tame(order, {float(spread)!r}, {float(ratio)!r}, {float(turn)!r}); }}\n"
        tree = Case(f"tree {i}", "forest", case.parameters, case.folder, text)
        groups.append(cone_curves(tree.unfolded()[1]))
    return groups, list(zip(which.ravel().tolist(), frames))


def split_tree(case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An order-2n tree by hand: curves of the lower half, curves of the upper half's tree, (k, 3, 4) places of it."""
    order = int(case.parameters["order"])
    half = order // 2
    lower = Case("lower", "tree", {"order": half}, case.folder)
    angle = 60.0 - 4.0 * half
    text = re.sub(r"cntTrunk = 2; betaBr = 60.0;", f"cntTrunk = 0; betaBr = {angle};", case.text)
    upper = Case("upper", "tree", {"order": order - half}, case.folder, text)
    _, matrices, _, parameters = lower.unfolded()
    slots = {name: i for i, name in enumerate(lower.compilation.graph.parameters)}
    ends = parameters[:, slots["cntTree"]] == 0
    places = matrices[ends].copy()
    places[:, :, :2] /= 0.15
    places[:, :, 2] /= 2.0
    return cone_curves(matrices[~ends]), cone_curves(upper.unfolded()[1]), places
