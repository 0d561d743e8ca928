"""Lay out scenes: spaces, indentation and blank lines. Line breaks and comments stay where they are, and a scene means
what it meant.

Definitions with syntax errors are left as they are. Exit code 1 with --check if a scene isn't laid out yet, 2 if one has
syntax errors. Of ``-``, standard input, what it becomes is written to standard output.

Example: ``plsys format scenes/*.plsys --check``
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..export.files import written_whole
from ..reading.diagnostics import PlsysError
from ..reading.source import Source
from .common import print_json, read_source, show_diagnostics

STANDARD = "-"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", metavar="SCENE", nargs="+", help=".plsys files, which are written anew where they change; -: standard input, to standard output")
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a scene would change")


def run(arguments: argparse.Namespace) -> int:
    if STANDARD in arguments.scenes and (len(arguments.scenes) > 1 or arguments.json and not arguments.check):
        besides = "other files" if len(arguments.scenes) > 1 else "--json"
        raise PlsysError(f"standard input goes to standard output, which has no room for {besides}", STANDARD)
    files = [_format(path, arguments) for path in arguments.scenes]
    if arguments.json:
        print_json({"files": files})
    if any(file["errors"] for file in files):
        return 2
    return 1 if arguments.check and any(file["changed"] for file in files) else 0


def _format(path: str, arguments: argparse.Namespace) -> dict:
    """Format one file; its JSON entry."""
    from ..analysis import Document, format_document

    is_file = path != STANDARD
    try:
        source = read_source(path) if is_file else read_source("<stdin>", sys.stdin.buffer)
        formatted = format_document(Document(source.path, source.data))
        changed = bool(formatted.edits)
        if not is_file and not arguments.check:
            sys.stdout.buffer.write(formatted.data)
        elif changed and not arguments.check:
            _write(path, formatted.data)
    except PlsysError as error:
        print(f"{error.place}: error: {error.reason}", file=sys.stderr)
        return {"path": path, "changed": False, "errors": 1, "error": error.reason}
    errors = 0
    if formatted.skipped:
        errors = _show_errors(source, arguments)
        errors = errors or len(formatted.skipped)
    if not arguments.json and changed and (is_file or arguments.check):
        print(f"{source.name}: {'would change' if arguments.check else 'formatted'}")
    return {"path": path, "changed": changed, "errors": errors}


def _show_errors(source: Source, arguments: argparse.Namespace) -> int:
    """Show the file's syntax errors; how many there are."""
    from ..reading.parse import parse

    found = [each for each in parse(source)[1].sorted() if each.severity == "error"]
    if not arguments.json:
        show_diagnostics(found)
    return len(found)


def _write(path: str, data: bytes) -> None:
    """Replace the file's text at once, and keep its permissions."""
    mode = Path(path).stat().st_mode
    with written_whole(path) as temporary:
        temporary.write_bytes(data)
        temporary.chmod(mode)
