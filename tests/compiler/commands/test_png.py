"""The PNG of ordinary pictures, read by another library."""

import numpy as np
import OpenImageIO as oiio
import pytest

from plsys.compiler.commands.png import png_bytes


@pytest.mark.parametrize("shape", [(1, 1, 3), (5, 7, 3), (300, 400, 3)])
@pytest.mark.parametrize("colors", [2, 256])
def test_pixels_and_texts_are_read_back(tmp_path, shape, colors):
    pixels = np.random.default_rng(1).integers(0, colors, shape, np.uint8)
    path = tmp_path / "p.png"
    path.write_bytes(png_bytes(pixels, {"Software": "plsys", "Description": "Bäume, 木"}))
    image = oiio.ImageBuf(str(path))
    np.testing.assert_array_equal(image.get_pixels(oiio.UINT8), pixels)
    spec = image.spec()
    assert spec.format == "uint8" and "srgb" in spec.getattribute("oiio:ColorSpace").lower()
    assert spec.getattribute("Software") == "plsys" and spec.getattribute("ImageDescription") == "Bäume, 木"
