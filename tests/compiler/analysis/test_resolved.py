"""What editors are told equals what the compiler says, for every scene, and however the text came about."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plsys.compiler.analysis import Project, check_whole
from plsys.compiler.graph.forecast import forecast
from plsys.compiler.pipeline import build_graph, build_model
from plsys.compiler.reading.ignore import kept
from plsys.compiler.reading.source import Source

ROOT = Path(__file__).resolve().parents[3]
SCENES = sorted((ROOT / "scenes").glob("*.plsys"))

SMALL = b"""\
global_settings { seed 7 }
camera { location <0, -14, 5> sky <0, 0, 1> look_at <0, 0, 5> }
light_source { <20, -30, 40> color rgb 1 }
#declare Height = 2;
#declare Double = Height * 2;
Parameter order = 3 [0 to 9] "Age";
object { Tree(order) texture { Bark } }
Texture Bark { pigment { color rgb <Height/4, 0.3, 0.1> } }
Selection Tree(n)
{
    C_init Tree;
    if (n > 0) Tree -> [ scale 1 1 Double ] cylinder + C_less T_up Tree(n - 1);
    else Tree -> sphere;
}
Calculation C_init { angle = 60; }
Calculation C_less { angle -= 4; }
Transformation T_up { trans 0 0 Height; roty angle; }
"""


def told(project: Project, document) -> list[tuple]:
    project.work()
    return sorted((m.start, m.end, m.diagnostic.code, m.diagnostic.message) for m in project.messages(document))


def compiled(source: Source) -> list[tuple]:
    model, diagnostics = build_model(source)
    found = diagnostics.items if diagnostics.has_errors else [*diagnostics.items, *forecast(build_graph(model)).diagnostics]
    return sorted((d.span.start, d.span.end, d.code, d.message) for d in kept(found))


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_scenes_get_the_compilers_messages(path):
    project = Project()
    document = project.open(path, path.read_bytes())
    project.work()
    check_whole(project.scene_of(document))
    assert told(project, document) == compiled(Source.read(path))


def test_a_mistake_in_what_an_earlier_block_uses():
    """The object is resolved first, and the texture with it; the message stays the texture's."""
    project = Project()
    document = project.open(None, SMALL.replace(b"Bark {", b"Bark { glossy", 1), name="x")
    assert [code for _, _, code, _ in told(project, document)] == ["unknown-name"]


def test_what_a_broken_block_means_is_not_judged_by_its_users():
    project = Project()
    document = project.open(None, SMALL.replace(b"Bark { pigment", b"Bark { p{igment", 1), name="x")
    assert {code for _, _, code, _ in told(project, document)} == {"unclosed"}


MISTAKES = [
    (b"Tree(order)", b"Tree"), (b"Tree(order)", b"Tre(order)"), (b"{ Bark }", b"{ Height }"), (b"Height = 2", b"Height = 0"),
    (b"Height * 2", b"1 / (Height - 2)"), (b"[0 to 9]", b"[5 to 9]"), (b"angle = 60", b"Height = 60"), (b"C_less {", b"C_init {"),
    (b"roty angle", b"roty angel"), (b"cylinder", b"cylindre"), (b"trans 0 0", b"trans 0"), (b"Double", b"Tree"),
    (b"camera {", b"camera { } camera {"), (b"seed 7", b"sed 7"), (b"Tree(n - 1)", b"Tree(n)"), (b"T_up Tree", b"Tree"),
]  # fmt: skip


@pytest.mark.parametrize("old, new", MISTAKES, ids=lambda text: text.decode())
def test_a_mistake_and_its_repair(old, new):
    """Typed into a right scene, a mistake gives the compiler's errors; taken back, none."""
    assert compiled(Source("x", SMALL)) == []
    project = Project()
    document = project.open(None, SMALL, name="x")
    assert told(project, document) == []
    at = SMALL.index(old)
    project.edit(document, at, at + len(old), new)
    wrong = SMALL.replace(old, new, 1)
    errors = [each for each in compiled(Source("x", wrong))]
    check_whole(project.scene_of(document))
    assert told(project, document) == errors
    project.edit(document, at, at + len(new), old)
    project.scene_of(document).whole.clear()
    project.scene_of(document).general.clear()
    assert told(project, document) == []


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, len(SMALL)), st.integers(0, 12), st.sampled_from([b"", b"x", b"{", b"}", b"\n", b";", b"/*", b"Tree "])), max_size=6))
def test_history_does_not_matter(changes):
    """After any edits, names and messages are those of a document opened with the same text. (What is kept of
    definitions that a syntax error swallowed may spare messages.)"""
    project = Project()
    document = project.open(None, SMALL, name="x")
    for start, length, new in changes:
        project.edit(document, start, start + length, new)
        project.work()
    fresh = Project()
    other = fresh.open(None, document.text.data, name="x")
    now, expected = set(told(project, document)), set(told(fresh, other))
    ghosts = any(facts.ghosts for facts in map(lambda block: block.__dict__["facts"], document.text.blocks))
    assert now == expected if not ghosts else now >= {m for m in expected if m[2] in ("syntax", "missing", "unclosed")}


def test_typing_a_scene_from_its_first_to_its_last_character():
    project = Project()
    document = project.open(None, b"", name="x")
    for i in range(len(SMALL)):
        project.edit(document, i, i, SMALL[i : i + 1])
        project.work()
        project.messages(document)
    check_whole(project.scene_of(document))
    assert told(project, document) == []


@pytest.mark.parametrize("old, new", [(b"Selection Tree { Twig", b"Selection Bush { Twig"), (b"Tree { Tree", b"Bush { Tree")], ids=["renamed", "the first one renamed"])
def test_a_second_definition_becomes_the_only_one(old, new):
    """Nothing but that it is a second one is said of it before, and all then."""
    text = b"object { Tree }\nSelection Tree { Tree -> box; }\nSelection Tree { Twig -> box; }\n"
    project, fresh = Project(), Project()
    document = project.open(None, text, name="x")
    assert [code for _, _, code, *_ in told(project, document)] == ["duplicate-name"]
    project.edit(document, text.index(old), text.index(old) + len(old), new)
    now = told(project, document)
    assert now == told(fresh, fresh.open(None, document.text.data, name="x"))
    assert "wrong-kind" in {code for _, _, code, *_ in now}
