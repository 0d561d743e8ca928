"""What the bench's measures share: ratios of rates against Embree, agreement of hits, rendered pictures.

Ratios are ours : theirs, of the same rays in the same turn (turns.py).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from peers import plsys
from prepare import Case, cone_curves
from report import Results
from turns import alone, embree, ours, take_turns

ALL = 2**64 - 1
SETS = ("coherent", "random")


@dataclass
class Bench:
    folder: Path
    results: Results
    quick: bool

    @property
    def rounds(self) -> int:
        """Processes of each program."""
        return 1 if self.quick else 3

    @property
    def turns(self) -> int:
        """Of programs that trace rays by turns, a process."""
        return 5 if self.quick else 3


def median(values) -> float:
    return sorted(values)[len(values) // 2]


def rate(answer: dict, name: str, key: str = "rates") -> float:
    """Of several turns."""
    return median(answer["sets"][name][key])


def ratios(mine: dict, theirs: dict, name: str, key: str = "rates") -> list[float]:
    """Of each turn."""
    return [a / b for a, b in zip(mine["sets"][name]["rates"], theirs["sets"][name][key], strict=True)]


def against_embree(
    bench: Bench, case: Case, scene: Path, what: str, targets: dict | None = None, options: dict | None = None,
    version: str = "3.13", flags: str = "",
) -> tuple[dict, dict] | None:  # fmt: skip
    """Rows of ratios for both kinds of rays; the last answers of both."""
    peer = embree(case, scene, version, flags)
    if peer is None:
        return None
    pairs = [take_turns([ours(case, options=options or {}), peer], bench.turns) for _ in range(bench.rounds)]
    for name in SETS:
        bench.results.row(
            case.name, f"{name}: {what}", sum((ratios(*pair, name, "single") for pair in pairs), []), (targets or {}).get(name),
            ours=f"{median([rate(m, name) for m, _ in pairs]):.2f} Mray/s", theirs=f"{median([rate(t, name, 'single') for _, t in pairs]):.2f}",
        )  # fmt: skip
    return pairs[-1]


def same_hits(bench: Bench, case: Case, answer: dict) -> None:
    """Says how many rays Embree answers otherwise, so that nobody compares unlike things."""
    path = case.folder / "hits.npz"
    alone(ours(case, hits=str(path), most_seconds=1e9), 1)
    with np.load(path) as mine:
        for name in SETS:
            a, b = mine[name], answer["t"][name]
            both = np.isfinite(a) & np.isfinite(b)
            other = np.isfinite(a) != np.isfinite(b)
            other[both] = np.abs(a[both] - b[both]) > 1e-3 * (1 + a[both])
            bench.results.note(
                case.name,
                f"{name}: Embree {answer['version']} answers {other.mean():.2%} of the rays otherwise",
            )


def rays_of_a_picture(drawn: dict) -> float:
    """Millions of rays of all kinds a CPU-second, of a picture that :func:`pixels_traced` drew."""
    return 1e-6 * sum(drawn["rays"].values()) / drawn["seconds"]["trace_cpu"]


def curves_of(case: Case) -> np.ndarray:
    return cone_curves(case.unfolded()[1])


def pixels_traced(case: Case, *options: object) -> dict:
    """`plsys render --json` of 640x480 with one thread."""
    parameters = [x for name, value in case.parameters.items() for x in ("-D", f"{name}={value}")]
    done = plsys(
        "render",
        case.path,
        "-o",
        case.folder / "ours.png",
        "--threads",
        1,
        "--json",
        *parameters,
        *options,
        pinned=True,
    )
    return json.loads(done.text[done.text.index("{") :]) | {
        "wall": done.wall,
        "cpu": done.cpu,
        "rss": done.rss,
    }
