"""Measures plsys on given rays, as a process of its own that takes turns (turns.py): a JSON request in the first line.

    {"scene": "tree.plsys", "parameters": {"order": 10}, "rays": "rays.npz", "options": {"accelerator": "bvh"}}
    0                                               traces the first set of rays
    → {"rates": 12.3}
    → {"sets": {"coherent": {"rays": 307200, "hits": 512}}, "scene_bytes": …, "build_seconds": …}     after the last turn

Only t is asked for, as of the peers. Rates are millions of rays a second, of CPU time or, with "wall": true, of the clock on
the wall. Of a set that takes longer than `most_seconds` some rays are traced, evenly spread.

    {…, "pictures": 2, "size": [640, 480]} → {"pictures": [0.9, 0.4], …}       seconds of drawing the scene again and again
"""

from __future__ import annotations

import ctypes
import json
import sys
import time
from collections.abc import Callable

import numpy as np

from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source
from plsys.runtime import Scene
from plsys.runtime.binding import PlError, PlHits, library, pointer

Clock = Callable[[], float]


def intersect(scene: Scene, origins: np.ndarray, directions: np.ndarray, t: np.ndarray, clock: Clock = time.process_time) -> float:
    """Seconds that the foremost hits of these rays take."""
    error, hits = PlError(), PlHits(t=pointer(t))
    with scene._open() as handle:
        start = clock()
        done = library().pl_intersect(
            handle, len(t), pointer(origins), pointer(directions), ctypes.byref(hits), ctypes.byref(error)
        )
        seconds = clock() - start
    if not done:
        error.raise_()
    return seconds


class RaySet:
    """Rays as the runtime takes them, and t of their foremost hits."""

    def __init__(self, scene: Scene, rays: np.ndarray, clock: Clock):
        self.scene, self.clock = scene, clock
        self.origins, self.directions = (
            np.ascontiguousarray(rays[:, part], np.float64) for part in (slice(0, 3), slice(3, 6))
        )
        self.t = np.empty(len(rays))

    def seconds(self) -> float:
        return intersect(self.scene, self.origins, self.directions, self.t, self.clock)

    def rate(self) -> float:
        return 1e-6 * len(self.t) / self.seconds()


def affordable(scene: Scene, rays: np.ndarray, most_seconds: float, clock: Clock) -> RaySet:
    """The rays, or as many of them, evenly spread, as take so long."""
    few = min(len(rays), 512)
    count = int(most_seconds * few / max(RaySet(scene, spread(rays, few), clock).seconds(), 1e-9))
    return RaySet(scene, spread(rays, max(count, few)), clock)


def spread(rays: np.ndarray, count: int) -> np.ndarray:
    return rays if count >= len(rays) else rays[np.linspace(0, len(rays) - 1, count).astype(int)]


def draw(scene: Scene, size: tuple[int, int], times: int, clock: Clock) -> list[float]:
    """Seconds of each of the pictures; the first one finds caches cold."""
    pixels, seconds = bytearray(3 * size[0] * size[1]), []
    for _ in range(times):
        start = clock()
        scene.render_into({"srgb": pixels}, *size)
        seconds.append(clock() - start)
    return seconds


def main() -> None:
    request = json.loads(sys.stdin.readline())
    compilation = build(Source.read(request["scene"]), parameters=request["parameters"])
    data = compilation.encode()
    options = dict(request["options"])
    clock = time.perf_counter if request.get("wall") else time.process_time
    start = clock()
    with Scene(data, threads=request.get("threads", 1), **options) as scene:
        build_seconds = clock() - start
        answer: dict = {"build_seconds": build_seconds}
        if request.get("pictures"):
            answer["pictures"] = draw(scene, request["size"], request["pictures"], clock)
        with np.load(request["rays"]) as loaded:
            rays = dict(loaded)
        sets: dict[str, RaySet] = {}
        for line in sys.stdin:
            name = list(rays)[int(line)]
            if name not in sets:
                sets[name] = affordable(scene, rays[name], request["most_seconds"], clock)
            print(json.dumps({"rates": sets[name].rate()}), flush=True)
        answer["sets"] = {
            name: {"rays": len(s.t), "hits": int(np.isfinite(s.t).sum())} for name, s in sets.items()
        }
        if request.get("hits"):
            np.savez(request["hits"], **{name: s.t for name, s in sets.items()})
        statistics = scene.statistics
    answer |= {
        name: statistics[name]
        for name in ("scene_bytes", "primitives", "lazy")
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
