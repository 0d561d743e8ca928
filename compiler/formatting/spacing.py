"""How many spaces stand between two tokens of one line.

Example: between ``n`` and ``=`` one, or as many as the author aligned the ``=`` with; between ``sin`` and ``(`` none.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from .tokens import Role

_BRACKETS = {
    "call": "()",
    "parameters": "()",
    "parenthesized": "()",
    "vector": "<>",
    "range": "[]",
    "map_entry": "[]",
}
_OPENS_CLOSELY = frozenset(
    ("call", "parameters")
)  # nothing stands between these brackets and what is before them
_TIGHT = frozenset(("*", "/", "%"))  # as the author has them: `2*n` or `2 * n`, but not `2* n`

# What has its one space, or none, and is never aligned: after the first, before the second.
_NO_ALIGNMENT_AFTER = frozenset(
    ("(", "[", "{", "< ", ",", "=", "arrow", "+", "|", ":", "?", "+=", "-=", "*=", "/=")
)
_NO_ALIGNMENT_BEFORE = frozenset((")", "]", "+", "|", ":", "?"))


class Gap(NamedTuple):
    """The place between two tokens of one line, with the spaces that the author has there (``width``), before
    ``before``, after ``after`` and behind the bracket that ``after`` closes; a line break counts as one."""

    before: Role
    after: Role
    width: int
    width_before: int
    width_after: int
    width_opener: int
    comment_follows: bool


class Spaces(NamedTuple):
    count: int
    may_align: bool = False  # whether more spaces stay, where columns are aligned


@lru_cache(4096)  # few kinds of gaps are most of a file's
def spaces(gap: Gap) -> Spaces:
    before, after = gap.before, gap.after
    kind = after.kind
    if before.kind == "comment" or after.is_comment:
        return _beside_comment(gap)
    if kind in (";", ","):
        return Spaces(1 if before.kind == "arrow" else 0)
    inside = (
        _BRACKETS.get(before.parent, "")[:1] == before.kind or _BRACKETS.get(after.parent, "")[1:] == kind
    )
    if inside or (kind == "(" and after.parent in _OPENS_CLOSELY):
        return Spaces(0)
    if before.kind == "(":  # of a group
        return Spaces(min(gap.width, 1))
    if kind == ")":
        return Spaces(min(gap.width_opener, 1))
    if before.is_operator or after.is_operator:
        return _beside_operator(gap)
    if before.parent == after.parent == "step" and before.kind != ";":
        return Spaces(0)
    if kind == ":" and after.parent == "alternative":
        return Spaces(0)
    return Spaces(1, before.kind not in _NO_ALIGNMENT_AFTER and kind not in _NO_ALIGNMENT_BEFORE)


def is_fixed(before: Role, after: Role) -> bool:
    """Whether the spaces between the two depend on their kinds only (apart from those that align)."""
    loose = before.is_comment or after.is_comment or before.is_operator or after.is_operator
    return not loose and before.kind != "(" and after.kind != ")"


def _beside_comment(gap: Gap) -> Spaces:
    """What touches a comment still does: `-/**/1` is a sign and `- /**/1` may be a difference."""
    if gap.width == 0 and (gap.after.kind != "line_comment" or gap.before.is_operator):
        return Spaces(0)
    return Spaces(1, True)


def _beside_operator(gap: Gap) -> Spaces:
    before, after = gap.before, gap.after
    if before.is_operator and before.parent == "unary":
        # Two signs in a row are read as they touch or don't.
        return Spaces(min(gap.width, 1) if after.is_operator else 0)
    if after.is_operator and after.parent == "unary":
        tight = before.is_operator and before.kind in _TIGHT
        return Spaces(
            min(gap.width_before or gap.width, 1) if tight else 1,
            not before.is_operator and before.kind != ",",
        )
    if after.is_operator:
        if gap.comment_follows:
            return Spaces(min(gap.width, 1))
        return Spaces(min(gap.width or gap.width_after, 1) if after.kind in _TIGHT else 1)
    return Spaces(min(gap.width_before or gap.width, 1) if before.kind in _TIGHT else 1)
