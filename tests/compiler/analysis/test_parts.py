"""Checks part by part say what checks of the whole say, and after edits what a fresh start says."""

from __future__ import annotations

import random

import pytest
from plsys.compiler.analysis import Project, check_whole
from plsys.compiler.analysis.checking import Work
from plsys.compiler.analysis.whole import Result, Snapshot
from plsys.compiler.graph.insights import insights as make_insights
from plsys.compiler.pipeline import diagnose
from plsys.compiler.reading.nearest import NameIndex, nearest, nearest_of
from plsys.compiler.reading.source import Source

PLANT = """\
#declare Bark{i} = texture {{ pigment {{ color rgb <Redness, 0.3, 0.1> }} }}
object {{ Tree{i} texture {{ Bark{i} }} }}
Selection Tree{i}
{{
    C_init{i} Tree{i};
    if (n{i} > 0) Tree{i} -> cylinder + C_less{i} T_up Tree{i};
    else Tree{i} -> sphere;
}}
Calculation C_init{i} {{ n{i} = order; }}
Calculation C_less{i} {{ --n{i}; }}
"""
HEAD = """\
camera { location <0, -14, 5> sky <0, 0, 1> look_at <0, 0, 5> }
light_source { <20, -30, 40> color rgb 1 }
#declare Redness = 0.5;
Parameter order = 3 [0 to 9] "Age";
Transformation T_up { trans 0 0 1; }
"""
SCENE = HEAD + "".join(PLANT.format(i=i) for i in range(3))

CHANGES = [
    ("object { Tree1", "object { Tree0"), ("{ --n2; }", "{ unread = 2; --n2; }"), ("light_source", "// light_source"),
    ("camera {", "// camera {"), ("Redness = 0.5", "Redness = 0.25"), ("<Redness, 0.3", "<1, 0.3"), ("texture { Bark0 }", ""),
    ("C_less1 T_up", "C_less1 T_up T_up"), ("T_up { trans 0 0 1; }", "T_up { trans 0 0 n0; }"),
    ("trans 0 0 1;", "scale 0 1 1;"), ("object {", "// object {"), ("#declare Redness", "#declare Greenness = 1;\n#declare Redness"),
]  # fmt: skip


def compiled(text: str) -> list[tuple]:
    return sorted({(d.code, d.span.start, d.message) for d in diagnose(Source("x", text.encode()))[0]})


def told(scene, document) -> list[tuple]:
    scene.work()
    return sorted({(m.diagnostic.code, m.start, m.diagnostic.message) for m in scene.messages(document)})


@pytest.mark.parametrize("old, new", CHANGES, ids=lambda text: text.replace("\n", " "))
def test_a_change_is_told_as_the_compiler_tells_it(old, new):
    text = SCENE.replace(old, new)
    project = Project()
    document = project.open(None, text.encode(), name="x")
    scene = project.scene_of(document)
    check_whole(scene)
    assert told(scene, document) == compiled(text)


@pytest.mark.parametrize("seed", range(8))
def test_what_was_found_before_is_as_good_as_new(seed):
    choices, text = random.Random(seed), SCENE
    project, work, before = Project(), Work(), None
    document = project.open(None, text.encode(), name="x")
    scene = project.scene_of(document)
    for number in range(8):
        old, new = choices.choice(CHANGES)
        old, new = (old, new) if old in text else (new, old)
        if (at := text.find(old)) >= 0 and old:
            text = text[:at] + new + text[at + len(old) :]
            project.edit(document, at, at + len(old), new.encode())
        scene.work()
        before = snapshot = Snapshot.of(scene, number, before)
        work.run(snapshot.request, lambda answer: Result(snapshot, answer).apply())
        found, expected = set(told(scene, document)), set(compiled(text))
        # The compiler stops at errors of names; an editor goes on with the parts that have none.
        assert found >= expected if any(code == "duplicate-name" for code, *_ in expected) else found == expected


def test_an_edit_is_checked_with_its_own_part():
    project, work = Project(), Work()
    document = project.open(None, SCENE.encode(), name="x")
    scene = project.scene_of(document)
    answers = []
    first = Snapshot.of(scene, 0)
    work.run(first.request, answers.append)
    assert len(answers[-1].blocks) == 3 * 4  # all but what is shared
    at = SCENE.index("--n1") + 2
    project.edit(document, at, at + 2, b"n2")
    second = Snapshot.of(scene, 1, first)
    work.run(second.request, answers.append)
    assert [len(file.blocks) for file in second.request.files] == [1]
    assert len(answers[-1].blocks) == 8
    assert answers[-1].findings  # n1 isn't counted down


def test_an_edit_is_not_behind_the_reading_of_the_file():
    project, work = Project(), Work()
    document = project.open(None, SCENE.encode(), name="x")
    scene = project.scene_of(document)
    first = Snapshot.of(scene, 0)
    work.take(first.request)
    work.go_on(lambda answer: None, lambda: True)  # the first part
    at = SCENE.index("--n1") + 2
    project.edit(document, at, at + 2, b"n2")
    second, answers = Snapshot.of(scene, 1, first), []
    work.take(second.request)
    work.go_on(answers.append, lambda: bool(answers))
    assert "counter" in {finding.code for finding in answers[0].findings}
    [blocks] = work.scenes[scene.number].blocks.values()
    read = {block.data[:21] for block in blocks if "facts" in block.__dict__}
    assert b"Calculation C_less1 {" in read and b"Calculation C_less0 {" not in read


def test_edits_far_apart_leave_what_lies_between():
    project, work = Project(), Work()
    document = project.open(None, SCENE.encode(), name="x")
    scene = project.scene_of(document)
    answers: list = []
    first = Snapshot.of(scene, 0)
    work.run(first.request, answers.append)
    for name in ("--n2", "--n0"):
        at = SCENE.index(name) + 3
        project.edit(document, at, at + 1, b"1")
    second = Snapshot.of(scene, 1, first)
    assert [len(file.blocks) for file in second.request.files] == [2]
    work.run(second.request, answers.append)
    third = Snapshot.of(scene, 2, second)
    assert [len(file.blocks) for file in third.request.files] == [0]
    assert [block.data for block in document.text.blocks] == [
        block.data for block in work.scenes[scene.number].blocks[document.text.name]
    ]


def test_the_latest_text_comes_before_what_is_left_of_an_earlier_one():
    project, work = Project(), Work()
    document = project.open(None, SCENE.encode(), name="x")
    scene = project.scene_of(document)
    answers: list = []
    first = Snapshot.of(scene, 0)
    work.take(first.request)
    work.go_on(answers.append, lambda: True)
    at = SCENE.index("--n1") + 2
    project.edit(document, at, at + 2, b"n2")
    work.take(Snapshot.of(scene, 1, first).request)
    work.go_on(answers.append, lambda: True)
    assert [answer.key for answer in answers] == [0, 1]
    assert answers[-1].more and answers[-1].findings  # n1 isn't counted down
    work.go_on(answers.append)
    assert not answers[-1].more and work.is_done


def test_a_forecast_that_is_interrupted_is_made_later(monkeypatch):
    project, work = Project(), Work()
    scene = project.scene_of(project.open(None, SCENE.encode(), name="x"))
    calls: list = []

    def interrupted_once(model):
        calls.append(model)
        if len(calls) == 2:
            work.interruption.interrupt()
        return make_insights(model)

    monkeypatch.setattr("plsys.compiler.graph.insights.insights", interrupted_once)
    answers: list = []
    work.take(Snapshot.of(scene, 0).request)
    work.go_on(answers.append, lambda: len(calls) == 2)
    assert not work.is_done and answers[-1].more and answers[-1].forecast is None
    work.go_on(answers.append)
    assert work.is_done and answers[-1].forecast["primitives"] == 3 * 4
    work.interruption.interrupt()  # where nothing is at work, nothing happens


def test_a_slice_leaves_the_rest_for_later():
    project, work = Project(), Work()
    scene = project.scene_of(project.open(None, SCENE.encode(), name="x"))
    answers: list = []
    work.take(Snapshot.of(scene, 0).request)
    while not work.is_done:
        work.go_on(answers.append, lambda: True)
    assert len(answers) > 4
    assert answers[-1].forecast["primitives"] == 3 * 4


def test_an_index_finds_what_a_search_finds():
    choices = random.Random(4)
    names = [f"{kind}_{word}{i}" for kind in "CT" for word in ("trunk", "left", "initialise") for i in range(300)]
    first, second = NameIndex(names[::2]), NameIndex()
    for name in names[1::2]:
        second.add(name)
    second.add("gone")
    second.remove("gone")
    for name in choices.sample(names, 100):
        at = choices.randrange(len(name))
        wrong = name[:at] + choices.choice(["", "x", name[at] * 2]) + name[at + 1 :]
        assert nearest_of(wrong, (first, second)) == nearest(wrong, names)
    assert nearest("T_initalise17", names) == "did you mean 'T_initialise17'?"
    assert nearest("T_lef17", names) == "did you mean 'T_left17'?"
    assert nearest("quite another", names) == ""
