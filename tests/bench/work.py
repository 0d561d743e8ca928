"""Measures plsys on given rays, as a process of its own: a JSON request on standard input, a JSON answer on standard output.

    {"scene": "tree.plsys", "parameters": {"order": 10}, "rays": "rays.npz", "repeats": 3, "options": {"accelerator": "bvh"}}
    → {"sets": {"coherent": {"rates": [min, median, max], "hits": 512, "seconds": …}}, "scene_bytes": …, "build_seconds": …}

Only t is asked for, as of the peers. Rates are millions of rays a second, of CPU time or, with "wall": true, of the clock on
the wall. A set is cut off after `most_seconds`: slow accelerators trace its first rays only.

    {…, "pictures": 2, "size": [640, 480]} → {"pictures": [0.9, 0.4], …}       seconds of drawing the scene again and again
"""

from __future__ import annotations

import ctypes
import json
import resource
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


def measure(scene: Scene, rays: np.ndarray, repeats: int, most_seconds: float, clock: Clock) -> dict:
    origins, directions = (
        np.ascontiguousarray(rays[:, part], np.float64) for part in (slice(0, 3), slice(3, 6))
    )
    t = np.empty(len(rays))
    few = min(len(rays), 512)
    spread = np.linspace(0, len(rays) - 1, few).astype(int)
    seconds = intersect(scene, origins[spread].copy(), directions[spread].copy(), np.empty(few), clock)
    count = len(rays)
    if seconds / few * len(rays) > most_seconds:
        count = max(few, int(most_seconds / seconds * few))
        chosen = np.linspace(0, len(rays) - 1, count).astype(int)
        origins, directions, t = origins[chosen].copy(), directions[chosen].copy(), t[:count]
    rates = sorted(1e-6 * count / intersect(scene, origins, directions, t, clock) for _ in range(repeats))
    return {
        "rays": count,
        "rates": [rates[0], rates[len(rates) // 2], rates[-1]],
        "hits": int(np.isfinite(t).sum()),
        "t": t.tolist() if count == len(rays) and count <= 4096 else None,
    }


def draw(scene: Scene, size: tuple[int, int], times: int, clock: Clock) -> list[float]:
    """Seconds of each of the pictures; the first one finds caches cold."""
    pixels, seconds = bytearray(3 * size[0] * size[1]), []
    for _ in range(times):
        start = clock()
        scene.render_into({"srgb": pixels}, *size)
        seconds.append(clock() - start)
    return seconds


def main() -> None:
    request = json.load(sys.stdin)
    compilation = build(Source.read(request["scene"]), parameters=request["parameters"])
    data = compilation.encode()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    options = dict(request["options"])
    clock = time.perf_counter if request.get("wall") else time.process_time
    start = clock()
    with Scene(data, threads=request.get("threads", 1), **options) as scene:
        build_seconds = clock() - start
        answer: dict = {"build_seconds": build_seconds, "sets": {}}
        if request.get("pictures"):
            answer["pictures"] = draw(scene, request["size"], request["pictures"], clock)
        with np.load(request["rays"]) as sets:
            for name in () if request.get("pictures") else request.get("sets") or sets.files:
                answer["sets"][name] = measure(scene, sets[name], request["repeats"], request["most_seconds"], clock)
        if request.get("hits"):
            t = {}
            with np.load(request["rays"]) as sets:
                for name in sets.files:
                    rays = sets[name].astype(np.float64)
                    t[name] = np.empty(len(rays))
                    intersect(scene, rays[:, :3].copy(), rays[:, 3:].copy(), t[name])
            np.savez(request["hits"], **t)
        statistics = scene.statistics
    answer |= {
        name: statistics[name]
        for name in ("scene_bytes", "primitives", "states", "box_tests", "primitive_tests", "lazy", "rays", "front")
    }
    answer["rss_growth"] = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
