"""The syntax tree: what a file says, before any name has a meaning.

``parse.parse(source) -> (File, diagnostics)`` makes it from tree-sitter's tree; ``resolve`` gives it meaning.
Every node has ``span``. Names are not keywords here: ``sphere``, ``Tree`` and ``location`` are all
:class:`Name`, and the vocabulary tells them apart.

Example: ``Tree -> T_scaleCyl cylinder + C_Trunk Tree;`` is ::

    Rule(target=Name('Tree'), alternatives=(Alternative(weight=None, body=
        Union((Term((Name('T_scaleCyl'), Name('cylinder'))), Term((Name('C_Trunk'), Name('Tree')))))),))
"""

from __future__ import annotations

from .records import record
from .source import Span


@record
class Node:
    span: Span


# --- expressions -------------------------------------------------------------------------------------------


@record
class Number(Node):
    value: float
    text: str  # as written: `2`, `1.50`


@record
class String(Node):
    value: str  # without quotes, escapes resolved


@record
class Name(Node):
    name: str


@record
class Call(Node):
    """``name(arguments)``: no space before the bracket."""

    name: Name
    arguments: tuple[Expression, ...]


@record
class Vector(Node):
    """``<a, b, c>``: two to five components."""

    components: tuple[Expression, ...]


@record
class Unary(Node):
    operator: str  # - + !
    operand: Expression


@record
class Binary(Node):
    operator: str  # * / % + - < <= > >= == != && ||
    left: Expression
    right: Expression


@record
class Conditional(Node):
    test: Expression
    then: Expression
    otherwise: Expression


Expression = Number | String | Name | Call | Vector | Unary | Binary | Conditional


# --- statements of Calculations and Transformations -----------------------------------------------------------


@record
class Assignment(Node):
    """``target = value``, ``target += value`` …, ``++target``/``target++`` (value None)."""

    target: Name
    operator: str  # = += -= *= /= ++ --
    value: Expression | None


@record
class Operation(Node):
    """``trans 0 0 1.99;``, ``roty betaBr;``, ``variants 32;``: a name with arguments side by side or with commas."""

    name: Name
    arguments: tuple[Expression, ...]


Statement = Assignment | Operation


# --- productions -------------------------------------------------------------------------------------------------


@record
class Inline(Node):
    """``[ --n; trans 0 0 1 ]``: each line is an operator."""

    statements: tuple[Statement, ...]


@record
class Group(Node):
    """``( a + b )``"""

    union: Union


@record
class Term(Node):
    """Operators, outermost first, and last the operand: ``C_Trunk T_shiftTrunk Tree``.

    Items are what the text has; that all but the last are operators is for ``resolve`` to check."""

    items: tuple[Name | Call | Inline | Group | Block, ...]


@record
class Union(Node):
    """``term + term + …`` (left-associative: one node, terms in order; one term is a Union of one)."""

    terms: tuple[Term, ...]


@record
class Alternative(Node):
    """``weight: body`` of a Rule. ``body`` None is the empty production ``A -> ;``."""

    weight: Expression | None
    body: Union | None


@record
class Rule(Node):
    """``target -> body;`` or ``target -> 3: x | 1: y;``"""

    target: Name | Call
    alternatives: tuple[Alternative, ...]


@record
class If(Node):
    """``if (test) then else otherwise``; ``else`` is already bound to the nearest ``if``."""

    test: Expression
    then: Production
    otherwise: Production | None


Production = Rule | If


# --- scene blocks -------------------------------------------------------------------------------------------------


@record
class MapEntry(Node):
    """``[0.25 color rgb <1, 0, 0>]`` of a ``color_map``."""

    items: tuple[Item, ...]


@record
class Block(Node):
    """``name { items }``, POV-Ray's form. Items stand flat, as written: ``location <0, 1, 2> angle 45`` is
    Name, Vector, Name, Number; grouping them into properties is the vocabulary's business."""

    name: Name
    items: tuple[Item, ...]


Item = Expression | Block | MapEntry


# --- top level --------------------------------------------------------------------------------------------------------


@record
class Include(Node):
    path: String


@record
class Declare(Node):
    """``#declare Name = items`` (an expression, ``color rgb …``, or a block)."""

    name: Name
    items: tuple[Item, ...]


@record
class ParameterDeclaration(Node):
    """``Parameter order = 10 [0 to 20] "Age";``"""

    name: Name
    value: Expression
    low: Expression | None
    high: Expression | None
    text: String | None


@record
class Selection(Node):
    """``Name(parameters) { entry; productions }``. ``entry`` is the term of the entry action,
    ``C_initialize Tree``: Calculations and last the Selection's own name. Where a header breaks off, not ``is_whole``,
    parameters may be missing."""

    name: Name
    parameters: tuple[Name, ...]
    entry: Term | None
    productions: tuple[Production, ...]
    is_whole: bool = True


@record
class Calculation(Node):
    name: Name
    statements: tuple[Statement, ...]


@record
class Transformation(Node):
    name: Name
    statements: tuple[Statement, ...]


@record
class Texture(Node):
    """``Texture Name { pigment {…} finish {…} }``: a texture operator that may read parameters."""

    name: Name
    block: Block


Definition = (
    Include | Declare | ParameterDeclaration | Selection | Calculation | Transformation | Texture | Block
)


@record
class File(Node):
    definitions: tuple[Definition, ...]
