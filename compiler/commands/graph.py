"""Draw a scene's cyclic object-instancing graph: S, C, T, + and P nodes, with its cycles.

S is a Selection, C a Calculation, T a Transformation, + a union, P a primitive and X a texture; guards stand
on the edges, and edges that close a cycle are led around in colour. A .dot file is text for Graphviz."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..reading.diagnostics import PlsysError
from .common import add_scene_arguments, build_scene, print_json

SUMMARY = "draw the cyclic object-instancing graph (.svg, .dot)"
FORMATS = (".svg", ".dot")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scene_arguments(parser)
    parser.add_argument("-o", dest="output", metavar="OUT.{svg,dot}", required=True, help="the file to write")


def run(arguments: argparse.Namespace) -> int:
    from ..export.drawing import diagram, dot
    from ..export.files import whole_file

    suffix = Path(arguments.output).suffix.lower()
    if suffix not in FORMATS:
        raise PlsysError(f"don't know the format '{suffix}'; known: {', '.join(FORMATS)}", arguments.output)
    picture = diagram(build_scene(arguments).graph)
    name = Path(arguments.scene).stem
    if suffix == ".svg":
        from ..export.svg import svg

        text = svg(picture, name)
    else:
        text = dot(picture, name)
    with whole_file(arguments.output) as file:
        file.write(text)
    if arguments.json:
        letters = [node.letter or "object" for node in picture.nodes]
        print_json(
            {
                "scene": arguments.scene,
                "output": arguments.output,
                "nodes": {letter: letters.count(letter) for letter in sorted(set(letters))},
                "edges": len(picture.edges),
                "cycles": sum(edge.is_back for edge in picture.edges),
            }
        )
    return 0
