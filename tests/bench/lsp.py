"""The language server's budgets, measured: bytes in → bytes out over stdio.

`make bench-lsp` prints p50, p99 and the maximum of each kind of request beside its budget: on a generated scene of 10,000
lines, on the same in ten files that include each other, on the same tied together by one symbol, and on the scenes of
`scenes/`, all in one table. Where the system tells it (Linux), the processor time that the server spent on one stands beside,
for whole-file checks that of its worker: what other programs do hardly changes that. Numbers are of this machine and this
moment; nothing fails because of them.

Example: ``python tests/bench/lsp.py --lines 10000 --edits 300 --json``
"""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
import tempfile
import time
from pathlib import Path
from typing import Callable, Iterable, Iterator

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.lsp.client import Client  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]

BUDGETS_MS = {
    "start → ready": 1000,
    "edit → diagnostics": 16,
    "edit → diagnostics, broken braces": 16,
    "edit → diagnostics, 100 cursors": 16,
    "edit → whole-file checks": 50,
    "burst of 30 keys/s → diagnostics": 16,
    "textDocument/hover": 10,
    "textDocument/definition": 10,
    "textDocument/signatureHelp": 10,
    "textDocument/completion": 30,
    "textDocument/documentHighlight": 10,
    "textDocument/references": 10,
    "textDocument/semanticTokens/range": 10,
    "textDocument/rename": 300,
    "textDocument/formatting": 300,
    "textDocument/documentSymbol": 300,
    "textDocument/foldingRange": 300,
}

PLANT = """\
// Plant {i}
#declare Bark{i} = texture {{ pigment {{ color rgb <0.45, 0.30, 0.15> }} finish {{ ambient 0.1 diffuse 0.7 }} }}
Selection Tree{i}
{{
    C_initialize{i} Tree{i};
    if (cntTrunk{i} > 0)     Tree{i} -> T_scaleCyl{i} cylinder + C_Trunk{i} T_shiftTrunk{i} Tree{i};
    else if (cntTree{i} > 0) Tree{i} -> T_scaleCyl{i} cylinder + C_Tree{i} (T_left{i} Tree{i} + T_right{i} Tree{i});
    else                     Tree{i} -> T_scaleCyl{i} cylinder;
}}
Calculation    C_initialize{i} {{ cntTree{i} = order; cntTrunk{i} = 2; betaBr{i} = 60.0; }}
Calculation    C_Trunk{i}      {{ --cntTrunk{i}; }}
Calculation    C_Tree{i}       {{ --cntTree{i}; betaBr{i} -= 4.0; }}
Transformation T_scaleCyl{i}   {{ scale 0.15 0.15 2; }}
Transformation T_shiftTrunk{i} {{ trans 0 0 1.99; }}
Transformation T_left{i}       {{ trans 0 0 1.99; roty betaBr{i}; scale 0.8 0.8 0.8; }}
Transformation T_right{i}      {{ trans 0 0 1.99; roty -betaBr{i}; rotz 90; scale 0.8 0.8 0.8; }}
object {{ Tree{i}  texture {{ Bark{i} }} translate <{i}, 0, 0> }}

"""

HEAD = """\
global_settings { assumed_gamma 1.0  seed 7 }
camera { location <0, -14, 5>  sky <0, 0, 1>  look_at <0, 0, 5>  angle 45 }
light_source { <20, -30, 40> color rgb 1 }
Parameter order = 10 [0 to 2000] "Age of the plant";
"""


def generated_scene(lines: int) -> str:
    """A scene of at least ``lines`` lines without a diagnostic."""
    plants = -(-(lines - HEAD.count("\n")) // PLANT.count("\n"))
    return HEAD + "".join(PLANT.format(i=i) for i in range(plants))


Times = dict[str, list[float]]


class Bench:
    """Measures on ``text``, opened as ``uri`` beside ``others``; adds to ``times`` and ``work`` (processor time)."""

    def __init__(
        self, text: str, uri: str = "untitled:bench.plsys", others: dict[str, str] | None = None,
        times: Times | None = None, work: Times | None = None,
    ) -> None:  # fmt: skip
        self.random = random.Random(1)
        self.lines, self.uri = text.split("\n"), uri
        self.version = 1
        self.times: Times = {} if times is None else times
        self.work: Times = {} if work is None else work
        self.spent = 0.0
        started = time.perf_counter()
        self.client = Client()
        self.capabilities = self.client.initialize()["capabilities"]
        self.note("start → ready", started)
        started = self.start()
        for other, content in (others or {}).items():
            self.client.open(other, content)
        self.client.open(uri, text)
        self.diagnostics()
        self.note("open → first diagnostics", started)
        self.opening()
        # Outline and folding wait for the file to be read.
        self.client.request("textDocument/foldingRange", {"textDocument": {"uri": uri}})
        self.note("open → all is read", started)

    def opening(self) -> None:
        """What is asked first while the file is still being read."""
        if self.capabilities.get("semanticTokensProvider"):
            started = self.start()
            window = {"start": {"line": 0, "character": 0}, "end": {"line": 60, "character": 0}}
            self.client.request("textDocument/semanticTokens/range", {"textDocument": {"uri": self.uri}, "range": window})
            self.note("open → tokens of the first lines", started)

    def start(self) -> float:
        self.spent = self.processor_time()
        return time.perf_counter()

    def processor_time(self) -> float:
        """Milliseconds that the server's threads have run (its workers apart); 0 where the system doesn't tell."""
        return threads_time(self.client.process.pid)

    def workers_time(self) -> float:
        """Milliseconds that the server's workers have run."""
        files = Path(f"/proc/{self.client.process.pid}/task").glob("*/children")
        return sum(threads_time(int(pid)) for file in files for pid in file.read_text().split())

    def note(self, what: str, started: float, work: float | None = None) -> None:
        self.times.setdefault(what, []).append(1000 * (time.perf_counter() - started))
        self.work.setdefault(what, []).append(self.processor_time() - self.spent if work is None else work)

    def diagnostics(self, has: Callable[[list[dict]], bool] = lambda found: True) -> None:
        """Wait for those of this version that ``has`` is true of."""
        while True:
            told = self.client.wait_for("textDocument/publishDiagnostics")
            if told["uri"] == self.uri and told.get("version") == self.version and has(told["diagnostics"]):
                return

    def edit(self, what: str, changes: Iterable[dict]) -> None:
        """Edit and wait for the diagnostics of that version."""
        self.version += 1
        started = self.start()
        self.client.change(self.uri, self.version, *changes)
        self.diagnostics()
        self.note(what, started)

    def request(self, method: str, params: dict) -> None:
        started = self.start()
        answer = self.client.request(method, {"textDocument": {"uri": self.uri}, **params})
        self.note(method, started)
        assert "error" not in answer, answer

    # --- places

    def place(self) -> dict:
        """A random place in a line of a definition."""
        while True:
            line = self.random.randrange(min(10, len(self.lines) // 2), len(self.lines) - 2)
            if len(self.lines[line]) > 30:
                return {"line": line, "character": self.random.randrange(20, len(self.lines[line]))}

    def name(self) -> dict:
        """A random place on a name."""
        while True:
            place = self.place()
            text = self.lines[place["line"]]
            for i in range(place["character"], len(text) - 1):
                if text[i].isalpha():
                    return {"line": place["line"], "character": i}


def threads_time(pid: int) -> float:
    """Milliseconds that the threads of a process have run."""
    files = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(file.read_text().split()[0]) for file in files) / 1e6


def insertion(place: dict, text: str) -> dict:
    return {"range": {"start": place, "end": place}, "text": text}


def deletion(place: dict, length: int) -> dict:
    return {"range": {"start": place, "end": {**place, "character": place["character"] + length}}, "text": ""}


def typing(bench: Bench, count: int, texts: list[str], what: str) -> None:
    """Type a text somewhere and delete it again."""
    for _ in range(count // 2):
        place, text = bench.place(), bench.random.choice(texts)
        bench.edit(what, [insertion(place, text)])
        bench.edit(what, [deletion(place, len(text))])


Places = Callable[[Bench], list[dict]]


def anywhere(bench: Bench) -> list[dict]:
    """100 places, the last one first."""
    places = sorted({(p["line"], p["character"]) for p in (bench.place() for _ in range(100))}, reverse=True)
    return [{"line": line, "character": character} for line, character in places]


def at_occurrences(bench: Bench) -> list[dict]:
    """Behind a number, where it stands 100 times: what people put many cursors at. The last one first."""
    found = [(i, text.index("scale 0.8") + 9) for i, text in enumerate(bench.lines) if "scale 0.8" in text]
    start = bench.random.randrange(0, max(1, len(found) - 100))
    return [{"line": line, "character": character} for line, character in reversed(found[start : start + 100])]


def keys(places: list[dict]) -> tuple[list[dict], list[dict]]:
    """The changes of one key at all places, and of taking it back."""
    return [insertion(place, "x") for place in places], [deletion(place, 1) for place in reversed(places)]


def cursors(bench: Bench, count: int) -> None:
    """One key at 100 places at once."""
    for _ in range(count // 2):
        for edits in keys(anywhere(bench)):
            bench.edit("edit → diagnostics, 100 cursors", edits)


def all_of_cursors(bench: Bench, count: int, places: Places, what: str) -> None:
    """As ``cursors``, up to where all is known. What is left of edits before isn't counted."""
    bench.client.request("textDocument/diagnostic", {"textDocument": {"uri": bench.uri}})
    for _ in range(count // 2):
        for edits in keys(places(bench)):
            bench.version += 1
            started = bench.start()
            bench.client.change(bench.uri, bench.version, *edits)
            bench.client.request("textDocument/diagnostic", {"textDocument": {"uri": bench.uri}})
            bench.note(what, started)
            bench.diagnostics()


def checks(bench: Bench, count: int) -> None:
    """A Transformation becomes singular and whole again, which the checks of what is used tell."""
    lines = [i for i, text in enumerate(bench.lines) if text.endswith("{ scale 0.15 0.15 2; }")]
    for line in bench.random.sample(lines, min(count, len(lines))):
        place = {"line": line, "character": len(bench.lines[line]) - 4}
        for digit in "02":
            bench.version += 1
            started, spent = bench.start(), bench.workers_time()
            bench.client.change(bench.uri, bench.version, {**deletion(place, 1), "text": digit})
            bench.diagnostics(lambda found: any(each["code"] == "singular" for each in found) is (digit == "0"))
            if digit == "0":  # the message goes with the text
                bench.note("edit → whole-file checks", started, bench.workers_time() - spent)


def burst(bench: Bench, count: int) -> None:
    """Keys at 30 a second; the time from the last one."""
    for _ in range(count):
        place = bench.place()
        for i in range(9):
            bench.version += 1
            bench.client.change(bench.uri, bench.version, insertion({**place, "character": place["character"] + i}, "a"))
            time.sleep(1 / 30)
        bench.edit("burst of 30 keys/s → diagnostics", [deletion(place, 9)])


def requests(bench: Bench, count: int) -> None:
    """Each request that the server offers, at random places."""
    offered: list[tuple[str, str, Callable[[], dict]]] = [
        ("hoverProvider", "textDocument/hover", lambda: {"position": bench.name()}),
        ("definitionProvider", "textDocument/definition", lambda: {"position": bench.name()}),
        ("documentHighlightProvider", "textDocument/documentHighlight", lambda: {"position": bench.name()}),
        ("referencesProvider", "textDocument/references", lambda: {"position": bench.name(), "context": {"includeDeclaration": True}}),
        ("signatureHelpProvider", "textDocument/signatureHelp", lambda: {"position": bench.place()}),
        ("completionProvider", "textDocument/completion", lambda: {"position": bench.place()}),
        ("semanticTokensProvider", "textDocument/semanticTokens/range", lambda: {"range": viewport(bench)}),
        ("inlayHintProvider", "textDocument/inlayHint", lambda: {"range": viewport(bench)}),
        ("documentSymbolProvider", "textDocument/documentSymbol", dict),
        ("foldingRangeProvider", "textDocument/foldingRange", dict),
        ("documentFormattingProvider", "textDocument/formatting", lambda: {"options": {"tabSize": 4, "insertSpaces": True}}),
    ]
    for capability, method, params in offered:
        if bench.capabilities.get(capability):
            whole_file = params is dict or method == "textDocument/formatting"
            for _ in range(5 if whole_file else count):
                bench.request(method, params())
    if bench.capabilities.get("renameProvider"):
        for i in range(5):
            line = next((i for i, text in enumerate(bench.lines) if text.startswith(("Parameter ", "Selection "))), None)
            if line is not None:
                place = {"line": line, "character": bench.lines[line].index(" ") + 1}
                bench.request("textDocument/rename", {"position": place, "newName": f"years{i}"})


def viewport(bench: Bench) -> dict:
    line = bench.random.randrange(0, max(1, len(bench.lines) - 60))
    return {"start": {"line": line, "character": 0}, "end": {"line": line + 60, "character": 0}}


def rows(bench: Bench) -> list[dict]:
    found = []
    for what, values in bench.times.items():
        values, work = sorted(values), sorted(bench.work[what])
        found.append({
            "what": what, "count": len(values), "p50_ms": values[len(values) // 2],
            "p99_ms": values[min(len(values) - 1, int(0.99 * len(values)))], "max_ms": values[-1], "budget_ms": BUDGETS_MS.get(what),
            "processor_p50_ms": work[len(work) // 2], "processor_p99_ms": work[min(len(work) - 1, int(0.99 * len(work)))],
            "processor_max_ms": work[-1],
        })  # fmt: skip
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lines", type=int, default=10_000, help="length of the generated scene")
    parser.add_argument("--scene", type=Path, help="measure on this scene instead")
    parser.add_argument("--edits", type=int, default=300, help="edits and requests of each kind")
    parser.add_argument("--json", action="store_true", help="print the numbers as JSON")
    arguments = parser.parse_args()
    tables = []
    for what, bench in tables_of(arguments):
        tables.append({"what": what, "rows": rows(bench)})
        if not arguments.json:
            report(what, bench)
    if arguments.json:
        print(json.dumps(tables))


def tables_of(arguments: argparse.Namespace) -> Iterator[tuple[str, Bench]]:
    if arguments.scene:
        yield arguments.scene.name, measured(Bench(arguments.scene.read_text()), arguments.edits)
        return
    text = generated_scene(arguments.lines)
    yield f"{text.count(chr(10)):,} lines", measured(Bench(text), arguments.edits)
    with tempfile.TemporaryDirectory() as folder:
        yield "the same in ten files", measured(in_files(text, Path(folder)), arguments.edits)
    yield "the same, tied together by one symbol", measured(Bench(tied(text)), arguments.edits)
    yield "real scenes", real_scenes(max(20, arguments.edits // 10))


def measured(bench: Bench, edits: int) -> Bench:
    """Everything, and the end of the session."""
    typing(bench, edits, ["a", "1", " ", ";", "sphere ", "C_Tree7 "], "edit → diagnostics")
    typing(bench, edits, ["{", "}", "(", "[", '"', "/*"], "edit → diagnostics, broken braces")
    if len(bench.lines) > 500:
        cursors(bench, max(2, edits // 10))
        all_of_cursors(bench, max(2, edits // 10), anywhere, "100 cursors → all diagnostics (pull)")
        all_of_cursors(bench, max(2, edits // 10), at_occurrences, "100 cursors at a number → all diagnostics")
    burst(bench, max(1, edits // 50))
    requests(bench, edits)
    checks(bench, max(10, edits // 3))
    bench.client.request("shutdown")
    bench.client.notify("exit")
    bench.client.process.wait(10)
    return bench


def tied(text: str) -> str:
    """The scene with one object that enters all plants, so that it is one part to the whole-file checks."""
    count = text.count("// Plant ")
    places = (f"T_place{i} Bark{i} Tree{i}" for i in range(count))
    text = re.sub(r"object \{ Tree(\d+) .*", r"Transformation T_place\1 { trans \1 0 0; }", text)
    return f"{text}Selection Forest {{ Forest -> {' + '.join(places)}; }}\nobject {{ Forest }}\n"


def in_files(text: str, folder: Path) -> Bench:
    """The scene in ten files below ``folder``; the fifth is edited."""
    plants = text.removeprefix(HEAD).split("// Plant ")[1:]
    size = -(-len(plants) // 10)
    names = []
    for i in range(10):
        names.append(f"part{i}.plsys")
        (folder / names[-1]).write_text("".join("// Plant " + each for each in plants[i * size : (i + 1) * size]))
    main = folder / "main.plsys"
    main.write_text("".join(f'#include "{name}"\n' for name in names) + HEAD)
    edited = folder / names[4]
    return Bench(edited.read_text(), edited.as_uri(), {main.as_uri(): main.read_text()})


def real_scenes(edits: int) -> Bench:
    """All scenes of ``scenes/`` in one table."""
    bench, times, work = None, {}, {}
    for path in sorted((ROOT / "scenes").glob("*.plsys")):
        text = path.read_text()
        if sum(len(line) > 30 for line in text.split("\n")[10:-2]) > 0:
            bench = measured(Bench(text, path.as_uri(), times=times, work=work), edits)
    assert bench is not None
    return bench


def report(what: str, bench: Bench) -> None:
    found = rows(bench)
    print(f"{what}; milliseconds, bytes in → bytes out")
    print(f"{'':42}{'count':>6}{'p50':>9}{'p99':>9}{'max':>9}{'budget':>9}{'CPU p50':>9}{'CPU p99':>9}{'CPU max':>9}")
    for row in found:
        budget = f"{row['budget_ms']:,}" if row["budget_ms"] else ""
        print(f"{row['what']:42}{row['count']:6}{row['p50_ms']:9.2f}{row['p99_ms']:9.2f}{row['max_ms']:9.2f}{budget:>9}"
              f"{row['processor_p50_ms']:9.2f}{row['processor_p99_ms']:9.2f}{row['processor_max_ms']:9.2f}")
    print(flush=True)


if __name__ == "__main__":
    main()
