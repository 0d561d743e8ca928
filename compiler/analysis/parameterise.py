"""*Turn into parameterised symbol*: what the entry action of a Selection assigns → parameters of the Selection.

The values of the entry action become the arguments where the symbol is entered from outside, and its own recursion passes
the parameters on; an operator before such a reference that does nothing but change one of them becomes its argument.
That is the same derivation, since arguments are evaluated in the caller's scope, and only where the entry action
would have run.

Example: ``object { A } Selection A { [ n = 3 ] A; if (n > 0) A -> box + T [ --n ] A; }`` becomes
``object { A(3) } Selection A(n) { if (n > 0) A -> box + T A(n - 1); }``.
"""

from __future__ import annotations

from typing import Iterator, NamedTuple

from ..reading import syntax, vocabulary
from .actions import Action, Spot, TextEdit, terms, uses_at
from .bounding import produced_names
from .document import Place
from .facts import facts_of
from .scene import Scene

_STEPS = {"++": "+", "--": "-", "+=": "+", "-=": "-", "*=": "*", "/=": "/"}


class _Use(NamedTuple):
    """A reference to the symbol: its place, and the inline operator just before it (None: another thing, or nothing)."""

    place: Place
    operator: syntax.Inline | None
    base: int
    owner: str  # the Selection in whose productions it stands; '' in a scene block


def parameterised(spot: Spot, node: syntax.Selection) -> Iterator[Action]:
    """The action, if the symbol has no parameters yet and its entry action is made of simple assignments."""
    start = _entry(spot, node)
    uses = _uses(spot.scene, node.name.name)
    if node.parameters or start is None or uses is None:
        return
    values, gone = start
    name, names = node.name.name, list(values)
    inside = _reachable(spot.scene, name)
    edits = list(gone)
    head = spot.base + node.name.span.end
    edits.append(spot.edit(head, head, f"({', '.join(names)})"))
    for use in uses:
        current = dict(zip(names, names)) if use.owner in inside else values
        begin = use.place.start
        if use.owner in inside and use.operator is not None and (changed := _changed(use.operator, names)):
            current = {**current, changed[0]: changed[1]}
            begin = use.base + use.operator.span.start
        edits.append(
            TextEdit(
                use.place.document, begin, use.place.end, f"{name}({', '.join(current[n] for n in names)})"
            )
        )
    title = f"Turn into the parameterised symbol {name}({', '.join(names)})"
    yield Action(title, "refactor.rewrite", tuple(edits), name=name)


def _entry(spot: Spot, node: syntax.Selection) -> tuple[dict[str, str], list[TextEdit]] | None:
    """What the entry action assigns, as texts, and the edits that take it away. None if it does anything else than to assign
    values once each that are the same in the caller's scope."""
    entry = node.entry
    if entry is None or len(entry.items) != 2:
        return None
    operator = entry.items[0]
    end = spot.base + entry.span.end
    rest = spot.slice(end, spot.base + node.span.end)
    end += len(rest) - len(rest.lstrip()) + 1 if rest.lstrip().startswith(";") else 0
    edits = [spot.cut(spot.base + entry.span.start, end)]
    if isinstance(operator, syntax.Inline):
        statements = operator.statements
    else:
        meaning = spot.scene.meaning(operator.name) if isinstance(operator, syntax.Name) else None
        if (
            meaning is None
            or not isinstance(meaning.node, syntax.Calculation)
            or len(meaning.definitions) != 1
        ):
            return None
        if len(uses_at(spot.scene, operator.name)) != 1 or facts_of(meaning.node.span.source).is_broken:
            return None
        statements = meaning.node.statements
        place = spot.scene.place(meaning.node.span)
        assert place is not None
        edits.append(Spot(spot.scene, place.document, place.start, place.end).cut(place.start, place.end))
    values: dict[str, str] = {}
    for statement in statements:
        if (
            not isinstance(statement, syntax.Assignment)
            or statement.operator != "="
            or statement.target.name in values
        ):
            return None
        if not _is_constant(spot.scene, statement.value):
            return None
        values[statement.target.name] = statement.value.span.text
    return (values, edits) if values else None


def _is_constant(scene: Scene, value: syntax.Expression | None) -> bool:
    """Whether a value is the same wherever it is evaluated: made of numbers, constants and functions without chance."""
    match value:
        case syntax.Number():
            return True
        case syntax.Name():
            entry = scene.entries.get(value.name)
            return vocabulary.kind_of(value.name) == "constant" or (
                entry is not None and entry.kind in ("value", "input")
            )
        case syntax.Unary():
            return _is_constant(scene, value.operand)
        case syntax.Binary():
            return _is_constant(scene, value.left) and _is_constant(scene, value.right)
        case syntax.Call():
            return value.name.name != "rand" and all(_is_constant(scene, each) for each in value.arguments)
    return False


def _uses(scene: Scene, name: str) -> list[_Use] | None:
    """All references but that of the entry action; None if one stands where arguments can't follow."""
    found = []
    for place in uses_at(scene, name):
        block, base = place.document.text.block_at(place.start)
        if facts_of(block).is_broken:
            return None
        use = next(
            (u for node in facts_of(block).file.definitions for u in _uses_in(node, place, base)), None
        )
        if use is None:
            return None
        if use.owner != "entry":
            found.append(use)
    return found


def _uses_in(node: syntax.Definition, place: Place, base: int) -> Iterator[_Use]:
    at = place.start - base
    if isinstance(node, syntax.Block) and node.name.name == "object":
        if node.items and isinstance(node.items[0], syntax.Name) and node.items[0].span.start == at:
            yield _Use(place, None, base, "")
    if not isinstance(node, syntax.Selection):
        return
    if node.entry is not None and node.entry.span.start <= at < node.entry.span.end:
        yield _Use(place, None, base, "entry")
        return
    for term in terms(node):
        items = term.items
        if isinstance(items[-1], syntax.Name) and items[-1].span.start == at:
            before = items[-2] if len(items) > 1 and isinstance(items[-2], syntax.Inline) else None
            yield _Use(place, before, base, node.name.name)


def _changed(operator: syntax.Inline, names: list[str]) -> tuple[str, str] | None:
    """The parameter that an inline operator changes, and its new value; None if it does anything else."""
    if len(operator.statements) != 1 or not isinstance(operator.statements[0], syntax.Assignment):
        return None
    statement = operator.statements[0]
    name, value = statement.target.name, statement.value
    if name not in names or (value is not None and "rand" in value.span.text):
        return None  # (a draw stays where its ordinal is counted)
    if statement.operator == "=":
        return (name, value.span.text) if value is not None else None
    written = "1" if value is None else value.span.text
    if isinstance(value, syntax.Binary | syntax.Conditional | syntax.Unary):
        written = f"({written})"
    return name, f"{name} {_STEPS[statement.operator]} {written}"


def _reachable(scene: Scene, name: str) -> set[str]:
    """The Selections that ``name`` leads to, itself included: their references to it don't run its entry action."""
    found, waiting = {name}, [name]
    while waiting:
        meaning = scene.meaning(waiting.pop())
        if meaning is None or not isinstance(meaning.node, syntax.Selection):
            continue
        new = produced_names(meaning.node) - found
        found |= new
        waiting += new
    return found
