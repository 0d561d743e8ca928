"""What one block says, read from its own text: definitions, names used, includes, syntax messages.

Block → :class:`Facts`, worked out once a block and kept with it. Nothing here depends on other blocks, so an edit
costs the facts of the blocks it touched.

Example: the facts of ``Selection A { A -> C_step A; }`` are one definition (``A``, a selection), and the names ``A``
(definition, target, read) and ``C_step`` (read).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

from ..reading import mistakes, syntax, vocabulary
from ..reading.diagnostics import Diagnostic, Diagnostics
from ..reading.grammar import syntax_tree
from ..reading.parse import convert
from ..reading.records import lazy_property
from ..reading.resolve_names import assigned_names, kind_of_definition
from ..reading.source import Span
from .text import Block, Change

if TYPE_CHECKING:
    from tree_sitter import Tree

# From this size on, a block's tree is made from the tree before the edit; below, a fresh parse is as quick.
INCREMENTAL_BYTES = 8192

_HEAD = re.compile(rb"(?m)^\W*?(\w+)(?:[ \t]+(\w+))?")

_PLACE = attrgetter("node.span.start", "node.span.end")


class Name(NamedTuple):
    """An occurrence of a name of the scene. ``role`` is definition, write (a Calculation assigns it, or it is a
    Selection's parameter), target (left of an arrow) or read; ``node`` is its syntax. ``start`` and ``end`` are bytes in
    the block."""

    role: str
    node: syntax.Name

    @property
    def name(self) -> str:
        return self.node.name

    @property
    def start(self) -> int:
        return self.node.span.start

    @property
    def end(self) -> int:
        return self.node.span.end


class Definition(NamedTuple):
    """A name that a block defines; ``kind`` as in :class:`plsys.compiler.reading.model.Definition`, ``node`` its
    syntax. A scene block such as ``camera`` has the kind 'block'."""

    name: str
    kind: str
    node: syntax.Definition

    @property
    def name_span(self) -> Span:
        return self.node.name.span


@dataclass(eq=False)
class Facts:
    """See the module. They stay the same object while one token at a time is edited (retouch.py). ``text`` is what was parsed;
    ``definitions`` are those that name something; ``blocks`` are scene blocks; ``assigned`` are the names that get values, in text order; ``ghosts`` are
    definitions of an earlier text that this one has lost to a syntax error; ``spans`` are all places in ``file``, if
    there are no messages in ``syntax``; ``right`` are the last texts that nothing was wrong with, and when
    that was (Namespace.now)."""

    text: bytes
    _tree: Tree | None
    file: syntax.File
    spans: list[Span] = field(repr=False)
    syntax: list[Diagnostic]
    ghosts: dict[str, Definition] = field(default_factory=dict)
    right: dict[bytes, int] = field(default_factory=dict)

    @property
    def block(self) -> Block:
        """The block that this is about now."""
        return self.file.span.source  # type: ignore[return-value]

    @property
    def tree(self) -> Tree:
        if self._tree is None:
            self._tree = syntax_tree(self.text)
        return self._tree

    def retouched(self, *others: str) -> None:
        """The text has changed, and with it places in the syntax; ``others`` are properties that did not follow."""
        self.text, self._tree = self.file.span.source.data, None
        for each in ("headwords", *others):
            self.__dict__.pop(each, None)

    @lazy_property
    def definitions(self) -> list[Definition]:
        found = []
        for node in self.file.definitions:
            if not isinstance(node, syntax.Block | syntax.Include) and node.name.name:
                found.append(Definition(node.name.name, kind_of_definition(node), node))
        return found

    @lazy_property
    def blocks(self) -> list[syntax.Block]:
        return [node for node in self.file.definitions if isinstance(node, syntax.Block)]

    @lazy_property
    def includes(self) -> list[syntax.Include]:
        return [node for node in self.file.definitions if isinstance(node, syntax.Include)]

    @lazy_property
    def assigned(self) -> list[syntax.Name]:
        return [name for node in self.file.definitions for name in assigned_names(node) if name.name]

    @lazy_property
    def names(self) -> list[Name]:
        """All occurrences of names that may be the scene's own, in text order."""
        found: list[Name] = []
        for node in self.file.definitions:
            _names_of(node, found)
        places = {place: each for place, each in zip(map(_PLACE, found), found) if each.node.name}
        return [places[place] for place in sorted(places)]

    @lazy_property
    def words(self) -> dict[str, int]:
        """The names that occur, and how often."""
        found: dict[str, int] = {}
        for each in self.names:
            name = each.node.name
            found[name] = found.get(name, 0) + 1
        return found

    def renamed(self, old: str, new: str) -> None:
        """One of ``names`` was ``old`` and is ``new``."""
        words = self.words
        words[new] = words.get(new, 0) + 1
        if words[old] > 1:
            words[old] -= 1
        else:
            del words[old]

    @lazy_property
    def headwords(self) -> frozenset[str]:
        """The first two words of each line, one of which is the name where a line defines something."""
        return frozenset(word.decode() for line in _HEAD.finditer(self.text) for word in line.groups() if word)

    @lazy_property
    def is_broken(self) -> bool:
        return any([item.severity == "error" for item in self.syntax])


def facts_of(block: Block) -> Facts:
    """The block's facts; read at the first call."""
    found = block.__dict__.get("facts")
    if found is None:
        found = block.__dict__["facts"] = _read(block)
        block.__dict__["before"] = None  # of no more use, and a chain of all texts there ever were
    return found


def prepare_messages() -> None:
    """Load what only texts with mistakes need (some milliseconds), before the first mistake is typed."""
    import difflib  # noqa: F401

    from ..reading import habits  # noqa: F401


def drop_facts(block: Block) -> None:
    """Let go of what was read from a block that is gone. Syntax nodes name their block and the block has them: that
    would be garbage in cycles at every key, and the search for it takes longer than a key may."""
    if block.is_gone:
        block.__dict__.pop("facts", None)


def keep_lost(change: Change) -> None:
    """Definitions that a syntax error has swallowed live on in a block that is broken now, so that a half-typed line
    isn't answered by messages wherever its block is used."""
    broken = next((block for block in change.added if facts_of(block).is_broken), None)
    if broken is None:
        return
    kept = {d.name for block in change.added for d in facts_of(block).definitions}
    for block in change.removed:
        facts = facts_of(block)
        for each in (*facts.ghosts.values(), *facts.definitions):
            if each.name not in kept and each.name in facts_of(broken).headwords:
                facts_of(broken).ghosts[each.name] = each


def _read(block: Block) -> Facts:
    diagnostics = Diagnostics()
    text = mistakes.clean(block, diagnostics)
    tree = syntax_tree(text, _old_tree(block))
    spans: list[Span] = []
    file = convert(block, text, tree, diagnostics, spans)
    return Facts(text, tree, file, spans, diagnostics.items)


def _old_tree(block: Block) -> Tree | None:
    """The tree of the block before the edit, told of the edit; None where that isn't worth the while."""
    if block.before is None or len(block.data) < INCREMENTAL_BYTES:
        return None
    old, (start, old_end, new_end) = block.before
    facts: Facts | None = old.__dict__.get("facts")
    if facts is None:
        return None
    tree = facts.tree.copy()
    tree.edit(start, old_end, new_end, _point(old, start), _point(old, old_end), _point(block, new_end))
    return tree


def _point(block: Block, offset: int) -> tuple[int, int]:
    """Row and column as tree-sitter counts them: only a line feed ends a row. (A plain tuple: this version of
    py-tree-sitter frees a Point that Python made once too often.)"""
    row = block.data.count(b"\n", 0, offset)
    return row, offset - (block.data.rfind(b"\n", 0, offset) + 1)


# --- names


def _names_of(node: syntax.Definition, found: list[Name]) -> None:
    match node:
        case syntax.Block():
            _block(node, found)
        case syntax.Declare():
            found.append(Name("definition", node.name))
            _items(node.items, frozenset(), found)
        case syntax.ParameterDeclaration():
            found.append(Name("definition", node.name))
            for each in (node.value, node.low, node.high):
                _expression(each, found)
        case syntax.Selection():
            found.append(Name("definition", node.name))
            found += [Name("write", name) for name in node.parameters]
            if node.entry is not None:
                _term(node.entry, found)
            for production in node.productions:
                _production(production, found)
        case syntax.Calculation() | syntax.Transformation():
            found.append(Name("definition", node.name))
            _statements(node.statements, found)
        case syntax.Texture():
            found.append(Name("definition", node.name))
            _block(node.block, found)


def _block(node: syntax.Block, found: list[Name]) -> None:
    _items(node.items, _words_of(node.name.name), found)


def _words_of(block: str) -> frozenset[str]:
    """The names that mean something of their own in a block of this name."""
    found = _WORDS.get(block)
    if found is None:
        found = _WORDS[block] = frozenset(
            (*vocabulary.PROPERTIES.get(block, ()), *vocabulary.MODIFIERS, *vocabulary.COLOUR_WORDS)
        )
    return found


_WORDS: dict[str, frozenset[str]] = {}
_FLAGS = frozenset(row.name for row in vocabulary.ALL.values() if row.type == "flag")


def _items(items: tuple, words: frozenset[str], found: list[Name]) -> None:
    """``words`` are properties where one may stand; where a value must, the same name is the scene's."""
    needs_value = False
    for item in items:
        if isinstance(item, syntax.Block):
            _block(item, found)
        elif isinstance(item, syntax.MapEntry):
            _items(item.items, _words_of(""), found)
        elif (
            isinstance(item, syntax.Name)
            and item.name in words
            and not (needs_value and item.name not in vocabulary.COLOUR_WORDS)
        ):
            needs_value = item.name not in _FLAGS
            continue
        else:
            _expression(item, found)
        needs_value = False


def _expression(node: syntax.Expression | None, found: list[Name]) -> None:
    match node:
        case syntax.Name():
            found.append(Name("read", node))
        case syntax.Call():
            found.append(Name("read", node.name))
            for each in node.arguments:
                _expression(each, found)
        case syntax.Vector():
            for each in node.components:
                _expression(each, found)
        case syntax.Unary():
            _expression(node.operand, found)
        case syntax.Binary():
            _expression(node.left, found)
            _expression(node.right, found)
        case syntax.Conditional():
            for each in (node.test, node.then, node.otherwise):
                _expression(each, found)


def _statements(statements: tuple[syntax.Statement, ...], found: list[Name]) -> None:
    for statement in statements:
        if isinstance(statement, syntax.Assignment):
            found.append(Name("write", statement.target))
            _expression(statement.value, found)
        else:
            found.append(Name("read", statement.name))
            for each in statement.arguments:
                _expression(each, found)


def _production(node: syntax.Production | None, found: list[Name]) -> None:
    while isinstance(node, syntax.If):
        _expression(node.test, found)
        _production(node.then, found)
        node = node.otherwise
    if node is None:
        return
    if isinstance(node.target, syntax.Call):
        found.append(Name("target", node.target.name))
        for each in node.target.arguments:
            _expression(each, found)
    else:
        found.append(Name("target", node.target))
    for alternative in node.alternatives:
        _expression(alternative.weight, found)
        if alternative.body is not None:
            _union(alternative.body, found)


def _union(node: syntax.Union, found: list[Name]) -> None:
    for term in node.terms:
        _term(term, found)


def _term(node: syntax.Term, found: list[Name]) -> None:
    for item in node.items:
        if isinstance(item, syntax.Group):
            _union(item.union, found)
        elif isinstance(item, syntax.Inline):
            _statements(item.statements, found)
        elif isinstance(item, syntax.Block):
            _block(item, found)
        else:
            _expression(item, found)
