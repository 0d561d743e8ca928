"""The cyclic object-instancing graph (paper, section 2): what a scene is between its text and its bytecode.

Nodes stand in one list and refer to each other by index; node 0 is the root. Each class below is one node kind
of runtime/bytecode.toml, with its fields in that order, so that the encoder is a loop over the table. An
``Enter`` node is the edge back to a Selection's S-node and the only way to make a cycle. Expressions, steps and
statements stay symbolic (``reading.model``); the encoder makes code of them.

``str(graph)`` prints it, one node a line, reachable or not::

    0 object Tree 0 -> 1
    1 calculate C_initialize { cntTree = 10; cntTrunk = 2; betaBr = 60 } -> 2
    2 enter -> 3
    3 symbol Tree [cntTree cntTrunk betaBr] -> 4
    4 branch (cntTrunk > 0) then 5 else 11
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cache

from ..reading.model import Assign, Expression, Mesh, Record, Step, TextureValue, Variants
from ..reading.records import record
from ..reading.source import Span


@record(frozen=False)
class Node:
    span: Span | None = field(default=None, kw_only=True, compare=False, repr=False)

    def children(self) -> tuple[int, ...]:
        """The nodes that this one refers to, in the order of derivation (an Enter's symbol is one)."""
        found: list[int] = []
        for name in _references(type(self)):
            value = getattr(self, name)
            if name == "children_":
                found.extend(value)
            elif name == "cases":
                found.extend(body for _, body in value)
            else:
                found.append(value)
        return tuple(found)


@cache
def _references(kind: type[Node]) -> tuple[str, ...]:
    """The fields of a kind of nodes that refer to others, in the order of derivation."""
    names = ("child", "body", "then", "otherwise", "symbol", "children_", "cases")
    return tuple(each.name for each in fields(kind) if each.name in names)


@record(frozen=False)
class Empty(Node):
    pass


@record(frozen=False)
class Symbol(Node):
    """S-node. ``live`` and ``draws`` are filled by the liveness pass: the parameters (names, in slot order) and
    whether the random key matters for the geometry below."""

    name: str
    body: int
    live: tuple[str, ...] = ()
    draws: bool = False


@record(frozen=False)
class Rule(Node):
    index: int
    body: int


@record(frozen=False)
class Branch(Node):
    test: Expression
    then: int
    otherwise: int


@record(frozen=False)
class Choose(Node):
    cases: tuple[tuple[Expression, int], ...]


@record(frozen=False)
class Calculate(Node):
    name: str
    statements: tuple[Assign | Variants, ...]
    child: int
    together: bool = False


@record(frozen=False)
class Transform(Node):
    """A constant transformation: ``matrix`` is the 3x4 matrix row by row, 12 doubles, p' = M·(p, 1)."""

    name: str
    matrix: tuple[float, ...]
    child: int


@record(frozen=False)
class TransformCode(Node):
    name: str
    steps: tuple[Step, ...]
    child: int


@record(frozen=False)
class Texture(Node):
    name: str
    texture: TextureValue
    child: int
    draws: bool = False


@record(frozen=False)
class Union(Node):
    children_: tuple[int, ...]


@record(frozen=False)
class Enter(Node):
    symbol: int


@record(frozen=False)
class Primitive(Node):
    shape: str
    arguments: tuple[Expression, ...] = ()


@record(frozen=False)
class MeshLeaf(Node):
    mesh: int


@record(frozen=False)
class Object(Node):
    name: str
    ordinal: int
    child: int


@record(frozen=False)
class NoShadow(Node):
    child: int


@record
class LeftOut:
    """Something a pass removed because the scene doesn't need it: shown by ``--explain`` and in JSON."""

    what: str
    why: str


@dataclass
class Graph:
    """The nodes, the root first, and what else a scene has."""

    nodes: list[Node] = field(default_factory=list)
    parameters: list[str] = field(default_factory=list)  # slot order
    settings: Record | None = None
    camera: Record | None = None
    lights: list[Record] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)

    def add(self, node: Node) -> int:
        self.nodes.append(node)
        return len(self.nodes) - 1

    def reachable(self, start: int = 0) -> Iterator[int]:
        """Node indices reachable from ``start``, each once, depth first in derivation order (start first)."""
        seen, stack = set(), [start]
        while stack:
            i = stack.pop()
            if i in seen:
                continue
            seen.add(i)
            yield i
            stack.extend(reversed(self.nodes[i].children()))

    def __str__(self) -> str:
        from .printing import print_graph

        return print_graph(self)
