"""What is said of a token that the text lacks and tree-sitter put in: a table by the token, by what it is part of, and by
the leaf before it, at whose end it should stand.

A MISSING node → message and hint, or None where no row fits. In a row '' fits all, and the first row that fits counts;
``{leaf}`` is the text of the leaf before.

Example: in ``max(a, )`` the row ``("value", "call", ",")`` says "an argument is missing after this ','".
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from tree_sitter import Node

# Nodes in which a missing name is one that is being defined or called, and not an operand.
_NAMING = (
    "selection",
    "calculation",
    "transformation",
    "parameters",
    "named_block",
    "declare",
    "parameter",
    "step",
)
_VALUES = ("name", "number", "string")
_EXTRAS = ("comment", "directive")


class _Row(NamedTuple):
    token: str  # as in the grammar, or "value" for a name, number or text that is an operand
    parent: str
    leaf: str
    message: str
    hint: str


_CALL = "a call looks like max(a, b), with a comma between two values"
_VECTOR = "a vector looks like <x, y, z>, with a comma between two values"
_RANGE = "a range looks like [0 to 20]"
_CONDITION = "a condition looks like if (count > 0 && height < 2)"
_CHOICE = "a choice looks like test ? a : b"
_PARAMETERS = "parameters look like Branch(length, width)"
_BODY = "the body of a definition or block stands in braces"

_ROWS = (
    _Row("value", "call", "(", "an argument is missing after this '('", _CALL),
    _Row("value", "call", ",", "an argument is missing after this ','", _CALL),
    _Row("value", "vector", "<", "a value is missing after this '<'", _VECTOR),
    _Row("value", "vector", ",", "a value is missing after this ','", _VECTOR),
    _Row("value", "range", "[", "the lower end of the range is missing after this '['", _RANGE),
    _Row("value", "range", "to", "the upper end of the range is missing after 'to'", _RANGE),
    _Row("value", "guard", "", "a condition is missing after '{leaf}'", _CONDITION),
    _Row("value", "conditional", "?", "a value is missing after this '?'", _CHOICE),
    _Row("value", "conditional", ":", "a value is missing after this ':'", _CHOICE),
    _Row("value", "binary", "=", "a value is missing after this '='", "write it, such as 2 or n + 1"),
    _Row("value", "binary", "", "a value is missing after this '{leaf}'", "'{leaf}' stands between two values: a {leaf} b"),
    _Row("value", "unary", "", "a value is missing after this '{leaf}'", "'{leaf}' stands before a value: {leaf}a"),
    _Row("name", "parameters", "(", "a parameter's name is missing after this '('", _PARAMETERS),
    _Row("name", "parameters", ",", "a parameter's name is missing after this ','", _PARAMETERS),
    _Row("{", "", "name", "'{{' is missing after '{leaf}'", _BODY),
    _Row("{", "", "", "'{{' is missing here", _BODY),
)


def missing(node: Node, before: Node | None) -> tuple[str, str] | None:
    """Message and hint for ``node``, which is MISSING and comes after the leaf ``before``; None where the table has nothing."""
    token = node.type
    if is_value(node):
        token = "value"
    elif token in _VALUES:
        token = "name"
    leaf, text = (before.type, before.text.decode(errors="replace")) if before is not None else ("", "")
    for row in _ROWS:
        if row.token == token and row.parent in ("", node.parent.type) and row.leaf in ("", leaf):
            return row.message.format(leaf=text.strip()), row.hint.format(leaf=text.strip())
    return None


def is_value(node: Node) -> bool:
    """Whether the missing ``node`` is an operand, and not a name that is being given."""
    return node.type in _VALUES and node.parent.type not in _NAMING


def leaf_before(root: Node, offset: int) -> Node | None:
    """The last token of the text below ``root`` that ends at or before the byte ``offset``, comments left out. (Looked for from
    above: tree-sitter's ways from an empty node to its neighbours may lead in a circle.)"""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if node.start_byte >= offset or node.type in _EXTRAS or node.is_missing:
            continue
        if node.children:
            waiting += node.children
        elif node.end_byte <= offset:
            return node
    return None
