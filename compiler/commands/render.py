"""Draw a scene.

Writes any format that OpenImageIO writes: .png and .jpg in sRGB, .exr, .tif and .hdr as linear floats. With --aov,
extra channels go into the same .exr file, or beside other formats into files named OUT.CHANNEL.exr.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..reading.diagnostics import PlsysError
from .common import add_scene_arguments, build_scene, print_json, size

ACCELERATORS = ("auto", "none", "boxes", "grid", "bvh")
ANTIALIAS = "off, grid=N (centre and N×N sub-cells), or adaptive[=DEPTH[,THRESHOLD]]"

# Seconds of rendering without a progress bar.
PATIENCE = 0.5

# Channel name → the names of its components in a file; `picture1` is made from two of the runtime's channels.
AOVS = {
    "depth": ("Z",),
    "normal": ("N.x", "N.y", "N.z"),
    "position": ("P.x", "P.y", "P.z"),
    "primitive": ("primitive.high", "primitive.low"),
    "symbol": ("symbol",),
    "rule": ("rule",),
    "recursion": ("recursion",),
    "boxes": ("boxes",),
    "picture1": ("picture1.R", "picture1.G", "picture1.B"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scene_arguments(parser, "a .plsys file, or bytecode (.plsb)")
    parser.add_argument("-o", dest="output", metavar="OUT", required=True, help="the picture: .png, .exr, .tif, …")
    parser.add_argument("--size", type=size, default=(640, 480), metavar="WxH", help="in pixels (default 640x480)")
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="default: one a core")
    parser.add_argument("--accel", choices=ACCELERATORS, default="auto", help="accelerator")
    parser.add_argument(
        "--memory", type=memory, metavar="SIZE", help="of states and structures: 64K, 1M, 2G (default: by the caches)"
    )
    parser.add_argument(
        "--front", type=front, metavar="K", help="at most K items in a front of bvh, or all (default: by the memory)"
    )
    parser.add_argument("--grid", type=voxels, metavar="NxMxK", help="voxels of --accel grid (default 16x16x8)")
    parser.add_argument("--antialias", type=antialias, default=("off", 0, 0.0), metavar="A", help=ANTIALIAS)
    parser.add_argument("--aov", type=aov_names, default=(), metavar="A,B", help=f"extra channels: {', '.join(AOVS)}")
    parser.add_argument("--linear16", action="store_true", help="16-bit linear values instead of 8-bit sRGB")
    parser.add_argument(
        "--povray-epsilon", action="store_true", help="POV-Ray's hit and shadow tolerances (as `compare` does)"
    )
    parser.add_argument(
        "--detail", type=pixels, metavar="PX", help="draw what is smaller than PX pixels as a box (0: nothing; default: 0, but 0.5 where a recursion has no end)"
    )
    parser.add_argument("--explain", action="store_true", help="say what was built, and what was left out and why")
    parser.add_argument("--statistics", action="store_true", help="print counts of rays and tests, seconds and bytes")


def memory(text: str) -> int:
    """``64K`` → 65536; K, M, G and T are powers of 1024."""
    exponent = "KMGT".find(text[-1:].upper()) + 1 if text else 0
    try:
        size = int(float(text[:-1] if exponent else text) * 1024**exponent)
    except (ValueError, OverflowError):
        size = 0
    if not 1 <= size < 2**63:
        raise argparse.ArgumentTypeError(f"'{text}' isn't a size in bytes, such as 64K, 1M or 2G")
    return size


def front(text: str) -> int:
    """``21`` → 21; ``all`` → as many as there are."""
    if text == "all":
        return 2**64 - 1
    if not text.isdecimal() or not 1 <= int(text) < 2**63:
        raise argparse.ArgumentTypeError(f"'{text}' isn't a number of items, 1 or more, or all")
    return int(text)


def antialias(text: str) -> tuple[str, int, float]:
    """``grid=3`` → ``("grid", 3, 0)``; ``adaptive=3,0.1`` → ``("adaptive", 3, 0.1)``"""
    kind, _, rest = text.partition("=")
    try:
        if kind == "off" and not rest:
            return "off", 0, 0.0
        if kind == "grid":
            samples = int(rest or 3)
            if 1 <= samples <= 256:
                return "grid", samples, 0.0
        if kind == "adaptive":
            depth, _, threshold = rest.partition(",")
            if 1 <= int(depth or 3) <= 9 and float(threshold or 0.3) >= 0:
                return "adaptive", int(depth or 3), float(threshold or 0.3)
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"'{text}' isn't {ANTIALIAS}")


def voxels(text: str) -> tuple[int, int, int]:
    """``16x16x8`` → ``(16, 16, 8)``"""
    sides = text.split("x")
    if len(sides) != 3 or not all(side.isdecimal() and 1 <= int(side) <= 4096 for side in sides):
        raise argparse.ArgumentTypeError(f"'{text}' isn't NxMxK, such as 16x16x8")
    return tuple(int(side) for side in sides)


def pixels(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' isn't a number of pixels, 0 or more")
    return value


def aov_names(text: str) -> tuple[str, ...]:
    from ..reading.diagnostics import nearest

    names = tuple(text.removesuffix(",").split(","))
    for name in names:
        if name not in AOVS:
            hint = nearest(name, AOVS) or f"known: {', '.join(AOVS)}"
            raise argparse.ArgumentTypeError(f"no channel '{name}'; {hint}")
    return names


def run(arguments: argparse.Namespace) -> int:
    from . import render_facts
    from .pictures import check_format, prepare, stored_channel

    started = time.perf_counter()
    check_format(arguments.output)
    _check_options(arguments)
    folder = Path(arguments.output).resolve().parent
    if not folder.is_dir():
        raise PlsysError(f"can't be written: there is no folder '{folder}'", arguments.output)
    data, left_out = _bytecode(arguments)
    seconds = {"read": time.perf_counter() - started}

    from ...runtime import Scene

    prepare(arguments.output, stored_channel(arguments.output, arguments.linear16))
    with Scene(
        data,
        accelerator=_accelerator(arguments),
        threads=arguments.threads or None,
        povray_epsilon=arguments.povray_epsilon,
        memory=arguments.memory,
        front_items=arguments.front,
        grid=arguments.grid,
        detail=arguments.detail,
    ) as scene:
        before_trace = time.perf_counter()
        image = _render(scene, arguments)
        statistics = scene.statistics
    before_write = time.perf_counter()
    _write(arguments, image, statistics)
    seconds |= {name: statistics["seconds"][name] for name in ("verify", "states", "build", "trace", "trace_cpu")}
    seconds["write"] = time.perf_counter() - before_write
    seconds["first_pixel"] = before_trace - started + statistics["seconds"]["first_pixel"]
    facts = render_facts.facts(arguments, statistics, seconds, left_out)
    if arguments.json:
        print_json(facts)
        return 0
    if arguments.explain:
        print("\n".join(render_facts.explanation(statistics, facts)))
    if arguments.statistics:
        print("\n".join(render_facts.table(facts)))
    return 0


def _check_options(arguments: argparse.Namespace) -> None:
    """PlsysError where an option says nothing about this picture, so that none is silently ignored."""
    from .pictures import DEEP_FORMATS

    if arguments.grid and arguments.accel != "grid":
        raise PlsysError(f"the voxels of --accel grid; this picture is drawn with --accel {arguments.accel}", "--grid")
    if arguments.front and arguments.accel not in ("auto", "bvh"):
        raise PlsysError(f"fronts are built by --accel bvh; this picture is drawn with --accel {arguments.accel}", "--front")
    suffix = Path(arguments.output).suffix.lower()
    if arguments.linear16 and suffix not in DEEP_FORMATS:
        raise PlsysError(f"'{suffix}' doesn't hold 16-bit integers; these do: {', '.join(DEEP_FORMATS)}", "--linear16")


def _accelerator(arguments: argparse.Namespace) -> str:
    """Picture 1 shows the boxes of graph nodes, which only `boxes` tests on every ray's way."""
    return "boxes" if arguments.accel == "auto" and "picture1" in arguments.aov else arguments.accel


def _bytecode(arguments: argparse.Namespace) -> tuple[bytes, list]:
    """The scene's bytecode, and what the compiler left out."""
    if arguments.scene.endswith(".plsb"):
        from .disassemble import read_bytecode

        if arguments.parameters or arguments.seed is not None:
            raise PlsysError("-D and --seed belong to the source; this bytecode is compiled already", arguments.scene)
        return read_bytecode(arguments.scene), []
    compilation = build_scene(arguments)
    return compilation.encode(), compilation.graph.left_out


def _render(scene, arguments: argparse.Namespace) -> dict:
    """The runtime's planes by channel: a memoryview of shape (height, width, 3), or arrays where there are extra ones."""
    from .pictures import stored_channel

    width, height = arguments.size
    kind, samples, threshold = arguments.antialias
    options = dict(antialias=kind, samples=samples, threshold=threshold)
    channels = {stored_channel(arguments.output, arguments.linear16)}
    for name in arguments.aov:
        channels |= {"miss_depth", "primitive", "color"} if name == "picture1" else {name}
    with _progress(arguments) as progress:
        if arguments.aov:
            return scene.render(width, height, channels=tuple(sorted(channels)), progress=progress, **options)
        (channel,) = channels
        code, size = {"color": ("f", 4), "srgb": ("B", 1), "linear16": ("H", 2)}[channel]
        pixels = bytearray(3 * width * height * size)
        scene.render_into({channel: pixels}, width, height, progress=progress, **options)
        return {channel: memoryview(pixels).cast(code, (height, width, 3))}


@contextmanager
def _progress(arguments: argparse.Namespace) -> Iterator[Callable[[float], None] | None]:
    """What draws a progress bar on a terminal, once drawing takes so long that the bar is worth its import."""
    started, bars = time.monotonic(), []

    def show(done: float) -> None:
        if not bars and time.monotonic() - started > PATIENCE:
            from rich.console import Console
            from rich.progress import Progress

            bars.append(Progress(console=Console(stderr=True), transient=True))
            bars[0].add_task(Path(arguments.scene).name, total=1.0)
            bars[0].start()
        for bar in bars:
            bar.update(bar.task_ids[0], completed=done)

    try:
        yield show if sys.stderr.isatty() else None
    finally:
        for bar in bars:
            bar.stop()


def _write(arguments: argparse.Namespace, image: dict, statistics: dict) -> None:
    from .pictures import stored_channel, write_picture, write_pixels

    metadata = {
        "Software": "plsys",
        "plsys:scene": arguments.scene,
        "plsys:parameters": " ".join(f"{name}={value:g}" for name, value in arguments.parameters.items()),
        "plsys:accelerator": statistics["accelerator"],
        "plsys:primitives": str(statistics["primitives"]),
        "ImageDescription": f"{arguments.scene}, rendered by plsys",
    }
    output = Path(arguments.output)
    channel = stored_channel(output, arguments.linear16)
    layers = {name: _layer(name, image) for name in arguments.aov}
    if layers and output.suffix.lower() == ".exr" and not arguments.linear16:
        import numpy as np

        names = ("R", "G", "B") + tuple(n for name in layers for n in AOVS[name])
        write_picture(output, np.concatenate([image["color"], *layers.values()], axis=2), metadata=metadata, channels=names)
        return
    write_pixels(output, image[channel], channel, metadata=metadata)
    for name, layer in layers.items():
        if name == "picture1":
            write_picture(output.with_name(f"{output.stem}.{name}{output.suffix}"), layer, metadata=metadata)
        else:
            path = output.with_name(f"{output.stem}.{name}.exr")
            write_picture(path, layer, metadata=metadata, channels=AOVS[name])


def _layer(name: str, image: dict):
    """One extra channel as (height, width, components) float32.

    A primitive's index may exceed what a float holds exactly, so it is split at 2²⁴."""
    import numpy as np

    if name == "picture1":
        return _picture1(image)
    values = image[name]
    if name == "primitive":
        return np.stack([values >> 24, values & 0xFFFFFF], axis=2).astype(np.float32)
    return values.reshape(*values.shape[:2], -1).astype(np.float32)


def _picture1(image: dict):
    """The paper's Picture 1: where a ray missed everything, the recursion depth at which it missed a box, brighter
    when deeper, red and blue in turn."""
    import numpy as np

    depth = image["miss_depth"].astype(np.float32)
    brightness = depth / max(1.0, float(depth.max()))
    odd = (image["miss_depth"] % 2 == 1)[..., None]
    tint = np.where(odd, np.float32([1.0, 0.25, 0.2]), np.float32([0.2, 0.35, 1.0]))
    missed = (image["primitive"] < 0)[..., None]
    return np.where(missed, brightness[..., None] * tint, image["color"]).astype(np.float32)
