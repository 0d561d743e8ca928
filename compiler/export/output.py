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

from ..graph.forecast import forecast
from ..graph.graph import Graph
from ..reading.diagnostics import PlsysError
from .unfold import SHAPE_NAMES, Instances, Unfolding

MOST_PRIMITIVES = 100_000_000
"""Of an export: about 15 GB of text for POV-Ray, which needs ten times as much memory to read it."""


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
            self.lost.append(
                f"{unfolding.singular} subtrees under singular transformations, which have no volume"
            )


def check_size(graph: Graph, most_primitives: int = MOST_PRIMITIVES) -> None:
    """PlsysError where it is known beforehand that the unfolding has no end, or more primitives than an
    export may have. What depends on draws is found out by the unfolder's own limits."""
    prediction = forecast(graph)
    if prediction.infinite:
        raise PlsysError(
            "a scene without end can't be unfolded: its recursion must stop at some depth to be exported"
        )
    if (prediction.primitives or 0) > most_primitives:
        digits = len(str(prediction.primitives))
        count = f"{prediction.primitives:,}" if digits <= 15 else f"a number of {digits} digits of"
        raise PlsysError(
            f"the scene unfolds into {count} primitives; "
            f"an export has at most {most_primitives:,} (max_primitives)"
        )


@contextmanager
def whole_file(path: str | Path) -> Iterator[TextIO]:
    """A text file to write; it takes the name ``path`` when all is written and leaves nothing behind on an
    error. PlsysError where ``path`` can't be written."""
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
