"""Habits from other languages: each row of the table has a text that it is for, and where the row knows how to mend it, the
text after that. There is one message, it is about this place, and it is gone afterwards."""

from __future__ import annotations

import pytest

from plsys.compiler.reading import habits
from plsys.compiler.reading.habit_rows import HABITS
from plsys.compiler.reading.parse import parse
from plsys.compiler.reading.source import Source


def rule(text: str) -> str:
    return f"Selection A {{ {text} }}"


def statement(text: str) -> str:
    return f"Calculation C {{ {text} }}"


def operation(text: str) -> str:
    return f"Transformation T {{ {text} }}"


def both(frame, before: str, after: str | None) -> tuple[str, str | None]:
    return frame(before), after and frame(after)


EXAMPLES = [
    # L-systems
    both(rule, "A -> F[+F]F;", None),
    both(rule, "A -> F[-A]F[+A]F;", None),
    both(rule, "A(n) : n > 0 -> box;", "if (n > 0) A -> box;"),
    both(rule, "n > 0 : A -> box;", "if (n > 0) A -> box;"),
    both(rule, "A : box;", "A -> box;"),
    both(rule, "A ::= box;", "A -> box;"),
    both(rule, "A --> box;", "A -> box;"),
    both(rule, "A ==> box;", "A -> box;"),
    both(rule, "A <- box;", "A -> box;"),
    ("axiom: A", "object { A }"),
    ("A -> A + A;", "Selection A { A -> A + A; }"),
    both(rule, "A -> 70%: box | 30: sphere;", "A -> 70: box | 30: sphere;"),
    both(rule, "A -> (0.7) box | 1: sphere;", "A -> 0.7: box | 1: sphere;"),
    both(rule, "A -> 0.7 box | 0.3 sphere;", None),
    # operators and operands of rules
    both(rule, "A -> (trans 0 0 1) box;", "A -> [ trans 0 0 1 ] box;"),
    both(rule, "A -> {scale 2} box;", "A -> [ scale 2 ] box;"),
    both(rule, "A -> trans 0 0 1 box;", "A -> [ trans 0 0 1 ] box;"),
    both(rule, "A -> --n A;", "A -> [ --n ] A;"),
    both(rule, "A -> n = n - 1, A;", "A -> [ n = n - 1 ] A;"),
    both(rule, "-> box;", None),
    both(rule, "A -> big-leaf;", "A -> big_leaf;"),
    both(rule, "A -> C-grow box;", "A -> C_grow box;"),
    both(rule, "A -> torus 0.2;", "A -> torus(0.2);"),
    both(rule, 'A -> mesh "leaf.obj";', 'A -> mesh("leaf.obj");'),
    both(rule, "A -> mesh(leaf.obj);", 'A -> mesh("leaf.obj");'),
    both(rule, "A -> A 1 2;", "A -> A(1, 2);"),
    both(rule, "A -> A[1, 2];", "A -> A(1, 2);"),
    both(rule, "A -> A<1, 2>;", "A -> A(1, 2);"),
    both(rule, "A -> A (n - 1);", "A -> A(n - 1);"),
    both(rule, "A -> + box;", "A -> box;"),
    both(rule, "A -> 3*box;", None),
    both(rule, "A -> T * box;", "A -> T box;"),
    both(rule, "A -> box, sphere;", "A -> box + sphere;"),
    both(rule, "if (n > 0) A -> box, else A -> sphere;", "if (n > 0) A -> box; else A -> sphere;"),
    # how rules choose
    both(rule, "If (n > 0) A -> box;", "if (n > 0) A -> box;"),
    both(rule, "if (n > 0) A -> box; Else A -> sphere;", "if (n > 0) A -> box; else A -> sphere;"),
    both(rule, "if (n > 0) A -> box; elsif (n < 3) A -> sphere;", "if (n > 0) A -> box; else if (n < 3) A -> sphere;"),
    both(rule, "if (n > 0) then A -> box;", "if (n > 0) A -> box;"),
    both(rule, "if n > 0) A -> box;", "if (n > 0) A -> box;"),
    both(rule, "A -> if (n > 0) box;", "if (n > 0) A -> box;"),
    both(rule, "A -> (n > 0) box;", "if (n > 0) A -> box;"),
    both(rule, "A -> n > 0 ? box : sphere;", "if (n > 0) A -> box; else A -> sphere;"),
    both(rule, "switch (n) { case 1: A -> box; }", None),
    both(rule, "for i in range(5): A -> box;", None),
    both(rule, "if n > 0: A -> box; else A -> sphere;", "if (n > 0) A -> box; else A -> sphere;"),
    both(rule, "if max(n, 2) > 0: A -> box;", "if (max(n, 2) > 0) A -> box;"),
    both(rule, "if (n > 0): A -> box;", "if (n > 0) A -> box;"),
    both(rule, "if (n > 0) A -> box; else: A -> sphere;", "if (n > 0) A -> box; else A -> sphere;"),
    both(rule, "A -> box -> sphere;", "A -> box + sphere;"),
    both(rule, "A -> [0, 0, 1] box;", "A -> [ trans 0, 0, 1 ] box;"),
    both(rule, "A -> [0.5] box;", None),
    both(rule, "A -> -1: box | 2: sphere;", "A -> 1: box | 2: sphere;"),
    both(rule, "[ n = 7//2 ] A; A -> [ scale n ] box;", "[ n = floor(7/2) ] A; A -> [ scale n ] box;"),
    both(statement, "n = (m + 1)//k;", "n = floor((m + 1)/k);"),
    both(rule, "A -> n = 2 box;", "A -> [ n = 2 ] box;"),
    # conditions and expressions
    both(rule, "if (n =< 0) A -> box;", "if (n <= 0) A -> box;"),
    both(rule, "if (n => 0) A -> box;", "if (n >= 0) A -> box;"),
    both(rule, "if (n === 0) A -> box;", "if (n == 0) A -> box;"),
    both(rule, "if (n <> 0) A -> box;", "if (n != 0) A -> box;"),
    both(rule, "if (n > 0 | m > 0) A -> box;", "if (n > 0 || m > 0) A -> box;"),
    both(rule, "if (n > 0 & m > 0) A -> box;", "if (n > 0 && m > 0) A -> box;"),
    both(rule, "if (n > 0 and m > 0) A -> box;", "if (n > 0 && m > 0) A -> box;"),
    both(rule, "if (n > 0 or m > 0) A -> box;", "if (n > 0 || m > 0) A -> box;"),
    both(rule, "if (not n) A -> box;", "if (!n) A -> box;"),
    both(statement, "n = a ** 3;", "n = pow(a, 3);"),
    both(statement, "n = a ^ 3;", "n = pow(a, 3);"),
    both(statement, "n = a mod 3;", "n = a % 3;"),
    both(statement, "n = sqrt 2;", "n = sqrt(2);"),
    both(statement, "n = sin[2];", "n = sin(2);"),
    both(statement, "n = Math.sqrt(2);", "n = sqrt(2);"),
    both(statement, "n = max(1 2);", "n = max(1, 2);"),
    both(statement, "n = sin(2, );", "n = sin(2 );"),
    both(statement, "n = sin(, 2);", "n = sin( 2);"),
    # statements
    both(statement, "tree-age = 2;", "tree_age = 2;"),
    both(statement, "n == 2;", "n = 2;"),
    both(statement, "n := 2;", "n = 2;"),
    both(statement, "n = if (a > b) 1 else 2;", "n = a > b ? 1 : 2;"),
    both(statement, "n = a if b else c;", "n = b ? a : c;"),
    both(statement, "n = a > b ? 1;", None),
    both(statement, "n = m = 2;", "m = 2; n = m;"),
    both(statement, "n = 10'000;", "n = 10000;"),
    both(statement, "n = 1,5;", "n = 1.5;"),
    both(statement, "n = 1, m = 2;", "n = 1; m = 2;"),
    both(operation, "trans 0 0 1, rotz 90;", "trans 0 0 1; rotz 90;"),
    both(statement, "n = {1 + 2};", "n = (1 + 2);"),
    both(operation, "trans: 0 0 1;", "trans 0 0 1;"),
    both(operation, "trans [0 0 1];", "trans 0 0 1;"),
    both(statement, "n = 2 3;", None),
    both(statement, "float n = 2;", "n = 2;"),
    ("int n = 3;", "#declare n = 3;"),
    ("#define X 3", "#declare X = 3;"),
    ('include "x.plsys"', '#include "x.plsys"'),
    ("#include colors.plsys", '#include "colors.plsys"'),
    # heads of definitions
    ("parameter p = 3;", "Parameter p = 3;"),
    ("size = 3;", "#declare size = 3;"),
    ("Calculation C = { n = 1; }", "Calculation C { n = 1; }"),
    ("Texture Bark = texture { pigment { color rgb 1 } }", "Texture Bark { pigment { color rgb 1 } }"),
    ("Selection 1A { A -> box; }", None),
    ("Selection A-B { A_B -> box; }", "Selection A_B { A_B -> box; }"),
    ("Selection big-old-tree { big_old_tree -> box; }", "Selection big_old_tree { big_old_tree -> box; }"),
    ("#declare red-bark = rgb 1;", "#declare red_bark = rgb 1;"),
    ("Parameter if = 1;", None),
    ("Selection A(n = 3) { A -> box; }", "Selection A(n) { A -> box; }"),
    ("Selection A, B { A -> box; }", None),
    ("Selection Big Tree { Big_Tree -> box; }", "Selection Big_Tree { Big_Tree -> box; }"),
    ("Selection A A -> box; }", "Selection A { A -> box; }"),
    ("Parameter p = 1 (0 to 2);", "Parameter p = 1 [0 to 2];"),
    ("Parameter p = 1 [0 .. 2];", "Parameter p = 1 [0 to 2];"),
    ("Parameter p = 1 0 to 2;", "Parameter p = 1 [0 to 2];"),
    ('Parameter p = 1 "age" [0 to 2];', 'Parameter p = 1 [0 to 2] "age";'),
    ("Parameter p = 1 'age';", 'Parameter p = 1 "age";'),
    ("Parameter p: 1;", "Parameter p = 1;"),
    ("Parameter p = 1, q = 2;", "Parameter p = 1; Parameter q = 2;"),
    # scene blocks
    ("camera = { angle 45 }", "camera { angle 45 }"),
    ("camera ( angle 45 )", "camera { angle 45 }"),
    ("camera angle 45", "camera { angle 45 }"),
    ("camera { location <0 1 2> }", "camera { location <0, 1, 2> }"),
    ("camera { location <0, 1, 2>> }", "camera { location <0, 1, 2> }"),
    ("camera { location <<0, 1, 2> }", "camera { location <0, 1, 2> }"),
    ("background { color #ff8000 }", "background { color rgb <1, 0.502, 0> }"),
    # comments
    ("-- a tree\nsphere { 0, 1 }", "// a tree\nsphere { 0, 1 }"),
    ("# a tree\nsphere { 0, 1 }", "// a tree\nsphere { 0, 1 }"),
]  # fmt: skip

AROUND = "Selection Before {{ Before -> box; }}\n{}\nSelection After {{ After -> box; }}\n"


@pytest.mark.parametrize("before, after", EXAMPLES, ids=[before for before, _ in EXAMPLES])
def test_a_habit_has_one_message_that_mends_it(before, after):
    text = AROUND.format(before)
    file, diagnostics = parse(Source.from_text(text))
    (said,) = diagnostics.items
    start = len(AROUND.split("{}")[0].replace("{{", "{").replace("}}", "}"))
    assert start <= said.span.start <= said.span.end <= start + len(before.encode())
    assert said.hint and said.message[0] != said.message[0].upper() or said.message[0] in "'#"
    assert [each.name.name for each in file.definitions][-1] == "After", "a neighbour is lost"
    assert (said.mend is None) == (after is None)
    if said.mend is not None:
        mended = text[: said.span.start] + said.mend + text[said.span.end :]
        assert " ".join(mended.split()) == " ".join(AROUND.format(after).split())
        assert parse(Source.from_text(mended))[1].items == []


def test_every_habit_has_an_example(monkeypatch):
    seen = set()
    message = habits._message

    def noted(text, habit, match):
        seen.add(habit)
        return message(text, habit, match)

    monkeypatch.setattr(habits, "_message", noted)
    for before, _ in EXAMPLES:
        parse(Source.from_text(AROUND.format(before)))
    assert [habit.pattern.pattern for habit in HABITS if habit not in seen] == []


def test_a_number_is_not_torn_apart():
    (said,) = parse(Source.from_text("Selection A { A -> trans 0 0 0.24; }"))[1].items
    assert said.mend is None


def test_a_habit_in_a_comment_or_a_text_is_none():
    (said,) = parse(Source.from_text('Selection A { A -> box; } @ // A --> box\nParameter p = 1 "A --> box";'))[1].items
    assert said.message == "the character '@' has no meaning here"


def test_a_comment_behind_a_value_is_no_quotient():
    for text in ("Calculation C { n = 7 // 2; }", "Calculation C { n = 7 //2;\n}", "Selection A { A -> box // 2 }"):
        assert not [each for each in parse(Source.from_text(text))[1].items if "comment" in each.message]


def test_long_broken_lines_are_read_in_time():
    """Every pattern stays linear in what it looks at, and looks at a part of the line only."""
    for piece in ("A -> F[+F] ", "if (n => 0) ", "<0 1 2> ", "a ** ", "((((", "n = m = ", "'",
                  "A -> theScaledCylinderOfTheTrunk cylinder ] "):  # fmt: skip
        assert parse(Source.from_text("Selection A { " + piece * 1000 + "}"))[1].items
