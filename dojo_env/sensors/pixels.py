"""Pictures as bytes and as the light that makes them, and what happens to each of their pixels.

Sums, shares and gains hold for linear light, not for sRGB's bytes.
"""

from functools import cache
from math import floor, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.lighting import SRGB, to_linear

Light = NDArray[np.float32]
Picture = NDArray[np.uint8]

_LINEAR = to_linear(np.arange(256, dtype=np.uint8)).astype(np.float32)
_WHITE = np.float32(len(SRGB) - 1)
_TILE = (512, 1024)
"""Rows and columns of the noise that is drawn once; each picture takes it from another place on."""
_APART = 137
"""Where a picture is larger than that, what follows is moved by this many rows or columns, too."""
_GRAIN_PIXELS = 0.6
_HALF, _BYTE, _NONE = np.float32(0.5), np.float32(255), np.float32(0)


def to_light(rgb: Picture) -> Light:
    """Turn a picture into linear light.

    Args:
        rgb: (h, w, 3) sRGB.

    Returns:
        (h, w, 3) float32, 0 to 1.
    """
    return np.asarray(cv2.LUT(rgb, _LINEAR), dtype=np.float32)


@kernel
def to_picture(light):
    """Turn linear light into a picture.

    Args:
        light: (h, w, 3); what is above 1 is white, what is below 0 black.

    Returns:
        (h, w, 3) uint8 sRGB.
    """
    picture = np.empty(light.shape, np.uint8)
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            for c in range(3):
                value = light[row, column, c] * _WHITE + _HALF
                picture[row, column, c] = SRGB[int(max(_NONE, min(_WHITE, value)))]
    return picture


@kernel
def add_exposure(total, rgb, shares):
    """Add the light of a picture to that of others.

    Args:
        total: (h, w, 3) linear light, changed in place.
        rgb: (h, w, 3).
        shares: (h,) of the exposure of each row.
    """
    for row in range(total.shape[0]):
        if shares[row] > _NONE:
            for column in range(total.shape[1]):
                for c in range(3):
                    total[row, column, c] += shares[row] * _LINEAR[rgb[row, column, c]]


@cache
def white_noise() -> Light:
    """Draw noise of deviation 1: rows, columns, 3. It is the same always; pictures take it from any place."""
    return np.random.default_rng(0).standard_normal((*_TILE, 3), dtype=np.float32)


@cache
def grain() -> Light:
    """Draw noise of deviation 1 that neighbours share, as they do after colours are interpolated."""
    kernel = cv2.getGaussianKernel(5, _GRAIN_PIXELS, cv2.CV_32F)
    around = np.pad(white_noise(), ((2, 2), (2, 2), (0, 0)), mode="wrap")
    blurred = cv2.sepFilter2D(around, -1, kernel, kernel)[2:-2, 2:-2]
    return np.ascontiguousarray(blurred / np.float32((kernel**2).sum()))


def add_noise(rgb: Picture, random: np.random.Generator, deviation: float) -> Picture:
    """Add noise that is equally strong at every level and pixel.

    Args:
        rgb: (h, w, 3).
        random: decides which part of the noise is taken.
        deviation: its standard deviation, in levels of 255.

    Returns:
        (h, w, 3), a new picture.
    """
    noisy = np.empty_like(rgb)
    place = random.integers(0, _TILE)
    _add_noise(_rows(rgb), _rows(white_noise()), place, np.float32(deviation), _rows(noisy))
    return noisy


def add_grain(light: Light, random: np.random.Generator, shot: float, read: float) -> None:
    """Add a sensor's noise of variance shot * light + read to linear light.

    Args:
        light: (h, w, 3), contiguous, 0 or more; changed in place.
        random: decides which part of the noise is taken.
        shot: variance for each unit of light.
        read: variance in the dark.
    """
    place = random.integers(0, _TILE)
    _add_grain(_rows(light), _rows(grain()), place, np.float32(shot), np.float32(read))


def _rows(picture: NDArray[np.generic]) -> NDArray[np.generic]:
    """Give (h, w, 3) as (h, w * 3)."""
    return np.ascontiguousarray(picture).reshape(len(picture), -1)


@inner
def _find_run(tile, place, row, start, length):
    """Tell where in a tile a row of values goes on at `start`: row, first value, and how many follow there.

    Values are channels of pixels, so three are a column.
    """
    down = place[0] + row
    across = 3 * (place[1] + _APART * (down // tile.shape[0])) + start
    right, first = across // tile.shape[1], across % tile.shape[1]
    return (down + _APART * right) % tile.shape[0], first, min(tile.shape[1] - first, length - start)


@kernel
def _add_noise(rgb, tile, place, deviation, noisy):
    for row in range(rgb.shape[0]):
        start = 0
        while start < rgb.shape[1]:
            at, first, count = _find_run(tile, place, row, start, rgb.shape[1])
            clean, noise = rgb[row, start : start + count], tile[at, first : first + count]
            made = noisy[row, start : start + count]
            for k in range(count):
                value = np.float32(clean[k]) + deviation * noise[k] + _HALF
                made[k] = np.uint8(np.int32(max(_NONE, min(_BYTE, value))))
            start += count


@kernel
def _add_grain(light, tile, place, shot, read):
    for row in range(light.shape[0]):
        start = 0
        while start < light.shape[1]:
            at, first, count = _find_run(tile, place, row, start, light.shape[1])
            lit, noise = light[row, start : start + count], tile[at, first : first + count]
            for k in range(count):
                lit[k] += noise[k] * np.sqrt(shot * lit[k] + read)
            start += count


@kernel
def cover(rgb, clean, colour):
    """Look through something that lets a share of each pixel's light through.

    Args:
        rgb: (h, w, 3).
        clean: (h, w) the share, 0 to 1.
        colour: (3,) float32 what is seen of it where it lets nothing through, levels of 255.

    Returns:
        (h, w, 3), a new picture.
    """
    seen = np.empty_like(rgb)
    for row in range(rgb.shape[0]):
        for column in range(rgb.shape[1]):
            through = clean[row, column]
            for c in range(3):
                value = rgb[row, column, c] * through + colour[c] * (np.float32(1) - through)
                seen[row, column, c] = np.uint8(np.int32(value + _HALF))
    return seen


@kernel
def draw_drops(seen, soft, drops, shows, edge):
    """Look through drops on the lens: each shows its surroundings upside down.

    Args:
        seen: (h, w, 3) uint8, changed in place.
        soft: (h / n, w / n, 3) uint8 the same picture, out of focus and smaller.
        drops: (k, 3) column, row, radius, pixels.
        shows: how many times its own size a drop shows.
        edge: share of the radius over which it fades away.
    """
    height, width = seen.shape[:2]
    scale = soft.shape[0] / height
    for k in range(len(drops)):
        x, y, radius = drops[k]
        for row in range(max(0, floor(y - radius)), min(height, floor(y + radius) + 1)):
            for column in range(max(0, floor(x - radius)), min(width, floor(x + radius) + 1)):
                across, down = (column + 0.5 - x) / radius, (row + 0.5 - y) / radius
                away = sqrt(across * across + down * down)
                if away >= 1.0:
                    continue
                # A thick lens: upside down, and ever more drawn together towards its edge.
                reach = -shows * (0.4 + 0.6 * away * away)
                u = (x + across * radius * reach) * scale - 0.5
                v = (y + down * radius * reach) * scale - 0.5
                share, rim = min(1.0, (1.0 - away) / edge), 1.0 - 0.3 * away**3
                for c in range(3):
                    shown = rim * _interpolate(soft, u, v, c)
                    value = seen[row, column, c] * (1.0 - share) + shown * share
                    seen[row, column, c] = int(value + 0.5)


@inner
def _interpolate(picture, u, v, c):
    """Read a channel between four pixels; beyond the border it goes on as there."""
    u, v = min(max(u, 0.0), picture.shape[1] - 1.0), min(max(v, 0.0), picture.shape[0] - 1.0)
    left, top = int(u), int(v)
    right, below = min(left + 1, picture.shape[1] - 1), min(top + 1, picture.shape[0] - 1)
    a, b = u - left, v - top
    upper = picture[top, left, c] * (1.0 - a) + picture[top, right, c] * a
    lower = picture[below, left, c] * (1.0 - a) + picture[below, right, c] * a
    return upper * (1.0 - b) + lower * b
