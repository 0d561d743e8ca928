"""The rows of the bench's table that compare rates of rays with Embree's and POV-Ray's; targets stand beside the measurement."""

from __future__ import annotations

import peers
from common import (
    ALL,
    SETS,
    Bench,
    against_embree,
    curves_of,
    median,
    pixels_traced,
    rate,
    ratios,
    rays_of_a_picture,
    same_hits,
)
from peers import plsys
from prepare import (
    CURVES,
    QUADS,
    TRIANGLES,
    Case,
    box_quads,
    split_forest,
    triangles_of,
    write_embree,
)
from report import size
from turns import alone, ours, take_turns


def figure(bench: Bench) -> None:
    """Figure 2.1's tree, order 10."""
    case = Case("Fig 2.1", "tree", {"order": 10}, bench.folder)
    scene = write_embree(case.folder / "flat.bin", [(CURVES, curves_of(case))], [])
    pure = against_embree(bench, case, scene, "of Embree single rays")
    flattened = {"front_items": ALL}
    flat = against_embree(
        bench, case, scene, "flattened, of Embree single rays", {"coherent": 2.5, "random": 1.5}, flattened
    )
    if pure and flat:
        default = alone(ours(case, sets=False, options={"front_items": 64}))
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
            case.name, "POV-Ray's trace : ours, 640x480, CPU", [t["trace"] / o["seconds"]["trace_cpu"] for o, t in drawn], 4,
            ours=f"{drawn[-1][0]['seconds']['trace_cpu']:.3f} s", theirs=f"{drawn[-1][1]['trace']:.3f} s",
        )  # fmt: skip


def memory(bench: Bench, case: Case, last: tuple[dict, dict], megabytes: float, percent: float) -> None:
    """Rows of what the scene's structures take, and of their share of Embree's; ``last`` is a round's two answers."""
    ours, theirs = last[0]["scene_bytes"], last[1]["bytes"]
    bench.results.row(case.name, "memory", ours / 1e6, megabytes, " MB", at_most=True, theirs=size(theirs))
    bench.results.row(case.name, "memory, of Embree's", 100 * ours / theirs, percent, " %", at_most=True)


def order20(bench: Bench) -> None:
    """DESIGN's tree of order 20: 2,097,153 cylinders."""
    case = Case("order 20", "tree", {"order": 20}, bench.folder)
    scene = write_embree(case.folder / "flat.bin", [(CURVES, curves_of(case))], [])
    last = against_embree(
        bench, case, scene, "of Embree flat, single rays", {"coherent": 1.0, "random": 2.0}
    )
    if last:
        memory(bench, case, last, 1, 0.5)
        same_hits(bench, case, last[1])
    sixteen = Case("order 16", "tree", {"order": 16}, bench.folder)
    flat = [alone(ours(sixteen, sets=False, options={"front_items": ALL})) for _ in range(bench.rounds)]
    bench.results.row(
        sixteen.name, "building, a primitive that is flattened", [1e6 * f["build_seconds"] / f["primitives"] for f in flat], 0.6, " µs",
        at_most=True, ours=f"{flat[0]['primitives']:,} of them",
    )  # fmt: skip
    bvh, boxes = take_turns([ours(case), ours(case, options={"accelerator": "boxes"})], 1)
    for name in SETS:
        bench.results.row(
            case.name, f"{name}: bvh of the paper's boxes", ratios(bvh, boxes, name), 30 if name == "coherent" else None,
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
            case.name, "POV-Ray's trace (CPU) : ours", [theirs["trace"] / m["seconds"]["trace_cpu"] for m in mine], 10,
            ours=f"{median([m['seconds']['trace_cpu'] for m in mine]):.2f} s", theirs=f"{theirs['trace']:.2f} s",
        )  # fmt: skip


def menger(bench: Bench) -> None:
    """Menger's sponge: level 4 against Embree; 6 and 10 in proportion to level 4."""
    case = Case("Menger 4", "menger", {"level": 4}, bench.folder)
    quads = box_quads(case.unfolded()[1])
    scene = write_embree(case.folder / "quads.bin", [(QUADS, quads)], [])
    last = against_embree(
        bench, case, scene, "of Embree single rays, quads", {"coherent": 1.3, "random": 3.4}
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
                case.name, f"coherent: of Embree's packets of {width}", ratios(*last, "coherent", f"packets{width}"),
                1.0 if width == 8 else None, theirs=f"{rate(last[1], 'coherent', f'packets{width}'):.2f} Mray/s",
            )  # fmt: skip
    if not bench.quick:
        triangles = write_embree(case.folder / "triangles.bin", [(TRIANGLES, triangles_of(quads))], [])
        against_embree(bench, case, triangles, "of Embree 3.13 triangles")
        against_embree(bench, case, triangles, "of Embree 3.13 triangles, compact", flags="c")
        against_embree(bench, case, triangles, "of Embree 3.13 triangles, robust", flags="r")
        against_embree(bench, case, triangles, "of embreex 4.4 triangles", version="4.4")
    for level, most, proportions in ((6, 0.2, (3.6 / 8.8, 2.8 / 4.5)), (10, 0.3, (None, 1.4 / 4.5))):
        deep = Case(f"Menger {level}", "menger", {"level": level}, bench.folder)
        pairs = [take_turns([ours(deep), ours(case)], bench.turns) for _ in range(bench.rounds)]
        bench.results.row(deep.name, "memory", pairs[0][0]["scene_bytes"] / 1e6, most, " MB", at_most=True)
        for name, proportion in zip(SETS, proportions):
            bench.results.row(
                deep.name, f"{name}: of Menger 4's rate", sum((ratios(*pair, name) for pair in pairs), []), proportion and round(proportion, 2),
                ours=f"{median([rate(m, name) for m, _ in pairs]):.2f} Mray/s", theirs=f"{median([rate(f, name) for _, f in pairs]):.2f}",
            )  # fmt: skip
    pairs = [(pixels_traced(deep, "--detail", "1"), pixels_traced(case)) for _ in range(bench.rounds)]
    bench.results.row(
        deep.name, "rays of a picture at 1 px, of Menger 4's", [rays_of_a_picture(m) / rays_of_a_picture(o) for m, o in pairs], round(2.2 / 8.8, 2),
        ours=f"{rays_of_a_picture(pairs[-1][0]):.2f} Mray/s", theirs=f"{rays_of_a_picture(pairs[-1][1]):.2f}",
    )  # fmt: skip


def residency(bench: Bench) -> None:
    """Embree's flat scene as it grows beyond the caches, where ours stays: Menger 3 to 5, trees of order 14 to 22."""
    if bench.quick:
        return bench.results.note("residency", "left out: the largest flat scenes take Embree minutes and gigabytes")
    beyond = {"coherent": 1.1, "random": 3.0}
    for name, scene, parameter, values, kind, flat in (
        ("Menger", "menger", "level", (3, 4, 5), QUADS, lambda case: box_quads(case.unfolded()[1])),
        ("order", "tree", "order", (14, 16, 18, 20, 22), CURVES, curves_of),
    ):
        points = []
        for value in values:
            case = Case(f"{name} {value}", scene, {parameter: value}, bench.folder)
            path = write_embree(case.folder / "flat.bin", [(kind, flat(case))], [])
            last = against_embree(
                bench, case, path, "of Embree flat, by size of scene", beyond if case.name == "Menger 5" else {}
            )
            path.unlink()
            if last:
                points.append(
                    {"bytes": last[0]["scene_bytes"], "embree_bytes": last[1]["bytes"]}
                    | {n: median(ratios(*last, n, "single")) for n in SETS}
                )
        bench.results.curves[f"residency: {name}"] = points


def forest(bench: Bench) -> None:
    """10,000 trees of 32 kinds against Embree with two levels of instances."""
    case = Case("forest", "forest", {}, bench.folder)
    groups, instances = split_forest(case)
    scene = write_embree(case.folder / "two-level.bin", [(CURVES, g) for g in groups], instances)
    last = against_embree(
        bench, case, scene, f"of Embree two-level, {len(groups)} kinds", {"coherent": 1.6, "random": 1.6}
    )
    if last:
        memory(bench, case, last, 4, 12)
        same_hits(bench, case, last[1])


def terrain(bench: Bench) -> None:
    """Midpoint displacement: 2,097,152 different triangles, against Embree on the same ones."""
    case = Case("terrain", "terrain", {"level": 10}, bench.folder)
    scene = write_embree(case.folder / "triangles.bin", [(TRIANGLES, case.triangles())], [])
    last = against_embree(
        bench, case, scene, "of Embree triangles, single rays", {"coherent": 1.0, "random": 1.0}
    )
    if not last:
        return
    bench.results.row(
        case.name, "memory, of Embree's", 100 * last[0]["scene_bytes"] / last[1]["bytes"], 25, " %", at_most=True,
        ours=size(last[0]["scene_bytes"]), theirs=size(last[1]["bytes"]),
    )  # fmt: skip
    bench.results.note(
        case.name, f"{last[0]['primitives']:,} triangles built in {last[0]['build_seconds']:.2f} s, Embree's in {last[1]['build_seconds']:.2f} s"
    )
    same_hits(bench, case, last[1])


def fern(bench: Bench) -> None:
    """Barnsley's fern, endless, cut off at one pixel: rays of pictures, since a cut-off needs pixels."""
    case = Case("endless fern", "fern_endless", {}, bench.folder)
    sponge = Case("Menger 4", "menger", {"level": 4}, bench.folder)
    pairs = [(pixels_traced(case, "--detail", "1"), pixels_traced(sponge)) for _ in range(bench.rounds)]
    speeds = [[rays_of_a_picture(side) for side in pair] for pair in pairs]
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
