"""libplsys through ctypes: plsys.h's structs and functions, loaded on first use from beside this file.

    >>> error = PlError()
    >>> handle = library().pl_scene_create(data, len(data), ctypes.byref(PlOptions()), ctypes.byref(error))
    >>> if not handle: error.raise_()

Pointers to arrays are passed as addresses (``pointer``); whoever calls keeps the arrays alive and C-contiguous.
"""

from __future__ import annotations

import ctypes
from ctypes import POINTER, c_bool, c_char, c_char_p, c_double, c_int, c_int32, c_int64, c_size_t, c_uint32, c_uint64, c_void_p
from functools import cache
from pathlib import Path

from .errors import KINDS, PlsysRuntimeError, RuntimeArgumentError

LIBRARY = Path(__file__).with_name("libplsys.so")
ACCELERATORS = ("auto", "none", "boxes", "bvh", "grid")
INSTRUCTION_SETS = ("auto", "scalar", "avx2", "avx512")
ANTIALIAS = ("off", "grid", "adaptive")


class PlError(ctypes.Structure):
    """pl_error."""

    _fields_ = [("code", c_int), ("place", c_char * 256), ("reason", c_char * 512)]

    def raise_(self) -> None:
        """Raise what C filled in, as an exception of the family."""
        place, reason = self.place.decode("utf-8", "replace"), self.reason.decode("utf-8", "replace")
        kind = KINDS[self.code] if 0 < self.code < len(KINDS) else "scene"
        if kind == "argument":
            raise RuntimeArgumentError(place, reason)
        raise PlsysRuntimeError(place, reason, kind)


class PlOptions(ctypes.Structure):
    """pl_options."""

    _fields_ = [
        ("accelerator", c_int),
        ("threads", c_int),
        ("memory", c_size_t),
        ("povray_epsilon", c_bool),
        ("grid", c_uint32 * 3),
        *(("isa", c_int), ("front_items", c_uint64)),
        ("detail", c_double),
    ]


class PlHits(ctypes.Structure):
    """pl_hits: addresses of arrays, None for those not wanted."""

    _fields_ = [(name, c_void_p) for name in ("t", "primitive", "symbol", "rule", "depth", "normal", "bound")]


Progress = ctypes.CFUNCTYPE(c_bool, c_void_p, c_double)


class PlRenderOptions(ctypes.Structure):
    """pl_render_options."""

    _fields_ = [
        ("width", c_int),
        ("height", c_int),
        ("antialias", c_int),
        ("samples", c_int),
        ("threshold", c_double),
        ("progress", Progress),
        ("context", c_void_p),
    ]


# Channel → (NumPy dtype, components), in the order of pl_channels.
CHANNELS = {
    "color": ("float32", 3),
    "depth": ("float32", 1),
    "normal": ("float32", 3),
    "position": ("float32", 3),
    "primitive": ("int64", 1),
    "symbol": ("int32", 1),
    "rule": ("int32", 1),
    "recursion": ("int32", 1),
    "boxes": ("int32", 1),
    "miss_depth": ("int32", 1),
    "srgb": ("uint8", 3),
    "linear16": ("uint16", 3),
}

ITEM_BYTES = {"uint8": 1, "uint16": 2, "int32": 4, "int64": 8, "float32": 4}


class PlChannels(ctypes.Structure):
    """pl_channels: addresses of planes, None for those not wanted."""

    _fields_ = [(name, c_void_p) for name in CHANNELS]


class PlStatistics(ctypes.Structure):
    """pl_statistics."""

    _fields_ = [
        *((name, c_uint64) for name in ("primitives", "states", "depth", "scene_bytes")),
        *((f"rays_{name}", c_uint64) for name in ("primary", "shadow", "reflection", "transmitted")),
        *((name, c_uint64) for name in ("box_tests", "primitive_tests", "singular", "bailout", "trace_level")),
        *((f"seconds_{name}", c_double) for name in ("verify", "build", "trace")),
        ("accelerator", c_int),
        ("threads", c_int),
        ("detail", c_double),
        ("cut_instances", c_uint64),
        ("cut_max_error", c_double),
        *((f"lazy_{name}", c_uint64) for name in ("unfolded", "evicted", "states", "bytes", "classes")),
        *((name, c_uint64) for name in ("instances", "filtered")),
        *((f"front_{name}", c_uint64) for name in ("count", "items", "instances", "limit")),
        *((f"bytes_{name}", c_uint64) for name in ("program", "meshes", "states", "nodes", "items")),
        ("seconds_states", c_double),
        ("isa", c_int),
        ("lazy_found", c_uint64),
        ("terrain_tiles", c_uint64),
        ("seconds_first_pixel", c_double),
        *((f"front_{name}", c_uint64) for name in ("pilot_rays", "flat_bytes")),
        ("front_entries", c_double),
        ("front_pilot_seconds", c_double),
        ("terrain_triangles", c_uint64),
        ("terrain_bytes", c_uint64),
        ("terrain_node_bytes", c_uint64),
        ("seconds_trace_cpu", c_double),
        ("lazy_visited", c_uint64),
    ]


_ERROR = POINTER(PlError)

# Function → (result, arguments).
_FUNCTIONS = {
    "pl_scene_create": (c_void_p, [c_char_p, c_size_t, POINTER(PlOptions), _ERROR]),
    "pl_scene_destroy": (None, [c_void_p]),
    "pl_intersect": (c_bool, [c_void_p, c_size_t, c_void_p, c_void_p, POINTER(PlHits), _ERROR]),
    "pl_occluded": (c_bool, [c_void_p, c_size_t, c_void_p, c_void_p, c_void_p, c_void_p, _ERROR]),
    "pl_render": (c_bool, [c_void_p, POINTER(PlRenderOptions), POINTER(PlChannels), _ERROR]),
    "pl_quantise": (None, [c_size_t, c_void_p, c_void_p, c_void_p]),
    "pl_scene_statistics": (None, [c_void_p, POINTER(PlStatistics)]),
    "pl_symbol_name": (c_char_p, [c_void_p, c_int32]),
    "pl_rule_place": (c_char_p, [c_void_p, c_int32]),
    "pl_scene_texture": (POINTER(c_double), [c_void_p, c_int32, POINTER(c_uint32)]),
    "pl_unfold_begin": (c_void_p, [c_void_p, _ERROR]),
    "pl_unfold_next": (c_int64, [c_void_p, c_size_t, *[c_void_p] * 6, _ERROR]),
    "pl_unfold_end": (None, [c_void_p]),
    "pl_disassemble": (c_void_p, [c_char_p, c_size_t, _ERROR]),
    "pl_free": (None, [c_void_p]),
}


@cache
def library() -> ctypes.CDLL:
    """The loaded library. PlsysRuntimeError if it is missing or another version."""
    try:
        loaded = ctypes.CDLL(str(LIBRARY))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(loaded, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise PlsysRuntimeError(LIBRARY.name, f"can't be loaded, build it with 'make dev' ({error})", "output") from None
    return loaded


def pointer(array) -> int | None:
    """The address of a NumPy array's first element."""
    return None if array is None else array.ctypes.data
