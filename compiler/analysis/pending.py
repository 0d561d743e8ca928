"""Changes of which nothing has been read yet.

Changes in the order of editing → fewer of them: what a block was in between is never read. A hundred cursors or a burst
of keys cost the last text of the blocks that they touched, and that when there is time for it.

Example: ``{A → B}`` and then ``{B → C}`` is ``{A → C}``.
"""

from __future__ import annotations

from .text import Block, Change


class _Joined:
    """Changes as one: what was there before all of them, and what is after."""

    def __init__(self) -> None:
        self.removed: dict[Block, None] = {}
        self.added: dict[Block, None] = {}


class Pending:
    def __init__(self) -> None:
        self._changes: dict[_Joined, None] = {}
        self._of: dict[Block, _Joined] = {}  # by the blocks that they add

    def __bool__(self) -> bool:
        return bool(self._changes)

    def add(self, change: Change) -> None:
        of = self._of
        touched = list(dict.fromkeys([of[block] for block in change.removed if block in of]))
        # A file that is being opened is one large change: the others go into it.
        joined = max(touched, key=lambda each: len(each.added), default=None) or _Joined()
        self._changes[joined] = None
        for other in touched:
            if other is not joined:
                del self._changes[other]
                joined.removed.update(other.removed)
                joined.added.update(other.added)
                self._of.update(dict.fromkeys(other.added, joined))
        for block in change.removed:
            if block in joined.added:
                del joined.added[block], self._of[block]
            else:
                joined.removed[block] = None
        joined.added.update(dict.fromkeys(change.added))
        self._of.update(dict.fromkeys(change.added, joined))

    def take(self) -> list[Change]:
        """All changes, the oldest first, which are pending no longer."""
        changes = [Change(list(joined.removed), list(joined.added)) for joined in self._changes]
        self._changes.clear()
        self._of.clear()
        return changes
