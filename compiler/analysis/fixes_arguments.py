"""Quick fixes of arguments that are missing or too many: filled in from an example of the vocabulary, or cut off.

Each takes the spot of the message, the match of the row's pattern, and the message; it gives a title and edits, or None.

Example: "torus takes 1 argument, not 0" at ``A -> torus;`` is mended by ``torus(0.2)``, the vocabulary's example.
"""

from __future__ import annotations

import re
from typing import Iterator

from ..reading import syntax, vocabulary
from .actions import Spot, TextEdit
from .document import Message

Found = tuple[str, list[TextEdit]] | None

# What changes nothing where it is filled in; and what stands for a value of which no example is known.
_NEUTRAL = {"trans": "0", "shear": "0", "scale": "1"}
_ANY = {"number": "1", "vector": "<1, 1, 1>"}


def fitting_arguments(spot: Spot, match: re.Match, message: Message) -> Found:
    """As many arguments as are taken: those that are there, and for the rest values of the example."""
    node = next(_nodes(spot.definition, spot.start - spot.base, spot.end - spot.base), None)
    if node is None:
        return None
    name, given = node.name if isinstance(node, syntax.Name) else node.name.name, getattr(node, "arguments", ())
    counts, sample = _taken(spot, name, given)
    if not counts:
        return None
    more = [count for count in counts if count > len(given)]
    wanted = min(more) if more else max(counts)
    texts = [argument.span.text for argument in given[:wanted]]
    texts += sample[len(texts) : wanted]
    if len(texts) != wanted or wanted == len(given):
        return None
    if isinstance(node, syntax.Operation):
        separator = ", " if "," in node.span.text else " "
        written = f"{name} {separator.join(texts)}"
    else:
        written = f"{name}({', '.join(texts)})" if texts else name
    start = spot.base + node.span.start
    return f"Write '{written}'", [spot.edit(start, start + len(node.span.text.rstrip("; ").encode()), written)]


def _taken(spot: Spot, name: str, given: tuple) -> tuple[tuple[int, ...], list[str]]:
    """How many arguments ``name`` takes, and values for them."""
    row = vocabulary.OPERATIONS.get(name) or vocabulary.PRIMITIVES.get(name) or vocabulary.FUNCTIONS.get(name)
    if row is None:
        entry = spot.scene.entries.get(name)
        node = entry.node if entry is not None else None
        count = len(node.parameters) if isinstance(node, syntax.Selection) else 0
        return ((count,), ["1"] * count) if isinstance(node, syntax.Selection) else ((), [])
    if row.variadic:
        return (), []
    found = re.search(rf"\b{name}(?:\s+([^;\]}}]+)|\(([^()]*)\))", row.example)
    text = (found[1] or found[2] or "") if found is not None else ""
    sample = [part for part in re.split(r"\s*,\s*|\s+", text.strip()) if part]
    if name in _NEUTRAL:
        sample = [_NEUTRAL[name]] * max(row.arity)
    return row.arity, sample


def _nodes(node: object, start: int, end: int) -> Iterator[syntax.Name | syntax.Call | syntax.Operation]:
    """The innermost names, calls and operations at bytes ``start`` to ``end`` of a definition."""
    if isinstance(node, tuple):
        for each in node:
            yield from _nodes(each, start, end)
    elif isinstance(node, syntax.Node) and node.span.start <= start and end <= node.span.end:
        for field in node.__dataclass_fields__:
            yield from _nodes(getattr(node, field), start, end)
        if node.span.start == start and isinstance(node, syntax.Call | syntax.Operation | syntax.Name):
            if node.span.end == end or _ends_there(node, end):
                yield node


def _ends_there(node: syntax.Node, end: int) -> bool:
    """Whether only a ``;`` and space lie between ``end`` and the node's end."""
    return node.span.start + len(node.span.text.rstrip("; \t\r\n").encode()) == end


def last_values(spot: Spot, match: re.Match, message: Message) -> Found:
    """Values for those that a shape's block lacks at its end."""
    row = vocabulary.BLOCKS.get(match[1])
    node = next((each for each in _blocks(spot.definition) if each.span.end == spot.end - spot.base), None)
    if row is None or not row.types or node is None or node.name.name != row.name:
        return None
    given = [item for item in node.items if not isinstance(item, syntax.Block)]
    missing = ", ".join(_ANY[each] for each in row.types[len(given) :])
    if not given or not missing or len(given) < len(node.items):
        return None
    at = spot.base + given[-1].span.end
    return f"Add ', {missing}'", [spot.edit(at, at, f", {missing}")]


def _blocks(node: object) -> Iterator[syntax.Block]:
    if isinstance(node, syntax.Block):
        yield node
    for item in getattr(node, "items", ()):
        yield from _blocks(item)


ARGUMENT_FIXES = {
    "wrong-arguments": (
        (r"^\w+ takes .*arguments?, not \d+", fitting_arguments),
        (r"^'(\w+)' needs the .* here", last_values),
    ),
}
