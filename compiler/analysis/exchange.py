"""What the language server and the process of the whole-file checks say to each other.

A :class:`Request` brings the worker's copy of a scene up to date; each is followed by :class:`Answer`\\ s, up to one without
``more`` or up to the next request. Places are numbers: of a file, of a block in it, and bytes in the block.

Example: after an edit of block 7 of the only file, of 20 blocks, ``Request(2, 1, (FileText("a.plsys", None, ((0, 7), NewBlock(b"…", role), (8, 20))),))``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from .insights import Placed
from .parts import Role


class NewBlock(NamedTuple):
    """The text of a block and its role in the scene, so that the worker reads only what it checks."""

    text: bytes
    role: Role


class FileText(NamedTuple):
    """A file of a snapshot in ``pieces``: new blocks, and ranges (start, end) of the last request's blocks. ``wrong`` are the
    numbers of blocks that are known to have errors."""

    name: str
    path: Path | None
    pieces: tuple[NewBlock | tuple[int, int], ...]
    wrong: tuple[int, ...] = ()

    @property
    def blocks(self) -> list[NewBlock]:
        """The new blocks."""
        return [piece for piece in self.pieces if isinstance(piece, NewBlock)]


class Request(NamedTuple):
    """What the worker gets: the scene's root first, then included files. ``forget`` are scenes that aren't asked about
    again, unless with all their text."""

    key: int
    scene: int
    files: tuple[FileText, ...]
    forget: tuple[int, ...] = ()


class Finding(NamedTuple):
    """A message in the block with number ``block`` of file ``file``. ``notes`` are (file, block, start, end, message)."""

    file: int
    block: int
    start: int
    end: int
    code: str
    severity: str
    message: str
    hint: str
    notes: tuple[tuple[int, int, int, int, str], ...]


class Answer(NamedTuple):
    """About the texts of the request ``key``. ``findings`` are all about ``blocks`` (file, number), ``general`` all about what
    parts share. ``insights`` are what is shown beside the text of the blocks ``forecast_of``. ``forecast`` is None until
    all is known and where the scene has errors: a dict with the numbers of graph.forecast.Forecast. ``more``: others
    follow, unless the text changes. ``share`` of the parts is done; None while it isn't worth telling. One that
    ``is_piece`` holds some insights of the next one and nothing else (telling.in_pieces)."""

    key: int
    blocks: tuple[tuple[int, int], ...] = ()
    findings: tuple[Finding, ...] = ()
    general: tuple[Finding, ...] = ()
    insights: tuple[Placed, ...] = ()
    forecast_of: tuple[tuple[int, int], ...] = ()
    forecast: dict[str, Any] | None = None
    more: bool = False
    share: float | None = None
    is_piece: bool = False
