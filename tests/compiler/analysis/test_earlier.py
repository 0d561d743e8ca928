"""Texts that come back, by deletions and undoing, are known as a fresh reading knows them."""

from __future__ import annotations

import random

import pytest
from plsys.compiler.analysis import Document, Project, check_whole, facts_of
from plsys.compiler.analysis import earlier as module
from plsys.compiler.analysis.earlier import Earlier
from plsys.compiler.analysis.split import Shape
from plsys.compiler.analysis.text import Block
from stress import rounds
from test_retouch import SCENE, check, told

# Without a mistake: only then there is much to take back.
RIGHT = (
    SCENE.replace("\n    ; rotx", "; rotx")
    .replace("scale\n   ", "scale")
    .replace("tilt ;\n}", "; rotx tilt ;\n}")
)
LETTERS = ["x", "2", " ", "-", "{", "}", "\n", ";", "/*", "A", "Tree", "", ""]


def edited(rng: random.Random, project: Project, document: Document) -> list[tuple[int, int, bytes]]:
    """Edits some places; the edits that take it back."""
    back = []
    for at in sorted({rng.randrange(len(document.text)) for _ in range(rng.choice((1, 1, 4)))}, reverse=True):
        new, end = rng.choice(LETTERS).encode(), at + rng.choice((0, 0, 1, 6))
        back.append((at, at + len(new), document.text.slice(at, min(end, len(document.text)))))
        project.edit(document, at, end, new)
    return back[::-1]


@pytest.mark.parametrize("seed", range(rounds(25, 2_000)))
def test_edits_that_are_taken_back(seed):
    """Some at once, some after other edits, as undoing does."""
    rng = random.Random(seed)
    project = Project()
    document = project.open(None, (RIGHT if seed % 3 else SCENE).encode(), name="x")
    project.work()
    undoing: list[list[tuple[int, int, bytes]]] = []
    for _ in range(12):
        if undoing and rng.random() < 0.5:
            for edit in undoing.pop():
                project.edit(document, *edit)
        else:
            undoing.append(edited(rng, project, document))
        if rng.random() < 0.8:
            project.work()
            check(project, document)


def test_a_deletion_takes_back_what_was_read():
    project = Project()
    document = project.open(None, RIGHT.encode(), name="x")
    before = told(project, document)
    at = RIGHT.index("roty angle")
    facts = facts_of(document.text.block_at(at)[0])
    project.edit(document, at, at, b"2 ")
    assert told(project, document) != before
    project.edit(document, at, at + 2, b"")
    assert told(project, document) == before
    assert facts_of(document.text.block_at(at)[0]) is facts
    check(project, document)


def test_what_changed_meanwhile_is_told():
    """The text comes back, but a name in it is gone."""
    project = Project()
    document = project.open(None, RIGHT.encode(), name="x")
    project.work()
    at, height = RIGHT.index("roty angle"), RIGHT.index("Height = 2")
    project.edit(document, at, at, b"2 ")
    project.work()
    project.edit(document, height, height + 6, b"Weight")
    project.work()
    project.edit(document, at, at + 2, b"")
    assert any(
        start > RIGHT.index("T_up {") and "'Height'" in said for start, _, _, said, _ in told(project, document)
    )
    check(project, document)


def test_a_text_that_comes_back_elsewhere_is_another_definition():
    text = b"Transformation T { roty 9; }\nSelection A { A -> T box; }\n"
    project = Project()
    document = project.open(None, text, name="x")
    project.work()
    project.edit(document, 0, 29, b"")
    project.work()
    project.edit(document, len(text) - 29, len(text) - 29, text[:29])
    assert told(project, document) == []
    project.edit(document, 0, 0, text[:29])
    assert [each[2] for each in told(project, document)] == ["duplicate-name"]
    check(project, document)


def test_the_whole_scene_is_checked_as_before():
    """Messages and findings about a text that comes back are made anew."""
    project = Project()
    document = project.open(
        None, b"Selection A { A -> box; }\nobject { A }\nTransformation T { scale 0; }\n", name="x"
    )
    before = told_of_all(project, document)
    at = document.text.data.index(b"scale")
    project.edit(document, at, at, b"2 ")
    project.work()
    project.edit(document, at, at + 2, b"")
    assert told_of_all(project, document) == before != []


def told_of_all(project: Project, document: Document) -> list[tuple]:
    project.work()
    check_whole(project.scene_of(document))
    return told(project, document)


def test_no_more_is_kept_than_has_room(monkeypatch):
    monkeypatch.setattr(module, "MOST_TEXTS", 3)
    monkeypatch.setattr(module, "MOST_BYTES", 100)
    earlier = Earlier()

    def block(text: bytes) -> Block:
        return Block("x", text, None, Shape(True, 0, 0, False))

    texts = [b"Transformation T%d { roty 9; }" % i for i in range(5)] + [
        b"Transformation T {%s roty 9; }" % (b" " * 100)
    ]
    for text in texts:
        old = block(text)
        facts_of(old)
        earlier.keep(old)
    assert [earlier.take(block(text)) for text in texts] == [False, False, True, True, True, False]
    assert not earlier.take(block(texts[4]))  # it is another block's by now
