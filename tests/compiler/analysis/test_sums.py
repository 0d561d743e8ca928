"""Sums of sizes after exchanges are those of the sizes."""

from __future__ import annotations

from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st
from plsys.compiler.analysis.sums import Sums

SIZES = st.lists(st.integers(0, 9), max_size=6)


@given(SIZES, st.lists(st.tuples(st.integers(0, 20), st.integers(0, 4), SIZES, st.booleans()), max_size=12))
def test_they_are_the_sums(sizes, exchanges):
    sums = Sums()
    sums.exchange(0, 0, sizes)
    for at, count, new, is_read in exchanges:
        low = min(at, len(sizes))
        high = min(low + count, len(sizes))
        sums.exchange(low, high, new)
        sizes[low:high] = new
        expected = list(accumulate(sizes, initial=0))
        assert [sums[i] for i in range(len(expected))] == expected
        assert sums.total == expected[-1]
        for value in range(expected[-1] + 2):
            assert sums.find(value) == max(i for i, each in enumerate(expected) if each <= value)
        if is_read:
            assert sums.all() == expected


@given(SIZES.filter(bool), st.lists(st.tuples(st.integers(0, 20), st.integers(0, 9)), max_size=12))
def test_pieces_that_become_longer_or_shorter(sizes, changes):
    sums = Sums()
    sums.exchange(0, 0, sizes)
    for at, size in changes:
        at %= len(sizes)
        sums.grow(at, size - sizes[at])
        sizes[at] = size
        expected = list(accumulate(sizes, initial=0))
        assert [sums[i] for i in range(len(expected))] == expected
        assert sums.total == expected[-1]


def test_what_is_no_piece():
    with pytest.raises(IndexError):
        Sums()[1]
