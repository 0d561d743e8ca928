"""Pigments, finishes and objects of the reference model: what a surface is made of.

Input: points of the object's own pattern space, (n, 3) float64.  Output of `at`: (n, 5) colours as red, green,
blue, filter, transmit.  Everything writes itself as POV-Ray text, too:

    Gradient((1, 0, 0), [(0, (1, 0, 0)), (1, (0, 0, 1, 0, 0.5))]).at(points)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .shapes import Shape, Vector, unit, vector_text

CHECKER_BIAS = 1e-10

Modifiers = Sequence[tuple[str, Vector]]


def transform(modifiers: Modifiers) -> tuple[np.ndarray, np.ndarray]:
    """(A, t) of p' = p·A + t for a chain of translate, rotate (degrees: x, then y, then z) and scale."""
    matrix, offset = np.eye(3), np.zeros(3)
    for word, v in modifiers:
        v = np.asarray(v, float)
        if word == "translate":
            offset = offset + v
            continue
        step = np.diag(v) if word == "scale" else rotation(v)
        matrix, offset = matrix @ step, offset @ step
    return matrix, offset


def rotation(degrees: np.ndarray) -> np.ndarray:
    """Row-vector matrix of POV-Ray's `rotate`."""
    cx, cy, cz = np.cos(np.radians(degrees))
    sx, sy, sz = np.sin(np.radians(degrees))
    x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    z = np.array([[cz, sz, 0], [-sz, cz, 0], [0, 0, 1]])
    return x @ y @ z


def modifiers_text(modifiers: Modifiers) -> str:
    return " ".join(f"{word} {vector_text(v)}" for word, v in modifiers)


def colour_text(c: Vector) -> str:
    return f"rgbft {vector_text(c)}" if len(c) == 5 else f"rgb {vector_text(c)}"


def rgbft(c: Vector) -> np.ndarray:
    """A colour of three or five numbers as red, green, blue, filter, transmit."""
    return np.array([*c, 0, 0][:5], float)


@dataclass
class Plain:
    """One colour (red, green, blue[, filter, transmit])."""

    colour: Vector

    def at(self, p):
        return np.broadcast_to(rgbft(self.colour), (len(p), 5))

    def colours(self):
        return [self.colour]

    def pov(self):
        return f"pigment {{ {colour_text(self.colour)} }}"


@dataclass
class Pattern:
    """A pattern value in a colour map.  `modifiers` are the pigment's own."""

    entries: Sequence[tuple[float, Vector]]
    modifiers: Modifiers = ()

    def value(self, p):
        raise NotImplementedError

    def colours(self):
        return [c for _, c in self.entries]

    def at(self, p):
        matrix, offset = transform(self.modifiers)
        value = self.value((p - offset) @ np.linalg.inv(matrix))
        keys = np.array([k for k, _ in self.entries], np.float32).astype(float)
        colours = np.stack([rgbft(c) for _, c in self.entries])
        after = np.clip(np.searchsorted(keys, value, side="left"), 0, len(keys) - 1)
        before = np.maximum(after - 1, 0)
        gap = keys[after] - keys[before]
        fraction = np.clip((value - keys[before]) / np.where(gap > 0, gap, 1), 0, 1)
        fraction = np.where(value >= keys[-1], 1.0, fraction)
        after = np.where(value >= keys[-1], len(keys) - 1, after)
        return colours[before] + fraction[:, None] * (colours[after] - colours[before])


class Checker(Pattern):
    """Two colours by the parity of ⌊x⌋ + ⌊y⌋ + ⌊z⌋, each with 1e-10 added first."""

    def __init__(
        self, first: Vector = (0, 0, 1), second: Vector = (0, 1, 0), modifiers: Modifiers = (), given=2
    ):
        super().__init__([(0, first), (1, second)], modifiers)
        self.given = given

    def value(self, p):
        return np.floor(p + CHECKER_BIAS).sum(axis=1) % 2

    def pov(self):
        listed = ", ".join(colour_text(c) for _, c in self.entries[: self.given])
        return f"pigment {{ checker {listed} {modifiers_text(self.modifiers)} }}"


class Gradient(Pattern):
    """g = p·direction, wrapped to [0, 1]; a negative g has the period 1.00001."""

    def __init__(
        self, direction: Vector, entries=((0, (0, 0, 0)), (1, (1, 1, 1))), modifiers: Modifiers = ()
    ):
        super().__init__(entries, modifiers)
        self.direction = direction

    def value(self, p):
        g = p @ unit(np.asarray(self.direction, float))
        g = np.fmod(np.where(g > 1, np.fmod(g, 1), g), 1.00001)
        return np.where(g < 0, g - np.floor(g), g)

    def pov(self):
        entries = " ".join(f"[{k!r} {colour_text(c)}]" for k, c in self.entries)
        return (
            f"pigment {{ gradient {vector_text(self.direction)} color_map {{ {entries} }} "
            f"{modifiers_text(self.modifiers)} }}"
        )


@dataclass
class Finish:
    ambient: Vector = (0.1, 0.1, 0.1)
    emission: Vector = (0, 0, 0)
    diffuse: float = 0.6
    brilliance: float = 1.0
    phong: float = 0.0
    phong_size: float = 40.0
    specular: float = 0.0
    roughness: float = 0.05
    reflection: Vector = (0, 0, 0)

    def pov(self):
        default, words = Finish(), []
        for name, value in vars(self).items():
            if value != getattr(default, name):
                words.append(f"{name} {colour_text(value) if isinstance(value, tuple) else repr(value)}")
        return f"finish {{ {' '.join(words)} }}" if words else ""


@dataclass
class Object:
    """A shape with its texture.  The modifiers move the pattern too, unless the texture comes after them."""

    shape: Shape
    pigment: Plain | Pattern | None = None
    finish: Finish = field(default_factory=Finish)
    modifiers: Modifiers = ()
    texture_last: bool = False
    no_shadow: bool = False

    def hits(self, o, d):
        matrix, offset = transform(self.modifiers)
        inverse = np.linalg.inv(matrix)
        t, n = self.shape.hits((o - offset) @ inverse, d @ inverse)
        return t, n @ inverse.T

    def colour(self, p):
        if self.pigment is None:
            return np.zeros((len(p), 5))
        if self.texture_last:
            return self.pigment.at(p)
        matrix, offset = transform(self.modifiers)
        return self.pigment.at((p - offset) @ np.linalg.inv(matrix))

    @property
    def opaque(self):
        return self.pigment is None or not any(np.any(rgbft(c)[3:]) for c in self.pigment.colours())

    def pov(self):
        texture = (
            f"texture {{ {self.pigment.pov()} {self.finish.pov()} }}" if self.pigment else self.finish.pov()
        )
        parts = [texture, modifiers_text(self.modifiers)]
        if self.texture_last:
            parts.reverse()
        return f"{self.shape.pov()} {' '.join(parts)}{' no_shadow' if self.no_shadow else ''} }}"
