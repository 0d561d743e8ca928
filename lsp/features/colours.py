"""Colours: a swatch beside each constant colour, and its spelling when the editor's picker changes it.

Scenes hold linear light and editors show sRGB, so a colour is encoded as the picture will be, and decoded again.

Example: ``rgb <0.45, 0.30, 0.15>`` is shown as (0.70, 0.58, 0.42); picking white offers ``rgb <1, 1, 1>`` and ``White``.
"""

from __future__ import annotations

from typing import Any

from plsys.compiler.analysis import vocabulary
from plsys.lsp import prose
from plsys.lsp.palette import colours_of, five
from plsys.lsp.request import Feature, Request

# A picked component may differ from a named colour's by half a step of a byte.
STEP = 0.5 / 255


def document_colours(request: Request) -> list[dict[str, Any]]:
    text = request.document.text
    found = []
    for block, base in zip(text.blocks, text.starts):
        for start, end, parts in colours_of(request.scene, block):
            found.append({"range": request.range(base + start, base + end), "color": shown(parts)})
    return found


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
