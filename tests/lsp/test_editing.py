"""Recorded editing: scenes typed from empty to whole, and edits at random, against analyses from scratch.

Whatever the way to a text, the analysis by block must say what one of the whole text says; and while a block is being
typed, about the finished blocks before it only what is true.
"""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from plsys.compiler.analysis import Document, Project, facts_of
from plsys.compiler.pipeline import diagnose
from plsys.compiler.reading.source import Source
from stress import rounds
from tests.lsp.editor import Editor

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted((ROOT / "scenes").glob("*.plsys"))
PIECES = (
    "Selection New { New -> sphere; }\n", "Calculation C_new { --n; }\n", "#declare Red2 = rgb <1, 0, 0>;\n", "object { New }\n", "{", "}", "(", ")",
    ";", "->", "+", "if (n > 0) ", "else ", "n", "Tree", "Palm", "sphere", "/*", "*/", "//", "\n", "\r\n", '"', "1", "é", "\U0001f333", "#include \"x.plsys\"\n",
    "// plsys-ignore: unused\n", "camera { angle 45 }\n",
)  # fmt: skip

SYNTAX = ("syntax", "unclosed", "missing", "assignment-in-condition", "encoding")
Said = tuple[int, int, str, str]


def said(project: Project, document: Document) -> list[Said]:
    project.work()
    return sorted((m.start, m.end, m.diagnostic.code, m.diagnostic.message) for m in project.messages(document))


def from_scratch(path: Path, data: bytes) -> list[Said]:
    project = Project()
    return said(project, project.open(path, data))


def is_broken(document: Document) -> bool:
    return any(facts_of(block).is_broken for block in document.text.blocks)


@pytest.mark.parametrize("steps", [(1,), (1, 1, 1, 2, 30, 90)], ids=["characters", "pieces"])
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_typed_from_empty_to_whole(path, steps):
    """Character by character, and in pieces of so many characters. About the blocks before the one that is typed only that is
    said which is true without it, or once it is whole."""
    rng = random.Random(path.stem)
    whole = path.read_bytes().decode()
    starts = Document(path, whole.encode()).text.starts
    project = Project()
    document = project.open(path, b"")
    typed, boundary, true = 0, -1, []
    while typed < len(whole):
        piece = whole[typed : typed + rng.choice(steps)]
        at = len(document.text)
        project.edit(document, at, at, piece.encode())
        typed += len(piece)
        length = len(whole[:typed].encode())
        block = max(start for start in starts if start < length)
        if block != boundary:
            after = min(start for start in starts if start > block)
            boundary = block
            true = from_scratch(path, whole.encode()[:block]) + from_scratch(path, whole.encode()[:after])
        finished = [each for each in said(project, document) if each[1] <= boundary]
        assert [each for each in finished if each not in true] == [], whole[max(0, typed - 60) : typed]
    assert document.text.data == whole.encode()
    assert said(project, document) == from_scratch(path, whole.encode())


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_what_an_editor_shows_in_the_end_is_what_check_says(path, tmp_path):
    for mesh in path.parent.glob("*.obj"):
        (tmp_path / mesh.name).write_bytes(mesh.read_bytes())
    editor = Editor({path.name: ""}, folder=tmp_path)
    editor.change("", path.read_bytes().decode(), path.name)
    assert codes_of(editor, path) == codes_of_check(path)


def codes_of(editor: Editor, path: Path) -> list[tuple]:
    editor.check_whole(path.name)
    found = editor.published(path.name)
    assert not [message for message in editor.sent if "error" in message]
    return sorted((each["code"], each["range"]["start"]["line"] + 1, each["message"].split("\n")[0]) for each in found)


def codes_of_check(path: Path) -> list[tuple]:
    found = diagnose(Source(path.name, path.read_bytes(), path))[0]
    return sorted((each.code, each.span.start_position.line, each.message) for each in found)


def test_random_edits_end_where_a_fresh_analysis_does():
    rng = random.Random(7)
    for _ in range(rounds(ci=12, stress=2000)):
        path = rng.choice(SCENES)
        project = Project()
        document = project.open(path, path.read_bytes())
        for _ in range(25):
            data = document.text.data
            start = rng.randrange(len(data) + 1)
            end = min(len(data), start + rng.choice((0, 0, 0, 1, 3, 30, 200)))
            piece = rng.choice(PIECES).encode() if rng.random() < 0.7 else b""
            project.edit(document, start, end, piece)
            if rng.random() < 0.3:
                compare(project, document, path)
            if rng.random() < 0.5:  # undo, so that the text stays a scene
                project.edit(document, start, start + len(piece), data[start:end])
                compare(project, document, path)


PLANT = """\
Selection Tree{i} {{ C_init{i} Tree{i}; if (n{i} > 0) Tree{i} -> T_up{i} box + C_less{i} (T_up{i} Tree{i} + cylinder); else Tree{i} -> box; }}
Calculation C_init{i} {{ n{i} = 3; }}
Calculation C_less{i} {{ --n{i}; }}
Transformation T_up{i} {{ trans 0 0 {i}; scale 0.5 0.5 0.5; }}
"""


def test_a_key_at_many_cursors_ends_where_a_fresh_analysis_does():
    """One key at many places at once, in names mostly, and all of it taken back; one block uses the names of all others."""
    rng, path = random.Random(11), Path("scene.plsys")
    terms = (f"(T_up{i} Tree{i} + T_up{i} [ trans n{i} 0 0 ] Tree{i})" if i % 3 else f"T_up{i} Tree{i}" for i in range(12))
    forest = f"Selection Forest {{ Forest -> {' + '.join(terms)}; }}\nobject {{ Forest }}\n"
    whole = ("".join(PLANT.format(i=i) for i in range(12)) + forest).encode()
    in_names = [match.start() for match in re.finditer(rb"(?<=[A-Za-z_])\d+", whole)]
    for _ in range(rounds(ci=30, stress=2000)):
        project = Project()
        document = project.open(path, whole)
        for _ in range(2):
            anywhere = rng.sample(range(1, len(whole)), rng.choice((0, 0, 0, 1, 5)))
            typed = set(rng.sample(in_names, rng.randrange(1, 30)) + anywhere)
            project.edits(document, [(place, place, b"x") for place in sorted(typed, reverse=True)])
            compare(project, document, path)
            first = set(rng.sample(sorted(typed), rng.randrange(len(typed))))
            for gone, there in (first, typed), (typed - first, typed - first):
                at = [place + sum(other < place for other in there) for place in gone]
                project.edits(document, [(place, place + 1, b"") for place in sorted(at, reverse=True)])
                compare(project, document, path)
            assert document.text.data == whole


def compare(project: Project, document: Document, path: Path) -> None:
    data = document.text.data
    found, fresh = said(project, document), from_scratch(path, data)
    if is_broken(document):
        # What an error has swallowed is remembered, so that names may be known here and not from scratch.
        assert [each for each in found if each[2] in SYNTAX] == [each for each in fresh if each[2] in SYNTAX], data
    else:
        assert found == fresh, data


def test_a_header_that_is_being_typed_floods_nothing():
    text = "object { Tree(1, 2) }\nSelection Tree(n, m) { Tree -> [ scale n m 1 ] box; }\n"
    assert from_scratch(Path("scene.plsys"), text.encode()) == []
    for cut in ("Selection Tree(", "Selection Tree(n,", "Selection Tree(n, m)"):
        found = from_scratch(Path("scene.plsys"), text[: text.index(cut) + len(cut)].encode())
        assert found and {each[2] for each in found} <= set(SYNTAX)


def test_what_a_calculation_assigns_is_not_missed_while_it_is_typed():
    rules = "object { Tree }\nSelection Tree { Tree -> C_start T_up box; }\nTransformation T_up { trans 0 0 height; }\n"
    typed = rules.replace("T_up box", "[ trans 0 0 width ] box") + "Calculation C_start { height = 2 * (1; }"
    assert {each[2] for each in from_scratch(Path("scene.plsys"), typed.encode())} <= {*SYNTAX, "unknown-name"}
    project = Project()
    document = project.open(Path("scene.plsys"), typed.encode())
    assert "width" not in str(said(project, document))
    project.edit(document, typed.index("(1"), typed.index("(1") + 1, b"")
    assert "width" in str(said(project, document))  # now it is known that nothing assigns it


def test_what_is_published_first_of_a_file_is_complete_on_a_slow_machine(monkeypatch):
    """A file's first messages aren't those of a first slice of work, which may be none."""
    monkeypatch.setattr("plsys.lsp.updates.SLICE", 0.0)
    editor = Editor("object { Tre }\nSelection Tree { Tree -> box; }\n")
    editor.codes()
    sent = [each["params"] for each in editor.sent if each.get("method") == "textDocument/publishDiagnostics"]
    assert [[each["code"] for each in each["diagnostics"]] for each in sent] == [["unknown-name"]]
