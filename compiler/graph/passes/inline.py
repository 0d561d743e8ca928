"""Put symbols that only arrange others into the productions that enter them, each term below one transformation.

before ::                                 after ::

    4 transform <0.5 0 0 0 …> -> 5            4 union 9 10
    5 enter -> 6                              8 enter -> 3
    6 symbol Ends -> …                        9 transform <0.5 0 0 0 …> -> 8
    7 union 8 11                              10 transform <0.5 0 0 1 …> -> 12
    …                                         …

A ray is mapped down the path one transformation after another, and enters each symbol on the way. Menger's sponge of
plates of rows of ends of sponges has three times as many of both as one of twenty sponges. What draws stays, since
names of symbols and places of terms are part of the random key. So do symbols that hold primitives, whose rules and
depth a hit names, and those that are placed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from .. import graph as g
from ..matrices import is_singular, regular_product
from ..rewrite import map_children
from .liveness import draw_sets, live_sets

# Terms of a production that others are put into: a scene grows by some small nodes, whatever they repeat.
MOST_TERMS = 32


def inline(graph: g.Graph) -> None:
    symbols = [i for i in graph.reachable() if isinstance(graph.nodes[i], g.Symbol)]
    inliner = _Inliner(graph)
    for symbol in symbols:
        inliner.visit(symbol)
    passed = set(symbols).difference(graph.reachable())
    why = "it only arranges others: they stand where it was entered"
    graph.left_out.extend(g.LeftOut(f"symbol {graph.nodes[i].name}", why) for i in symbols if i in passed)
    for i, node in enumerate(graph.nodes):
        if i in passed or isinstance(node, g.Enter) and node.symbol in passed:
            graph.nodes[i] = g.Empty()


class _Inliner:
    def __init__(self, graph: g.Graph) -> None:
        self.graph, self.nodes = graph, graph.nodes
        self.keyed = draw_sets(graph, "everything", live_sets(graph, "everything"))
        self.seen: set[int] = set()
        self.open: set[int] = set()
        placed = {
            symbol
            for node in graph.nodes
            if isinstance(node, g.Object)
            for symbol in self.entered(node.child)
        }
        self.arranging = {
            i for i, node in enumerate(graph.nodes) if isinstance(node, g.Symbol) and self.arranges(node)
        } - placed

    def arranges(self, symbol: g.Symbol) -> bool:
        """Whether a symbol has one production, of transformed symbols and nothing else, and nothing below draws."""
        if not isinstance(self.nodes[symbol.body], g.Rule) or self.keyed[symbol.body]:
            return False
        kinds = (g.Rule, g.Transform, g.Calculate, g.Union, g.Enter)
        return all(isinstance(self.nodes[i], kinds) for i in self.production(symbol.body))

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
            if sum(map(self.size, self.entered(rule.body))) <= MOST_TERMS:
                rule.body = self.rewritten(rule.body, None)
            else:
                self.arranging.discard(symbol)

    def size(self, symbol: int) -> int:
        """How many terms take the place of one that enters a symbol."""
        return len(self.entered(self.nodes[symbol].body)) if symbol in self.arranging else 1

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
                return not self.draws(i) and any(map(self.absorbs, terms))
        return False

    def draws(self, i: int) -> bool:
        return i < len(self.keyed) and self.keyed[i]  # what is new doesn't

    def rewritten(self, i: int, above: g.Transform | None) -> int:
        """The node, or one in its place, below a transformation which is moved as far down as it meets others."""
        node = self.nodes[i]
        match node:
            case g.Transform() if joined := _joined(above, node):
                return self.rewritten(node.child, joined)
            case g.Enter(symbol) if symbol in self.arranging:
                return self.rewritten(self.nodes[self.nodes[symbol].body].body, above)
            case g.Calculate() if not self.draws(i):
                return self.graph.add(replace(node, child=self.rewritten(node.child, above)))
            case g.Union(terms) if not self.draws(i) and (above is None or self.absorbs(i)):
                return self.graph.add(replace(node, children_=self.spliced(terms, above)))
        map_children(node, lambda child: child if isinstance(node, g.Enter) else self.rewritten(child, None))
        return i if above is None else self.graph.add(replace(above, child=i))

    def spliced(self, terms: tuple[int, ...], above: g.Transform | None) -> tuple[int, ...]:
        found: list[int] = []
        for i in terms:
            term = self.rewritten(i, above)
            node = self.nodes[term]
            found.extend(node.children_ if isinstance(node, g.Union) else (term,))
        return tuple(found)


def _joined(above: g.Transform | None, node: g.Transform) -> g.Transform | None:
    """Both as one; None: their product isn't regular, or the node itself."""
    if is_singular(node.matrix):
        return None
    if above is None:
        return node
    matrix = regular_product(above.matrix, node.matrix)
    name = "*".join(name for name in (above.name, node.name) if name)
    return matrix and replace(above, name=name, matrix=matrix)
