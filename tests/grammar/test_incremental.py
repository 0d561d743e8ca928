"""Parsing again after an edit gives the tree of a fresh parse, and no text stops the parser."""

from __future__ import annotations

import random
from pathlib import Path

from stress import rounds

from plsys.compiler.reading.grammar import syntax_tree

ROOT = Path(__file__).resolve().parents[2]
SCENES = [scene for scene in sorted((ROOT / "scenes").glob("*.plsys")) if scene.stat().st_size]
PIECES = (
    "Selection A { A -> box; }", "Calculation C { --n; }", "#declare X = 1;", "camera { angle 45 }", "if (n > 0) ", "else ", "{", "}",
    "(", ")", "[", "]", "<", ">", ";", ",", "->", "=>", "=", "+", "-", "*", "|", ":", '"', "/*", "*/", "//", "#", "#while (1)", "@", "é",
    "\n", "\r\n", "\r", "\t", " ", "0", "1.5", ".5", "2x", "name", "Selection", "Parameter", "texture {", "\0", "\U0001f333", "\ufeff",
)  # fmt: skip


def point(data: bytes, offset: int) -> tuple[int, int]:
    return data.count(b"\n", 0, offset), offset - (data.rfind(b"\n", 0, offset) + 1)


def edited(data: bytes, rng: random.Random) -> tuple[bytes, int, int, int]:
    """The text after a random edit, with the edit's start, old end and new end."""
    start = rng.randrange(len(data) + 1)
    end = min(len(data), start + rng.choice((0, 0, 0, 1, 1, 2, 5, 40)))
    piece = "" if rng.random() < 0.3 else rng.choice(PIECES)
    if rng.random() < 0.2:
        at = rng.randrange(len(data) + 1)
        piece = data[at : at + rng.randrange(30)].decode(errors="ignore")
    new = piece.encode()
    return data[:start] + new + data[end:], start, end, start + len(new)


def ranges(tree) -> list[tuple[str, int, int]]:
    found, cursor = [], tree.walk()
    while True:
        found.append((cursor.node.type, cursor.node.start_byte, cursor.node.end_byte))
        if cursor.goto_first_child() or cursor.goto_next_sibling():
            continue
        while cursor.goto_parent():
            if cursor.goto_next_sibling():
                break
        else:
            return found


def test_incremental_parses_are_fresh_parses():
    rng = random.Random(20)
    count = rounds(ci=10_000, stress=1_000_000)
    data = tree = None
    for i in range(count):
        if i % 40 == 0:  # a fresh piece of a scene: after many edits all text is noise
            scene = rng.choice(SCENES).read_bytes()
            at = rng.randrange(len(scene))
            data = scene[at : at + 500]
            tree = syntax_tree(data)
        after, start, end, new_end = edited(data, rng)
        tree.edit(start, end, new_end, point(data, start), point(data, end), point(after, new_end))
        tree, fresh = syntax_tree(after, tree), syntax_tree(after)
        assert str(tree.root_node) == str(fresh.root_node), (data, start, end, after)
        if i % 10 == 0:
            assert ranges(tree) == ranges(fresh), (data, start, end, after)
        data = after
