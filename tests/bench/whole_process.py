"""The rows of the bench's table about whole processes, from a scene's text to a picture: start-up, the forest of unique trees,
and Mitsuba, which users would pick instead."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import peer_mitsuba as mitsuba
import peers
from common import Bench, curves_of, median, pixels_traced
from peers import plsys
from prepare import Case, box_quads, split_forest, split_tree
from report import size
from turns import alone, ours

ONE_SPHERE = (
    "camera { location <0, 0, -5> look_at 0 }\nlight_source { <9, 9, -9> color rgb 1 }\n"
    "sphere { 0, 1 pigment { color rgb 1 } }\n"
)

# What the forest of unique trees may take, and the whole process at most.
UNIQUE_MEMORY, UNIQUE_PEAK = "200M", 256


def start(bench: Bench) -> None:
    """A scene of one sphere: what a process costs by itself."""
    case = Case("one sphere", "sphere", {}, bench.folder, ONE_SPHERE)
    runs = [plsys("render", case.path, "-o", case.folder / "ours.png") for _ in range(3 * bench.rounds)]
    bench.results.row("one sphere", "plsys render, wall", [r.wall for r in runs], 0.25, " s", at_most=True,
                      ours=f"{median([r.cpu for r in runs]):.3f} s of CPU time")  # fmt: skip
    bench.results.row(
        "one sphere", "plsys render, peak", median([r.rss for r in runs]) / 1e6, 60, " MB", at_most=True
    )
    tool = shutil.which("plsys-rt") or shutil.which("plsys-rt", path=str(Path(sys.executable).parent))
    if not tool:
        peers.MISSING["plsys-rt"] = "it isn't installed; run by `make bench`"
        return
    plsys("compile", case.path, "-o", case.folder / "sphere.plsb")
    runs = [
        peers.run([tool, case.folder / "sphere.plsb", "-o", case.folder / "o.pfm", "--size", "1x1"], pinned=False)
        for _ in range(3 * bench.rounds)
    ]
    bench.results.row(
        "one sphere", "plsys-rt of one pixel, wall", [1e3 * r.wall for r in runs], 10, " ms", at_most=True
    )


def unique(bench: Bench) -> None:
    """The forest with every tree unique: 163,840,000 different cylinders."""
    shared, case = (Case(n, "forest", p, bench.folder) for n, p in (("forest", {}), ("unique forest", {"unique": 1})))
    options = ["--detail", "1", "--memory", UNIQUE_MEMORY]
    mine, theirs, alike = [], [], []
    try:
        for _ in range(bench.rounds):
            mine.append(pixels_traced(case, *options))
            theirs.append(pixels_traced(shared))
            alike.append(pixels_traced(shared, "--detail", "1"))
    except RuntimeError as error:
        return bench.results.note(case.name, f"failed: {str(error).strip().splitlines()[-1][:160]}")
    bench.results.row(
        case.name, "render 640x480 at --detail 1, of the shared one's time", [a["cpu"] / b["cpu"] for a, b in zip(mine, theirs)], 4,
        at_most=True, ours=f"{mine[-1]['wall']:.2f} s", theirs=f"{theirs[-1]['wall']:.2f} s",
    )  # fmt: skip
    bench.results.row(
        case.name, "the same, of the shared one's time at --detail 1 too", [a["cpu"] / b["cpu"] for a, b in zip(mine, alike)], 4,
        at_most=True, ours=f"{mine[-1]['wall']:.2f} s", theirs=f"{alike[-1]['wall']:.2f} s",
    )  # fmt: skip
    peak = max(m["rss"] for m in mine)
    bench.results.row(case.name, "peak of the whole process", peak / 1e6, UNIQUE_PEAK, " MB", at_most=True)
    sphere = Case("one sphere", "sphere", {}, bench.folder, ONE_SPHERE)
    beside = pixels_traced(sphere)["rss"]
    bench.results.row(
        case.name, "peak less a process without scene, of --memory", (peak - beside) / 200 / 2**20, 1.1, at_most=True, ours=size(peak - beside)
    )  # fmt: skip
    for what, detail, picture in (("at --detail 1", 1.0, [640, 480]), ("without cut-off", 0.0, [160, 120])):
        if bench.quick and not detail:
            continue
        options = {"detail": detail, "memory": 200 * 2**20}
        answer = alone(ours(case, sets=False, options=options, pictures=2, size=picture))
        cold, warm = answer["pictures"]
        lazy = answer["lazy"]
        bench.results.note(
            case.name,
            f"{what}, {picture[0]}x{picture[1]}: cold {cold:.2f} s, warm {warm:.2f} s; {lazy['unfolded']:,} states unfolded, "
            f"{lazy['evicted']:,} of them thrown out again, {lazy['found']:,} times found; peak {size(answer['process_rss'])}",
        )


def beyond_mitsuba(bench: Bench) -> None:
    """What Mitsuba can't hold: 10^13 cubes, and 10,000 trees that are all different."""
    for case, options in (
        (Case("Menger 10", "menger", {"level": 10}, bench.folder), ("--detail", "1")),
        (Case("unique forest", "forest", {"unique": 1}, bench.folder), ("--detail", "1", "--memory", UNIQUE_MEMORY)),
    ):
        parameters = [x for name, value in case.parameters.items() for x in ("-D", f"{name}={value}")]
        try:
            runs = [plsys("render", case.path, "-o", case.folder / "ours.png", *parameters, *options) for _ in range(bench.rounds)]
        except RuntimeError as error:
            bench.results.note(case.name, f"failed: {str(error).strip().splitlines()[-1][:160]}")
            continue
        bench.results.row(case.name, "whole process, which Mitsuba can't hold: wall", [r.wall for r in runs], None, " s", ours=size(runs[0].rss))


def split_by_hand(bench: Bench) -> None:
    """Whole processes, source to picture: plsys against Mitsuba's best form."""
    beyond_mitsuba(bench)
    if not mitsuba.program():
        return
    ten = Case("order 10", "tree", {"order": 10}, bench.folder)
    twenty = Case("order 20", "tree", {"order": 20}, bench.folder)
    woods = Case("forest", "forest", {}, bench.folder)
    eight, four = (Case(f"Menger {n}", "menger", {"level": n}, bench.folder) for n in (8, 4))
    lower, upper, places = split_tree(twenty)
    forms = [
        (ten, lambda: ([mitsuba.Group("curves", curves_of(ten))], [])),
        (
            twenty,
            lambda: (
                [mitsuba.Group("curves", lower), mitsuba.Group("curves", upper, True)],
                [(1, p) for p in places],
            ),
        ),
        (woods, lambda: _forest_groups(woods)),
        (eight, lambda: _menger_groups(four)),
    ]
    for case, form in forms:
        if bench.quick and case is eight:
            continue
        # Reading Menger 8 takes Mitsuba as long as twelve million samples do, so it draws as many.
        small, large = (640, 480), (3840, 2880) if case is eight else (1280, 960)
        scene = mitsuba.write_scene(case.folder / "mitsuba.xml", case, *form())
        parameters = [x for name, value in case.parameters.items() for x in ("-D", f"{name}={value}")]
        mine, theirs = [], []
        try:
            for _ in range(bench.rounds):
                mine.append([_draw(case, pixels, *parameters) for pixels in (small, large)])
                theirs.append([mitsuba.render(scene, *pixels) for pixels in (small, large)])
        except RuntimeError as error:
            bench.results.note(case.name, f"failed: {error}")
            continue
        bench.results.row(
            case.name, "Mitsuba's wall : ours, whole process", [t[0].wall / m[0].wall for m, t in zip(mine, theirs)], 1.5,
            ours=f"{mine[0][0].wall:.2f} s", theirs=f"{theirs[0][0].wall:.2f} s",
        )  # fmt: skip
        bench.results.row(case.name, "peak, of Mitsuba's", mine[0][0].rss / theirs[0][0].rss, 0.5, at_most=True,
                          ours=size(mine[0][0].rss), theirs=size(theirs[0][0].rss))  # fmt: skip
        # What the large picture's further samples cost: start-up and scene, the least time for them, drop out.
        more = (large[0] * large[1] - small[0] * small[1]) / 1e6
        starts = [min(a.cpu for a, _ in side) for side in (mine, theirs)]
        samples = [[more / max(b.cpu - start, 1e-3) for _, b in side] for start, side in zip(starts, (mine, theirs))]
        bench.results.row(
            case.name, "camera samples a CPU-second, of Mitsuba's", [m / t for m, t in zip(*samples)], 1.5,
            ours=f"{median(samples[0]):.2f} M", theirs=f"{median(samples[1]):.2f} M",
        )  # fmt: skip


def _draw(case: Case, pixels: tuple[int, int], *options) -> peers.Run:
    """The whole process of `plsys render`, on all cores."""
    return plsys("render", case.path, "-o", case.folder / "ours.png", "--size", "{}x{}".format(*pixels), *options)


def _forest_groups(case: Case):
    groups, instances = split_forest(case)
    return [mitsuba.Group("curves", g, True) for g in groups], instances


def _menger_groups(four: Case):
    matrices = four.unfolded()[1]
    return [mitsuba.Group("quads", box_quads(matrices), True)], [(0, m) for m in matrices]
