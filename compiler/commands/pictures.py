"""Pictures on disk: pixels in, an image file out.

Formats that hold floats (exr, hdr, pfm, tif) get linear floats, others (png, jpg, …) 8-bit sRGB; ``linear16`` gives
16-bit linear values, for comparison with other renderers. OpenImageIO writes all of them but the ordinary .png: it takes
36 MB, more than the whole of a process that draws a small scene, and Pillow 9 MB. Either is imported when something is
written (or, by ``prepare``, while it is drawn), and NumPy for arrays only.

Example::

    channel = stored_channel("tree.png")                       # "srgb": what the runtime is asked for
    write_pixels("tree.png", pixels, channel, metadata={"Software": "plsys"})      # (height, width, 3) uint8
"""

from __future__ import annotations

import threading
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ..export.files import written_whole
from ..reading.diagnostics import PlsysError

if TYPE_CHECKING:
    import numpy as np

FLOAT_FORMATS = (".exr", ".tif", ".tiff", ".hdr", ".pfm")

# Formats of 16-bit integers.
DEEP_FORMATS = (".png", ".tif", ".tiff")

# Formats that OpenImageIO writes however it was built, so that it needn't be asked.
USUAL_FORMATS = (".png", ".exr", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr", ".bmp")

# The runtime's channel → OpenImageIO's names of the type and of the colour space.
STORED = {"color": ("float", "lin_rec709"), "srgb": ("uint8", "sRGB"), "linear16": ("uint16", "lin_rec709")}

# Of 1 to 9. Beyond it rendered pictures become hardly smaller in up to twice the time.
PNG_COMPRESSION = 2


def stored_channel(path: str | Path, linear16: bool = False) -> str:
    """The channel of the runtime that a file named like ``path`` holds: "color", "srgb" or "linear16"."""
    if linear16:
        return "linear16"
    return "color" if Path(path).suffix.lower() in FLOAT_FORMATS else "srgb"


def prepare(path: str | Path, channel: str) -> None:
    """Begin to import what will write ``channel`` to ``path``, beside what the caller does next: it takes as long as to
    draw a small scene."""
    module = "PIL.PngImagePlugin" if _is_ordinary_png(path, channel) else "OpenImageIO"
    threading.Thread(target=import_module, args=(module,)).start()


def write_picture(
    path: str | Path,
    color: np.ndarray,
    *,
    metadata: dict[str, str] | None = None,
    channels: tuple[str, ...] = ("R", "G", "B"),
) -> None:
    """As :func:`write_pixels` for ``color`` (height, width, len(channels)), linear values of any kind of number."""
    import numpy as np

    channel = stored_channel(path)
    if channel == "color":
        pixels = np.ascontiguousarray(color, np.float32)
    else:
        from ...runtime import quantise

        pixels = quantise(color, channel)
    write_pixels(path, pixels, channel, metadata=metadata, channels=channels)


def write_pixels(
    path: str | Path,
    pixels: memoryview | np.ndarray,
    channel: str,
    *,
    metadata: dict[str, str] | None = None,
    channels: tuple[str, ...] = ("R", "G", "B"),
) -> None:
    """Write ``pixels``, a contiguous buffer of shape (height, width, len(channels)) and of the type that the runtime's
    ``channel`` has, to ``path``.

    Raises PlsysError when the format is unknown or the file can't be written; then no file is left."""
    path = Path(path)
    height, width, _ = memoryview(pixels).shape
    if _is_ordinary_png(path, channel):
        _write_png(path, pixels, width, height, metadata or {})
        return
    import OpenImageIO as oiio

    kind, space = STORED[channel]
    spec = oiio.ImageSpec(width, height, len(channels), kind)
    spec.channelnames = channels
    spec.attribute("oiio:ColorSpace", space)
    spec.attribute("png:compressionLevel", PNG_COMPRESSION)
    for name, value in (metadata or {}).items():
        spec.attribute(name, value)
    with written_whole(path) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        if output is None:
            oiio.geterror()
            raise PlsysError(f"don't know the picture format '{path.suffix}'", str(path))
        if not (output.open(str(temporary), spec) and output.write_image(pixels) and output.close()):
            raise PlsysError(f"can't be written: {output.geterror().strip()}", str(path))


def _is_ordinary_png(path: str | Path, channel: str) -> bool:
    return channel == "srgb" and Path(path).suffix.lower() == ".png"


def _write_png(path: Path, pixels: memoryview | np.ndarray, width: int, height: int, metadata: dict[str, str]) -> None:
    """8-bit sRGB. The metadata become texts, under PNG's own names where it has one, as OpenImageIO writes them."""
    from PIL import Image, PngImagePlugin

    texts = PngImagePlugin.PngInfo()
    texts.add(b"sRGB", bytes([0]))
    for name, value in metadata.items():
        # Plain texts are Latin-1, which not all readers know; international ones are UTF-8.
        add = texts.add_text if value.isascii() else texts.add_itxt
        add({"ImageDescription": "Description"}.get(name, name), value)
    picture = Image.frombuffer("RGB", (width, height), memoryview(pixels).cast("B"), "raw", "RGB", 0, 1)
    with written_whole(path) as temporary:
        # Without a format's name: asked for one, Pillow imports all that it has.
        picture.save(temporary, pnginfo=texts, compress_level=PNG_COMPRESSION)


def check_format(path: str | Path) -> None:
    """PlsysError unless OpenImageIO writes files named like ``path``: asked before any work is done."""
    suffix = Path(path).suffix.lower()
    if suffix in USUAL_FORMATS:
        return
    import OpenImageIO as oiio

    formats = dict(entry.split(":") for entry in oiio.get_string_attribute("extension_list").split(";") if entry)
    writable = set(oiio.get_string_attribute("output_format_list").split(","))
    known = {extension for name, extensions in formats.items() if name in writable for extension in extensions.split(",")}
    if suffix.lstrip(".") not in known:
        raise PlsysError(f"don't know the picture format '{suffix}'; use .png, .jpg, .exr or .tif", str(path))
