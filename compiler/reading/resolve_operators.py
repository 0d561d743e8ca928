"""Calculations and Transformations: statements → operators.

Example: ``{ --cntTree; betaBr -= 4.0; }`` becomes one Calculate with two Assigns;
``[ --n; trans 0 0 1 ]`` becomes a Calculate and a Transform.
"""

from __future__ import annotations

from . import syntax, vocabulary
from .diagnostics import nearest
from .model import Apply, Assign, Calculate, Constant, Expression, Operator, Read, Step, Transform, Variants
from .problems import Problem, synonym
from .resolve_expressions import RULES, Expressions
from .resolve_names import ARTICLES, Entry, Names

UPDATES = {"+=": "add", "-=": "subtract", "*=": "multiply", "/=": "divide", "++": "add", "--": "subtract"}

# What POV-Ray calls the operations, for the hint.
POV_NAMES = {
    "translate": "trans",
    "rotate": "rotx, roty and rotz",
    "move": "trans",
    "turn": "rotz",
    "rotate_z": "rotz",
}


class Operators:
    def __init__(self, names: Names, expressions: Expressions) -> None:
        self.names, self.expressions = names, expressions

    def declared(self, entry: Entry) -> Operator:
        """The operator that a Calculation or Transformation is; made once. Problems of single statements are
        reported here, and the statements left out."""
        if entry.value is None:
            node = entry.node
            assert isinstance(node, syntax.Calculation | syntax.Transformation)
            entry.value = self.names.known(node, lambda: self._definition(node))
        return entry.value  # type: ignore[return-value]

    def _definition(self, node: syntax.Calculation | syntax.Transformation) -> Operator:
        calculates = isinstance(node, syntax.Calculation)
        made = []
        for statement in node.statements:
            try:
                if _calculates(statement) not in (None, calculates):
                    raise self._misplaced(statement, calculates, node.name.name)
                made.append(self._statement(statement))
            except Problem as problem:
                problem.report(self.names.diagnostics)
        if calculates:
            return Calculate(node.name.name, tuple(made), span=node.name.span)
        return Transform(node.name.name, tuple(made), node.name.span)

    def inline(self, node: syntax.Inline) -> list[Operator]:
        """Each line is an operator; lines of one kind that follow each other make one."""
        operators: list[Operator] = []
        for statement in node.statements:
            result = self._statement(statement)
            last = operators[-1] if operators else None
            if isinstance(result, Step):
                if isinstance(last, Transform):
                    operators[-1] = Transform("", (*last.steps, result), last.span)
                else:
                    operators.append(Transform("", (result,), node.span))
            elif isinstance(last, Calculate):
                operators[-1] = Calculate("", (*last.statements, result), span=last.span)
            else:
                operators.append(Calculate("", (result,), span=node.span))
        return operators

    # --- statements

    def _statement(self, node: syntax.Statement) -> Assign | Variants | Step:
        if isinstance(node, syntax.Assignment):
            return self._assignment(node)
        row = vocabulary.OPERATIONS.get(node.name.name)
        if row is None:
            raise self._unknown(node)
        if row.name == "variants":
            return self._variants(node)
        arguments = []
        for argument in node.arguments:
            if isinstance(argument, syntax.Vector):
                hint = f"{row.name}'s numbers stand side by side: {row.signature}"
                is_alone = len(node.arguments) == 1 and row.accepts(len(argument.components))
                mend = ", ".join(each.span.text for each in argument.components) if is_alone else None
                message = f"{row.name} takes numbers, not a vector"
                raise Problem("wrong-arguments", argument.span, message, hint, mend=mend)
            arguments.append(self.expressions.number(argument, RULES))
        self._count(row, node)
        uniform = row.name == "scale" and len(arguments) == 1
        return Step("scale_uniform" if uniform else row.name, tuple(arguments), node.span)

    def _assignment(self, node: syntax.Assignment) -> Assign:
        name = node.target.name
        entry = self.names.entries.get(name)
        if entry is None or entry.kind != "parameter":
            raise Problem  # reported where the assigned names were gathered
        if node.value is None:
            value: Expression = Constant(1.0, node.span)
        else:
            value = self.expressions.number(node.value, RULES)
        if node.operator != "=":
            self.names.refer(entry, node.target.span)
            value = Apply(UPDATES[node.operator], (Read(name, node.target.span), value), node.span)
        return Assign(name, value, node.span)

    def _variants(self, node: syntax.Operation) -> Variants:
        row = vocabulary.OPERATIONS["variants"]
        arguments = [self.expressions.number(argument, RULES) for argument in node.arguments]
        self._count(row, node)
        count = arguments[0]
        if isinstance(count, Constant) and (count.value not in row.range or count.value != int(count.value)):
            message = f"the number of variants is a whole number from 1 to 4294967296, not {count.value:g}"
            raise Problem("wrong-value", node.arguments[0].span, message)
        return Variants(count, node.span)

    def _count(self, row: vocabulary.Row, node: syntax.Operation) -> None:
        if not row.accepts(len(node.arguments)):
            message = f"{row.name} takes {row.expected}, not {len(node.arguments)}"
            hint = f"write {row.signature}"
            if len(node.arguments) > max(row.arity):
                hint += "; perhaps a ';' is missing"
            raise Problem("wrong-arguments", node.span, message, hint)

    def _misplaced(self, node: syntax.Statement, calculates: bool, name: str) -> Problem:
        if calculates:
            assert isinstance(node, syntax.Operation)
            message = f"'{node.name.name}' moves the frame, which the Calculation {name} can't"
            return Problem("wrong-kind", node.span, message, "put it into a Transformation")
        message = f"the Transformation {name} can't calculate"
        return Problem("wrong-kind", node.span, message, "put this into a Calculation")

    def _unknown(self, node: syntax.Operation) -> Problem:
        name = node.name
        if name.name in POV_NAMES:
            hint = f"in a Transformation it is {POV_NAMES[name.name]}, with the numbers side by side"
            mend = _from_povray(node)
            span = name.span if mend is None else node.span
            message = f"'{name.name}' is POV-Ray's modifier of scene objects"
            return Problem("unknown-name", span, message, f"write {mend}" if mend else hint, mend=mend)
        if (entry := self.names.entries.get(name.name)) is not None:
            message = f"'{name.name}' is {ARTICLES[entry.kind]}, not an operation"
            hint = f"to assign it, write {name.name} = …" if entry.kind == "parameter" else ""
            if entry.kind == "selection":
                hint = f"what {name.name} produces is joined by '+': {name.name} + …"
            return Problem("wrong-kind", name.span, message, hint)
        ours = synonym(name.name, ("operation",)) or nearest(name.name, vocabulary.OPERATIONS)
        problem = self.names.unknown(name, (), "an operation", ours)
        problem.hint = ours or problem.hint or f"operations are {' '.join(vocabulary.OPERATIONS)}"
        return problem


def _from_povray(node: syntax.Operation) -> str | None:
    """POV-Ray's ``translate`` or ``rotate`` of one vector in our operations; None for other arguments. POV-Ray turns about
    x first; here the last operation acts first."""
    if node.name.name == "translate" and len(node.arguments) == 3:  # numbers side by side
        return node.span.text.replace("translate", "trans", 1)
    if node.name.name == "rotate" and len(node.arguments) == 4:
        return node.span.text.replace("rotate", "rot", 1)
    if len(node.arguments) != 1 or node.name.name not in ("translate", "rotate"):
        return None
    (argument,) = node.arguments
    match argument:
        case syntax.Vector(components=components) if len(components) == 3:
            parts = [None if _is_zero(each) else each.span.text for each in components]
        case (
            syntax.Binary(operator="*", left=syntax.Name(name=axis), right=factor)
            | syntax.Binary(operator="*", left=factor, right=syntax.Name(name=axis))
        ) if axis in ("x", "y", "z"):
            parts = [factor.span.text if each == axis else None for each in "xyz"]
        case _:
            return None
    if node.name.name == "translate":
        return f"trans {', '.join(part or '0' for part in parts)}"
    turns = [f"rot{axis} {part}" for axis, part in zip("xyz", parts) if part is not None]
    return "; ".join(reversed(turns)) or None


def _is_zero(node: syntax.Expression) -> bool:
    return isinstance(node, syntax.Number) and node.value == 0


def _calculates(node: syntax.Statement) -> bool | None:
    """Whether a statement belongs into a Calculation; None for an operation that there isn't."""
    if isinstance(node, syntax.Assignment):
        return True
    return node.name.name == "variants" if node.name.name in vocabulary.OPERATIONS else None
