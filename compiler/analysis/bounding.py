"""*Bound this recursion with a counter*: a Selection that may never end → one that ends after some rounds.

A new parameter counts the rounds: the entry action gives it its first value, each way back to the Selection counts it
down, and rules that lead back apply only while it is above 0. What the Selection produced in fewer rounds stays the same.

Example: ``Selection A { A -> box + T A; }`` becomes
``Selection A { [ rounds = 10 ] A; if (rounds > 0) A -> box + T [ --rounds ] A; }``.
"""

from __future__ import annotations

from typing import Iterator

from ..reading import syntax
from .actions import Spot, TextEdit, fresh_name, name_of, rules, terms, uses_at
from .document import Place
from .facts import facts_of
from .scene import Scene

ROUNDS = 10


def leads_back(scene: Scene, node: syntax.Selection) -> set[str]:
    """The Selections from which ``node`` is reached, itself among them if it is recursive."""
    start, found = node.name.name, set()
    waiting = [start]
    while waiting:
        for facts in scene.users.get(waiting.pop(), ()):
            for each in facts.definitions:
                is_new = isinstance(each.node, syntax.Selection) and each.name not in found
                if is_new and produced_names(each.node) & ({start} | found):
                    found.add(each.name)
                    waiting.append(each.name)
    return found


def _has_other_entrance(scene: Scene, node: syntax.Selection, back: set[str]) -> bool:
    """Whether another Selection of the recursion is entered from outside of it: references to ``node`` from there don't
    run its entry action, so the counter would have no value."""
    reached, waiting = set(), [node.name.name]
    while waiting:
        meaning = scene.meaning(waiting.pop())
        if meaning is not None and isinstance(meaning.node, syntax.Selection):
            new = produced_names(meaning.node) - reached
            reached |= new
            waiting += new
    others = (reached & back) - {node.name.name}
    return any(_owner(place) not in reached for name in others for place in uses_at(scene, name))


def _goes_round_elsewhere(scene: Scene, others: set[str]) -> bool:
    """Whether a way round leads through ``others`` only, where nothing would count."""
    for start in others:
        reached, waiting = set(), [start]
        while waiting:
            meaning = scene.meaning(waiting.pop())
            if meaning is not None and isinstance(meaning.node, syntax.Selection):
                new = (produced_names(meaning.node) & others) - reached
                reached |= new
                waiting += new
        if start in reached:
            return True
    return False


def _owner(place: Place) -> str:
    """The Selection round a place; '' for a scene block."""
    block, base = place.document.text.block_at(place.start)
    for node in facts_of(block).file.definitions:
        if isinstance(node, syntax.Selection) and node.span.start <= place.start - base < node.span.end:
            return node.name.name
    return ""


def produced_names(node: syntax.Selection) -> set[str]:
    """The names that a Selection's productions have."""
    bodies = (term for production in node.productions for term in terms(production))
    return {name.name for term in bodies for item in term.items if (name := name_of(item)) is not None}


def bounded(spot: Spot, node: syntax.Selection) -> list[TextEdit]:
    """The edits that bound the recursion of ``node``; none if it isn't recursive or nothing has a place for them."""
    back = leads_back(spot.scene, node)
    if node.name.name not in back or not node.productions or _has_other_entrance(spot.scene, node, back):
        return []
    if _goes_round_elsewhere(spot.scene, back - {node.name.name}):
        return []
    counter, base = fresh_name(spot.scene, "rounds"), spot.base
    edits = [_entry(spot, node, base, counter)]
    for production in node.productions:
        for rule, guard in rules(production):
            found = [
                item
                for alternative in rule.alternatives
                for term in terms(alternative.body)
                for item in term.items
                if (name := name_of(item)) is not None and name.name in back and item is term.items[-1]
            ]
            if not found:
                continue
            edits += [
                spot.edit(base + item.span.start, base + item.span.start, f"[ --{counter} ] ")
                for item in found
            ]
            if guard is None and any(rule is each for each in _takes_else(production)):
                return []
            if guard is None:
                edits.append(
                    spot.edit(base + rule.span.start, base + rule.span.start, f"if ({counter} > 0) ")
                )
                continue
            start, end = base + guard.test.span.start, base + guard.test.span.end
            needs_brackets = isinstance(guard.test, syntax.Conditional) or (
                isinstance(guard.test, syntax.Binary) and guard.test.operator == "||"
            )
            edits.append(spot.edit(start, start, f"{counter} > 0 && {'(' if needs_brackets else ''}"))
            if needs_brackets:
                edits.append(spot.edit(end, end, ")"))
    return sorted(edits, key=lambda edit: edit.start)


def _takes_else(node: syntax.Production | None, outer: bool = False) -> Iterator[syntax.Rule]:
    """The rules before which another `if` would take the `else` of one further out; ``outer``: there is such a one."""
    while isinstance(node, syntax.If):
        yield from _takes_else(node.then, outer or node.otherwise is not None)
        node = node.otherwise
    if node is not None and outer:
        yield node


def _entry(spot: Spot, node: syntax.Selection, base: int, counter: str) -> TextEdit:
    if node.entry is not None:
        at = base + node.entry.span.start
        return spot.edit(at, at, f"[ {counter} = {ROUNDS} ] ")
    at = base + node.productions[0].span.start
    text = spot.document.text
    before = text.slice(text.line_start(text.line_of(at)), at)
    gap = "\n" + before.decode() if not before.strip() else " "
    return spot.edit(at, at, f"[ {counter} = {ROUNDS} ] {node.name.name};{gap}")
