"""The runtime's one family of errors: where, and what."""

from __future__ import annotations

KINDS = ("ok", "bytecode", "scene", "limit", "memory", "argument", "cancelled", "output")
"""By code, as in include/plsys.h's pl_error_code."""


class PlsysRuntimeError(Exception):
    """Something that the runtime can't do.

    ``place`` is "file:line:column" of the source where known, else what was being read or asked for; ``reason`` is one
    sentence; ``kind`` one of KINDS.

        >>> raise PlsysRuntimeError("tree.plsys:12:5", "n is read before it is assigned", "scene")
    """

    def __init__(self, place: str, reason: str, kind: str = "scene") -> None:
        super().__init__(f"{place}: {reason}" if place else reason)
        self.place = place
        self.reason = reason
        self.kind = kind


class RuntimeArgumentError(PlsysRuntimeError, ValueError):
    """An argument of the wrong shape, type or range; also a ValueError."""

    def __init__(self, place: str, reason: str) -> None:
        super().__init__(place, reason, "argument")
