"""Measures plsys, POV-Ray, Embree and Mitsuba 3 side by side: same rays, same machine, one run.

    make bench                          everything, about 10 minutes
    make bench QUICK=1                  one round, without what takes minutes
    make bench ONLY=scatter,menger

Prints a table of ratios (median, least … most of the rounds), each with its target and whether it is met, and writes
bench.json and bench.png. One core a process (taskset), where it isn't said otherwise. It asserts nothing: machines differ.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import tempfile
import time
from pathlib import Path

import peers
from common import Bench
from measures import MEASURES
from report import Results


def processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


def names(text: str) -> list[str]:
    chosen = text.split(",")
    for name in chosen:
        if name not in MEASURES:
            raise argparse.ArgumentTypeError(f"no measure '{name}'; there are {', '.join(MEASURES)}")
    return chosen


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one round, without what takes minutes")
    parser.add_argument(
        "--only", type=names, default=list(MEASURES), metavar="NAME,…", help=f"of {', '.join(MEASURES)}"
    )
    parser.add_argument(
        "--output", type=Path, default=Path("bench"), metavar="PATH", help="PATH.json and PATH.png (bench)"
    )
    arguments = parser.parse_args()
    results, started = Results(), time.perf_counter()
    facts = {
        "processor": processor(),
        "cores": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "quick": arguments.quick,
    }
    print(f"{facts['processor']}, {facts['cores']} cores, load {os.getloadavg()[0]:.1f}", flush=True)
    with tempfile.TemporaryDirectory(prefix="plsys-bench-") as folder:
        bench = Bench(Path(folder), results, arguments.quick)
        for name in arguments.only:
            before = time.perf_counter()
            try:
                MEASURES[name](bench)
            except RuntimeError as error:
                results.note(name, f"failed: {str(error).strip().splitlines()[-1]}")
            print(f"{'':<14} ({name}: {time.perf_counter() - before:.0f} s)", flush=True)
    for name, remedy in peers.MISSING.items():
        results.note("missing", f"{name}: {remedy}")
    facts["missing"] = peers.MISSING
    facts["seconds"] = round(time.perf_counter() - started, 1)
    judged = [row for row in results.rows if row.met is not None]
    print(f"\n{sum(row.met for row in judged)} of {len(judged)} targets met; {facts['seconds']:.0f} s")
    for row in judged:
        if not row.met:
            print("  " + row.line())
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    results.write(arguments.output.with_suffix(".json"), facts)
    trouble = results.plot(arguments.output.with_suffix(".png"))
    print(trouble or f"{arguments.output.with_suffix('.json')}, {arguments.output.with_suffix('.png')}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
