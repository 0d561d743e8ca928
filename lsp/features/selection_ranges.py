"""Growing and shrinking selections along the syntax.

Example: in `roty -betaBr;` with the cursor in `betaBr`: `betaBr`, `-betaBr`, `roty -betaBr;`, the statements in braces, the
definition, the file.
"""

from __future__ import annotations

from typing import Any

from plsys.lsp.request import Feature, Request


def selection_ranges(request: Request) -> list[dict[str, Any]]:
    places = [(position["line"], position["character"]) for position in request.params["positions"]]
    return [_ranges(request, request.positions.offset(*place)) for place in places]


def _ranges(request: Request, offset: int) -> dict[str, Any]:
    """The SelectionRange at ``offset``, innermost first."""
    node, base = request.document.node_at(offset)
    before, _ = request.document.node_at(max(0, offset - 1))
    if (node.child_count or not node.is_named) and not before.child_count and before.is_named and base + before.end_byte == offset:
        node = before  # the cursor stands just behind a word
    spans: list[tuple[int, int]] = []
    while node is not None and node.parent is not None:
        span = base + node.start_byte, base + node.end_byte
        if node.child_count and node.children[0].type in "{[(" and node.end_byte - node.start_byte > 2:
            inner = span[0] + 1, span[1] - 1
            if inner[0] <= offset <= inner[1]:
                _add(spans, inner)
        _add(spans, span)
        node = node.parent
    _add(spans, (0, len(request.document.text)))
    result: dict[str, Any] | None = None
    for start, end in reversed(spans):
        result = {"range": request.range(start, end), **({"parent": result} if result else {})}
    assert result is not None
    return result


def _add(spans: list[tuple[int, int]], span: tuple[int, int]) -> None:
    """Add a span round the last one, if it is larger."""
    if not spans or (span != spans[-1] and span[0] <= spans[-1][0] and spans[-1][1] <= span[1]):
        spans.append(span)


FEATURES = (Feature("textDocument/selectionRange", selection_ranges, "selectionRangeProvider"),)
