"""Expressions, statements, steps and textures → the stack machine's code.

Each piece is assembled on its own; equal pieces share one place in the code section. Operands that name
constants, slots and strings come from the tables given.

Example: ``betaBr -= 4`` is ``load betaBr · const 4 · subtract · store betaBr · end``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from ..graph import graph as g
from ..reading.diagnostics import PlsysError
from ..reading.model import Apply, Assign, Constant, Expression, Read, TextureValue
from ..reading.source import Span
from .layout import write_u
from .layout_rows import LIMITS, OPCODES, RECORDS


class Assembler:
    """The code section in the making. ``constant``, ``slot`` and ``string`` give the operands' numbers."""

    def __init__(
        self, constant: Callable[[float], int], slot: Callable[[str], int], string: Callable[[str], int]
    ) -> None:
        self.constant, self.slot, self.string = constant, slot, string
        self.code = bytearray()
        self.places: dict[bytes, int] = {}

    def of_node(self, node: g.Node) -> int:
        """The ``code`` field of a node: 0 if it has none, else its offset + 1."""
        piece = _Piece(self, node.span)
        match node:
            case g.Calculate():
                piece.calculation(node)
            case g.TransformCode():
                for step in node.steps:
                    piece.values(step.arguments)
                    piece.emit(step.operation)
            case g.Texture():
                piece.texture(node.texture)
            case g.Primitive():
                piece.values(node.arguments)
        return self.finish(piece)

    def of_value(self, expression: Expression, span: Span | None) -> int:
        """Code that leaves one value: a guard or a weight."""
        piece = _Piece(self, span)
        piece.value(expression)
        return self.finish(piece)

    def finish(self, piece: _Piece) -> int:
        if not piece.code:
            return 0
        piece.emit("end")
        key = bytes(piece.code)
        if key not in self.places:
            self.places[key] = len(self.code)
            self.code += key
        return self.places[key] + 1


class _Piece:
    def __init__(self, owner: Assembler, span: Span | None) -> None:
        self.owner, self.span = owner, span
        self.code = bytearray()
        self.depth = 0

    def emit(self, name: str, operand: int | None = None) -> None:
        row = OPCODES[name]
        self.code.append(row.id)
        if operand is not None:
            write_u(self.code, operand)
        self.depth += row.pushes - (operand if row.pops < 0 else row.pops)
        if self.depth > LIMITS["stack"]:
            place = str(self.span) if self.span else ""
            raise PlsysError(f"an expression needs more than {LIMITS['stack']} values at a time", place)

    def values(self, expressions: Iterable[Expression]) -> None:
        for expression in expressions:
            self.value(expression)

    def value(self, expression: Expression) -> None:
        match expression:
            case Constant():
                self.number(expression.value)
            case Read():
                self.emit("load", self.owner.slot(expression.parameter))
            case Apply("and", (left, right)):
                self.choice(left, lambda: self.truth(right), lambda: self.number(0.0))
            case Apply("or", (left, right)):
                self.choice(left, lambda: self.number(1.0), lambda: self.truth(right))
            case Apply("select", (test, then, otherwise)):
                self.choice(test, lambda: self.value(then), lambda: self.value(otherwise))
            case Apply("hash"):
                self.values(expression.arguments)
                self.emit("hash", len(expression.arguments))
            case Apply():
                self.values(expression.arguments)
                self.emit(expression.operation)

    def truth(self, expression: Expression) -> None:
        self.value(expression)
        self.emit("bool")

    def choice(self, test: Expression, then: Callable[[], None], otherwise: Callable[[], None]) -> None:
        """Values by two ways, of which only one runs."""
        self.value(test)
        depth = self.depth - 1
        before, self.code = self.code, bytearray()
        self.depth = depth
        then()
        taken, self.code = self.code, bytearray()
        self.depth = depth
        otherwise()
        skipped, self.code = self.code, before
        jump = bytearray([OPCODES["jump"].id])
        write_u(jump, len(skipped))
        self.code.append(OPCODES["jump_if_zero"].id)
        write_u(self.code, len(taken) + len(jump))
        self.code += taken + jump + skipped

    def number(self, value: float) -> None:
        """A constant; those that the constants section doesn't hold are calculated."""
        if math.isfinite(value):
            self.emit("const", self.owner.constant(abs(value) if value == 0 else value))
            if value == 0 and math.copysign(1, value) < 0:
                self.emit("negate")
        else:
            self.number(0.0 if math.isnan(value) else math.copysign(1, value))
            self.number(0.0)
            self.emit("divide")

    def calculation(self, node: g.Calculate) -> None:
        """Statement by statement; with ``together`` all values first, then all assignments."""
        if node.together:
            self.values(statement.value for statement in node.statements)
            for statement in reversed(node.statements):
                self.emit("store", self.owner.slot(statement.parameter))
            return
        for statement in node.statements:
            if isinstance(statement, Assign):
                self.value(statement.value)
                self.emit("store", self.owner.slot(statement.parameter))
            else:
                self.value(statement.count)
                self.emit("variants", self.owner.string(node.name))

    def texture(self, texture: TextureValue) -> None:
        """What isn't constant of a texture."""
        for index, value in texture_values(texture):
            if not isinstance(value, Constant):
                self.value(value)
                self.emit("texture_set", index)


def texture_values(texture: TextureValue) -> Iterable[tuple[int, Expression]]:
    """(index in the texture record, value) of all that a texture sets, in order."""
    row = RECORDS["texture"]
    for name, values in texture.values:
        offset = row.values[name].offset
        yield from ((offset + i, value) for i, value in enumerate(values))
    for i, entry in enumerate(texture.entries):
        yield from ((row.size + i * len(row.entry) + j, value) for j, value in enumerate(entry))
