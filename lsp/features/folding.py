"""Folding: bodies in braces, comments of several lines, and runs of `//` lines.

Example: a Selection over lines 3 to 9 folds to its line 3; the comment lines before it fold as a comment.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import Any, Iterator

from plsys.compiler.analysis import Block, facts_of
from plsys.lsp.request import Feature, Request

BODIES = frozenset(("block_body", "selection_body", "statements", "inline"))


def folding_ranges(request: Request) -> list[dict[str, Any]]:
    text = request.document.text
    found = []
    comment: list[int] = []  # first and last line of the run of comments that grows

    def end_comment() -> None:
        if comment and comment[1] > comment[0]:
            found.append({"startLine": comment[0], "endLine": comment[1], "kind": "comment"})
        comment.clear()

    for block, base in zip(text.blocks, text.first_lines):
        for first, last, is_comment in _folds(block):
            first, last = base + first, base + last
            if is_comment:
                if comment and first == comment[1] + 1:
                    comment[1] = last
                else:
                    end_comment()
                    comment.extend((first, last))
            else:
                end_comment()
                if last > first:
                    found.append({"startLine": first, "endLine": last})
    end_comment()
    return found


def _folds(block: Block) -> list[tuple[int, int, bool]]:
    """First and last line of what can be folded, counted from the block's first line, and whether it is a comment; kept
    with the block."""
    kept = block.__dict__.get("folds")
    if kept is None:
        starts = block.line_starts
        kept = block.__dict__["folds"] = [
            (bisect_right(starts, node.start_byte) - 1, bisect_right(starts, node.end_byte) - 1, node.type == "comment")
            for node in _foldable(facts_of(block).tree.root_node)
        ]
    return kept


def _foldable(node: Any) -> Iterator[Any]:
    """Comments and bodies below ``node``, outer before inner. Rules and values hold none."""
    for child in node.children:
        if child.type == "comment":
            yield child
        elif child.type in BODIES:
            yield child
        if child.child_count and child.type not in ("vector", "call", "binary"):
            yield from _foldable(child)


FEATURES = (Feature("textDocument/foldingRange", folding_ranges, "foldingRangeProvider"),)
