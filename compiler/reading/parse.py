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
from .parse_rules import selection_body
from .parse_values import (
    MAX_DEPTH,
    Abandon,
    Reading,
    TooDeep,
    expression,
    name,
    need_parenthesis,
    statements,
    string,
)
from .source import Source, Span

if TYPE_CHECKING:
    from tree_sitter import Node, Tree

# More messages than this about one definition help nobody.
MAX_MESSAGES = 10


def parse(source: Source) -> tuple[syntax.File, Diagnostics]:
    """The syntax tree of ``source``, and the syntax errors in file order. Never raises for what the text holds."""
    diagnostics = Diagnostics()
    text = mistakes.clean(source, diagnostics)
    return convert(source, text, syntax_tree(text), diagnostics), diagnostics


def convert(source: Source, text: bytes, tree: Tree, diagnostics: Diagnostics) -> syntax.File:
    """The syntax tree from tree-sitter's tree of ``text``, which is ``mistakes.clean(source, …)``; syntax errors go to
    ``diagnostics``. For callers that keep the tree up to date by ``grammar.syntax_tree(text, old_tree)``."""
    reader = _FileReader(source, text, diagnostics)
    reader.file(tree)
    mistakes.extras(reader.reading, tree)
    diagnostics.items[:] = diagnostics.sorted()
    return syntax.File(Span(source, 0, len(source.data)), tuple(reader.definitions))


class _FileReader:
    """Collects the definitions of one file."""

    def __init__(self, source: Source, text: bytes, diagnostics: Diagnostics) -> None:
        self.reading = Reading(source, text, diagnostics)
        self.definitions: list[syntax.Definition] = []
        self.hoisted: list[Node] = []
        # The last definition that broke: what follows it, up to the next one that starts a line no deeper, may be
        # its debris, of which nothing is said.
        self.broken: Node | None = None

    def file(self, tree: Tree) -> None:
        items = self.reading.diagnostics.items
        root = tree.root_node
        before = len(items)
        for node in root.children:
            self.definition(node)
        if root.has_error and len(items) == before:
            found = mistakes.unmatched_bracket(self.reading, tree) or mistakes.unexpected(self.reading, root)
            items.append(found)

    def definition(self, node: Node) -> None:
        """Read one child of the file's root, or a definition found inside of a broken one."""
        if self.broken is not None:
            if node.type not in _DEFINITIONS or not self.starts_afresh(node):
                return
            self.broken = None
        if node.type == "ERROR":
            self.broken_file(node)
        elif node.type == "stray":
            text = self.reading.text(node)
            self.reading.complain(node, f"this '{text}' {'ends' if text in ';,' else 'closes'} nothing", "remove it")
            self.broken = node
        elif node.type in _DEFINITIONS:
            self.one_definition(node)

    def starts_afresh(self, node: Node) -> bool:
        """Whether ``node`` begins a line, no deeper than the definition that broke."""
        column = node.start_point[1]
        before = self.reading.data[node.start_byte - column : node.start_byte]
        return not before.strip() and (column == 0 or column <= self.broken.start_point[1])

    def broken_file(self, node: Node) -> None:
        """Text between definitions, perhaps with some that tree-sitter recognised inside."""
        items = self.reading.diagnostics.items
        inside = [child for child in node.children if child.type in _DEFINITIONS]
        error = mistakes.unexpected(self.reading, node, self.cut_short(node.prev_sibling))
        if not inside or error.span.start < inside[0].start_byte:
            items.append(error)
            self.broken = node
        for child in inside:
            self.definition(child)

    def cut_short(self, node: Node | None) -> Node | None:
        """The part of a definition that breaks off at its end, if one does."""
        if node is None or node.type not in _DEFINITIONS:
            return None
        body = node.child_by_field_name("body")
        if body is None:
            return node if node.children[-1].type != ";" else None
        return body if body.children[-1].type != "}" else None

    def one_definition(self, node: Node) -> None:
        items = self.reading.diagnostics.items
        before = len(items)
        try:
            found = _DEFINITIONS[node.type](self, node)
        except Abandon as error:
            items[before:] = []
            self.reading.complain(error.span, error.message, error.hint)
            found = None
            self.broken = node
        if found is not None:
            self.definitions.append(found)
        hoisted, self.hoisted = self.hoisted, []
        if node.has_error and self.broken is None:
            self.report_break(node, before, hoisted[0].start_byte if hoisted else None)
        following = node.next_sibling
        if following is not None and (following.type == "ERROR" or self.reading.text(following) in (")", "]")):
            # What is wrong at this definition's end comes from the text that broke it off.
            items[before:] = [item for item in items[before:] if item.code not in ("missing", "unclosed")]
        first_at = {item.span.start: item for item in reversed(items[before:])}
        items[before:] = sorted(first_at.values(), key=lambda item: item.span.start)[:MAX_MESSAGES]
        for child in hoisted:
            if self.is_sibling(child):
                self.definition(child if child.type == "block" else self.block_of_entry(child))

    def report_break(self, node: Node, before: int, end: int | None) -> None:
        """Add the place where ``node`` breaks to its messages, from ``before`` on, and leave out those that may
        only follow from it: later ones, and braces that the broken text may have swallowed."""
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

    # --- scene blocks

    def include(self, node: Node) -> syntax.Include | None:
        path = string(self.reading, node.child_by_field_name("path"))
        if path is None and not node.has_error:
            self.reading.complain(node, "this #include names no file", 'write #include "forest.plsys"', "missing")
        return path and syntax.Include(self.reading.span(node), path)

    def declare(self, node: Node) -> syntax.Declare | None:
        reading = self.reading
        keyword = node.children[0]
        if keyword.type == "#local":
            reading.complain(keyword, "#local isn't supported", "#declare does the same here", "unsupported")
        target = node.child_by_field_name("name")
        if target is None:
            self.name_of(node, "#declare Name = 1;")
            return None
        items = self.items(node.children_by_field_name("value"), 0)
        if not items:
            reading.complain(node, f"#declare {reading.text(target)} has no value",
                             f"write #declare {reading.text(target)} = 1;", "missing")
            return None
        if not any(child.type == "=" for child in node.children):
            reading.complain(reading.after(target.end_byte), "missing '=' after the declared name",
                             f"write #declare {reading.text(target)} = …", "missing")
        return syntax.Declare(reading.span(node), name(reading, target), items)

    def parameter(self, node: Node) -> syntax.ParameterDeclaration | None:
        reading = self.reading
        target = self.name_of(node, "Parameter age = 1;")
        if target is None:
            return None
        value = expression(reading, node.child_by_field_name("value"))
        if value is None:
            reading.complain(node, f"Parameter {target.name} has no value", f"write Parameter {target.name} = 1;",
                             "missing")
            return None
        low, high = self.range(node.child_by_field_name("range"))
        text = string(reading, node.child_by_field_name("text"))
        reading.need_semicolon(node, "this Parameter")
        return syntax.ParameterDeclaration(reading.span(node), target, value, low, high, text)

    def range(self, node: Node | None) -> tuple[syntax.Expression | None, syntax.Expression | None]:
        if node is None:
            return None, None
        self.reading.need_closer(node, "[", "]")
        for child in node.children:
            if child.type in (",", ":"):
                self.reading.complain(child, f"'{child.type}' stands where a range has 'to'", "write [0 to 20]")
        low = expression(self.reading, node.child_by_field_name("low"))
        return low, expression(self.reading, node.child_by_field_name("high"))

    def named_block(self, node: Node) -> syntax.Texture | syntax.Block | None:
        """``Texture Name { … }``. Any other word there is a misspelt one."""
        reading = self.reading
        kind, target, body = (node.child_by_field_name(field) for field in ("kind", "name", "body"))
        if broken := next((child for child in node.children if child.is_error), None):
            # Stray words before a block, of which the last became the block's kind.
            error = mistakes.unexpected(reading, broken)
            if error.hint == mistakes.DEFINITION:
                reading.complain(kind, f"'{reading.text(kind)}' is unexpected here", error.hint)
            else:
                reading.diagnostics.items.append(error)
            block_name = name(reading, target)
            return syntax.Block(reading.span(target).to(reading.span(body)), block_name, self.items(self.inside(body), 0))
        if reading.text(kind) != "Texture":
            if not body.has_error or reading.text(body).startswith("{"):
                reading.complain(kind, *mistakes.unknown_definition(reading.text(kind)))
                self.broken = node
            return None
        span = reading.span(node)
        block = syntax.Block(span, syntax.Name(reading.span(kind), "texture"), self.items(self.inside(body), 0))
        return syntax.Texture(span, name(reading, target), block)

    def block(self, node: Node, depth: int = 0) -> syntax.Block:
        if depth > MAX_DEPTH:
            raise TooDeep(self.reading.span(node))
        target, body = node.child_by_field_name("name"), node.child_by_field_name("body")
        return syntax.Block(self.reading.span(node), name(self.reading, target), self.items(self.inside(body), depth))

    def items(self, nodes: list[Node], depth: int) -> tuple[syntax.Item, ...]:
        """The items of a block, a map entry or a declaration."""
        found: list[syntax.Item] = []
        last = ","
        for node in nodes:
            kind = node.type
            if kind == "block":
                found.append(self.block(node, depth + 1))
            elif kind == "map_entry":
                self.reading.need_closer(node, "[", "]")
                found.append(syntax.MapEntry(self.reading.span(node), self.items(node.children, depth + 1)))
            elif kind == "stray":
                self.reading.complain(node, *mistakes.stray_in_block(self.reading.text(node)))
            elif kind == "," and last in (",", "{", "["):
                self.reading.complain(node, "this ',' separates nothing", "remove it")
            else:
                value = expression(self.reading, node, depth + 1)
                if value is not None:
                    found.append(value)
            last = kind
        return tuple(found)

    # --- PL-systems

    def selection(self, node: Node) -> syntax.Selection | None:
        target, body = self.header(node, "Name -> …;")
        if target is None:
            return None
        parameters = self.parameters(node)
        entry, productions = None, []
        if body is not None:
            before = len(self.reading.diagnostics.items)
            nodes = self.inside(body)
            entry, productions = selection_body(self.reading, nodes, target.name, self.block)
            if not productions and not node.has_error and len(self.reading.diagnostics.items) == before:
                self.reading.complain(target.span, f"Selection {target.name} has no rule", mistakes.RULE, "missing")
        return syntax.Selection(self.reading.span(node), target, parameters, entry, tuple(productions))

    def calculation(self, node: Node) -> syntax.Calculation | None:
        target, found = self.statements(node, "--count;")
        return target and syntax.Calculation(self.reading.span(node), target, found)

    def transformation(self, node: Node) -> syntax.Transformation | None:
        target, found = self.statements(node, "trans 0 0 1;")
        return target and syntax.Transformation(self.reading.span(node), target, found)

    def header(self, node: Node, example: str) -> tuple[syntax.Name, Node | None]:
        """Name and body of a definition; complains when the body is missing."""
        keyword = node.children[0]
        target = self.name_of(node, f"{keyword.type} Name {{ {example} }}")
        body = node.child_by_field_name("body")
        if body is None and not node.has_error and target is not None:
            self.reading.complain(self.reading.after(node.end_byte), f"{keyword.type} {target.name} has no body",
                                  f"write {keyword.type} {target.name} {{ {example} }}", "missing")
        return target, body

    def name_of(self, node: Node, example: str) -> syntax.Name | None:
        """The name after a definition's keyword; complains when there is none."""
        target = node.child_by_field_name("name")
        if target is not None:
            return name(self.reading, target)
        keyword = node.children[0]
        if not node.has_error:
            self.reading.complain(keyword, f"this {keyword.type} has no name", f"write {example}", "missing")
        return None

    def parameters(self, node: Node) -> tuple[syntax.Name, ...]:
        parameters = node.child_by_field_name("parameters")
        if parameters is None:
            return ()
        need_parenthesis(self.reading, parameters, parameters.children[0])
        return tuple(name(self.reading, child) for child in parameters.named_children if child.type == "name")

    def statements(self, node: Node, example: str) -> tuple[syntax.Name | None, tuple[syntax.Statement, ...]]:
        """Name and statements of a Calculation or Transformation."""
        target, body = self.header(node, example)
        keyword = node.children[0].type
        if self.parameters(node):
            self.reading.complain(node.child_by_field_name("parameters"), f"a {keyword} has no parameters",
                                  "only a Selection has; a Calculation assigns to names: { a = 1; }")
        if body is None or target is None:
            return target, ()
        before = len(self.reading.diagnostics.items)
        nodes = self.inside(body)
        for child in nodes:
            self.complain_foreign(child, keyword, example)
        found = statements(self.reading, nodes)
        if not found and not node.has_error and len(self.reading.diagnostics.items) == before:
            self.reading.complain(target.span, f"{keyword} {target.name} holds nothing",
                                  f"write {keyword} {target.name} {{ {example} }}", "missing")
        return target, found

    def complain_foreign(self, node: Node, keyword: str, example: str) -> None:
        """Complain about what parses inside of statements but has no place there."""
        if node.type == "stray":
            text = self.reading.text(node)
            self.reading.complain(node, f"this '{text}' {'ends' if text == ';' else 'separates'} nothing", "remove it")
        elif node.type == "block":
            self.reading.complain(node.children[0], f"a scene block can't stand in a {keyword}",
                                  f"write statements: {example}")
        elif node.type == "guard" and node.children[0].type != "else":
            self.reading.complain(node.children[0], f"'{node.children[0].type}' can't stand in a {keyword}",
                                  "write a = test ? b : c; or let a Selection choose between two of them")
        elif node.type == "braced":
            self.reading.complain(node.children[0], f"statements in a {keyword} don't nest", "remove the inner braces")

    # --- braces

    def inside(self, body: Node) -> list[Node]:
        """The children of a body in braces that belong to it.

        A body that is never closed swallows what follows, so there a block at the start of a line is taken to be a
        definition of its own: one missing brace costs no neighbour."""
        children = body.children
        if children[-1].type == "}" and not children[-1].is_missing:
            return children
        if children[0].is_missing:
            return []
        own = next((i for i, child in enumerate(children) if i > 0 and self.is_sibling(child)), len(children))
        self.hoisted += children[own:]
        self.reading.never_closed(self.unclosed_brace(body, children[own - 1]), "{", "}")
        return children[:own]

    def unclosed_brace(self, body: Node, last: Node) -> int:
        """Where the brace stands that is to blame for an unclosed body, whose last child is ``last``: if the '}' of a
        block in it starts a line further left than the block's own line does, it was meant for the body."""
        while last.children:
            last = last.children[-1]
            if last.type == "block_body" and last.children[-1].type == "}":
                closer = last.children[-1]
                if self.indent(closer) == closer.start_point[1] < self.indent(last.children[0]):
                    return last.start_byte
        return body.start_byte

    def indent(self, node: Node) -> int:
        """The number of blanks before the first word of the node's line."""
        start = node.start_byte - node.start_point[1]
        line = self.reading.data[start : node.end_byte]
        return len(line) - len(line.lstrip(b" \t"))

    def is_sibling(self, node: Node) -> bool:
        if node.start_point[1] != 0:
            return False
        return node.type == "block" or (node.type == "entry" and self.block_of_entry(node) is not None)

    @staticmethod
    def block_of_entry(node: Node) -> Node | None:
        """The block that is all of an entry: in an unclosed Selection, the next scene block."""
        while node.type in ("entry", "union", "term"):
            node = node.children[0]
        return node if node.type == "block" else None


_DEFINITIONS = {
    "include": _FileReader.include,
    "declare": _FileReader.declare,
    "parameter": _FileReader.parameter,
    "selection": _FileReader.selection,
    "calculation": _FileReader.calculation,
    "transformation": _FileReader.transformation,
    "named_block": _FileReader.named_block,
    "block": _FileReader.block,
}
