"""What is kept of a block when one token is edited, or white space or a comment, is what a reading of the new text gives."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from plsys.compiler.analysis import Deadline, Document, Project, facts_of
from plsys.compiler.analysis.namespace import MANY_HINTS
from plsys.compiler.analysis.text import Block
from plsys.compiler.reading.source import Span
from stress import rounds

ROOT = Path(__file__).resolve().parents[3]
SCENES = sorted((ROOT / "scenes").glob("*.plsys"))

SCENE = """\
#declare Height = 2;
#declare Bark = texture { pigment { color rgb <Height/4, 0.3, 0.1> }
                          finish { phong 1e-1  // shiny
                                   ambient .2 } }
Parameter age = 1.5 [0 to 20] "Age  in 2 years";
Selection Tree(n)
{
    C_init Tree;
    if (n > Height) Tree -> [ scale 1 1
                                        Height; --n ] cylinder + C_less (T_up Tree(n - 1) + T_down Tree(n));
    else Tree -> 2: sphere | n: cone;
}
Selection Bush { Bush -> T_up sphere + Tree(2); }
Calculation C_init { angle = 60; tilt = angle ? 2 : -angle; }
Calculation C_less { angle -= max(4, tilt); }
Transformation T_up { trans 0 0 Height;   roty angle
    ; rotx tilt;  /* a comment */ scale
                                  tilt; }
Transformation T_down { roty angle  // ;
                                   tilt ;
}
object { Tree(3) texture { Bark } translate <Height, 0, 0> }
object { Bush }
"""
LETTERS = ["x", "for", "i", "f", "1", "_", "rgb", " ", "-", "", "", "", "cone", "Bark", "é", ".", "e", "  ", "\t", "/", "0", '"']
# Names, numbers, comments and white space, at and in which most of the edits are.
TOKENS = re.compile(rb"[A-Za-z_]\w*|[.\d][\w.]*|//[^\n]*|[ \t]+")


def shown(value: object, block: Block) -> object:
    """Syntax as plain values, with places that must be of ``block``."""
    if isinstance(value, Span):
        assert value.source is block
        return value.start, value.end
    if isinstance(value, tuple | list):
        return [shown(each, block) for each in value]
    if hasattr(value, "__slots__"):
        fields = [name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())]
        return type(value).__name__, [(name, shown(getattr(value, name), block)) for name in fields]
    return value


def known(block: Block) -> list[object]:
    facts = facts_of(block)
    return [
        shown(facts.file, block),
        [(each.name, each.role, each.start, each.end) for each in facts.names],
        [(each.name, each.kind, shown(each.node, block)) for each in facts.definitions],
        shown(facts.assigned, block),
        [(each.code, each.message, shown(each.span, block)) for each in facts.syntax],
        facts.words,
        facts.is_broken,
        facts.text,
        str(facts.tree.root_node),
    ]


def told(project: Project, document: Document) -> list[tuple]:
    project.work()
    return sorted((m.start, m.end, m.diagnostic.code, m.diagnostic.message, m.diagnostic.hint) for m in project.messages(document))


def used(project: Project, document: Document) -> dict[str, list[tuple]]:
    """Where each name stands."""
    scene = project.scene_of(document)
    return {name: [(each.start, each.end, each.role) for each in scene.uses(name)] for name in scene.users}


def check(project: Project, document: Document) -> None:
    """All that is known equals what a fresh start finds out."""
    for block in document.text.blocks:
        assert known(block) == known(Block(block.name, block.data, block.path, block.shape))
    if not any(facts_of(block).ghosts for block in document.text.blocks):
        fresh = Project()
        other = fresh.open(document.path, document.text.data, name="y")
        assert told(project, document) == told(fresh, other), document.text.data.decode()
        assert used(project, document) == used(fresh, other)


def places(rng: random.Random, document: Document, count: int) -> list[int]:
    """Places at and in tokens mostly, the last one first."""
    tokens = [match.span() for match in TOKENS.finditer(document.text.data)]
    several = (rng.randint(*rng.choice(tokens)) if rng.random() < 0.8 else rng.randrange(len(document.text)) for _ in range(count))
    return sorted(set(several), reverse=True)


def type_at_many_places(rng: random.Random, document: Document, project: Project) -> int:
    """A change at several places, and the change back of some; how often facts were kept."""
    before = {block: facts_of(block) for block in document.text.blocks}
    read = {id(facts) for facts in before.values()}
    letters = rng.choice(LETTERS)
    cut = 0 if letters and rng.random() < 0.7 else 1
    project.edits(document, [(at, at + cut, letters.encode()) for at in places(rng, document, rng.choice((1, 3, 6)))])
    project.work()
    return sum(block not in before and id(facts_of(block)) in read for block in document.text.blocks)


@pytest.mark.parametrize("seed", range(rounds(25, 2_000)))
def test_letters_at_many_places(seed):
    rng = random.Random(seed)
    text = SCENE if seed % 3 else SCENES[seed % len(SCENES)].read_text()
    project = Project()
    document = project.open(None, text.encode(), name="x")
    project.work()
    kept = 0
    for _ in range(10):
        kept += type_at_many_places(rng, document, project)
        check(project, document)
    if seed == 1:
        assert kept > 0


@pytest.mark.parametrize("seed", range(rounds(15, 500)))
def test_letters_typed_while_others_are_being_read(seed):
    rng = random.Random(seed)
    project = Project()
    document = project.open(None, SCENE.encode(), name="x")
    project.work()
    for _ in range(10):
        for _ in range(rng.choice((2, 3))):
            letters = rng.choice(LETTERS)
            cut = 0 if letters and rng.random() < 0.7 else 1
            project.edits(document, [(at, at + cut, letters.encode()) for at in places(rng, document, 6)])
            for _ in range(rng.choice((0, 1, 2, 3))):
                project.work(Deadline(0.0))  # some blocks only
        project.work()
        check(project, document)


@pytest.mark.parametrize(
    "text, typed",
    [
        ("Transformation Tree| { roty\n                       angle; }\n", "s"),  # `angle` stands no deeper now
        ("Transformation T { roty i|; }\n", "f"),
        ("Transformation T { fo| 1; }\n", "r"),
        ("#declare B = texture { pigment { color rg| 1 } }\n", "b"),
        ("Selection A { A -> texture { pigment { color rg| 1 } } box; }\n", "b"),
        ("Selection A { C_a A|; A -> box; }\n", "b"),
        ("Selection A| { C_a A; A -> box; }\n", "b"),
        ("Calculation C { |n = 1; }\n", "é"),
        ("Calculation C { |n = 1; }\n", "2"),
        ("Calculation C { n| = 1; }\n", " 2"),
        ('#include "|a.plsys"\n#declare B = c;\n', "b"),
        ("#declare B = tex|ture { }\n", "x"),  # it is an object now
        ("Tex|ture B { pigment { color rgb 1 } }\n", "x"),
        ("Calculation C { n = |.60; m .= n; }\n", "0"),  # what is wrong with the number hides the other point
        ("Calculation C { n = 1| -2; }\n", "e"),
        ("Calculation C { n = 1|-2; }\n", "e"),  # one number now
        ("Calculation C { n = |1; }\n", "x"),
        ("Calculation C { n = 1|; }\n", "x"),
        ("Calculation C { n = 2|; }\nSelection A { A -> C box; }\n", "_"),  # what C assigns isn't known now
        ("#declare B = 1|;\n#declare C = sqrt(1 - B);\n", "0"),
        ("Selection A { if (2|) A -> box; }\n", "x"),
        ("Transformation T |{ roty\n                  angle; }\n", " "),
        ("Transformation T { scale 2;  | roty\n                  angle; }\n", " "),  # `angle` stands no deeper now
        ("Transformation T { scale -| 2; }\n", " "),
        ("Transformation T { scale |-2 ; }\n", " "),
        ('Parameter a = 1 "a| b";\n', " "),
        ("Calculation C { n = 2; // plsys-ignore: un|used\n}\n", "x"),
        ("Calculation C { n = 2; /| a\n n = 2; }\n", "/"),
        ("Calculation C { n = 2; //| a\n n = 2; }\n", "/"),
        ("Calculation C { n = 2; /* // */| n = 3; }\n", " "),
    ],
)
def test_letters_with_a_meaning(text, typed):
    project = Project()
    document = project.open(None, text.replace("|", "").encode(), name="x")
    project.work()
    project.edit(document, text.index("|"), text.index("|"), typed.encode())
    project.work()
    check(project, document)


@pytest.mark.parametrize("taken, typed", [("\u207f".encode()[:1], b""), (b"cubes", b"\0")])
def test_a_comment_that_is_no_text_any_more_says_so(taken, typed):
    """Half a character, a NUL byte: what a reading of it says isn't forgotten because comments mean nothing."""
    project = Project()
    document = project.open(None, "camera { angle 45 } // 20\u207f cubes\n".encode(), name="x")
    assert told(project, document) == []
    at = document.text.data.index(taken)
    project.edit(document, at, at + len(taken), typed)
    assert [code for _, _, code, *_ in told(project, document)] == ["encoding"]
    check(project, document)


def test_a_letter_in_a_name_keeps_the_rest():
    project = Project()
    document = project.open(None, SCENE.encode(), name="x")
    project.work()
    at = SCENE.index("cylinder + C_less")
    block = document.text.block_at(at)[0]
    facts = facts_of(block)
    project.edit(document, at, at, b"T_up x")
    project.work()
    assert facts_of(document.text.block_at(at)[0]) is not facts  # a name more
    at = document.text.data.index(b"T_up xcylinder")
    facts = facts_of(document.text.block_at(at)[0])
    project.edit(document, at + 5, at + 6, b"")
    project.work()
    assert facts_of(document.text.block_at(at)[0]) is facts
    check(project, document)


@pytest.mark.parametrize(
    "text, typed",
    [
        ("Transformation T { scale 0.|5; }\n", "2"),
        ("Transformation T { scale 0.|5; }\n", "x"),
        ("#declare B = texture { pi|gment { color rgb 1 } }\n", "x"),
        ("camera {\n    location <0, 1|, 2>\n    angle 45\n}\n", "0"),
        ("camera {\n    location <0, 1, 2> |\n    angle 45\n}\n", " "),
        ("Transformation T { scale 2; |  // a comment\n}\n", "  "),
        ("Transformation T { scale 2;  // a |comment\n}\n", "{ /"),
        ('Selection A { A -> [ scale 1.|5 ] mesh("a.obj"); }\n', "2"),
    ],
)
def test_what_is_in_or_beside_tokens_keeps_the_rest(text, typed):
    project = Project()
    at = text.index("|")
    document = project.open(None, text.replace("|", "").encode(), name="x")
    before = told(project, document)
    facts = facts_of(document.text.blocks[0])
    for edit in ((at, at, typed.encode()), (at, at + len(typed), b"")):
        project.edit(document, *edit)
        project.work()
        assert facts_of(document.text.blocks[0]) is facts
        check(project, document)
    assert told(project, document) == before


def library_of_two_scenes(folder):
    """A project, and in it a library that two scenes include."""
    for name in ("one", "two"):
        (folder / f"{name}.plsys").write_text('#include "library.plsys"\nobject { Tree }\n')
    (folder / "library.plsys").write_text("Selection Tree { Tree -> T_up sphere; }\nTransformation T_up { trans 0 0 1; }\n")
    project = Project()
    documents = [project.open(path, path.read_bytes()) for path in sorted(folder.glob("*.plsys"))]
    library = next(each for each in documents if each.path.stem == "library")
    project.work()
    return project, library


def test_a_name_in_a_file_of_two_scenes_is_read_anew(tmp_path):
    project, library = library_of_two_scenes(tmp_path)
    assert len(library.scenes) == 2
    at = library.text.data.index(b"T_up sphere")
    project.edit(library, at, at, b"x")
    project.work()
    for scene in library.scenes:
        assert [each.diagnostic.message[:20] for each in scene.messages(library)] == ["unknown name 'xT_up'"]
        assert scene.uses("T_up") and len(scene.uses("xT_up")) == 1


def test_what_a_wrong_name_hid_is_told_when_the_name_is_right():
    """A term's first mistake is the only one that is told of it."""
    project = Project()
    text = b"Selection A { A -> C_x (T_y box + T_x box); }\nTransformation T_x { roty 9; }\nTransformation C_xx { roty 9; }\n"
    document = project.open(None, text, name="x")
    assert [each[3][:18] for each in told(project, document)] == ["unknown name 'C_x'"]
    at = text.index(b"C_x ") + 3
    project.edit(document, at, at, b"x")
    assert [each[3][:18] for each in told(project, document)] == ["unknown name 'T_y'"]
    check(project, document)


def test_what_a_library_no_longer_defines_is_gone_in_all_its_scenes(tmp_path):
    project, library = library_of_two_scenes(tmp_path)
    at = library.text.data.index(b"T_up {")
    for _ in range(2):  # the second time, what the first one gave is to be forgotten
        project.edit(library, at, at, b"x")
        project.work()
    for scene in library.scenes:
        assert [each.diagnostic.message[:19] for each in scene.messages(library)] == ["unknown name 'T_up'"]
        assert set(scene.names()) == {"Tree", "xxT_up"}


@pytest.mark.parametrize("many", [0, 2 * MANY_HINTS])
def test_what_a_wrong_name_is_like_is_looked_up_again(many):
    """When the name that was named goes, and when one comes that is more like it; beside many other wrong names, too."""
    project = Project()
    other = "".join(f"#declare A{i} = B{i};\n" for i in range(many))
    text = f"object {{ Bracket }}\nSelection Brackets {{ Brackets -> box; }}\n{other}"
    document = project.open(None, text.encode(), name="x")

    def hint() -> str:
        project.work()
        (found,) = (m.diagnostic.hint for m in project.messages(document) if "'Bracket'" in m.diagnostic.message)
        return found

    assert hint() == "did you mean 'Brackets'?"
    for old, new in ((b"Brackets {", b"Brackett {"), (b"Brackett {", b"Shelf {"), (b"Shelf {", b"Brakcet {")):
        at = document.text.data.index(old)
        project.edit(document, at, at + len(old), new)
        name = new.split()[0].decode()
        assert hint() == ("" if name == "Shelf" else f"did you mean '{name}'?")
        check(project, document)
