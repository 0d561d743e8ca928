"""Statements of Calculations, Transformations and inline operators: nodes of tree-sitter's tree → nodes of
:mod:`syntax`.

Example: the statements of ``{ trans 0 0 1.99; roty -angle; }`` are
``(Operation(trans, (0, 0, 1.99)), Operation(roty, (Unary('-', angle),)))``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import syntax
from .parse_values import Abandon, Reading, call, expression, expressions, name

if TYPE_CHECKING:
    from tree_sitter import Node

_REPEAT = "a Selection repeats: Selection Row { if (n > 0) Row -> C_count Row; }"
# Words that begin statements elsewhere.
FOREIGN = {
    "for": _REPEAT,
    "while": _REPEAT,
    "do": _REPEAT,
    "return": "a Calculation assigns its results: n = 2;",
}


def statements(
    reading: Reading, nodes: list[Node], last_needs_semicolon: bool = True
) -> tuple[syntax.Statement, ...]:
    """The statements among ``nodes``, children of a body or of an inline operator."""
    found: list[syntax.Statement] = []
    usable = [node for node in nodes if node.type in _STATEMENTS]
    for node in usable:
        if node is not usable[-1] or last_needs_semicolon:
            reading.need_semicolon(node, "this statement")
        found += _STATEMENTS[node.type](reading, node)
    return tuple(found)


def _assignment(reading: Reading, node: Node) -> list[syntax.Statement]:
    target, operator = node.child_by_field_name("target"), node.child_by_field_name("operator")
    value = expression(reading, node.child_by_field_name("value"))
    if value is None:
        return []
    return [syntax.Assignment(reading.span(node), name(reading, target), reading.text(operator), value)]


def _step(reading: Reading, node: Node) -> list[syntax.Statement]:
    target, operator = node.child_by_field_name("target"), node.child_by_field_name("operator")
    return [syntax.Assignment(reading.span(node), name(reading, target), reading.text(operator), None)]


def _operation(reading: Reading, node: Node) -> list[syntax.Statement]:
    called = node.child_by_field_name("call")
    if called is not None:
        operation = call(reading, called)
        reading.complain(
            called,
            "an operation's arguments stand without brackets",
            f"write {operation.name.name} and its arguments, side by side or with commas",
        )
        return [syntax.Operation(reading.span(node), operation.name, operation.arguments)]
    parts = [child for child in node.children if child.type != ";"]
    found: list[syntax.Statement] = []
    for start, end in _split_lines(reading, parts):
        found.append(_one_operation(reading, parts[start:end]))
        if end < len(parts):
            reading.missing_semicolon(parts[end - 1].end_byte, "this statement")
    return found


def _split_lines(reading: Reading, parts: list[Node]) -> list[tuple[int, int]]:
    """Where a ';' is missing at a line's end, the next line's operation reads as more arguments. A name that
    begins a line no deeper than the operation does starts a new one."""
    starts = [0]
    column = parts[0].start_point[1]
    for i in range(1, len(parts)):
        begins_line = parts[i].start_point[0] > parts[i - 1].end_point[0]
        if begins_line and parts[i].type == "name" and parts[i].start_point[1] <= column:
            starts.append(i)
    return list(zip(starts, [*starts[1:], len(parts)], strict=True))


def _one_operation(reading: Reading, parts: list[Node]) -> syntax.Operation:
    if (hint := FOREIGN.get(reading.text(parts[0]))) is not None:
        raise Abandon(reading.span(parts[0]), f"'{reading.text(parts[0])}' is no statement", hint)
    commas = [part for part in parts if part.type == ","]
    arguments = expressions(reading, [part for part in parts[1:] if part.type != ","], 0)
    # With commas, arguments and commas take turns.
    if commas and [part.type == "," for part in parts[1:]] != [
        i % 2 == 1 for i in range(2 * len(arguments) - 1)
    ]:
        text = reading.text(parts[0])
        if len(commas) < len(arguments) - 1:
            reading.complain(
                commas[0],
                "commas stand between some of these arguments only",
                f"write {text} with a comma between all arguments, or with none",
            )
        else:
            reading.complain(commas[-1], "this ',' separates nothing", "remove it")
    span = reading.between(parts[0].start_byte, parts[-1].end_byte)
    return syntax.Operation(span, name(reading, parts[0]), arguments)


_STATEMENTS = {"assignment": _assignment, "step": _step, "operation": _operation}
