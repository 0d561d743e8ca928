"""Write the unfolded scene for another program: POV-Ray (.pov) or a mesh (.obj with .mtl).

What a format can't carry is listed in the file and on the terminal.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..reading.diagnostics import PlsysError
from .common import add_scene_arguments, build_scene, json_integer, print_json

FORMATS = (".pov", ".obj")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scene_arguments(parser)
    parser.add_argument("-o", dest="output", metavar="OUT.{pov,obj}", required=True, help="the file to write")
    parser.add_argument(
        "--tolerance",
        type=float,
        default=None,
        metavar="UNITS",
        help="meshes: how far a facet may lie from the surface, in scene units (default: 1/1000 of the scene's size)",
    )


def run(arguments: argparse.Namespace) -> int:
    suffix = Path(arguments.output).suffix.lower()
    if suffix not in FORMATS:
        raise PlsysError(f"don't know the format '{suffix}'; known: {', '.join(FORMATS)}", arguments.output)
    if arguments.tolerance is not None and suffix != ".obj":
        raise PlsysError("the tolerance of meshes; POV-Ray gets the shapes as they are", "--tolerance")
    compilation = build_scene(arguments)
    if suffix == ".pov":
        from ..export.povray import export_povray

        result = export_povray(compilation.graph, arguments.output)
    else:
        from ..export.mesh import export_mesh

        result = export_mesh(compilation.graph, arguments.output, tolerance=arguments.tolerance)
    for line in result.lost:
        print(f"{arguments.output}: not carried: {line}", file=sys.stderr)
    facts = {
        "scene": arguments.scene,
        "output": arguments.output,
        "primitives": json_integer(result.primitives),
        "lost": list(result.lost),
    }
    if suffix == ".obj":
        facts |= {"tolerance": result.tolerance, "error": result.error, "triangles": result.triangles}
        if not arguments.json:
            print(
                f"{arguments.output}: {result.triangles:,} triangles, at most {result.error:.3g} units from the "
                f"surfaces (tolerance {result.tolerance:.3g})"
            )
    if arguments.json:
        print_json(facts)
    return 0
