"""The way from a scene's text to bytecode, with all that lies between: read → parse → resolve → check → lower →
passes → encode.

Example::

    compilation = build("scenes/tree.plsys", parameters={"order": 12})
    print(compilation.graph)
    data = compilation.encode()
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .graph.graph import Graph, LeftOut
from .reading.diagnostics import Diagnostic, Diagnostics, PlsysError, SceneError
from .reading.ignore import kept
from .reading.model import Model
from .reading.source import Source

if TYPE_CHECKING:
    from .graph.forecast import Forecast

# Nested Python calls while compiling; an expression nested deeper than some thousands isn't a scene.
RECURSION_LIMIT = 20_000


@dataclass
class Compilation:
    """A scene that has no errors. ``diagnostics`` holds its warnings and infos in file order."""

    source: Source
    model: Model
    graph: Graph
    diagnostics: list[Diagnostic]

    @property
    def left_out(self) -> list[LeftOut]:
        """What the passes removed because the scene doesn't need it."""
        return self.graph.left_out

    def encode(self, sourcemap: bool = True) -> bytes:
        """The bytecode. PlsysError if the scene exceeds a limit of the format."""
        from .bytecode.encode import encode

        with deep_nesting(self.source.name):
            return encode(self.graph, sourcemap)


def build(
    scene: str | Path | Source, parameters: Mapping[str, float] | None = None, seed: float | None = None
) -> Compilation:
    """Compile a file (a path, or a Source) as far as the graph after all passes.

    ``parameters`` sets the scene's ``Parameter`` inputs, ``seed`` replaces global_settings' seed. Raises SceneError
    with every diagnostic of a scene that has errors, PlsysError for a file that can't be read."""
    from .graph.limits import check_limits

    source = read(scene)
    with deep_nesting(source.name):
        model, diagnostics = build_model(source, parameters, seed)
        if diagnostics.has_errors:
            raise SceneError(diagnostics.sorted())
        graph = build_graph(model)
        check_limits(graph, diagnostics)
        if diagnostics.has_errors:
            raise SceneError(diagnostics.sorted())
    return Compilation(source, model, graph, kept(diagnostics.sorted()))


def diagnose(
    scene: str | Path | Source, parameters: Mapping[str, float] | None = None, seed: float | None = None
) -> tuple[list[Diagnostic], Compilation | None, Forecast | None]:
    """Everything that there is to say about a scene, as `plsys check` does; the compilation and its forecast are None
    where it has errors. PlsysError for a file that can't be read."""
    from .graph.forecast import forecast

    try:
        compilation = build(scene, parameters, seed)
    except SceneError as error:
        return kept(error.diagnostics), None, None
    prediction = forecast(compilation.graph)
    return [*compilation.diagnostics, *kept(prediction.diagnostics)], compilation, prediction


def build_model(
    source: Source, parameters: Mapping[str, float] | None = None, seed: float | None = None
) -> tuple[Model, Diagnostics]:
    """The model of what could be understood of a scene, and every message about it."""
    from .reading.check import check
    from .reading.parse import parse
    from .reading.resolve import resolve

    file, diagnostics = parse(source)
    model = resolve(file, diagnostics, parameters=dict(parameters or {}), seed=seed)
    if not diagnostics.has_errors:
        check(model, diagnostics)
    return model, diagnostics


def read(scene: str | Path | Source) -> Source:
    if isinstance(scene, Source):
        return scene
    try:
        return Source.read(scene)
    except (OSError, ValueError) as error:
        raise PlsysError(f"can't be read: {getattr(error, 'strerror', None) or error}", str(scene)) from None


def build_graph(model: Model, is_verified: bool = True) -> Graph:
    """The graph of a model without errors, after all passes. Unless ``is_verified``, it isn't looked for mistakes of ours:
    where nothing is drawn from it and time counts. Where there is one, the passes run once more, to tell which makes it."""
    from .graph.lower import lower
    from .graph.passes import run_passes
    from .graph.verify import InvalidGraph, verify

    graph = run_passes(lower(model), is_verified=False)
    if is_verified:
        try:
            verify(graph, "all passes")
        except InvalidGraph:
            run_passes(lower(model))
            raise
    return graph


@contextmanager
def deep_nesting(place: str) -> Iterator[None]:
    """Room for deeply nested expressions; what exceeds even that is one clear error."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(max(before, RECURSION_LIMIT))
    try:
        yield
    except RecursionError:
        raise PlsysError("an expression is nested too deeply", place) from None
    finally:
        sys.setrecursionlimit(before)
