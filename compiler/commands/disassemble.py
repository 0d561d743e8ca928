"""Show bytecode as text: one line a node, with its fields and code.

`plsys-rt --dump` prints the same text.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ..reading.diagnostics import PlsysError
from .common import add_input_arguments, build_scene, print_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="a .plsys file, or bytecode (.plsb)")
    add_input_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    from ..bytecode.disassemble import disassemble

    data = read_bytecode(arguments.scene) if arguments.scene.endswith(".plsb") else build_scene(arguments).encode()
    text = disassemble(data)
    if arguments.json:
        print_json({"scene": arguments.scene, "bytes": len(data), "text": text})
    else:
        print(text, end="")
    return 0


def read_bytecode(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise PlsysError(f"can't be read: {error.strerror}", path) from None
