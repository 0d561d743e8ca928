"""Draw a scene here and in POV-Ray, and compare the pictures pixel by pixel.

POV-Ray 3.7 draws the exported scene in linear light, 16 bits, without antialiasing; plsys takes POV-Ray's
tolerances for hits and shadows. Every pixel that differs by more than 1e-5 is traced again in higher
precision, to say who is right: ours_wrong, theirs_wrong, or ambiguous (rounding alone decides: edges of
things, of shadows and of patterns).

With --through obj the scene goes through a mesh file instead: written, read back, its volume and bounds
checked against closed forms, and drawn.

Exit code 0: at most 1 pixel in 10,000 differs by more than 1e-5, none of them visibly and away from an edge,
and ours is never wrong. 1: otherwise. 2: no comparison is possible."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from .common import add_scene_arguments, build_scene, size

SUMMARY = "draw a scene here and in POV-Ray and compare the pictures"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scene_arguments(parser)
    parser.add_argument(
        "--size", type=size, default=(640, 480), metavar="WxH", help="in pixels (default 640x480)"
    )
    parser.add_argument(
        "-o", dest="output", metavar="OUT.png", help="ours, theirs and the difference, side by side"
    )
    parser.add_argument(
        "--amplify", type=float, default=None, metavar="F", help="factor of the difference picture"
    )
    parser.add_argument(
        "--through", choices=("obj",), help="compare with the scene's mesh export instead of POV-Ray"
    )
    parser.add_argument("--tolerance", type=float, metavar="UNITS", help="of the mesh, in scene units")
    parser.add_argument(
        "--accel", choices=("auto", "none", "boxes", "grid", "bvh"), default="auto", help="accelerator"
    )
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="default: one a core")


def run(arguments: argparse.Namespace) -> int:
    from .pictures import check_format

    if arguments.output:
        check_format(arguments.output)
    if arguments.through == "obj":
        from .through_mesh import run as run_through_mesh

        return run_through_mesh(arguments)
    from ..export.povray_run import find_povray, peak_rss
    from .comparison import render_ours, report

    find_povray()
    started = time.perf_counter()
    compilation = build_scene(arguments)
    image, rays_agree, scene = render_ours(compilation.encode(), arguments)
    ours_seconds = time.perf_counter() - started
    ours_rss = peak_rss()
    with scene:
        theirs = _povray(compilation.graph, arguments)
        facts, ours = _compare(compilation.graph, image, theirs.pixels, rays_agree, arguments)
    facts |= {
        "ours_seconds": round(ours_seconds, 4),
        "povray_seconds": round(theirs.seconds, 4),
        "ours_rss": ours_rss,
        "povray_rss": theirs.rss,
        "povray_epsilon": True,
    }
    return report(facts, ours, theirs.pixels, arguments)


def _povray(graph, arguments: argparse.Namespace):
    from ..export.povray import export_povray
    from ..export.povray_run import draw

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / (Path(arguments.scene).stem + ".pov")
        for line in export_povray(graph, path).lost:
            print(f"{arguments.scene}: not carried to POV-Ray: {line}", file=sys.stderr)
        return draw(path, *arguments.size)


def _compare(graph, image: dict, theirs, rays_agree, arguments: argparse.Namespace):
    """The facts of the JSON object, and our picture as it was compared."""
    import numpy as np

    from ..export.povray import values_of
    from ..export.retrace import Retracer
    from .differences import CLASSES, SAME, Camera, classify, clipped, edges, statistics

    ours, edge = clipped(image["color"]), edges(image)
    width, height = arguments.size
    facts = {"scene": arguments.scene, "width": width, "height": height} | statistics(ours, theirs, edge)
    differing = np.argwhere(np.abs(ours - theirs).max(axis=2) > SAME)
    found: list[dict] = []
    if len(differing):
        camera = Camera(values_of(graph.camera, "camera"), width, height)
        found = classify(differing, Retracer(graph), camera, rays_agree)
        for pixel in found:
            pixel["difference"] = float(np.abs(ours - theirs)[pixel["y"], pixel["x"]].max())
    facts["classes"] = {name: sum(pixel["class"] == name for pixel in found) for name in CLASSES}
    facts["differing"] = [pixel for pixel in found if pixel["class"] != "unclassified"]
    return facts, ours
