"""Put symbols that only arrange others into the productions that enter them, each term below one transformation.

before ::                                 after ::

    3 rule 0 -> 4                             3 rule 0 -> 13
    4 transform <0.5 0 0 0 …> -> 5            8 enter -> 2
    5 enter -> 6                              10 enter -> 2
    6 symbol Ends -> 7                        11 transform <0.5 0 0 0 …> -> 8
    7 rule 1 -> 12                            12 transform <0.5 0 0 1 …> -> 10
    8 enter -> 2                              13 union 11 12
    9 transform <1 0 0 2 …> -> 10             …
    10 enter -> 2
    12 union 8 9

A ray is mapped down the path one transformation after another, and enters each symbol on the way. Menger's sponge of
plates of rows of ends of sponges has three times as many of both as one of twenty sponges. What draws stays, since
names of symbols and places of terms are part of the random key. So do symbols that hold primitives, whose rules and
depth a hit names, and those that are placed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

from .. import graph as g
from ..matrices import is_singular
from ..rewrite import map_children
from .liveness import draw_sets, live_sets
from .merge import joined

# Terms of a production that others are put into: a scene grows by some small nodes, whatever they repeat.
MOST_TERMS = 32


def inline(graph: g.Graph) -> None:
    symbols = [i for i in graph.reachable() if isinstance(graph.nodes[i], g.Symbol)]
    inliner = _Inliner(graph)
    for symbol in symbols:
        inliner.visit(symbol)
    graph.left_out = list(dict.fromkeys(graph.left_out))  # what was merged below many terms is noted once
    passed = set(symbols).difference(graph.reachable())
    why = "it only arranges others: they stand where it was entered"
    graph.left_out.extend(g.LeftOut(f"symbol {graph.nodes[i].name}", why) for i in symbols if i in passed)
    for i, node in enumerate(graph.nodes):
        if i in passed or isinstance(node, g.Enter) and node.symbol in passed:
            graph.nodes[i] = g.Empty()


class _Inliner:
    def __init__(self, graph: g.Graph) -> None:
        self.graph, self.nodes = graph, graph.nodes
        self.seen: set[int] = set()
        self.open: set[int] = set()
        placed = {
            symbol
            for node in graph.nodes
            if isinstance(node, g.Object)
            for symbol in self.entered(node.child)
        }
        self.arranging = {
            i
            for i, node in enumerate(graph.nodes)
            if isinstance(node, g.Symbol) and i not in placed and self.arranges(node)
        }

    @cached_property
    def keyed(self) -> list[bool]:
        """Of each node, whether a draw can be reached from it: few scenes need to know."""
        return draw_sets(self.graph, "everything", live_sets(self.graph, "everything"))

    def arranges(self, symbol: g.Symbol) -> bool:
        """Whether a symbol has one production, of transformed symbols and nothing else, and nothing below draws."""
        if not isinstance(self.nodes[symbol.body], g.Rule):
            return False
        kinds = (g.Rule, g.Transform, g.Calculate, g.Union, g.Enter)
        return (
            all(isinstance(self.nodes[i], kinds) for i in self.production(symbol.body))
            and not self.keyed[symbol.body]
        )

    def production(self, start: int) -> Iterator[int]:
        """The nodes of guards and productions, down to the symbols that they enter."""
        stack = [start]
        while stack:
            i = stack.pop()
            yield i
            if not isinstance(self.nodes[i], g.Enter):
                stack.extend(reversed(self.nodes[i].children()))

    def entered(self, start: int) -> list[int]:
        nodes = map(self.nodes.__getitem__, self.production(start))
        return [node.symbol for node in nodes if isinstance(node, g.Enter)]

    def visit(self, symbol: int) -> None:
        """Rewrites the productions of a symbol, after those of the symbols that it enters."""
        if symbol in self.seen:
            return
        self.seen.add(symbol)
        self.open.add(symbol)
        body = self.nodes[symbol].body
        for below in self.entered(body):
            self.visit(below)
            if below in self.open:
                self.arranging.discard(below)  # it leads back to itself
        self.open.remove(symbol)
        for i in list(self.production(body)):
            rule = self.nodes[i]
            if not isinstance(rule, g.Rule):
                continue
            if sum(map(self.size, self.entered(rule.body))) > MOST_TERMS:
                self.arranging.discard(symbol)
            elif any(map(self.gains, self.production(rule.body))):
                rule.body = self.rewritten(rule.body, None)

    def size(self, symbol: int) -> int:
        """How many terms take the place of one that enters a symbol."""
        return len(self.entered(self.nodes[symbol].body)) if symbol in self.arranging else 1

    def gains(self, i: int) -> bool:
        """Whether something is put into the node, or a transformation moves down to others: those that follow each other are
        merge's."""
        node = self.nodes[i]
        if isinstance(node, g.Transform):
            return not isinstance(self.nodes[node.child], g.Transform) and self.absorbs(node.child)
        return isinstance(node, g.Enter) and node.symbol in self.arranging

    def absorbs(self, i: int) -> bool:
        """Whether a transformation above the node becomes one with others below."""
        match self.nodes[i]:
            case g.Transform(matrix=matrix):
                return not is_singular(matrix)
            case g.Calculate(child=child):
                return self.absorbs(child)
            case g.Enter(symbol) if symbol in self.arranging:
                return True
            case g.Union(terms):
                return any(map(self.absorbs, terms)) and not self.draws(i)
        return False

    def draws(self, i: int) -> bool:
        return i < len(self.keyed) and self.keyed[i]  # what is new doesn't

    def rewritten(self, i: int, above: g.Transform | None) -> int:
        """The node, or one in its place, below a transformation which is moved as far down as it meets others."""
        node = self.nodes[i]
        match node:
            case g.Transform() if both := self.joined(above, node):
                return self.rewritten(node.child, both)
            case g.Enter(symbol) if symbol in self.arranging:
                return self.rewritten(self.nodes[self.nodes[symbol].body].body, above)
            case g.Calculate() if not self.draws(i):
                return self.graph.add(replace(node, child=self.rewritten(node.child, above)))
            case g.Union(terms) if not self.draws(i) and (above is None or self.absorbs(i)):
                return self.graph.add(replace(node, children_=self.spliced(terms, above)))
        map_children(node, lambda child: child if isinstance(node, g.Enter) else self.rewritten(child, None))
        return i if above is None else self.graph.add(replace(above, child=i))

    def joined(self, above: g.Transform | None, node: g.Transform) -> g.Transform | None:
        if above is None:
            return None if is_singular(node.matrix) else node
        return joined(self.graph, above, node)

    def spliced(self, terms: tuple[int, ...], above: g.Transform | None) -> tuple[int, ...]:
        found: list[int] = []
        for i in terms:
            term = self.rewritten(i, above)
            node = self.nodes[term]
            found.extend(node.children_ if isinstance(node, g.Union) else (term,))
        return tuple(found)
