"""Programs that trace rays by turns: what disturbs the machine for a while disturbs all of them.

    mine, theirs = take_turns([ours(case), embree(case, scene)], 3)
    mine["sets"]["random"]["rates"]     →  [4.4, 4.5, 4.1]     Mray/s, one a round
    theirs["sets"]["random"]["single"]  →  [2.0, 2.1, 1.9]     in the same moments

A program reads its request, if any, from the first line of its standard input. Each line after it is the number of a set of
rays: it traces them once and answers with a line of JSON, its rates by name. At the end of its input it says the rest in a
last line. None of this takes time that is measured.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from peers import HERE, embree_compiled, embree_libraries, on_one_core, run
from prepare import Case


@dataclass
class Program:
    """sets: the names of its sets of rays. finish: makes an answer of its last line."""

    command: list
    sets: list[str]
    opening: str = ""
    pinned: bool = True
    finish: Callable[[dict], dict] = dict

    def answer(self, said: list[str], numbers: list[int]) -> dict:
        """Of all lines that it said: one for each turn's number of a set, and the last one."""
        answer = self.finish(json.loads(said[-1]))
        for number, line in zip(numbers, said[:-1], strict=True):
            measured = answer["sets"].setdefault(self.sets[number], {})
            for key, rate in json.loads(line).items():
                measured.setdefault(key, []).append(rate)
        return answer


def ours(case: Case, pinned: bool = True, sets: bool = True, **request) -> Program:
    """work.py on a case's rays; without ``sets`` it gets none."""
    request = {"scene": str(case.path), "parameters": case.parameters, "rays": str(case.rays_path), "most_seconds": 2.0,
               "options": {}} | request  # fmt: skip
    command = [sys.executable, HERE / "work.py"]
    return Program(command, list(case.rays) if sets else [], json.dumps(request) + "\n", pinned)


def embree(case: Case, scene: Path, version: str = "3.13", flags: str = "") -> Program | None:
    """embree.c on a scene's file and a case's rays; of the answer "t" has t of all rays, by set. None: it isn't installed."""
    program, library, hits = embree_compiled(case.folder), embree_libraries().get(version), case.folder / "embree-hits.bin"

    def finish(last: dict) -> dict:
        t, ends = np.fromfile(hits, np.float32).astype(float), np.cumsum([len(rays) for rays in case.rays.values()])
        t[t > 1e29] = np.inf
        return last | {"sets": {}, "t": dict(zip(case.rays, np.split(t, ends[:-1])))}

    if not program or not library:
        return None
    return Program([program, library, scene, case.binary_rays_path, hits, flags], list(case.rays), finish=finish)


def alone(program: Program, rounds: int = 3) -> dict:
    """The answer of a program that has the machine to itself, and "process_rss": its peak memory in bytes."""
    numbers = rounds * list(range(len(program.sets)))
    done = run(program.command, program.opening + "".join(f"{number}\n" for number in numbers), program.pinned)
    return program.answer(done.text.splitlines(), numbers) | {"process_rss": done.rss}


def take_turns(programs: list[Program], rounds: int = 3) -> list[dict]:
    """The answers of programs with the same sets of rays."""
    numbers = rounds * list(range(len(programs[0].sets)))
    with contextlib.ExitStack() as stack:
        running = [stack.enter_context(Running(program)) for program in programs]
        said = [[one.turn(number) for one in running] for number in numbers]
        said.append([one.end() for one in running])
        return [program.answer(list(lines), numbers) for program, lines in zip(programs, zip(*said))]


def at_once(program: Program, count: int, rounds: int) -> list[dict]:
    """The answers of so many processes of one program, each turn of which all take in the same moments."""
    numbers = rounds * list(range(len(program.sets)))
    with contextlib.ExitStack() as stack:
        running = [stack.enter_context(Running(program)) for _ in range(count)]
        said = []
        for number in numbers:
            for one in running:
                one.begin(number)
            said.append([one.line() for one in running])
        said.append([one.end() for one in running])
        return [program.answer(list(lines), numbers) for lines in zip(*said)]


class Running:
    """A program under way."""

    def __init__(self, program: Program):
        self.complaints = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(
            [*on_one_core(program.pinned), *map(str, program.command)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.complaints,
            text=True,
        )
        self.process.stdin.write(program.opening)

    def __enter__(self) -> Running:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.__exit__(None, None, None)
        self.complaints.close()

    def begin(self, number: int) -> None:
        self.process.stdin.write(f"{number}\n")
        self.process.stdin.flush()

    def turn(self, number: int) -> str:
        self.begin(number)
        return self.line()

    def end(self) -> str:
        self.process.stdin.close()
        return self.line()

    def line(self) -> str:
        line = self.process.stdout.readline()
        if not line:
            self.complaints.seek(0)
            raise RuntimeError(f"{self.process.args[-1]} failed ({self.process.wait()}): {self.complaints.read()[-600:]}")
        return line
