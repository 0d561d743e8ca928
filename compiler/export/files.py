"""Files that exist whole or not at all: written under a temporary name, renamed at the end.

Example::

    with whole_file("tree.pov") as file:
        file.write("…")                      # on any error nothing is left behind, and an older file stays
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path
from typing import Iterator, TextIO

from ..reading.diagnostics import PlsysError


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path`` (or beside what it links to) to write to, with the same suffix, by which image
    libraries choose the format. Fails at once with a PlsysError where ``path`` can't be written."""
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        if target.exists() and not target.is_file():
            raise OSError(0, "it is a folder" if target.is_dir() else "it is not an ordinary file")
        temporary.touch()
    except OSError as error:
        raise PlsysError(f"can't be written: {error.strerror}", str(path)) from None
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise PlsysError(f"can't be written: {error.strerror}", str(path)) from None
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def whole_file(path: str | Path) -> Iterator[TextIO]:
    """A text file to write, as :func:`written_whole`."""
    with written_whole(path) as temporary, open(temporary, "w", encoding="utf-8") as file:
        yield file
