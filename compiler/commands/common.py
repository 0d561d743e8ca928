"""What the commands share: arguments that several take, reading a scene, and how an error is told.

A command's ``run`` raises; :func:`report_errors` prints the message (and, with ``--json``, one object
``{"error": {"place", "reason"}, "diagnostics": […]}``) and gives the exit code.
"""

from __future__ import annotations

import argparse
import codecs
import os
import re
import sys
from typing import BinaryIO, Callable

from ..reading.diagnostics import Diagnostic, PlsysError, SceneError, excerpt_at, render


def add_scene_arguments(parser: argparse.ArgumentParser, scene_help: str = "a .plsys file") -> None:
    parser.add_argument("scene", metavar="SCENE", help=scene_help)
    add_input_arguments(parser)


def add_input_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-D",
        dest="parameters",
        metavar="NAME=VALUE",
        type=parameter,
        action=SetParameter,
        default={},
        help="set a Parameter of the scene; may be given several times",
    )
    parser.add_argument("--seed", type=seed, help="set the random seed instead of global_settings' seed")


class SetParameter(argparse.Action):
    """Collects parameters by name. Each is set once: of two values one would be ignored."""

    def __call__(self, parser, namespace, value, option_string=None) -> None:
        name, number = value
        before = getattr(namespace, self.dest)
        if before.get(name, number) != number:
            raise argparse.ArgumentError(self, f"'{name}' is set to {before[name]:g} and to {number:g}")
        setattr(namespace, self.dest, before | {name: number})


def seed(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' isn't a whole number") from None


def parameter(text: str) -> tuple[str, float]:
    """``order=12`` → ``("order", 12.0)``"""
    name, equals, value = text.partition("=")
    try:
        if not equals or not name:
            raise ValueError
        return name, float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' isn't NAME=NUMBER, such as order=12") from None


def size(text: str) -> tuple[int, int]:
    """``640x480`` → ``(640, 480)``"""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
        if not (1 <= width <= 65536 and 1 <= height <= 65536):
            raise ValueError
        return width, height
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' isn't WIDTHxHEIGHT, such as 640x480 (1 to 65536 each)") from None


def build_scene(arguments: argparse.Namespace):
    """The compilation of ``arguments.scene``; its warnings are printed. Raises SceneError, PlsysError."""
    from ..pipeline import build

    compilation = build(read_source(arguments.scene), parameters=arguments.parameters, seed=arguments.seed)
    show_diagnostics(d for d in compilation.diagnostics if d.severity == "warning")
    return compilation


def read_source(path: str, stream: BinaryIO | None = None):
    """The Source at ``path``, or of what a stream holds; PlsysError where it can't be read, or isn't a scene's text."""
    from ..reading.source import Source

    try:
        source = Source.read(path) if stream is None else Source(path, stream.read())
    except OSError as error:
        raise PlsysError(f"can't be read: {error.strerror}", path) from None
    if source.data.startswith(b"PLSB"):
        raise PlsysError("is bytecode, which render and disassemble read; this takes the scene's text", path)
    if b"\0" in source.data[:1024] and not _is_utf8(source.data[:1024]):
        raise PlsysError("isn't text in UTF-8; a scene is", path)
    return source


def show_diagnostics(diagnostics) -> None:
    for diagnostic in diagnostics:
        print(render(diagnostic), file=sys.stderr)


def print_json(value: object) -> None:
    import json

    print(json.dumps(value, indent=2, allow_nan=False))


def json_integer(value: int | None) -> int | str | None:
    """Integers above 2⁵³ as decimal strings: JSON readers that use doubles would lose digits."""
    return str(value) if value is not None and value > 2**53 else value


def report_errors(arguments: argparse.Namespace, run: Callable[[], int]) -> int:
    """Run a command; errors that users cause are told in one message, exit code 2."""
    try:
        return run()
    except SceneError as error:
        show_diagnostics(d for d in error.diagnostics if d.severity != "info")
        _print_json_error(arguments, error.place, error.reason, error.diagnostics)
    except PlsysError as error:
        _print_error(arguments, error.place, error.reason)
    except KeyboardInterrupt:
        print("plsys: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except RecursionError:
        _print_error(arguments, "", "the scene is nested too deeply")
    except MemoryError:
        _print_error(arguments, "", "there isn't enough memory")
    except Exception as error:
        # The runtime's errors are a family of their own: it knows nothing of the compiler.
        if not (hasattr(error, "place") and hasattr(error, "reason")):
            raise
        _print_runtime_error(arguments, error.place, error.reason)
    return 2


def _print_error(arguments: argparse.Namespace, place: str, reason: str) -> None:
    place = place or getattr(arguments, "scene", "plsys")
    print(f"{place}: error: {reason}", file=sys.stderr)
    _print_json_error(arguments, place, reason, ())


def _print_runtime_error(arguments: argparse.Namespace, place: str, reason: str) -> None:
    """``place`` is file:line:column where the runtime found something in the source, whose line is shown; else it is a part of
    the scene, such as memory."""
    found = re.fullmatch(r"(.*):(\d+):(\d+)", place, re.DOTALL)
    if found:
        _print_error(arguments, place, reason)
        for line in excerpt_at(found[1], int(found[2]), int(found[3])):
            print(line, file=sys.stderr)
    else:
        _print_error(arguments, "", reason if place in ("camera", "objects") else f"{place}: {reason}")


def _print_json_error(
    arguments: argparse.Namespace, place: str, reason: str, diagnostics: tuple[Diagnostic, ...]
) -> None:
    if arguments.json:
        print_json(json_error(place, reason, diagnostics))


def _is_utf8(data: bytes) -> bool:
    """Also where the last character is cut off."""
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data)
    except UnicodeDecodeError:
        return False
    return True


def json_error(place: str, reason: str, diagnostics: tuple[Diagnostic, ...] = ()) -> dict:
    """What a command that fails prints with ``--json``."""
    return {"error": {"place": place, "reason": reason}, "diagnostics": [d.as_json() for d in diagnostics]}
