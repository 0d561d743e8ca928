"""The bench's results: rows with their targets, as a table, JSON and plots.

results.row("order 20", "coherent, of Embree single rays", [1.1, 1.2, 1.3], 1.0)
results.note("order 20", "Embree needs 214 MB")
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path


@dataclass
class Row:
    """low, value, high: least, median and most of the rounds. target: at least that (`at_most`: at most); None: only
    reported. ours, theirs: what the ratio is made of, for the reader."""

    scene: str
    what: str
    low: float
    value: float
    high: float
    unit: str
    target: float | None
    at_most: bool
    ours: str = ""
    theirs: str = ""

    @property
    def met(self) -> bool | None:
        if self.target is None:
            return None
        return self.value <= self.target if self.at_most else self.value >= self.target

    def line(self) -> str:
        verdict = {None: "", True: "met", False: "NOT met"}[self.met]
        target = "" if self.target is None else f"{'≤' if self.at_most else '≥'} {self.target:g}"
        spread = f"{number(self.low)} … {number(self.high)}" if self.low != self.high else ""
        parts = f"{self.scene:<14} {self.what:<46} {number(self.value):>8}{self.unit:<3} {spread:<19} {target:>8}  {verdict:<8}"
        return f"{parts} {self.ours}{' : ' + self.theirs if self.theirs else ''}".rstrip()


@dataclass
class Results:
    rows: list[Row] = field(default_factory=list)
    notes: list[tuple[str, str]] = field(default_factory=list)
    curves: dict[str, list[dict]] = field(default_factory=dict)

    def row(self, scene: str, what: str, values, target: float | None = None, unit: str = "×", at_most: bool = False,
            ours: str = "", theirs: str = "") -> None:  # fmt: skip
        ordered = sorted(values if isinstance(values, (list, tuple)) else [values])
        row = Row(
            scene,
            what,
            ordered[0],
            ordered[len(ordered) // 2],
            ordered[-1],
            unit,
            target,
            at_most,
            ours,
            theirs,
        )
        self.rows.append(row)
        print(row.line(), flush=True)

    def note(self, scene: str, text: str) -> None:
        self.notes.append((scene, text))
        print(f"{scene:<14} {text}", flush=True)

    def write(self, path: Path, facts: dict) -> None:
        rows = [asdict(row) | {"met": row.met} for row in self.rows]
        path.write_text(
            json.dumps(facts | {"rows": rows, "notes": self.notes, "curves": self.curves}, indent=1) + "\n"
        )

    def plot(self, path: Path) -> str | None:
        """Draws the curves; a message if it can't."""
        try:
            import matplotlib
        except ImportError:
            return "no plot: pip install matplotlib"
        matplotlib.use("Agg")
        from matplotlib import pyplot

        kinds = [kind for kind in PANELS if any(name.startswith(kind) for name in self.curves)]
        if not kinds:
            return "no plot: no curve was measured"
        figure, axes = pyplot.subplots(
            1, len(kinds), figsize=(5.3 * len(kinds), 5), layout="constrained", squeeze=False
        )
        for axis, kind in zip(axes[0], kinds):
            title, x, y, logarithmic = PANELS[kind]
            for name, points in self.curves.items():
                for label, style, xs, ys in lines_of(name, points) if name.startswith(kind) else ():
                    axis.plot(xs, ys, style, label=label)
                for text, *at in labels_of(points) if kind == "fronts" and name.startswith(kind) else ():
                    axis.annotate(text, at, (0, 5), textcoords="offset points", fontsize=7)
            axis.set(title=title, xlabel=x, ylabel=y)
            if logarithmic:
                axis.set(xscale="log", yscale="log")
                if kind == "residency":  # ratios about 1
                    axis.yaxis.set_major_formatter("{x:g}")
                    axis.yaxis.set_minor_formatter("{x:g}")
            else:
                axis.set(ylim=(0, None))
                axis.xaxis.get_major_locator().set_params(integer=True)
            axis.legend(fontsize=8)
            axis.grid(alpha=0.3)
        figure.savefig(path, dpi=110)
        pyplot.close(figure)
        return None


# By what a curve's name begins with: title, x, y, logarithmic.
PANELS = {
    "fronts": ("Memory for time: items a front", "MB", "Mray/s, one core", True),
    "growth": ("Growth: Menger 2 to 10, coherent rays", "primitives", "", True),
    "residency": ("The flat scene leaves the caches", "Embree's MB", "ours : Embree's rate", True),
    "threads": ("Threads", "threads", "Mray/s", False),
}


def lines_of(name: str, points: list[dict]):
    """(label, style, xs, ys) of a curve's lines."""

    def column(key: str, scale: float = 1.0) -> list[float]:
        return [point[key] * scale for point in points]

    short = name.partition(": ")[2]
    if name.startswith("fronts"):
        for key, style in (("coherent", "o-"), ("random", "s--")):
            yield f"{short}, {key}", style, column("bytes", 1e-6), column(key)
    elif name.startswith("residency"):
        for key, style in (("coherent", "o-"), ("random", "s--")):
            yield f"{short}, {key}", style, column("embree_bytes", 1e-6), column(key)
    elif name.startswith("growth"):
        yield "memory, MB", "o-", column("primitives"), column("bytes", 1e-6)
        yield "build, s", "s--", column("primitives"), column("build_seconds")
        yield "coherent, Mray/s", "^:", column("primitives"), column("coherent")
    else:
        yield short, "o-", column("threads"), column("rate")
        yield f"{short}, in proportion", "k:", column("threads"), [points[0]["rate"] * n for n in column("threads")]


def labels_of(points: list[dict]) -> list[tuple[str, float, float]]:
    """(items a front, MB, coherent rate) of the points on a curve of fronts; one label for those that are hardly apart."""
    labels: list[tuple[str, float, float]] = []
    for point in points:
        text, x, y = "all" if point["items"] > 1e9 else str(point["items"]), point["bytes"] * 1e-6, point["coherent"]
        if labels and all(0.8 < new / old < 1.25 for new, old in zip((x, y), labels[-1][1:])):
            text = f"{labels.pop()[0].partition('–')[0]}–{text}"
        labels.append((text, x, y))
    return labels


def number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def size(count: float) -> str:
    for unit, name in ((1e9, "GB"), (1e6, "MB"), (1e3, "KB")):
        if count >= unit:
            return f"{count / unit:.3g} {name}"
    return f"{count:.0f} B"
