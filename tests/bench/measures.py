"""The measures of `make bench` by name, in the order in which they run."""

from __future__ import annotations

from against_peers import fern, figure, forest, menger, order20, residency, terrain
from own_curves import fronts, growth, scatter, threads
from whole_process import split_by_hand, start, unique

MEASURES = {
    "start": start,
    "figure": figure,
    "order20": order20,
    "menger": menger,
    "residency": residency,
    "forest": forest,
    "unique": unique,
    "fern": fern,
    "terrain": terrain,
    "scatter": scatter,
    "threads": threads,
    "mitsuba": split_by_hand,
    "fronts": fronts,
    "growth": growth,
}
