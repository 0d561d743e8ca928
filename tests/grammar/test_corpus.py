"""The grammar's corpus (grammar/test/corpus), run without tree-sitter's command line.

A case is a title between lines of ``=``, a text, a line of ``-`` and the tree with field names; with `:error`
under its title only that the tree has an error. ``PLSYS_BLESS=1`` rewrites the trees.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

import pytest

from plsys.compiler.reading.grammar import language, syntax_tree

GRAMMAR = Path(__file__).resolve().parents[2] / "grammar"
CORPUS = sorted((GRAMMAR / "test/corpus").glob("*.txt"))
CASE = re.compile(
    r"={80}\n(?P<title>[^\n]*)\n(?P<flags>(?::\w+\n)*)={80}\n\n(?P<text>.*?)\n\n-{80}\n(?P<tree>[^=]*)",
    re.DOTALL,
)


class Case(NamedTuple):
    file: str
    title: str
    flags: str
    text: str
    tree: str


def cases(path: Path) -> list[Case]:
    return [Case(path.stem, *match.groups()) for match in CASE.finditer(path.read_text())]


def tree_text(text: str) -> str:
    """The tree as the command line writes it: one node a line, indented by two."""
    flat = str(syntax_tree(text.encode()).root_node)
    lines, depth, start = [], 0, 0
    for match in re.finditer(r"(?:\w+: )?\((?:MISSING |UNEXPECTED )?(?:\"[^\"]*\"|'[^']*'|\w+)|\)", flat):
        if match[0] == ")":
            depth -= 1
            lines[-1] += ")"
        else:
            lines.append("  " * depth + match[0])
            depth += 1
        start = match.end()
    assert start == len(flat) and depth == 0
    return "\n".join(lines)


QUERIES = sorted(path for path in (GRAMMAR / "queries").rglob("*.scm"))
ALL = [case for path in CORPUS for case in cases(path)]


def test_corpus_is_complete() -> None:
    """Every header in the files is a case that this module runs."""
    headers = sum(path.read_text().count("=" * 80) for path in CORPUS)
    assert headers == 2 * len(ALL) > 80


@pytest.mark.parametrize("case", ALL, ids=lambda case: f"{case.file}: {case.title}")
def test_case(case: Case) -> None:
    root = syntax_tree(case.text.encode()).root_node
    assert root.has_error == (":error" in case.flags)
    if not root.has_error and not os.environ.get("PLSYS_BLESS"):
        assert tree_text(case.text) == case.tree.strip()


def test_bless() -> None:
    """With PLSYS_BLESS=1, write the trees; without it, the files are as this would write them."""
    for path in CORPUS:
        parts = []
        for case in cases(path):
            tree = "" if case.flags else tree_text(case.text) + "\n\n"
            parts.append(
                f"{'=' * 80}\n{case.title}\n{case.flags}{'=' * 80}\n\n{case.text}\n\n{'-' * 80}\n\n{tree}"
            )
        text = "\n".join(part.rstrip("\n") + "\n" for part in parts)
        if os.environ.get("PLSYS_BLESS"):
            path.write_text(text)
        assert path.read_text() == text


@pytest.mark.parametrize("path", QUERIES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_queries_fit_the_grammar(path: Path) -> None:
    """Every query names only nodes and fields that exist, and finds something in a scene."""
    from tree_sitter import Query, QueryCursor

    scene = (GRAMMAR.parent / "scenes/tree.plsys").read_bytes()
    text = path.read_text()
    if path.parent.name == "emacs":  # its predicates are its own
        text = re.sub(r"\(#\w+ (?:\"[^\"]*\"|@[\w.-]+)\s+(?:\"[^\"]*\"|@[\w.-]+)\)", "", text)
    captures = QueryCursor(Query(language(), text)).captures(syntax_tree(scene).root_node)
    assert captures


def test_highlights_tell_what_things_are() -> None:
    from tree_sitter import Query, QueryCursor

    text = b"""Selection Tree { if (n > 0) Tree -> C_x T_y cylinder; } // end
        Parameter n = 1 "age";
        camera { angle 45 }"""
    query = Query(language(), (GRAMMAR / "queries/highlights.scm").read_text())
    captures = QueryCursor(query).captures(syntax_tree(text).root_node)
    found = {
        name: {text[node.start_byte : node.end_byte].decode() for node in nodes}
        for name, nodes in captures.items()
    }
    assert {"Selection", "Parameter"} <= found["keyword"] and "if" in found["keyword.conditional"]
    assert "Tree" in found["type.definition"]
    assert found["comment"] == {"// end"} and found["string"] == {'"age"'}
    assert {"0", "1", "45"} <= found["number"] and {"->", ">"} <= found["operator"]
    assert "camera" in found["type"] and "angle" in found["property"]


@pytest.mark.parametrize("editor, words", [
    ("neovim", "@comment @string @number @keyword @keyword.conditional @keyword.directive @type @type.definition @type.builtin @function "
     "@function.call @function.builtin @constant @constant.builtin @variable @variable.parameter @property @operator @punctuation.bracket "
     "@punctuation.delimiter"),
    ("helix", "@comment @string @constant.numeric @keyword @keyword.control.conditional @keyword.directive @type @type.builtin @function "
     "@function.builtin @constant @constant.builtin @variable @variable.parameter @variable.other.member @operator @punctuation.bracket "
     "@punctuation.delimiter"),
])  # fmt: skip
def test_highlights_use_the_editors_words(editor, words):
    text = (GRAMMAR / "queries" / editor / "highlights.scm").read_text()
    assert set(re.findall(r"@[\w.]+", text)) == set(words.split())


def test_emacs_captures_are_faces():
    text = (GRAMMAR / "queries/emacs/highlights.scm").read_text()
    # The elisp manual, "Faces for Font Lock" (Emacs 29).
    faces = (
        "warning doc doc-markup comment comment-delimiter string keyword builtin preprocessor function-name function-call variable-name"
        " variable-use type constant number operator property-name property-use punctuation bracket delimiter misc-punctuation"
        " negation-char escape regexp"
    ).split()
    assert set(re.findall(r"@[\w.-]+", text)) <= {f"@font-lock-{face}-face" for face in faces}
    assert "#any-of" not in text and "#eq?" not in text


@pytest.mark.parametrize("path", [path for path in QUERIES if path.stem == "highlights"], ids=lambda path: path.parent.name)
def test_every_name_of_every_scene_has_a_colour(path: Path) -> None:
    """Also where a word has two meanings, the last pattern that fits knows which: properties are in blocks only."""
    from tree_sitter import Query, QueryCursor

    text = re.sub(r'\(#match "\^\\\\\(\?:(.*?)\\\\\)\$" (@[\w-]+)\)', in_words, path.read_text())
    query = Query(language(), text.replace("#equal", "#eq?"))
    for scene in (GRAMMAR.parent / "scenes").glob("*.plsys"):
        root = syntax_tree(scene.read_bytes()).root_node
        last: dict[int, tuple[int, str]] = {}
        for pattern, captures in QueryCursor(query).matches(root):
            for name, nodes in captures.items():
                for node in nodes:
                    last[node.id] = max(last.get(node.id, (-1, "")), (pattern, name))
        waiting, operations = [root], set()
        while waiting:
            node = waiting.pop()
            waiting += node.children
            if node.type == "name":
                assert node.id in last, node.text
            if node.type == "operation" and (name := node.child_by_field_name("name")) is not None:
                operations.add(last[name.id][1])
        assert len(operations) <= 1 and not operations & {"property", "variable.other.member", "font-lock-property-name-face"}


def in_words(match: re.Match[str]) -> str:
    words = " ".join(f'"{word}"' for word in match[1].split(r"\\|"))
    return f"(#any-of? {match[2]} {words})"
