"""Checks part by part of scenes in several files: as of one text, and an edit costs its own part."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from plsys.compiler.analysis import Project, check_whole
from plsys.compiler.analysis.checking import Work
from plsys.compiler.analysis.whole import Result, Snapshot
from plsys.compiler.pipeline import diagnose
from plsys.compiler.reading.source import Source
from tests.compiler.analysis.test_parts import CHANGES, HEAD, PLANT

FILES = {
    "main.plsys": '#include "head.plsys"\n#include "plants/one.plsys"\n' + PLANT.format(i=0),
    "head.plsys": HEAD,
    "plants/one.plsys": '#include "two.plsys"\n' + PLANT.format(i=1),
    "plants/two.plsys": PLANT.format(i=2),
}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "plants").mkdir()
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def opened(folder: Path):
    """The project with all files open, the scene, and the documents by name."""
    project = Project()
    documents = {name: project.open(folder / name, (folder / name).read_bytes()) for name in FILES}
    return project, project.scene_of(documents["main.plsys"]), documents


def compiled(folder: Path) -> set[tuple]:
    path = folder / "main.plsys"
    return {(d.code, d.span.source.path.name, d.span.start, d.message) for d in diagnose(Source.read(path))[0]}


def told(scene, documents) -> set[tuple]:
    scene.work()
    return {
        (m.diagnostic.code, document.path.name, m.start, m.diagnostic.message)
        for document in documents.values()
        for m in scene.messages(document)
    }


@pytest.mark.parametrize("old, new", CHANGES, ids=lambda text: text.replace("\n", " "))
def test_a_change_is_told_as_the_compiler_tells_it(folder, old, new):
    for name, text in FILES.items():
        (folder / name).write_text(text.replace(old, new))
    _, scene, documents = opened(folder)
    check_whole(scene)
    assert told(scene, documents) == compiled(folder)


@pytest.mark.parametrize("seed", range(6))
def test_what_was_found_before_is_as_good_as_new(folder, seed):
    choices, texts = random.Random(seed), dict(FILES)
    project, scene, documents = opened(folder)
    work, before = Work(), None
    for number in range(8):
        old, new = choices.choice([*CHANGES, ('#include "two.plsys"\n', ""), ('#include "head.plsys"\n', "")])
        for name in texts:
            this, that = (old, new) if old in texts[name] else (new, old)
            if this and (at := texts[name].find(this)) >= 0:
                texts[name] = texts[name][:at] + that + texts[name][at + len(this) :]
                (folder / name).write_text(texts[name])
                project.edit(documents[name], at, at + len(this.encode()), that.encode())
        scene.work()
        before = snapshot = Snapshot.of(scene, number, before)
        work.run(snapshot.request, lambda answer: Result(snapshot, answer).apply())
        found, expected = told(scene, dict(enumerate(scene.documents))), compiled(folder)
        # The compiler stops at errors of names; an editor goes on with the parts that have none.
        wrong = {"duplicate-name", "unknown-name"}
        if any(code in wrong for code, *_ in expected):
            assert expected - found == set()
        else:
            assert found == expected


def test_an_edit_is_checked_with_its_own_part(folder):
    project, scene, documents = opened(folder)
    work, answers = Work(), []
    first = Snapshot.of(scene, 0)
    work.run(first.request, answers.append)
    at = FILES["plants/two.plsys"].index("--n2") + 2
    project.edit(documents["plants/two.plsys"], at, at + 2, b"nn")
    scene.work()
    second = Snapshot.of(scene, 1, first)
    work.run(second.request, answers.append)
    assert [len(file.blocks) for file in second.request.files] == [0, 0, 0, 1]
    assert {file for file, _ in answers[-1].blocks} == {3}
    assert [finding.code for finding in answers[-1].findings if finding.file == 3]


def test_a_file_that_is_missing_hides_what_it_may_hold(folder):
    (folder / "head.plsys").unlink()
    project = Project()
    text = '#include "head.plsys"\nSelection Tree { Tree -> sphere; }\n'
    document = project.open(folder / "main.plsys", text.encode())
    scene = project.scene_of(document)
    check_whole(scene)
    assert {code for code, *_ in told(scene, {"main": document})} == {"include"}


def test_insights_of_included_files(folder):
    _, scene, documents = opened(folder)
    check_whole(scene)
    assert scene.forecast["primitives"] == 3 * 4
    blocks = set(documents["plants/two.plsys"].text.blocks)
    assert blocks & set(scene.insights)
