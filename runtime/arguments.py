"""What callers of plsys.runtime pass in, as C wants it; RuntimeArgumentError says what was given and what was expected.

    >>> choice("accelerator", "bvh", ("auto", "none", "bvh"))
    2
    >>> count("threads", None, 0, 1024)
    0
"""

from __future__ import annotations

import ctypes
import math
import operator
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from .binding import CHANNELS, ITEM_BYTES, PlChannels, Progress
from .errors import RuntimeArgumentError

if TYPE_CHECKING:
    import numpy as np


def bytecode_bytes(bytecode: object) -> bytes:
    if not isinstance(bytecode, (bytes, bytearray, memoryview)):
        raise RuntimeArgumentError("bytecode", f"expected bytes, not {type(bytecode).__name__}")
    return bytes(bytecode)


def name(what: str, value: object, names: tuple[str, ...]) -> str:
    if value not in names:
        raise RuntimeArgumentError(what, f"{value!r} is none of {', '.join(names)}")
    return value


def choice(what: str, value: object, names: tuple[str, ...]) -> int:
    return names.index(name(what, value, names))


def count(what: str, value: object, low: int, high: int) -> int:
    """An integer of [low, high]; None is 0."""
    try:
        number = 0 if value is None else operator.index(value)
    except TypeError:
        raise RuntimeArgumentError(what, f"expected an integer, not {value!r}") from None
    if not low <= number <= high:
        raise RuntimeArgumentError(what, f"{number} is not between {low} and {high}")
    return number


def voxels(grid: object) -> tuple[int, int, int]:
    try:
        sides = (0, 0, 0) if grid is None else tuple(grid)
    except TypeError:
        sides = ()
    if len(sides) != 3:
        raise RuntimeArgumentError("grid", f"expected three numbers of voxels, not {grid!r}")
    return tuple(count("grid", side, 0 if grid is None else 1, 2**26) for side in sides)


def detail(value: object) -> float:
    """pl_options' detail: there 0 is automatic and what is below 0 is none."""
    if value is None:
        return 0.0
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise RuntimeArgumentError("detail", f"expected a number of pixels, not {value!r}") from None
    if not 0 <= number < math.inf:
        raise RuntimeArgumentError("detail", f"{value} isn't a number of pixels, 0 or more")
    return number or -1.0


def rays(origins, directions) -> tuple[np.ndarray, np.ndarray]:
    """Two contiguous (n, 3) float64 arrays; one may be a single (3,) vector for all rays."""
    import numpy as np

    arrays = []
    for what, value in (("origins", origins), ("directions", directions)):
        try:
            array = np.asarray(value, np.float64)
        except (TypeError, ValueError):
            raise RuntimeArgumentError(what, "expected numbers in an array of shape (n, 3)") from None
        if array.ndim not in (1, 2) or array.shape[-1] != 3:
            raise RuntimeArgumentError(what, f"expected an array of shape (n, 3), not {array.shape}")
        arrays.append(array.reshape(-1, 3) if array.ndim == 1 else array)
    first, second = arrays
    if len(first) != len(second) and 1 not in (len(first), len(second)):
        raise RuntimeArgumentError("rays", f"{len(first)} origins, but {len(second)} directions")
    n = 0 if 0 in (len(first), len(second)) else max(len(first), len(second))
    return tuple(np.ascontiguousarray(np.broadcast_to(array, (n, 3)) if n else array[:0]) for array in arrays)


def planes(given: Mapping[str, object], pixels: int) -> PlChannels:
    """The addresses of writable, contiguous buffers by channel, each with room for `pixels` pixels."""
    addresses = {}
    for channel, buffer in given.items():
        kind, components = CHANNELS[name("channel", channel, tuple(CHANNELS))]
        size = pixels * components * ITEM_BYTES[kind]
        try:
            found = memoryview(buffer).nbytes
            address = ctypes.addressof(ctypes.c_char.from_buffer(buffer))
        except (TypeError, ValueError, BufferError) as error:
            raise RuntimeArgumentError(channel, f"expected a writable, contiguous buffer ({error})") from None
        if found != size:
            raise RuntimeArgumentError(channel, f"a buffer of {found} bytes, but the picture takes {size}")
        addresses[channel] = address
    return PlChannels(**addresses)


def callback(progress: Callable[[float], object] | None, raised: list[BaseException]) -> Progress:
    """A C callback; what Python raises in it cancels and is raised again by the caller. There always is one: Python heeds
    Ctrl-C only while it runs itself (scene.py)."""

    def call(_: object, done: float) -> bool:
        if raised:
            return False
        try:
            return progress is None or progress(done) is not False
        except BaseException as error:
            raised.append(error)
            return False

    return Progress(call)
