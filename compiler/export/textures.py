"""Texture values as rows of numbers, and the fixed order in which an instance's texture is evaluated.

A texture is one row: the values of the ``texture`` record of runtime/bytecode.toml, then six numbers per
colour entry (position, red, green, blue, filter, transmit). Where an expression depends on parameters, each
instance has a row of its own.

Example: ``Texture(row).color`` of a solid red texture is ``(1, 0, 0, 0, 0)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bytecode.layout_rows import PATTERNS, RECORDS
from ..reading.diagnostics import PlsysError
from ..reading.model import Constant, TextureValue
from .evaluate import Scope, evaluate, place
from .matrices import IDENTITY

RECORD = RECORDS["texture"]
ENTRY = len(RECORD.entry)
DEFAULTS = np.concatenate([np.asarray(value.default, dtype=np.float64) for value in RECORD.values.values()])
PATTERN_NAMES = {number: name for name, number in PATTERNS.items()}


@dataclass(frozen=True)
class Texture:
    """One texture: ``row`` as above, ``frame`` the (3, 4) map of the place where it stands to the world,
    ``name`` that of its first operator, or ''."""

    row: np.ndarray
    frame: np.ndarray
    name: str = ""

    def value(self, name: str) -> np.ndarray:
        field = RECORD.values[name]
        return self.row[field.offset : field.offset + field.size]

    @property
    def pattern(self) -> str:
        return PATTERN_NAMES[int(self.value("pattern")[0])]

    @property
    def entries(self) -> np.ndarray:
        """(k, 6): position, red, green, blue, filter, transmit."""
        return self.row[RECORD.size :].reshape(-1, ENTRY)


def row_length(texture: TextureValue) -> int:
    return RECORD.size + ENTRY * len(texture.entries)


def is_constant(texture: TextureValue) -> bool:
    values = [e for _, expressions in texture.values for e in expressions]
    return all(isinstance(e, Constant) for e in values + [e for entry in texture.entries for e in entry])


def has_frame(texture: TextureValue) -> bool:
    """Whether it matters where the texture stands: not for a solid colour."""
    return any(name == "pattern" and expressions[0] != Constant(0.0) for name, expressions in texture.values)


def rows(texture: TextureValue, scope: Scope, width: int) -> np.ndarray:
    """The rows (n, width) of a texture for all instances of ``scope``, padded with NaN after its entries."""
    table = np.full((len(scope), width), np.nan)
    table[:, : RECORD.size] = DEFAULTS
    targets = [
        (RECORD.values[name].offset + i, expression)
        for name, expressions in texture.values
        for i, expression in enumerate(expressions)
    ]
    targets += [
        (RECORD.size + ENTRY * number + i, expression)
        for number, entry in enumerate(texture.entries)
        for i, expression in enumerate(entry)
    ]
    for column, expression in targets:
        values = evaluate(expression, scope)
        if not np.isfinite(values).all():
            raise PlsysError("a texture's value is not a finite number", place(expression))
        table[:, column] = values
    return table


NOTHING = Scope(np.zeros((1, 0)), np.zeros(1, np.uint64), np.zeros((1, 0), np.uint64), {}, np.uint64(0))
"""One instance that knows nothing: enough for constant textures."""


class Palette:
    """Names the distinct textures of a scene's batches: equal values, and equal frames where they matter, are
    one texture, however many operators and places it comes from."""

    def __init__(self, graph) -> None:
        self._nodes = graph.nodes
        self._rows: dict[int, np.ndarray] = {}  # texture node -> row of a constant texture
        self._same: dict[int, int] = {-1: -1}  # texture node -> first node of equal values
        first: dict[bytes, int] = {}
        for index in graph.reachable() if graph.nodes else ():
            texture = getattr(graph.nodes[index], "texture", None)
            if isinstance(texture, TextureValue) and is_constant(texture):
                row = rows(texture, NOTHING, row_length(texture))[0]
                self._rows[index] = row
                self._same[index] = first.setdefault(row.tobytes(), index)

    def distinct(self, batch) -> tuple[list[tuple[bytes, Texture | None]], np.ndarray]:
        """The batch's textures as (key, texture) with equal keys for equal textures, None for no texture at
        all; and for each of its n primitives the index of its own."""
        n = len(batch)
        if batch.values.shape[1]:
            look = np.where(batch.texture[:, None] >= 0, np.nan_to_num(batch.values), -1.0)
            has_pattern = (batch.texture >= 0) & (batch.values[:, RECORD.values["pattern"].offset] > 0)
        else:
            used, inverse = np.unique(batch.texture, return_inverse=True)
            look = np.array([self._same[node] for node in used.tolist()], float)[inverse][:, None]
            patterns = [
                node >= 0 and self._rows[node][RECORD.values["pattern"].offset] > 0 for node in used.tolist()
            ]
            has_pattern = np.array(patterns)[inverse]
        frame = np.broadcast_to(IDENTITY, (n, 3, 4))
        if batch.frame.shape[1]:
            frame = np.where(has_pattern[:, None, None], batch.frame, IDENTITY)
        table = np.ascontiguousarray(np.concatenate([look, frame.reshape(n, 12)], axis=1)) + 0.0
        keys = table.view(np.dtype((np.void, table.shape[1] * 8)))[:, 0]
        _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        return [(keys[i].tobytes(), self._texture(batch, i, frame[i])) for i in first], inverse

    def _texture(self, batch, i: int, frame: np.ndarray) -> Texture | None:
        node = int(batch.texture[i])
        if node < 0:
            return None
        row = batch.values[i] if batch.values.shape[1] else self._rows[node]
        return Texture(row[~np.isnan(row)], frame, self._nodes[node].name)
