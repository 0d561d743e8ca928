"""What an export has to say about itself, and what is too big to be one.

Example::

    check_size(graph)                    # PlsysError for a scene without end
    exported = Exported()
    exported.count(batch)                # primitives by kind
    exported.lost.append("planes have no end")
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from ..graph.forecast import MOST_PRIMITIVES, forecast
from ..graph.graph import Graph
from ..reading.diagnostics import PlsysError
from .unfold import SHAPE_NAMES, Instances, Unfolding

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
