"""Refactorings: what they make of a text, and that the derivation stays what it was."""

from __future__ import annotations

import random
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenes import scenes

from plsys.compiler.analysis import facts_of, refactorings
from plsys.compiler.export.unfold import unfold
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source
from tests.compiler.analysis.edits import applied, messages, opened, refactored

HEAD = "camera { location <0, -9, 0> sky <0, 0, 1> look_at <0, 0, 0> }\nlight_source { <2, -3, 4> color rgb 1 }\n"


def derivation(text: str) -> tuple[list[str], np.ndarray]:
    """Kinds and matrices of all primitives, in order."""
    batches = list(unfold(build(Source.from_text(text)).graph))
    kinds = [str(kind) for batch in batches for kind in batch.kinds]
    return kinds, np.concatenate([np.zeros((0, 3, 4)), *(batch.matrix.reshape(-1, 3, 4) for batch in batches)])


def same_derivation(before: str, after: str) -> bool:
    (kinds, matrices), (kinds_after, matrices_after) = derivation(before), derivation(after)
    return kinds == kinds_after and np.array_equal(matrices, matrices_after)


def changed(marked: str, title: str, keeps: bool = True) -> str:
    """The text after the refactoring whose title begins with ``title``; without the head."""
    found = refactored(HEAD + marked)
    after = next((text for each, text in found.items() if each.startswith(title)), None)
    assert after is not None, list(found)
    assert not [each for each in messages(after) if each.diagnostic.severity == "error"]
    if keeps:
        assert same_derivation(HEAD + marked.replace("<cursor>", ""), after)
    return after.removeprefix(HEAD)


# --- extract


def test_extract_a_transformation():
    assert changed(
        "object { A }\nSelection A { A -> [ trans 0 0 1<cursor>; roty 30*rand(0) ] box; } // a\ncamera_x\n".replace("camera_x\n", ""),
        "Extract Transformation",
    ) == "object { A }\nSelection A { A -> T_new box; } // a\nTransformation T_new { trans 0 0 1; roty 30*rand(0); }\n"


def test_extract_a_calculation_under_a_free_name():
    text = "object { A }\nSelection A { [ n = 2<cursor>; k = n ] A; A -> [ scale k ] C_new box; }\nCalculation C_new { n = 1; }\n"
    after = changed(text, "Extract Calculation")
    assert "{ C_new2 A; A ->" in after and "Calculation C_new2 { n = 2; k = n; }\n" in after


def test_a_name_does_not_touch_its_neighbours():
    text = "object { A }\nSelection A { A ->[trans 0 0<cursor> 1]box+[ scale 2 ](sphere); }\n"
    assert "A ->T_new box+[" in changed(text, "Extract Transformation")
    text = "object { A }\nSelection A { A ->box+[ scale<cursor> 2 ](sphere); }\n"
    assert "box+T_new (sphere);" in changed(text, "Extract Transformation")


def test_mixed_operators_are_not_extracted():
    assert not [each for each in refactored("Selection A { A -> [ n = 1; tra<cursor>ns 0 0 n ] box; }") if "Extract" in each]


# --- inline


INLINE = """\
object { A }
Selection A { C_i A; if (n > 0) A -> T_up box + T_up C_less A; }
Calculation C_i { n = 3; }
Calculation C_less { --n; }
Transformation T_up
{
    trans 0 0 1; // up
    rotz 20*rand(1);
}
"""


def test_inline_what_is_used_once():
    after = changed(INLINE.replace("C_less A;", "C_l<cursor>ess A;"), "Inline 'C_less'")
    assert "T_up [ --n ] A; }" in after and "C_less" not in after


def test_inline_from_the_definition_and_in_an_entry_action():
    after = changed(INLINE.replace("Calculation C_i", "Calculation C_<cursor>i"), "Inline 'C_i'")
    assert "Selection A { [ n = 3 ] A;" in after and "Calculation C_i" not in after


def test_inline_here_and_everywhere():
    marked = INLINE.replace("A -> T_up", "A -> T_<cursor>up")
    body = "[ trans 0 0 1; // up\n    rotz 20*rand(1) ]"
    assert f"A -> {body} box + T_up C_less A" in changed(marked, "Inline 'T_up' here")
    after = changed(marked, "Inline 'T_up' everywhere (2 places)")
    assert after.count(body) == 2 and "Transformation" not in after


def test_variants_belong_to_their_calculation():
    assert refactored("Selection A { C_v<cursor> A; A -> box; }\nCalculation C_v { variants 3; }\n") == {}
    twice = "Selection A { A -> [ vari<cursor>ants 3; ] B + [ variants 3; ] B; }\nSelection B { B -> [ rotz 360*rand(0) ] box; }\n"
    assert refactored(twice) == {}


# --- bound a recursion


def test_bound_keeps_what_ends_by_itself():
    text = "object { A }\nSelection <cursor>A\n{\n    [ n = 3 ] A;\n    if (n > 0) A -> box + [ --n; trans 0 0 1 ] A;\n    else A -> sphere;\n}\n"
    after = changed(text, "Bound the recursion of 'A'")
    assert "    [ rounds = 10 ] [ n = 3 ] A;\n    if (rounds > 0 && n > 0) A -> box + [ --n; trans 0 0 1 ] [ --rounds ] A;\n" in after


def test_bound_makes_an_end():
    text = "object { A }\nSelection <cursor>A { A -> box + [ scale 0.9 ] (A + [ trans 0 0 2 ] sphere); }\n"
    after = changed(text, "Bound", keeps=False)
    assert after == "object { A }\nSelection A { [ rounds = 10 ] A; if (rounds > 0) A -> box + [ scale 0.9 ] ([ --rounds ] A + [ trans 0 0 2 ] sphere); }\n"
    kinds, _ = derivation(HEAD + after)
    assert kinds.count("box") == 10


def test_bound_through_another_symbol():
    text = "object { A }\nSelection <cursor>A { A -> box + [ trans 0 0 1 ] B; }\nSelection B { B -> disc + [ trans 0 0 1 ] A; }\n"
    kinds, _ = derivation(HEAD + changed(text, "Bound", keeps=False))
    assert kinds.count("box") == 10 and kinds.count("disc") == 10


def test_a_recursion_that_is_entered_elsewhere_gets_no_counter():
    """A reference from A to B doesn't run B's entry action, since B leads back to A."""
    text = "object {{ {} }}\nSelection A {{ A -> [ scale 2 ] B; }}\nSelection <cursor>B {{ B -> box + A; }}\n"
    assert not [each for each in refactored(text.format("A")) if each.startswith("Bound")]
    assert "Selection B { [ rounds = 10 ] B; if (rounds > 0) B -> box + [ --rounds ] A; }" in changed(text.format("B"), "Bound", keeps=False)


def test_a_way_round_elsewhere_would_go_on():
    text = "object { A }\nSelection <cursor>A { A -> box + [ trans 0 0 1 ] B; }\nSelection B { B -> [ trans 1 0 0 ] B + A; }\n"
    assert not [each for each in refactored(text) if each.startswith("Bound")]


def test_no_other_rule_gets_the_else():
    """`else if (rounds > 0) A -> …; else A -> cone;` would bind the last `else` to the new `if`."""
    inner = "if (n > 2) A -> box + [ --n; trans 0 0 1 ] A; else A -> [ --n; trans 0 1 0 ] A + sphere;"
    start = "object { A }\nSelection <cursor>A { [ n = 4 ] A; if (n > 0) "
    assert not [each for each in refactored(f"{start}{inner} else A -> cone; }}\n") if each.startswith("Bound")]
    after = changed(f"{start}{inner} }}\n", "Bound")
    assert "else if (rounds > 0) A -> [ --n; trans 0 1 0 ] [ --rounds ] A + sphere;" in after


def test_only_recursions_are_bounded():
    assert refactored("Selection <cursor>A { A -> box; }\n") == {}


# --- parameters


def test_parameters_from_an_inline_entry_action():
    text = "object { A }\nSelection <cursor>A { [ n = 3; size = 1 ] A; if (n > 0) A -> [ scale size ] box + [ trans 0 0 1 ] [ --n ] A + [ size *= 0.5 + 0.1 ] [ --n ] A; }\n"
    assert changed(text, "Turn into the parameterised symbol A(n, size)") == (
        "object { A(3, 1) }\nSelection A(n, size) { if (n > 0) A -> [ scale size ] box + [ trans 0 0 1 ] A(n - 1, size)"
        " + [ size *= 0.5 + 0.1 ] A(n - 1, size); }\n"
    )


def test_parameters_from_a_calculation():
    text = """\
Parameter order = 4;
object { B }
Selection B { B -> A + [ trans 9 0 0; rotz 10*rand(0) ] A; }
Selection A<cursor>
{
    C_begin A;
    if (n > 0) A -> [ scale 0.3 + 0.1*rand(0) ] box + C_less [ trans 0 0 1 ] A;
}
Calculation C_begin { n = order; }
Calculation C_less { --n; }
"""
    after = changed(text, "Turn into the parameterised symbol A(n)")
    assert "B -> A(order) + [ trans 9 0 0; rotz 10*rand(0) ] A(order);" in after
    assert "Selection A(n)\n{\n    if (n > 0) A -> [ scale 0.3 + 0.1*rand(0) ] box + C_less [ trans 0 0 1 ] A(n);\n}\n" in after
    assert "C_begin" not in after


@pytest.mark.parametrize(
    "entry", ["[ n = rand(0) ] A;", "[ n = m ] A;", "C_i A;", "[ n = 1; n = 2 ] A;", "[ ++n ] A;", ""]
)
def test_other_entry_actions_stay(entry):
    text = f"object {{ A }}\nSelection <cursor>A {{ {entry} A -> C_i [ m = 1 ] box; }}\nCalculation C_i {{ n = 1; }}\n"
    assert not [each for each in refactored(text) if each.startswith("Turn")]


def test_broken_blocks_are_left_alone():
    assert refactored("Selection <cursor>A { [ n = 3 ] A; A -> box + [ --n A; }\n") == {}


# --- real scenes

SCENES = ("bush", "mirrors", "palm", "tower", "tree")


@pytest.mark.parametrize("name", SCENES)
def test_real_scenes_keep_their_derivation(name):
    """Refactorings at the names and brackets of a scene, some of them at random."""
    path = Path(__file__).resolve().parents[3] / f"scenes/{name}.plsys"
    text = path.read_text()
    scene, document = opened(text)
    parts = zip(document.text.blocks, document.text.starts)
    places = [base + each.start for block, base in parts for each in facts_of(block).names]
    places += [match.start() + 1 for match in re.finditer(r"\[", text)]
    found = {action.title: action for at in places for action in refactorings(scene, document, at, at)}
    wanted = [action for title, action in sorted(found.items()) if not title.startswith("Bound")]
    assert wanted
    for action in random.Random(name).sample(wanted, min(len(wanted), 4)):
        assert same_derivation(text, applied(text, action)), action.title


# --- random scenes


@settings(max_examples=25, deadline=None)
@given(scenes(), st.integers(0, 2**32))
def test_random_scenes_keep_their_derivation(text, seed):
    """Every refactoring but *bound* at a random place leaves all primitives where they were."""
    scene, document = opened(text)
    chance = random.Random(seed)
    expected = None
    for _ in range(6):
        at = chance.randrange(len(text))
        for action in refactorings(scene, document, at, at):
            if action.title.startswith("Bound"):
                continue
            expected = expected or derivation(text)
            kinds, matrices = derivation(applied(text, action))
            assert kinds == expected[0] and np.array_equal(matrices, expected[1]), action.title
