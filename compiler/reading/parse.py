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
from .parse_rules import RULE_EXAMPLE, selection_body
from .parse_values import (
    MAX_DEPTH,
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


def parse(source: Source) -> tuple[syntax.File, Diagnostics]:
    """The syntax tree of ``source``, and the syntax errors in file order. Never raises for what the text holds."""
    diagnostics = Diagnostics()
    text = mistakes.clean(source, diagnostics)
    return convert(source, syntax_tree(text), diagnostics)


def convert(source: Source, tree: Tree, diagnostics: Diagnostics) -> tuple[syntax.File, Diagnostics]:
    """The syntax tree from tree-sitter's; for callers that keep ``tree`` up to date themselves (an editor's
    server, by ``grammar.syntax_tree(text, old_tree)``). Adds to ``diagnostics``."""
    reader = _FileReader(source, diagnostics)
    for node in tree.root_node.children:
        reader.definition(node)
    mistakes.comments(reader.reading, tree)
    diagnostics.items[:] = diagnostics.sorted()
    span = Span(source, 0, len(source.data))
    return syntax.File(span, tuple(reader.definitions)), diagnostics


class _FileReader:
    """Collects the definitions of one file."""

    def __init__(self, source: Source, diagnostics: Diagnostics) -> None:
        self.reading = Reading(source, diagnostics)
        self.definitions: list[syntax.Definition] = []
        self.hoisted: list[Node] = []

    def definition(self, node: Node) -> None:
        """Read one child of the file's root. Of a broken one, what stands before the break is reported and the
        break itself, but nothing after it: that may only follow from the break."""
        items = self.reading.diagnostics.items
        before = len(items)
        read = _DEFINITIONS.get(node.type)
        if node.type == "stray":
            self.reading.complain(node, f"this '{self.reading.text(node)}' closes nothing", "remove it")
        elif node.type == "ERROR":
            for child in node.children:
                if child.type in _DEFINITIONS:
                    self.definition(child)
        elif read is not None:
            try:
                found = read(self, node)
            except TooDeep as error:
                self.reading.complain(error.span, "this is nested too deeply", f"the limit is {MAX_DEPTH} levels")
                return
            if found is not None:
                self.definitions.append(found)
        if node.has_error:
            error = mistakes.first_error(self.reading, node)
            if error is not None:
                items[before:] = [item for item in items[before:] if item.span.start < error.span.start]
                items.append(error)
        hoisted, self.hoisted = self.hoisted, []
        for child in hoisted:
            if self.is_sibling(child):
                self.definition(child if child.type == "block" else self.block_of_entry(child))

    # --- scene blocks

    def include(self, node: Node) -> syntax.Include | None:
        path = string(self.reading, node.child_by_field_name("path"))
        return path and syntax.Include(self.reading.span(node), path)

    def declare(self, node: Node) -> syntax.Declare | None:
        reading = self.reading
        keyword = node.children[0]
        if keyword.type == "#local":
            reading.complain(keyword, "#local isn't supported", "#declare does the same here", "unsupported")
        target = node.child_by_field_name("name")
        if not any(child.type == "=" for child in node.children):
            reading.complain(reading.after(target.end_byte), "missing '=' after the declared name",
                             f"write #declare {reading.text(target)} = …", "missing")
        items = self.items(node.children_by_field_name("value"), 0)
        if not items:
            reading.complain(node, f"#declare {reading.text(target)} has no value",
                             f"write #declare {reading.text(target)} = 1;", "missing")
            return None
        return syntax.Declare(reading.span(node), name(reading, target), items)

    def parameter(self, node: Node) -> syntax.ParameterDeclaration | None:
        reading = self.reading
        target = node.child_by_field_name("name")
        value = expression(reading, node.child_by_field_name("value"))
        if value is None:
            reading.complain(node, f"Parameter {reading.text(target)} has no value",
                             f"write Parameter {reading.text(target)} = 1;", "missing")
            return None
        low, high = self.range(node.child_by_field_name("range"))
        text = string(reading, node.child_by_field_name("text"))
        reading.need_semicolon(node, "this Parameter")
        return syntax.ParameterDeclaration(reading.span(node), name(reading, target), value, low, high, text)

    def range(self, node: Node | None) -> tuple[syntax.Expression | None, syntax.Expression | None]:
        if node is None:
            return None, None
        self.reading.need_closer(node, "[", "]")
        for child in node.children:
            if child.type in (",", ":"):
                self.reading.complain(child, f"'{child.type}' stands where a range has 'to'", "write [0 to 20]")
        low = expression(self.reading, node.child_by_field_name("low"))
        return low, expression(self.reading, node.child_by_field_name("high"))

    def named_block(self, node: Node) -> syntax.Texture | None:
        """``Texture Name { … }``. Any other word there is a misspelt one."""
        reading = self.reading
        kind = node.child_by_field_name("kind")
        if reading.text(kind) != "Texture":
            reading.complain(kind, *mistakes.unknown_definition(reading.text(kind)))
            return None
        return self.texture(node, kind, node.child_by_field_name("name"), node.child_by_field_name("body"))

    def texture(self, node: Node, kind: Node, target: Node, body: Node) -> syntax.Texture:
        span = self.reading.span(node)
        block = syntax.Block(span, syntax.Name(self.reading.span(kind), "texture"), self.items(self.inside(body), 0))
        return syntax.Texture(span, name(self.reading, target), block)

    def block(self, node: Node, depth: int = 0) -> syntax.Block:
        if depth > MAX_DEPTH:
            raise TooDeep(self.reading.span(node))
        target, body = node.children
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
        parameters = self.parameters(node)
        entry, productions = (None, [])
        if body is not None:
            nodes = self.inside(body)
            entry, productions = selection_body(self.reading, nodes, target.name, lambda _, block, depth: self.block(block, depth))
            if not productions and not node.has_error:
                self.reading.complain(target.span, f"Selection {target.name} has no rule", RULE_EXAMPLE, "missing")
        return syntax.Selection(self.reading.span(node), target, parameters, entry, tuple(productions))

    def calculation(self, node: Node) -> syntax.Calculation:
        target, found = self.statements(node, "--count;")
        return syntax.Calculation(self.reading.span(node), target, found)

    def transformation(self, node: Node) -> syntax.Transformation:
        target, found = self.statements(node, "trans 0 0 1;")
        return syntax.Transformation(self.reading.span(node), target, found)

    def header(self, node: Node, example: str) -> tuple[syntax.Name, Node | None]:
        """Name and body of a definition; complains when the body is missing."""
        target = name(self.reading, node.child_by_field_name("name"))
        body = node.child_by_field_name("body")
        if body is None and not node.has_error:
            self.reading.complain(self.reading.after(node.end_byte), f"{node.children[0].type} {target.name} has no body",
                                  f"write {node.children[0].type} {target.name} {{ {example} }}", "missing")
        return target, body

    def parameters(self, node: Node) -> tuple[syntax.Name, ...]:
        parameters = node.child_by_field_name("parameters")
        if parameters is None:
            return ()
        need_parenthesis(self.reading, parameters, parameters.children[0])
        return tuple(name(self.reading, child) for child in parameters.named_children if child.type == "name")

    def statements(self, node: Node, example: str) -> tuple[syntax.Name, tuple[syntax.Statement, ...]]:
        target, body = self.header(node, example)
        keyword = node.children[0].type
        if self.parameters(node):
            self.reading.complain(node.child_by_field_name("parameters"), f"a {keyword} has no parameters",
                                  "only a Selection has; a Calculation assigns to names: { a = 1; }")
        if body is None:
            return target, ()
        nodes = self.inside(body)
        for child in nodes:
            if child.type == "stray":
                self.reading.complain(child, f"this '{self.reading.text(child)}' ends nothing", "remove it")
            elif child.type == "block":
                self.reading.complain(child, f"a scene block can't stand in a {keyword}", f"write statements: {example}")
        found = statements(self.reading, nodes)
        if not found and not node.has_error:
            self.reading.complain(target.span, f"{keyword} {target.name} holds nothing",
                                  f"write {keyword} {target.name} {{ {example} }}", "missing")
        return target, found

    # --- braces

    def inside(self, body: Node) -> list[Node]:
        """The children of a body in braces that belong to it.

        A body that is never closed swallows what follows, so there a block at the start of a line is taken to be a
        definition of its own: one missing brace costs no neighbour."""
        children = body.children
        if children[-1].type == "}" and not children[-1].is_missing:
            return children
        self.reading.never_closed(body.start_byte, "{", "}")
        for i, child in enumerate(children):
            if i > 0 and self.is_sibling(child):
                self.hoisted += children[i:]
                return children[:i]
        return children

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
