"""The language's pure and random functions with the runtime's own bits: numbers in, numbers out.

A thin layer over libelementary, which is built from runtime/elementary.c: an ulp in a guard is another plant,
so compiler, unfolder and runtime have one implementation. NumPy is imported only when an array comes in.

    >>> apply("sin", 30.0), sin(90.0), pow(2.0, 10.0)
    (0.5, 1.0, 1024.0)
    >>> rand(mix(seed_key(7), name_hash("Tree")), bits(0.0), 0)  # the first draw of rand(0)
    0.7593427476879594

Every function takes numbers or arrays: only numbers give a float or int, else the arguments are broadcast
against each other and an array comes back (float64; uint64 for keys, hashes and bits). Angles are in degrees.
Nothing raises for a value out of a function's domain: the result is NaN or infinite, as in IEEE arithmetic.
"""

from __future__ import annotations

import ctypes
from functools import partial
from pathlib import Path

from .bytecode.layout_rows import LIMITS, OPCODES, RANDOM

_LIBRARY = Path(__file__).with_name("libelementary.so")
_MASK = 2**64 - 1

PURE = frozenset(
    name for name, row in OPCODES.items() if 6 <= row.id < 50 and row.pushes == 1 and row.operand == ""
)
"""The opcodes that ``apply`` knows: those that need nothing but their arguments."""

TERM = RANDOM["term"]
CHOICE_STREAM = RANDOM["choice_stream"]


def _load() -> ctypes.CDLL:
    try:
        library = ctypes.CDLL(str(_LIBRARY))
    except OSError as error:
        raise ImportError(
            f"{_LIBRARY.name} is missing or can't be loaded: build it with 'make dev' ({error})"
        ) from None
    double, size, u64, pointer = ctypes.c_double, ctypes.c_size_t, ctypes.c_uint64, ctypes.c_void_p
    for name, result, arguments in (
        ("pl_elementary", double, (ctypes.c_int, double, double, double)),
        ("pl_elementary_array", ctypes.c_bool, (ctypes.c_int, size, pointer, pointer, pointer, pointer)),
        ("pl_name_hash_of", u64, (ctypes.c_char_p, size)),
        ("pl_seed_key_of", u64, (double,)),
        ("pl_mix_array", None, (size, pointer, pointer, pointer)),
        ("pl_bits_array", None, (size, pointer, pointer)),
        ("pl_rand_array", None, (size, pointer, pointer, pointer, pointer)),
        ("pl_hash_array", None, (size, u64, size, pointer, pointer)),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


_library = _load()


# --- pure functions ---


def apply(operation: str, *values: float) -> float:
    """The value of the opcode ``operation`` for the numbers it takes. KeyError if it isn't one of PURE."""
    row = _row(operation, len(values))
    return _library.pl_elementary(row.id, *map(float, values), *(0.0,) * (3 - len(values)))


def apply_array(operation: str, *arrays: object) -> object:
    """``apply`` for arrays of one shape, or shapes that broadcast: a float64 array."""
    import numpy as np

    row = _row(operation, len(arrays))
    inputs = _broadcast(arrays, np.float64)
    out = np.empty(inputs[0].shape)
    pointers = [a.ctypes.data for a in inputs] + [None] * (3 - len(inputs))
    _library.pl_elementary_array(row.id, out.size, *pointers, out.ctypes.data)
    return out


def _row(operation: str, count: int):
    if operation not in PURE:
        raise KeyError(operation)
    row = OPCODES[operation]
    if count != row.pops:
        raise TypeError(f"{operation} takes {row.pops} arguments, not {count}")
    return row


def _broadcast(values, dtype) -> list:
    """C-contiguous arrays of one shape."""
    import numpy as np

    return [
        np.ascontiguousarray(a)
        for a in np.broadcast_arrays(*(np.asarray(value, dtype=dtype) for value in values))
    ]


def _is_array(value: object) -> bool:
    return getattr(value, "ndim", 0) > 0


def _either(operation: str, *values):
    return (apply_array if any(map(_is_array, values)) else apply)(operation, *values)


sin = partial(_either, "sin")
cos = partial(_either, "cos")
tan = partial(_either, "tan")
asin = partial(_either, "asin")
acos = partial(_either, "acos")
atan2 = partial(_either, "atan2")
exp = partial(_either, "exp")
log = partial(_either, "log")
pow = partial(_either, "pow")


# --- random numbers (runtime/bytecode.toml, "random") ---


def name_hash(name: str) -> int:
    """FNV-1a of the UTF-8 bytes."""
    encoded = name.encode()
    return _library.pl_name_hash_of(encoded, len(encoded))


def seed_key(seed: float) -> int:
    """The key that a scene's seed gives."""
    return _library.pl_seed_key_of(float(seed))


def mix(k, x):
    """The key made of key ``k`` and the number ``x``, both unsigned 64-bit. Not the language's mix(a, b, t),
    which is ``apply("mix", a, b, t)``."""
    if not (_is_array(k) or _is_array(x)):
        return _one(_library.pl_mix_array, ctypes.c_uint64, (k, x))
    return _many(_library.pl_mix_array, (k, x), float_result=False)


def term_key(key, term):
    """The key of term number ``term`` of a union whose key is ``key``."""
    return mix(key, TERM + term if not _is_array(term) else term.astype("uint64") + _uint64(TERM))


def bits(value):
    """The IEEE bits of a double, those of +0 for -0: what names a stream of ``rand``."""
    if not _is_array(value):
        number, result = ctypes.c_double(value), ctypes.c_uint64()
        _library.pl_bits_array(1, ctypes.byref(number), ctypes.byref(result))
        return result.value
    import numpy as np

    (values,) = _broadcast((value,), np.float64)
    out = np.empty(values.shape, dtype=np.uint64)
    _library.pl_bits_array(out.size, values.ctypes.data, out.ctypes.data)
    return out


def unit(x):
    """The upper 53 bits as a number in [0, 1)."""
    if not _is_array(x):
        return (int(x) >> 11) * 2.0**-53
    return (x >> _uint64(11)).astype("float64") * 2.0**-53


def rand(key, stream_bits, ordinal):
    """Draw number ``ordinal`` (from 0) on the stream with these bits under this application's key: [0, 1)."""
    if not any(map(_is_array, (key, stream_bits, ordinal))):
        return _one(_library.pl_rand_array, ctypes.c_double, (key, stream_bits, ordinal))
    return _many(_library.pl_rand_array, (key, stream_bits, ordinal), float_result=True)


def hash(seed_key: int, *arguments):
    """The language's hash(a, …) of 1 to 16 numbers or arrays, in [0, 1)."""
    if not 1 <= len(arguments) <= LIMITS["hash_arguments"]:
        raise TypeError(f"hash takes 1 to {LIMITS['hash_arguments']} arguments, not {len(arguments)}")
    count = len(arguments)
    if not any(map(_is_array, arguments)):
        numbers, result = (ctypes.c_double * count)(*arguments), ctypes.c_double()
        _library.pl_hash_array(1, int(seed_key), count, numbers, ctypes.byref(result))
        return result.value
    import numpy as np

    rows = np.stack(_broadcast(arguments, np.float64), axis=-1)
    out = np.empty(rows.shape[:-1])
    _library.pl_hash_array(out.size, int(seed_key), count, rows.ctypes.data, out.ctypes.data)
    return out


def _uint64(value: int):
    import numpy as np

    return np.uint64(value)


def _one(function, result_type, values):
    """A function on arrays of keys, for one number each."""
    result = result_type()
    function(
        1, *(ctypes.byref(ctypes.c_uint64(int(value) & _MASK)) for value in values), ctypes.byref(result)
    )
    return result.value


def _many(function, values, *, float_result: bool):
    import numpy as np

    inputs = _broadcast(values, np.uint64)
    out = np.empty(inputs[0].shape, dtype=np.float64 if float_result else np.uint64)
    function(out.size, *(a.ctypes.data for a in inputs), out.ctypes.data)
    return out
