"""Refactorings at a place: extract, inline, bound a recursion; :mod:`parameterise` has the one that adds parameters.

All but *bound* keep the derivation: the same primitives at the same places, with the same random numbers.

Example: in ``A -> [ trans 0 0 1 ] box;`` with the cursor in the brackets, *Extract Transformation* gives
``A -> T_new box;`` and ``Transformation T_new { trans 0 0 1; }``.
"""

from __future__ import annotations

from typing import Iterator

from ..reading import syntax
from .actions import Action, Spot, TextEdit, fresh_name, terms, uses_at
from .bounding import ROUNDS, bounded
from .document import Document, Place
from .facts import facts_of
from .keys import has_variants
from .parameterise import parameterised
from .scene import Scene


def refactorings(scene: Scene, document: Document, start: int, end: int) -> Iterator[Action]:
    """What can be done at bytes ``start`` to ``end``; nothing in a block with syntax errors."""
    spot = Spot(scene, document, start, end)
    if spot.facts.is_broken:
        return
    yield from _extract(spot)
    yield from _inline(spot)
    node = spot.definition
    if isinstance(node, syntax.Selection) and _on_head(spot, node):
        if edits := bounded(spot, node):
            title = f"Bound the recursion of '{node.name.name}' with a counter ({ROUNDS} rounds)"
            yield Action(title, "refactor.rewrite", tuple(edits))
        yield from parameterised(spot, node)


def _on_head(spot: Spot, node: syntax.Selection) -> bool:
    """Whether the spot is on the Selection's name, or on its name in its rules."""
    at = spot.start - spot.base
    if node.span.start <= at <= node.name.span.end:
        return True
    found = spot.document.name_at(spot.start)
    return found is not None and found[0] == node.name.name


# --- extract


def _extract(spot: Spot) -> Iterator[Action]:
    """An inline operator becomes a Transformation or Calculation of its own."""
    node = spot.definition
    at = spot.start - spot.base
    for term in terms(node):
        for item in term.items:
            if not (
                isinstance(item, syntax.Inline) and item.span.start <= at <= item.span.end and item.statements
            ):
                continue
            kinds = {_kind(statement) for statement in item.statements}
            if len(kinds) != 1 or has_variants(item.statements):
                continue
            kind = kinds.pop()
            name = fresh_name(spot.scene, "T_new" if kind == "Transformation" else "C_new")
            start, end = spot.base + item.span.start, spot.base + item.span.end
            at_end = spot.after_definition()
            new = f"\n{kind} {name} {{ {_statements(spot, item.statements)}; }}"
            edits = (spot.edit(start, end, _apart(spot, start, end, name)), spot.edit(at_end, at_end, new))
            yield Action(f"Extract {kind} '{name}'", "refactor.extract", edits)


def _apart(spot: Spot, start: int, end: int, name: str) -> str:
    """``name`` with spaces where it would touch the words round bytes ``start`` to ``end``."""
    before, after = spot.slice(max(0, start - 1), start), spot.slice(end, end + 1)
    return f"{' ' * _is_word(before)}{name}{' ' * (_is_word(after) or after == '(')}"


def _is_word(text: str) -> bool:
    return text.isalnum() or text == "_"


def _kind(statement: syntax.Statement) -> str:
    return "Calculation" if isinstance(statement, syntax.Assignment) else "Transformation"


def _statements(spot: Spot, statements: tuple[syntax.Statement, ...], base: int | None = None) -> str:
    """The text of statements without the last ``;``, comments between them included."""
    base = spot.base if base is None else base
    return (
        spot.slice(base + statements[0].span.start, base + statements[-1].span.end)
        .rstrip()
        .rstrip(";")
        .rstrip()
    )


# --- inline


def _inline(spot: Spot) -> Iterator[Action]:
    """A Transformation's or Calculation's statements in the place of its name."""
    found = spot.document.name_at(spot.start)
    meaning = spot.scene.meaning(found[0]) if found else None
    if meaning is None or not isinstance(meaning.node, syntax.Calculation | syntax.Transformation):
        return
    node, place = meaning.node, spot.scene.place(meaning.node.span)
    if (
        place is None
        or len(meaning.definitions) != 1
        or not node.statements
        or facts_of(node.span.source).is_broken
    ):
        return
    if has_variants(node.statements):
        return
    home = Spot(spot.scene, place.document, place.start, place.end)
    body = _statements(home, node.statements, place.start - node.span.start)
    if "//" in body.rpartition("\n")[2]:
        body += "\n"
    uses = [use for use in uses_at(spot.scene, node.name.name) if _is_operator(use)]
    if len(uses) != len(uses_at(spot.scene, node.name.name)) or not uses:
        return
    edits = [TextEdit(use.document, use.start, use.end, f"[ {body} ]") for use in uses]
    gone = home.cut(place.start, place.end)
    if len(uses) == 1:
        yield Action(f"Inline '{node.name.name}'", "refactor.inline", (*edits, gone), name=node.name.name)
        return
    if found[1].role == "read":
        here = tuple(
            edit for edit in edits if edit.document is spot.document and edit.start == found[1].start
        )
        yield Action(f"Inline '{node.name.name}' here", "refactor.inline", here)
    title = f"Inline '{node.name.name}' everywhere ({len(uses)} places)"
    yield Action(title, "refactor.inline", (*edits, gone), name=node.name.name)


def _is_operator(use: Place) -> bool:
    """Whether the name stands in a production or an entry action."""
    block, base = use.document.text.block_at(use.start)
    for node in facts_of(block).file.definitions:
        for term in terms(node):
            if any(
                isinstance(item, syntax.Name) and item.span.start == use.start - base for item in term.items
            ):
                return True
    return False
