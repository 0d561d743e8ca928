"""Letters typed into a name: what was read from the block before, with the name changed and what follows it moved.

Most keys of an editing session go into a name. The text then has the same tokens as before, so that its syntax tree is the
same but for one name and for the places behind it: nothing needs to be parsed or read again. Where anything else may
follow from the edit, it isn't done here: in words that mean something of their own, in what has messages, or where the
reader looks at columns.

Example: of ``Transformation T { roty angel; scale 2; }`` read before, one letter more in ``angel`` changes one name of
its syntax, and moves ``scale 2`` on by one.
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from ..reading import syntax, vocabulary
from ..reading.grammar import language
from ..reading.parse_statements import FOREIGN
from ..reading.source import Span
from .facts import Definition, Facts, Name
from .text import Block

_NAME = re.compile(rb"[A-Za-z_][A-Za-z0-9_]*")
_REST = re.compile(rb"[^/\r\n]*[;{}][ \t]*(?=[\r\n]|\Z)")

_set_source, _set_start, _set_end = Span.source.__set__, Span.start.__set__, Span.end.__set__
_set_name = syntax.Name.name.__set__


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


def _is_plain(block: Block) -> bool:
    """Whether ``block`` is one definition with no scene blocks in it."""
    return block.shape.hard and not block.data.startswith(b"#") and block.data.count(b"{") <= 1


class Touch(NamedTuple):
    """The number of a name among the facts' names, what it is now, and how many bytes longer."""

    index: int
    text: str
    by: int


def touch_of(old: Block, new: Block) -> Touch | None:
    """The name that makes all the difference between ``old``, which has been read, and ``new``, which has taken its place;
    None where there is more to it."""
    facts, edit = old.__dict__.get("facts"), new.before
    if facts is None or edit is None or edit[0] is not old or "facts" in new.__dict__:
        return None
    if facts.syntax or facts.ghosts or facts.includes or facts.text is not old.data:
        return None
    index = _name_at(facts, *edit[1][:2])
    if index is None:
        return None
    name, by = facts.names[index], len(new.data) - len(old.data)
    match = _NAME.fullmatch(new.data, name.start, name.end + by)
    if match is None or _REST.match(new.data, match.end()) is None or _names_its_rules(facts, name.start):
        return None
    text, words = match[0].decode(), _reserved() if _is_plain(old) else _words()
    return None if name.name in words or text in words else Touch(index, text, by)


def retouch(old: Block, new: Block, touch: Touch) -> Span:
    """Give ``new`` the facts of ``old``, which are then ``old``'s no more; the place of the name that has changed."""
    facts = old.__dict__.pop("facts")
    name = facts.names[touch.index]
    move(facts, new, name.end, touch.by)
    _rename(facts, touch)
    facts.retouched()
    new.__dict__.update(facts=facts, before=None)
    return name.node.span


def _name_at(facts: Facts, low: int, high: int) -> int | None:
    """The number of the name that the bytes from ``low`` to ``high`` are within or at an end of."""
    for index, name in enumerate(facts.names):
        if high <= name.end:
            return index if name.start <= low else None
    return None


def _names_its_rules(facts: Facts, start: int) -> bool:
    """Whether what the first line of a Selection is depends on the name at ``start``: its own name, or one in an entry
    action."""
    return any(
        isinstance(each.node, syntax.Selection) and each.node.entry is not None and start < each.node.entry.span.end
        for each in facts.definitions
    )


def move(facts: Facts, block: Block, end: int, by: int) -> None:
    """Let all places be those of ``block``, which has ``by`` bytes more before the byte that was at ``end``. The one place
    where spans change: nobody else has them but messages and values that are made anew."""
    for span in facts.spans:
        _set_source(span, block)
        if by and span.end >= end:
            _set_end(span, span.end + by)
            if span.start >= end:
                _set_start(span, span.start + by)


def _rename(facts: Facts, touch: Touch) -> None:
    index, text, by = touch
    names, name = facts.names, facts.names[index]
    _set_name(name.node, text)
    names[index] = Name(text, name.role, name.start, name.end + by, name.node)
    if by:
        names[index + 1 :] = [
            Name(each.name, each.role, each.start + by, each.end + by, each.node) for each in names[index + 1 :]
        ]
    if name.role == "definition":
        facts.definitions[:] = [Definition(each.node.name.name, each.kind, each.node) for each in facts.definitions]
