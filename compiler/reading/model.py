"""The checked model: a scene whose every name has a meaning.

``resolve.resolve(file, …) -> Model`` makes it from the syntax tree, ``check.check(model)`` looks for scenes that
can't work, and ``graph.lower`` turns it into the cyclic graph. Constants (``#declare`` numbers, ``Parameter``
inputs, ``pi``) are already values here; what remains symbolic is what changes along a derivation.

Example: ``betaBr -= 4.0;`` is
``Assign('betaBr', Apply('subtract', (Read('betaBr'), Constant(4.0))))``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from .records import record
from .source import Source, Span

# --- expressions: over doubles ---------------------------------------------------------------------------------


@record
class Constant:
    value: float
    span: Span | None = field(default=None, compare=False)


@record
class Read:
    """The value of a parameter on the derivation's path."""

    parameter: str
    span: Span | None = field(default=None, compare=False)


@record
class Apply:
    """``operation`` is an opcode's name in runtime/bytecode.toml (``add``, ``less``, ``sin``, ``rand``, ``hash`` …)
    or one of ``and``, ``or``, ``select`` (test, then, otherwise), which evaluate only what they need."""

    operation: str
    arguments: tuple[Expression, ...]
    span: Span | None = field(default=None, compare=False)


Expression = Constant | Read | Apply


# --- operators ----------------------------------------------------------------------------------------------------


@record
class Assign:
    parameter: str
    value: Expression
    span: Span | None = field(default=None, compare=False)


@record
class Variants:
    """``variants n;``: the random key becomes one of n."""

    count: Expression
    span: Span | None = field(default=None, compare=False)


@record
class Calculate:
    """``name`` is '' for inline ones and symbol arguments. With ``together`` all values are evaluated before
    the first is assigned (symbol arguments)."""

    name: str
    statements: tuple[Assign | Variants, ...]
    together: bool = False
    span: Span | None = field(default=None, compare=False)


@record
class Step:
    """One line of a Transformation: ``operation`` is an opcode's name (trans rotx roty rotz rot scale
    scale_uniform shear matrix)."""

    operation: str
    arguments: tuple[Expression, ...]
    span: Span | None = field(default=None, compare=False)


@record
class Transform:
    """Steps compose like local frames: the last acts on the object first, M = step0 · step1 · …"""

    name: str
    steps: tuple[Step, ...]
    span: Span | None = field(default=None, compare=False)


@record
class TextureValue:
    """A whole texture: ``values`` by name of the texture record in runtime/bytecode.toml (only what is set;
    ``pattern`` is a Constant with the pattern's id), ``entries`` of six expressions each
    (position, red, green, blue, filter, transmit)."""

    values: tuple[tuple[str, tuple[Expression, ...]], ...]
    entries: tuple[tuple[Expression, ...], ...]


@record
class Paint:
    """A texture operator, or a scene object's texture."""

    name: str
    texture: TextureValue
    span: Span | None = field(default=None, compare=False)


@record
class NoShadow:
    span: Span | None = field(default=None, compare=False)


Operator = Calculate | Transform | Paint | NoShadow


# --- operands and productions -----------------------------------------------------------------------------------------


@record
class Enter:
    """A reference to a Selection. Arguments and entry action stand before it as Calculate operators."""

    symbol: str
    span: Span | None = field(default=None, compare=False)


@record
class Primitive:
    """``shape`` is a shape's name in runtime/bytecode.toml; arguments in its order."""

    shape: str
    arguments: tuple[Expression, ...] = ()
    span: Span | None = field(default=None, compare=False)


@record
class MeshLeaf:
    """An index into ``Model.meshes``."""

    mesh: int
    span: Span | None = field(default=None, compare=False)


@record
class Prefixed:
    operator: Operator
    operand: Operand
    span: Span | None = field(default=None, compare=False)


@record
class Sum:
    """Two or more terms of a union."""

    terms: tuple[Operand, ...]
    span: Span | None = field(default=None, compare=False)


@record
class Empty:
    span: Span | None = field(default=None, compare=False)


Operand = Enter | Primitive | MeshLeaf | Prefixed | Sum | Empty


@record
class Produce:
    """A production's right-hand side; ``rule`` counts the scene's rules in source order from 0."""

    rule: int
    body: Operand
    span: Span | None = field(default=None, compare=False)


@record
class Branch:
    test: Expression
    then: Production
    otherwise: Production  # Empty where no rule applies
    span: Span | None = field(default=None, compare=False)


@record
class Choose:
    cases: tuple[tuple[Expression, Produce], ...]
    span: Span | None = field(default=None, compare=False)


Production = Produce | Branch | Choose | Empty


# --- the scene -------------------------------------------------------------------------------------------------------------


@record
class Symbol:
    name: str
    production: Production
    span: Span
    name_span: Span


@record
class Mesh:
    """``vertices`` (n, 3) float64, ``normals`` (m, 3) float64 or (0, 3), ``triangles`` (k, 3) vertex indices,
    ``normal_triangles`` (k, 3) normal indices or (0, 3); NumPy arrays."""

    name: str
    vertices: object
    normals: object
    triangles: object
    normal_triangles: object


@record
class Record:
    """Camera, light or settings: ``kind`` and ``values`` as in runtime/bytecode.toml's records; only what is set."""

    kind: str
    values: tuple[tuple[str, tuple[float, ...]], ...]
    span: Span | None = field(default=None, compare=False)


@record
class SceneObject:
    """One placed object. ``symbol`` is the start symbol's name or ''; ``ordinal`` counts the objects that
    place it, from 0. ``body`` holds modifiers as operators, outermost first (the last modifier is outermost)."""

    symbol: str
    ordinal: int
    body: Operand
    span: Span


@record
class Input:
    """``Parameter name = default [low to high] "text";`` with the value that this compilation uses."""

    name: str
    value: float
    default: float
    low: float | None
    high: float | None
    text: str
    span: Span


@dataclass(eq=False)
class Definition:
    """A name of the scene, for messages and editors: ``kind`` is selection, calculation, transformation, texture,
    pigment, finish, color_map, object, value, input or parameter; ``span`` its (first) defining occurrence,
    ``assignments`` where a parameter is assigned, ``references`` where the name is used."""

    name: str
    kind: str
    span: Span
    assignments: list[Span] = field(default_factory=list)
    references: list[Span] = field(default_factory=list)


@dataclass
class Model:
    """A scene whose names all have a meaning."""

    source: Source
    files: list[Path] = field(default_factory=list)  # every file read, the scene's first
    settings: Record | None = None
    camera: Record | None = None
    lights: list[Record] = field(default_factory=list)
    objects: list[SceneObject] = field(default_factory=list)
    symbols: dict[str, Symbol] = field(default_factory=dict)
    parameters: list[str] = field(default_factory=list)  # assigned names, in order of first appearance
    meshes: list[Mesh] = field(default_factory=list)
    inputs: list[Input] = field(default_factory=list)
    definitions: dict[str, Definition] = field(default_factory=dict)
