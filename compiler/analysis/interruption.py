"""Work that a signal may interrupt, and only there.

A worker's other thread raises the signal when it has news; what is interrupted must leave nothing half done.

Example::

    interruption = Interruption()
    signal.signal(signal.SIGINT, interruption.interrupt)
    try:
        with interruption.allowed():
            result = takes_long()
    except Interrupted:
        ...                             # there is news: look at it first
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import Callable, Iterator


class Interrupted(Exception):
    """Raised in the middle of work that is allowed to be interrupted."""


class Interruption:
    """``has_news`` tells whether there is news already, of which the signal came while nothing could be interrupted. ``left`` is
    what was broken off last: whoever catches it may keep it, as letting go of all that was made takes longer than the news
    should wait."""

    def __init__(self) -> None:
        self._is_allowed = False
        self.has_news: Callable[[], bool] = lambda: False
        self.left: Interrupted | None = None

    @contextmanager
    def allowed(self) -> Iterator[None]:
        self._is_allowed = True
        try:
            if self.has_news():
                raise Interrupted
            yield
        finally:
            self._is_allowed = False

    def interrupt(self, *_: object) -> None:
        """The signal's handler."""
        if self._is_allowed:
            self._is_allowed = False
            raise Interrupted
