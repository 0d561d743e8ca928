"""From the checked model to the cyclic graph (paper, section 2): every component becomes a node, every reference
to a Selection an ``Enter``, the edge back to its S-node.

Nodes are numbered in the order of derivation, so that the graph reads like the scene. Every Selection gets its
nodes, whether an object leads there or not; the prune pass takes away what none does.

Example: ``object { Tree }`` with ``Tree -> cylinder;`` becomes ::

    0 object Tree 0 -> 1
    1 enter -> 2
    2 symbol Tree -> 3
    3 rule 0 -> 4
    4 primitive cylinder
"""

from __future__ import annotations

from collections.abc import Callable

from ..reading import model as m
from . import graph as g
from .matrices import is_finite, matrix_of

# What still has to become nodes: something of the model, and who wants to know its index.
Pending = tuple[object, Callable[[int], None]]


def lower(model: m.Model) -> g.Graph:
    """The graph of a model that ``check`` found no errors in. Expressions stay as they are."""
    return _Lowering(model).run()


class _Lowering:
    """Works through a stack instead of recursing: scenes may nest as deep as they like."""

    def __init__(self, model: m.Model) -> None:
        self.model = model
        self.graph = g.Graph(
            parameters=list(model.parameters),
            settings=model.settings,
            camera=model.camera,
            lights=list(model.lights),
            meshes=list(model.meshes),
        )
        self.symbols: dict[str, int] = {}  # name -> S-node
        self.pending: list[Pending] = []
        self.terms: dict[int, list[int]] = {}  # of each union, by its id

    def run(self) -> g.Graph:
        objects = self.model.objects
        if len(objects) == 1:
            self.work(objects[0], lambda index: None)
        elif objects:
            root = g.Union((-1,) * len(objects))
            self.graph.add(root)
            for i, placed in enumerate(objects):
                self.work(placed, self.term(root, i))
        else:
            self.graph.add(g.Empty())
        for name in self.model.symbols:
            if name not in self.symbols:
                self.work(self.model.symbols[name], lambda index: None)
        for node in self.graph.nodes:
            if isinstance(node, g.Union):
                node.children_ = tuple(self.terms[id(node)])
        return self.graph

    def work(self, item: object, wanted: Callable[[int], None]) -> None:
        self.pending.append((item, wanted))
        while self.pending:
            item, wanted = self.pending.pop()
            wanted(self.add(item))

    def add(self, item: object) -> int:
        """Add the node of ``item`` and put its children on the stack, the first on top."""
        match item:
            case m.Enter():
                return self.enter(item)
            case m.Primitive():
                return self.graph.add(g.Primitive(item.shape, item.arguments, span=item.span))
            case m.MeshLeaf():
                return self.graph.add(g.MeshLeaf(item.mesh, span=item.span))
            case m.Empty():
                return self.graph.add(g.Empty(span=item.span))
            case m.Sum():
                node = g.Union((-1,) * len(item.terms), span=item.span)
                return self.node(node, *((term, self.term(node, i)) for i, term in enumerate(item.terms)))
            case m.Prefixed():
                node = self.operator(item.operator, item.span)
                return self.node(node, (item.operand, _field(node, "child")))
            case m.Produce():
                node = g.Rule(item.rule, -1, span=item.span)
                return self.node(node, (item.body, _field(node, "body")))
            case m.Branch():
                node = g.Branch(item.test, -1, -1, span=item.test.span or item.span)
                return self.node(
                    node, (item.then, _field(node, "then")), (item.otherwise, _field(node, "otherwise"))
                )
            case m.Choose():
                node = g.Choose(tuple((weight, -1) for weight, _ in item.cases), span=item.span)
                return self.node(node, *((case, _case(node, i)) for i, (_, case) in enumerate(item.cases)))
            case m.Symbol():
                node = g.Symbol(item.name, -1, span=item.name_span)
                self.symbols[item.name] = len(self.graph.nodes)
                return self.node(node, (item.production, _field(node, "body")))
            case m.SceneObject():
                node = g.Object(item.symbol, item.ordinal, -1, span=item.span)
                return self.node(node, (item.body, _field(node, "child")))
        raise TypeError(f"{type(item).__name__} has no node")

    def node(self, node: g.Node, *children: Pending) -> int:
        self.pending.extend(reversed(children))
        return self.graph.add(node)

    def term(self, union: g.Union, i: int) -> Callable[[int], None]:
        terms = self.terms.setdefault(id(union), list(union.children_))
        return lambda index: terms.__setitem__(i, index)

    def enter(self, item: m.Enter) -> int:
        node = g.Enter(self.symbols.get(item.symbol, -1), span=item.span)
        if node.symbol >= 0:
            return self.graph.add(node)
        # The S-node is made next, before another reference to it can be met.
        return self.node(node, (self.model.symbols[item.symbol], _field(node, "symbol")))

    def operator(self, operator: m.Operator, place: object) -> g.Node:
        """The node of a prefix operator, child still open."""
        span = operator.span or place
        match operator:
            case m.Calculate():
                return g.Calculate(operator.name, operator.statements, -1, operator.together, span=span)
            case m.Paint():
                return g.Texture(operator.name, operator.texture, -1, span=span)
            case m.NoShadow():
                return g.NoShadow(-1, span=span)
        node = g.TransformCode(operator.name, operator.steps, -1, span=span)
        return constant_transform(node) or node


def constant_transform(node: g.TransformCode) -> g.Transform | None:
    """The node with its matrix worked out, if all arguments are constants and the matrix can be had."""
    if not all(isinstance(argument, m.Constant) for step in node.steps for argument in step.arguments):
        return None
    try:
        matrix = matrix_of((step.operation, [a.value for a in step.arguments]) for step in node.steps)
    except ValueError:
        return None  # left for the derivation, which reports the place
    return g.Transform(node.name, matrix, node.child, span=node.span) if is_finite(matrix) else None


def _field(node: g.Node, name: str) -> Callable[[int], None]:
    return lambda index: setattr(node, name, index)


def _case(choose: g.Choose, i: int) -> Callable[[int], None]:
    def put(index: int) -> None:
        weight, _ = choose.cases[i]
        choose.cases = (*choose.cases[:i], (weight, index), *choose.cases[i + 1 :])

    return put
