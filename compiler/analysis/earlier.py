"""What was read from texts that blocks had a moment ago: a deletion or an undo that brings one back gets it for nothing.

Facts of blocks that went, and blocks that come → the facts of those with a text that is known. Only facts without syntax
messages are kept, since only their places can be made those of another block (retouch.py), and none whose definitions a
broken block has as ghosts.

Example::

    earlier.keep(old)           # `Transformation T { roty 90; }` becomes `Transformation T { roty 9x0; }`
    earlier.take(new)           # and is `… roty 90; }` again: True, and the block has its facts
"""

from __future__ import annotations

from pathlib import Path

from .facts import Facts
from .retouch import move
from .text import Block

# Two times a hundred cursors, and of large blocks fewer.
MOST_TEXTS = 256
MOST_BYTES = 1 << 18


class Earlier:
    """Facts of gone blocks by file and text, the oldest first."""

    def __init__(self) -> None:
        self._facts: dict[tuple[Path | None, bytes], Facts] = {}
        self._bytes = 0

    def keep(self, old: Block) -> None:
        """Remember what was read from ``old``, which is gone."""
        facts: Facts | None = old.__dict__.get("facts")
        if (
            facts is None
            or facts.syntax
            or facts.includes
            or facts.text is not old.data
            or len(old.data) > MOST_BYTES
        ):
            return
        self._pop(old)
        self._facts[old.path, old.data] = facts
        self._bytes += len(old.data)
        while len(self._facts) > MOST_TEXTS or self._bytes > MOST_BYTES:
            _, data = oldest = next(iter(self._facts))
            del self._facts[oldest]
            self._bytes -= len(data)

    def __contains__(self, new: Block) -> bool:
        """Whether there is what ``take`` gives."""
        return (new.path, new.data) in self._facts

    def take(self, new: Block) -> bool:
        """Give ``new`` what was read from an earlier block with its text; whether there is such."""
        if "facts" in new.__dict__ or (facts := self._pop(new)) is None:
            return False
        move(facts, new, 0, 0)
        facts.retouched()
        new.__dict__.update(facts=facts, before=None)
        return True

    def _pop(self, block: Block) -> Facts | None:
        found = self._facts.pop((block.path, block.data), None)
        if found is not None:
            self._bytes -= len(block.data)
        return found
