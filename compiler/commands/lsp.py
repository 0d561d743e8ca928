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
    transport.add_argument("--tcp", metavar="PORT", type=port, help="one client on a TCP port of this machine")
    transport.add_argument("--ws", metavar="PORT", type=port, help="one client on a WebSocket of this machine")


def port(text: str) -> int:
    if not (text.isdecimal() and int(text) < 65536):
        raise argparse.ArgumentTypeError(f"'{text}' isn't a port, 0 to 65535")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    try:
        if arguments.tcp is None and arguments.ws is None:
            from plsys.lsp.server import serve_stdio

            return serve_stdio()
        from plsys.lsp.sockets import serve_tcp, serve_ws
    except ImportError as error:
        raise PlsysError(f"the language server can't be loaded ({error}); sockets need pygls[ws]", "plsys lsp") from None
    try:
        if arguments.tcp is not None:
            serve_tcp(HOST, arguments.tcp)
        else:
            serve_ws(HOST, arguments.ws)
    except OSError as error:
        raise PlsysError(f"can't serve: {error.strerror or error}", "plsys lsp") from None
    return 0
