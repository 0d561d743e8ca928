"""``plsys graph``: the files it writes, its JSON, and what it says of bad requests."""

from __future__ import annotations

import json
from xml.etree import ElementTree

from plsys.compiler.cli import main


def test_svg_and_dot(tmp_path):
    for name, start in (("tree.svg", "<svg"), ("tree.dot", 'digraph "tree"')):
        assert main(["graph", "scenes/tree.plsys", "-o", str(tmp_path / name)]) == 0
        assert (tmp_path / name).read_text().startswith(start)
    ElementTree.parse(tmp_path / "tree.svg")


def test_json_counts_nodes_and_cycles(tmp_path, capsys):
    assert main(["graph", "scenes/tree.plsys", "-o", str(tmp_path / "tree.svg"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["cycles"] == 3 and facts["nodes"]["S"] == 1 and facts["nodes"]["C"] == 3


def test_an_unknown_format_is_one_message_and_no_file(tmp_path, capsys):
    assert main(["graph", "scenes/tree.plsys", "-o", str(tmp_path / "tree.bmp")]) == 2
    assert "don't know the format '.bmp'" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_scene_with_errors_leaves_no_file(tmp_path, capsys):
    (tmp_path / "bad.plsys").write_text("object { Missing }")
    assert main(["graph", str(tmp_path / "bad.plsys"), "-o", str(tmp_path / "bad.svg")]) == 2
    assert "Missing" in capsys.readouterr().err
    assert not (tmp_path / "bad.svg").exists()
