"""Text → syntax tree, and what is said about text that isn't one.

``tests/cases/syntax/*.txt`` hold a scene, a line ``----``, and its messages;
``PLSYS_BLESS=1`` rewrites those.
"""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plsys.compiler.reading import syntax
from plsys.compiler.reading.diagnostics import render
from plsys.compiler.reading.grammar import syntax_tree
from plsys.compiler.reading.parse import convert, parse
from plsys.compiler.reading.parse_values import MAX_DEPTH
from plsys.compiler.reading.diagnostics import Diagnostics
from plsys.compiler.reading.source import Source

ROOT = Path(__file__).resolve().parents[3]
CASES = sorted((ROOT / "tests/cases/syntax").glob("*.txt"))
SCENES = sorted((ROOT / "scenes").glob("**/*.plsys"))
SEPARATOR = "----\n"


def read(text: str) -> syntax.File:
    """The tree of a text without errors."""
    file, diagnostics = parse(Source.from_text(text, "scene.plsys"))
    assert [render(item) for item in diagnostics.items] == []
    return file


def messages(text: str | bytes) -> list[str]:
    source = Source("scene.plsys", text if isinstance(text, bytes) else text.encode())
    return [item.message for item in parse(source)[1].items]


def production(text: str) -> syntax.Production:
    selection = read(f"Selection A {{ {text} }}").definitions[0]
    return selection.productions[0]


def value(text: str) -> syntax.Expression:
    return read(f"Calculation C {{ a = {text}; }}").definitions[0].statements[0].value


def arguments(text: str) -> list[str]:
    operation = read(f"Transformation T {{ trans {text}; }}").definitions[0].statements[0]
    return [argument.span.text for argument in operation.arguments]


def outline(node: object) -> object:
    """A tree as nested tuples of class names and texts, without spans."""
    if isinstance(node, tuple):
        return tuple(outline(each) for each in node)
    if isinstance(node, syntax.Number):
        return node.value
    if isinstance(node, syntax.Name):
        return node.name
    if isinstance(node, syntax.Node):
        fields = (getattr(node, name) for name in node.__dataclass_fields__ if name != "span")
        return (type(node).__name__, *(outline(field) for field in fields))
    return node


# --- golden messages


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)
def test_messages(case: Path) -> None:
    scene, _, expected = case.read_text().partition(SEPARATOR)
    _, diagnostics = parse(Source.from_text(scene, "scene.plsys"))
    actual = "\n".join(render(item) for item in diagnostics.items) + "\n"
    if os.environ.get("PLSYS_BLESS"):
        case.write_text(scene + SEPARATOR + actual)
        return
    assert actual == expected


# --- trees


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.stem)
def test_scenes_have_no_syntax_errors(scene: Path) -> None:
    _, diagnostics = parse(Source.read(scene))
    assert [render(item) for item in diagnostics.items] == []


def test_operators_bind_tighter_than_union() -> None:
    rule = production("A -> T cylinder + C (x A + y A);")
    assert outline(rule.alternatives[0].body) == (
        "Union",
        (
            ("Term", ("T", "cylinder")),
            ("Term", ("C", ("Group", ("Union", (("Term", ("x", "A")), ("Term", ("y", "A"))))))),
        ),
    )


def test_else_belongs_to_the_nearest_if() -> None:
    outer = production("if (a) if (b) A -> x; else A -> y; else A -> z;")
    assert isinstance(outer, syntax.If) and outer.test.name == "a"
    assert isinstance(outer.then, syntax.If) and outer.then.test.name == "b"
    assert outer.then.otherwise.alternatives[0].body.span.text == "y"
    assert outer.otherwise.alternatives[0].body.span.text == "z"
    lone = production("if (a) if (b) A -> x; else A -> y;")
    assert lone.otherwise is None and lone.then.otherwise is not None


def test_weighted_alternatives_and_the_empty_production() -> None:
    rule = production("A -> 3: T x | w: y + z | f(1, 2): ;")
    assert [outline(each.weight) for each in rule.alternatives] == [3.0, "w", ("Call", "f", (1.0, 2.0))]
    assert [each.body and each.body.span.text for each in rule.alternatives] == ["T x", "y + z", None]
    assert production("A -> ;").alternatives[0].body is None


def test_a_bracket_with_a_space_before_it_is_an_operand() -> None:
    body = production("A -> B(1) C (x);").alternatives[0].body
    assert [type(item).__name__ for item in body.terms[0].items] == ["Call", "Name", "Group"]


def test_inline_operators() -> None:
    inline = production("A -> [ --n; trans 0 0 1 ] A;").alternatives[0].body.terms[0].items[0]
    assert outline(inline) == (
        "Inline",
        (("Assignment", "n", "--", None), ("Operation", "trans", (0.0, 0.0, 1.0))),
    )


def test_entry_action_and_parameters() -> None:
    selection = read("Selection A(a, b) { C_x C_y A; A(a, b) -> x; }").definitions[0]
    assert [each.name for each in selection.parameters] == ["a", "b"]
    assert outline(selection.entry) == ("Term", ("C_x", "C_y", "A"))
    assert isinstance(selection.productions[0].target, syntax.Call)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("0 -1 len*0.9", ["0", "-1", "len*0.9"]),
        ("R-1 0 0", ["R-1", "0", "0"]),
        ("R - 1 0 0", ["R - 1", "0", "0"]),
        ("R -1 0", ["R", "-1", "0"]),
        ("R- 1 0", ["R- 1", "0"]),
        ("a +b -c", ["a", "+b", "-c"]),
        ("-a*b -c/d (1 - 2)", ["-a*b", "-c/d", "1 - 2"]),
        ("f(a -1) (b) 2", ["f(a -1)", "b", "2"]),
        ("0, -1, R -1", None),
        ("a, -b, <1, 2> * 0.5", ["a", "-b", "<1, 2> * 0.5"]),
    ],
)
def test_a_sign_touches_only_what_follows(text: str, expected: list[str] | None) -> None:
    if expected is None:
        assert messages(f"Transformation T {{ trans {text}; }}") == [
            "commas stand between some of these arguments only"
        ]
    else:
        assert arguments(text) == expected


def test_items_of_a_block_stand_as_written() -> None:
    block = read(
        "camera { location <0, -R, R-1> angle 45 [0.3 color rgb 1] pigment { rgb 1 -1 } }"
    ).definitions[0]
    assert outline(block.items) == (
        "location",
        ("Vector", (0.0, ("Unary", "-", "R"), ("Binary", "-", "R", 1.0))),
        "angle",
        45.0,
        ("MapEntry", (0.3, "color", "rgb", 1.0)),
        ("Block", "pigment", ("rgb", 1.0, ("Unary", "-", 1.0))),
    )


@pytest.mark.parametrize(
    "text, expected",
    [
        ("a + b * c - d", ("Binary", "-", ("Binary", "+", "a", ("Binary", "*", "b", "c")), "d")),
        ("-a * b", ("Binary", "*", ("Unary", "-", "a"), "b")),
        ("a < b == c", ("Binary", "==", ("Binary", "<", "a", "b"), "c")),
        ("a || b && !c", ("Binary", "||", "a", ("Binary", "&&", "b", ("Unary", "!", "c")))),
        ("a ? b : c ? d : e", ("Conditional", "a", "b", ("Conditional", "c", "d", "e"))),
        ("a - b - c", ("Binary", "-", ("Binary", "-", "a", "b"), "c")),
        ("(a - b) % 2", ("Binary", "%", ("Binary", "-", "a", "b"), 2.0)),
        ("pow(a, 2) / 1.5e-3", ("Binary", "/", ("Call", "pow", ("a", 2.0)), 1.5e-3)),
        ("a--1", None),
    ],
)
def test_precedence(text: str, expected: object) -> None:
    if expected is None:
        assert messages(f"Calculation C {{ a = {text}; }}") != []
    else:
        assert outline(value(text)) == expected


def test_parameter_declare_include_and_texture() -> None:
    file = read(
        'Parameter p = 10 [0 to 20] "text";\n#declare X = color rgb <1, 0, 0>\nplane { <0, 0, 1>, 0 }\n'
        '#declare Y = texture { X };\n#include "a\\"b.plsys"\nTexture Bark { pigment { rgb p } }\n'
    )
    parameter, color, plane, texture, include, bark = file.definitions
    assert outline(parameter) == ("ParameterDeclaration", "p", 10.0, 0.0, 20.0, ("String", "text"))
    assert [outline(item) for item in color.items][:2] == ["color", "rgb"] and len(color.items) == 3
    assert plane.name.name == "plane"
    assert outline(texture.items) == (("Block", "texture", ("X",)),)
    assert include.path.value == 'a"b.plsys'
    assert outline(bark) == ("Texture", "Bark", ("Block", "texture", (("Block", "pigment", ("rgb", "p")),)))


def test_spans_cover_what_they_mean() -> None:
    file = read("// a comment\n\nCalculation C { --n; }  // after\n")
    assert file.definitions[0].span.text == "Calculation C { --n; }"
    assert file.definitions[0].name.span.text == "C"


# --- broken files


def test_a_broken_block_costs_no_neighbour() -> None:
    text = "camera { location <0 1 @ }\nSelection A { A -> -> ; }\nobject { A }\nCalculation C { --n; }\n"
    file, diagnostics = parse(Source.from_text(text))
    assert {"object", "C"} <= {each.name.name for each in file.definitions}
    assert [item.span.start_position.line for item in diagnostics.items] == [1, 2]


def test_an_unclosed_block_hides_none_of_the_next() -> None:
    file, diagnostics = parse(Source.from_text("camera { angle 45\nobject { A }\nplane { <0, 0, 1>, 0 }\n"))
    assert [each.name.name for each in file.definitions] == ["camera", "object", "plane"]
    assert len(diagnostics.items) == 1


def test_bytes_that_are_no_text() -> None:
    assert messages(b"camera { angle 45 } // \xff\xfe") == ["the byte 0xff is not UTF-8 text"]
    assert messages(b"camera { angle \x00 45 }\x00") == ["a NUL byte stands in the text"]
    assert messages(b"\xef\xbb\xbfcamera { angle 45 }") == []
    assert messages(b"") == []


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_line_ends(newline: str) -> None:
    source = Source.from_text(newline.join(["// one", "camera { angle 45 }", "Calculation C { --n }"]))
    file, diagnostics = parse(source)
    assert len(file.definitions) == 2
    assert [str(item.span) for item in diagnostics.items] == ["<text>:3:20"]


DEEP = 10_000


@pytest.mark.parametrize(
    "text",
    [
        "#declare X = " + "(" * DEEP + "1" + ")" * DEEP,
        "Selection A { A -> " + "(" * DEEP + "A" + ")" * DEEP + "; }",
        "Selection A { " + "if (1) " * DEEP + "A -> x; }",
        "Selection A { " + "{" * DEEP + "A -> x;" + "}" * DEEP + "}",
        "Calculation C { a = " + "1+" * DEEP + "1; }",
        "Calculation C { a = " + "- " * DEEP + "1; }",
        "Calculation C { a = " + "f(" * DEEP + "1" + ")" * DEEP + "; }",
        "Calculation C { a = " + "a ? " * DEEP + "1" + " : 1" * DEEP + "; }",
        "union { " * DEEP + "}" * DEEP,
    ],
    ids=lambda text: text[:24],
)
def test_deep_nesting_is_a_message(text: str) -> None:
    _, diagnostics = parse(Source.from_text(text))
    assert [(item.message, item.hint) for item in diagnostics.items] == [
        ("this is nested too deeply", f"the limit is {MAX_DEPTH} levels")
    ]


def test_else_if_is_no_nesting() -> None:
    file, diagnostics = parse(Source.from_text("Selection A { " + "if (1) A -> x; else " * DEEP + "A -> x; }"))
    assert not diagnostics.items
    (rule,), count = file.definitions[0].productions, 0
    while isinstance(rule, syntax.If):
        rule, count = rule.otherwise, count + 1
    assert count == DEEP and isinstance(rule, syntax.Rule)


@pytest.mark.parametrize("opener", list("([{<") + ["f(", "union {", "A -> (", '"', "/*", ")", "}"])
def test_many_openers_give_few_messages(opener: str) -> None:
    for head in ("", "a { ", "Selection A { A -> ", "Calculation C { a = ", "Transformation T { trans "):
        found = messages(head + opener * DEEP)
        assert 1 <= len(found) <= 12


def test_many_unclosed_blocks_stay_apart() -> None:
    file, diagnostics = parse(Source.from_text("a { angle 1\n" * DEEP))
    assert len(file.definitions) == len(diagnostics.items) == DEEP


PIECES = st.sampled_from(
    "Selection Calculation Transformation Texture Parameter if else elseif #declare #include #while A B "
    "camera rgb texture to for 1 2.5 .5 5. 2x 1e3 { } ( ) [ ] < > ; , : = -> => + - * / -- ++ -= | ? && == "
    '" "s" // /* */ @ é − \n \t \r \0'.split(" ")
)


def check_any(data: bytes) -> None:
    """What must hold for every text."""
    source = Source("scene.plsys", data)
    file, diagnostics = parse(source)
    for item in diagnostics.items:
        assert 0 <= item.span.start <= item.span.end <= len(data)
        assert item.message and render(item)
    stack: list[object] = [file]
    while stack:
        node = stack.pop()
        if isinstance(node, tuple):
            stack += node
        elif isinstance(node, syntax.Node):
            assert 0 <= node.span.start <= node.span.end <= len(data)
            stack += [getattr(node, name) for name in node.__dataclass_fields__ if name != "span"]


@settings(max_examples=400, deadline=None)
@given(st.lists(PIECES, max_size=40).map(" ".join))
def test_any_tokens(text: str) -> None:
    check_any(text.encode())


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes(data: bytes) -> None:
    check_any(data)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(SCENES), st.randoms(use_true_random=False))
def test_scenes_with_a_part_missing(scene: Path, rng: random.Random) -> None:
    data = scene.read_bytes()
    start = rng.randrange(len(data))
    check_any(data[:start] + data[start + rng.choice([1, 1, 2, 10, len(data)]) :])


def test_tree_says_it_is_broken_only_with_a_message() -> None:
    """Where tree-sitter finds an error, so do we: deleting any one token of a scene is never silent then."""
    data = (ROOT / "scenes/tree.plsys").read_bytes()
    for i in range(len(data)):
        changed = data[:i] + data[i + 1 :]
        if syntax_tree(changed).root_node.has_error:
            assert messages(changed), changed[max(0, i - 20) : i + 20]


def test_incremental_parse_agrees() -> None:
    data = (ROOT / "scenes/tree.plsys").read_bytes()
    tree = syntax_tree(data)
    at = data.index(b"cntTree > 0") + 10
    changed = data[:at] + b"12" + data[at + 1 :]
    row = data[:at].count(b"\n")
    column = at - data.rindex(b"\n", 0, at) - 1
    tree.edit(at, at + 1, at + 2, (row, column), (row, column + 1), (row, column + 2))
    source, diagnostics = Source("scene.plsys", changed), Diagnostics()
    again = convert(source, changed, syntax_tree(changed, tree), diagnostics)
    assert diagnostics.items == []
    assert outline(again) == outline(parse(source)[0])
