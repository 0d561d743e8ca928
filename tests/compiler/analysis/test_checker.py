"""The process of the whole-file checks: what it knows of many scenes, and that it lives on."""

from __future__ import annotations

import queue

import pytest
from plsys.compiler.analysis import Checker, Project, check_whole, telling
from plsys.compiler.analysis.checking import Work
from plsys.compiler.analysis.interruption import Interrupted, Interruption
from plsys.compiler.analysis.whole import MAX_KNOWN, Result, Snapshot
from plsys.compiler.commands.check import check_scene
from plsys.compiler.reading.source import Source


@pytest.fixture
def results():
    return queue.Queue()


@pytest.fixture
def checker(results):
    checker = Checker(results.put)
    yield checker
    checker.close()


def codes(checker: Checker, results: queue.Queue, scene, document) -> list[str]:
    scene.work()
    checker.want(scene)
    checker.go()
    while not checker.is_idle or not results.empty():
        results.get(timeout=60).apply()
    return sorted(message.diagnostic.code for message in scene.messages(document))


def test_more_scenes_than_it_keeps(checker, results):
    project, text = Project(), b"camera { }\nlight_source { <0, 0, 9> color rgb 1 }\nobject { A }\nSelection A { A -> box; }\n"
    documents = [project.open(None, text, name=str(i)) for i in range(MAX_KNOWN + 4)]
    for _ in range(2):
        for document in documents:
            scene = project.scene_of(document)
            assert codes(checker, results, scene, document) == []
            project.edit(document, len(document.text), len(document.text), b"Selection B { B -> box; }\n")
            assert codes(checker, results, scene, document) == ["unreachable"]
            project.edit(document, len(text), len(document.text), b"")


def test_scenes_that_were_closed_are_left_out(checker, results):
    project = Project()
    document = project.open(None, b"object { A }\nSelection A { A -> box; }\n", name="a")
    scene = project.scene_of(document)
    checker.want(scene)
    project.close(document)
    project.documents.clear()
    scene.root.scenes.clear()
    checker.go()
    assert checker.is_idle


def test_texts_that_follow_each_other_before_one_is_checked(checker, results):
    head = b"camera { }\nlight_source { <0, 0, 9> color rgb 1 }\n"
    plant = b"object { A%d }\nSelection A%d { A%d -> C%d box; }\nCalculation C%d { n%d = 1; }\n"
    plants = b"".join(plant % ((i,) * 6) for i in range(40))
    project = Project()
    document = project.open(None, head + plants, name="x")
    scene = project.scene_of(document)
    for i in range(40):
        at = document.text.data.index(b"-> C%d box" % i) + 3
        project.edit(document, at, at + len(b"C%d " % i), b"")
        scene.work()
        checker.want(scene)
        checker.go()
    assert codes(checker, results, scene, document) == ["unused"] * 40


def test_what_is_told_in_pieces_is_what_is_told_at_once(monkeypatch):
    """Reading all insights of a large part at once would keep an editor's key waiting."""
    monkeypatch.setattr(telling, "PIECE", 3)
    plant = "object {{ A{i} }}\nSelection A{i} {{ [ n{i} = {i} ] A{i}; if (n{i} > 0) A{i} -> box + [ --n{i} ] A{i}; }}\n"
    text = "".join(plant.format(i=i) for i in range(10))
    counts = []

    def checked(told):
        document = Project().open(None, text.encode(), name="x")
        (scene,) = document.scenes
        scene.work()
        snapshot, answers = Snapshot.of(scene, 0), []
        Work().run(snapshot.request, answers.append)
        for answer in answers:
            several = list(told(answer))
            counts.append(len(several))
            for each in several:
                Result(snapshot, each).apply()
        insights = [scene.insights.get(block) for block in document.text.blocks]
        return insights, scene.forecast, [each.diagnostic.message for each in scene.messages(document)]

    assert checked(telling.in_pieces) == checked(lambda answer: [answer])
    assert max(counts) > 3


def test_a_mesh_file_that_comes_and_goes(checker, results, tmp_path):
    mesh, project = tmp_path / "leaf.obj", Project()
    text = b'camera { }\nlight_source { <0, 0, 9> color rgb 1 }\nSelection A { A -> mesh("leaf.obj"); }\nobject { A }\n'
    document = project.open(tmp_path / "scene.plsys", text)
    scene = project.scene_of(document)
    assert codes(checker, results, scene, document) == ["file"]
    for change, expected in ((lambda: mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), []), (mesh.unlink, ["file"])):
        change()
        project.file_changed(mesh)
        assert codes(checker, results, scene, document) == expected


def test_news_that_came_while_nothing_could_be_interrupted():
    """Its signal was in vain; a forecast that begins now would keep it waiting for seconds."""
    interruption, done = Interruption(), []
    interruption.has_news = lambda: True
    with pytest.raises(Interrupted), interruption.allowed():
        done.append("a forecast")
    interruption.has_news = lambda: False
    with interruption.allowed():
        done.append("the next one")
    assert done == ["the next one"]


def test_what_to_place_is_the_first_selection(tmp_path):
    """Of whichever part: those before and behind it have none, and others. What is included comes before."""
    other = "#declare A = 1;\nTexture X { pigment { color rgb A } }\n"
    two = "Selection Trunk { Trunk -> cylinder; }\nSelection Bough { Bough -> cone; }\n"
    (tmp_path / "first.plsys").write_text("Selection Leaf { Leaf -> disc; }\n")
    for text, first in ((other, "Tree"), (other + two + other.replace("A", "B").replace("X", "Y"), "Trunk"), (two + '#include "first.plsys"\n', "Trunk"),
                        (other + '#include "first.plsys"\n' + two, "Leaf")):  # fmt: skip
        path = tmp_path / "root.plsys"
        path.write_text(text)
        project = Project()
        scene = project.scene_of(project.open(path, text.encode()))
        project.work()
        check_whole(scene)
        told = [m.diagnostic.hint for m in scene.messages(scene.root) if m.diagnostic.code == "no-object"]
        assert told == [f"to place a Selection, write object {{ {first} }}"]
        assert told == [each.hint for each in check_scene(Source.read(path))[0] if each.code == "no-object"]
