"""Changes of which nothing has been read yet.

Changes in the order of editing → fewer of them: what a block was in between is never read. A hundred cursors or a burst
of keys cost the last text of the blocks that they touched, and that when there is time for it.

Example: ``{A → B}`` and then ``{B → C}`` is ``{A → C}``.
"""

from __future__ import annotations

from typing import Iterable

from .text import Block, Change


class _Joined:
    """Changes as one: what was there before all of them, and what is after."""

    __slots__ = "removed", "added"

    def __init__(self, removed: Iterable[Block] = (), added: Iterable[Block] = ()) -> None:
        self.removed, self.added = dict.fromkeys(removed), dict.fromkeys(added)


class Pending:
    def __init__(self) -> None:
        self._changes: dict[_Joined, None] = {}
        self._of: dict[Block, _Joined] = {}  # by the blocks that they add
        self.lost_include = False  # a block that went unread may have included a file

    def __bool__(self) -> bool:
        return bool(self._changes)

    def add(self, change: Change) -> None:
        of = self._of
        if len(change.removed) == len(change.added) == 1 and change.removed[0] not in of:  # most are such
            joined = of[change.added[0]] = _Joined(*change)
            self._changes[joined] = None
            return
        touched = list(dict.fromkeys([of[block] for block in change.removed if block in of]))
        # A file that is being opened is one large change: the others go into it.
        joined = max(touched, key=lambda each: len(each.added), default=None) or _Joined()
        self._changes[joined] = None
        for other in touched:
            if other is not joined:
                del self._changes[other]
                joined.removed.update(other.removed)
                joined.added.update(other.added)
                of.update(dict.fromkeys(other.added, joined))
        for block in change.removed:
            if block in joined.added:
                del joined.added[block], of[block]
                self.lost_include |= b"include" in block.data
            else:
                joined.removed[block] = None
        joined.added.update(dict.fromkeys(change.added))
        of.update(dict.fromkeys(change.added, joined))

    def take(self) -> list[Change]:
        """All changes, the oldest first, which are pending no longer."""
        changes = [Change(list(joined.removed), list(joined.added)) for joined in self._changes]
        self._changes.clear()
        self._of.clear()
        return changes
