"""`plsys-ignore` comments."""

from __future__ import annotations

import pytest
from model_text import read

from plsys.compiler.reading.ignore import kept

UNUSED = "Transformation T { scale 2; }"


def codes(text: str) -> list[str]:
    dull = ("no-camera", "no-light", "no-object")
    return [each.code for each in kept(read(text)[1].sorted()) if each.code not in dull]


@pytest.mark.parametrize(
    "text",
    [
        f"// plsys-ignore: unused\n{UNUSED}",
        f"{UNUSED} // plsys-ignore: unused",
        f"{UNUSED} // plsys-ignore: singular, unused",
        f"/* plsys-ignore: unused */ {UNUSED}",
        f"// plsys-ignore: unused\n\n// another comment\n{UNUSED}",
        f"// plsys-ignore: unused\r{UNUSED}\r",
        f"sphere {{ 0, 1 }}\r\n  // plsys-ignore: unused\r\n  {UNUSED}\r\n",
        f"// plsys-ignore unused\n{UNUSED}",
    ],
)
def test_silenced(text):
    assert codes(text) == []


@pytest.mark.parametrize(
    "text",
    [
        f"// plsys-ignore: singular\n{UNUSED}",
        f"// plsys-ignore: unused\nsphere {{ 0, 1 }}\n{UNUSED}",
        f"sphere {{ 0, 1 }} // plsys-ignore: unused\n{UNUSED}",
        f'Parameter p = 1 "// plsys-ignore: unused"; {UNUSED} object {{ A }} Selection A {{ A -> cone(p); }}',
    ],
)
def test_not_silenced(text):
    assert codes(text) == ["unused"]


def test_errors_stay_and_the_comment_is_warned_of():
    assert codes("// plsys-ignore: unknown-name\nobject { Tree }") == ["ignore", "unknown-name"]


@pytest.mark.parametrize("comment", ["// plsys-ignore", "// plsys-ignore:", "// plsys-ignore: unsued", "/* plsys-ignore: x */"])
def test_comments_without_a_code_are_warned_of(comment):
    assert codes(f"sphere {{ 0, 1 }} {comment}") == ["ignore"]


def test_the_warning_about_a_comment_can_be_ignored_as_well():
    assert codes("sphere { 0, 1 } // plsys-ignore: nonsense, ignore") == []
