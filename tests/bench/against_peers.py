"""The rows of the bench's table that compare plsys with Embree, POV-Ray and Mitsuba; targets stand beside the measurement."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import peer_mitsuba as mitsuba
import peers
from common import ALL, SETS, Bench, against_embree, curves_of, median, pixels_traced, rate, same_hits
from peers import ours, plsys
from prepare import (
    CURVES,
    QUADS,
    TRIANGLES,
    Case,
    box_quads,
    split_forest,
    split_tree,
    triangles_of,
    write_embree,
)
from report import size


def start(bench: Bench) -> None:
    """A scene of one sphere: what a process costs by itself."""
    text = "camera { location <0, 0, -5> look_at 0 }\nlight_source { <9, 9, -9> color rgb 1 }\nsphere { 0, 1 pigment { color rgb 1 } }\n"
    case = Case("one sphere", "sphere", {}, bench.folder, text)
    runs = [plsys("render", case.path, "-o", case.folder / "ours.png") for _ in range(3 * bench.rounds)]
    bench.results.row("one sphere", "plsys render, wall", [r.wall for r in runs], 0.25, " s", at_most=True)
    bench.results.row(
        "one sphere", "plsys render, peak", median([r.rss for r in runs]) / 1e6, 60, " MB", at_most=True
    )
    tool = shutil.which("plsys-rt") or shutil.which("plsys-rt", path=str(Path(sys.executable).parent))
    if not tool:
        peers.MISSING["plsys-rt"] = "it isn't installed; run by `make bench`"
        return
    plsys("compile", case.path, "-o", case.folder / "sphere.plsb")
    runs = [
        peers.run([tool, case.folder / "sphere.plsb", "-o", case.folder / "o.pfm", "--size", "1x1"])
        for _ in range(3 * bench.rounds)
    ]
    bench.results.row(
        "one sphere", "plsys-rt of one pixel, wall", [1e3 * r.wall for r in runs], 10, " ms", at_most=True
    )


def figure(bench: Bench) -> None:
    """Figure 2.1's tree, order 10."""
    case = Case("Fig 2.1", "tree", {"order": 10}, bench.folder)
    scene = write_embree(case.folder / "flat.bin", [(CURVES, curves_of(case))], [])
    pure = against_embree(bench, case, scene, {}, {}, "of Embree single rays")
    flat = against_embree(
        bench,
        case,
        scene,
        {"front_items": ALL},
        {"coherent": 2.5, "random": 1.5},
        "flattened, of Embree single rays",
    )
    if pure and flat:
        default = ours(case, options={"front_items": 64})
        bench.results.row(
            case.name, "memory with fronts of 64 items", default["scene_bytes"] / 1e3, 40, " KB", at_most=True
        )
        bench.results.row(
            case.name,
            "memory, flattened",
            flat[0]["scene_bytes"] / 1e6,
            0.25,
            " MB",
            at_most=True,
            theirs=size(flat[1]["bytes"]),
        )
        same_hits(bench, case, flat[1])
    drawn = [(pixels_traced(case), peers.povray(case, case.folder)) for _ in range(bench.rounds)]
    if drawn[0][1]:
        bench.results.row(
            case.name, "POV-Ray's trace : ours, 640x480", [t["trace"] / o["seconds"]["trace"] for o, t in drawn], 4,
            ours=f"{drawn[-1][0]['seconds']['trace']:.3f} s", theirs=f"{drawn[-1][1]['trace']:.3f} s",
        )  # fmt: skip


def order20(bench: Bench) -> None:
    """DESIGN's tree of order 20: 2,097,153 cylinders."""
    case = Case("order 20", "tree", {"order": 20}, bench.folder)
    scene = write_embree(case.folder / "flat.bin", [(CURVES, curves_of(case))], [])
    last = against_embree(
        bench, case, scene, {}, {"coherent": 1.0, "random": 2.0}, "of Embree flat, single rays"
    )
    if last:
        bench.results.row(
            case.name,
            "memory",
            last[0]["scene_bytes"] / 1e6,
            1,
            " MB",
            at_most=True,
            theirs=size(last[1]["bytes"]),
        )
        bench.results.row(
            case.name,
            "memory, of Embree's",
            100 * last[0]["scene_bytes"] / last[1]["bytes"],
            0.5,
            " %",
            at_most=True,
        )
        same_hits(bench, case, last[1])
    boxes, bvh = ours(case, options={"accelerator": "boxes"}, repeats=1), ours(case)
    for name in SETS:
        bench.results.row(
            case.name, f"{name}: bvh of the paper's boxes", rate(bvh, name) / rate(boxes, name), 30 if name == "coherent" else None,
            ours=f"{rate(bvh, name):.2f} Mray/s", theirs=f"{rate(boxes, name):.4f}",
        )  # fmt: skip
    mine = [pixels_traced(case) for _ in range(bench.rounds)]
    whole = [
        plsys("render", case.path, "-D", "order=20", "-o", case.folder / "ours.png")
        for _ in range(bench.rounds)
    ]
    if bench.quick:
        return bench.results.note(case.name, "POV-Ray is left out: it reads the scene for half a minute")
    theirs = peers.povray(case, case.folder, threads=None)
    if theirs:
        bench.results.row(
            case.name, "POV-Ray's whole process : ours, 640x480", [theirs["wall"] / r.wall for r in whole], 50,
            ours=f"{median([r.wall for r in whole]):.2f} s, {size(whole[0].rss)}", theirs=f"{theirs['wall']:.1f} s, {size(theirs['rss'])}",
        )  # fmt: skip
        bench.results.row(
            case.name, "POV-Ray's trace (CPU) : ours", [theirs["trace"] / m["seconds"]["trace"] for m in mine], 10,
            ours=f"{median([m['seconds']['trace'] for m in mine]):.2f} s", theirs=f"{theirs['trace']:.2f} s",
        )  # fmt: skip


def menger(bench: Bench) -> None:
    """Menger's sponge: level 4 against Embree; 6 and 10 in proportion to level 4."""
    case = Case("Menger 4", "menger", {"level": 4}, bench.folder)
    quads = box_quads(case.unfolded()[1])
    scene = write_embree(case.folder / "quads.bin", [(QUADS, quads)], [])
    last = against_embree(
        bench, case, scene, {}, {"coherent": 1.3, "random": 3.4}, "of Embree single rays, quads"
    )
    if last:
        bench.results.row(
            case.name,
            "memory",
            last[0]["scene_bytes"] / 1e6,
            0.35,
            " MB",
            at_most=True,
            theirs=size(last[1]["bytes"]),
        )
        same_hits(bench, case, last[1])
        for width in (8, 16):
            bench.results.row(
                case.name, f"coherent: of Embree's packets of {width}", rate(last[0], "coherent") / rate(last[1], "coherent", f"packets{width}"),
                1.0 if width == 8 else None, theirs=f"{rate(last[1], 'coherent', f'packets{width}'):.2f} Mray/s",
            )  # fmt: skip
    if not bench.quick:
        triangles = write_embree(case.folder / "triangles.bin", [(TRIANGLES, triangles_of(quads))], [])
        against_embree(bench, case, triangles, {}, {}, "of Embree 3.13 triangles")
        against_embree(bench, case, triangles, {}, {}, "of Embree 3.13 triangles, compact", flags="c")
        against_embree(bench, case, triangles, {}, {}, "of Embree 3.13 triangles, robust", flags="r")
        against_embree(bench, case, triangles, {}, {}, "of embreex 4.4 triangles", "4.4")
    four = ours(case)
    for level, most, proportions in ((6, 0.2, (3.6 / 8.8, 2.8 / 4.5)), (10, 0.3, (2.2 / 8.8, 1.4 / 4.5))):
        deep = Case(f"Menger {level}", "menger", {"level": level}, bench.folder)
        answers = [ours(deep) for _ in range(bench.rounds)]
        if "failed" in answers[0]:
            bench.results.note(deep.name, f"failed: {answers[0]['failed']}")
            continue
        bench.results.row(deep.name, "memory", answers[0]["scene_bytes"] / 1e6, most, " MB", at_most=True)
        for name, proportion in zip(SETS, proportions):
            bench.results.row(
                deep.name, f"{name}: of Menger 4's rate", [rate(a, name) / rate(four, name) for a in answers], round(proportion, 2),
                ours=f"{median([rate(a, name) for a in answers]):.2f} Mray/s",
            )  # fmt: skip


def forest(bench: Bench) -> None:
    """10,000 trees of 32 kinds against Embree with two levels of instances; then every tree unique."""
    case = Case("forest", "forest", {}, bench.folder)
    groups, instances = split_forest(case)
    scene = write_embree(case.folder / "two-level.bin", [(CURVES, g) for g in groups], instances)
    last = against_embree(
        bench, case, scene, {}, {"coherent": 1.6, "random": 1.6}, f"of Embree two-level, {len(groups)} kinds"
    )
    if last:
        bench.results.row(
            case.name,
            "memory",
            last[0]["scene_bytes"] / 1e6,
            4,
            " MB",
            at_most=True,
            theirs=size(last[1]["bytes"]),
        )
        bench.results.row(
            case.name,
            "memory, of Embree's",
            100 * last[0]["scene_bytes"] / last[1]["bytes"],
            12,
            " %",
            at_most=True,
        )
        same_hits(bench, case, last[1])
    unique(bench, case)


def unique(bench: Bench, shared: Case) -> None:
    """Every tree unique: 163,840,000 different cylinders."""
    case = Case("unique forest", "forest", {"unique": 1}, bench.folder)
    options = ["--detail", "1", "--memory", "200M"]
    try:
        mine = pixels_traced(case, *options)
    except RuntimeError as error:
        return bench.results.note(case.name, f"failed: {str(error).strip().splitlines()[-1][:160]}")
    with_all = pixels_traced(shared)
    bench.results.row(case.name, "render 640x480 at --detail 1, of the shared one's time", mine["wall"] / with_all["wall"], 4, at_most=True,
                      ours=f"{mine['wall']:.2f} s", theirs=f"{with_all['wall']:.2f} s")  # fmt: skip
    bench.results.row(case.name, "peak of the whole process", mine["rss"] / 1e6, 256, " MB", at_most=True)


def fern(bench: Bench) -> None:
    """Barnsley's fern, endless, cut off at one pixel: rays of pictures, since a cut-off needs pixels."""
    case = Case("endless fern", "fern_endless", {}, bench.folder)
    sponge = Case("Menger 4", "menger", {"level": 4}, bench.folder)
    pairs = [(pixels_traced(case, "--detail", "1"), pixels_traced(sponge)) for _ in range(bench.rounds)]
    speeds = [
        [1e-6 * sum(side["rays"].values()) / side["seconds"]["trace"] for side in pair] for pair in pairs
    ]
    bench.results.row(
        case.name, "memory", pairs[0][0]["memory"]["scene_bytes"] / 1e3, 50, " KB", at_most=True
    )
    bench.results.row(
        case.name,
        "rays of a picture at 1 px, of Menger 4's",
        [mine / other for mine, other in speeds],
        round(1.5 / 8.8, 2),
        ours=f"{median([mine for mine, _ in speeds]):.2f} Mray/s",
    )


def split_by_hand(bench: Bench) -> None:
    """Whole processes, source to picture: plsys against Mitsuba's best form."""
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
        scene = mitsuba.write_scene(case.folder / "mitsuba.xml", case, *form())
        parameters = [x for name, value in case.parameters.items() for x in ("-D", f"{name}={value}")]
        draw = lambda side: plsys(
            "render", case.path, "-o", case.folder / "ours.png", "--size", side, *parameters
        )  # noqa: E731
        mine, theirs = [], []
        try:
            for _ in range(bench.rounds):
                mine.append((draw("640x480"), draw("1280x960")))
                theirs.append((mitsuba.render(scene, 640, 480), mitsuba.render(scene, 1280, 960)))
        except RuntimeError as error:
            bench.results.note(case.name, f"failed: {error}")
            continue
        bench.results.row(
            case.name, "Mitsuba's wall : ours, whole process", [t[0].wall / m[0].wall for m, t in zip(mine, theirs)], 1.5,
            ours=f"{mine[0][0].wall:.2f} s", theirs=f"{theirs[0][0].wall:.2f} s",
        )  # fmt: skip
        bench.results.row(case.name, "peak, of Mitsuba's", mine[0][0].rss / theirs[0][0].rss, 0.5, at_most=True,
                          ours=size(mine[0][0].rss), theirs=size(theirs[0][0].rss))  # fmt: skip
        # What 921,600 more samples cost: start-up and scene drop out.
        samples = [
            [0.9216 / max(large.cpu - small.cpu, 1e-3) for small, large in side] for side in (mine, theirs)
        ]
        bench.results.row(
            case.name, "camera samples a CPU-second, of Mitsuba's", [m / t for m, t in zip(*samples)], 1.5,
            ours=f"{median(samples[0]):.2f} M", theirs=f"{median(samples[1]):.2f} M",
        )  # fmt: skip


def _forest_groups(case: Case):
    groups, instances = split_forest(case)
    return [mitsuba.Group("curves", g, True) for g in groups], instances


def _menger_groups(four: Case):
    matrices = four.unfolded()[1]
    return [mitsuba.Group("quads", box_quads(matrices), True)], [(0, m) for m in matrices]
