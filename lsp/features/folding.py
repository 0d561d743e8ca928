"""Folding: bodies in braces, comments of several lines, and runs of `//` lines.

Example: a Selection over lines 3 to 9 folds to its line 3; the comment lines before it fold as a comment.
"""

from __future__ import annotations

from typing import Any, Iterator

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

    for root, base, _ in request.document.trees():
        for node in _foldable(root):
            first, last = text.line_of(base + node.start_byte), text.line_of(base + node.end_byte)
            if node.type == "comment":
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
