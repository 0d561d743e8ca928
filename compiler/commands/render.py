"""Draw a scene.

Writes any format that OpenImageIO writes: .png and .jpg in sRGB, .exr, .tif and .hdr as linear floats. With --aov,
extra channels go into the same .exr file, or beside other formats into files named OUT.CHANNEL.exr.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from pathlib import Path

from ..reading.diagnostics import PlsysError
from .common import add_scene_arguments, build_scene, json_integer, print_json, size

ACCELERATORS = ("auto", "none", "boxes", "grid", "bvh")
ANTIALIAS = "off, grid=N (centre and N×N sub-cells), or adaptive[=DEPTH[,THRESHOLD]]"

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


def memory(text: str) -> int:
    """``64K`` → 65536; K, M and G are powers of 1024."""
    exponent = "KMG".find(text[-1:].upper()) + 1 if text else 0
    try:
        size = int(float(text[:-1] if exponent else text) * 1024**exponent)
    except (ValueError, OverflowError):
        size = 0
    if not 1 <= size < 2**63:
        raise argparse.ArgumentTypeError(f"'{text}' isn't a size in bytes, such as 64K, 1M or 2G")
    return size


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

    names = tuple(name for name in text.split(",") if name)
    for name in names:
        if name not in AOVS:
            hint = nearest(name, AOVS) or f"known: {', '.join(AOVS)}"
            raise argparse.ArgumentTypeError(f"no channel '{name}'; {hint}")
    return names


def run(arguments: argparse.Namespace) -> int:
    from .pictures import check_format

    started = time.perf_counter()
    check_format(arguments.output)
    folder = Path(arguments.output).resolve().parent
    if not folder.is_dir():
        raise PlsysError(f"can't be written: there is no folder '{folder}'", arguments.output)
    data, left_out = _bytecode(arguments)
    seconds = {"read": time.perf_counter() - started}

    from ...runtime import Scene

    with Scene(
        data,
        accelerator=_accelerator(arguments),
        threads=arguments.threads or None,
        povray_epsilon=arguments.povray_epsilon,
        memory=arguments.memory,
        grid=arguments.grid,
        detail=arguments.detail,
    ) as scene:
        image = _render(scene, arguments)
        statistics = scene.statistics
        before_write = time.perf_counter()
        _write(arguments, image, statistics)
    seconds |= {name: statistics["seconds"][name] for name in ("verify", "states", "build", "trace")}
    seconds["write"] = time.perf_counter() - before_write
    facts = _facts(arguments, statistics, seconds, left_out)
    if arguments.json:
        print_json(facts)
    elif arguments.explain:
        for row in _built(statistics):
            print("built: {:<12} {:>14,} bytes  {}".format(*row))
        for row in facts["left_out"]:
            print(f"left out: {row['what']}: {row['why']}")
    return 0


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
    """The arrays of the runtime by channel, with a progress bar on a terminal."""
    width, height = arguments.size
    kind, samples, threshold = arguments.antialias
    channels = {"color"}
    for name in arguments.aov:
        channels |= {"miss_depth", "primitive"} if name == "picture1" else {name}
    options = dict(antialias=kind, samples=samples, threshold=threshold, channels=tuple(sorted(channels)))
    if not sys.stderr.isatty():
        return scene.render(width, height, **options)
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(Path(arguments.scene).name, total=1.0)
        return scene.render(width, height, progress=lambda done: bar.update(task, completed=done), **options)


def _write(arguments: argparse.Namespace, image: dict, statistics: dict) -> None:
    import numpy as np

    from .pictures import write_picture

    metadata = {
        "Software": "plsys",
        "plsys:scene": arguments.scene,
        "plsys:parameters": " ".join(f"{name}={value:g}" for name, value in arguments.parameters),
        "plsys:accelerator": statistics["accelerator"],
        "plsys:primitives": str(statistics["primitives"]),
        "ImageDescription": f"{arguments.scene}, rendered by plsys",
    }
    layers = {name: _layer(name, image) for name in arguments.aov}
    output = Path(arguments.output)
    if output.suffix.lower() == ".exr" and not arguments.linear16:
        names = ("R", "G", "B") + tuple(n for name in layers for n in AOVS[name])
        pixels = np.concatenate([image["color"], *layers.values()], axis=2)
        write_picture(output, pixels, metadata=metadata, channels=names)
        return
    write_picture(output, image["color"], linear16=arguments.linear16, metadata=metadata)
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


def _built(statistics: dict) -> list[tuple[str, int, str]]:
    """(structure, bytes, what it holds) of what the scene needed."""
    front, size, seconds = statistics["front"], statistics["bytes"], statistics["seconds"]
    rows = [("program", size["program"], f"verified in {seconds['verify']:.4f} s")]
    if size["meshes"]:
        rows.append(("meshes", size["meshes"], "boxes over triangles"))
    if size["states"]:
        rows.append(("states", size["states"], f"{statistics['states']} in {seconds['states']:.4f} s"))
    if front["count"]:
        limit = "any number" if front["limit"] is None else f"at most {front['limit']:,}"
        build = seconds["build"] - seconds["states"]
        rows.append(("front items", size["items"], f"{front['items']:,}, {front['instances']:,} of them instances"))
        rows.append(
            ("front nodes", size["nodes"], f"of {front['count']:,} fronts with {limit} items each, in {build:.4f} s; {statistics['isa']}")
        )
    return rows


def _facts(arguments: argparse.Namespace, statistics: dict, seconds: dict, left_out: list) -> dict:
    width, height = arguments.size
    return {
        "scene": arguments.scene,
        "width": width,
        "height": height,
        "accelerator": statistics["accelerator"],
        "povray_epsilon": arguments.povray_epsilon,
        "primitives": json_integer(statistics["primitives"]),
        "states": statistics["states"],
        "detail": statistics["detail"],
        "cut": statistics["cut"],
        "lazy": statistics["lazy"],
        "rays": statistics["rays"],
        "isa": statistics["isa"],
        "front": statistics["front"],
        "tests": {
            "nodes": statistics["box_tests"] // 8 if statistics["isa"] else statistics["box_tests"],
            "instances": statistics["instances"],
            "primitives_filtered": statistics["filtered"],
            "primitives": statistics["primitive_tests"],
        },
        "seconds": {name: round(value, 6) for name, value in seconds.items()},
        "memory": {
            "scene_bytes": statistics["scene_bytes"],
            **{f"{name}_bytes": value for name, value in statistics["bytes"].items()},
            "peak_rss_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        },
        "left_out": [{"what": row.what, "why": row.why} for row in left_out],
        "image": arguments.output,
    }
