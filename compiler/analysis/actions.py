"""What can be done to a text at a place: edits with a title, and the helpers that fixes and refactorings are made of.

Example: for "missing ';' after this rule", ``Action("Add ';'", "quickfix", (TextEdit(document, 31, 31, ";"),))``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Iterator, NamedTuple

from ..reading import syntax, vocabulary
from ..reading.resolve_objects import SIGNED_NAME
from .document import Document, Message, Place
from .facts import Facts, facts_of
from .scene import Scene


# So far from a place is looked for the name that it is in.
NAME_REACH = 100


class TextEdit(NamedTuple):
    """Bytes ``start`` to ``end`` of ``document`` become ``text``."""

    document: Document
    start: int
    end: int
    text: str


class Action(NamedTuple):
    """``kind`` is the protocol's: quickfix, refactor.extract, refactor.inline, refactor.rewrite. ``message`` is what a
    quickfix is for; ``preferred`` says that it is the likely one. ``name`` is defined no longer, or takes other arguments."""

    title: str
    kind: str
    edits: tuple[TextEdit, ...]
    preferred: bool = False
    message: Message | None = None
    name: str = ""


@dataclass(frozen=True)
class Spot:
    """Bytes ``start`` to ``end`` of a document in its scene, with the block that they are in."""

    scene: Scene
    document: Document
    start: int
    end: int

    @property
    def facts(self) -> Facts:
        return facts_of(self.document.text.block_at(self.start)[0])

    @property
    def base(self) -> int:
        """Where the block starts: nodes of syntax count from there."""
        return self.document.text.block_at(self.start)[1]

    @property
    def text(self) -> str:
        return self.slice(self.start, self.end)

    def slice(self, start: int, end: int) -> str:
        return self.document.text.slice(start, end).decode(errors="replace")

    def edit(self, start: int, end: int, text: str) -> TextEdit:
        return TextEdit(self.document, start, end, text)

    def replace(self, text: str) -> TextEdit:
        return self.edit(self.start, self.end, text)

    @property
    def definition(self) -> syntax.Definition | None:
        """The definition or scene block round the spot."""
        for node in self.facts.file.definitions:
            if node.span.start <= self.start - self.base <= node.span.end:
                return node
        return None

    def cut(self, start: int, end: int) -> TextEdit:
        """Remove bytes ``start`` to ``end``, with the space round them that nothing needs then, or their whole lines."""
        text = self.document.text
        line, last = text.line_of(start), text.line_of(max(start, end - 1))
        before = text.slice(text.line_start(line), start)
        after = text.slice(end, max(end, text.line_start(last + 1)))
        if not before.strip() and not after.strip():
            return self.edit(start - len(before), end + len(after), "")
        blanks = len(after) - len(after.lstrip(b" \t"))
        if not before.strip() or before[-1:] in (b" ", b"\t"):
            return self.edit(start, end + blanks, "")
        return self.edit(start, end, "")

    def signed_name(self) -> TextEdit | None:
        """Of ``tree-age`` round the spot the edit that makes ``tree_age`` of it."""
        data, at = self.document.text.block_at(self.start)[0].data.decode("latin-1"), self.start - self.base
        for found in SIGNED_NAME.finditer(data, max(0, at - NAME_REACH), at + NAME_REACH):
            if found.start() <= at < found.end():
                return self.edit(self.base + found.start(), self.base + found.end(), found[0].replace("-", "_"))
        return None

    def after_definition(self) -> int:
        """Where a new definition can stand: behind the one round the spot, at the end of its line."""
        node = self.definition
        end = self.base + node.span.end if node is not None else self.end
        text = self.document.text
        rest = text.slice(end, max(end, text.line_start(text.line_of(end) + 1)))
        is_comment = rest.strip().startswith(b"//") or not rest.strip()
        return end + len(rest.rstrip(b"\r\n")) if is_comment else end


def line_break(document: Document) -> str:
    """How the document's first line ends."""
    found = re.search(rb"\r\n|\n|\r", document.text.slice(0, document.text.line_start(1)) if document.text.line_count > 1 else b"")
    return found[0].decode() if found else "\n"


def fresh_name(scene: Scene, *wanted: str) -> str:
    """The first of ``wanted`` that is free in the scene, or the last with a number."""
    number = 1
    candidates = list(wanted)
    while True:
        for name in candidates:
            if name not in scene.entries and not scene.users.get(name) and not vocabulary.kind_of(name):
                return name
        number += 1
        candidates = [f"{wanted[-1]}{number}"]


# --- looking at syntax


def terms(node: object) -> Iterator[syntax.Term]:
    """All terms of a definition's productions and entry action, outer ones first."""
    match node:
        case syntax.Selection():
            if node.entry is not None:
                yield node.entry
            for production in node.productions:
                yield from terms(production)
        case syntax.If():
            yield from terms(node.then)
            yield from terms(node.otherwise)
        case syntax.Rule():
            for alternative in node.alternatives:
                yield from terms(alternative.body)
        case syntax.Union():
            for term in node.terms:
                yield term
                for item in term.items:
                    if isinstance(item, syntax.Group):
                        yield from terms(item.union)


def rules(
    node: syntax.Production | None, inside: syntax.If | None = None
) -> Iterator[tuple[syntax.Rule, syntax.If | None]]:
    """The rules of a production, each with the `if` whose ``then`` it is (None: it has no condition of its own)."""
    while isinstance(node, syntax.If):
        yield from rules(node.then, node)
        node, inside = node.otherwise, None
    if node is not None:
        yield node, inside


def name_of(item: object) -> syntax.Name | None:
    """The name of an item of a term: of a name or call."""
    if isinstance(item, syntax.Call):
        return item.name
    return item if isinstance(item, syntax.Name) else None


def uses_at(scene: Scene, name: str, roles: tuple[str, ...] = ("read",)) -> list[Place]:
    return [place for place in scene.uses(name) if place.role in roles]
