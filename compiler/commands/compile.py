"""Compile a scene to bytecode.

The .plsb file is all that the renderer needs: `plsys render scene.plsb` and the stand-alone `plsys-rt` read it.
"""

from __future__ import annotations

import argparse

from ..export.files import written_whole
from .common import add_scene_arguments, build_scene, print_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scene_arguments(parser)
    parser.add_argument("-o", dest="output", metavar="OUT.plsb", required=True, help="the file to write")
    parser.add_argument("--no-sourcemap", action="store_true", help="leave out the places in the source (smaller)")


def run(arguments: argparse.Namespace) -> int:
    compilation = build_scene(arguments)
    data = compilation.encode(sourcemap=not arguments.no_sourcemap)
    with written_whole(arguments.output) as temporary:
        temporary.write_bytes(data)
    if arguments.json:
        print_json(
            {
                "scene": arguments.scene,
                "output": arguments.output,
                "bytes": len(data),
                "left_out": [{"what": row.what, "why": row.why} for row in compilation.graph.left_out],
            }
        )
    return 0
