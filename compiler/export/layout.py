"""Where the nodes of a diagram stand: layers from top to bottom, few crossings, straight long edges.

The method is Sugiyama's (Sugiyama, Tagawa & Toda 1981): longest-path layers, invisible nodes where an edge
passes a layer, barycentres for the order, and then several sweeps that pull each node towards its neighbours.
Edges that close cycles take no part; they are led around the outside.

Example: ``layout(diagram, widths).position[0]`` is the (x, y) of the root's circle, in points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable

from .drawing import Diagram, Edge

LAYER_HEIGHT = 62.0
GAP = 22.0
SWEEPS = 24


@dataclass
class Layout:
    """``position`` of each node; ``bends`` of each edge: the points at which it passes the layers between its
    ends."""

    position: list[tuple[float, float]]
    bends: list[list[tuple[float, float]]]
    layer: list[int]


def layout(
    picture: Diagram, extents: list[tuple[float, float]], label_width: Callable[[str], float]
) -> Layout:
    """``extents`` are each node's reach to the left and to the right of its centre. An edge with a label has
    at least one bend, the first, and room for the label there."""
    layer = _layers(picture)
    slots = [*layer]
    reach = [*extents]
    links: list[tuple[int, int]] = []
    passes: list[list[int]] = []
    for edge in picture.edges:
        chain = []
        if not edge.is_back:
            for level in range(layer[edge.source] + 1, layer[edge.target]):
                half = max(5.0, label_width(edge.label) / 2 if not chain else 0.0)
                chain.append(len(slots))
                slots.append(level)
                reach.append((half, half))
            whole = [edge.source, *chain, edge.target]
            links += zip(whole, whole[1:])
        passes.append(chain)
    x = _place(_order(slots, links), slots, reach, links)
    y = [LAYER_HEIGHT * level for level in slots]
    return Layout(
        position=[(x[i], y[i]) for i in range(len(picture.nodes))],
        bends=[[(x[i], y[i]) for i in chain] for chain in passes],
        layer=layer,
    )


def _forward(picture: Diagram) -> list[Edge]:
    return [edge for edge in picture.edges if not edge.is_back]


def _layers(picture: Diagram) -> list[int]:
    """Each node one below the lowest of its parents, two where the edge has a label."""
    layer = [0] * len(picture.nodes)
    waiting = [0] * len(picture.nodes)
    children: list[list[Edge]] = [[] for _ in picture.nodes]
    for edge in _forward(picture):
        waiting[edge.target] += 1
        children[edge.source].append(edge)
    ready = [i for i, count in enumerate(waiting) if count == 0]
    while ready:
        node = ready.pop()
        for edge in children[node]:
            layer[edge.target] = max(layer[edge.target], layer[node] + (2 if edge.label else 1))
            waiting[edge.target] -= 1
            if waiting[edge.target] == 0:
                ready.append(edge.target)
    return layer


def _neighbours(count: int, links: list[tuple[int, int]]) -> tuple[list[list[int]], list[list[int]]]:
    above: list[list[int]] = [[] for _ in range(count)]
    below: list[list[int]] = [[] for _ in range(count)]
    for a, b in links:
        above[b].append(a)
        below[a].append(b)
    return above, below


def _order(slots: list[int], links: list[tuple[int, int]]) -> list[list[int]]:
    """The nodes of each layer from left to right. Starts in derivation order; keeps the best of several
    sweeps."""
    rows: list[list[int]] = [[] for _ in range(max(slots, default=-1) + 1)]
    above, below = _neighbours(len(slots), links)
    seen: set[int] = set()
    stack = [i for i in range(len(slots) - 1, -1, -1) if not above[i]]
    while stack:
        node = stack.pop()
        if node not in seen:
            seen.add(node)
            rows[slots[node]].append(node)
            stack.extend(reversed(below[node]))
    best, fewest = [list(row) for row in rows], _crossings(rows, below)
    for sweep in range(SWEEPS):
        downwards = sweep % 2 == 0
        rank = {node: i for row in rows for i, node in enumerate(row)}
        for row in rows if downwards else reversed(rows):
            near = above if downwards else below
            row.sort(key=lambda n: sum(rank[m] for m in near[n]) / len(near[n]) if near[n] else rank[n])
            rank.update((node, i) for i, node in enumerate(row))
        count = _crossings(rows, below)
        if count < fewest:
            best, fewest = [list(row) for row in rows], count
    return best


def _crossings(rows: list[list[int]], below: list[list[int]]) -> int:
    total = 0
    for row, under in zip(rows, rows[1:]):
        rank = {node: i for i, node in enumerate(under)}
        ends = [rank[child] for node in row for child in sorted(below[node], key=rank.__getitem__)]
        total += sum(a > b for i, a in enumerate(ends) for b in ends[i + 1 :])
    return total


def _place(
    rows: list[list[int]], slots: list[int], reach: list[tuple[float, float]], links: list[tuple[int, int]]
):
    """x of every node: rows keep their order and distances, and follow their neighbours' means as far as they
    can."""
    above, below = _neighbours(len(slots), links)
    x = [0.0] * len(slots)
    for row in rows:
        _settle(row, [0.0] * len(row), x, reach)
    for sweep in range(2 * SWEEPS):
        downwards = sweep % 2 == 0
        is_last = sweep >= 2 * SWEEPS - 2
        for row in rows if downwards else reversed(rows):
            near = above if downwards else below
            wanted = []
            for node in row:
                others = near[node] or (below[node] if downwards else above[node])
                if not is_last and sweep >= SWEEPS:
                    others = above[node] + below[node]
                wanted.append(sum(x[m] for m in others) / len(others) if others else x[node])
            _settle(row, wanted, x, reach)
    return x


def _settle(row: list[int], wanted: list[float], x: list[float], reach: list[tuple[float, float]]) -> None:
    """The positions nearest to ``wanted`` (least squares) that keep the row apart: blocks that touch merge
    and share their mean (pool adjacent violators)."""
    offset, total = [], 0.0
    for i, node in enumerate(row):
        if i:
            total += reach[row[i - 1]][1] + GAP + reach[node][0]
        offset.append(total)
    blocks: list[list[float]] = []  # sum of (wanted - offset), count
    for want, shift in zip(wanted, offset):
        blocks.append([want - shift, 1])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] >= blocks[-1][0] / blocks[-1][1]:
            value, count = blocks.pop()
            blocks[-1][0] += value
            blocks[-1][1] += count
    bases = [value / count for value, count in blocks for _ in range(int(count))]
    for node, base, shift in zip(row, bases, offset):
        x[node] = base + shift
