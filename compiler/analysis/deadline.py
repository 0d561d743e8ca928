"""When to pause: so much processor time from now on.

Seconds → whether they are over. On a busy machine a slice of work takes longer and comes as far. The thread's own clock is
read through the system, which takes some microseconds on some; so it is asked only when, by the common one, time may be over.

Example::

    deadline = Deadline(0.004)
    while work_is_left and not deadline.has_passed(): …
"""

from __future__ import annotations

import time


class Deadline:
    def __init__(self, seconds: float) -> None:
        self._end = time.thread_time() + seconds
        self._earliest = time.perf_counter() + seconds  # it isn't over before: no thread runs longer than time goes by

    def has_passed(self) -> bool:
        now = time.perf_counter()
        if now < self._earliest:
            return False
        left = self._end - time.thread_time()
        self._earliest = now + left
        return left <= 0
