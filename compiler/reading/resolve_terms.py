"""Productions' terms: operators, operands and references to Selections.

A reference to X in a production of Y runs X's entry action iff Y can't be reached from X; ``object`` always runs
it. Reachability is static: it follows every reference, whatever its guard.

Example: with ``C_init Tree;`` as its entry action, ``object { Tree }`` is
``Prefixed(Calculate('C_init', …), Enter('Tree'))`` and the ``Tree`` in Tree's own rules is ``Enter('Tree')``.
"""

from __future__ import annotations

from typing import Callable

from . import syntax, vocabulary
from .blocks_in_rules import block_in_rule, union_in_rule
from .diagnostics import Note
from .meanings import Record
from .model import (
    Assign,
    Calculate,
    Constant,
    Empty,
    Enter,
    MeshLeaf,
    Operand,
    Operator,
    Prefixed,
    Primitive,
    Sum,
)
from .problems import Problem
from .resolve_expressions import RULES, Expressions, Scope
from .resolve_names import Entry, Names, terms_of
from .resolve_operators import Operators
from .resolve_textures import Textures
from .source import Span
from .walk import reached_from

OPERAND_KINDS = ("selection", "primitive")


class Terms:
    """``mesh`` loads a mesh file and gives its index."""

    def __init__(
        self,
        names: Names,
        expressions: Expressions,
        operators: Operators,
        textures: Textures,
        mesh: Callable[[syntax.Call], int],
    ) -> None:
        self.names, self.expressions, self.operators = names, expressions, operators
        self.textures, self.mesh = textures, mesh
        self.begin()

    def begin(self) -> None:
        """Start with the Selections of another scene."""
        self._entry_actions: dict[str, tuple[Operator, ...]] = {}
        self._all_edges: dict[str, set[str]] | None = None
        self._same_edges: bool | None = None
        self._reached: dict[str, frozenset[str]] = {}

    def union(self, node: syntax.Union, owner: str) -> Operand:
        terms = tuple(
            self.names.reporting(lambda: self.term(term, owner), Empty(term.span)) for term in node.terms
        )
        return terms[0] if len(terms) == 1 else Sum(terms, node.span)

    def term(self, node: syntax.Term, owner: str) -> Operand:
        if not node.items:
            return Empty(node.span)
        *prefixes, last = node.items
        operators: list[tuple[Operator, Span]] = []
        for item in prefixes:
            operators += [(operator, item.span) for operator in self._operators(item)]
        operand = self.operand(last, owner, RULES)
        for operator, span in reversed(operators):
            operand = Prefixed(operator, operand, span)
        return operand

    def _operators(self, item: syntax.Node) -> list[Operator]:
        """The operators that ``item``, not the last of its term, stands for."""
        if isinstance(item, syntax.Inline):
            return self.operators.inline(item)
        if isinstance(item, syntax.Group):
            raise Problem(
                "wrong-kind",
                item.span,
                "a group in brackets is an operand: nothing can follow it",
                "join with '+'",
            )
        if isinstance(item, syntax.Block):
            raise block_in_rule(item, self.expressions)
        name = item.name if isinstance(item, syntax.Call) else item
        assert isinstance(name, syntax.Name)
        if name.name in vocabulary.PRIMITIVES or self._is(name, "selection"):
            what = "a primitive" if name.name in vocabulary.PRIMITIVES else "a Selection"
            hint = "join operands with '+'; operators are Calculations, Transformations and textures"
            raise Problem(
                "wrong-kind", item.span, f"'{name.name}' is {what}, an operand: nothing can follow it", hint
            )
        if name.name in vocabulary.OPERATIONS:
            hint = f"write [ {vocabulary.OPERATIONS[name.name].signature} ], or name it: Transformation T {{ … }}"
            raise Problem(
                "wrong-kind", name.span, f"the operation '{name.name}' stands outside of brackets", hint
            )
        entry = self.names.find(name, ("calculation", "transformation", "texture"), "an operator")
        if isinstance(item, syntax.Call):
            hint = "only Selections take arguments; assign before: [ a = 1 ]"
            raise Problem("wrong-arguments", item.span, f"'{name.name}' takes no arguments", hint)
        if entry.kind == "texture":
            return [self.textures.paint(entry, name.span)]
        return [self.operators.declared(entry)]

    def operand(self, item: syntax.Node, owner: str, scope: Scope) -> Operand:
        """What ``item`` stands for at the end of a term in a rule of ``owner`` ('' for a scene object)."""
        if isinstance(item, syntax.Group):
            return self.union(item.union, owner)
        if isinstance(item, syntax.Inline):
            raise Problem(
                "missing",
                item.span,
                "the operators in brackets have nothing to act on",
                "write an operand after them",
            )
        if isinstance(item, syntax.Block):
            raise block_in_rule(item, self.expressions)
        name = item.name if isinstance(item, syntax.Call) else item
        assert isinstance(name, syntax.Name)
        arguments = item.arguments if isinstance(item, syntax.Call) else ()
        if name.name == "mesh" and isinstance(item, syntax.Call):
            return MeshLeaf(self.mesh(item), item.span)
        if name.name in vocabulary.PRIMITIVES:
            return self._primitive(name, item.span, arguments, scope)
        if name.name == "union" and isinstance(item, syntax.Call):
            raise union_in_rule(item)
        if name.name == "plane":
            hint = "planes are endless: write plane { … } as a scene block, or use square"
            raise Problem("wrong-kind", name.span, "a plane can't be produced by rules", hint)
        entry = self.names.entries.get(name.name)
        if entry is not None and entry.kind in ("calculation", "transformation", "texture"):
            self.names.find(name, (entry.kind,), "an operator")
            message = f"the operator '{name.name}' has nothing to act on"
            raise Problem(
                "missing", name.span, message, "write an operand after it: a Selection or a primitive"
            )
        entry = self.names.find(name, OPERAND_KINDS, "a Selection or a primitive")
        return self.enter(entry, item.span, arguments, owner, scope)

    def _primitive(self, name: syntax.Name, span: Span, arguments: tuple, scope: Scope) -> Operand:
        row = vocabulary.PRIMITIVES[name.name]
        if not row.accepts(len(arguments)):
            message = f"{row.name} takes {row.expected}, not {len(arguments)}"
            raise Problem("wrong-arguments", span, message, f"write {row.signature}")
        numbers = tuple(self.expressions.number(argument, scope) for argument in arguments)
        for number, argument in zip(numbers, arguments):
            if isinstance(number, Constant) and row.range is not None and number.value not in row.range:
                message = f"{row.name}'s argument must be {row.range}, not {number.value:g}"
                raise Problem("wrong-value", argument.span, message)
        if row.name == "cone" and not numbers:
            numbers = (Constant(0.0, span),)
        return Primitive(row.name, numbers, span)

    # --- references to Selections

    def enter(self, entry: Entry, span: Span, arguments: tuple, owner: str, scope: Scope) -> Operand:
        """A reference from a rule of ``owner`` ('' from a scene object): arguments, entry action, Enter."""
        node = entry.node
        assert isinstance(node, syntax.Selection)
        name = entry.definition.name
        operand: Operand = Enter(name, span)
        if not owner or not self.leads_to(name, owner):
            for operator in reversed(self.entry_action(node)):
                operand = Prefixed(operator, operand, span)
        if len(arguments) != len(node.parameters) and node.is_whole:
            wanted = ", ".join(parameter.name for parameter in node.parameters)
            counted = f"{len(node.parameters)} argument{'s' * (len(node.parameters) != 1)}"
            message = f"{name} takes {counted if node.parameters else 'no arguments'}, not {len(arguments)}"
            hint = f"write {name}({wanted})" if wanted else f"write {name}"
            raise Problem(
                "wrong-arguments", span, message, hint, (Note(node.name.span, f"'{name}' is defined here"),)
            )
        if arguments:
            values = [self.expressions.number(argument, scope) for argument in arguments]
            pairs = zip(node.parameters, values, arguments)
            assigns = tuple(
                Assign(parameter.name, value, argument.span) for parameter, value, argument in pairs
            )
            operand = Prefixed(Calculate("", assigns, together=True, span=span), operand, span)
        return operand

    def entry_action(self, node: syntax.Selection) -> tuple[Operator, ...]:
        """The Calculations of the entry action, outermost first; reported once."""
        name = node.name.name
        if name not in self._entry_actions:
            self._entry_actions[name] = ()
            if node.entry is not None:
                outer, self.names.record = self.names.record, Record()  # it isn't part of what asks first
                self._entry_actions[name] = self.names.reporting(lambda: self._entry_action(node), ())
                self.names.record = outer
        return self._entry_actions[name]

    def forget(self, name: str) -> None:
        """Let the entry action of a Selection be made anew."""
        self._entry_actions.pop(name, None)

    def _entry_action(self, node: syntax.Selection) -> tuple[Operator, ...]:
        assert node.entry is not None
        *prefixes, last = node.entry.items
        if not isinstance(last, syntax.Name) or last.name != node.name.name:
            hint = f"write C_init {node.name.name}; with a Calculation of yours"
            raise Problem("wrong-kind", last.span, "an entry action ends with its Selection's own name", hint)
        operators: list[Operator] = []
        for item in prefixes:
            for operator in self._operators(item):
                if not isinstance(operator, Calculate):
                    raise Problem("wrong-kind", item.span, "an entry action is made of Calculations only")
                operators.append(operator)
        return tuple(operators)

    def leads_to(self, name: str, other: str) -> bool:
        """Whether productions lead from one Selection to another, or through a cycle to itself."""
        answer = other in self.reached(name)
        self.names.record.reached.append((name, other, answer))
        return answer

    def reached(self, name: str) -> frozenset[str]:
        """The Selections that productions lead to from ``name``; itself only through a cycle."""
        if name not in self._reached:
            edges = self.edges()
            self._reached[name] = reached_from(edges[name], edges)
        return self._reached[name]

    def has_same_edges(self) -> bool:
        """Whether Selections lead to each other as they did when their meanings were kept."""
        if self._same_edges is None:
            self._same_edges = self.names.meanings is not None and self.names.meanings.edges == self.edges()
        return self._same_edges

    def edges(self) -> dict[str, set[str]]:
        """The Selections that each one's productions end with."""
        if self._all_edges is None:
            selections = ((name, entry.node) for name, entry in self.names.entries.items())
            self._all_edges = {name: self.ends_of(node) for name, node in selections if isinstance(node, syntax.Selection)}
        return self._all_edges

    def ends_of(self, node: syntax.Selection) -> set[str]:
        """The Selections that the productions of one end with."""
        meanings = self.names.meanings
        named = meanings.once(node, "ends", lambda: _ends(node)) if meanings is not None else _ends(node)
        return {end.name for end in named if self._is(end, "selection")}

    def _is(self, name: syntax.Name, kind: str) -> bool:
        entry = self.names.entries.get(name.name)
        return entry is not None and entry.kind == kind


def _ends(node: syntax.Selection) -> tuple[syntax.Name, ...]:
    """The names that the terms of a Selection's productions end with."""
    lasts = [term.items[-1] for term in terms_of(node) if term is not node.entry and term.items]
    targets = [last.name if isinstance(last, syntax.Call) else last for last in lasts]
    return tuple(target for target in targets if isinstance(target, syntax.Name))
