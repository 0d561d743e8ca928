"""A diagram → an SVG picture, drawn without Graphviz.

Circles carry the paper's letters, names stand to their right, guards stand on the edges, and the edges that
close a cycle are led around the outside in colour.

Example: ``Path("tree.svg").write_text(svg(diagram(graph)))``
"""

from __future__ import annotations

from html import escape

from .drawing import Diagram, Edge, Node
from .layout import Layout, layout

RADIUS = 16.0
CHARACTER = 6.6  # width of a character of a label, at 12 points
MARGIN = 28.0
LANE = 14.0  # between the paths of two cycles

COLOURS = {"S": "#d7e8c8", "C": "#fbe3b5", "T": "#cfe0f5", "+": "#ffffff", "P": "#ecd3ea", "X": "#f6d1c4"}

STYLE = """\
  .edge { fill: none; stroke: #5b6470; stroke-width: 1.3; }
  .back { fill: none; stroke: #b0482e; stroke-width: 1.5; }
  .node { stroke: #2b3038; stroke-width: 1.3; }
  .letter { font: bold 15px Helvetica, Arial, sans-serif; text-anchor: middle; fill: #1d2127; }
  .name { font: 12px Helvetica, Arial, sans-serif; fill: #1d2127; }
  .guard { font: italic 12px Helvetica, Arial, sans-serif; fill: #474f59; text-anchor: middle; }
  .object { text-anchor: middle; }
  .halo { fill: #ffffff; stroke: #ffffff; stroke-width: 4; stroke-linejoin: round; }
  .head { fill: #5b6470; }
  .turn { fill: #b0482e; }"""


def svg(picture: Diagram, title: str = "") -> str:
    """The whole picture as one text."""
    placed = layout(picture, [_extent(picture, i) for i in range(len(picture.nodes))], _width)
    lanes = _lanes(picture, placed)
    left = min(
        [p[0] - _extent(picture, i)[0] for i, p in enumerate(placed.position)]
        + [x for x, _ in lanes.values()]
    )
    right = max(
        [p[0] + _extent(picture, i)[1] for i, p in enumerate(placed.position)]
        + [x for x, _ in lanes.values()]
    )
    bottom = max(y for _, y in placed.position) + 46
    width, height = right - left + 2 * MARGIN, bottom + RADIUS + 2 * MARGIN
    parts = []
    for index, (edge, bends) in enumerate(zip(picture.edges, placed.bends)):
        parts.append(
            _back(edge, placed, *lanes[index]) if edge.is_back else _edge(picture, edge, placed, bends)
        )
    for edge, bends in zip(picture.edges, placed.bends):
        parts.append(_text("guard", bends[0][0], bends[0][1] + 4, edge.label) if bends else "")
    parts += [_node(node, *at) for node, at in zip(picture.nodes, placed.position)]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="{left - MARGIN:.1f} {-RADIUS - MARGIN:.1f} {width:.1f} {height:.1f}">',
            f"<title>{escape(title)}</title>",
            f"<style>\n{STYLE}\n</style>",
            f'<rect x="{left - MARGIN:.1f}" y="{-RADIUS - MARGIN:.1f}" '
            'width="100%" height="100%" fill="#ffffff"/>',
            *parts,
            "</svg>",
            "",
        ]
    )


def _width(text: str) -> float:
    return CHARACTER * len(text)


def _extent(picture: Diagram, index: int) -> tuple[float, float]:
    """How far a node reaches to the left and to the right."""
    node = picture.nodes[index]
    if not node.letter:
        return _width(node.label) / 2 + 8, _width(node.label) / 2 + 8
    return RADIUS, RADIUS + (6 + _width(node.label) if node.label else 0)


def _node(node: Node, x: float, y: float) -> str:
    if not node.letter:
        half = _width(node.label) / 2 + 8
        return (
            f'<rect class="node" x="{x - half:.1f}" y="{y - 12:.1f}" width="{2 * half:.1f}" height="24" '
            f'rx="5" fill="#f3f4f6"/>'
            f'<text class="name object" x="{x:.1f}" y="{y + 4:.1f}">{escape(node.label)}</text>'
        )
    name = _text("name", x + RADIUS + 5, y + 4, node.label)
    return (
        f'<circle class="node" cx="{x:.1f}" cy="{y:.1f}" r="{RADIUS}" fill="{COLOURS[node.letter]}"/>'
        f'<text class="letter" x="{x:.1f}" y="{y + 5.3:.1f}">{escape(node.letter)}</text>{name}'
    )


def _edge(picture: Diagram, edge: Edge, placed: Layout, bends: list[tuple[float, float]]) -> str:
    """A smooth line through the bends, from circle to circle."""
    start, end = placed.position[edge.source], placed.position[edge.target]
    first, last = (bends or [end])[0], (bends or [start])[-1]
    start_reach = RADIUS if picture.nodes[edge.source].letter else 12.0
    end_reach = RADIUS if picture.nodes[edge.target].letter else 12.0
    points = [_towards(start, first, start_reach), *bends, _towards(end, last, end_reach + 1)]
    path = f"M{points[0][0]:.1f},{points[0][1]:.1f}"
    for (ax, ay), (bx, by) in zip(points, points[1:]):
        bend = (by - ay) * 0.4 if bends else 0.0
        path += f" C{ax:.1f},{ay + bend:.1f} {bx:.1f},{by - bend:.1f} {bx:.1f},{by:.1f}"
    return f'<path class="edge" d="{path}"/>' + _head("head", points[-1], _towards(end, last, end_reach + 20))


def _head(style: str, tip: tuple[float, float], behind: tuple[float, float]) -> str:
    """An arrow's head; drawn out because not every viewer places SVG's markers well."""
    dx, dy = _towards((0.0, 0.0), (behind[0] - tip[0], behind[1] - tip[1]), 1.0)
    ax, ay = tip[0] + 8 * dx, tip[1] + 8 * dy
    corners = (tip, (ax - 3.6 * dy, ay + 3.6 * dx), (ax + 3.6 * dy, ay - 3.6 * dx))
    return f'<polygon class="{style}" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in corners)}"/>'


def _text(style: str, x: float, y: float, text: str) -> str:
    """A label with a white rim, so that lines behind it don't disturb."""
    if not text:
        return ""
    place = f'x="{x:.1f}" y="{y:.1f}">{escape(text)}</text>'
    return f'<text class="{style} halo" {place}<text class="{style}" {place}'


def _towards(
    origin: tuple[float, float], target: tuple[float, float], distance: float
) -> tuple[float, float]:
    dx, dy = target[0] - origin[0], target[1] - origin[1]
    length = (dx * dx + dy * dy) ** 0.5 or 1.0
    return origin[0] + dx / length * distance, origin[1] + dy / length * distance


def _lanes(picture: Diagram, placed: Layout) -> dict[int, tuple[float, float]]:
    """For each back edge the x of its way up, outside of everything between its ends, on the nearer side; and
    how far below its source it turns."""
    lanes: dict[int, tuple[float, float]] = {}
    taken = {-1: 0, 1: 0}
    turns: dict[int, int] = {}
    backs = [i for i, e in enumerate(picture.edges) if e.is_back]
    backs.sort(key=lambda i: placed.layer[picture.edges[i].source] - placed.layer[picture.edges[i].target])
    for index in backs:
        edge = picture.edges[index]
        top, bottom = placed.layer[edge.target], placed.layer[edge.source]
        xs = [
            bound
            for i, (x, _) in enumerate(placed.position)
            if top <= placed.layer[i] <= bottom
            for bound in (x - _extent(picture, i)[0], x + _extent(picture, i)[1])
        ]
        x = placed.position[edge.source][0]
        side = -1 if x - min(xs) <= max(xs) - x else 1
        taken[side] += 1
        turns[bottom] = turns.get(bottom, 0) + 1
        reach = LANE * taken[side] + 6
        lanes[index] = (min(xs) - reach if side < 0 else max(xs) + reach), RADIUS + 6.0 * turns[bottom] + 2
    return lanes


def _back(edge: Edge, placed: Layout, lane: float, drop: float) -> str:
    """Down out of the source, around the outside between the layers, and into the target from above."""
    (sx, sy), (tx, ty) = placed.position[edge.source], placed.position[edge.target]
    side = -1 if lane < sx else 1
    corner = 8.0
    floor, ceiling = sy + drop, ty - RADIUS - 10
    entry = tx + side * 10
    tip = entry, ty - (RADIUS**2 - 100) ** 0.5 - 1
    path = (
        f"M{sx:.1f},{sy + RADIUS:.1f} L{sx:.1f},{floor - corner + 2:.1f} "
        f"Q{sx:.1f},{floor:.1f} {sx + side * corner:.1f},{floor:.1f} "
        f"L{lane - side * corner:.1f},{floor:.1f} Q{lane:.1f},{floor:.1f} {lane:.1f},{floor - corner:.1f} "
        f"L{lane:.1f},{ceiling + corner:.1f} "
        f"Q{lane:.1f},{ceiling:.1f} {lane - side * corner:.1f},{ceiling:.1f} "
        f"L{entry + side * corner:.1f},{ceiling:.1f} Q{entry:.1f},{ceiling:.1f} {tip[0]:.1f},{tip[1]:.1f}"
    )
    return f'<path class="back" d="{path}"/>' + _head("turn", tip, (entry, tip[1] - 1))
