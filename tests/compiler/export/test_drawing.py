"""The graph's picture: its nodes, edges and cycles; a layout without overlaps; well-formed SVG and DOT."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest
from plsys.compiler.export.drawing import diagram, dot
from plsys.compiler.export.layout import layout
from plsys.compiler.export.svg import svg
from plsys.compiler.pipeline import build
from plsys.compiler.reading.source import Source

SCENES = ["tree", "palm", "tower", "menger", "bush", "conifer"]


def picture_of(scene: str):
    return diagram(build(f"scenes/{scene}.plsys").graph)


def test_the_tree_is_the_papers_figure_2_2():
    picture = picture_of("tree")
    letters = [node.letter for node in picture.nodes]
    assert letters.count("S") == 1 and letters.count("C") == 3 and letters.count("+") >= 3
    symbol = letters.index("S")
    back = [edge for edge in picture.edges if edge.is_back]
    assert [edge.target for edge in back] == [symbol] * 3
    sources = sorted(picture.nodes[edge.source].label for edge in back)
    assert sources == ["T_attach_Branch1", "T_attach_Branch2", "T_shiftTrunk"]
    assert [e.label for e in picture.edges if e.source == symbol] == ["cntTrunk > 0", "cntTree > 0", "else"]


@pytest.mark.parametrize("scene", SCENES)
def test_without_the_back_edges_there_is_no_cycle(scene):
    picture = picture_of(scene)
    below = {
        i: [e.target for e in picture.edges if e.source == i and not e.is_back]
        for i in range(len(picture.nodes))
    }
    placed = layout(picture, [(16, 40)] * len(picture.nodes), len)
    assert all(placed.layer[i] < placed.layer[child] for i, children in below.items() for child in children)


@pytest.mark.parametrize("scene", SCENES)
def test_nodes_of_a_layer_do_not_overlap(scene):
    picture = picture_of(scene)
    placed = layout(picture, [(16.0, 40.0)] * len(picture.nodes), lambda label: 6.0 * len(label))
    rows: dict[float, list[float]] = {}
    for x, y in placed.position:
        rows.setdefault(y, []).append(x)
    for row in rows.values():
        row.sort()
        assert all(b - a >= 56 for a, b in zip(row, row[1:]))


@pytest.mark.parametrize("scene", SCENES)
def test_svg_is_well_formed_and_shows_every_node_inside_its_frame(scene):
    picture = picture_of(scene)
    root = ElementTree.fromstring(svg(picture, scene))
    left, top, width, height = map(float, root.get("viewBox").split())
    names = {"s": "{http://www.w3.org/2000/svg}"}
    circles = root.findall(f".//{names['s']}circle")
    assert len(circles) == sum(bool(node.letter) for node in picture.nodes)
    for circle in circles:
        x, y = float(circle.get("cx")), float(circle.get("cy"))
        assert left < x < left + width and top < y < top + height


def test_dot_lists_all_nodes_and_edges():
    picture = picture_of("tree")
    text = dot(picture, 'a "tree"')
    assert text.startswith('digraph "a \\"tree\\"" {') and text.rstrip().endswith("}")
    assert len(re.findall(r"^  n\d+ \[", text, re.MULTILINE)) == len(picture.nodes)
    assert text.count("->") == len(picture.edges)


def test_names_of_textures_and_guards_are_escaped():
    text = "object { S }\nSelection S { C S; if (n < 3 && n > 1) S -> sphere; else S -> box; }\nCalculation C { n = rand(0)*4; }"
    markup = svg(diagram(build(Source.from_text(text)).graph))
    assert "n &lt; 3 &amp;&amp; n &gt; 1" in markup
    ElementTree.fromstring(markup)
