"""What one block says, read from its own text: definitions, names used, includes, syntax messages.

Block → :class:`Facts`, worked out once a block and kept with it. Nothing here depends on other blocks, so an edit
costs the facts of the blocks it touched.

Example: the facts of ``Selection A { A -> C_step A; }`` are one definition (``A``, a selection), and the names ``A``
(definition, target, read) and ``C_step`` (read).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Iterator, NamedTuple

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
        """The text has changed, and with it all else but the tree and what follows from names; ``others`` are properties that
        did not follow."""
        self.text, self._tree = self.file.span.source.data, None
        for each in ("is_broken", *others):
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
        found = [name for node in self.file.definitions for name in _names_of(node)]
        return sorted(
            {(name.start, name.end): name for name in found if name.node.name}.values(), key=lambda n: n.start
        )

    @lazy_property
    def words(self) -> frozenset[str]:
        """The names that occur."""
        return frozenset([name.node.name for name in self.names])

    @lazy_property
    def is_broken(self) -> bool:
        return any(item.severity == "error" for item in self.syntax)


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
            if each.name not in kept:
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


def _occurrence(name: syntax.Name, role: str = "read") -> Name:
    return Name(role, name)


def _names_of(node: syntax.Definition) -> Iterator[Name]:
    match node:
        case syntax.Block():
            yield from _block(node)
        case syntax.Declare():
            yield _occurrence(node.name, "definition")
            yield from _items(node.items, frozenset())
        case syntax.ParameterDeclaration():
            yield _occurrence(node.name, "definition")
            for each in (node.value, node.low, node.high):
                yield from _expression(each)
        case syntax.Selection():
            yield _occurrence(node.name, "definition")
            for name in node.parameters:
                yield _occurrence(name, "write")
            if node.entry is not None:
                yield from _term(node.entry)
            for production in node.productions:
                yield from _production(production)
        case syntax.Calculation() | syntax.Transformation():
            yield _occurrence(node.name, "definition")
            yield from _statements(node.statements)
        case syntax.Texture():
            yield _occurrence(node.name, "definition")
            yield from _block(node.block)


def _block(node: syntax.Block) -> Iterator[Name]:
    yield from _items(node.items, _words_of(node.name.name))


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


def _items(items: tuple, words: frozenset[str]) -> Iterator[Name]:
    """``words`` are properties where one may stand; where a value must, the same name is the scene's."""
    needs_value = False
    for item in items:
        if isinstance(item, syntax.Block):
            yield from _block(item)
        elif isinstance(item, syntax.MapEntry):
            yield from _items(item.items, _words_of(""))
        elif (
            isinstance(item, syntax.Name)
            and item.name in words
            and not (needs_value and item.name not in vocabulary.COLOUR_WORDS)
        ):
            needs_value = item.name not in _FLAGS
            continue
        else:
            yield from _expression(item)
        needs_value = False


def _expression(node: syntax.Expression | None) -> Iterator[Name]:
    match node:
        case syntax.Name():
            yield _occurrence(node)
        case syntax.Call():
            yield _occurrence(node.name)
            for each in node.arguments:
                yield from _expression(each)
        case syntax.Vector():
            for each in node.components:
                yield from _expression(each)
        case syntax.Unary():
            yield from _expression(node.operand)
        case syntax.Binary():
            yield from _expression(node.left)
            yield from _expression(node.right)
        case syntax.Conditional():
            for each in (node.test, node.then, node.otherwise):
                yield from _expression(each)


def _statements(statements: tuple[syntax.Statement, ...]) -> Iterator[Name]:
    for statement in statements:
        if isinstance(statement, syntax.Assignment):
            yield _occurrence(statement.target, "write")
            yield from _expression(statement.value)
        else:
            yield _occurrence(statement.name)
            for each in statement.arguments:
                yield from _expression(each)


def _production(node: syntax.Production | None) -> Iterator[Name]:
    while isinstance(node, syntax.If):
        yield from _expression(node.test)
        yield from _production(node.then)
        node = node.otherwise
    if node is None:
        return
    if isinstance(node.target, syntax.Call):
        yield _occurrence(node.target.name, "target")
        for each in node.target.arguments:
            yield from _expression(each)
    else:
        yield _occurrence(node.target, "target")
    for alternative in node.alternatives:
        yield from _expression(alternative.weight)
        if alternative.body is not None:
            yield from _union(alternative.body)


def _union(node: syntax.Union) -> Iterator[Name]:
    for term in node.terms:
        yield from _term(term)


def _term(node: syntax.Term) -> Iterator[Name]:
    for item in node.items:
        if isinstance(item, syntax.Group):
            yield from _union(item.union)
        elif isinstance(item, syntax.Inline):
            yield from _statements(item.statements)
        elif isinstance(item, syntax.Block):
            yield from _block(item)
        else:
            yield from _expression(item)
