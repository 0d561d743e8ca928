"""Models and graphs written by hand, for tests of what comes after the reader.

``tree()`` is the model of Figure 2.1 (scenes/tree.plsys); the small functions make tests read like scenes:
``C("n", minus(read("n"), 1))`` is ``[ n = n - 1 ]``.
"""

from __future__ import annotations

from plsys.compiler.reading.model import (
    Apply,
    Assign,
    Branch,
    Calculate,
    Choose,
    Constant,
    Empty,
    Enter,
    Expression,
    Model,
    Operand,
    Operator,
    Paint,
    Prefixed,
    Primitive,
    Produce,
    Production,
    Read,
    Record,
    SceneObject,
    Step,
    Sum,
    Symbol,
    TextureValue,
    Transform,
)
from plsys.compiler.reading.source import Source, Span

SOURCE = Source.from_text("a scene made by hand\n", "hand.plsys")
SPAN = Span(SOURCE, 0, 7)


def number(value: Expression | float) -> Expression:
    return Constant(float(value)) if isinstance(value, (int, float)) else value


def read(name: str) -> Read:
    return Read(name, SPAN)


def apply(operation: str, *arguments: Expression | float) -> Apply:
    return Apply(operation, tuple(map(number, arguments)), SPAN)


def assign(**values: Expression | float) -> Calculate:
    return Calculate(
        "", tuple(Assign(name, number(value), SPAN) for name, value in values.items()), span=SPAN
    )


def calculation(name: str, **values: Expression | float) -> Calculate:
    return Calculate(name, assign(**values).statements, span=SPAN)


def transformation(name: str, *steps: tuple) -> Transform:
    return Transform(name, tuple(Step(op, tuple(map(number, values)), SPAN) for op, *values in steps), SPAN)


def paint(
    name: str, red: Expression | float = 1, green: Expression | float = 1, blue: Expression | float = 1
) -> Paint:
    entry = tuple(map(number, (0, red, green, blue, 0, 0)))
    return Paint(name, TextureValue((), (entry,)), SPAN)


def chain(*items: Operator | Operand) -> Operand:
    """``C T X`` of operators and last the operand."""
    *operators, operand = items
    for operator in reversed(operators):
        operand = Prefixed(operator, operand, SPAN)
    return operand


def union(*terms: Operand) -> Sum:
    return Sum(terms, SPAN)


def rule(index: int, body: Operand) -> Produce:
    return Produce(index, body, SPAN)


def branch(test: Expression, then: Production, otherwise: Production = Empty()) -> Branch:
    return Branch(test, then, otherwise, SPAN)


def choose(*cases: tuple[Expression | float, Produce]) -> Choose:
    return Choose(tuple((number(weight), case) for weight, case in cases), SPAN)


def model(objects: list[Operand], seed: float = 0.0, **symbols: Production) -> Model:
    """A scene; an object whose body enters a symbol (behind operators) is named after it."""
    made = Model(SOURCE, settings=Record("settings", (("seed", (seed,)),)))
    for name, production in symbols.items():
        made.symbols[name] = Symbol(name, production, SPAN, SPAN)
    for ordinal, body in enumerate(objects):
        made.objects.append(SceneObject(start_symbol(body), ordinal, body, SPAN))
    made.parameters = sorted(parameters_of(list(made.symbols.values()) + made.objects))
    return made


def start_symbol(body: Operand) -> str:
    while isinstance(body, Prefixed):
        body = body.operand
    return body.symbol if isinstance(body, Enter) else ""


def parameters_of(item: object) -> set[str]:
    """The names that anything below assigns or reads."""
    names, pending = set(), [item]
    while pending:
        item = pending.pop()
        if isinstance(item, (list, tuple)):
            pending.extend(item)
        elif isinstance(item, (Assign, Read)):
            names.add(item.parameter)
        if hasattr(item, "__dataclass_fields__"):
            pending.extend(getattr(item, name) for name in item.__dataclass_fields__ if "span" not in name)
    return names


def tree(order: float = 10, decrement: float = 4.0, scale: float = 0.8) -> Model:
    """Figure 2.1 as scenes/tree.plsys completes it."""
    cylinder = chain(transformation("T_scaleCyl", ("scale", 0.15, 0.15, 2)), Primitive("cylinder", (), SPAN))
    enter = Enter("Tree", SPAN)
    trunk = calculation("C_Trunk", cntTrunk=apply("subtract", read("cntTrunk"), 1))
    crown = calculation(
        "C_Tree",
        cntTree=apply("subtract", read("cntTree"), 1),
        betaBr=apply("subtract", read("betaBr"), decrement),
    )
    up, beta, smaller = ("trans", 0, 0, 1.99), read("betaBr"), ("scale", scale, scale, scale)
    branch1 = transformation("T_attach_Branch1", up, ("roty", beta), smaller)
    branch2 = transformation("T_attach_Branch2", up, ("roty", apply("negate", beta)), ("rotz", 90), smaller)
    production = branch(
        apply("greater", read("cntTrunk"), 0),
        rule(0, union(cylinder, chain(trunk, transformation("T_shiftTrunk", up), enter))),
        branch(
            apply("greater", read("cntTree"), 0),
            rule(1, union(cylinder, chain(crown, union(chain(branch1, enter), chain(branch2, enter))))),
            rule(2, cylinder),
        ),
    )
    start = calculation("C_initialize", cntTree=order, cntTrunk=2, betaBr=60)
    made = model([chain(paint("Bark", 0.45, 0.3, 0.15), start, enter)], seed=7, Tree=production)
    made.camera = Record(
        "camera",
        (
            ("location", (0.0, -14.0, 5.0)),
            ("sky", (0.0, 0.0, 1.0)),
            ("right", (-4 / 3, 0.0, 0.0)),
            ("look_at", (0.0, 0.0, 5.0)),
            ("has_look_at", (1.0,)),
            ("angle", (45.0,)),
        ),
    )
    made.lights.append(Record("light", (("location", (20.0, -30.0, 40.0)), ("color", (1.0, 1.0, 1.0)))))
    return made
