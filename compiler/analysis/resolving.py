"""The compiler's resolver, asked about one block.

Block and namespace → messages, each put to the block that it is about. It is the code that compiles scenes, so that
an editor is told what the compiler will say.

Example: ``BlockResolver(Router(messages), namespace.entries, namespace.nearest).run_on(facts_of(block))``
"""

from __future__ import annotations

from bisect import bisect_right
from operator import attrgetter
from pathlib import Path
from typing import Callable, Sequence

from ..reading import syntax
from ..reading.diagnostics import Diagnostic, Diagnostics
from ..reading.model import Calculate, Constant, Empty, Operand, Operator, Transform, Variants
from ..reading.problems import Problem
from ..reading.resolve import Resolver
from ..reading.resolve_names import Entry
from ..reading.source import Source, Span
from .facts import Facts, facts_of
from .text import Block

# Given a wrong name and the kinds that are wanted (None: any): a hint that names what is most like it.
Nearest = Callable[[str, tuple[str, ...] | None], str]


# What stands for what is left out: nobody looks at what a block comes to.
_NOTHING = Variants(Constant(1.0))
_OPERATORS: dict[str, Operator] = {"calculation": Calculate("", ()), "transformation": Transform("", ())}
_NO_SOURCE = Source.from_text("")
_START = attrgetter("span.start")


class Router(Diagnostics):
    """Puts each message to the block that it is about; of blocks with syntax errors, whose meaning can only be guessed
    at, it keeps none."""

    def __init__(self, messages: dict[Block, list[Diagnostic]]) -> None:
        super().__init__()
        self.messages = messages

    def keep(self, diagnostic: Diagnostic) -> None:
        block: Block = diagnostic.span.source  # type: ignore[assignment]
        if facts_of(block).is_broken:
            return
        known = self.messages.setdefault(block, [])
        what = diagnostic.code, diagnostic.span.start, diagnostic.message
        if not any((each.code, each.span.start, each.message) == what for each in known):
            known.append(diagnostic)


def _with_places(nodes: Sequence[syntax.Node], places: list[Span]) -> list[syntax.Node]:
    """Those of ``nodes``, which stand in text order, that have one of the places in them. Of thousands, few do."""
    found = set()
    for place in places:
        index = bisect_right(nodes, place.start, key=_START) - 1
        if index >= 0 and place.end <= nodes[index].span.end:
            found.add(index)
    return [nodes[index] for index in sorted(found)]


class BlockResolver(Resolver):
    """Resolves blocks in the namespace ``entries``, one after the other; what it remembers of one doesn't outlive it, and values
    of constants stay in the entries. ``nearest`` finds names that are like a wrong one faster than by comparing all of
    them."""

    def __init__(self, diagnostics: Diagnostics, entries: dict[str, Entry], nearest: Nearest | None = None) -> None:
        super().__init__(syntax.File(Span(_NO_SOURCE, 0, 0), ()), diagnostics, {}, 0.0, Source.read)
        self.names.entries = entries
        self._places: list[Span] | None = None
        # Which entry actions run where decides no message, and the closure of all references costs too much per key.
        self.terms.leads_to = lambda name, other: True  # type: ignore[method-assign]
        self.names.refer = lambda entry, span: None  # type: ignore[method-assign]
        # What is wrong with an operator or an entry action is said where its own block is resolved.
        self._own_operator, self._own_entry_action = self.operators.declared, self.terms.entry_action
        self.terms.entry_action = lambda node: ()  # type: ignore[method-assign]
        self.operators.declared = lambda entry: _OPERATORS[entry.kind]  # type: ignore[method-assign]
        self._leave_out()
        if nearest is not None:
            self.names.nearest = nearest  # type: ignore[method-assign]

    def _leave_out(self) -> None:
        """Let terms and statements without any of the places be skipped."""
        terms, operators, is_right = self.terms, self.operators, self._is_right
        union, statement = terms.union, operators._statement

        def touched_union(node: syntax.Union, owner: str) -> Operand:
            if (places := self._places) is None:
                return union(node, owner)
            touched = _with_places(node.terms, places)
            self._places = None  # the first problem of a term hides others, so that all of it is looked at
            for term in touched:
                try:
                    terms.term(term, owner)
                except Problem as problem:
                    problem.report(self.diagnostics)
            self._places = places
            return Empty(node.span)

        terms.union = touched_union  # type: ignore[method-assign]
        operators._statement = lambda node: _NOTHING if is_right(node) else statement(node)  # type: ignore[method-assign]

    def _is_right(self, node: syntax.Node) -> bool:
        """Whether ``node`` is known to be right, since it has none of the places that may be wrong."""
        if self._places is None:
            return False
        start, end = node.span.start, node.span.end
        for place in self._places:
            if start <= place.start and place.end <= end:
                return False
        return True

    def load_mesh(self, call: syntax.Call) -> int:
        """Meshes are loaded by the whole-file checks; here it is enough that the file is there."""
        if len(call.arguments) == 1 and isinstance(call.arguments[0], syntax.String):
            base = call.span.source.path
            if ((base.parent if base is not None else Path()) / call.arguments[0].value).is_file():
                return 0
        return super().load_mesh(call)

    def run_on(self, facts: Facts, places: list[Span] | None = None) -> None:
        """Resolve what ``facts``' block holds. Where ``places`` are given, all that has none of them in it is known to be right
        and left out."""
        self._places = places
        try:
            self._run_on(facts)
        finally:
            self.begin()

    def force(self, entry: Entry) -> None:
        node = entry.node
        if entry.kind in _OPERATORS:
            self._own_operator(entry)
        elif not isinstance(node, syntax.Selection):
            super().force(entry)
        elif node.entry is not None and not self._is_right(node.entry):
            self._own_entry_action(node)

    def _touched_rules(self, selection: syntax.Selection) -> None:
        """Resolve the guards and rules that have the places in them."""
        waiting = list(selection.productions)
        while waiting:
            production = waiting.pop()
            if self._is_right(production):
                continue
            if isinstance(production, syntax.If):
                if not self._is_right(production.test):
                    self.rules._test(production.test)
                waiting += [each for each in (production.then, production.otherwise) if each is not None]
            else:
                self.rules._rule(production, selection, 0)

    def _run_on(self, facts: Facts) -> None:
        names = self.names
        for definition in facts.definitions:
            entry = names.entries.get(definition.name)
            if entry is None or entry.node is not definition.node:
                names._define(definition.node)  # says why it isn't in the namespace
                continue
            if isinstance(definition.node, syntax.Selection):
                if self._places is None:
                    self.rules.selection(definition.node)
                else:
                    self._touched_rules(definition.node)
            elif entry.kind == "input" and not entry.failed:
                names.reporting(lambda: self.constant_of(entry, entry.definition.span), None)
            names.reporting(lambda: self.force(entry), None)
        for name in facts.assigned:
            names._assign(name)
        for block in facts.blocks:
            if block.name.name == "global_settings":
                names.reporting(lambda: self.blocks.global_settings(block, {}), None)
            else:
                names.reporting(lambda: self.block(block), None)
