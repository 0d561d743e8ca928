"""What the bench measures of plsys alone: the paper's accelerators against each other, threads, the dial of fronts, growth."""

from __future__ import annotations

import os

from common import ALL, SETS, Bench, rate, ratios
from prepare import Case
from report import size
from turns import alone, at_once, ours, take_turns


def scatter(bench: Bench) -> None:
    """The paper's 2.3: its grid over its boxes, on spheres scattered by translations."""
    case = Case("scatter", "scatter", {}, bench.folder)
    others = {
        "grid 16x16x8 of boxes (paper: 2.3)": ours(case, options={"accelerator": "grid", "grid": (16, 16, 8)}),
        "grid 64x64x4 of boxes": ours(case, options={"accelerator": "grid", "grid": (64, 64, 4)}),
        "bvh of boxes": ours(case),
    }
    boxes, *answers = take_turns([ours(case, options={"accelerator": "boxes"}), *others.values()], bench.rounds)
    for what, answer in zip(others, answers):
        for name in SETS:
            bench.results.row(
                case.name, f"{name}: {what}", ratios(answer, boxes, name),
                ours=f"{rate(answer, name):.4f} Mray/s, {size(answer['scene_bytes'])}", theirs=f"{rate(boxes, name):.4f}, {size(boxes['scene_bytes'])}",
            )  # fmt: skip


def threads(bench: Bench) -> None:
    """Two threads against one, on all cores; and two processes, which share nothing: what the machine itself gives."""
    cores = len(os.sched_getaffinity(0))
    for name, scene, parameters in (
        ("order 20", "tree", {"order": 20}),
        ("Menger 6", "menger", {"level": 6}),
    ):
        case = Case(name, scene, parameters, bench.folder)
        programs = [
            ours(case, pinned=False, threads=count, wall=True) for count in range(1, cores + 1)
        ]
        # Not by turns: of a process that has waited, the second thread gets its core late (1.35 instead of 1.65).
        answers = [alone(program, 7) for program in programs]
        bench.results.curves[f"threads: {name}"] = [
            {"threads": count, "rate": rate(answer, "coherent")} for count, answer in enumerate(answers, 1)
        ]
        if cores > 1:
            bench.results.row(name, "2 threads of 1", ratios(answers[1], answers[0], "coherent"), 1.9)
            pair = zip(*(answer["sets"]["coherent"]["rates"] for answer in at_once(programs[0], 2, 7)))
            one = rate(answers[0], "coherent")
            bench.results.row(name, "2 processes with a thread each, of 1", [sum(rates) / one for rates in pair])


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
            answer = alone(ours(case, options={"front_items": items}))
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
        answer = alone(ours(Case(f"Menger {level}", "menger", {"level": level}, bench.folder)), 1)
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
