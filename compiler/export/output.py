"""Files that exist whole or not at all, and what an export has to say about itself.

Example::

    with whole_file("tree.pov") as file:      # written under a temporary name, renamed at the end
        file.write("…")
"""

from __future__ import annotations

import os
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Iterator, TextIO

from ..reading.diagnostics import PlsysError
from .unfold import SHAPE_NAMES, Instances, Unfolding


@dataclass
class Exported:
    """What was written: ``lost`` says, one sentence each, what the format can't carry."""

    primitives: int = 0
    by_kind: Counter[str] = field(default_factory=Counter)
    lost: list[str] = field(default_factory=list)

    def count(self, batch: Instances) -> None:
        for kind, name in SHAPE_NAMES.items():
            if n := int((batch.kind == kind).sum()):
                self.by_kind[name] += n
        self.primitives += len(batch)

    def finish(self, unfolding: Unfolding) -> None:
        if unfolding.singular:
            self.lost.append(f"{unfolding.singular} subtrees under singular transformations, which have no volume")


@contextmanager
def whole_file(path: str | Path) -> Iterator[TextIO]:
    """A text file to write; it takes the name ``path`` when all is written and leaves nothing behind on an error.
    PlsysError where ``path`` can't be written."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        if path.is_dir():
            raise IsADirectoryError(21, "it is a folder")
        file = open(temporary, "w", encoding="utf-8")
    except OSError as error:
        raise PlsysError(f"can't be written: {error.strerror}", str(path)) from None
    try:
        with file:
            yield file
        os.replace(temporary, path)
    except OSError as error:
        raise PlsysError(f"can't be written: {error.strerror}", str(path)) from None
    finally:
        temporary.unlink(missing_ok=True)
