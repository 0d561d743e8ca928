"""Candidates for completion, and the names and values that stand in many places.

A :class:`Place` is where something is typed: scene, document, offset and context. ``candidates.py`` has what stands
in definitions and rules, ``block_items.py`` what stands in scene blocks.

Example: ``place.values(with_parameters=True)`` gives what an expression may begin with.
"""

from __future__ import annotations

from typing import Iterable, Iterator, NamedTuple

from plsys.compiler.analysis import Context, Document, Scene, facts_of, vocabulary

from . import prose, snippets

Row = vocabulary.Row

FORMS = ("rgb", "rgbt", "rgbf", "rgbft")
VALUES = {"value": 2, "input": 2}
# Names of a kind that are looked at further: more than a list shows.
MAX_NAMES = 250


class Candidate(NamedTuple):
    """``order`` sorts candidates of equal fit: lower first. ``plain`` is what is put in where there are no snippets,
    if that isn't the name."""

    name: str
    kind: str
    order: int = 5
    detail: str = ""
    snippet: str = ""
    plain: str = ""
    row: Row | None = None


def fit(name: str, prefix: str) -> int | None:
    """0 for names that begin as typed, 1 whatever the case, 2 for those that have the letters in order; None for others."""
    if name.startswith(prefix):
        return 0
    low, typed = name.lower(), prefix.lower()
    if low.startswith(typed):
        return 1
    letters = iter(low)
    return 2 if low[:1] == typed[:1] and all(letter in letters for letter in typed) else None


class Place:
    """Where something is typed."""

    def __init__(self, scene: Scene, document: Document, offset: int, context: Context) -> None:
        self.scene, self.document, self.offset, self.context = scene, document, offset, context
        self.near = {each.name for each in facts_of(document.text.block_at(max(0, offset - 1))[0]).names}

    def nothing(self) -> Iterator[Candidate]:
        yield from ()

    @property
    def before(self) -> bytes:
        """The text of the block up to the cursor."""
        block, base = self.document.text.block_at(max(0, self.offset - 1))
        return block.data[: self.offset - base]

    def values(self, with_parameters: bool) -> Iterator[Candidate]:
        """What an expression may begin with; without parameters there are no draws either."""
        yield from self.ordered_names({"parameter": 1, **VALUES} if with_parameters else VALUES)
        for row in vocabulary.FUNCTIONS.values():
            if with_parameters or row.name != "rand":
                yield self.of_row(row, 4, snippets.call(row))
        for row in vocabulary.CONSTANTS.values():
            yield self.of_row(row, 4)

    def colour_words(self) -> Iterator[Candidate]:
        for name in ("color", "rgb"):
            yield self.of_row(vocabulary.COLOUR_WORDS[name], 2, snippets.COLOURS[name])

    def colours(self, names_only: bool = False) -> Iterator[Candidate]:
        """The forms of colours, and their names."""
        if self.context.previous in FORMS:
            yield Candidate("<r, g, b>", "snippet", 0, "", snippets.COLOURS[self.context.previous].partition(" ")[2], "<")
            return
        if not names_only:
            for name in FORMS:
                yield self.of_row(vocabulary.COLOUR_WORDS[name], 0, snippets.COLOURS[name])
            yield from self.scene_names(("value",), 1)
        for name, parts in vocabulary.COLOURS.items():
            yield Candidate(name, "colour", 4, f"<{', '.join(map(prose.number, parts))}>")

    def scene_names(self, kinds: Iterable[str], order: int) -> Iterator[Candidate]:
        return self.ordered_names(dict.fromkeys(kinds, order))

    def ordered_names(self, orders: dict[str, int]) -> Iterator[Candidate]:
        """Names of the kinds in ``orders`` that fit what is typed; those of the block come first. Of many, some."""
        prefix, entries = self.context.prefix, self.scene.entries
        for name in self.near:
            order = orders.get(entries[name].kind) if name in entries else None
            if order is not None and name != prefix:
                yield Candidate(name, entries[name].kind, order - 1)
        firsts = (prefix[:1].lower(), prefix[:1].upper())
        count = 0
        for name, entry in entries.items():
            if prefix and name[0] not in firsts:
                continue  # a quick look, for scenes with thousands of names
            kind = entry.definition.kind
            if kind in orders and (name not in self.near or name == prefix) and fit(name, prefix) is not None:
                yield Candidate(name, kind, orders[kind])
                count += 1
                if count > MAX_NAMES:
                    return

    @staticmethod
    def of_row(row: Row, order: int, snippet: str = "") -> Candidate:
        return Candidate(row.name, row.kind, order, row.signature, snippet, row=row)

    def blocks(self, names: Iterable[str], order: int) -> Iterator[Candidate]:
        for name in names:
            row = vocabulary.BLOCKS[name]
            yield self.of_row(row, order, snippets.block(row))
