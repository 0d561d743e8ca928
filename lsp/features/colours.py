"""Colours: a swatch beside each constant colour, and its spelling when the editor's picker changes it.

Scenes hold linear light and editors show sRGB, so a colour is encoded as the picture will be, and decoded again.

Example: ``rgb <0.45, 0.30, 0.15>`` is shown as (0.70, 0.58, 0.42); picking white offers ``rgb <1, 1, 1>`` and ``White``.
"""

from __future__ import annotations

from typing import Any, Iterator

from plsys.compiler.analysis import Block, Scene, constant_of, facts_of, syntax, vocabulary
from plsys.lsp import prose
from plsys.lsp.request import Feature, Request

# The words of colours, and which of red, green, blue, filter and transmit their components are.
FORMS = {"rgb": (0, 1, 2), "rgbf": (0, 1, 2, 3), "rgbt": (0, 1, 2, 4), "rgbft": (0, 1, 2, 3, 4)}
# A picked component may differ from a named colour's by half a step of a byte.
STEP = 0.5 / 255


def document_colours(request: Request) -> list[dict[str, Any]]:
    text = request.document.text
    found = []
    for block, base in zip(text.blocks, text.starts):
        for start, end, parts in colours_of(request.scene, block):
            found.append({"range": request.range(base + start, base + end), "color": shown(parts)})
    return found


def colours_of(scene: Scene, block: Block) -> Iterator[tuple[int, int, list[float]]]:
    """Constant colours of a block: where, and the five components."""
    facts = facts_of(block)
    if b"rgb" not in block.data and not any(name.name in vocabulary.COLOURS for name in facts.names):
        return
    for definition in facts.file.definitions:
        for items in item_lists(definition):
            yield from colours_in(scene, items)


def item_lists(node: Any) -> Iterator[tuple]:
    """The flat lists of items below a definition, a block or a map's entry."""
    if isinstance(node, syntax.Texture):
        yield from item_lists(node.block)
    elif isinstance(node, syntax.Block | syntax.Declare | syntax.MapEntry):
        yield node.items
        for item in node.items:
            yield from item_lists(item)


def colours_in(scene: Scene, items: tuple) -> Iterator[tuple[int, int, list[float]]]:
    following = (*items[1:], None)
    for item, after in zip(items, following):
        if not isinstance(item, syntax.Name):
            continue
        if item.name in vocabulary.COLOURS:
            yield item.span.start, item.span.end, five(vocabulary.COLOURS[item.name])
        elif item.name in FORMS and isinstance(after, syntax.Vector | syntax.Number):
            components = after.components if isinstance(after, syntax.Vector) else (after,)
            numbers = [constant_of(scene, each) for each in components]
            if len(numbers) == 1:
                numbers *= len(FORMS[item.name])
            if None not in numbers and len(numbers) == len(FORMS[item.name]):
                parts = [0.0] * 5
                for place, value in zip(FORMS[item.name], numbers):
                    parts[place] = value
                yield item.span.start, after.span.end, parts


def five(parts: list[float]) -> list[float]:
    return [*parts, *([0.0] * (5 - len(parts)))]


def shown(parts: list[float]) -> dict[str, float]:
    """The protocol's Color: sRGB, and as alpha what isn't let through."""
    red, green, blue = (prose.encoded(each) for each in parts[:3])
    return {"red": red, "green": green, "blue": blue, "alpha": max(0.0, min(1.0, 1 - parts[3] - parts[4]))}


def presentations(request: Request) -> list[dict[str, Any]]:
    """How a picked colour can be written: as numbers, and by name where it has one."""
    picked = request.params["color"]
    red, green, blue = (prose.decoded(picked[each]) for each in ("red", "green", "blue"))
    transmit = 1 - picked["alpha"]
    numbers = [prose.number(round(each, 4)) for each in (red, green, blue)]
    labels = [f"rgb <{', '.join(numbers)}>"]
    if transmit > STEP:
        passes = prose.number(round(transmit, 4))
        labels = [f"rgbt <{', '.join(numbers)}, {passes}>", f"rgbf <{', '.join(numbers)}, {passes}>"]
    else:
        labels += [name for name, parts in vocabulary.COLOURS.items() if is_named(parts, picked)]
    range_ = request.params["range"]
    return [{"label": label, "textEdit": {"range": range_, "newText": label}} for label in labels]


def is_named(parts: list[float], picked: dict[str, float]) -> bool:
    known = shown(five(parts))
    return all(abs(known[each] - picked[each]) <= STEP for each in ("red", "green", "blue", "alpha"))


FEATURES = (
    Feature("textDocument/documentColor", document_colours, "colorProvider"),
    Feature("textDocument/colorPresentation", presentations),
)
