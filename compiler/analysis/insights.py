"""Insights (graph/insights.py) on their way from the worker of the whole-file checks to the text that an editor shows.

The worker makes :class:`Placed` insights, numbers without spans; the scene keeps them by block, so that edits elsewhere
move them and an edit of their block drops them until the next ones arrive.

Example::

    scene.insights.update(kept(placed, result_span))
    for start, end, insight in insights_in(scene, document, 0, 4000): …
"""

from __future__ import annotations

from dataclasses import replace
from typing import Callable, Iterable, Iterator, NamedTuple

from ..graph.insight import GuardInsight, Insights, SymbolInsight, ValueInsight
from ..reading.source import Span
from .document import Document
from .scene import Scene
from .text import Block

Insight = SymbolInsight | GuardInsight | ValueInsight


class Placed(NamedTuple):
    """``place`` as in whole.Finding: file, block, start, end. The insight's own span is None."""

    place: tuple[int, int, int, int]
    insight: Insight


class Shown(NamedTuple):
    """An insight about the bytes ``start`` to ``end`` of a file."""

    start: int
    end: int
    insight: Insight


def placed(found: Insights, place: Callable[[Span], tuple[int, int, int, int]]) -> tuple[Placed, ...]:
    every = (*found.symbols, *found.guards, *found.values)
    return tuple(Placed(place(each.span), replace(each, span=None)) for each in every)


def kept(
    found: Iterable[Placed], span_of: Callable[[int, int, int, int], tuple[Block, Span]]
) -> dict[Block, list[Shown]]:
    """The insights by block, with offsets in it, in text order."""
    blocks: dict[Block, list[Shown]] = {}
    for each in found:
        block, span = span_of(*each.place)
        blocks.setdefault(block, []).append(Shown(span.start, span.end, each.insight))
    for several in blocks.values():
        several.sort(key=lambda shown: shown[:2])
    return blocks


def insights_in(scene: Scene, document: Document, start: int, end: int) -> Iterator[Shown]:
    """What is known about the bytes ``start`` to ``end`` of a file, block by block."""
    if not scene.insights:
        return
    text = document.text
    for index in range(text.index_at(start), text.index_at(end) + 1):
        base = text.starts[index]
        for each in scene.insights.get(text.blocks[index], ()):
            if base + each.end >= start and base + each.start <= end:
                yield Shown(base + each.start, base + each.end, each.insight)


def insights_of(scene: Scene, name: str) -> Iterator[Insight]:
    """What is known about a symbol or a parameter, wherever it stands."""
    for facts in (*scene.definers.get(name, ()), *scene.writers.get(name, ())):
        for each in scene.insights.get(facts.block, ()):
            if getattr(each.insight, "name", "") == name:
                yield each.insight
