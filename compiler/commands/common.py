"""What the commands share: arguments that several take, reading a scene, and how an error is told.

A command's ``run`` raises; :func:`report_errors` prints the message (and, with ``--json``, one object
``{"error": {"place", "reason"}, "diagnostics": […]}``) and gives the exit code.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import Callable, Iterator

from ..reading.diagnostics import Diagnostic, PlsysError, SceneError, render


def add_scene_arguments(parser: argparse.ArgumentParser, scene_help: str = "a .plsys file") -> None:
    parser.add_argument("scene", metavar="SCENE", help=scene_help)
    add_input_arguments(parser)


def add_input_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-D",
        dest="parameters",
        metavar="NAME=VALUE",
        type=parameter,
        action="append",
        default=[],
        help="set a Parameter of the scene",
    )
    parser.add_argument("--seed", type=int, help="set the random seed instead of global_settings' seed")


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
    from ..reading.source import Source

    compilation = build(read_source(arguments.scene), parameters=dict(arguments.parameters), seed=arguments.seed)
    show_diagnostics(d for d in compilation.diagnostics if d.severity == "warning")
    return compilation


def read_source(path: str):
    """The Source at ``path``; PlsysError where it can't be read."""
    from ..reading.source import Source

    try:
        return Source.read(path)
    except OSError as error:
        raise PlsysError(f"can't be read: {error.strerror}", path) from None


def show_diagnostics(diagnostics) -> None:
    for diagnostic in diagnostics:
        print(render(diagnostic), file=sys.stderr)


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """A temporary name beside ``path`` to write to: renamed to it at the end, removed on any error.

    Fails before any work is done where ``path`` can't be written. The temporary name keeps the suffix, by which
    image libraries choose the format."""
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        if path.is_dir():
            raise IsADirectoryError(21, "it is a folder")
        temporary.touch()
    except OSError as error:
        raise PlsysError(f"can't be written: {error.strerror}", str(path)) from None
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def print_json(value: object) -> None:
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
    except MemoryError:
        _print_error(arguments, getattr(arguments, "scene", ""), "there isn't enough memory")
    except Exception as error:
        # The runtime's errors are a family of their own: it knows nothing of the compiler.
        if not (hasattr(error, "place") and hasattr(error, "reason")):
            raise
        _print_error(arguments, error.place, error.reason)
    return 2


def _print_error(arguments: argparse.Namespace, place: str, reason: str) -> None:
    print(f"{place or 'plsys'}: error: {reason}", file=sys.stderr)
    _print_json_error(arguments, place, reason, ())


def _print_json_error(
    arguments: argparse.Namespace, place: str, reason: str, diagnostics: tuple[Diagnostic, ...]
) -> None:
    if arguments.json:
        print_json({"error": {"place": place, "reason": reason}, "diagnostics": [d.as_json() for d in diagnostics]})
