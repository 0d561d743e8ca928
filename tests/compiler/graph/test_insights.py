"""Insights: forecasts of symbols, runs of guards and values, against a derivation that shares nothing, and against the
unfolder."""

from __future__ import annotations

import math
from collections import Counter, defaultdict

import pytest
from hypothesis import HealthCheck, given, settings
from plsys.compiler.elementary import seed_key
from plsys.compiler.export.unfold import unfold
from plsys.compiler.graph import graph as g
from plsys.compiler.graph.evaluate import Scope, calculate, choose, evaluate, transform
from plsys.compiler.graph.insights import insights
from plsys.compiler.graph.lower import lower
from plsys.compiler.graph.matrices import determinant, is_singular
from plsys.compiler.graph.passes.dead import dead_parameters
from plsys.compiler.graph.states import objects_of, seed_of
from plsys.compiler.pipeline import build_graph, build_model
from plsys.compiler.reading.model import Constant
from plsys.compiler.reading.parse import parse
from plsys.compiler.reading.resolve import resolve
from plsys.compiler.reading.source import Source
from random_scenes import scenes

FIGURE_2_1 = """\
object { Tree }
Selection Tree
{
    C_initialize Tree;
    if (cntTrunk > 0)     Tree -> T_scaleCyl cylinder + C_Trunk T_shiftTrunk Tree;
    else if (cntTree > 0) Tree -> T_scaleCyl cylinder + C_Tree (T_attach_Branch1 Tree + T_attach_Branch2 Tree);
    else                  Tree -> T_scaleCyl cylinder;
}
Calculation    C_initialize { cntTree = 10; cntTrunk = 2; betaBr = 60.0; }
Calculation    C_Trunk      { --cntTrunk; }
Calculation    C_Tree       { --cntTree; betaBr -= 4.0; }
Transformation T_scaleCyl   { scale 0.15 0.15 2; }
Transformation T_shiftTrunk { trans 0 0 1.99; }
Transformation T_attach_Branch1 { trans 0 0 1.99; roty betaBr; scale 0.8 0.8 0.8; }
Transformation T_attach_Branch2 { trans 0 0 1.99; roty -betaBr; rotz 90; scale 0.8 0.8 0.8; }
"""


def model_of(text: str):
    model, diagnostics = build_model(Source.from_text(text))
    assert not diagnostics.has_errors, [str(each.message) for each in diagnostics.items]
    return model


def insights_of(text: str):
    file, diagnostics = parse(Source.from_text(text))
    model = resolve(file, diagnostics)
    assert not diagnostics.has_errors
    return insights(model)


def symbol_of(text: str, name: str):
    return next(each for each in insights_of(text).symbols if each.name == name)


def values_of(text: str) -> dict[str, tuple[float, float]]:
    return {each.span.text: (each.first, each.last) for each in insights_of(text).values}


def test_figure_2_1():
    found = insights_of(FIGURE_2_1)
    (tree,) = found.symbols
    assert tree.primitives == (2049, 2049) and tree.kinds == {"cylinder": (2049, 2049)}
    assert tree.depth == 13 and tree.instances == (1, 1) and tree.alike
    assert tree.scale == pytest.approx((0.8, 1.0))
    assert {each.span.text: (each.path, each.total) for each in found.guards} == {
        "cntTrunk > 0": (2, (2, 2)), "cntTree > 0": (10, (1023, 1023)),
    }
    values = values_of(FIGURE_2_1)
    assert values["betaBr"] == (56, 20) and values["-betaBr"] == (-56, -20) and values["--cntTree;"] == (9, 0)


def test_a_large_order_is_counted_exactly():
    tree = symbol_of(FIGURE_2_1.replace("cntTree = 10", "cntTree = 1000"), "Tree")
    assert tree.primitives[0] == 2**1001 - 1 + 2 and tree.depth == 1003


def test_draws_give_bounds_and_an_expectation():
    text = "object { A }\nSelection A { [ n = 3 ] A; if (n > 0) A -> 3: box + [ --n ] A | 1: sphere; else A -> ; }\n"
    text = text.replace("[ n = 3 ] A;", "C_a A;") + "Calculation C_a { n = 3; }\n"
    found = insights_of(text)
    (symbol,) = found.symbols
    assert symbol.primitives == (1, 3) and symbol.kinds == {"box": (0, 3), "sphere": (0, 1)}
    # 1 · 1/4 + (1 + …) · 3/4 three times: boxes 3/4 + 9/16 + 27/64, spheres 1 - 27/64
    assert symbol.expected == pytest.approx(0.75 + 0.5625 + 0.421875 + 1 - 0.421875)
    (guard,) = found.guards
    assert guard.path == 3 and guard.total == (1, 3)
    shares = [each.first for each in found.values if each.kind == "share"]
    assert not any(each.certain for each in found.values if each.kind == "assign" and each.low != each.high)
    assert [(each.low, each.high) for each in found.values if each.kind == "share"] == [(0.75, 0.75), (0.25, 0.25)]
    assert len(shares) == 2


def test_a_drawn_angle_has_bounds():
    text = "object { A }\nSelection A { A -> [ roty 18 + 14*rand(0) ] box; }\n"
    (value,) = insights_of(text).values
    assert not value.certain and (value.low, value.high) == pytest.approx((18, 32))


def test_a_recursion_without_end_that_contracts():
    text = "object { A }\nSelection A { A -> sphere + [ trans 0 0 1; scale 0.5 ] A; }\n"
    (symbol,) = insights_of(text).symbols
    assert symbol.primitives == (None, None) and symbol.depth is None and symbol.scale == pytest.approx((0.5, 0.5))


def test_scale_through_another_symbol():
    text = """object { A }
Selection A { C_a A; if (n > 0) A -> [ scale 0.5 ] B; else A -> box; }
Selection B { B -> [ --n; scale 0.5 ] A; }
Calculation C_a { n = 3; }
"""
    assert symbol_of(text, "A").scale == pytest.approx((0.25, 0.25))


def test_instances_of_a_helper():
    text = "object { A }\nSelection A { A -> B + [ trans 1 0 0 ] B + B; }\nSelection B { B -> box + sphere; }\n"
    helper = symbol_of(text, "B")
    assert helper.instances == (3, 3) and helper.alike and helper.primitives == (2, 2)


# --- against other derivations


class Derivation:
    """Every instance by itself, with the compiler's exact values: what insights must agree with."""

    def __init__(self, model) -> None:
        self.graph = lower(model)
        dead_parameters(self.graph)
        self.guards: Counter = Counter()
        self.paths: Counter = Counter()
        self.values: dict = defaultdict(lambda: defaultdict(set))  # place → depth → values
        self.largest: dict[str, list[int]] = defaultdict(list)
        self.scales: dict[str, list[float]] = defaultdict(list)  # from each instance to the next of its symbol below
        for node in objects_of(self.graph):
            placed = self.graph.nodes[node]
            scope = Scope.of_object(seed_key(seed_of(self.graph)), placed.name, placed.ordinal)
            self.walk(placed.child, scope, 0, Counter(), {})

    def note(self, span, depth: int, value: float) -> None:
        if span is not None:
            self.values[span.start, span.end][depth].add(value)

    def walk(self, index: int, scope: Scope, depth: int, held: Counter, shrunk: dict[str, float]) -> int:
        """The primitives below. ``shrunk``: each symbol's log |determinant| since it was entered last."""
        node = self.graph.nodes[index]
        match node:
            case g.Primitive():
                for argument in node.arguments:
                    value = evaluate(argument, scope)
                    if not isinstance(argument, Constant):
                        self.note(argument.span, depth, value)
                return 1
            case g.Branch():
                taken = evaluate(node.test, scope) != 0
                if taken:
                    place = node.test.span.start, node.test.span.end
                    held = held + Counter([place])
                    self.guards[place] += 1
                    self.paths[place] = max(self.paths[place], held[place])
                return self.walk(node.then if taken else node.otherwise, scope, depth, held, shrunk)
            case g.Choose():
                return self.walk(choose(node, scope), scope, depth, held, shrunk)
            case g.Calculate():
                calculate(node, scope)
                # Each parameter's last assignment is what the scope holds.
                for statement in {s.parameter: s for s in node.statements if hasattr(s, "parameter")}.values():
                    self.note(statement.span or statement.value.span, depth, scope.values[statement.parameter])
            case g.Transform() | g.TransformCode():
                if isinstance(node, g.TransformCode):
                    before = scope.copy()
                    for step in node.steps:
                        for argument in step.arguments:
                            value = evaluate(argument, before)
                            if not isinstance(argument, Constant):
                                self.note(argument.span, depth, value)
                matrix = node.matrix if isinstance(node, g.Transform) else transform(node, scope)
                if is_singular(matrix):
                    return 0
                shrunk = {name: value + math.log(abs(determinant(matrix))) for name, value in shrunk.items()}
            case g.Union():
                return sum(self.walk(child, scope.term(i), depth, held, shrunk) for i, child in enumerate(node.children_))
            case g.Enter():
                symbol = self.graph.nodes[node.symbol]
                if symbol.name in shrunk:
                    self.scales[symbol.name].append(math.exp(shrunk[symbol.name] / 3))
                below = {**shrunk, symbol.name: 0.0}
                total = self.walk(symbol.body, scope.entered(symbol.name), depth + 1, held, below)
                self.largest[symbol.name].append(total)
                return total
            case g.Texture() if node.draws:
                raise AssertionError("liveness has not run")
        return sum(self.walk(child, scope, depth, held, shrunk) for child in node.children())


def inside(value: float, low: float, high: float) -> bool:
    slack = 1e-9 * max(1.0, abs(value))
    return low - slack <= value <= high + slack


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(scenes())
def test_random_scenes_against_every_instance(text):
    model = model_of(text.replace("0.1*n, 0.5, p/10", "0.1, 0.5, 0.1"))  # colours that draw move what is drawn after them
    found = insights(model)
    real = Derivation(model)
    # Where a draw decides which instances there are, the largest one may be missing.
    certain = all(each.instances[0] == each.instances[1] for each in found.symbols)
    for symbol in found.symbols:
        low, high = symbol.primitives
        assert max(real.largest[symbol.name], default=0) <= high
        if low == high and certain:
            assert max(real.largest[symbol.name]) == high
        scales = real.scales[symbol.name]
        assert not scales or all(inside(each, *symbol.scale) for each in scales)
        if scales and certain and "rand" not in text:
            assert (min(scales), max(scales)) == pytest.approx(symbol.scale)
    for guard in found.guards:
        place = guard.span.start, guard.span.end
        assert guard.total[0] <= real.guards[place] <= guard.total[1]
        assert real.paths[place] <= guard.path
        if guard.total[0] == guard.total[1] and not any(s.primitives[0] != s.primitives[1] for s in found.symbols):
            assert real.paths[place] == guard.path
    for value in found.values:
        levels = real.values.get((value.span.start, value.span.end))
        if levels is None or value.kind == "share":
            continue
        assert all(inside(v, value.low, value.high) for several in levels.values() for v in several)
        if value.certain:
            assert levels[min(levels)] == {value.first} and levels[max(levels)] == {value.last}


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(scenes())
def test_random_scenes_against_the_unfolder(text):
    text = "\n".join(line for line in text.splitlines() if not line.startswith("object { Q"))
    model = model_of(text)
    start = next(each for each in insights(model).symbols if each.name == "S")
    kinds: Counter = Counter()
    depth = 0
    for batch in unfold(build_graph(model)):
        rows = batch.symbol >= 0
        kinds.update(kind for kind, counts in zip(batch.kinds, rows) if counts)
        depth = max(depth, int(batch.depth.max(initial=0)))
    total = sum(kinds.values())
    assert start.primitives[0] <= total <= start.primitives[1]
    assert depth <= start.depth
    for kind, (low, high) in start.kinds.items():
        assert low <= kinds[kind] <= high
    assert kinds.keys() <= start.kinds.keys()
