"""The formatter: style by example, and what holds for every text: it is idempotent, keeps comments, and changes no
meaning."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenes import scenes

from plsys.compiler.analysis import Document, format_document
from plsys.compiler.reading import syntax
from plsys.compiler.reading.parse import parse
from plsys.compiler.reading.source import Source

ROOT = Path(__file__).resolve().parents[3]
SCENES = sorted((ROOT / "scenes").glob("**/*.plsys"))
CASES = sorted(each for folder in ("syntax", "resolve") for each in (ROOT / "tests/cases" / folder).glob("*.txt"))

TOKEN = re.compile(r'"(?:[^"\\\r\n]|\\.)*"?|//[^\r\n]*|/\*.*?(?:\*/|$)|\s+|\w+(?:\.\w+)*|.', re.DOTALL)


def formatted(text: str | bytes) -> str:
    data = text.encode() if isinstance(text, str) else text
    return format_document(Document(None, data)).data.decode()


def outline(node: object) -> object:
    """A tree as nested tuples, without spans."""
    if isinstance(node, tuple):
        return tuple(outline(each) for each in node)
    if isinstance(node, syntax.Node):
        fields = (getattr(node, name) for name in node.__dataclass_fields__ if name != "span")
        return (type(node).__name__, *(outline(field) for field in fields))
    return node


def meaning(text: str) -> object:
    """The syntax tree and the messages."""
    file, diagnostics = parse(Source.from_text(text))
    return outline(file), [(each.code, each.message) for each in diagnostics.items]


def comments(text: str) -> list[str]:
    return [each.rstrip() for each in TOKEN.findall(text) if each.startswith(("//", "/*"))]


def check(text: str) -> str:
    """What holds for every text; the formatted one."""
    result = formatted(text)
    assert meaning(result) == meaning(text)
    assert formatted(result) == result
    assert comments(result) == comments(text)
    assert re.sub(r"\s+", "", result) == re.sub(r"\s+", "", text)
    return result


# --- style


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_our_scenes_are_formatted(scene):
    text = scene.read_text()
    assert check(text) == text


STYLE = {
    "spaces": (
        "Calculation C{n=1;m  +=n-1 ;a=-b+(c>2&&!d?1:0);--n;m ++;}",
        "Calculation C { n = 1; m += n - 1; a = -b + (c > 2 && !d ? 1 : 0); --n; m++; }\n",
    ),
    "side by side": ("Transformation T{trans 0 -1 len*0.9;rot R-1,0 , - n,2;}", "Transformation T { trans 0 -1 len*0.9; rot R - 1, 0, -n, 2; }\n"),
    "products as the author has them": ("Calculation C { a = 2*b+c * d-e* f; }", "Calculation C { a = 2*b + c * d - e * f; }\n"),
    "calls and vectors": ("camera{location< 1 , max( a,b ),-2 >sky<0,0,1>}", "camera { location <1, max(a, b), -2> sky <0, 0, 1> }\n"),
    "definitions begin lines": ("camera { angle 4 }  object { A } // c\nSelection A { A->box+[--n;scale 2]A; }", "camera { angle 4 }\nobject { A } // c\nSelection A { A -> box + [ --n; scale 2 ] A; }\n"),
    "indentation": (
        "Selection A\n{\nC_i A;\nif(n>0)A->box+A;\nelse if (m > 0)\nA -> x;\nelse\nA->y;\n}\n",
        "Selection A\n{\n    C_i A;\n    if (n > 0) A -> box + A;\n    else if (m > 0)\n        A -> x;\n    else\n        A -> y;\n}\n",
    ),
    "operands below each other": (
        "Selection A { A->T x+(y\n+z)\n+ w; }",
        "Selection A { A -> T x + (y\n                        + z)\n                 + w; }\n",
    ),
    "alternatives": ("Selection A { A->3:x|1:\ny; A -> ; }", "Selection A { A -> 3: x | 1:\n    y; A -> ; }\n"),
    "aligned columns stay": (
        "Calculation    C_long { n=1; }   // one\nTransformation T      { scale 2;  rotz 3; } // two\n",
        "Calculation    C_long { n = 1; } // one\nTransformation T      { scale 2;  rotz 3; } // two\n",
    ),
    "a vector over lines": (
        "camera {\nlocation < 1,\n2, 3\n>\n}\n",
        "camera {\n    location <1,\n        2, 3\n    >\n}\n",
    ),
    "a body over lines": (
        "union {\nsphere{0,1}\n  texture\n{\npigment{color rgb 1}}}\n",
        "union {\n    sphere { 0, 1 }\n    texture\n    {\n        pigment { color rgb 1 }\n    }\n}\n",
    ),
    "blank lines": ("\n\n#declare A=1 ;\n\n\n\n#declare B = 2;\n\n", "#declare A = 1;\n\n#declare B = 2;\n"),
    "no blank lines inside of braces' ends": ("Calculation C {\n\n\nn = 1;\n\n\nm = 2;\n\n}\n", "Calculation C {\n    n = 1;\n\n    m = 2;\n}\n"),
    "comments": (
        "// a  \nSelection A   // b\n{\n  /* c */ A ->/*d*/box; // e\n// f\n}\n",
        "// a\nSelection A   // b\n{\n    /* c */ A ->/*d*/box; // e\n    // f\n}\n",
    ),
    "parameters and textures": ('Parameter  p=1[0 to 2]"x";\nTexture X{pigment{color_map{[0 color Red][1.0 color rgb 1]}}}', 'Parameter  p = 1 [0 to 2] "x";\nTexture X { pigment { color_map { [0 color Red] [1.0 color rgb 1] } } }\n'),
    "tabs": ("Calculation C {\n\tn\t=\t1;\t// c\n}\n", "Calculation C {\n    n = 1; // c\n}\n"),
    "line ends stay": ("Calculation C {\r\nn=1;\r\n}", "Calculation C {\r\n    n = 1;\r\n}\r\n"),
    "empty": ("  \n\n", ""),
}


@pytest.mark.parametrize("text, expected", STYLE.values(), ids=STYLE)
def test_style(text, expected):
    assert check(text) == expected


def test_a_byte_order_mark_stays():
    assert formatted(b"\xef\xbb\xbf  camera{angle 4}") == "\ufeffcamera { angle 4 }\n"


def test_definitions_with_errors_are_left_alone():
    text = "Calculation C {n=1;}\nCalculation D { n=  ; }\nCalculation E{n=1;}\n"
    assert formatted(text) == "Calculation C { n = 1; }\nCalculation D { n=  ; }\nCalculation E { n = 1; }\n"


# --- meaning


SIGNS = ["-1", "- 1", "-n", "n", "n-1", "n -1", "n - 1", "-(n)", "(n -1)", "n*-2", "n/ 2", "+1", "+ 1", "!n", "- -1", "-/**/1", "n-/**/1", "n -/**/1", "n/**/-1", "n/**/- 1", "f(n)-1", "f(n) -1", "-\n1", "n\n- 1", "n\n-1", "n-// c\n1", "n -// c\n1", "<1,-2,3>", "<1 -2,3>"]  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(st.lists(st.sampled_from(SIGNS), min_size=1, max_size=5), st.sampled_from([" ", "  ", ", ", "\n", " /**/", "//c\n"]))
def test_signs_keep_their_meaning(arguments, separator):
    text = f"Transformation T {{ trans {separator.join(arguments)}; }}\nsphere {{ {separator.join(arguments)} }}\n"
    check(text)


@pytest.mark.parametrize("case", CASES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_golden_scenes_keep_their_meaning(case):
    text = case.read_text(errors="replace").partition("----\n")[0]
    result = formatted(text)
    assert formatted(result) == result
    assert meaning(result) == meaning(text)


def shaken(text: str, seed: int) -> str:
    """``text`` with other white space and comments between its tokens, wherever that can't change what it says."""
    chance = random.Random(seed)
    parts = []
    for token in TOKEN.findall(text):
        if not token.isspace():
            parts.append(token)
        elif "\n" in token or chance.random() < 0.7:
            parts.append(chance.choice(["\n", "\n\n\n", "  \n", " // c\n\t", "\r\n"]) if "\n" in token else chance.choice(["  ", "\t", " /* c */ "]))
        else:
            parts.append(chance.choice([" ", "\n", "\n    "]))
    return "".join(parts)


@settings(max_examples=60, deadline=None)
@given(scenes(), st.integers(0, 2**32))
def test_random_scenes_keep_their_meaning(text, seed):
    check(text)
    check(shaken(text, seed))


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_shaken_scenes_keep_their_meaning(scene):
    for seed in range(5):
        check(shaken(scene.read_text(), seed))


# --- ranges


def test_a_range_is_formatted_by_lines():
    text = b"Calculation C {\n  n=1;\n  m=2;\n  k=3;\n}\n"
    document = Document(None, text)
    start = text.index(b"m=")
    found = format_document(document, start, start + 1)
    assert found.data == b"Calculation C {\n  n=1;\n    m = 2;\n  k=3;\n}\n"
