"""Procedural textures: how bright each surface is at a place of the map. Pure functions of position."""

from math import floor

from dojo_env.rendering.compiling import kernel


@kernel
def _hashed(x, y):
    """A number from 0 to 1 for two integers. Source: the finaliser of MurmurHash3."""
    h = (x * 374761393 + y * 668265263) & 0xFFFFFFFF
    h = ((h ^ (h >> 15)) * 2246822519) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 3266489917) & 0xFFFFFFFF
    return ((h ^ (h >> 16)) & 0xFFFFFF) / 16777215.0


@kernel
def _smooth_noise(x, y):
    i, j = floor(x), floor(y)
    u, v = x - i, y - j
    u, v = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v)
    low = _hashed(i, j) * (1.0 - u) + _hashed(i + 1, j) * u
    high = _hashed(i, j + 1) * (1.0 - u) + _hashed(i + 1, j + 1) * u
    return low * (1.0 - v) + high * v


@kernel
def _layered_noise(x, y, pixel):
    """Sum four octaves of noise around 0; octaves finer than a pixel (in units of x) fade out."""
    total, gain, scale = 0.0, 0.5, 1.0
    for _ in range(4):
        shown = min(1.0, max(0.0, 1.5 - 2.0 * pixel * scale))
        if shown > 0.0:
            total += gain * shown * (_smooth_noise(x * scale + 17.0, y * scale + 5.0) - 0.5)
        gain *= 0.55
        scale *= 2.1
    return total


@kernel
def asphalt(x, y, pixel):
    """Grain and patches."""
    tone = 1.0 + 0.28 * _layered_noise(0.13 * x, 0.13 * y, 0.13 * pixel)
    return tone + 0.34 * _layered_noise(5.0 * x, 5.0 * y, 5.0 * pixel)


@kernel
def grass(x, y, pixel):
    """Tufts, and drier and lusher places."""
    tone = 1.0 + 0.7 * _layered_noise(0.09 * x, 0.09 * y, 0.09 * pixel)
    return tone + 0.75 * _layered_noise(2.3 * x, 2.3 * y, 2.3 * pixel)


@kernel
def paving(x, y, pixel):
    """Slabs of half a metre with joints."""
    u, v = 2.0 * x, 2.0 * y
    i, j = floor(u), floor(v)
    shown = min(1.0, max(0.0, 1.4 - 3.0 * pixel))
    tone = 1.0 + 0.12 * shown * (_hashed(i, j) - 0.5) + 0.2 * _layered_noise(0.2 * x, 0.2 * y, 0.2 * pixel)
    edge = min(u - i, 1.0 - (u - i), v - j, 1.0 - (v - j))
    if edge < 0.035:
        tone *= 1.0 - 0.28 * min(1.0, max(0.0, 1.2 - 12.0 * pixel))
    return tone


@kernel
def paint(x, y, pixel):
    """Road paint, worn in places."""
    worn = _layered_noise(1.7 * x, 1.7 * y, 1.7 * pixel)
    return 0.93 - 0.3 * max(0.0, worn)


@kernel
def ballast(x, y, pixel):
    """Crushed stone."""
    return 1.0 + 0.9 * _layered_noise(5.0 * x, 5.0 * y, 5.0 * pixel)


@kernel
def facade(along, z, level, pixel):
    """Plaster with a window every 2.4 m on each floor of 3 m; plain where it is level, as on a roof.

    Returns the tone and, where there is a window, a number from 0 to 1 that is its own; else -1.
    """
    if level:
        return 0.75, -1.0
    i, j = floor(along / 2.4), floor(z / 3.0)
    u, v = along / 2.4 - i, z / 3.0 - j
    if 0.27 < u < 0.73 and 0.3 < v < 0.78 and pixel < 1.0:
        return 1.0, _hashed(i, j)
    return 1.0 + 0.2 * _layered_noise(0.4 * along, 0.4 * z, 0.4 * pixel), -1.0


@kernel
def foliage(x, y, z, pixel):
    """Leaves."""
    return 1.0 + 1.2 * _layered_noise(1.9 * (x + 0.37 * z), 1.9 * (y + 0.61 * z), 1.9 * pixel)


@kernel
def puddles(x, y, pixel):
    """Share of the sky that wet ground mirrors: little on open grain, all in puddles."""
    level = _layered_noise(0.35 * x + 9.0, 0.35 * y + 3.0, 0.35 * pixel)
    return 0.35 + 0.65 * min(1.0, max(0.0, 0.5 + 6.0 * level))
