"""Scenes that can't work: semantic checks on the model.

model.Model → diagnostics. resolve has made sure that every name means something; here is what only shows when
rules, guards and parameters are looked at together. The larger checks stand in check_*.py. With a ``memory`` of earlier
checks, what a scene's unchanged nodes say isn't worked out again.

Example::

    check(model, diagnostics)
    # error[unassigned]: 'age' is read in Tree, but nothing has assigned it
"""

from __future__ import annotations

from .check_camera import check_camera
from .check_guards import check_guards
from .check_paths import check_paths
from .check_recursion import check_recursion
from .check_values import check_values
from .diagnostics import Diagnostic, Diagnostics
from .memory import Memory
from .model import Constant, Expression, Model, Symbol
from .resolve_names import ARTICLES
from .source import Span
from .view import View, read_by
from .walk import decided, is_open, parts, reads, ways


def check(model: Model, diagnostics: Diagnostics, memory: Memory | None = None) -> None:
    """Add what is wrong or suspicious with ``model``, which resolve made without errors (with errors the checks
    still run on what there is, but may say less)."""
    view = View(model, memory or Memory())
    _check_scene(model, diagnostics)
    check_values(view, diagnostics)
    for found in view.of_each(outcomes_of, view.symbols):
        diagnostics.items += found
    if not diagnostics.has_errors:
        check_paths(view, diagnostics)
        check_recursion(view, diagnostics)
        check_guards(view, diagnostics)
        check_camera(view, diagnostics)
    _check_unused(view, diagnostics)


def _check_scene(model: Model, diagnostics: Diagnostics) -> None:
    start = Span(model.source, 0, 0)
    if model.camera is None:
        hint = "write camera { location <0, -10, 5> sky <0, 0, 1> right <-4/3, 0, 0> look_at <0, 0, 0> }"
        diagnostics.add("no-camera", start, "the scene has no camera", hint)
    if not model.objects:
        names = [*model.symbols, "Tree"]
        diagnostics.add("no-object", start, "the scene has no object", f"to place a Selection, write object {{ {names[0]} }}")
    elif not model.lights:
        hint = "write light_source { <20, -30, 40> color rgb 1 }"
        diagnostics.add("no-light", start, "the scene has no light", hint)


# --- guards and weights


def outcomes_of(symbol: Symbol, seed: float) -> list[Diagnostic]:
    """Guards of literals, and symbols of which no rule can apply."""
    found = Diagnostics()
    said: set[int] = set()
    several = list(ways(symbol.production))
    for way in several:
        for test, _ in way.guards:
            if id(test) not in said:
                said.add(id(test))
                _literal_guard(test, seed, found)
    if not any(way.is_rule and is_open(way, seed) for way in several):
        named = {name for way in several for test, needed in way.guards if decided(test, seed) is (not needed) for name in _switches(test)}
        where = f" where {' and '.join(f'{name} is {value:g}' for name, value in sorted(named))}" if named else ""
        found.add("no-rule", symbol.name_span, f"no rule of '{symbol.name}' can apply{where}: it produces nothing")
    return found.items


def _switches(test: Expression) -> list[tuple[str, float]]:
    """The inputs and named constants of a guard, which may be something else in another run, with what they are."""
    constants = [part for part in parts(test) if isinstance(part, Constant) and part.span is not None]
    return [(part.span.text, part.value) for part in constants if part.span.text.isidentifier()]


def _literal_guard(test: Expression, seed: float, diagnostics: Diagnostics) -> None:
    """A guard of literals only; one of inputs and named constants is there to be switched."""
    if reads(test) or test.span is None:
        return
    constants = [part for part in parts(test) if isinstance(part, Constant)]
    if all(part.span is not None and part.span.text[:1] in "0123456789-" for part in constants):
        truth = decided(test, seed)
        if truth is not None:
            outcome = "true" if truth else "false"
            diagnostics.add("constant-guard", test.span, f"this guard is always {outcome}")


# --- names


def _check_unused(view: View, diagnostics: Diagnostics) -> None:
    """Definitions of the scene's own file that nothing uses. (Included files are libraries.)"""
    model, read = view.model, _read_parameters(view)
    own = model.source.name
    named = ("parameter", "selection")
    # Nearly all of a large scene goes here, so that the loop runs for few.
    suspects = [each for each in model.definitions.values() if not each.references or each.kind in named]
    for definition in suspects:
        name = definition.name
        if definition.span.source.name != own:
            continue
        if definition.kind == "parameter":
            if name not in read and definition.assignments:
                diagnostics.add("unused", definition.span, f"'{name}' is assigned but never read")
        elif definition.kind == "selection":
            if model.objects and name not in view.reached and name in model.symbols:
                message, hint = f"no object leads to the Selection '{name}'", f"to place it, write object {{ {name} }}"
                diagnostics.add("unreachable", definition.span, message, hint)
        elif not definition.references:
            diagnostics.add("unused", definition.span, f"'{name}' is {ARTICLES[definition.kind]} that nothing uses")


def _read_parameters(view: View) -> frozenset[str]:
    """The parameters that something reads, their own updates apart; those of operators that nothing uses count
    as read, since the operators themselves are reported."""
    read = view.ask_again(_union, view.of_productions(read_by, in_turn=True))
    return read.union(name for name in view.model.parameters if name not in view.writes)


def _union(several: list[frozenset[str]]) -> frozenset[str]:
    return frozenset().union(*several)
