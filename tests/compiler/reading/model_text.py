"""The model as short text, for tests: operators in order, operands as in a scene.

{cntTree = cntTree - 1} [trans 0 0 1.99] >Tree          Prefixed, Prefixed, Enter
if cntTrunk > 0: ... else: ...                          Branch
"""

from __future__ import annotations

from plsys.compiler.reading import model as m
from plsys.compiler.reading.check import check
from plsys.compiler.reading.diagnostics import Diagnostics, render
from plsys.compiler.reading.parse import parse
from plsys.compiler.reading.resolve import resolve
from plsys.compiler.reading.source import Source

SIGNS = {
    "add": "+",
    "subtract": "-",
    "multiply": "*",
    "divide": "/",
    "less": "<",
    "greater": ">",
    "equal": "==",
}


def read(text: str, **options) -> tuple[m.Model, Diagnostics]:
    """The model of a text and its diagnostics, the checks' included."""
    file, diagnostics = parse(Source.from_text(text, "scene.plsys"))
    model = resolve(file, diagnostics, **options)
    if not diagnostics.has_errors:
        check(model, diagnostics)
    return model, diagnostics


def good(text: str, **options) -> m.Model:
    """The model of a text that has no errors."""
    model, diagnostics = read(text, **options)
    assert [render(item) for item in diagnostics.items if item.severity == "error"] == []
    return model


def codes(text: str, **options) -> list[str]:
    """The codes of a text's errors and warnings, and of its infos but the missing camera and light, in file order."""
    dull = ("no-camera", "no-light", "no-object")
    return [item.code for item in read(text, **options)[1].sorted() if item.code not in dull]


def number(value: float) -> str:
    return f"{value:.12g}"


def expression(node: m.Expression) -> str:
    if isinstance(node, m.Constant):
        return number(node.value)
    if isinstance(node, m.Read):
        return node.parameter
    if node.operation in SIGNS:
        return f"({f' {SIGNS[node.operation]} '.join(map(expression, node.arguments))})"
    return f"{node.operation}({', '.join(map(expression, node.arguments))})"


def operator(node: m.Operator) -> str:
    if isinstance(node, m.Calculate):
        inside = "; ".join(
            f"variants {expression(each.count)}"
            if isinstance(each, m.Variants)
            else f"{each.parameter} = {expression(each.value)}"
            for each in node.statements
        )
        return f"{node.name}{'<' if node.together else '{'}{inside}{'>' if node.together else '}'}"
    if isinstance(node, m.Transform):
        steps = "; ".join(" ".join([step.operation, *map(expression, step.arguments)]) for step in node.steps)
        return f"{node.name}[{steps}]"
    if isinstance(node, m.Paint):
        return f"{node.name}({texture(node.texture)})"
    return "no_shadow"


def texture(value: m.TextureValue) -> str:
    values = [f"{name} {' '.join(map(expression, parts))}" for name, parts in value.values]
    entries = [",".join(map(expression, entry)) for entry in value.entries]
    return " | ".join([*values, " ".join(entries)])


def operand(node: m.Operand) -> str:
    if isinstance(node, m.Prefixed):
        return f"{operator(node.operator)} {operand(node.operand)}"
    if isinstance(node, m.Sum):
        return f"({' + '.join(map(operand, node.terms))})"
    if isinstance(node, m.Enter):
        return f">{node.symbol}"
    if isinstance(node, m.Primitive):
        return f"{node.shape}({', '.join(map(expression, node.arguments))})" if node.arguments else node.shape
    return f"mesh {node.mesh}" if isinstance(node, m.MeshLeaf) else "nothing"


def production(node: m.Production) -> str:
    if isinstance(node, m.Produce):
        return f"{node.rule}: {operand(node.body)}"
    if isinstance(node, m.Branch):
        return f"if {expression(node.test)} {{{production(node.then)}}} else {{{production(node.otherwise)}}}"
    if isinstance(node, m.Choose):
        return " | ".join(f"{expression(weight)} => {production(case)}" for weight, case in node.cases)
    return "nothing"


def rules(text: str, name: str = "A") -> str:
    """The production of the Selection ``name`` of a text without errors."""
    return production(good(text).symbols[name].production)


def objects(text: str) -> list[str]:
    """The scene's objects, each with its key's symbol and ordinal."""
    return [f"{each.symbol}#{each.ordinal} {operand(each.body)}" for each in good(text).objects]
