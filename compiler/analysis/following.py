"""What edits touch in a scene: which blocks are read and resolved again.

Blocks that come and go → an index of names (who defines, assigns and uses each) and the messages of every block. The index
tells whose meaning a change touches: the new blocks, and those that use a name whose *signature* changed (its kind, a
Selection's parameters, a constant's text). Only these are resolved again, by the same code that compiles scenes.

Example::

    following.changed(document.edit(120, 121, b"x"))
    following.work()                                # read and resolve what the edit touched
"""

from __future__ import annotations

import re
from typing import Iterator

from ..reading import syntax
from ..reading.diagnostics import Diagnostic
from ..reading.ignore import WORD as IGNORE_WORD
from ..reading.source import Span
from .deadline import Deadline
from .document import Document
from .earlier import Earlier
from .facts import Facts, drop_facts, facts_of, keep_lost
from .namespace import Namespace
from .parts import role_of
from .pending import Pending
from .resolving import BlockResolver, Router
from .retouch import retouch, touch_of
from .text import Block, Change

# A change that adds so many blocks is a file that is opened: reading it takes longer than a request may wait.
MANY_BLOCKS = 200

# So many texts of a block are known to have been right, for what is typed to be taken back.
RIGHT_TEXTS = 4

_SINGLE = ("camera", "background")

_QUOTED = re.compile(r"'(\w+)'")  # the names in a message


class Following:
    """Follows the texts of ``documents``; ``_find_files`` is called when one may include other files than before."""

    def __init__(self) -> None:
        self.documents: list[Document] = []
        names = self._names = Namespace(self._position)
        self.entries, self.definers, self.writers, self.users = names.entries, names.definers, names.writers, names.users
        self.singles: dict[str, dict[Block, None]] = {name: {} for name in _SINGLE}
        self.whole: dict[Block, list[Diagnostic]] = {}  # messages of the whole-file checks
        self.general: dict[Block, list[Diagnostic]] = {}  # those about what parts of the scene share
        self.insights: dict[Block, list] = {}  # what they found to show beside the text: see insights.py
        self.is_opening = False  # names aren't known yet: much of a file was never read
        self._included_by: dict[Document, syntax.Include] = {}
        self._pending = Pending()
        self._earlier = Earlier()
        self._reading: Iterator[None] | None = None
        self._messages: dict[Block, list[Diagnostic]] = {}  # of resolving
        self._syntax: dict[Block, list[Diagnostic]] = {}
        self._ignoring: dict[Block, None] = {}  # blocks with `plsys-ignore` comments
        # Blocks to be resolved: the last one first. Places are all that has changed, where the rest is right.
        self._edited: dict[Block, list[Span] | None] = {}
        self._dirty: dict[Block, list[Span] | None] = {}  # then those that use what was edited
        self._opened: dict[Block, None] = {}  # and then those of a file that was opened, from its start
        self._by_block = (
            self._messages, self._syntax, self.whole, self.general, self.insights, self._ignoring,
            self._edited, self._dirty, self._opened, *self.singles.values(),
        )  # fmt: skip
        self._resolver = BlockResolver(Router(self._messages), self.entries, names.nearest)

    def _find_files(self) -> None:
        raise NotImplementedError

    def changed(self, change: Change) -> None:
        """Take note that blocks of a document were exchanged; ``work`` then does what follows from it."""
        self._pending.add(change)
        self.is_opening |= len(change.added) >= MANY_BLOCKS

    def work(self, deadline: Deadline | None = None) -> bool:
        """Read and resolve what changes have touched, up to ``deadline``, or up to where
        only the rest of a file that was opened is left. True when nothing is left to do."""
        had_edits = bool(self._pending or self._edited or self._dirty)
        if not self.read(deadline):
            return False
        while self._edited or self._dirty or self._opened or self._names.has_doubts:
            block = places = None
            if self._edited:
                block, places = self._edited.popitem()
            elif self._dirty:
                block, places = next(iter(self._dirty.items()))
            elif self._names.has_doubts:
                self._settle_doubts(deadline)
            elif had_edits and deadline is not None:
                return False  # what is known about the edit needs not wait
            else:
                block = next(iter(self._opened))
            if block is not None:
                self._dirty.pop(block, None)
                self._opened.pop(block, None)
                self._resolve(block, places)
            if deadline is not None and deadline.has_passed():
                return self.is_current
        return True

    def read(self, deadline: Deadline | None = None) -> bool:
        """The first half of ``work``: after it all names are known, but what is wrong with them isn't."""
        while self._reading is not None or self._pending or not self._names.is_fresh:
            self._reading = self._reading or self._steps()
            for _ in self._reading:
                if deadline is not None and deadline.has_passed():
                    return False
            self._reading = None
        self.is_opening = False
        return True

    @property
    def is_current(self) -> bool:
        """Whether all that the last changes touched has been resolved."""
        read = self._reading is None and not self._pending and self._names.is_fresh
        return read and not (self._edited or self._dirty or self._opened or self._names.has_doubts)

    def _settle_doubts(self, deadline: Deadline | None) -> None:
        """Blocks with a wrong name that something else is most like now are to be resolved again."""
        wrong: dict[str, dict[Block, None]] = {}
        for block, said in self._messages.items():
            for name in {name for each in said for name in _QUOTED.findall(each.message)}:
                wrong.setdefault(name, {})[block] = None
        for name in self._names.settle_doubts(wrong):
            if name is not None:
                self._dirty.update(wrong[name])
            if deadline is not None and deadline.has_passed():
                return

    def wrong_blocks(self) -> list[Block]:
        """The blocks with errors, if all that changes touched has been resolved; before, none is known for sure."""
        if not self.is_current:
            return []
        tables = self._syntax, self._messages
        return [block for table in tables for block, said in table.items() if any(each.severity == "error" for each in said)]

    def _steps(self) -> Iterator[None]:
        """Reads what is pending, with a pause after each block. Each kind of work is done for all changes in a row: what it needs
        stays in the processor's caches."""
        while self._pending:
            changes = self._pending.take()
            afresh = []
            for change in changes:
                if not self._is_alone() or not self._retouch(change):
                    afresh.append(change)
                yield
            for change in afresh:
                for block in change.added if change.removed else ():
                    if not self._is_alone() or not self._earlier.take(block):
                        facts_of(block)
                    yield
            for change in afresh:
                yield from self._exchange(change)
            if self._pending.lost_include:
                self._pending.lost_include = False
                self._find_files()
        noted: dict[Facts, set[str]] = {}
        for found in self._names.refresh():
            if found is not None:
                facts, name = found
                noted.setdefault(facts, set()).add(name)
            yield
        for facts, names in noted.items():
            self._note_change(facts, names)
            yield

    def _exchange(self, change: Change) -> Iterator[None]:
        """Puts what was read of new blocks in the place of what is known of old ones."""
        if change.removed:
            keep_lost(change)
        is_kept = self._is_alone() and change.removed and not any([facts_of(block).ghosts for block in change.added])
        removed_includes = False
        for block in change.removed:
            facts = facts_of(block)
            if is_kept:
                if self._is_right(block, facts):
                    self._note_right(block, facts)
                self._earlier.keep(block)
            self._forget(block)
            self._names.forget(facts)
            removed_includes |= b"include" in block.data and bool(facts.includes)
            if (readers := block.__dict__.get("readers", 1)) > 1:
                block.__dict__["readers"] = readers - 1  # another scene has yet to forget the same facts
            else:
                drop_facts(block)
            yield
        waiting = self._opened if len(change.added) >= MANY_BLOCKS else self._edited
        for block in change.added:
            facts = facts_of(block)
            self._learn(block, facts)
            self._names.learn(facts)
            if waiting is self._opened:
                role_of(block)  # the whole-file checks ask for it, of all blocks at once
            if not self._was_right(block, facts):
                waiting[block] = None
            yield
        if removed_includes or any(facts_of(block).includes for block in change.added if b"include" in block.data):
            self._find_files()

    def _is_alone(self) -> bool:
        """Whether no other scene looks at the same files."""
        return all([len(each.scenes) == 1 for each in self.documents])

    def _note_change(self, facts: Facts, names: set[str]) -> None:
        """``names``, which are in ``facts``, mean something else now."""
        block = facts.block
        if block in self._opened:
            return
        places = [each.node.span for each in facts.names if each.node.name in names]
        waiting = self._edited if block in self._edited else self._dirty
        if block not in waiting:
            waiting[block] = places if self._is_right_but_at(block, places) else None
        elif (known := waiting[block]) is not None:
            known += places

    def _is_right_but_at(self, block: Block, places: list[Span]) -> bool:
        """Whether nothing is known to be wrong with ``block`` but what is in ``places``. (Of a second definition nothing is
        known but that it is one.)"""
        said = self._messages.get(block)
        return not said or all(
            each.code != "duplicate-name"
            and any(place.start <= each.span.start and each.span.end <= place.end for place in places)
            for each in said
        )

    def _retouch(self, change: Change) -> bool:
        """Whether all that was typed is in one token or beside all, which has been read then."""
        if len(change.removed) != 1 or len(change.added) != 1:
            return False
        (old,), (new,) = change
        touch = touch_of(old, new) if new not in self._earlier else None
        if touch is None:
            return False
        facts, leaf, names = facts_of(old), touch.leaf, self._names
        was_broken, words, places = facts.is_broken, facts.words, [leaf.span] if leaf is not None else []
        name = leaf.name if isinstance(leaf, syntax.Name) else None
        # Whether all else in the block is known to be right.
        was_right = not was_broken and not self._is_waiting(old) and self._is_right_but_at(old, places)
        if was_right and not self._messages.get(old):
            self._note_right(old, facts)
        self._forget(old)
        if touch.renames and touch.index is None:
            names.forget(facts)
            retouch(old, new, touch)
            names.learn(facts)
        else:
            retouch(old, new, touch)
            if touch.renames:
                names.rename(facts, name, touch.text)
            elif touch.index is not None:
                names.rename_use(facts, name, touch.text)
            elif name is not None:
                names.learn_uses(facts, words)
            elif leaf is not None:
                names.learn_value(facts, facts.is_broken is not was_broken)
        self._learn(new, facts)
        if not (was_right and leaf is None) and not self._was_right(new, facts):
            self._edited[new] = places if was_right else None
        return True

    def _is_right(self, block: Block, facts: Facts) -> bool:
        """Whether all in a block is known to be right."""
        return not (self._messages.get(block) or facts.is_broken or self._is_waiting(block))

    def _note_right(self, block: Block, facts: Facts) -> None:
        """Note with the facts of a block that goes that all in it was right."""
        right = facts.right
        right.pop(block.data, None)
        right[block.data] = self._names.now
        if len(right) > RIGHT_TEXTS:
            del right[next(iter(right))]

    def _is_waiting(self, block: Block) -> bool:
        """Whether a block is to be resolved."""
        return block in self._edited or block in self._dirty or block in self._opened

    def _was_right(self, block: Block, facts: Facts) -> bool:
        """Whether an earlier block with the same text was right, and all names in it mean the same."""
        moment = facts.right.get(block.data)
        return moment is not None and self._names.are_as(facts, moment)

    def _forget(self, block: Block) -> None:
        for table in self._by_block:
            table.pop(block, None)

    def _learn(self, block: Block, facts: Facts) -> None:
        block.__dict__["readers"] = block.__dict__.get("readers", 0) + 1
        if facts.syntax:
            self._syntax[block] = facts.syntax
        if IGNORE_WORD in block.data:
            self._ignoring[block] = None
        for each in facts.blocks:
            if each.name.name in self.singles:
                self.singles[each.name.name][block] = None

    def _position(self, block: Block, start: int) -> tuple[int, ...]:
        """Where a place stands in the scene as it is read: what is included stands where the `#include` does."""
        for document in self.documents:
            if block in document.text.order:
                if document not in self._included_by:
                    return document.text.order[block], start
                include = self._included_by[document]
                return *self._position(include.span.source, include.span.start), document.text.order[block], start
        return len(self.documents), 0

    def _resolve(self, block: Block, places: list[Span] | None = None) -> None:
        self._messages.pop(block, None)
        facts = facts_of(block)
        if facts.is_broken:
            return  # what it means can only be guessed at
        for definition in facts.definitions:
            # Another block that uses it may have been first, and its messages went with the old ones.
            self._names.renew(definition)
        try:
            self._resolver.run_on(facts, places)
        except RecursionError:
            pass  # the whole-file checks, which have more room, report it
