"""Counter-based random numbers on Python integers: pure functions of a 64-bit key.

runtime/bytecode.toml defines them bit by bit, with test vectors; the runtime has the same in random.h.

Example: the first draw of ``rand(3)`` in an application with key k is ``unit(mix(mix(k, bits(3.0)), 0))``.
"""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import Iterable

MASK = 2**64 - 1
TERM = 0x7465726D00000000
CHOICE_STREAM = 0xFFF8000000000001  # a NaN's bits, so that no rand(k) can be it


def finalize(z: int) -> int:
    """splitmix64's finalizer (Steele, Lea & Flood 2014, with Stafford's constants "Mix13")."""
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & MASK
    z = (z ^ z >> 27) * 0x94D049BB133111EB & MASK
    return z ^ z >> 31


def mix(k: int, x: int) -> int:
    """A new key from key k and the number x."""
    return finalize(finalize(x + 0x9E3779B97F4A7C15 & MASK) ^ (k * 0xD1342543DE82EF95 + 0x632BE59BD9B4E019 & MASK))


@lru_cache(maxsize=4096)
def name_hash(name: str) -> int:
    """FNV-1a, 64 bits, of the UTF-8 bytes."""
    value = 0xCBF29CE484222325
    for byte in name.encode():
        value = (value ^ byte) * 0x100000001B3 & MASK
    return value


def bits(a: float) -> int:
    """The IEEE bits, with -0 as +0."""
    return struct.unpack("<Q", struct.pack("<d", a + 0.0))[0]


def unit(x: int) -> float:
    """The upper 53 bits as a number in [0, 1)."""
    return (x >> 11) * 2.0**-53


def seed_key(seed: float) -> int:
    return mix(name_hash("plsys"), bits(seed))


def hash_of(key: int, values: Iterable[float]) -> float:
    """``hash(a, …)`` under a scene's seed key."""
    h = mix(key, name_hash("hash"))
    for value in values:
        h = mix(h, bits(value))
    return unit(h)
