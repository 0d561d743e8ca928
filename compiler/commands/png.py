"""Pictures of 8-bit sRGB as PNG (ISO/IEC 15948), by zlib alone: libraries that know all formats take longer to load than
a small picture takes to draw.

    write_png(Path("tree.png"), pixels, 640, 480, {"Software": "plsys"})

Rows aren't filtered: rendered pictures have large even areas and repeat themselves, and so become smaller without."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

SIGNATURE = b"\x89PNG\r\n\x1a\n"
BIT_DEPTH, TRUE_COLOR, UNFILTERED, PERCEPTUAL = 8, 2, b"\0", b"\0"

# Of 1 to 9. Beyond it rendered pictures become a tenth smaller in three times the time.
COMPRESSION = 1


def write_png(
    path: Path, pixels: memoryview | bytes, width: int, height: int, texts: Mapping[str, str] | None = None
) -> None:
    """Write ``pixels``, a contiguous buffer of height x width x 3 bytes, with ``texts`` by keyword. OSError."""
    with open(path, "wb") as file:
        file.write(SIGNATURE)
        for kind, data in _chunks(memoryview(pixels).cast("B"), width, height, texts or {}):
            file.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)))


def _chunks(
    pixels: memoryview, width: int, height: int, texts: Mapping[str, str]
) -> Iterator[tuple[bytes, bytes]]:
    """Kinds and contents, in the order of the file."""
    yield b"IHDR", struct.pack(">IIBBBBB", width, height, BIT_DEPTH, TRUE_COLOR, 0, 0, 0)
    yield b"sRGB", PERCEPTUAL
    for keyword, text in texts.items():
        # Plain texts are Latin-1, which not all readers know; international ones are UTF-8.
        if text.isascii():
            yield b"tEXt", keyword.encode() + b"\0" + text.encode()
        else:
            yield b"iTXt", keyword.encode() + b"\0\0\0\0\0" + text.encode()
    stream = zlib.compressobj(COMPRESSION)
    for start in range(0, len(pixels), 3 * width):
        data = stream.compress(UNFILTERED) + stream.compress(pixels[start : start + 3 * width])
        if data:
            yield b"IDAT", data
    yield b"IDAT", stream.flush()
    yield b"IEND", b""
