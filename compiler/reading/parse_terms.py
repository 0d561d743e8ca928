"""The right-hand side of a rule: alternatives, and the unions and terms in them.

Example: ``3: T_up A + box | 1: sphere`` is two alternatives; the first has weight 3 and a union of two terms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import syntax
from .parse_statements import statements
from .parse_values import MAX_DEPTH, Reading, TooDeep, call, expression, is_stray, name

if TYPE_CHECKING:
    from collections.abc import Callable

    from tree_sitter import Node


class RightSides:
    """Reads right-hand sides; ``block`` reads a scene block inside a rule."""

    def __init__(self, reading: Reading, block: Callable[[Node, int], syntax.Block]) -> None:
        self.reading, self.read_block = reading, block

    def alternatives(self, node: Node, late: list[Node]) -> tuple[syntax.Alternative, ...]:
        """The alternatives of a rule; one empty one for ``A -> ;``."""
        nodes = [child for child in node.children if child.type == "alternative"]
        found = [self.alternative(child) for child in nodes]
        for child in node.children:
            if is_stray(child):
                self.reading.complain(
                    child, "an alternative is missing after this '|'", "write A -> 3: x | 1: y;"
                )
        if not found:
            return (syntax.Alternative(self.reading.span(node), None, None),)
        unweighted = [each for each in found if each.weight is None]
        if len(found) > 1 and unweighted and not node.has_error:
            self.reading.complain(
                unweighted[0].span, "this alternative has no weight", "write A -> 3: x | 1: y;"
            )
        return tuple(found)

    def alternative(self, node: Node) -> syntax.Alternative:
        weight_node = node.child_by_field_name("weight")
        weight = expression(self.reading, weight_node)
        body_node = node.child_by_field_name("body")
        body = self.union(body_node, 0) if body_node is not None else None
        return syntax.Alternative(self.reading.span(node), weight, body)

    def union(self, node: Node, depth: int) -> syntax.Union | None:
        if depth > MAX_DEPTH:
            raise TooDeep(self.reading.span(node))
        terms = []
        for child in node.children:
            if child.type == "term":
                term = self.term(child, depth)
                if term is not None:
                    terms.append(term)
            elif is_stray(child):
                self.reading.complain(
                    child, "nothing stands after this '+'", "add an operand, or remove the '+'"
                )
        return syntax.Union(self.reading.span(node), tuple(terms)) if terms else None

    def term(self, node: Node, depth: int) -> syntax.Term | None:
        items = []
        strays = [child for child in node.children if is_stray(child)]
        if strays:
            self.complain_stray(strays[0])
        for child in node.children:
            item = self.item(child, depth)
            if item is not None:
                items.append(item)
        return syntax.Term(self.reading.span(node), tuple(items)) if items else None

    def complain_stray(self, node: Node) -> None:
        text, following = self.reading.text(node), node.next_sibling
        rest = self.reading.data[node.start_byte :].partition(b";")[0].partition(b"|")[0]
        if b":" in rest and node.parent.start_byte == node.start_byte:
            hint = "a weight is a number, a name or a call: A -> 3: x | f(n): y;"
        elif text == "-" and (following is None or following.type != "stray"):
            hint = "only '+' joins what a rule produces"
        elif text[0].isdigit() or text[0] in ".<-":
            hint = "an operation with arguments stands in square brackets: [trans 0 0 1] Tree"
        else:
            hint = "'+' joins what a rule produces"
        self.reading.complain(node, f"'{text}' can't stand in a rule", hint)

    def item(
        self, node: Node, depth: int
    ) -> syntax.Name | syntax.Call | syntax.Inline | syntax.Group | syntax.Block | None:
        reading = self.reading
        if node.type == "name":
            return name(reading, node)
        if node.type == "call":
            return call(reading, node, depth)
        if node.type == "block":
            return self.read_block(node, depth + 1)
        if node.type == "inline":
            reading.need_closer(node, "[", "]")
            found = statements(reading, node.children, last_needs_semicolon=False)
            if not found and not node.has_error:
                reading.complain(node, "these brackets hold nothing", "write an operation: [trans 0 0 1]")
            return syntax.Inline(reading.span(node), found)
        if node.type == "group":
            reading.need_closer(node, "(", ")")
            unions = [child for child in node.children if child.type == "union"]
            union = self.union(unions[0], depth + 1) if unions else None
            if union is None and not node.has_error:
                reading.complain(node, "these brackets hold nothing", "remove them")
            return union and syntax.Group(reading.span(node), union)
        return None
