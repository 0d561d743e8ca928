"""Scenes with pieces changed at random: whatever comes out, it is messages, and soon."""

from __future__ import annotations

import random
import signal
from pathlib import Path

import pytest
from stress import rounds

from plsys.compiler.graph.forecast import forecast
from plsys.compiler.pipeline import build
from plsys.compiler.reading.diagnostics import PlsysError, render
from plsys.compiler.reading.source import Source

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted((ROOT / "scenes").glob("*.plsys"))
PIECES = ("0", "-1", "1e9", "n", "rand(0)", "{", "}", "(", ")", ";", "+", "->", "if (n > 0)", "else", "Tree", "sphere", "scale 0;", "++n;", "", "", "")
LIMIT_S = 60


def mutated(data: bytes, rng: random.Random) -> bytes:
    for _ in range(rng.randrange(1, 4)):
        start = rng.randrange(len(data))
        if rng.random() < 0.5:  # a whole word
            while start < len(data) and not data[start : start + 1].isalnum():
                start += 1
            end = start
            while end < len(data) and data[end : end + 1].isalnum():
                end += 1
        else:
            end = start + rng.randrange(20)
        data = data[:start] + rng.choice(PIECES).encode() + data[end:]
    return data


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="the time limit is a POSIX signal")
def test_mutated_scenes_give_messages():
    def late(*_: object) -> None:
        raise TimeoutError

    rng = random.Random(4)
    before = signal.signal(signal.SIGALRM, late)
    try:
        for _ in range(rounds(ci=250, stress=20_000)):
            scene = rng.choice(SCENES)
            data = mutated(scene.read_bytes(), rng)
            signal.alarm(LIMIT_S)
            try:
                compilation = build(Source(scene.name, data, scene))
                found = [*compilation.diagnostics, *forecast(compilation.graph, 500, 500).diagnostics]
            except PlsysError as error:
                found = getattr(error, "diagnostics", ())
            except BaseException:
                print(data.decode(errors="replace"))
                raise
            for each in found:
                assert render(each)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
