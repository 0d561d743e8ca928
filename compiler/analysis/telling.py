"""What an answer of the whole-file checks says: outcomes of parts → an :class:`Answer`, with places as numbers.

Example: ``answer(scene, request, places, new)`` tells what was found out about the parts ``new``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Iterable, Iterator

from ..reading.diagnostics import Diagnostic
from ..reading.source import Span
from .exchange import Answer, Finding, Request
from .facts import facts_of
from .insights import Placed, placed
from .parts import Part
from .text import Block

if TYPE_CHECKING:
    from .checking import SceneState

# Said once of a scene, not of each part.
_MISSING = frozenset(("no-camera", "no-object", "no-light"))

# What isn't sure while a block that can't be read may hold a use, or a camera.
_UNSURE = frozenset((*_MISSING, "unused", "unreachable"))

# The insights about so many blocks are read in a millisecond or two.
PIECE = 256


def answer(
    scene: SceneState, request: Request, order: dict[Block, int], places: dict[Block, tuple[int, int]], new: Iterable[Part]
) -> Answer:
    """``new`` are parts of which more is known than was told; ``order`` is where each block stands in what the compiler
    reads, ``places`` the numbers of its file and of it there."""
    return _Told(scene, order, places).answer(request.key, dict.fromkeys(new))


def in_pieces(answer: Answer) -> Iterator[Answer]:
    """The answer as several, none of which takes long to read: whoever does that has a key to answer. The last one has all
    but the insights of the others."""
    by_block: dict[tuple[int, int], list[Placed]] = {}
    for each in answer.insights:
        by_block.setdefault(each.place[:2], []).append(each)
    blocks = answer.forecast_of
    while len(blocks) > PIECE:
        some, blocks = blocks[:PIECE], blocks[PIECE:]
        insights = tuple(each for block in some for each in by_block.pop(block, ()))
        yield Answer(answer.key, insights=insights, forecast_of=some, more=True, is_piece=True)
    yield answer._replace(insights=tuple(each for several in by_block.values() for each in several), forecast_of=blocks)


class _Told:
    def __init__(self, scene: SceneState, order: dict[Block, int], places: dict[Block, tuple[int, int]]) -> None:
        self.scene, self.order, self.places = scene, order, places
        self.parts = [part for part in scene.parts if part.outcome is not None]

    def answer(self, key: int, new: dict[Part, None]) -> Answer:
        scene = self.scene
        is_unsure = not scene.is_complete or any(part.outcome.is_broken for part in self.parts)
        scene.unsure.intersection_update(self.parts)
        if is_unsure:  # and what was said while it was sure is taken back
            told = {part for part in self.parts if part in new or (part not in scene.unsure and _is_unsure(part))}
            scene.unsure |= told
        else:
            told = scene.unsure.union(new)
            scene.unsure = set()
        findings, general = self._diagnostics(told, is_unsure)
        shown = [part for part in new if part.outcome.insights is not None]
        silent, scene.partless = scene.partless, set()
        left = sum(part.outcome is None or part.outcome.model is not None for part in scene.parts)
        return Answer(
            key,
            tuple(self.places[block] for blocks in (*(part.blocks for part in told), silent) for block in blocks),
            tuple(map(self._finding, findings)),
            tuple(map(self._finding, general)),
            tuple(each for part in shown for each in placed(part.outcome.insights, self._place)),
            tuple(self.places[block] for part in shown for block in part.blocks),
            None if left else _total(self.parts),
            left > 0,
        )

    def _diagnostics(self, told: set[Part], is_unsure: bool) -> tuple[list[Diagnostic], list[Diagnostic]]:
        """Those about the blocks of parts that are told, and all those about what parts share."""
        own: list[Diagnostic] = []
        general: dict[tuple, Diagnostic] = {}
        missing: dict[str, Diagnostic] = {}
        objects: dict[float, Diagnostic] = {}  # what to place, by where it stands
        for part in self.parts:
            if not part.outcome.diagnostics:
                continue
            blocks = set(part.blocks)
            for each in part.outcome.diagnostics:
                if is_unsure and each.code in _UNSURE:
                    continue
                if each.code == "no-object":
                    objects[self._first_selection(part)] = each
                elif each.code in _MISSING:
                    if part is self.scene.parts.base:
                        missing[each.code] = each
                elif each.span.source not in blocks:
                    general.setdefault((each.code, each.span.source, each.span.start), each)
                elif part in told:
                    own.append(each)
        if objects:
            missing["no-object"] = objects[min(objects)]
        return own, [*missing.values(), *general.values()]

    def _first_selection(self, part: Part) -> float:
        """Where the first Selection of a part stands; behind all others: it has none."""
        has_one = (block for block in part.blocks if any(each.kind == "selection" for each in facts_of(block).definitions))
        return min((self.order[block] for block in has_one), default=math.inf)

    def _place(self, span: Span) -> tuple[int, int, int, int]:
        return (*self.places.get(span.source, (0, 0)), span.start, span.end)  # type: ignore[call-overload]

    def _finding(self, d: Diagnostic) -> Finding:
        notes = tuple((*self._place(note.span), note.message) for note in d.notes)
        return Finding(*self._place(d.span), d.code, d.severity, d.message, d.hint, notes)


def _is_unsure(part: Part) -> bool:
    return any(each.code in _UNSURE for each in part.outcome.diagnostics)


def _total(parts: Iterable[Part]) -> dict[str, Any] | None:
    """The forecasts of all parts together; None where one isn't known."""
    found = [part.outcome.forecast for part in parts]
    if None in found:
        return None
    kinds = dict.fromkeys(kind for each in found for kind in each.by_kind)
    bounds = zip(*(each.primitives_range for each in found))
    return {
        "primitives": _sum(each.primitives for each in found),
        "by_kind": {kind: _sum(each.by_kind.get(kind, 0) for each in found) for kind in kinds},
        "primitives_range": tuple(_sum(values) for values in bounds),
        "states": _sum(each.states for each in found),
        "depth": None if any(each.depth is None for each in found) else max((each.depth for each in found), default=0),
        "infinite": any(each.infinite for each in found),
    }


def _sum(values: Iterable[Any]) -> Any:
    values = list(values)
    return None if None in values else sum(values)
