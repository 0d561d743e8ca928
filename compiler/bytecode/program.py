"""Bytecode in memory: what ``decode`` gives and ``disassemble`` prints, section by section as in the file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from .layout_rows import NodeRow, Opcode, RecordRow


class Instruction(NamedTuple):
    offset: int  # of its first byte in the code section
    row: Opcode
    operand: int | None
    next: int  # offset of the byte after it


class RecordValues(NamedTuple):
    """``values``: defaults filled in, then the entries' numbers."""

    row: RecordRow
    entries: int
    values: tuple[float, ...]


class MeshValues(NamedTuple):
    """Tuples of three numbers each: vertices, normals, vertex indices, normal indices (none without normals)."""

    name: int
    vertices: list[tuple[float, ...]]
    normals: list[tuple[float, ...]]
    triangles: list[tuple[int, ...]]
    normal_triangles: list[tuple[int, ...]]


class Place(NamedTuple):
    """From line and column to the place after the end; ``file`` is a string's index."""

    file: int
    line: int
    column: int
    end_line: int
    end_column: int


@dataclass
class ProgramNode:
    """``fields`` by name, in the row's order: numbers, lists of them, and (weight, body) pairs for cases."""

    row: NodeRow
    fields: dict[str, int | list]
    place: Place | None = None


@dataclass
class Program:
    """A file of bytecode, section by section."""

    strings: list[str] = field(default_factory=list)
    constants: list[float] = field(default_factory=list)
    parameters: list[int] = field(default_factory=list)  # names, as strings' indices
    code: bytes = b""
    pieces: dict[int, list[Instruction]] = field(default_factory=dict)  # by the offset where they start
    records: list[RecordValues] = field(default_factory=list)
    meshes: list[MeshValues] = field(default_factory=list)
    nodes: list[ProgramNode] = field(default_factory=list)
