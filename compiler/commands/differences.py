"""Two pictures of one scene, compared: statistics, edges, every differing pixel traced again, and a picture
of it all.

Ours is what the runtime draws, theirs POV-Ray's 16-bit picture; both are linear light, (height, width, 3)
float32. Statistics are OpenImageIO's; edges are those of our geometry: another primitive, a normal turned by
more than 10°, or a depth that jumps by more than 1 % in a pixel's 3×3 neighbourhood.

Example: ``statistics(ours, theirs, edges)["max_abs"]`` is 7.6e-6 where only quantisation differs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Callable

import numpy as np

from ..export.retrace import Retracer

SAME = 1e-5  # linear light; 16-bit quantisation alone gives 0.76e-5
VISIBLE = 1 / 255
EDGE_ANGLE_DEG, EDGE_DEPTH = 10.0, 0.01
MOST_RETRACED = 2000
STEP = 1e-6  # of a pixel: how far the neighbours of a ray are that rounding may confuse it with

CLASSES = ("ours_wrong", "theirs_wrong", "ambiguous", "sampling", "unclassified")
"""``sampling`` is for pictures with several samples a pixel; both pictures here have one, at the same
place."""


def clipped(color: np.ndarray) -> np.ndarray:
    """As far as a 16-bit picture can show it. Not rounded to 16 bits as theirs is: a value that rounds up
    here and down there would count as 1.5e-5, twice what quantisation can do."""
    return np.clip(color, 0, 1).astype(np.float32)


def edges(image: dict[str, np.ndarray]) -> np.ndarray:
    """(height, width) bool, from the channels primitive, normal and depth."""
    primitive, normal, depth = image["primitive"], image["normal"], image["depth"]
    found = np.zeros(primitive.shape, bool)
    height, width = found.shape
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        here = slice(0, height - down), slice(max(0, -right), width - max(0, right))
        there = slice(down, height), slice(max(0, right), width + min(0, right))
        with np.errstate(invalid="ignore"):
            turned = np.sum(normal[here] * normal[there], axis=-1) < np.cos(np.radians(EDGE_ANGLE_DEG))
            jumps = np.abs(depth[here] - depth[there]) > EDGE_DEPTH * np.minimum(depth[here], depth[there])
        is_hit = primitive[here] >= 0
        differs = (primitive[here] != primitive[there]) | (is_hit & (turned | jumps))
        found[here] |= differs
        found[there] |= differs
    return found


def statistics(ours: np.ndarray, theirs: np.ndarray, edge: np.ndarray) -> dict:
    """``pixels, max_abs, rmse, over_1e5, interior_over_1_255, edge_pixels`` of two pictures in [0, 1]."""
    import OpenImageIO as oiio

    result = oiio.ImageBufAlgo.compare(oiio.ImageBuf(ours), oiio.ImageBuf(theirs), SAME, SAME)
    difference = np.abs(ours - theirs).max(axis=2)
    return {
        "pixels": int(edge.size),
        "max_abs": float(result.maxerror),
        "rmse": float(result.rms_error),
        "over_1e5": int(np.count_nonzero(difference > SAME)),
        "interior_over_1_255": int(np.count_nonzero((difference > VISIBLE) & ~edge)),
        "edge_pixels": int(np.count_nonzero(edge)),
    }


# --- every differing pixel ---


class Camera:
    """POV-Ray's perspective camera (see runtime/SHADING.md and POV-Ray's manual): pixel coordinates to
    rays."""

    def __init__(self, values: dict[str, tuple[float, ...]], width: int, height: int) -> None:
        location, direction, right, up, sky, look_at = (
            np.array(values[name]) for name in ("location", "direction", "right", "up", "sky", "look_at")
        )
        self.origin, self.size = location, (width, height)
        length = np.linalg.norm(direction)
        if values["angle"][0]:
            length = np.linalg.norm(right) / np.tan(np.radians(values["angle"][0]) / 2) / 2
        if values["has_look_at"][0]:
            hand = np.sign(np.dot(np.cross(up, direction), right)) or 1.0
            d = _unit(look_at - location)
            r = _unit(np.cross(sky, d))
            right, up = hand * np.linalg.norm(right) * r, np.linalg.norm(up) * np.cross(d, r)
        else:
            d = _unit(direction)
        self.forward, self.right, self.up = length * d, right, up

    def rays(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Directions (k, 3) through the points (x, y) of the picture, in pixels; centres are at +½."""
        width, height = self.size
        return (
            self.forward
            + (np.asarray(x)[:, None] / width - 0.5) * self.right
            + (0.5 - np.asarray(y)[:, None] / height) * self.up
        )


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def classify(
    pixels: np.ndarray, retracer: Retracer, camera: Camera, agrees: Callable[[object], bool]
) -> list[dict[str, object]]:
    """What each differing pixel (row, column) is: ``{x, y, class, why}``. ``agrees(ray)`` tells whether the
    runtime decides a ray as the retracer does."""
    angle = 2 * np.pi * np.arange(8) / 8
    dx, dy = (np.concatenate([[0.0], STEP * f(angle)]) for f in (np.cos, np.sin))
    found = []
    for row, column in pixels[:MOST_RETRACED].tolist():
        verdict = retracer.decide(camera.origin, camera.rays(column + 0.5 + dx, row + 0.5 + dy))
        if verdict.is_ambiguous:
            kind, why = "ambiguous", verdict.why
        elif all(agrees(ray) for ray in verdict.rays):
            kind, why = "theirs_wrong", "every ray that we traced is confirmed in higher precision"
        else:
            kind, why = "ours_wrong", "a ray hits something else in higher precision"
        found.append({"x": column, "y": row, "class": kind, "why": why})
    found += [
        {"x": x, "y": y, "class": "unclassified", "why": "too many"}
        for y, x in pixels[MOST_RETRACED:].tolist()
    ]
    return found


# --- side by side ---


def write_side_by_side(
    path: str | Path, ours: np.ndarray, theirs: np.ndarray, factor: float, their_name: str = "POV-Ray"
) -> None:
    """Ours | theirs | their difference times ``factor``, with captions."""
    import OpenImageIO as oiio

    from .pictures import write_picture

    height, width = ours.shape[:2]
    difference = np.clip(np.abs(ours - theirs) * factor, 0, 1)
    band, gap = 24, 4
    sheet = np.full((height + band, 3 * width + 2 * gap, 3), 0.02, np.float32)
    for i, panel in enumerate((ours, theirs, difference)):
        sheet[band:, i * (width + gap) : i * (width + gap) + width] = panel
    picture = oiio.ImageBuf(np.ascontiguousarray(sheet))
    for i, caption in enumerate(("plsys", their_name, f"|difference| x {factor:g}")):
        oiio.ImageBufAlgo.render_text(
            picture, i * (width + gap) + 8, 17, caption, 14, textcolor=(0.9, 0.9, 0.9)
        )
    write_picture(path, picture.get_pixels(oiio.FLOAT), metadata={"Software": "plsys"})
