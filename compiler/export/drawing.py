"""A graph → what there is to draw of it: the paper's Figure 2.2.

Every S-, C-, T-, +- and P-node (and X for textures) is a circle with its letter; what the compiler needs
between them (rules, guards, references) becomes edges and their labels. References back to a symbol that is
being derived are the cycles; :func:`diagram` marks them.

Example: ``diagram(graph).edges[0]`` is ``Edge(0, 1, label="", is_back=False)``; ``dot(diagram(graph))`` is
Graphviz text."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..bytecode.layout_rows import NODES
from ..graph import graph as g
from ..graph.printing import print_expression
from ..reading.model import Expression

LONGEST_LABEL = 28


@dataclass(frozen=True)
class Node:
    """``letter`` stands in the circle, ``label`` beside it."""

    letter: str
    label: str


@dataclass
class Edge:
    """From ``source`` to ``target`` (indices of nodes); ``label`` is a guard or a weight. ``is_back`` closes
    a cycle."""

    source: int
    target: int
    label: str = ""
    is_back: bool = False


@dataclass
class Diagram:
    nodes: list[Node] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)


def diagram(graph: g.Graph) -> Diagram:
    """Everything reachable from the root."""
    builder = _Builder(graph)
    if graph.nodes:
        builder.draw(0)
    _mark_cycles(builder.result)
    return builder.result


class _Builder:
    def __init__(self, graph: g.Graph) -> None:
        self.graph, self.result = graph, Diagram()
        self.drawn: dict[int, int] = {}  # graph node -> diagram node

    def draw(self, start: int) -> None:
        """Depth first in derivation order, without recursion: scenes may nest deeply."""
        stack: list[tuple[int, int | None, str]] = [(start, None, "")]
        while stack:
            index, parent, label = stack.pop()
            node = self.graph.nodes[index]
            further = self._through(node, label)
            if further is None:
                is_new = index not in self.drawn
                if is_new:
                    self.drawn[index] = len(self.result.nodes)
                    self.result.nodes.append(_circle(node, self.graph))
                if parent is not None:
                    self.result.edges.append(Edge(parent, self.drawn[index], label))
                if not is_new:
                    continue
                parent, further = self.drawn[index], [(child, "") for child in node.children()]
            stack.extend((child, parent, text) for child, text in reversed(further))

    def _through(self, node: g.Node, label: str) -> list[tuple[int, str]] | None:
        """The children of a node that isn't drawn, with their edges' labels; None for one that is."""
        match node:
            case g.Empty():
                return []
            case g.Rule():
                return [(node.body, label)]
            case g.Enter():
                return [(node.symbol, label)]
            case g.NoShadow():
                return [(node.child, _join(label, "no_shadow"))]
            case g.Branch():
                test = _text(node.test)
                return [(node.then, _join(label, test)), (node.otherwise, _join(label, "else"))]
            case g.Choose():
                return [(body, _join(label, _text(weight) + ":")) for weight, body in node.cases]
        return None


def _join(outer: str, inner: str) -> str:
    """``else`` before another guard says nothing in a picture that lists them in order."""
    return inner if outer in ("", "else") else f"{outer}, {inner}"


def _text(expression: Expression) -> str:
    span = getattr(expression, "span", None)
    text = " ".join(span.text.split()) if span is not None else print_expression(expression)
    return text if len(text) <= LONGEST_LABEL else text[: LONGEST_LABEL - 1] + "…"


def _circle(node: g.Node, graph: g.Graph) -> Node:
    match node:
        case g.Symbol():
            return Node(NODES["symbol"].letter, node.name)
        case g.Calculate():
            return Node(NODES["calculate"].letter, node.name)
        case g.Transform() | g.TransformCode():
            return Node(NODES["transform"].letter, node.name)
        case g.Texture():
            return Node(NODES["texture"].letter, node.name)
        case g.Union():
            return Node(NODES["union"].letter, "")
        case g.Primitive():
            return Node(NODES["primitive"].letter, node.shape)
        case g.MeshLeaf():
            return Node(NODES["mesh"].letter, graph.meshes[node.mesh].name if graph.meshes else "mesh")
        case g.Object():
            return Node("", "object" + (f" {node.name}" if node.name else ""))
    raise TypeError(f"no picture of {node!r}")


def _mark_cycles(picture: Diagram) -> None:
    """An edge to a node on the path from the root is a back edge."""
    children: list[list[Edge]] = [[] for _ in picture.nodes]
    for edge in picture.edges:
        children[edge.source].append(edge)
    state = [0] * len(picture.nodes)  # 0 new, 1 on the path, 2 done
    if not picture.nodes:
        return
    state[0], stack = 1, [(0, iter(children[0]))]
    while stack:
        node, rest = stack[-1]
        edge = next(rest, None)
        if edge is None:
            state[node] = 2
            stack.pop()
        elif state[edge.target] == 1:
            edge.is_back = True
        elif state[edge.target] == 0:
            state[edge.target] = 1
            stack.append((edge.target, iter(children[edge.target])))


def dot(picture: Diagram, name: str = "plsys") -> str:
    """Graphviz' language, for those who want to lay it out themselves."""
    lines = [
        f"digraph {_quoted(name)} {{",
        "  node [shape=circle fontname=Helvetica width=0.4 fixedsize=true]",
    ]
    lines.append("  edge [fontname=Helvetica fontsize=10]")
    for index, node in enumerate(picture.nodes):
        if node.letter:
            lines.append(f"  n{index} [label={_quoted(node.letter)} xlabel={_quoted(node.label)}]")
        else:
            lines.append(f"  n{index} [label={_quoted(node.label)} shape=box fixedsize=false]")
    for edge in picture.edges:
        attributes = [f"label={_quoted(edge.label)}"] if edge.label else []
        attributes += ["constraint=false style=dashed"] if edge.is_back else []
        lines.append(
            f"  n{edge.source} -> n{edge.target}" + (f" [{' '.join(attributes)}]" if attributes else "")
        )
    return "\n".join([*lines, "}"]) + "\n"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
