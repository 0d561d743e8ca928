"""Work that takes a while, shown by clients that can: a title, a message and how much of it is done.

Example::

    progress = Progress(ask, notify, client_capabilities)
    progress.report("scan", "Reading scenes", "12 of 40 files", 30)     # the first one shows it
    progress.end("scan")
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable


@dataclass
class _Shown:
    token: str
    value: dict[str, Any]
    is_begun: bool = False


class Progress:
    """``ask`` sends a request and calls a function with the answer; ``notify`` sends a notification."""

    def __init__(self, ask: Callable[..., None], notify: Callable[[str, dict], None], client: dict[str, Any]) -> None:
        self._ask, self._notify = ask, notify
        self.is_shown = bool((client.get("window") or {}).get("workDoneProgress"))
        self._shown: dict[str, _Shown] = {}
        self._count = 0

    def report(self, what: str, title: str, message: str, percentage: int) -> None:
        if not self.is_shown:
            return
        value = {"message": message, "percentage": percentage}
        shown = self._shown.get(what)
        if shown is None:
            self._count += 1
            shown = self._shown[what] = _Shown(f"plsys-progress-{self._count}", {"title": title, **value})
            # A token may be used once the client has said that it knows it.
            self._ask("window/workDoneProgress/create", {"token": shown.token}, lambda answer: self._begin(what, shown, answer))
        elif shown.is_begun:
            self._send(shown, {"kind": "report", **value})
        else:
            shown.value.update(value)

    def _begin(self, what: str, shown: _Shown, answer: dict[str, Any]) -> None:
        if self._shown.get(what) is not shown:
            return  # over already
        if "error" in answer:
            self._shown.pop(what)
            return
        shown.is_begun = True
        self._send(shown, {"kind": "begin", "cancellable": False, **shown.value})

    def end(self, what: str) -> None:
        shown = self._shown.pop(what, None)
        if shown is not None and shown.is_begun:
            self._send(shown, {"kind": "end"})

    def _send(self, shown: _Shown, value: dict[str, Any]) -> None:
        self._notify("$/progress", {"token": shown.token, "value": value})
