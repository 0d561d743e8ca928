"""What is kept of a large part from one check to the next: messages after edits are those of a fresh start."""

from __future__ import annotations

import random
from functools import partial
from pathlib import Path

import pytest
from plsys.compiler.analysis import Project, check_whole, keeping
from plsys.compiler.analysis.checking import Work
from plsys.compiler.analysis.facts import facts_of
from plsys.compiler.analysis.whole import Result, Snapshot
from plsys.compiler.graph import forecast
from plsys.compiler.reading.memory import Memory
from plsys.compiler.reading.resolve_names import Names
from plsys.compiler.reading.resolve_rules import Rules

HEAD = """\
camera { location <0, -14, 5> sky <0, 0, 1> look_at <0, 0, 5> }
light_source { <20, -30, 40> color rgb 1 }
#declare Redness = 0.5;
#declare Twice = 2*Redness;
Parameter order = 3 [0 to 9] "Age";
Transformation T_up { trans 0 0 1; }
Calculation C_all { all = order; }
object { Forest }
"""
PLANT = """\
#declare Bark{i} = texture {{ pigment {{ color rgb <Redness, 0.3, 0.1> }} }}
Texture Leaf{i} {{ pigment {{ color rgb <Twice, n{i}/10, 0> }} }}
Selection Tree{i}
{{
    C_init{i} Tree{i};
    if (n{i} > 0) Tree{i} -> Bark{i} cylinder + C_less{i} T_up Tree{i};
    else Tree{i} -> Leaf{i} sphere + Twig{i}(n{i} + all);
}}
Selection Twig{i}(w{i}) {{ Twig{i} -> 1: [ scale w{i} ] disc | Twice: T_turn{i} box; }}
Calculation C_init{i} {{ n{i} = order; }}
Calculation C_less{i} {{ --n{i}; }}
Transformation T_turn{i} {{ rotz n{i}; }}
"""
FOREST = "Selection Forest { C_all Forest; Forest -> Tree0 + T_up Tree1 + Tree2; }\n"
SCENE = HEAD + "".join(PLANT.format(i=i) for i in range(3)) + FOREST

# Pieces of text that stand for each other, wherever they are found.
EXCHANGES = [
    ("Tree0", "Tree1"), ("Tree1 + Tree2", "Twig2(4) + Tree2"), ("--n1;", "++n1;"), ("--n2;", "--n2; unread = n1;"), ("n0 = order", "n0 = 3.5"),
    ("n1 > 0", "n1 > 9"), ("n2 > 0", "2 > 1"), ("trans 0 0 1", "scale 0 1 1"), ("trans 0 0 1", "trans 0 0 n0"),
    ("Redness = 0.5", "Redness = 0"), ("2*Redness", "1/Redness"), ("Twice:", "0:"), ("C_init1 Tree1;", "C_init1 C_all Tree1;"),
    ("C_init2 Tree2;", "[ n2 = 2 ] Tree2;"), ("C_init0 Tree0;", ""), ("Twig1(w1) {", "Twig1 {"), ("Twig2(w2) {", "Twig2(v2) {"), ("disc", "sphere"),
    ("C_all Forest;", ""), ("all = order", "al = order"), ("rotz n1", "rotz n2"), ("rotz n0", "rotz pi/2"), ("scale w0", "scale all"),
    ("Texture Leaf1", "Texture Leaf2"), ("Calculation C_less0", "Transformation C_less0"), ("object { Forest }", "object { Tree1 }"),
    ("object { Forest }", "object { Forest texture { Bark0 } }"), ("light_source", "// light_source"), ("1 }\n#dec", "1 }\nglobal_settings { seed 4 }\n#dec"),
    ("<0, -14, 5>", "<0, 0, 0.5>"), ("T_up Tree1 +", "Forest +"), ("Parameter order", "Parameter older"), ("{ --n", "{ --n0; --n"),
    ("cylinder", "mesh(\"no.obj\")"), ("else Tree2 ->", "Tree2 ->"), ("T_up { ", "T_up { // plain\n"), ("\nSelection Twig0", "\nSelection Tree0"),
    ("<Redness, 0.3, 0.1>", "<128, 64, 0>"), ("n1/10, 0>", "200, 0>"),
]  # fmt: skip

# Most of these leave all names and the number of rules as they are, and all can be undone.
SPARE = SCENE.replace("--n1;", "--n1; spare = 1;").replace("--n2;", "--n2; spare = n2; all = 2;")
WITHIN = [
    ("n0 = order", "n0 = order/0"), ("n1 = order", "\n  n1 = 2 + order"), ("n1 > 0", "n1 > 12"), ("n2 > 0", "n2 == 0"), ("trans 0 0 1", "scale 0 1 1"),
    ("--n1;", "++n1;"), ("spare = 1", "spare = pi/2"), ("spare = n2; all = 2", "all = n2; spare = 2"), ("rotz n0", "rotz n0/0"), ("rotz n1", "rotz sqrt(-1)*n1"),
    ("scale w0", "scale w0*0"), ("--n2;", "n2 = n2;"), ("disc", "sphere"), ("cylinder", "cone"), ("Tree0 + T_up Tree1", "T_up Tree1 + Tree0"),
    ("Twice:", "0*Twice:"), ("1: [", "-1: ["), ("n2/10", "n2/0"), ("C_less0 T_up", "T_up C_less0"), ("Calculation C_init2", "\n// new\nCalculation C_init2"),
    ("scale w1", "scale w1; spare = 3"), ("Tree1 + Tree2", "Tree1 + Tree1"), ("else Tree2 ->", "else if (n2 < 9) Tree2 ->"), ("n0 > 0", "n1 > 0"),
    ("(n1 + all)", "(all + n1, 2)"), ("C_init1 Tree1;", "C_init1 C_init1 Tree1;"), ("T_turn2 box", "T_turn2 box + box"), ("sphere +", "sphere"),
    ("rotz n2", "rotz"), ("Calculation C_less1", "Transformation C_less1"), ("Redness = 0.5", "Redness = 0"), ("sky <0, 0, 1>", "sky <0, 1, 1>"),
    ("n1/10, 0>", "200, 0>"), ("n0/10, 0>", "99, 0>"), ("<Redness, 0.3, 0.1>", "<128, 64, 0>"),
]  # fmt: skip


@pytest.fixture(autouse=True)
def parts_are_large_and_forecasts_short(monkeypatch):
    monkeypatch.setattr(keeping, "MANY_BLOCKS", 1)
    monkeypatch.setattr(forecast, "forecast", partial(forecast.forecast, max_states=300, max_depth=300))


# What is said only where all names are known.
UNSURE = ("unused", "unreachable")


def exchanged(choices: random.Random, text: str) -> tuple[int, str, str]:
    """Where what is to be replaced by what."""
    while True:
        pair = choices.choice(EXCHANGES)
        old, new = pair if choices.random() < 0.5 else pair[::-1]
        places = [at for at in range(len(text)) if old and text.startswith(old, at)]
        if places:
            return choices.choice(places), old, new


def told(scene, document) -> list[tuple]:
    scene.work()
    found = [(m.diagnostic.severity, m.diagnostic.code, m.start, m.end, m.diagnostic.message, m.diagnostic.hint) for m in scene.messages(document)]
    return sorted(found)


def fresh(text: str) -> list[tuple]:
    project = Project()
    document = project.open(None, text.encode(), name="x")
    scene = project.scene_of(document)
    check_whole(scene)
    return told(scene, document)


class Editing:
    """A scene under the hands of a random editor, checked in rounds by one worker."""

    def __init__(self, seed: int, text: str) -> None:
        self.choices, self.text = random.Random(seed), text
        self.project, self.worker, self.snapshot = Project(), Work(), None
        self.document = self.project.open(None, text.encode(), name="x")
        self.scene = self.project.scene_of(self.document)

    def replace(self, at: int, old: str, new: str) -> None:
        self.text = self.text[:at] + new + self.text[at + len(old) :]
        self.project.edit(self.document, at, at + len(old), new.encode())

    def is_checked(self, number: int, may_be_late: bool = True) -> bool:
        """One round; False: the next edit came first."""
        self.scene.work()
        snapshot = self.snapshot = Snapshot.of(self.scene, number, self.snapshot)
        self.worker.take(snapshot.request)
        if may_be_late and self.choices.random() < 0.2:
            return False
        self.worker.go_on(lambda answer: Result(snapshot, answer).apply())
        return True

    def expect_a_fresh_start_s_messages(self) -> None:
        found, expected = told(self.scene, self.document), fresh(self.text)
        if any(severity == "error" for severity, *_ in expected):
            found, expected = ([each for each in every if each[1] not in UNSURE] for every in (found, expected))
        assert found == expected


@pytest.mark.parametrize("seed", range(24))
def test_what_is_kept_says_what_a_fresh_start_says(seed):
    editing = Editing(seed, SCENE)
    for number in range(12):
        for _ in range(editing.choices.choice((0, 1, 1, 1, 2))):
            editing.replace(*exchanged(editing.choices, editing.text))
        # Where a block is broken, what was there before is remembered.
        if editing.is_checked(number) and not any(facts_of(block).is_broken for block in editing.document.text.blocks):
            editing.expect_a_fresh_start_s_messages()


@pytest.mark.parametrize("seed", range(12))
def test_definitions_are_exchanged_as_if_all_were_resolved(seed):
    editing = Editing(seed, SPARE)
    choices, done = editing.choices, []
    for number in range(16):
        for _ in range(choices.choice((1, 1, 1, 2))):
            text = editing.text
            if done and choices.random() < 0.6:
                new, old = done.pop()
            else:
                old, new = choices.choice([pair for pair in WITHIN if text.count(pair[0]) > text.count(pair[1]) * (pair[0] in pair[1])])
                done.append((old, new))
            if (at := text.find(old)) >= 0:  # else another edit is in its place
                editing.replace(at, old, new)
        if editing.is_checked(number):
            editing.expect_a_fresh_start_s_messages()


@pytest.fixture
def gathered(monkeypatch) -> list[object]:
    """The files of which all names were gathered, since the last ``clear()``."""
    found: list[object] = []
    gather = Names.gather
    monkeypatch.setattr(Names, "gather", lambda self, file: found.append(file) or gather(self, file))
    return found


@pytest.fixture
def leaf(tmp_path) -> Path:
    """A file of one triangle."""
    path = tmp_path / "leaf.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    return path


ELSEWHERE = {
    "nothing to say": ("", ""), "a message elsewhere": ("<Twice, n2/10, 0>", "<128, 200, 0>"), "a mesh elsewhere": ("T_turn0 box", "mesh(\"leaf.obj\")"),
}  # fmt: skip


@pytest.mark.parametrize("elsewhere", ELSEWHERE)
def test_an_edit_within_a_definition_leaves_the_namespace_alone(elsewhere, gathered, leaf):
    project, work = Project(), Work()
    document = project.open(leaf.parent / "x.plsys", SCENE.replace(*ELSEWHERE[elsewhere]).encode())
    scene = project.scene_of(document)
    snapshot = Snapshot.of(scene, 0)
    work.run(snapshot.request, lambda answer: None)
    gathered.clear()
    for old, new, is_within in (("n1 > 0", "n1 > 2", True), ("n2 = order", "n2 = 4 + order", True), ("trans 0 0 1", "trans 0 0 2", True), ("scale w1", "scale all", True), ("disc |", "disc | 2: box |", False)):
        at = document.text.data.index(old.encode())
        project.edit(document, at, at + len(old), new.encode())
        scene.work()
        snapshot = Snapshot.of(scene, 0, snapshot)
        work.run(snapshot.request, lambda answer: None)
        assert bool(gathered) is not is_within


def test_while_a_part_has_an_error_it_is_not_resolved(gathered):
    editing = Editing(0, SCENE)
    assert editing.is_checked(0, may_be_late=False)
    gathered.clear()
    # An unknown name, an edit elsewhere, a syntax error, and all is right again.
    for number, (old, new) in enumerate((("n1 > 0", "nn > 0"), ("rotz n2", "rotz 2"), ("rotz 2", "rotz 2 +"), ("rotz 2 +", "rotz n2")), 1):
        editing.replace(editing.text.index(old), old, new)
        assert editing.is_checked(number, may_be_late=False) and not gathered
        assert any(each[0] == "error" for each in told(editing.scene, editing.document))
    editing.replace(editing.text.index("nn > 0"), "nn > 0", "n1 > 0")
    assert editing.is_checked(9, may_be_late=False)
    editing.expect_a_fresh_start_s_messages()


def test_a_mesh_file_that_goes_bad_is_told(leaf):
    project, work, before = Project(), Work(), None
    document = project.open(leaf.parent / "x.plsys", SCENE.replace("T_turn0 box", 'mesh("leaf.obj")').encode())
    scene = project.scene_of(document)
    for text in (leaf.read_text(), "no triangles"):
        leaf.write_text(text)
        project.file_changed(leaf)
        scene.work()
        before = snapshot = Snapshot.of(scene, 0, before)
        work.run(snapshot.request, lambda answer: Result(snapshot, answer).apply())
        assert ("file" in {each[1] for each in told(scene, document)}) is (text == "no triangles")


@pytest.mark.parametrize("scene, old, new, code", [
    # The entry action that others run; what they run, since a rule leads back to them; a constant through a constant.
    (SCENE, "n0 = order", "n0 = pi/3", "radians"),
    (SCENE, "Twig1(n1 + all)", "Forest", "maybe-unassigned"),
    (SCENE.replace("T_turn0 {", "T_turn0 { scale Twice;"), "Redness = 0.5", "Redness = 0", "singular"),
], ids=["entry action", "way back", "constant"])  # fmt: skip
def test_an_edit_is_seen_far_away(scene, old, new, code):
    project, work, before = Project(), Work(), None
    document = project.open(None, scene.encode(), name="x")
    shown = project.scene_of(document)
    for this, that in (("", ""), (old, new), (new, old)):
        at = document.text.data.index(this.encode())
        project.edit(document, at, at + len(this), that.encode())
        shown.work()
        before = snapshot = Snapshot.of(shown, 0, before)
        work.run(snapshot.request, lambda answer: Result(snapshot, answer).apply())
        found = told(shown, document)
        assert found == fresh(document.text.data.decode())
        assert (code in {each[1] for each in found}) is (that == new != "")


def test_an_edit_in_a_rule_resolves_that_rule_only(monkeypatch):
    project, work = Project(), Work()
    document = project.open(None, SCENE.encode(), name="x")
    scene = project.scene_of(document)
    first = Snapshot.of(scene, 0)
    work.run(first.request, lambda answer: None)
    resolved: list[str] = []
    selection = Rules._selection
    monkeypatch.setattr(Rules, "_selection", lambda self, node, *rest: resolved.append(node.name.name) or selection(self, node, *rest))
    at = SCENE.index("n1 > 0") + 5
    project.edit(document, at, at + 1, b"1")
    work.run(Snapshot.of(scene, 1, first).request, lambda answer: None)
    assert resolved == ["Tree1"]


@pytest.mark.parametrize("seed", range(4))
def test_checks_that_are_broken_off_go_on_where_they_were(seed, monkeypatch):
    choices, text = random.Random(seed), SCENE
    ask = Memory.ask

    def sometimes_asks(memory, *question, given=()):
        if work.interruption._is_allowed and choices.random() < 0.01:
            work.interruption.interrupt()
        return ask(memory, *question, given=given)

    project, work, before = Project(), Work(), None
    document = project.open(None, text.encode(), name="x")
    scene = project.scene_of(document)
    for number in range(6):
        at, old, new = exchanged(choices, text)
        text = text[:at] + new + text[at + len(old) :]
        project.edit(document, at, at + len(old), new.encode())
        scene.work()
        before = snapshot = Snapshot.of(scene, number, before)
        work.take(snapshot.request)
        with monkeypatch.context() as patch:
            patch.setattr(Memory, "ask", sometimes_asks)
            for _ in range(3):
                work.go_on(lambda answer: Result(snapshot, answer).apply(), lambda: True)
        if choices.random() < 0.5:
            work.go_on(lambda answer: Result(snapshot, answer).apply())
            if not any(each[0] == "error" for each in fresh(text)):
                assert told(scene, document) == fresh(text)
