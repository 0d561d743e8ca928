"""The compiler's resolver, asked about one block.

Block and namespace → messages, each put to the block that it is about. It is the code that compiles scenes, so that
an editor is told what the compiler will say.

Example: ``BlockResolver(block, Router(messages), namespace.entries, namespace.nearest).run_on(facts_of(block))``
"""

from __future__ import annotations

from pathlib import Path
from typing import Callable

from ..reading import syntax
from ..reading.diagnostics import Diagnostic, Diagnostics
from ..reading.model import Constant, Empty, Operand, Variants
from ..reading.resolve import Resolver
from ..reading.resolve_names import Entry
from ..reading.source import Source, Span
from .facts import Facts, facts_of
from .text import Block

# Given a wrong name and the kinds that are wanted (None: any): a hint that names what is most like it.
Nearest = Callable[[str, tuple[str, ...] | None], str]


# What stands for what is left out: nobody looks at what a block comes to.
_ALWAYS = Constant(1.0)
_NOTHING = Variants(_ALWAYS)


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


class BlockResolver(Resolver):
    """Resolves in the namespace ``entries``. It is made anew for each block, so that what it remembers of one doesn't
    outlive it; values of constants stay in the entries. ``nearest`` finds names that are like a wrong one faster than
    by comparing all of them. Where ``places`` are given, rules, guards, terms and statements with none of them in it are known to be
    right and left out."""

    def __init__(
        self, block: Source, diagnostics: Diagnostics, entries: dict[str, Entry], nearest: Nearest | None = None,
        places: list[Span] | None = None,
    ) -> None:  # fmt: skip
        super().__init__(syntax.File(Span(block, 0, 0), ()), diagnostics, {}, 0.0, Source.read)
        self.names.entries = entries
        # Which entry actions run where decides no message, and the closure of all references costs too much per key.
        self.terms.reached = lambda name: frozenset()  # type: ignore[method-assign]
        if places is not None:
            self._leave_out(places)
        if nearest is not None:
            self._nearest, self._hints = nearest, {}
            self.names.nearest = self._hint  # type: ignore[method-assign]

    def _leave_out(self, places: list[Span]) -> None:
        production, test = self.rules._production, self.rules._test
        term, statement = self.terms.term, self.operators._statement

        def is_right(node: syntax.Node) -> bool:
            start, end = node.span.start, node.span.end
            for place in places:
                if start <= place.start and place.end <= end:
                    return False
            return True

        def whole(node: syntax.Term, owner: str) -> Operand:
            # The first problem of a term hides others, so that all of it is looked at.
            self.terms.term, self.operators._statement = term, statement  # type: ignore[method-assign]
            try:
                return term(node, owner)
            finally:
                leave_out()

        def leave_out() -> None:
            self.terms.term = lambda node, owner: Empty(node.span) if is_right(node) else whole(node, owner)  # type: ignore[method-assign]
            self.operators._statement = lambda node: _NOTHING if is_right(node) else statement(node)  # type: ignore[method-assign]

        leave_out()
        self.rules._test = lambda node: _ALWAYS if is_right(node) else test(node)  # type: ignore[method-assign]
        self.rules._production = (  # type: ignore[method-assign]
            lambda node, *rest: Empty(node.span) if is_right(node) else production(node, *rest)
        )

    def _hint(self, name: str, kinds: tuple[str, ...] | None) -> str:
        """A wrong name that stands in several places of a block is compared with others once."""
        key = (name, kinds)
        if key not in self._hints:
            self._hints[key] = self._nearest(name, kinds)
        return self._hints[key]

    def load_mesh(self, call: syntax.Call) -> int:
        """Meshes are loaded by the whole-file checks; here it is enough that the file is there."""
        if len(call.arguments) == 1 and isinstance(call.arguments[0], syntax.String):
            base = call.span.source.path
            if ((base.parent if base is not None else Path()) / call.arguments[0].value).is_file():
                return 0
        return super().load_mesh(call)

    def run_on(self, facts: Facts) -> None:
        """Resolve what ``facts``' block holds."""
        names = self.names
        for definition in facts.definitions:
            entry = names.entries.get(definition.name)
            if entry is None or entry.node is not definition.node:
                names._define(definition.node)  # says why it isn't in the namespace
                continue
            if isinstance(definition.node, syntax.Selection):
                self.rules.selection(definition.node)
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
