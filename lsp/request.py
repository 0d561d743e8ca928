"""What a feature gets: the request, and the document that it is about.

Example::

    def definition(request: Request) -> list[dict]:
        found = request.document.name_at(request.offset)
        …
        return [request.location(place) for place in meaning.definitions]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Callable, NamedTuple

from plsys.compiler.analysis import Document, Place, Scene

from .text import Positions
from .workspace import Workspace


@dataclass
class Request:
    """``params`` are the protocol's parameters as plain JSON; ``client`` the client's capabilities, as plain JSON."""

    workspace: Workspace
    params: dict[str, Any]
    client: dict[str, Any]

    @cached_property
    def document(self) -> Document:
        return self.workspace.document(self.params["textDocument"]["uri"])

    @cached_property
    def scene(self) -> Scene:
        """The document's scene, with all that edits touched resolved. (Of a long file that is just being opened, with
        what is known by now: see EARLY in session.py.)"""
        scene = self.workspace.scene(self.document)
        if not scene.is_opening or self.document.version is None:
            scene.work()
        return scene

    @cached_property
    def positions(self) -> Positions:
        return self.workspace.positions(self.document)

    @cached_property
    def offset(self) -> int:
        """The byte at ``params.position``."""
        position = self.params["position"]
        return self.positions.offset(position["line"], position["character"])

    @cached_property
    def offsets(self) -> tuple[int, int]:
        """The bytes of ``params.range``; of the whole text where there is none."""
        range_ = self.params.get("range")
        return self.positions.offsets(range_) if range_ else (0, len(self.document.text))

    def range(self, start: int, end: int) -> dict:
        """The protocol's Range of bytes of this document."""
        return self.positions.range(start, end)

    def location(self, place: Place) -> dict:
        """The protocol's Location of a place in any file."""
        return self.workspace.location(place)

    def supports(self, *path: str) -> Any:
        """A client capability, such as ``supports("textDocument", "completion", "completionItem", "snippetSupport")``."""
        value: Any = self.client
        for key in path:
            value = value.get(key) if isinstance(value, dict) else None
        return value


class Feature(NamedTuple):
    """A row of a feature module's FEATURES: the protocol's method, what answers it, and what to put into the server's
    capabilities: the key, and its value (True or the options)."""

    method: str
    answer: Callable[[Request], Any]
    capability: str = ""
    options: Any = True
