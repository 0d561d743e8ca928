"""A scene to trace: bytecode in; hits, pictures, the unfolding and statistics out.

    >>> scene = Scene(data)
    >>> scene.intersect([[0, -9, 3]], [[0, 1, 0]]).t
    array([8.85])

Units: positions and distances in scene units, row-major arrays of float64. Directions need not be unit length: t counts
them. A Scene may be used by several threads; after close() every call is a PlsysRuntimeError.
"""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

from . import arguments
from .binding import ACCELERATORS, ANTIALIAS, CHANNELS, INSTRUCTION_SETS, PlError, PlHits, PlOptions, PlRenderOptions
from .binding import PlStatistics, library, pointer
from .errors import PlsysRuntimeError, RuntimeArgumentError

if TYPE_CHECKING:
    import numpy as np

UNKNOWN = 2**64 - 1
BATCH = 65536


@contextmanager
def _keeping_interrupts(raised: list[BaseException]) -> Iterator[None]:
    """Ctrl-C is kept in ``raised``. Python raises it before the first line of a function that C calls, where nothing can
    catch it and ctypes drops it."""
    is_ours = threading.current_thread() is threading.main_thread()
    if not is_ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda *_: raised.append(KeyboardInterrupt()))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


class Hits(NamedTuple):
    """The foremost hits of n rays.

    t (n,): distance in multiples of the direction, inf: none · primitive (n,) int64: index in derivation order, -1:
    none · symbol (n,) int32: index of the innermost symbol, -1: none · normal (n, 3): unit, as the shape has it
    (outward; flat shapes +z), zero without a hit · depth (n,) int32: symbols entered · rule (n,) int32: index of the
    innermost rule, -1: none · bound (n,): error bound of t, NaN until known.
    """

    t: np.ndarray
    primitive: np.ndarray
    symbol: np.ndarray
    normal: np.ndarray
    depth: np.ndarray
    rule: np.ndarray
    bound: np.ndarray


class Batch(NamedTuple):
    """n primitives of the unfolding, in derivation order.

    kind (n,) int32: shape id of bytecode.toml, 0: mesh · matrix (n, 3, 4): unit shape to world · argument (n,): the
    shape's argument, or the mesh's index · texture (n,) int32: for Scene.texture, -1: none · symbol, depth as in Hits.
    """

    kind: np.ndarray
    matrix: np.ndarray
    argument: np.ndarray
    texture: np.ndarray
    symbol: np.ndarray
    depth: np.ndarray


class Scene:
    """Bytecode, ready to be traced.

    accelerator: "auto" (bvh), "none" (the paper's chapter 2), "boxes" (chapter 3), "grid" (chapter 4) or
    "bvh"; all give the same hits. grid: voxels of "grid" along x, y and z (None: 16, 16, 8).
    memory: bytes that states and structures may take (None: chosen by the machine). threads: None for one a core.
    povray_epsilon: POV-Ray's hit and shadow tolerances when rendering. isa ("scalar", "avx2", "avx512") and front_items
    (2**64 - 1: all): the instruction set and the items a front of bvh may have, which the machine and the memory decide
    otherwise; no result depends on them. detail: pixel footprints below which instances are drawn as boxes when rendering (0:
    never; None: never, but 0.5 in endless scenes). PlsysRuntimeError for bytes that aren't valid
    bytecode, scenes that can't be derived, and limits.
    """

    def __init__(
        self,
        bytecode: bytes,
        accelerator: str = "auto",
        memory: int | None = None,
        threads: int | None = None,
        povray_epsilon: bool = False,
        grid: tuple[int, int, int] | None = None,
        isa: str = "auto",
        front_items: int | None = None,
        detail: float | None = None,
    ) -> None:
        self._handle: int | None = None
        self._users = 0
        self._closed = False
        self._lock = threading.RLock()  # __del__ may run while this thread holds it
        data = arguments.bytecode_bytes(bytecode)
        options = PlOptions(
            accelerator=arguments.choice("accelerator", accelerator, ACCELERATORS),
            threads=arguments.count("threads", threads, 0, 1024),
            memory=arguments.count("memory", memory, 0, 2**63 - 1),
            povray_epsilon=bool(povray_epsilon),
            grid=arguments.voxels(grid),
            isa=arguments.choice("isa", isa, INSTRUCTION_SETS),
            front_items=arguments.count("front_items", front_items, 0, UNKNOWN),
            detail=arguments.detail(detail),
        )
        error = PlError()
        self._handle = library().pl_scene_create(data, len(data), ctypes.byref(options), ctypes.byref(error))
        if not self._handle:
            error.raise_()

    # --- life ---

    def close(self) -> None:
        """Free the scene; what still runs (calls of other threads, an unfolding) keeps its memory until it ends.
        Closing twice is fine."""
        with self._lock:
            self._closed = True
        self._free_if_unused()

    def __enter__(self) -> Scene:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        if hasattr(self, "_lock"):
            self.close()

    def _free_if_unused(self) -> None:
        with self._lock:
            handle = None
            if self._closed and self._users == 0:
                handle, self._handle = self._handle, None
        if handle:
            library().pl_scene_destroy(handle)

    @contextmanager
    def _open(self) -> Iterator[int]:
        """The handle, kept alive while it is used."""
        with self._lock:
            if self._closed:
                raise PlsysRuntimeError("scene", "it is closed", "argument")
            self._users += 1
        try:
            yield self._handle
        finally:
            with self._lock:
                self._users -= 1
            self._free_if_unused()

    # --- rays ---

    def intersect(self, origins, directions) -> Hits:
        """The foremost hit of each ray at t > 0. origins, directions: (n, 3) or (3,), finite, directions not zero."""
        import numpy as np

        origins, directions = arguments.rays(origins, directions)
        n = len(origins)
        hits = Hits(
            t=np.empty(n),
            primitive=np.empty(n, np.int64),
            symbol=np.empty(n, np.int32),
            normal=np.empty((n, 3)),
            depth=np.empty(n, np.int32),
            rule=np.empty(n, np.int32),
            bound=np.empty(n),
        )
        error, arrays = PlError(), PlHits(**{name: pointer(array) for name, array in hits._asdict().items()})
        with self._open() as handle:
            if not library().pl_intersect(
                handle, n, pointer(origins), pointer(directions), ctypes.byref(arrays), ctypes.byref(error)
            ):
                error.raise_()
        return hits

    def occluded(self, origins, directions, distance=None) -> np.ndarray:
        """(n,) bool: whether something stands at 0 < t < distance. distance: (n,), a number, or None for any."""
        import numpy as np

        origins, directions = arguments.rays(origins, directions)
        n = len(origins)
        if distance is not None:
            try:
                distance = np.ascontiguousarray(np.broadcast_to(np.asarray(distance, np.float64), (n,)))
            except (TypeError, ValueError):
                raise RuntimeArgumentError("distance", f"expected a number or {n} of them, one a ray") from None
        result, error = np.zeros(n, np.uint8), PlError()
        addresses = [pointer(array) for array in (origins, directions, distance, result)]
        with self._open() as handle:
            if not library().pl_occluded(handle, n, *addresses, ctypes.byref(error)):
                error.raise_()
        return result.astype(bool)

    # --- pictures ---

    def render(
        self,
        width: int,
        height: int,
        antialias: str = "off",
        samples: int = 0,
        threshold: float = 0.0,
        channels: tuple[str, ...] = ("color",),
        progress: Callable[[float], object] | None = None,
    ) -> dict[str, np.ndarray]:
        """Draw the scene through its camera; arrays by channel, row 0 on top.

        channels: color (h, w, 3) float32, linear and unclipped · srgb (h, w, 3) uint8, linear16 (h, w, 3) uint16: the same as
        :func:`quantise` gives them · depth (h, w) float32, inf: none · normal, position (h, w, 3) float32 · primitive (h, w) int64 · symbol, rule, recursion, boxes, miss_depth (h, w) int32.
        antialias: "off", "grid" (centre and samples² sub-cells) or "adaptive" (to depth `samples` where colours differ by
        more than `threshold`). progress: called now and then with the share done; returning False cancels.
        """
        import numpy as np

        width, height = _sides(width, height)
        planes = {}
        for name in (channels,) if isinstance(channels, str) else channels:
            dtype, components = CHANNELS[arguments.name("channel", name, tuple(CHANNELS))]
            planes[name] = np.zeros((height, width) if components == 1 else (height, width, components), dtype)
        self.render_into(planes, width, height, antialias, samples, threshold, progress)
        return planes

    def render_into(
        self,
        planes: Mapping[str, object],
        width: int,
        height: int,
        antialias: str = "off",
        samples: int = 0,
        threshold: float = 0.0,
        progress: Callable[[float], object] | None = None,
    ) -> None:
        """As :meth:`render`, into writable, contiguous buffers of the channels' types: a bytearray, an array. It does
        without NumPy."""
        width, height = _sides(width, height)
        raised: list[BaseException] = []
        options = PlRenderOptions(
            width=width,
            height=height,
            antialias=arguments.choice("antialias", antialias, ANTIALIAS),
            samples=arguments.count("samples", samples, 0, 256),
            threshold=float(threshold),
            progress=arguments.callback(progress, raised),
        )
        channels, error = arguments.planes(planes, width * height), PlError()
        with self._open() as handle, _keeping_interrupts(raised):
            done = library().pl_render(handle, ctypes.byref(options), ctypes.byref(channels), ctypes.byref(error))
        if raised:
            raise raised[0]
        if not done:
            error.raise_()

    # --- what it is made of ---

    def unfold(self, batch: int = BATCH) -> Iterator[Batch]:
        """All primitives in derivation order, at most `batch` at a time; memory doesn't grow with their number."""
        import numpy as np

        batch = arguments.count("batch", batch, 1, 2**31)
        error = PlError()
        with self._open() as handle:
            unfolding = library().pl_unfold_begin(handle, ctypes.byref(error))
            if not unfolding:
                error.raise_()
            try:
                while True:
                    arrays = Batch(
                        kind=np.empty(batch, np.int32),
                        matrix=np.empty((batch, 3, 4)),
                        argument=np.empty(batch),
                        texture=np.empty(batch, np.int32),
                        symbol=np.empty(batch, np.int32),
                        depth=np.empty(batch, np.int32),
                    )
                    addresses = [pointer(array) for array in arrays]
                    count = library().pl_unfold_next(unfolding, batch, *addresses, ctypes.byref(error))
                    if count < 0:
                        error.raise_()
                    if count == 0:
                        return
                    yield Batch(*(array[:count] for array in arrays))
            finally:
                library().pl_unfold_end(unfolding)

    def texture(self, index: int) -> np.ndarray:
        """The values of a texture of the unfolding (bytecode.toml's texture record, entries at the end), as they are
        before parameters change some of them."""
        import numpy as np

        size = ctypes.c_uint32()
        with self._open() as handle:
            values = library().pl_scene_texture(handle, arguments.count("texture", index, 0, 2**31 - 1), ctypes.byref(size))
            if not values:
                raise RuntimeArgumentError("texture", f"there is no texture {index}")
            return np.array(values[: size.value])

    @property
    def statistics(self) -> dict:
        """Counts and costs so far.

        primitives (that symbols generate; None: more than 2⁶⁴, or unknown as without states), states, depth (symbols on a
        path), scene_bytes, singular (dropped subtrees), box_tests, primitive_tests, bailout, trace_level, rays {primary, shadow, reflection,
        transmitted}, seconds {verify, build, trace, trace_cpu: that its threads ran, first_pixel: of the last rendering, from
        its start}, accelerator, threads,
        detail (the cut-off in pixels, 0: none), cut {instances: rays that ended at a cut instance's box, max_error: the
        largest error bound of their distance, in scene units}, lazy {unfolded, evicted: states, where there are too many to
        build; found: times that a ray came to one in memory; states, bytes, classes: of these in memory now; visited: nodes, to bound
        classes}.

        Of bvh: isa (None: another accelerator), front {count, items, instances: items that are one, limit: items that one
        has, None: everything; where not everything fits, pilot_rays, pilot_seconds, entries: instances that a ray is then expected to enter,
        flat_bytes: what everything would take}, instances (entered), filtered (primitives tried in single precision). bytes {program, meshes,
        states, nodes, items} is scene_bytes by structure; seconds["states"] is a part of seconds["build"]. terrain {tiles,
        triangles, bytes, node_bytes}: of regular subdivisions, which have neither states nor fronts; their bytes are among items
        and nodes.
        """
        counts = PlStatistics()
        with self._open() as handle:
            library().pl_scene_statistics(handle, ctypes.byref(counts))
        result: dict = {"rays": {}, "seconds": {}, "cut": {}, "lazy": {}, "front": {}, "terrain": {}, "bytes": {}}
        for name, _ in PlStatistics._fields_:
            group, _, member = name.partition("_")
            place = result[group] if group in result else result
            place[member if group in result else name] = getattr(counts, name)
        result["accelerator"] = ACCELERATORS[counts.accelerator]
        result["isa"] = INSTRUCTION_SETS[counts.isa] if counts.isa else None
        for group, name in ((result, "primitives"), (result, "depth"), (result["front"], "limit")):
            if group[name] == UNKNOWN:
                group[name] = None
        return result

    def symbol_name(self, symbol: int) -> str:
        """The name of a symbol of Hits, "" for -1."""
        with self._open() as handle:
            return library().pl_symbol_name(handle, int(symbol)).decode()

    def rule_place(self, rule: int) -> str:
        """ "file:line:column" of a rule of Hits, "" for -1."""
        with self._open() as handle:
            return library().pl_rule_place(handle, int(rule)).decode()


def disassemble(bytecode: bytes) -> str:
    """Bytecode as text, one line a node, as ``plsys disassemble`` prints it."""
    data, error = arguments.bytecode_bytes(bytecode), PlError()
    text = library().pl_disassemble(data, len(data), ctypes.byref(error))
    if not text:
        error.raise_()
    try:
        return ctypes.string_at(text).decode()
    finally:
        library().pl_free(text)


def quantise(linear: np.ndarray, kind: str) -> np.ndarray:
    """Linear values as picture files of integers have them, floor(clip(x, 0, 1)·most + ½): "srgb" uint8 (IEC 61966-2-1)
    or "linear16" uint16, in the array's shape."""
    import numpy as np

    linear = np.ascontiguousarray(linear, np.float32)
    values = np.empty(linear.shape, CHANNELS[arguments.name("kind", kind, ("srgb", "linear16"))][0])
    outputs = (pointer(values), None) if kind == "srgb" else (None, pointer(values))
    library().pl_quantise(linear.size, pointer(linear), *outputs)
    return values


def _sides(width: object, height: object) -> tuple[int, int]:
    return arguments.count("width", width, 1, 2**20), arguments.count("height", height, 1, 2**20)
