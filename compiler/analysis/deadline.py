"""When to pause: so much processor time from now on, or as soon as something more urgent waits.

Seconds → whether they are over. On a busy machine a slice of work takes longer and comes as far. The thread's own clock is
read through the system, which takes some microseconds on some; so it is asked only when, by the common one, time may be over,
and that one after some steps only.

Example::

    deadline = Deadline(0.004)
    while work_is_left and not deadline.has_passed(): …
"""

from __future__ import annotations

import time
from typing import Callable

# Steps between two looks at a clock.
STEPS = 4


class Deadline:
    """``is_urgent`` tells whether something waits that can't wait for the rest of the time."""

    def __init__(self, seconds: float, is_urgent: Callable[[], bool] = lambda: False) -> None:
        self._is_urgent = is_urgent
        self._end = time.thread_time() + seconds
        self._earliest = time.perf_counter() + seconds  # it isn't over before: no thread runs longer than time goes by
        self._steps = 0

    def has_passed(self) -> bool:
        """To be asked after each step, of a fraction of a millisecond."""
        self._steps += 1
        if self._steps % STEPS:
            return False
        if self._is_urgent():
            return True
        now = time.perf_counter()
        if now < self._earliest:
            return False
        left = self._end - time.thread_time()
        self._earliest = now + left
        return left <= 0
