"""Names that enter random keys: entering a symbol mixes its name into the key, and so does a Calculation with `variants`.
Another name for one of them gives other random numbers below it, and so other plants.

Example: in ``Selection Tree { Tree -> [ roty 360*rand(0) ] Leaf; }`` 'Tree' enters a key that a draw reads; 'Leaf' with
``Leaf -> box;`` enters one that nothing reads.
"""

from __future__ import annotations

from ..reading import syntax
from .actions import rules
from .facts import facts_of
from .scene import Scene


def enters_keys(scene: Scene, name: str) -> bool:
    """Whether renaming ``name`` would change what is drawn at random."""
    meaning = scene.meaning(name)
    node = meaning.node if meaning is not None else None
    if isinstance(node, syntax.Calculation):
        return has_variants(node.statements)
    return isinstance(node, syntax.Selection) and _draws(scene, name)


def _draws(scene: Scene, name: str) -> bool:
    """Whether what a definition leads to draws."""
    waiting, seen = [name], {name}
    while waiting:
        meaning = scene.meaning(waiting.pop())
        if meaning is None or meaning.node is None:
            continue
        node = meaning.node
        if isinstance(node, syntax.Selection) and any(
            len(rule.alternatives) > 1 for production in node.productions for rule, _ in rules(production)
        ):
            return True
        facts = facts_of(node.span.source)  # type: ignore[arg-type]
        used = {each.name for each in facts.names if node.span.start <= each.start < node.span.end}
        if "rand" in used:
            return True
        waiting += used - seen
        seen |= used
    return False


def has_variants(statements: tuple[syntax.Statement, ...]) -> bool:
    """Whether the name of what has these statements, or that it has none, is part of random keys."""
    return any(isinstance(each, syntax.Operation) and each.name.name == "variants" for each in statements)
