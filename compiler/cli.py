"""The command line: ``plsys COMMAND …``.

Each command is a module of ``plsys.compiler.commands`` with ``SUMMARY``, ``add_arguments(parser)`` and
``run(arguments) -> exit code``; only the one that is asked for is imported. Exit codes: 0 fine, 1 a check failed or
pictures differ, 2 bad input (with a message on stderr and no output file).

Example: ``plsys render scenes/tree.plsys -o tree.png``
"""

from __future__ import annotations

import argparse
import atexit
import gc
import importlib
import sys
from typing import Iterable, NoReturn

# Objects made before Python looks for cycles among them. Importing and compiling make some ten thousand, which stay.
GARBAGE_THRESHOLD = 100_000

COMMANDS = {
    "render": "draw a scene",
    "check": "diagnostics, and how many primitives a scene has, without unfolding it",
    "format": "lay out scenes: spaces, indentation, blank lines",
    "compile": "write the bytecode (.plsb) that `render` and `plsys-rt` read",
    "export": "write the unfolded scene for POV-Ray (.pov) or as a mesh (.obj)",
    "compare": "draw a scene here and in POV-Ray and compare the pictures",
    "graph": "draw the cyclic object-instancing graph (.svg, .dot)",
    "disassemble": "show the bytecode as text",
    "lsp": "the language server, for editors",
}

EPILOG = """\
examples:
  plsys render scenes/tree.plsys -o tree.png --size 800x600
  plsys render scenes/tree.plsys -o old.png -D order=14
  plsys check scenes/*.plsys
  plsys compare scenes/tree.plsys -o difference.png

`plsys COMMAND --help` explains a command. Every command but `lsp` takes --json.
exit codes: 0 fine, 1 a check failed or pictures differ, 2 bad input."""


def main(argv: list[str] | None = None) -> int:
    """Run one command; the process's exit code."""
    gc.set_threshold(GARBAGE_THRESHOLD)
    atexit.register(_forget_garbage)
    argv = sys.argv[1:] if argv is None else argv
    parser = _parser(argv[0] if argv else None)
    if argv and argv[0] not in COMMANDS and not argv[0].startswith("-"):
        parser.json = "--json" in argv
        parser.error(f"no command '{argv[0]}': {_meant(argv[0], COMMANDS)}")
    arguments, rest = parser.parse_known_args(argv)
    if rest:
        parser.error(_is_too_much(rest[0], parser.options))
    if not arguments.command:
        parser.print_help()
        return 2
    from .commands.common import report_errors

    return report_errors(arguments, lambda: arguments.run(arguments))


def _forget_garbage() -> None:
    """Spare Python looking for cycles while it ends, a tenth of drawing a small scene. OpenImageIO's binding wants it: it
    takes what is left for leaks, and says so."""
    if "OpenImageIO" not in sys.modules:
        gc.freeze()


def _parser(command: str | None) -> argparse.ArgumentParser:
    """The parser of all commands, with the options of ``command`` only: the others stay unimported."""
    parser = _ArgumentParser(
        prog="plsys",
        description="A scene language and renderer for things that grow and repeat.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version)
    parser.options = ["--help", "--version"]
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, summary in COMMANDS.items():
        if name != command:
            subparsers.add_parser(name, help=summary, add_help=False)
            continue
        module = importlib.import_module(f".commands.{name}", __package__)
        sub = subparsers.add_parser(
            name, help=summary, description=module.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        module.add_arguments(sub)
        if name == "lsp":  # it speaks JSON anyway
            sub.set_defaults(json=False)
        else:
            sub.add_argument("--json", action="store_true", help="print the facts as one JSON object")
        sub.set_defaults(run=module.run)
        parser.options = [name for action in sub._actions for name in action.option_strings]
    return parser


def _is_too_much(argument: str, options: list[str]) -> str:
    """The message for an argument that the command doesn't take."""
    if not argument.startswith("-"):
        return f"'{argument}' is one argument too many"
    name = argument.partition("=")[0]
    return f"no option '{name}': {_meant(name, options)}"


def _meant(name: str, known: Iterable[str]) -> str:
    from .reading.nearest import nearest

    return nearest(name, known) or f"known: {' '.join(known)}"


class _ArgumentParser(argparse.ArgumentParser):
    """Tells wrong arguments as JSON, too, where that is asked for."""

    json = False

    def parse_known_args(self, args=None, namespace=None):
        self.json = "--json" in (args or ())
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        if self.json:
            from .commands.common import json_error, print_json

            print_json(json_error("arguments", message))
        super().error(message)


class _Version(argparse.Action):
    def __init__(self, option_strings, dest, **_):
        super().__init__(option_strings, dest, nargs=0, help="the version, and exit")

    def __call__(self, parser, namespace, values, option_string=None):
        from importlib.metadata import version

        print(f"plsys {version('plsys')}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
