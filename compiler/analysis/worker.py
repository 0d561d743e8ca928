"""Processes of the analysis beside the one that answers an editor: how they are started, and what they say.

A worker is a function of this package that reads pickled requests from standard input and writes pickled answers.

Example: ``process = start("plsys.compiler.analysis.checking")`` runs that module's ``main``; ``for answer in answers(process): …``
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from typing import Any, BinaryIO, Iterator

# A thread that waits for the interpreter gets it after so long.
SWITCH_S = 0.0002


def start(module: str) -> subprocess.Popen:
    """A process that runs ``main`` of ``module``. Raises OSError."""
    command = [sys.executable, "-c", f"from {module} import main; main()"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(each for each in sys.path if each)}
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
    )


def write(process: subprocess.Popen, data: bytes) -> None:
    """Send a pickled request. May wait until the worker reads it."""
    try:
        process.stdin.write(data)
        process.stdin.flush()
    except (OSError, ValueError):
        pass  # it ended; answers() notices


def answers(process: subprocess.Popen) -> Iterator[Any]:
    """What the worker says until it ends."""
    while True:
        try:
            yield pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError, ValueError):
            return


def streams() -> tuple[BinaryIO, BinaryIO]:
    """A worker's own input and output; it runs after whatever a person waits for, and what prints by mistake isn't sent."""
    give_turns()
    try:
        os.nice(5)
    except (AttributeError, OSError):
        pass
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return sys.stdin.buffer, output


def give_turns() -> None:
    """Have threads that read what comes in get their turn soon, whatever the process is at. With the interpreter's usual 5 ms
    they are late by as much each time they wait, and answers with them."""
    sys.setswitchinterval(SWITCH_S)
