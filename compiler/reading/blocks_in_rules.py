"""What is said of a scene block that stands in a rule, where only names, calls and brackets may.

A block as it was read → a :class:`Problem`, with what to write instead where the block's own numbers say it: rules have unit
shapes, and operators put them in their places.

Example: of ``A -> sphere { <0, 0, 1>, 2 };`` the mend is ``[ trans 0 0 1; scale 2 ] sphere``.
"""

from __future__ import annotations

import re
from typing import Sequence

from . import syntax, vocabulary
from .problems import Problem, unsupported
from .resolve_expressions import BLOCKS, Expressions
from .resolve_items import Items

# What may stand in a block of which the numbers are taken over: a name's value may change.
_NUMBERS = re.compile(r"\w+\s*\{[^A-Za-z_{}]*\}")


def block_in_rule(block: syntax.Block, expressions: Expressions) -> Problem:
    name = block.name.name
    if name in vocabulary.UNSUPPORTED:
        return unsupported(block.name)
    if name in ("texture", "pigment", "finish"):
        hint = "name it: Texture Leaf { pigment { … } } and write Leaf"
        return Problem("wrong-kind", block.span, f"a {name} block can't stand in a rule", hint)
    if name in vocabulary.PRIMITIVES:
        mend = _unit_shape(block, expressions)
        message, hint = f"the scene block '{name}' can't stand in a rule", f"write [ trans … ] {name}: rules have unit shapes"
        return Problem("wrong-kind", block.span, message, f"write {mend}" if mend else hint, mend=mend)
    message, hint, mend = f"the block '{name}' can't stand in a rule", "scene blocks stand outside of Selections", None
    if name == "object" and len(block.items) == 1 and isinstance(block.items[0], syntax.Name | syntax.Call):
        mend = block.items[0].span.text
        hint = f"write {mend}"
    elif name == "union":
        hint = "'+' joins what a rule produces: (box + T_up sphere)"
    return Problem("wrong-kind", block.span, message, hint, mend=mend)


def union_in_rule(call: syntax.Call) -> Problem:
    """Of ``union(box, sphere)``."""
    mend = f"({' + '.join(argument.span.text for argument in call.arguments)})"
    return Problem("wrong-kind", call.span, "'+' joins what a rule produces", f"write {mend}", mend=mend)


def _unit_shape(block: syntax.Block, expressions: Expressions) -> str | None:
    """The unit shape where the block's numbers put it; None where more than numbers stands there, or a shape is turned."""
    if not _NUMBERS.fullmatch(block.span.text):
        return None
    name = block.name.name
    items = Items(f"'{name}'", block.span, block.items, expressions, BLOCKS)
    try:
        start = items.vector("a place")
        if name == "sphere":
            sizes = [items.constant("a radius")]
        elif name == "box":
            end = items.vector("a corner")
            start, end = tuple(map(min, start, end)), tuple(map(max, start, end))
            sizes = [high - low for low, high in zip(start, end)]
        elif name == "cylinder":
            end, radius = items.vector("a place"), items.constant("a radius")
            if end[:2] != start[:2]:
                return None
            sizes = [radius, radius, end[2] - start[2]]
        else:
            return None
    except Problem:
        return None
    if items or min(sizes) <= 0:
        return None
    steps = [_step("trans", start)] if any(start) else []
    steps += [_step("scale", sizes)] if set(sizes) != {1.0} else []
    return f"[ {'; '.join(steps)} ] {name}" if steps else name


def _step(operation: str, numbers: Sequence[float]) -> str:
    return " ".join([operation, *(f"{number:.12g}" for number in numbers)])
