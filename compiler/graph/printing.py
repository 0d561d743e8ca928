"""The graph as text, one node a line, for people, golden tests and ``--explain``: deterministic, complete.

Expressions read like source (``betaBr - 4``), with no more brackets than precedence needs. Numbers are the
shortest that read back as the same double; whole ones have no point.

Example: ``print(graph)`` ::

    0 object Tree 0 -> 1
    1 calculate C_initialize { cntTree = 10; cntTrunk = 2; betaBr = 60 } -> 2
    2 enter -> 3
    3 symbol Tree [cntTree cntTrunk betaBr] -> 4
    4 branch (cntTrunk > 0) then 5 else 11
"""

from __future__ import annotations

from ..reading.model import Apply, Assign, Constant, Expression, Read, TextureValue
from . import graph as g

# Infix spelling and binding strength of operations, as in the language (tighter is larger).
INFIX = {
    "or": ("||", 1),
    "and": ("&&", 2),
    "equal": ("==", 3),
    "not_equal": ("!=", 3),
    "less": ("<", 4),
    "less_equal": ("<=", 4),
    "greater": (">", 4),
    "greater_equal": (">=", 4),
    "add": ("+", 5),
    "subtract": ("-", 5),
    "multiply": ("*", 6),
    "divide": ("/", 6),
    "modulo": ("%", 6),
}
PREFIX = {"negate": "-", "not": "!"}
PREFIX_STRENGTH = 7
ATOM = 8


def print_graph(graph: g.Graph) -> str:
    """Every node of the list, reachable or not."""
    return "\n".join(f"{i} {print_node(node)}" for i, node in enumerate(graph.nodes))


def print_node(node: g.Node) -> str:
    match node:
        case g.Empty():
            return "empty"
        case g.Symbol():
            live = f" [{' '.join(node.live)}]" if node.live else ""
            return f"symbol {node.name}{live}{' draws' if node.draws else ''} -> {node.body}"
        case g.Rule():
            return f"rule {node.index} -> {node.body}"
        case g.Branch():
            return f"branch ({print_expression(node.test)}) then {node.then} else {node.otherwise}"
        case g.Choose():
            return "choose " + " | ".join(
                f"{print_expression(weight)}: {body}" for weight, body in node.cases
            )
        case g.Calculate():
            together = " together" if node.together else ""
            return f"{_named('calculate', node.name)}{together} {{ {_statements(node)} }} -> {node.child}"
        case g.Transform():
            return f"{_named('transform', node.name)} <{' '.join(map(print_number, node.matrix))}> -> {node.child}"
        case g.TransformCode():
            steps = "; ".join(
                " ".join([step.operation, *(print_expression(a, ATOM) for a in step.arguments)])
                for step in node.steps
            )
            return f"{_named('transform_code', node.name)} {{ {steps} }} -> {node.child}"
        case g.Texture():
            draws = " draws" if node.draws else ""
            return f"{_named('texture', node.name)}{draws} {print_texture(node.texture)} -> {node.child}"
        case g.Union():
            return "union " + " ".join(map(str, node.children_))
        case g.Enter():
            return f"enter -> {node.symbol}"
        case g.Primitive():
            arguments = ", ".join(map(print_expression, node.arguments))
            return f"primitive {node.shape}" + (f"({arguments})" if arguments else "")
        case g.MeshLeaf():
            return f"mesh {node.mesh}"
        case g.Object():
            return f"{_named('object', node.name)} {node.ordinal} -> {node.child}"
        case g.NoShadow():
            return f"no_shadow -> {node.child}"
    raise TypeError(f"{type(node).__name__} is no node")


def print_expression(expression: Expression, strength: int = 0) -> str:
    """As source; in brackets if it binds less than ``strength``."""
    match expression:
        case Constant():
            text = print_number(expression.value)
            return f"({text})" if text.startswith("-") and strength == ATOM else text
        case Read():
            return expression.parameter
        case Apply("select", (test, then, otherwise)):
            text = f"{print_expression(test, 1)} ? {print_expression(then)} : {print_expression(otherwise)}"
            return f"({text})" if strength > 0 else text
        case Apply(operation, (left, right)) if operation in INFIX:
            sign, own = INFIX[operation]
            text = f"{print_expression(left, own)} {sign} {print_expression(right, own + 1)}"
            return f"({text})" if strength > own else text
        case Apply(operation, (operand,)) if operation in PREFIX:
            text = PREFIX[operation] + print_expression(operand, ATOM)
            return f"({text})" if strength > PREFIX_STRENGTH else text
        case Apply():
            return f"{expression.operation}({', '.join(map(print_expression, expression.arguments))})"
    raise TypeError(f"{type(expression).__name__} is no expression")


def print_number(value: float) -> str:
    """``2``, ``0.15``, ``1e+300``; -0 keeps its sign."""
    is_short = abs(value) < 1e15 and value == int(value)
    return f"{value:.0f}" if is_short else repr(value)


def print_texture(texture: TextureValue) -> str:
    """``{ ambient 0.1 0.1 0.1; entry 0 0.45 0.3 0.15 0 0 }``"""
    rows = [(name, values) for name, values in texture.values] + [
        ("entry", entry) for entry in texture.entries
    ]
    return (
        "{ "
        + "; ".join(" ".join([name, *(print_expression(v, ATOM) for v in values)]) for name, values in rows)
        + " }"
    )


def _statements(node: g.Calculate) -> str:
    return "; ".join(
        f"{s.parameter} = {print_expression(s.value)}"
        if isinstance(s, Assign)
        else f"variants {print_expression(s.count)}"
        for s in node.statements
    )


def _named(kind: str, name: str) -> str:
    return f"{kind} {name}" if name else kind
