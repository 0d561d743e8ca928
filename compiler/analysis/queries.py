"""Tree-sitter queries on a block's tree: thousands of nodes by pattern, faster than by walking.

Example: ``captures(compile("(number) @number"), facts.tree.root_node)["number"]`` are all numbers of a block.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..reading.grammar import language

if TYPE_CHECKING:
    from tree_sitter import Node, Query


def compile(pattern: str) -> Query:
    from tree_sitter import Query

    return Query(language(), pattern)


def captures(query: Query, root: Node) -> dict[str, list[Node]]:
    """The captured nodes by the names of their captures."""
    from tree_sitter import QueryCursor

    return QueryCursor(query).captures(root)
