"""Syntax tree → model: every name gets its meaning (DESIGN: the language).

resolve(syntax.File) → model.Model, with everything that is wrong in ``diagnostics``. A scene with errors still
gives a model of what could be understood, for editors; whether it may be compiled, ``diagnostics.has_errors``
tells.

Example::

    file, diagnostics = parse(Source.read("scenes/tree.plsys"))
    model = resolve(file, diagnostics, parameters={"order": 12})
    model.symbols["Tree"].production        # Branch(…)
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Callable

from . import meshes, syntax
from .diagnostics import Diagnostics, nearest
from .meanings import Meanings
from .model import Constant, Input, Mesh, Model, Record, SceneObject
from .problems import Problem
from .resolve_blocks import Blocks, Values
from .resolve_expressions import BLOCKS, INPUTS, Expressions, Value
from .resolve_items import Items
from .resolve_names import ARTICLES, Entry, Names
from .resolve_objects import Objects, split
from .resolve_operators import Operators
from .resolve_rules import Rules
from .resolve_terms import Terms
from .resolve_textures import Textures
from .source import Source, Span
from .vocabulary import BLOCKS as BLOCK_ROWS
from .vocabulary import MODIFIERS, OBJECT_BLOCKS, PRIMITIVES


def resolve(
    file: syntax.File,
    diagnostics: Diagnostics,
    *,
    parameters: dict[str, float] | None = None,
    seed: float | None = None,
    loader: Callable[[Path], Source] = Source.read,
    meanings: Meanings | None = None,
) -> Model:
    """The model of ``file`` and of what it includes.

    ``parameters`` sets ``Parameter`` inputs by name; ``seed`` overrides the scene's. ``loader`` reads included
    files (an editor gives what it has open) and raises OSError. ``meanings`` are kept from one time to the next.
    Messages are added to ``diagnostics``; nothing is raised for what a scene holds.
    """
    resolver = Resolver(file, diagnostics, dict(parameters or {}), seed, loader)
    resolver.names.meanings = meanings
    return resolver.run()


class Resolver:
    """Wires the resolve modules together and holds what they share: constants, the seed and meshes."""

    def __init__(
        self,
        file: syntax.File,
        diagnostics: Diagnostics,
        parameters: dict[str, float],
        seed: float | None,
        loader: Callable[[Path], Source],
    ) -> None:
        self.file, self.diagnostics, self.parameters = file, diagnostics, parameters
        self.seed = seed
        self.names = Names(diagnostics, loader)
        self.expressions = Expressions(self.names, self.constant_of, self.seed_of)
        self.textures = Textures(self.names, self.expressions)
        self.operators = Operators(self.names, self.expressions)
        self.terms = Terms(self.names, self.expressions, self.operators, self.textures, self.load_mesh)
        self.rules = Rules(self.names, self.expressions, self.terms)
        self.objects = Objects(self.names, self.expressions, self.textures, self.terms, self.add_mesh)
        self.blocks = Blocks(self.names, self.expressions, self.textures)
        self.begin()

    def begin(self) -> None:
        """Start afresh: nothing that was found out so far is known any more."""
        self.model = Model(self.file.span.source)
        self.settings: Values = {}
        self.mesh_files: dict[Path, int] = {}
        self.placed: dict[str, int] = {}  # how many objects place each symbol
        for each in (self.terms, self.rules, self.objects):
            each.begin()

    def run(self) -> Model:
        self.names.leads_to, self.names.has_same_edges = self.terms.leads_to, self.terms.has_same_edges
        self.names.gather(self.file)
        model, entries = self.model, self.names.entries
        model.files = self.names.files
        model.definitions = {name: entry.definition for name, entry in entries.items()}
        model.parameters = [name for name, entry in entries.items() if entry.kind == "parameter"]
        self.resolve_settings()
        self.resolve_inputs()
        # In the text's order, so that long chains of constants need no deep recursion.
        for entry in list(entries.values()):
            if entry.kind == "value":
                self.names.reporting(lambda: self.constant_of(entry, entry.definition.span), None)
        for entry in list(entries.values()):
            if isinstance(entry.node, syntax.Selection):
                model.symbols[entry.definition.name] = self.rules.selection(entry.node)
        for block in self.names.blocks:
            self.names.reporting(lambda: self.block(block), None)
        for entry in list(entries.values()):
            if entry.kind != "parameter":
                self.names.reporting(lambda: self.force(entry), None)
        if self.settings:
            model.settings = Record("settings", tuple(self.settings.items()))
        if self.names.meanings is not None:
            self.names.meanings.edges = self.terms.edges()
        return model

    def close(self) -> None:
        """Let go of the parts, which refer to each other: nothing is left to the search for garbage in cycles."""
        self.names.__dict__.clear()
        self.__dict__.clear()

    # --- settings and the seed

    def resolve_settings(self) -> None:
        """Settings come first: the seed is part of every ``hash``."""
        for block in self.names.blocks:
            if block.name.name == "global_settings":
                self.names.reporting(lambda: self.blocks.global_settings(block, self.settings), None)
        if self.seed is None:
            self.seed = self.settings.get("seed", (0.0,))[0]
        else:
            self.settings["seed"] = (float(self.seed),)
        if self.names.meanings is not None:
            self.names.meanings.use_seed(self.seed)

    def seed_of(self, span: Span) -> float:
        if self.seed is None:
            raise Problem(
                "wrong-value", span, "hash needs the scene's seed, which global_settings is only just setting"
            )
        return self.seed

    # --- constants

    def constant_of(self, entry: Entry, span: Span) -> Value:
        """The value of a declared constant or an input, worked out when first asked for. Raises Problem."""
        value = entry.once(
            lambda: self._value_of(entry), span, f"'{entry.definition.name}' is declared through itself"
        )
        assert isinstance(value, Value)
        return value

    def _value_of(self, entry: Entry) -> Value:
        node = entry.node
        if isinstance(node, syntax.ParameterDeclaration):
            return self._input(node)
        assert isinstance(node, syntax.Declare)
        items = Items(f"#declare {node.name.name}", node.span, node.items, self.expressions, BLOCKS)
        plain = isinstance(items.peek(), syntax.Name) and len(node.items) > 1
        colour = plain and items.starts_colour()
        value = items.colour() if colour else items.value("a value")
        if items:
            raise Problem(
                "wrong-value", items.peek().span, f"#declare {node.name.name} has more than one value"
            )
        return value

    # --- inputs

    def resolve_inputs(self) -> None:
        inputs = {name: entry for name, entry in self.names.entries.items() if entry.kind == "input"}
        for name, value in self.parameters.items():
            if name not in inputs:
                entry = self.names.entries.get(name)
                what = (
                    f"'{name}' is {ARTICLES[entry.kind]}" if entry else f"the scene has no Parameter '{name}'"
                )
                hint = nearest(name, inputs) or (
                    f"it has: {' '.join(inputs)}" if inputs else "it declares none"
                )
                option = Source.from_text(f"{name}={value:g}", "-D")
                self.diagnostics.add(
                    "unknown-name", Span(option, 0, len(name)), f"{what}, which -D can't set" if entry else what, hint
                )
        for entry in inputs.values():
            self.names.reporting(lambda: self.constant_of(entry, entry.definition.span), None)

    def _input(self, node: syntax.ParameterDeclaration) -> Value:
        name = node.name.name
        default = self.expressions.constant(node.value, INPUTS)
        low, high = (
            None if bound is None else self.expressions.constant(bound, INPUTS)
            for bound in (node.low, node.high)
        )
        if low is not None and high is not None and low > high:
            message = f"the range of '{name}' is empty: {low:g} is above {high:g}"
            raise Problem(
                "wrong-value", node.low.span.to(node.high.span), message, f"write [{high:g} to {low:g}]"
            )
        value = float(self.parameters.get(name, default))
        for number, what, span in ((default, "default", node.value.span), (value, "value", node.name.span)):
            outside = (low is not None and number < low) or (high is not None and number > high)
            if outside or not math.isfinite(number):
                allowed = (
                    f"from {low:g} to {high:g}" if low is not None and high is not None else "a finite number"
                )
                message = f"the {what} of '{name}' is {number:g}, but must be {allowed}"
                raise Problem("wrong-value", span, message)
        text = node.text.value if node.text is not None else ""
        self.model.inputs.append(Input(name, value, default, low, high, text, node.span))
        return Value("number", (Constant(value, node.span),), node.span)

    # --- blocks

    def block(self, block: syntax.Block) -> None:
        name = block.name.name
        if name == "global_settings" or not name:
            return
        if name == "background":
            self.once(block, "background" in self.settings)
            self.blocks.background(block, self.settings)
        elif name == "camera":
            self.once(block, self.model.camera is not None)
            self.model.camera = self.blocks.camera(block)
        elif name == "light_source":
            self.model.lights.append(self.blocks.light(block))
        elif name in OBJECT_BLOCKS:
            self.place(block)
        else:
            raise self._unknown_block(block)

    def once(self, block: syntax.Block, again: bool) -> None:
        if again:
            message = f"a second {block.name.name} block"
            self.diagnostics.add(
                "duplicate-name", block.name.span, message, "a scene has one; remove the other"
            )

    def place(self, block: syntax.Block) -> None:
        for symbol, operand in self.names.known(block, lambda: tuple(split(self.objects.object(block)))):
            ordinal = self.placed.get(symbol, 0)
            self.placed[symbol] = ordinal + 1
            self.model.objects.append(SceneObject(symbol, ordinal, operand, block.span))

    def _unknown_block(self, block: syntax.Block) -> Problem:
        name = block.name.name
        if name in MODIFIERS or name == "color_map" or name == "colour_map":
            hint = f"write it into an object, or #declare Name = {name} {{ … }}"
            return Problem("wrong-kind", block.name.span, f"'{name}' stands outside of an object", hint)
        if name in PRIMITIVES:
            return Problem(
                "wrong-kind",
                block.name.span,
                f"the primitive '{name}' is no scene block",
                "it stands in rules",
            )
        if name in self.names.entries:
            kind = self.names.entries[name].kind
            hint = f"to place it, write object {{ {name} }}" if kind in ("selection", "object") else ""
            return Problem(
                "wrong-kind", block.name.span, f"'{name}' is {ARTICLES[kind]}, not a scene block", hint
            )
        problem = self.names.unknown(block.name, (), "a scene block")
        if problem.code == "unknown-name":
            problem.hint = nearest(name, BLOCK_ROWS)
        return problem

    # --- what nothing uses still gets its errors

    def force(self, entry: Entry) -> None:
        node = entry.node
        if entry.kind in ("calculation", "transformation"):
            self.operators.declared(entry)
        elif entry.kind in ("texture", "pigment", "finish", "color_map"):
            if not entry.failed:
                self.textures.declared(entry, entry.definition.span)
        elif entry.kind == "object":
            self.objects.force(entry)
        elif entry.kind == "value" and not entry.failed:
            self.constant_of(entry, entry.definition.span)
        elif isinstance(node, syntax.Selection):
            self.terms.entry_action(node)

    # --- meshes

    def add_mesh(self, mesh: Mesh) -> int:
        self.names.record.is_lasting = False  # its number is this model's
        self.model.meshes.append(mesh)
        return len(self.model.meshes) - 1

    def load_mesh(self, call: syntax.Call) -> int:
        """The index of the mesh that ``mesh("leaf.obj")`` names, loaded once. Raises Problem."""
        if len(call.arguments) != 1 or not isinstance(call.arguments[0], syntax.String):
            raise Problem(
                "wrong-arguments", call.span, "mesh takes the name of a file", 'write mesh("leaf.obj")'
            )
        self.names.record.is_lasting = False
        text = call.arguments[0]
        base = text.span.source.path
        path = (base.parent if base is not None else Path()) / text.value
        if path not in self.mesh_files:
            try:
                self.mesh_files[path] = self.add_mesh(meshes.load(path))
            except meshes.MeshError as error:
                message = f"can't use the mesh '{text.value}': {error}"
                raise Problem(
                    "file", text.span, message, f"looked for {path}, relative to the scene file"
                ) from None
        return self.mesh_files[path]
