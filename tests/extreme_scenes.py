"""Random scenes of extremes, by number: thin, sheared, huge, tiny, endless and unique things, and copies that lie on each other.

random_scenes.py's are small and round, so that a plain unfolder can follow. These are for comparing the runtime's ways of
tracing with each other.

Example: ``scene(17)`` is the text of a scene, always the same one.
"""

from __future__ import annotations

import random
from collections.abc import Callable

SHAPES = (
    "sphere", "cylinder", "cone(0)", "cone(0.5)", "cone(0.999999)", "cone(1.7)", "box", "triangle", "square", "disc",
    "torus(0.3)", "torus(0.05)", "torus(1e-4)",
)  # fmt: skip


def _size(r: random.Random, low: float, high: float) -> str:
    """A number between powers of ten, sometimes negative."""
    return f"{r.choice(('', '', '-'))}{10 ** r.uniform(low, high):.6g}"


def _number(r: random.Random, low: float, high: float) -> str:
    return f"{r.uniform(low, high):.3g}"


def _moves(r: random.Random) -> str:
    return r.choice((
        f"trans {_number(r, -1.2, 1.2)} {_number(r, -1.2, 1.2)} {_number(r, -1.2, 1.2)}",
        f"rot{r.choice('xyz')} {_number(r, -180, 180)}", f"rot {_number(r, -180, 180)} 0.4 {_number(r, -1, 1)} 1",
        f"scale {_number(r, 0.3, 1)} {_number(r, 0.3, 1)} {_number(r, 0.3, 1)}",
        "rotz 40*p; trans 0 p 0.2",
    ))  # fmt: skip


def _draws(r: random.Random) -> str:
    return r.choice((f"scale 0.4 + 0.3*rand({r.randrange(3)})", f"roty 90*rand({r.randrange(3)})", _moves(r)))


def _thins(r: random.Random) -> str:
    return r.choice((
        f"scale {_size(r, -6, 0)} {_size(r, -2, 0.3)} {_size(r, -2, 0.3)}", f"scale {_size(r, -3, 3)} {_size(r, -3, 3)} {_size(r, -3, 3)}",
        "scale 1 1e-08 0.0001", f"scale 1e6 1e-6 1; rotz {_number(r, -90, 90)}",
        f"matrix 1 1 0  1 {1 + 10 ** r.uniform(-8, -2):.12g} 0  0 0 1  0 0 {_number(r, -1, 1)}", _moves(r),
    ))  # fmt: skip


def _shears(r: random.Random) -> str:
    return r.choice((
        f"shear {_number(r, -8, 8)} {_number(r, -3, 3)} 0 {_number(r, -3, 3)} 0 {_number(r, -9, 9)}", f"shear {_size(r, 0, 5)} 0 0 0 0 0",
        "scale -1 1 1", _moves(r),
    ))  # fmt: skip


def _repeats(r: random.Random) -> str:
    """What brings copies onto each other, so that many hits have the same t."""
    return r.choice((
        f"trans {r.choice((0, 1, -1, 0.5))} {r.choice((0, 1, -1))} {r.choice((0, 0, 1))}", f"rot{r.choice('xyz')} {r.choice((90, 180, -90, 45))}",
        f"scale {r.choice(('-1 1 1', '1 -1 1', '-1 -1 -1', '0.5', '2 1 1', '1 1 0.5'))}", "trans 0 0 0",
    ))  # fmt: skip


# Of each kind: the steps of its transformations, and what stands round its object.
KINDS: dict[str, tuple[Callable[[random.Random], str], Callable[[random.Random], str]]] = {
    "plain": (_moves, lambda r: ""),
    "thin": (_thins, lambda r: ""),
    "sheared": (_shears, lambda r: "scale <1, -1, 1>"),
    "repeated": (_repeats, lambda r: ""),
    "far": (_moves, lambda r: f"translate <{r.choice((0, 1e8, 3e6))}, {r.choice((0, -1e8, 1e4))}, 0>"),
    "sized": (_moves, lambda r: f"scale {r.choice((1e-9, 1e-6, 1e-4, 1e5, 1e9))}"),
    "endless": (_moves, lambda r: ""),
    "unique": (_draws, lambda r: ""),
}


def kind_of(number: int) -> str:
    return list(KINDS)[number % len(KINDS)]


def scene(number: int) -> str:
    """The text of a scene of kind_of(number)."""
    r, kind = random.Random(number), kind_of(number)
    steps, around = KINDS[kind]
    names = [f"S{i}" for i in range(r.randrange(1, 5))]
    selections = [_selection(r, name, names, steps, kind) for name in names]
    return "\n".join([
        f"global_settings {{ assumed_gamma 1.0 seed {r.randrange(99)} }}",
        f"camera {{ location <{_number(r, -3, 3)}, {_number(r, -9, -6)}, {_number(r, -1, 4)}> sky <0, 0, 1> look_at <0, 0, 0.3> angle 50 }}",
        "light_source { <7, -20, 15> color rgb 0.9 }",
        *selections,
        f"Selection Root {{ Root -> [ n = {r.randrange(2, 6)}; p = {_number(r, 0.1, 1)} ] S0; }}",
        f"object {{ Root pigment {{ color rgb <0.4, 0.7, 0.2> }} {around(r)} }}",
        *([f"plane {{ <0, 0, 1>, {_number(r, -3, -1)} }}"] if r.random() < 0.3 else []),
    ]) + "\n"  # fmt: skip


def _selection(r: random.Random, name: str, names: list[str], steps: Callable[[random.Random], str], kind: str) -> str:
    def term(is_recursive: bool) -> str:
        parts = [f"[ {steps(r)} ]" for _ in range(r.randrange(3))]
        if kind == "unique" and r.random() < 0.5:
            parts.append("[ p = rand(1) ]")
        if not is_recursive:
            return " ".join([*parts, r.choice(SHAPES)])
        less = f"trans {_number(r, -1, 1)} 0.3 {_number(r, -1, 1)}; roty 40; scale {_number(r, 0.3, 0.55)}" if kind == "endless" else f"--n; scale {_number(r, 0.4, 0.75)}"
        return " ".join([*parts, f"[ {less} ]", r.choice(names)])

    def body(is_recursive: bool) -> str:
        terms = [term(False) for _ in range(r.randrange(1, 3))] + [term(True) for _ in range(r.randrange(1, 3) if is_recursive else 0)]
        return " + ".join(r.sample(terms, len(terms)))

    if kind == "endless":
        return f"Selection {name} {{ {name} -> {body(True)}; }}"
    if r.random() < 0.3:
        choice = f"{_number(r, 0.2, 2)}: {body(True)} | 1: {body(True)} | 0.5: {body(False)}"
        return f"Selection {name} {{ if (n > 0) {name} -> {choice}; else {name} -> {body(False)}; }}"
    return f"Selection {name} {{ if (n > 0) {name} -> {body(True)}; else {name} -> {body(False)}; }}"
