"""Scene objects: object, union and shape blocks → operands with their modifiers.

Later modifiers act outside of earlier ones, and a texture stands where it is written: transformations after it
move its pattern too. A union's texture is inherited by those inside that have none.

Example: ``sphere { <0,0,0>, 1 texture { T } translate <1,0,0> }`` is
``Prefixed(Transform(trans 1 0 0), Prefixed(Paint(T), Primitive('sphere')))``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Callable

from . import syntax
from .meshes import build
from .model import Enter, Mesh, MeshLeaf, NoShadow, Operand, Operator, Paint, Prefixed, Sum, Transform
from .problems import Problem
from .resolve_expressions import ARGUMENTS, BLOCKS, Expressions
from .resolve_items import Items
from .resolve_names import Entry, Names
from .resolve_shapes import corners, shape
from .resolve_terms import Terms
from .resolve_textures import TRANSFORMATIONS, Look, Textures
from .source import Span
from .vocabulary import BLOCKS as BLOCK_ROWS
from .vocabulary import MODIFIERS, OBJECT_BLOCKS

# What other languages have as a name, and here is a difference.
SIGNED_NAME = re.compile(r"[A-Za-z_]\w*(?:-[A-Za-z_]\w*)+", re.ASCII)

# Declared objects in declared objects double quickly; a million parts is more than a text should hold.
MAX_PARTS = 1_000_000


@dataclass
class Placed:
    """An object as it is put together: the operand so far, then modifiers from the innermost outwards. The
    texture's place among them is ``paint``; ``compound`` for unions, whose parts have textures of their own."""

    operand: Operand
    compound: bool
    modifiers: list[Operator | None] = field(default_factory=list)  # None: where the texture stands
    look: Look | None = None

    def put_texture(self, look: Look, move: bool) -> None:
        """Set the texture; ``move`` its pattern's frame to here (a finish leaves it where it was)."""
        self.look = look
        if move or None not in self.modifiers:
            self.modifiers = [modifier for modifier in self.modifiers if modifier is not None]
            self.modifiers.append(None)

    def finished(self, block: syntax.Block) -> Operand:
        operand = self.operand
        for modifier in self.modifiers:
            if modifier is None:
                assert self.look is not None
                modifier = Paint("", self.look.record(), block.span)
            operand = Prefixed(modifier, operand, block.span)
        return operand


class Objects:
    """``add_mesh`` keeps a mesh and gives its index, ``load_mesh`` one of a file."""

    def __init__(
        self,
        names: Names,
        expressions: Expressions,
        textures: Textures,
        terms: Terms,
        add_mesh: Callable[[Mesh], int],
    ) -> None:
        self.names, self.expressions, self.textures = names, expressions, textures
        self.terms, self.add_mesh = terms, add_mesh
        self.begin()

    def begin(self) -> None:
        """Start with the objects of another scene."""
        self._sizes: dict[int, tuple[int, Operand]] = {}

    def object(self, block: syntax.Block) -> Operand:
        """The operand of a scene block that makes an object. Raises Problem."""
        return self.placed(block).finished(block)

    def placed(self, block: syntax.Block) -> Placed:
        name = block.name.name
        items = Items(f"'{name}'", block.span, block.items, self.expressions, BLOCKS)
        if name == "object":
            placed = self._object(items)
        elif name == "union":
            placed = self._union(items)
        elif name == "mesh":
            placed = Placed(self._mesh(items), compound=False)
        elif name == "smooth_triangle":
            placed = Placed(
                MeshLeaf(self.add_mesh(build("", [corners(items, smooth=True)])), block.span), compound=False
            )
        else:
            placed = Placed(shape(items, name), compound=False)
        self.modify(placed, items)
        if self._size(placed.operand) > MAX_PARTS:
            message = f"this object has more than {MAX_PARTS:,} parts"
            raise Problem(
                "limit", block.name.span, message, "let a Selection make what repeats: it is never copied"
            )
        return placed

    def _size(self, operand: Operand) -> int:
        """How many leaves the operand has, shared parts counted wherever they stand."""
        while isinstance(operand, Prefixed):
            operand = operand.operand
        if not isinstance(operand, Sum):
            return 1
        if id(operand) not in self._sizes:
            self._sizes[id(operand)] = (
                sum(map(self._size, operand.terms)),
                operand,
            )  # kept: its id stays its own
        return self._sizes[id(operand)][0]

    # --- what is placed

    def _object(self, items: Items) -> Placed:
        item = items.peek()
        if item is None:
            raise Problem(
                "wrong-arguments",
                items.span,
                "this object is empty",
                "write object { Name } with a Selection's name",
            )
        items.take()
        if isinstance(item, syntax.Block) and item.name.name in OBJECT_BLOCKS:
            return self._nested(item)
        name = item.name if isinstance(item, syntax.Call) else item
        if not isinstance(name, syntax.Name):
            if SIGNED_NAME.fullmatch(item.span.text):
                raise _with_a_sign(item)
            items.at -= 1
            raise items.misfit(())
        if name.name == "mesh" and isinstance(item, syntax.Call):
            return Placed(self.terms.operand(item, "", ARGUMENTS), compound=False)
        entry = self.names.find(name, ("selection", "object"), "a Selection or a declared object")
        if entry.kind == "object":
            if isinstance(item, syntax.Call):
                raise Problem(
                    "wrong-arguments", item.span, f"'{name.name}' is a declared object and takes no arguments"
                )
            return self._declared(entry, name)
        arguments = item.arguments if isinstance(item, syntax.Call) else ()
        return Placed(self.terms.enter(entry, item.span, arguments, "", ARGUMENTS), compound=True)

    def _nested(self, block: syntax.Block) -> Placed:
        """What ``object { sphere { … } … }`` holds; its own texture stays under the outer modifiers' control."""
        inner = self.placed(block)
        return Placed(inner.operand, inner.compound, list(inner.modifiers), inner.look)

    def _declared(self, entry: Entry, name: syntax.Name) -> Placed:
        assert isinstance(entry.node, syntax.Declare)
        node = entry.node
        value = entry.once(
            lambda: self._declaration(node), name.span, f"the object '{name.name}' contains itself"
        )
        assert isinstance(value, Placed)
        return Placed(value.operand, value.compound, list(value.modifiers), value.look)

    def force(self, entry: Entry) -> None:
        """Resolve a declared object that may not be used, for its errors. Raises Problem."""
        if entry.value is None and not entry.failed:
            assert isinstance(entry.node, syntax.Declare)
            self._declared(entry, entry.node.name)

    def _declaration(self, node: syntax.Declare) -> Placed:
        block = node.items[0]
        assert isinstance(block, syntax.Block)
        if block.name.name not in OBJECT_BLOCKS:
            row = BLOCK_ROWS.get(block.name.name)
            if row is None:
                raise self.names.unknown(block.name, (), "a block that makes an object or a texture")
            hint = "texture, pigment, finish, color_map and objects can be declared"
            raise Problem("unsupported", block.name.span, f"a {row.name} can't be declared", hint)
        if len(node.items) > 1:
            raise Problem(
                "wrong-value", node.items[1].span, f"#declare {node.name.name} has more than one value"
            )
        return self.placed(block)

    def _union(self, items: Items) -> Placed:
        parts: list[Operand] = []
        while isinstance(items.peek(), syntax.Block) and items.word() not in MODIFIERS:
            block = items.take()
            assert isinstance(block, syntax.Block)
            if block.name.name not in OBJECT_BLOCKS:
                items.at -= 1
                raise items.misfit(OBJECT_BLOCKS)
            parts.append(self.object(block))
        self._no_bare_symbol(items)
        if not parts:
            raise Problem(
                "wrong-arguments", items.span, "this union is empty", "write objects into it: sphere { … }"
            )
        return Placed(parts[0] if len(parts) == 1 else Sum(tuple(parts), items.span), compound=True)

    def _no_bare_symbol(self, items: Items) -> None:
        """Raises Problem for the name of a Selection or a declared object where a union's object is awaited."""
        item, entry = items.peek(), self.names.entries.get(items.word())
        if entry is not None and entry.kind in ("selection", "object") and not isinstance(item, syntax.Block):
            mend = f"object {{ {item.span.text} }}"
            raise Problem("wrong-kind", item.span, "a union joins blocks", f"write {mend}", mend=mend)

    def _mesh(self, items: Items) -> Operand:
        triangles = []
        if isinstance(path := items.peek(), syntax.String):
            mend = f"object {{ mesh({path.span.text})"
            raise Problem(
                "wrong-arguments",
                Span(path.span.source, items.span.start, path.span.end),
                "a mesh block holds triangles; a mesh from a file is a primitive",
                f"write {mend} }}",
                mend=mend,
            )
        while isinstance(items.peek(), syntax.Block) and items.word() in ("triangle", "smooth_triangle"):
            block = items.take()
            assert isinstance(block, syntax.Block)
            inner = Items(f"'{block.name.name}'", block.span, block.items, self.expressions, BLOCKS)
            triangles.append(corners(inner, block.name.name == "smooth_triangle"))
            if inner:
                if inner.word() == "texture":
                    raise Problem(
                        "unsupported",
                        inner.peek().span,
                        "a texture a triangle isn't supported",
                        "put it on the mesh",
                    )
                raise inner.misfit(())
        if not triangles:
            raise Problem(
                "wrong-arguments", items.span, "this mesh is empty", "write triangle { a, b, c } into it"
            )
        return MeshLeaf(self.add_mesh(build("", triangles)), items.span)

    # --- modifiers

    def modify(self, placed: Placed, items: Items) -> None:
        """Add the modifiers that follow in ``items``. Raises Problem."""
        while items:
            word = items.word()
            item = items.peek()
            if word in TRANSFORMATIONS:
                steps = self.textures.steps(items)
                if steps:
                    placed.modifiers.append(Transform("", steps, steps[0].span))
            elif word == "no_shadow" and isinstance(item, syntax.Name):
                items.take()
                placed.modifiers.append(NoShadow(item.span))
            elif word in ("texture", "pigment", "finish") and isinstance(item, syntax.Block):
                items.take()
                self._look(placed, item)
            else:
                raise items.misfit(list(MODIFIERS))

    def _look(self, placed: Placed, block: syntax.Block) -> None:
        word, look = block.name.name, placed.look or Look()
        if word == "texture":
            if placed.look is not None and not placed.compound:
                hint = "an object has one texture; POV-Ray would lay this one over the first"
                raise Problem("unsupported", block.span, "layered textures aren't supported", hint)
            placed.put_texture(self.textures.texture(block, BLOCKS), move=True)
        elif word == "pigment":
            pigment = self.textures.pigment(block, BLOCKS, look.pigment if placed.look else None)
            placed.put_texture(Look(pigment, look.finish), move=True)
        else:
            placed.put_texture(
                Look(look.pigment, self.textures.finish(block, BLOCKS, look.finish)), move=False
            )


def _with_a_sign(item: syntax.Item) -> Problem:
    mend = item.span.text.replace("-", "_")
    return Problem("wrong-value", item.span, f"the name '{item.span.text}' has a sign in it", f"write {mend}", mend=mend)


def split(operand: Operand) -> list[tuple[str, Operand]]:
    """A scene object as (start symbol, operand) pairs: one a symbol placed, so that each has a random key of its
    own, and one with the symbol '' for all that has none. Modifiers stay round each."""
    if isinstance(operand, Enter):
        return [(operand.symbol, operand)]
    if isinstance(operand, Prefixed):
        return [
            (symbol, Prefixed(operand.operator, part, operand.span)) for symbol, part in split(operand.operand)
        ]  # fmt: skip
    if not isinstance(operand, Sum):
        return [("", operand)]
    found = [pair for term in operand.terms for pair in split(term)]
    plain = tuple(part for symbol, part in found if not symbol)
    pairs = [pair for pair in found if pair[0]]
    if plain:
        pairs.append(("", plain[0] if len(plain) == 1 else Sum(plain, operand.span)))
    return pairs
