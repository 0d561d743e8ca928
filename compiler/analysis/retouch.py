"""What is typed into one token, white space or a comment: what was read from the block before, with that token changed and what
follows it moved.

Most keys of an editing session go into a name or a number. The text then has the same tokens as before, so that its syntax
tree is the same but for one leaf and for the places behind it: nothing needs to be parsed or read again. Where anything else
may follow from the edit, it isn't done here: in words that mean something to the grammar, in what has messages (but those
about the number itself), or where the reader looks at columns.

Example: of ``Transformation T { roty angel; scale 2; }`` read before, one letter more in ``angel`` changes one name of
its syntax, and moves ``scale 2`` on by one.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import deque
from dataclasses import replace
from functools import cache
from itertools import repeat
from operator import attrgetter
from typing import NamedTuple

from ..reading import syntax, vocabulary
from ..reading.diagnostics import Diagnostic, Diagnostics
from ..reading.grammar import language
from ..reading.ignore import WORD as IGNORE_WORD
from ..reading.parse import sharpen
from ..reading.parse_statements import FOREIGN
from ..reading.parse_values import Reading, number_at
from ..reading.source import Span
from .facts import Definition, Facts
from .text import Block

_NAME = re.compile(rb"[A-Za-z_][A-Za-z0-9_]*")
# The grammar's token; where both alternatives fit, the first one is longer.
_NUMBER = re.compile(rb"[0-9]+(?:\.[0-9]+)?[eE][+-][0-9]+[A-Za-z0-9_.]*|\.?[0-9][A-Za-z0-9_.]*")
_RENAMING = frozenset(("definition", "write"))
_IN_WORDS = frozenset(bytes((each,)) for each in b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.")
_BLANKS = re.compile(rb"[ \t]*")
# Statements that end in their line, strings and a comment in it apart.
_REST = re.compile(rb'(?:[^/"\r\n]*(?:"[^"\\\r\n]*"[^/"\r\n]*)*[;{}])?[ \t]*(?://[^\r\n]*)?(?=[\r\n]|\Z)')

# Definitions with operations in them: where one goes on in a later line, the reader looks at columns.
_WITH_COLUMNS = (syntax.Selection, syntax.Calculation, syntax.Transformation)

_END = attrgetter("node.span.end")

_set_source, _set_start, _set_end = Span.source.__set__, Span.start.__set__, Span.end.__set__
_set_name = syntax.Name.name.__set__
_set_value, _set_text = syntax.Number.value.__set__, syntax.Number.text.__set__


@cache
def _reserved() -> frozenset[str]:
    """Names that the grammar or the reader of statements has a meaning for."""
    grammar = language()
    kinds = (grammar.node_kind_for_id(i) for i in range(grammar.node_kind_count))
    return frozenset((*filter(None, kinds), *FOREIGN))


@cache
def _words() -> frozenset[str]:
    """Names that mean something of their own in scene blocks, too."""
    return _reserved().union((row.name for row in vocabulary.ALL.values()), vocabulary.COLOURS, vocabulary.UNSUPPORTED)


@cache
def _fields(kind: type) -> tuple[str, ...]:
    """The fields of a kind of syntax node that may hold others."""
    slots = (name for each in kind.__mro__ for name in getattr(each, "__slots__", ()))
    return tuple(name for name in slots if name != "span")


def _is_plain(block: Block) -> bool:
    """Whether ``block`` is one definition with no scene blocks in it."""
    return block.shape.hard and not block.data.startswith(b"#") and block.data.count(b"{") <= 1


class Touch(NamedTuple):
    """The name or number ``leaf`` is ``text`` now; None where the edit is beside all tokens. What began or ended at or behind the
    byte ``end`` does so ``by`` bytes later. ``index`` is the name's number among the facts' names, None where these
    have to be found anew; ``number`` what a number is read as, and ``said`` what is wrong with it.
    ``renames``: other names may be defined or assigned now, or of another kind."""

    leaf: syntax.Name | syntax.Number | None
    text: str
    end: int
    by: int
    index: int | None = None
    number: syntax.Number | None = None
    said: tuple[Diagnostic, ...] = ()
    renames: bool = False


def touch_of(old: Block, new: Block) -> Touch | None:
    """The one token that makes all the difference between ``old``, which has been read, and ``new``, which has taken its place;
    None where there is more to it."""
    facts, edit = old.__dict__.get("facts"), new.before
    if facts is None or edit is None or edit[0] is not old or "facts" in new.__dict__:
        return None
    if facts.ghosts or facts.includes or facts.text is not old.data:
        return None
    low, high, put = edit[1]
    for each in facts.syntax:
        if low < each.span.start or each.span.end < high:
            return None
    leaf, index = None, None
    if facts.text[low - 1 : low] in _IN_WORDS or facts.text[high : high + 1] in _IN_WORDS:
        index = _name_at(facts, low, high)
        leaf = facts.names[index].node if index is not None else _leaf_at(facts, low, high)
    if facts.syntax and facts.tree.root_node.has_error:
        return None  # what is said of the number may hide it
    for each in facts.syntax:
        if leaf is None or each.span is not leaf.span:
            return None
    if leaf is None:
        return _beside_tokens(facts, new, low, high, put)
    by = len(new.data) - len(old.data)
    if not _ends_statements(facts, new, leaf.span.end + by):
        return None
    return _in_name(facts, new, leaf, index, by) if isinstance(leaf, syntax.Name) else _in_number(new, leaf, by)


def _name_at(facts: Facts, low: int, high: int) -> int | None:
    """The number of the name that the bytes from ``low`` to ``high`` are within or at an end of."""
    names = facts.names
    index = bisect_left(names, high, key=_END)
    return index if index < len(names) and names[index].node.span.start <= low else None


def _leaf_at(facts: Facts, low: int, high: int) -> syntax.Name | syntax.Number | None:
    """As ``_name_at``, of the block's numbers and of the names that are the vocabulary's."""
    waiting: list[object] = list(facts.file.definitions)
    while waiting:
        node = waiting.pop()
        if isinstance(node, tuple):
            waiting += node
        elif isinstance(node, syntax.Node) and node.span.start <= low and high <= node.span.end:
            if isinstance(node, syntax.Name | syntax.Number):
                return node
            waiting += [getattr(node, name) for name in _fields(type(node))]
    return None


def _ends_statements(facts: Facts, new: Block, at: int) -> bool:
    """Whether nothing that stands from the byte ``at`` on in its line goes on in the next one, where its column matters."""
    for each in facts.file.definitions:
        if isinstance(each, _WITH_COLUMNS):
            return _REST.match(new.data, at) is not None
    return True


def _in_name(facts: Facts, new: Block, leaf: syntax.Name, index: int | None, by: int) -> Touch | None:
    start, end = leaf.span.start, leaf.span.end
    match = _NAME.fullmatch(new.data, start, end + by)
    if match is None or facts.text[start:end] != leaf.name.encode() or _names_its_rules(facts, start):
        return None
    text, reserved = match[0].decode(), _reserved()
    if leaf.name in reserved or text in reserved:
        return None
    renames = index is not None and facts.names[index].role in _RENAMING
    if not _is_plain(new):
        renames = renames or any([each is leaf for each in _heads(facts)])
        if index is not None and (leaf.name in _words() or text in _words()):
            index = None
    return Touch(leaf, text, end, by, index, renames=renames)


def _heads(facts: Facts) -> list[syntax.Name]:
    """The names of blocks that are declared, which make the kind of the definition."""
    declared = (each.items[0] for each in facts.file.definitions if isinstance(each, syntax.Declare))
    return [each.name for each in declared if isinstance(each, syntax.Block)]


def _in_number(new: Block, leaf: syntax.Number, by: int) -> Touch | None:
    start, end = leaf.span.start, leaf.span.end
    match = _NUMBER.match(new.data, start)
    if match is None or match.end() != end + by:
        return None
    span, diagnostics = Span(new, start, end + by), Diagnostics()
    number = number_at(Reading(new, new.data, diagnostics), span)
    sharpen(new, new.data, diagnostics)
    if any(each.span is not span for each in diagnostics.items):
        return None
    return Touch(leaf, number.text, end, by, None, number, tuple(diagnostics.items))


def _is_text(data: bytes) -> bool:
    """Whether the reader takes all bytes as they are: a comment may be cut within a character."""
    try:
        return "\0" not in data.decode()
    except UnicodeDecodeError:
        return False


def _beside_tokens(facts: Facts, new: Block, low: int, high: int, put: int) -> Touch | None:
    """An edit of white space that some is left of, or in a comment up to the line's end."""
    old = facts.text
    line = max(old.rfind(b"\n", 0, low), old.rfind(b"\r", 0, low)) + 1
    before, changed = old[line:low], old[low:high] + new.data[low:put]
    if b'"' in before or not before.strip() or b"\n" in changed or b"\r" in changed:
        return None
    is_in_comment = b"//" in before
    if not is_in_comment and changed.strip(b" \t"):
        return None
    if IGNORE_WORD in old or IGNORE_WORD in new.data or b"/*" in new.data or not _is_text(new.data):
        return None
    by = put - high
    if is_in_comment:
        return Touch(None, "", high, by)
    blanks = _BLANKS.match(old, high).end()  # type: ignore[union-attr]
    if blanks == high and old[low - 1] not in b" \t":
        return None
    return Touch(None, "", blanks, by) if _ends_statements(facts, new, blanks + by) else None


def retouch(old: Block, new: Block, touch: Touch) -> None:
    """Give ``new`` the facts of ``old``, which are then ``old``'s no more."""
    facts = old.__dict__.pop("facts")
    move(facts, new, touch.end, touch.by)
    leaf = touch.leaf
    if isinstance(leaf, syntax.Name):
        if touch.index is not None:
            facts.renamed(leaf.name, touch.text)
        _set_name(leaf, touch.text)
    elif touch.number is not None:
        _set_value(leaf, touch.number.value)
        _set_text(leaf, touch.text)
        facts.syntax[:] = [replace(each, span=leaf.span) for each in touch.said]
    if touch.index is not None:
        facts.retouched()
        if touch.renames and facts.names[touch.index].role == "definition":
            facts.definitions[:] = [Definition(each.node.name.name, each.kind, each.node) for each in facts.definitions]
    elif isinstance(leaf, syntax.Name):
        # Which words of a scene block are the scene's depends on the others.
        facts.retouched("words", "names", "definitions", "assigned")
    else:
        facts.retouched("is_broken")
    new.__dict__.update(facts=facts, before=None)


def _names_its_rules(facts: Facts, start: int) -> bool:
    """Whether what the first line of a Selection is depends on the name at ``start``: its own name, or one in an entry
    action."""
    for each in facts.definitions:
        if each.kind == "selection" and each.node.entry is not None and start < each.node.entry.span.end:
            return True
    return False


def move(facts: Facts, block: Block, end: int, by: int) -> None:
    """Let all places be those of ``block``, which has ``by`` bytes more before the byte that was at ``end``. The one place
    where spans change: nobody else has them but messages and values that are made anew."""
    deque(map(_set_source, facts.spans, repeat(block)), 0)
    if not by:
        return
    for span in facts.spans:
        if (last := span.end) >= end:
            _set_end(span, last + by)
            if (first := span.start) >= end:
                _set_start(span, first + by)
