"""What the bench measures of plsys alone: the paper's accelerators against each other, threads, the dial of fronts, growth."""

from __future__ import annotations

import os

from common import ALL, SETS, Bench, median, rate
from peers import ours
from prepare import Case
from report import size


def scatter(bench: Bench) -> None:
    """The paper's 2.3: its grid over its boxes, on spheres scattered by translations."""
    case = Case("scatter", "scatter", {}, bench.folder)
    boxes = [ours(case, options={"accelerator": "boxes"}, repeats=1) for _ in range(bench.rounds)]
    for sides, paper in (((16, 16, 8), " (paper: 2.3)"), ((64, 64, 4), "")):
        grid = [
            ours(case, options={"accelerator": "grid", "grid": sides}, repeats=1) for _ in range(bench.rounds)
        ]
        for name in SETS:
            bench.results.row(
                case.name, f"{name}: grid {'x'.join(map(str, sides))} of boxes{paper}", [rate(g, name) / rate(b, name) for g, b in zip(grid, boxes)],
                ours=f"{rate(grid[0], name):.4f} Mray/s, {size(grid[0]['scene_bytes'])}", theirs=f"{rate(boxes[0], name):.4f}, {size(boxes[0]['scene_bytes'])}",
            )  # fmt: skip
    bvh = ours(case)
    for name in SETS:
        bench.results.row(
            case.name,
            f"{name}: bvh of boxes",
            rate(bvh, name) / rate(boxes[0], name),
            ours=f"{rate(bvh, name):.2f} Mray/s",
        )


def threads(bench: Bench) -> None:
    """Two threads against one, on all cores."""
    cores = len(os.sched_getaffinity(0))
    for name, scene, parameters in (
        ("order 20", "tree", {"order": 20}),
        ("Menger 6", "menger", {"level": 6}),
    ):
        case = Case(name, scene, parameters, bench.folder)
        points = []
        for count in range(1, cores + 1):
            answers = [ours(case, pinned=False, threads=count, wall=True) for _ in range(bench.rounds)]
            points.append(
                {
                    "threads": count,
                    "rate": median([rate(a, "coherent") for a in answers]),
                    "all": [rate(a, "coherent") for a in answers],
                }
            )
        bench.results.curves[f"threads: {name}"] = points
        if cores > 1:
            bench.results.row(
                name, "2 threads of 1", [b / a for a, b in zip(points[0]["all"], points[1]["all"])], 1.9
            )


def fronts(bench: Bench) -> None:
    """The one dial, from pure graph to flat scene: items a front against memory and rate."""
    for name, scene, parameters in (
        ("order 20", "tree", {"order": 20}),
        ("Menger 4", "menger", {"level": 4}),
    ):
        case = Case(name, scene, parameters, bench.folder)
        points = []
        for items in (
            (1, 21, 256, 2048, ALL) if bench.quick else (1, 5, 21, 64, 256, 1024, 2048, 8192, 65536, ALL)
        ):
            answer = ours(case, options={"front_items": items}, repeats=3)
            if "failed" in answer:
                bench.results.note(name, f"fronts of {items} items: {answer['failed']}")
                continue
            points.append(
                {"items": items, "bytes": answer["scene_bytes"], "build_seconds": answer["build_seconds"]}
                | {n: rate(answer, n) for n in SETS}
            )
            shown = "all" if items == ALL else items
            bench.results.note(
                name,
                f"fronts of {shown} items: {size(answer['scene_bytes'])}, {rate(answer, 'coherent'):.2f} and {rate(answer, 'random'):.2f} Mray/s, built in {answer['build_seconds']:.3f} s",
            )
        bench.results.curves[f"fronts: {name}"] = points


def growth(bench: Bench) -> None:
    """Menger 2 to 10: 400 to 1e13 primitives."""
    points = []
    for level in range(2, 11):
        answer = ours(Case(f"Menger {level}", "menger", {"level": level}, bench.folder), repeats=1)
        if "failed" in answer:
            bench.results.note(f"Menger {level}", f"failed: {answer['failed']}")
            continue
        points.append(
            {
                "primitives": 20.0**level,
                "bytes": answer["scene_bytes"],
                "build_seconds": answer["build_seconds"],
            }
            | {n: rate(answer, n) for n in SETS}
        )
        bench.results.note(
            f"Menger {level}",
            f"{20.0**level:.1e} primitives: {size(answer['scene_bytes'])}, built in {answer['build_seconds']:.3f} s, {rate(answer, 'coherent'):.2f} and {rate(answer, 'random'):.2f} Mray/s",
        )
    bench.results.curves["growth"] = points
