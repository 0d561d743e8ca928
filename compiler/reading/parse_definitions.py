"""Definitions: top-level nodes of tree-sitter's tree → definitions of :mod:`syntax`, with their scene blocks.

Example::

    reader = DefinitionReader(reading)
    reader.read(node)       # Block(Name('camera'), (Name('location'), Vector(…)))
    reader.take_hoisted()   # blocks that an unclosed brace swallowed, to be read as definitions of their own
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import mistakes, syntax
from .parse_rules import selection_body
from .parse_statements import statements
from .parse_values import (
    MAX_DEPTH,
    Abandon,
    Reading,
    TooDeep,
    expression,
    is_stray,
    name,
    need_parenthesis,
    string,
)

if TYPE_CHECKING:
    from tree_sitter import Node


class DefinitionReader:
    """Reads one definition after the other."""

    def __init__(self, reading: Reading) -> None:
        self.reading = reading
        self.hoisted: list[Node] = []

    def read(self, node: Node) -> syntax.Definition | None:
        """The definition at ``node``, whose type is in DEFINITIONS; None if it is too broken to be of use.
        Raises Abandon."""
        return DEFINITIONS[node.type](self, node)

    # --- scene blocks

    def include(self, node: Node) -> syntax.Include | None:
        path = string(self.reading, node.child_by_field_name("path"))
        if path is None and not node.has_error:
            self.reading.complain(
                node, "this #include names no file", 'write #include "forest.plsys"', "missing"
            )
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
            reading.complain(
                node,
                f"#declare {reading.text(target)} has no value",
                f"write #declare {reading.text(target)} = 1;",
                "missing",
            )
            return None
        if not any(child.type == "=" for child in node.children):
            reading.complain(
                reading.after(target.end_byte),
                "missing '=' after the declared name",
                f"write #declare {reading.text(target)} = …",
                "missing",
            )
        return syntax.Declare(reading.span(node), name(reading, target), items)

    def parameter(self, node: Node) -> syntax.ParameterDeclaration | None:
        reading = self.reading
        target = self.name_of(node, "Parameter age = 1;")
        if target is None:
            return None
        value = expression(reading, node.child_by_field_name("value"))
        if value is None:
            reading.complain(
                node,
                f"Parameter {target.name} has no value",
                f"write Parameter {target.name} = 1;",
                "missing",
            )
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
                self.reading.complain(
                    child, f"'{child.type}' stands where a range has 'to'", "write [0 to 20]"
                )
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
            return syntax.Block(
                reading.span(target).to(reading.span(body)), block_name, self.items(self.inside(body), 0)
            )
        if reading.text(kind) != "Texture":
            raise Abandon(reading.span(kind), *mistakes.unknown_definition(reading.text(kind)))
        span = reading.span(node)
        block = syntax.Block(
            span, syntax.Name(reading.span(kind), "texture"), self.items(self.inside(body), 0)
        )
        return syntax.Texture(span, name(reading, target), block)

    def block(self, node: Node, depth: int = 0) -> syntax.Block:
        if depth > MAX_DEPTH:
            raise TooDeep(self.reading.span(node))
        target, body = node.child_by_field_name("name"), node.child_by_field_name("body")
        return syntax.Block(
            self.reading.span(node), name(self.reading, target), self.items(self.inside(body), depth)
        )

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
            elif is_stray(node):
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
                self.reading.complain(
                    target.span, f"Selection {target.name} has no rule", mistakes.RULE, "missing"
                )
        is_whole = body is not None and not any(child.is_error for child in node.children)
        return syntax.Selection(
            self.reading.span(node), target, parameters, entry, tuple(productions), is_whole
        )

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
            self.reading.complain(
                self.reading.after(node.end_byte),
                f"{keyword.type} {target.name} has no body",
                f"write {keyword.type} {target.name} {{ {example} }}",
                "missing",
            )
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
            self.reading.complain(
                node.child_by_field_name("parameters"),
                f"a {keyword} has no parameters",
                "only a Selection has; a Calculation assigns to names: { a = 1; }",
            )
        if body is None or target is None:
            return target, ()
        before = len(self.reading.diagnostics.items)
        nodes = self.inside(body)
        for child in nodes:
            self.complain_foreign(child, keyword, example)
        found = statements(self.reading, nodes)
        if not found and not node.has_error and len(self.reading.diagnostics.items) == before:
            self.reading.complain(
                target.span,
                f"{keyword} {target.name} holds nothing",
                f"write {keyword} {target.name} {{ {example} }}",
                "missing",
            )
        return target, found

    def complain_foreign(self, node: Node, keyword: str, example: str) -> None:
        """Complain about what parses inside of statements but has no place there."""
        if is_stray(node):
            text = self.reading.text(node)
            self.reading.complain(
                node, f"this '{text}' {'ends' if text == ';' else 'separates'} nothing", "remove it"
            )
        elif node.type == "block":
            self.reading.complain(
                node.children[0], f"a scene block can't stand in a {keyword}", f"write statements: {example}"
            )
        elif node.type == "guard" and node.children[0].type != "else":
            self.reading.complain(
                node.children[0],
                f"'{node.children[0].type}' can't stand in a {keyword}",
                "write a = test ? b : c; or let a Selection choose between two of them",
            )
        elif node.type == "braced":
            self.reading.complain(
                node.children[0], f"statements in a {keyword} don't nest", "remove the inner braces"
            )

    # --- braces

    def inside(self, body: Node) -> list[Node]:
        """The children of a body in braces that belong to it.

        A body that is never closed swallows what follows, so there a block at the start of a line is taken to
        be a definition of its own: one missing brace costs no neighbour."""
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
        """Where the brace stands that is to blame for an unclosed body, whose last child is ``last``: if the
        '}' of a block in it starts a line further left than the block's own line does, it was meant for the
        body."""
        for _ in range(MAX_DEPTH):
            if not last.children:
                break
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

    def take_hoisted(self) -> list[Node]:
        """The definitions that the last one's unclosed brace swallowed."""
        found = [
            node if node.type == "block" else self.block_of_entry(node)
            for node in self.hoisted
            if self.is_sibling(node)
        ]
        self.hoisted = []
        return found

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


DEFINITIONS = {
    "include": DefinitionReader.include,
    "declare": DefinitionReader.declare,
    "parameter": DefinitionReader.parameter,
    "selection": DefinitionReader.selection,
    "calculation": DefinitionReader.calculation,
    "transformation": DefinitionReader.transformation,
    "named_block": DefinitionReader.named_block,
    "block": DefinitionReader.block,
}
