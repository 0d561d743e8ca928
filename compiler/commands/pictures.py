"""Pictures on disk, through OpenImageIO: linear float arrays in, an image file out.

Ordinary formats (png, jpg, …) get 8-bit sRGB; ``linear16`` gives 16-bit linear values, for comparison with other
renderers; formats that hold floats (exr, hdr, pfm, tif) get linear floats.

Example: ``write_picture("tree.png", color, metadata={"Software": "plsys"})`` with color (height, width, 3) float32.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..export.files import written_whole
from ..reading.diagnostics import PlsysError

if TYPE_CHECKING:
    import numpy as np

FLOAT_FORMATS = (".exr", ".tif", ".tiff", ".hdr", ".pfm")


def write_picture(
    path: str | Path,
    color: np.ndarray,
    *,
    linear16: bool = False,
    metadata: dict[str, str] | None = None,
    channels: tuple[str, ...] = ("R", "G", "B"),
) -> None:
    """Write ``color`` (height, width, len(channels)), linear values, to ``path``.

    Raises PlsysError when the format is unknown or the file can't be written; then no file is left."""
    import numpy as np
    import OpenImageIO as oiio

    path = Path(path)
    if path.suffix.lower() in FLOAT_FORMATS and not linear16:
        pixels, kind, space = np.ascontiguousarray(color, np.float32), "float", "lin_rec709"
    elif linear16:
        pixels, kind, space = quantise(color, 65535).astype(np.uint16), "uint16", "lin_rec709"
    else:
        pixels, kind, space = quantise(srgb_from_linear(color), 255).astype(np.uint8), "uint8", "sRGB"
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    spec.channelnames = channels
    spec.attribute("oiio:ColorSpace", space)
    for name, value in (metadata or {}).items():
        spec.attribute(name, value)
    with written_whole(path) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        if output is None:
            oiio.geterror()
            raise PlsysError(f"don't know the picture format '{path.suffix}'", str(path))
        if not (output.open(str(temporary), spec) and output.write_image(pixels) and output.close()):
            raise PlsysError(f"can't be written: {output.geterror().strip()}", str(path))


def check_format(path: str | Path) -> None:
    """PlsysError unless OpenImageIO writes files named like ``path``: asked before any work is done."""
    import OpenImageIO as oiio

    suffix = Path(path).suffix.lower().lstrip(".")
    formats = dict(entry.split(":") for entry in oiio.get_string_attribute("extension_list").split(";") if entry)
    writable = set(oiio.get_string_attribute("output_format_list").split(","))
    known = {extension for name, extensions in formats.items() if name in writable for extension in extensions.split(",")}
    if suffix not in known:
        raise PlsysError(f"don't know the picture format '.{suffix}'; use .png, .jpg, .exr or .tif", str(path))


def quantise(values: np.ndarray, maximum: int) -> np.ndarray:
    """``floor(clip(x, 0, 1)·maximum + ½)``: what POV-Ray does too."""
    import numpy as np

    return np.floor(np.clip(values.astype(np.float64), 0, 1) * maximum + 0.5)


def srgb_from_linear(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1's transfer function."""
    import numpy as np

    x = np.clip(linear.astype(np.float64), 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
