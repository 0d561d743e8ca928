"""Hints between the text: what a symbol unfolds to, how often a guard holds, how values change, shares of alternatives.

The whole-file checks work them out in their own process; this shows what has arrived, for the lines asked for.

Example: ``Selection Tree`` is followed by ``2,049 cylinders · depth 13 · ×0.80–1.00 per level``, ``if (cntTree > 0)`` by
``runs 10×``, and ``roty betaBr`` by ``56° → 20°``.
"""

from __future__ import annotations

import re
from typing import Any

from plsys.compiler.analysis import GuardInsight, SymbolInsight, Text, ValueInsight, insights_in
from plsys.lsp import prose
from plsys.lsp.request import Feature, Request

_NAME = re.compile(rb"[A-Za-z_]\w*")
_CLOSING = re.compile(rb"\s*\)")
_PARAMETERS = re.compile(rb"\s*\([^(){}]*\)")
# How far behind a name or a guard its brackets are looked for.
REACH = 200


def inlay_hints(request: Request) -> list[dict[str, Any]]:
    start, end = request.offsets
    text = request.document.text
    hints = []
    told: set[tuple[int, bytes, str]] = set()
    for first, last, insight in insights_in(request.scene, request.document, start, end):
        label, tooltip = described(insight)
        written = text.slice(first, last)
        if isinstance(insight, ValueInsight) and insight.kind == "assign" and _NAME.fullmatch(written):
            continue  # an argument that is handed on says nothing new
        key = (text.line_of(first), written, label)
        if label and key not in told:  # `scale a a 1` needs one hint for a
            told.add(key)
            position = request.positions.position(hint_offset(text, first, last, insight))
            hint = {"position": position, "label": label, "paddingLeft": True, "tooltip": tooltip}
            hints.append(hint)
    return hints


def described(insight: SymbolInsight | GuardInsight | ValueInsight) -> tuple[str, str]:
    """The hint's label and what it means."""
    match insight:
        case SymbolInsight():
            return prose.forecast(insight), symbol_tooltip(insight)
        case GuardInsight():
            total = prose.times(insight.total)
            return prose.runs(insight), f"on the longest path of the derivation; {total} in the whole scene"
        case ValueInsight(kind="share"):
            return prose.values(insight), "how likely this alternative is"
        case ValueInsight():
            if insight.certain:
                bounds = f"between {prose.number(insight.low)} and {prose.number(insight.high)}"
                return prose.values(insight), f"at the first and at the last level; {bounds} in the whole scene"
            return prose.values(insight), "the least and the greatest value in the whole scene"
    raise TypeError(insight)


def symbol_tooltip(insight: SymbolInsight) -> str:
    parts = ["what " + ("one instance unfolds to" if insight.alike else "the largest instance unfolds to")]
    if insight.depth is not None and insight.depth > 1:
        parts.append(f"the longest path enters {insight.depth:,} symbols")
    if prose.scale(insight):
        parts.append("from each level to the next, sizes change by the factor given (the cube root of the volume's)")
    return "; ".join(parts)


def hint_offset(text: Text, start: int, end: int, insight: object) -> int:
    """Where a hint about the bytes ``start`` to ``end`` stands: behind the brackets of a guard or of a symbol's
    parameters, and before a semicolon."""
    if isinstance(insight, ValueInsight):
        written = text.slice(start, end)
        return start + len(written.rstrip(b"; \t\r\n"))
    following = text.slice(end, end + REACH)
    pattern = _CLOSING if isinstance(insight, GuardInsight) else _PARAMETERS
    match = pattern.match(following)
    return end + match.end() if match else end


FEATURES = (Feature("textDocument/inlayHint", inlay_hints, "inlayHintProvider", {"resolveProvider": False}),)
