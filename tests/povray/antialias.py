"""POV-Ray's two antialiasing methods without jitter, on the reference model.

Input: a `Scene`, the image's size and POV-Ray's +R, +A and Antialias_Gamma.  Output: a (height, width, 3) image:

    adaptive(scene, 160, 120, depth=3, threshold=0.1)  =  povray(scene, …, "+A0.1", "+AM2", "+R3", "-J")
"""

from __future__ import annotations

import numpy as np

from .model import Scene

BLOCK = 32


def adaptive(scene: Scene, width: int, height: int, depth: int, threshold: float, gamma: float = 2.5):
    """+AM2: a pixel is the mean of its corners; where two corners differ, the mean of its four quarters.

    The quarters are divided again down to 2^-(depth-1) pixel, so depth 1 never divides.
    """
    steps = 2 ** (depth - 1)
    x, y = np.meshgrid(np.arange(width * steps + 1) / steps, np.arange(height * steps + 1) / steps)
    colour = scene.colour_at(x.ravel(), y.ravel(), width, height).reshape(*x.shape, 3)
    encoded = np.maximum(colour, 0) ** (1 / gamma)

    def corners(image, size):
        low = image[:-1:size, :-1:size]
        return np.stack(
            [low, image[:-1:size, size::size], image[size::size, :-1:size], image[size::size, size::size]]
        )

    mean = corners(colour, 1).mean(axis=0)
    for size in 2 ** np.arange(1, depth):
        quarters = mean.reshape(mean.shape[0] // 2, 2, mean.shape[1] // 2, 2, 3).mean(axis=(1, 3))
        e = corners(encoded, size)
        differ = np.abs(e[:, None] - e[None]).sum(axis=-1).max(axis=(0, 1)) >= threshold
        mean = np.where(differ[..., None], quarters, corners(colour, size).mean(axis=0))
    return mean


def uniform(scene: Scene, width: int, height: int, count: int, threshold: float, gamma: float = 2.5):
    """+AM1: a pixel that differs from its left or upper neighbour becomes the mean of itself and count² more.

    The neighbour is sampled again as well.  Pixels are visited row by row in blocks of 32 × 32, and a block
    sees the pixels left of and above it only as they were at first.
    """
    x, y = np.meshgrid(np.arange(-1, width) + 0.5, np.arange(-1, height) + 0.5)
    single = scene.colour_at(x.ravel(), y.ravel(), width, height).reshape(height + 1, width + 1, 3)
    x, y = np.meshgrid((np.arange(width * count) + 0.5) / count, (np.arange(height * count) + 0.5) / count)
    more = scene.colour_at(x.ravel(), y.ravel(), width, height).reshape(height, count, width, count, 3)
    full = (single[1:, 1:] + more.sum(axis=(1, 3))) / (count**2 + 1)
    result = np.empty_like(full)
    for top in range(0, height, BLOCK):
        for left in range(0, width, BLOCK):
            rows, columns = slice(top, top + BLOCK), slice(left, left + BLOCK)
            framed = single[top : top + BLOCK + 1, left : left + BLOCK + 1].copy()
            result[rows, columns] = visit(framed, full[rows, columns], threshold, gamma)
    return result


def visit(framed: np.ndarray, full: np.ndarray, threshold: float, gamma: float) -> np.ndarray:
    """One block of +AM1: `framed` has a row above and a column to the left of the pixels in `full`."""

    def differ(a, b):
        return np.abs(np.maximum(a, 0) ** (1 / gamma) - np.maximum(b, 0) ** (1 / gamma)).sum() >= threshold

    for y in range(1, framed.shape[0]):
        for x in range(1, framed.shape[1]):
            neighbours = [(y, x - 1), (y - 1, x)]
            changed = [p for p in neighbours if differ(framed[p], framed[y, x])]
            for v, u in [*changed, *([(y, x)] if changed else [])]:
                if v > 0 and u > 0:
                    framed[v, u] = full[v - 1, u - 1]
    return framed[1:, 1:]
