"""Text → syntax tree: what a scene file says, and everything that is wrong with how it is written.

A tree-sitter parser (grammar/) reads the bytes; this module turns its tree into :mod:`syntax`. A file with
errors still gives a File, with everything in it that can be used.

Example::

    file, diagnostics = parse(Source.from_text("camera { location <0, 1, 2> }"))
    file.definitions[0].name.name       # 'camera'
    diagnostics.items                   # []
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import mistakes, syntax
from .diagnostics import Diagnostics
from .grammar import syntax_tree
from .ignore import check_ignores
from .parse_definitions import DEFINITIONS, DefinitionReader
from .parse_values import Abandon, Reading, is_stray
from .source import Source, Span

if TYPE_CHECKING:
    from tree_sitter import Node, Tree

# More messages than this about one definition help nobody.
MAX_MESSAGES = 10


def parse(source: Source) -> tuple[syntax.File, Diagnostics]:
    """The syntax tree of ``source``, and its syntax errors in file order. Never raises for what it holds."""
    diagnostics = Diagnostics()
    text = mistakes.clean(source, diagnostics)
    return convert(source, text, syntax_tree(text), diagnostics), diagnostics


def convert(
    source: Source, text: bytes, tree: Tree, diagnostics: Diagnostics, spans: list[Span] | None = None
) -> syntax.File:
    """The syntax tree from tree-sitter's tree of ``text``, which is ``mistakes.clean(source, …)``; syntax
    errors go to ``diagnostics``. For callers that keep the tree up to date, by
    ``grammar.syntax_tree(text, old_tree)``. Where there are no errors, ``spans`` gets every span of
    the syntax tree."""
    reader = _FileReader(Reading(source, text, diagnostics, spans))
    reader.file(tree)
    mistakes.extras(reader.reading, tree)
    sharpen(source, text, diagnostics)
    check_ignores(source, text, diagnostics)
    diagnostics.items[:] = diagnostics.sorted()
    return syntax.File(reader.reading.between(0, len(source.data)), tuple(reader.definitions))


def sharpen(source: Source, text: bytes, diagnostics: Diagnostics) -> None:
    """Let messages about habits from other languages take the place of vague ones."""
    if diagnostics.items:
        from . import habits  # many patterns, for texts with mistakes only

        habits.sharpen(source, text, diagnostics)


class _FileReader:
    """Collects the definitions of one file, and decides how much is said about a broken one."""

    def __init__(self, reading: Reading) -> None:
        self.reading = reading
        self.reader = DefinitionReader(self.reading)
        self.definitions: list[syntax.Definition] = []
        # The last definition that broke: what follows it, up to the next one that starts a line no deeper,
        # may be its debris, of which nothing is said.
        self.broken: Node | None = None

    def file(self, tree: Tree) -> None:
        items = self.reading.diagnostics.items
        before = len(items)
        # A stack, because definitions may be hoisted out of definitions that were hoisted themselves.
        nodes = tree.root_node.children[::-1]
        while nodes:
            nodes += self.definition(nodes.pop())[::-1]
        if tree.root_node.has_error and len(items) == before:
            found = mistakes.unmatched_bracket(self.reading, tree)
            items.append(found or mistakes.unexpected(self.reading, tree.root_node))

    def definition(self, node: Node) -> list[Node]:
        """Read one child of the file's root; returns nodes in it that are to be read like it."""
        if self.broken is not None:
            if node.type not in DEFINITIONS or not self.starts_afresh(node):
                return []
            self.broken = None
        if node.type == "ERROR":
            return self.broken_file(node)
        if is_stray(node):
            text = self.reading.text(node)
            self.reading.complain(
                node, f"this '{text}' {'ends' if text in ';,' else 'closes'} nothing", "remove it"
            )
            self.broken = node
        elif node.type in DEFINITIONS:
            return self.one_definition(node)
        return []

    def starts_afresh(self, node: Node) -> bool:
        """Whether ``node`` begins a line, no deeper than the definition that broke."""
        column = node.start_point[1]
        before = self.reading.data[node.start_byte - column : node.start_byte]
        return not before.strip() and (column == 0 or column <= self.broken.start_point[1])

    def broken_file(self, node: Node) -> list[Node]:
        """Text between definitions, perhaps with some that tree-sitter recognised inside."""
        items = self.reading.diagnostics.items
        inside = [child for child in node.children if child.type in DEFINITIONS]
        error = mistakes.unexpected(self.reading, node, self.cut_short(node.prev_sibling))
        if not inside or error.span.start < inside[0].start_byte:
            items.append(error)
            self.broken = node
        return inside

    def cut_short(self, node: Node | None) -> Node | None:
        """The part of a definition that breaks off at its end, if one does."""
        if node is None or node.type not in DEFINITIONS:
            return None
        body = node.child_by_field_name("body")
        if body is None:
            return node if node.children[-1].type != ";" else None
        return body if body.children[-1].type != "}" else None

    def one_definition(self, node: Node) -> list[Node]:
        items = self.reading.diagnostics.items
        before = len(items)
        try:
            found = self.reader.read(node)
        except Abandon as error:
            items[before:] = []
            self.reading.complain(error.span, error.message, error.hint)
            found = None
            self.broken = node
        if found is not None:
            self.definitions.append(found)
        hoisted = self.reader.take_hoisted()
        if node.has_error and self.broken is None:
            self.report_break(node, before, hoisted[0].start_byte if hoisted else None)
        if self.broken is None and self.is_broken_off(node):
            # What is wrong at this definition's end comes from the text that broke it off.
            items[before:] = [item for item in items[before:] if item.code not in ("missing", "unclosed")]
        first_at = {item.span.start: item for item in reversed(items[before:])}
        items[before:] = sorted(first_at.values(), key=lambda item: item.span.start)[:MAX_MESSAGES]
        return hoisted

    def is_broken_off(self, node: Node) -> bool:
        """Whether text that makes no sense follows, so that ``node`` may have ended too early."""
        following = node.next_sibling
        if following is None or following.type == "ERROR":
            return following is not None
        return following.type == "stray" and self.reading.text(following) in (")", "]")

    def report_break(self, node: Node, before: int, end: int | None) -> None:
        """Add the place where ``node`` breaks to its messages, from ``before`` on, and leave out those that
        may only follow from it: later ones, and braces that the broken text may have swallowed."""
        items = self.reading.diagnostics.items
        found = mistakes.first_error(self.reading, node, end)
        if found is None:
            return
        items[before:] = [item for item in items[before:] if item.span.start != found.diagnostic.span.start]
        place = found.diagnostic.span
        line = place.start_position.line
        kept = [item for item in items[before:] if item.span.start < place.start]
        if found.is_gap:
            later = [item for item in items[before:] if item.span.start_position.line > line]
            items[before:] = [*kept, found.diagnostic, *later]
            return
        self.broken = node
        kept = [item for item in kept if item.code != "unclosed" or item.span.text != "{"]
        on_line = [item for item in kept if item.span.start_position.line == line]
        if all(item.code == "missing" for item in on_line):
            kept = [item for item in kept if item not in on_line] + [found.diagnostic]
        items[before:] = kept
