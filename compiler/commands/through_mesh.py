"""``compare --through obj``: a scene, through a mesh file and back.

The file is read with trimesh, its volume and bounds are checked against closed forms of the exact scene, and
it is drawn beside the scene itself; what the file can't carry (planes, camera, lights) is taken from the
scene."""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from .common import build_scene


def run(arguments: argparse.Namespace) -> int:
    """Exit code 1 unless volume, bounds and watertightness are as promised; the pictures only show where
    facets do."""
    import numpy as np

    from ..bytecode.encode import encode
    from ..export.mesh import agrees, export_mesh, read_back
    from ..export.mesh_scene import mesh_graph
    from ..export.povray_run import peak_rss
    from .comparison import render_ours, report
    from .differences import clipped, edges, statistics

    started = time.perf_counter()
    compilation = build_scene(arguments)
    image, _, scene = render_ours(compilation.encode(), arguments)
    scene.close()
    ours_seconds = time.perf_counter() - started
    ours_rss = peak_rss()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / (Path(arguments.scene).stem + ".obj")
        exported = export_mesh(compilation.graph, path, tolerance=arguments.tolerance)
        read = read_back(path)
    back, _, scene = render_ours(encode(mesh_graph(compilation.graph, exported, read)), arguments)
    scene.close()
    ours, theirs = clipped(image["color"]), clipped(back["color"])
    width, height = arguments.size
    facts = {"scene": arguments.scene, "through": "obj", "width": width, "height": height}
    facts |= statistics(ours, theirs, edges(image))
    facts |= {
        "ours_seconds": round(ours_seconds, 4),
        "ours_rss": ours_rss,
        "mesh": {
            "triangles": read.triangles,
            "tolerance": exported.tolerance,
            "error": exported.error,
            "watertight": read.watertight,
            "volume": read.volume,
            "facets_volume": exported.mesh_volume,
            "exact_volume": exported.volume,
            "bounds": [read.low.tolist(), read.high.tolist()],
            "exact_bounds": [exported.low.tolist(), exported.high.tolist()],
            "bounds_error": float(np.abs([read.low - exported.low, read.high - exported.high]).max()),
        },
        "lost": exported.lost,
        "passed": agrees(exported, read),
    }
    return report(facts, ours, theirs, arguments)
