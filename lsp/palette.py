"""The constant colours of a block: where they stand, and what they are.

Example: ``color rgb <1, 0, 0> transmit 0.5`` has a colour at ``rgb <1, 0, 0>``, ``[1, 0, 0, 0, 0]``.
"""

from __future__ import annotations

from typing import Any, Iterator

from plsys.compiler.analysis import Block, Scene, constant_of, facts_of, syntax, vocabulary

# The words of colours, and which of red, green, blue, filter and transmit their components are.
FORMS = {"rgb": (0, 1, 2), "rgbf": (0, 1, 2, 3), "rgbt": (0, 1, 2, 4), "rgbft": (0, 1, 2, 3, 4)}
# Blocks without any of these have no colours, and needn't be looked at.
_WORDS = (b"rgb", b"color", b"colour", b"pigment", b"finish", b"background", b"light_source", b"declare", b"ambient")


Colour = tuple[int, int, list[float]]


def colours_of(scene: Scene, block: Block) -> list[Colour]:
    """Constant colours of a block: where, and the five components. They are kept with the block if no name that they are made
    of can come to mean something else."""
    kept = block.__dict__.get("colours")
    if kept is not None:
        return kept
    found = []
    if any(word in block.data for word in _WORDS):
        for definition in facts_of(block).file.definitions:
            for items in item_lists(definition):
                found += colours_in(scene, items)
    colours = [(start, end, parts) for start, end, parts, _ in found if parts is not None]
    if all(is_literal for *_, is_literal in found):
        block.__dict__["colours"] = colours
    return colours


def item_lists(node: Any) -> Iterator[tuple]:
    """The flat lists of items below a definition, a block or a map's entry."""
    if isinstance(node, syntax.Texture):
        yield from item_lists(node.block)
    elif isinstance(node, syntax.Block | syntax.Declare | syntax.MapEntry):
        yield node.items
        for item in node.items:
            yield from item_lists(item)


def colours_in(scene: Scene, items: tuple) -> Iterator[tuple[int, int, list[float] | None, bool]]:
    """Colours among ``items``: where, the components (None for what isn't constant), and whether they are written as numbers
    or by a name of the vocabulary."""
    following = (*items[1:], None)
    for item, after in zip(items, following):
        if not isinstance(item, syntax.Name):
            continue
        if item.name in vocabulary.COLOURS:
            yield item.span.start, item.span.end, five(vocabulary.COLOURS[item.name]), True
        elif item.name in FORMS and isinstance(after, syntax.Vector | syntax.Number):
            components = after.components if isinstance(after, syntax.Vector) else (after,)
            numbers = [constant_of(scene, each) for each in components]
            if len(numbers) == 1:
                numbers *= len(FORMS[item.name])
            parts = None
            if None not in numbers and len(numbers) == len(FORMS[item.name]):
                parts = [0.0] * 5
                for place, value in zip(FORMS[item.name], numbers):
                    parts[place] = value
            is_literal = all(isinstance(each, syntax.Number) for each in components)
            yield item.span.start, after.span.end, parts, is_literal


def five(parts: list[float]) -> list[float]:
    return [*parts, *([0.0] * (5 - len(parts)))]
