"""Whatever was edited on the way, in the end an editor shows what `plsys check` says of the texts: of one file or several,
and whatever is wrong with them."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from plsys.compiler.analysis import Document, Project
from plsys.compiler.analysis.checking import Work
from plsys.compiler.analysis.whole import Result, Snapshot
from plsys.compiler.commands.check import check_scene
from plsys.compiler.reading.source import Source
from stress import rounds

HEAD = "camera { location <0, -9, 2> }\nlight_source { <0, -9, 9> color rgb 1 }\n"
SCENE = HEAD + """\
#declare Height = 2;
Texture Bark { pigment { color rgb <0.4, 0.3, 0.1> } }
Texture Unused { pigment { color Red } }
Selection Tree { [ n = 3 ] Tree; if (n > 0) Tree -> Bark cylinder + T_up C_less Tree; else Tree -> Leaf; }
Selection Bush { [ n = 2 ] Bush; if (n > 0) Bush -> sphere; else Bush -> [ trans 0 0 Height ] Leaf; }
Calculation C_less { --n; }
Transformation T_up { trans 0 0 Height; scale 0.5; }
object { Tree }
object { Bush }
"""
LEAF = "Selection Leaf { Leaf -> [ size = 1 ] Blade; }\nSelection Blade { Blade -> [ scale size ] square; }\nCalculation C_own { size = 4; }\n"
MIDDLE = 'Selection Twig { Twig -> Leaf; }\n#include "leaf.plsys"\n'
FILES = (
    {"scene.plsys": SCENE + LEAF},
    {"scene.plsys": '#include "leaf.plsys"\n' + SCENE, "leaf.plsys": LEAF},
    {"scene.plsys": SCENE + '#include "leaf.plsys"\n', "leaf.plsys": LEAF},
    {"scene.plsys": SCENE + '#include "middle.plsys"\n', "middle.plsys": MIDDLE, "leaf.plsys": LEAF},
)
LINES = (
    "Selection New { New -> box; }\n", "object { Tree }\n", "Calculation C_less { n = 2; n = 3/0; m = q; }\n", "background { color Red }\n",
    "#declare Height = 3;\n", "#declarex Height = texture { Bark }\n", "Parameter age = 2 [0 to 3];\n", "camera { location <0, 1, 2> }\n",
    "Transformation T_up { scale 0 1 1; trans zz 0 0; }\n", "Selection Tree(a, b) { Tree -> T_up C_x Blade; }\n", "object { Leaf(1) }\n",
    '#include "leaf.plsys"\n', '#include "nowhere.plsys"\n', "// plsys-ignore: unused\n", "Selection Leaf { Leaf -> [ n = 2 ]; n -> box; }\n",
    "camera { apigment 3 }\n", "pigment { color Red }\n",
)  # fmt: skip
PIECES = ("{", "}", ";", "(", ")", "->", "+", " n", "1.5", "/*", "*/", "//", '"', "\r\n", "\t", "@", "é\U0001f333", "else ", "if (n > 0) ", "Tree")


class Session:
    """Files that are edited, all or some of them open, and the process of the whole-file checks."""

    def __init__(self, files: dict[str, str], folder: Path, closed: set[str] = frozenset()) -> None:
        for name, text in files.items():
            (folder / name).write_bytes(text.encode())
        self.project, self.work, self.folder = Project(), Work(), folder
        self.documents = {name: self.project.open(folder / name, text.encode()) for name, text in files.items() if name not in closed}
        self.root = self.documents["scene.plsys"]
        self.last: Snapshot | None = None

    def edit(self, document: Document, start: int, end: int, data: bytes) -> None:
        self.project.edit(document, start, end, data)

    def change(self, old: str, new: str, name: str = "scene.plsys") -> None:
        start = self.documents[name].text.data.index(old.encode())
        self.edit(self.documents[name], start, start + len(old.encode()), new.encode())

    def shown(self) -> list[tuple]:
        self.project.work()
        scene = self.project.scene_of(self.root)
        snapshot = self.last = Snapshot.of(scene, self.last.request.key + 1 if self.last else 1, self.last)
        self.work.take(snapshot.request)
        self.work.go_on(lambda answer: Result(snapshot, answer).apply())
        found = [(document.path.name, each) for document in scene.documents for each in scene.messages(document)]
        return sorted((name, m.start, m.end, m.diagnostic.code, m.diagnostic.severity, m.diagnostic.message) for name, m in found)

    def said_by_check(self) -> list[tuple]:
        for document in self.documents.values():
            document.path.write_bytes(document.text.data)
        found = check_scene(Source.read(self.root.path))[0]
        return sorted((d.span.source.path.name, d.span.start, d.span.end, d.code, d.severity, d.message) for d in found)


def random_edit(rng: random.Random, data: bytes) -> tuple[int, int, bytes]:
    text = data.decode()
    places = [match.span() for match in re.finditer(r"\w+|[^\w\s]", text)] or [(0, 0)]
    start, end = rng.choice(places)
    line = text.rfind("\n", 0, start) + 1, text.find("\n", start) + 1 or len(text)
    start, end, new = rng.choice((
        (line[0], line[0], rng.choice(LINES)), (line[0], line[0], rng.choice(LINES)), (*line, ""), (line[0], line[0], text[slice(*line)]),
        (end, end, rng.choice(PIECES)), (start, end, ""), (start, end, text[slice(*rng.choice(places))]), (end, end, "x"), (end - 1, end, ""),
    ))  # fmt: skip
    return len(text[:start].encode()), len(text[:end].encode()), new.encode()


def test_random_edits(tmp_path):
    rng = random.Random(5)
    for _ in range(rounds(ci=25, stress=5000)):
        files = rng.choice(FILES)
        session = Session(files, tmp_path, {name for name in files if name != "scene.plsys" and rng.random() < 0.4})
        for _ in range(6):
            done = []
            for _ in range(rng.choice((1, 1, 2, 4))):
                document = rng.choice(list(session.documents.values()))
                start, end, new = random_edit(rng, document.text.data)
                done.append((document, start, start + len(new), document.text.data[start:end]))
                session.edit(document, start, end, new)
                if rng.random() < 0.5:
                    session.project.work()
            for each in reversed(done) if rng.random() < 0.4 else ():
                session.edit(*each)
            assert session.shown() == session.said_by_check(), {name: each.text.data for name, each in session.documents.items()}


@pytest.mark.parametrize(
    "old, new",
    [
        ("Bark cylinder", "cylinder { "),  # guesses about a broken block
        ("C_less Tree", "C_less Treex"),  # an error beside warnings of other parts
        ("camera { location", "camera { locat"),
        ("#declare Height", "#declarex Height"),  # what follows a directive that isn't known
        ("Texture Unused {", "Texture Unused { {"),
        ("Selection Bush {", "Selection Bush { { /* "),  # a name that a break has swallowed
        ("Texture Unused", "Texture Blade"),  # defined in the included file, too
        ("color rgb 1", "color rgb 1 } background { } background {"),
    ],
)
@pytest.mark.parametrize("files", FILES, ids=lambda files: str(len(files)))
def test_mistakes_that_come_and_go(old, new, files, tmp_path):
    session = Session(files, tmp_path)
    before = session.shown()
    assert before == session.said_by_check()
    session.change(old, new)
    assert session.shown() == session.said_by_check()
    session.change(new, old)
    assert session.shown() == session.said_by_check() == before


def test_the_second_definition_is_the_one_that_is_read_later(tmp_path):
    session = Session(FILES[1], tmp_path)
    session.change("Texture Unused", "Texture Blade")
    assert {name for name, *_, code, _, _ in session.shown() if code == "duplicate-name"} == {"scene.plsys"}
    session.change('#include "leaf.plsys"\n', "")
    session.change("object { Tree }\n", 'object { Tree }\n#include "leaf.plsys"\n')
    assert {name for name, *_, code, _, _ in session.shown() if code == "duplicate-name"} == {"leaf.plsys"}


def test_what_is_unused_is_not_said_while_a_use_may_be_in_a_broken_block(tmp_path):
    session = Session(FILES[0], tmp_path)
    assert "unused" in str(session.shown())
    session.change("object { Tree }", "object { Tree")
    assert "unused" not in str(session.shown())
    session.change("object { Tree", "object { Tree }")
    assert "unused" in str(session.shown())


def test_an_include_that_goes_before_its_file_was_read(tmp_path):
    session = Session(FILES[2], tmp_path)
    session.change('#include "leaf.plsys"\n', "")
    assert session.shown() == session.said_by_check()
    assert len(session.project.scene_of(session.root).documents) == 1
