"""The language server, for editors: LSP on standard input and output, or on a socket.

Editors start it themselves; `--tcp` and `--ws` are for a client in a browser and for looking at what happens.
"""

from __future__ import annotations

import argparse

from ..reading.diagnostics import PlsysError

HOST = "127.0.0.1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    transport = parser.add_mutually_exclusive_group()
    transport.add_argument("--stdio", action="store_true", help="standard input and output (the default)")
    transport.add_argument("--tcp", metavar="PORT", type=int, help="one client on a TCP port of this machine")
    transport.add_argument("--ws", metavar="PORT", type=int, help="one client on a WebSocket of this machine")


def run(arguments: argparse.Namespace) -> int:
    try:
        from plsys.lsp import server
    except ImportError as error:
        raise PlsysError(f"the language server can't be loaded ({error}); it needs the package pygls", "plsys lsp") from None
    try:
        if arguments.tcp is not None:
            server.serve_tcp(HOST, arguments.tcp)
        elif arguments.ws is not None:
            server.serve_ws(HOST, arguments.ws)
        else:
            return server.serve_stdio()
    except OSError as error:
        raise PlsysError(f"can't serve: {error.strerror or error}", "plsys lsp") from None
    return 0
