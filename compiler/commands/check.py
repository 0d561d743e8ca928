"""Check scenes: diagnostics, and a forecast of what they unfold to, without unfolding them.

Exit code 2 if a scene has errors; warnings and infos don't change it.
"""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from ..reading.diagnostics import Diagnostic, PlsysError
from ..reading.source import Source
from .common import add_input_arguments, json_integer, print_json, read_source, show_diagnostics

if TYPE_CHECKING:
    from ..graph.forecast import Forecast
    from ..pipeline import Compilation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", metavar="SCENE", nargs="+", help=".plsys files")
    add_input_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    files = [_check(path, arguments) for path in arguments.scenes]
    if arguments.json:
        print_json({"files": [file for file, _ in files]})
    return 2 if any(failed for _, failed in files) else 0


def _check(path: str, arguments: argparse.Namespace) -> tuple[dict, bool]:
    """The JSON entry of one file, and whether it has errors."""
    prediction = None
    try:
        source = read_source(path)
        diagnostics, compilation, prediction = check_scene(source, arguments.parameters, arguments.seed)
        prediction_json = compilation and _forecast_json(prediction, len(compilation.encode()))
    except PlsysError as error:
        if not arguments.json:
            print(f"{error.place}: error: {error.reason}", file=sys.stderr)
        place = {"line": 1, "column": 1, "end_line": 1, "end_column": 1}
        entry = {"path": path, "code": "unreadable", "severity": "error", "message": error.reason, **place, "hint": ""}
        return {"path": path, "diagnostics": [entry], "forecast": None}, True
    failed = any(d.severity == "error" for d in diagnostics)
    if not arguments.json:
        show_diagnostics(diagnostics)
        if prediction is not None and not failed:
            print(f"{path}: {_sentence(prediction)}")
    rows = [d.as_json() for d in diagnostics]
    return {"path": path, "diagnostics": rows, "forecast": None if failed else prediction_json}, failed


def check_scene(
    source: Source, parameters: dict[str, float] | None = None, seed: float | None = None
) -> tuple[list[Diagnostic], Compilation | None, Forecast | None]:
    """As pipeline.diagnose; of a scene with errors it is said what an editor would say."""
    from ..pipeline import diagnose

    found, compilation, prediction = diagnose(source, parameters, seed)
    if compilation is None:
        from ..analysis.saying import messages_about

        said = messages_about(source)
        if any(each.severity == "error" for each in said):  # else a limit, or a parameter, is what is wrong
            found = said
    return found, compilation, prediction


def _forecast_json(prediction, bytecode_bytes: int) -> dict:
    low, expected, high = prediction.primitives_range
    return {
        "primitives": json_integer(prediction.primitives),
        "by_kind": {kind: json_integer(count) for kind, count in prediction.by_kind.items()},
        "primitives_range": {
            "low": json_integer(low),
            "expected": expected if isinstance(expected, float) else json_integer(expected),
            "high": json_integer(high),
        },
        "states": json_integer(prediction.states),
        "depth": prediction.depth,
        "infinite": prediction.infinite,
        "bytecode_bytes": bytecode_bytes,
    }


def _sentence(prediction) -> str:
    """``2,049 cylinders, 13 states, depth 13``"""
    low, expected, high = prediction.primitives_range
    if prediction.infinite:
        counts = "endless (ended by the detail cut-off)"
    elif prediction.primitives is None:
        counts = _range(low, high) if expected is None else f"{_range(low, high)}, about {_short(expected)} expected"
    else:
        kinds = prediction.by_kind or {"primitive": prediction.primitives}
        counts = " and ".join(f"{_short(n)} {_plural(kind, n)}" for kind, n in kinds.items())
    states = "states not counted"
    if prediction.states is not None:
        states = f"{prediction.states:,} {_plural('state', prediction.states)}"
    depth = "no end to its depth" if prediction.depth is None else f"depth {prediction.depth:,}"
    return f"{counts}, {states}, {depth}"


def _range(low: int | None, high: int | None) -> str:
    if low is None:
        return "primitives not counted"
    if high is None:
        return f"{_short(low)} {_plural('primitive', low)} or more"
    return f"{_short(low)} to {_short(high)} primitives"


def _plural(kind: str, count: int) -> str:
    if count == 1:
        return kind
    return {"box": "boxes", "torus": "tori", "mesh": "meshes"}.get(kind, kind + "s")


def _short(count: float | int) -> str:
    """An integer with thousands' commas; a long one as its leading digits and its length."""
    if isinstance(count, float):
        return f"{count:,.0f}"
    text = f"{count:,}"
    digits = str(count)
    return text if len(digits) <= 21 else f"{digits[0]}.{digits[1:4]}e{len(digits) - 1} ({len(digits)} digits)"
