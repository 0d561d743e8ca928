"""Did you mean …: the name that is most like a wrong one.

name, candidates → a hint such as ``did you mean 'Tree'?``, or ''. Few candidates are all compared. Of many, only those
are that stand next to the name in the order of their heads or of their tails: a slip of the finger leaves one of the
two as it was. An editor keeps its names in :class:`NameIndex`\\ es, where that costs the logarithm of their number.

Example: ``nearest("Tre", ["Tree", "Bush"])`` is ``"did you mean 'Tree'?"``.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Iterable, Sequence

# From this number of candidates on, only the likeliest ones are compared: a comparison takes some 30 µs.
MANY_NAMES = 200
NEIGHBOURS = 8
LIKELIEST = 8

# difflib's ratio from which on two names are alike.
CLOSE = 0.6


class NameIndex:
    """Distinct names, in the order of their heads and of their tails (which are reversed)."""

    def __init__(self, names: Iterable[str] = ()) -> None:
        self.names = set(names)
        self.heads = sorted(self.names)
        self.tails = sorted(name[::-1] for name in self.heads)

    def add(self, name: str) -> None:
        self.names.add(name)
        insort(self.heads, name)
        insort(self.tails, name[::-1])

    def remove(self, name: str) -> None:
        self.names.remove(name)
        del self.heads[bisect_left(self.heads, name)]
        del self.tails[bisect_left(self.tails, name[::-1])]


def nearest(name: str, candidates: Iterable[str]) -> str:
    """A hint that names the closest candidate, or ''."""
    names = list(candidates)
    return _hint(name, names) if len(names) < MANY_NAMES else nearest_of(name, (NameIndex(names),))


def nearest_of(name: str, indexes: Sequence[NameIndex]) -> str:
    """As ``nearest``, of all names in ``indexes``, which have none in common."""
    if sum(len(index.heads) for index in indexes) < MANY_NAMES:
        return _hint(name, [other for index in indexes for other in index.heads])
    shorter = _shorter(name)
    found = _neighbours(name, [index.heads for index in indexes])
    if (slip := _a_letter_off(name, found, shorter)) is not None:
        return f"did you mean '{slip}'?"
    found += [other[::-1] for other in _neighbours(name[::-1], [index.tails for index in indexes])]
    if (slip := _a_letter_off(name, found, shorter)) is not None:
        return f"did you mean '{slip}'?"
    # A letter too many among names that differ by little, such as numbered ones: there the one that was meant is a neighbour
    # in neither order.
    meant = [other for other in shorter for index in indexes if other in index.names]
    if meant and all(other.casefold() != name.casefold() for other in found):
        return f"did you mean '{max(meant)}'?"
    size = len(name)
    alike = {other for other in found if 2 * min(size, len(other)) >= CLOSE * (size + len(other))}  # can be, by their lengths
    return _hint(name, sorted(alike, key=lambda other: (-_alike(name, other), other))[:LIKELIEST])


def _shorter(name: str) -> set[str]:
    """What ``name`` may be without one of its letters; of fewer than three letters nothing, since what is left of them says
    little."""
    return {name[:i] + name[i + 1 :] for i in range(len(name))} if len(name) > 2 else set()


def _a_letter_off(name: str, names: Iterable[str], shorter: set[str]) -> str | None:
    """The one of ``names`` that has a letter more than ``name``, or else one that lacks a letter: by difflib's ratio no
    other is more like a ``name`` of three letters or more, so that the others needn't be compared."""
    size, slips, folded = len(name), [], name.casefold()
    for other in names:
        more = len(other) - size
        if more == 0:
            if other.casefold() == folded:
                return None
        elif (more == -1 and other in shorter) or (more == 1 and _has_one_more(name, other)):
            slips.append(other)
    return max(slips, key=lambda other: (len(other), other), default=None) if size > 2 else None


def _has_one_more(one: str, other: str) -> bool:
    """Whether ``other`` is ``one`` with a letter more: one half of ``one`` is as it was, and the other has that letter."""
    while one:
        half = len(one) // 2
        if one[half:] == other[half + 1 :]:
            one, other = one[:half], other[: half + 1]
        elif one[: half + 1] == other[: half + 1]:
            one, other = one[half + 1 :], other[half + 1 :]
        else:
            return False
    return True


def _hint(name: str, names: list[str]) -> str:
    folded = name.casefold()
    same = next((other for other in names if other.casefold() == folded), None)
    if same is not None:
        return f"did you mean '{same}'?"
    best = _a_letter_off(name, names, _shorter(name)) or _most_like(name, names)
    return f"did you mean '{best}'?" if best else ""


def _most_like(name: str, names: list[str]) -> str:
    """As difflib.get_close_matches, of which only the first is wanted: what can't be better isn't compared."""
    from difflib import SequenceMatcher  # only for who mistypes

    matcher = SequenceMatcher()
    matcher.set_seq2(name)
    best, ratio = "", CLOSE
    for other in names:
        most = min(sum(map(other.__contains__, name)), sum(map(name.__contains__, other)))  # letters that can be in common
        if 2 * most < ratio * (len(name) + len(other)):
            continue
        matcher.set_seq1(other)
        if matcher.quick_ratio() >= ratio:
            found = matcher.ratio()
            if (found, other) >= (ratio, best):
                best, ratio = other, found
    return best


def _neighbours(name: str, ordered: list[list[str]]) -> list[str]:
    """The names right before and right after ``name`` in all of the lists together."""
    before: list[str] = []
    after: list[str] = []
    for names in ordered:
        at = bisect_left(names, name)
        before += names[max(0, at - NEIGHBOURS) : at]
        at += names[at : at + 1] == [name]
        after += names[at : at + NEIGHBOURS]
    return sorted(before)[-NEIGHBOURS:] + sorted(after)[:NEIGHBOURS]


def _alike(name: str, other: str) -> int:
    """The letters that two names have in common at their heads and at their tails."""
    head = _same(name, other)
    return head + _same(name[head:][::-1], other[head:][::-1])


def _same(one: str, other: str) -> int:
    """How many letters two names begin with together."""
    count = 0
    for a, b in zip(one, other):
        if a != b:
            break
        count += 1
    return count
