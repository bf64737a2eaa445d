"""What lies between the world and a sensor: rain, drops and dirt on the lens, stray light, vignetting."""

from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.lighting import Light
from dojo_env.rendering.raster import draw_mesh
from dojo_env.rendering.scene import Scene
from dojo_env.sensors.pixels import cover, draw_drops

Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]

_SPOTS = 60
"""Spots of dirt on a very dirty lens."""
_MUD = np.array([70.0, 62.0, 50.0], dtype=np.float32)
_STREAKS = 90
"""Streaks of heavy rain in a picture of 100,000 pixels."""
_DROPS = 40
"""Drops on a lens that holds no more."""
_DROP_LASTS = (6.0, 40.0)
"""Seconds until a drop runs off and another one falls."""
_DROP_RADIUS = (0.015, 0.09)
"""Share of the picture's height."""
_DROP_EDGE = 0.45
"""Share of a drop's radius over which it fades away: it is far out of focus."""
_DROP_SHOWS = 4.0
"""A drop shows this many times its own surroundings, upside down."""
_SOFT, _OUT_OF_FOCUS = 4, 0.012
"""How much smaller the picture in drops is, and its blur as a share of its height."""
_NEXT_DROP = np.array([0.8191725134, 0.6710436067, 0.5497004779])
"""From a drop's place and size to the next one's. Source: Roberts, low-discrepancy sequences, 2018."""
_HALO = ((1.5, 3.0), (0.5, 12.0), (0.15, 40.0))
"""Stray light of a strong sun: brightness, and degrees over which it falls to a third."""
_GHOSTS = ((0.45, 0.05, (1.0, 0.7, 0.4)), (0.8, 0.09, (0.5, 0.9, 0.6)), (1.4, 0.14, (0.5, 0.6, 1.0)))
"""Reflections between lenses: how far beyond the middle, radius as a share of the height, colour."""
_GHOST = 0.1
_SUN_PIXELS, _SUN_DEG = 9, 1.5


def draw_rain(rgb: Picture, rain: float, random: np.random.Generator) -> Picture:
    """Draw falling drops as short slanted streaks.

    Args:
        rgb: (h, w, 3).
        rain: 0 dry to 1 heavy rain.
        random: decides where they are.

    Returns:
        (h, w, 3), a new picture.
    """
    height, width = rgb.shape[:2]
    streaks = np.zeros((height, width), dtype=np.uint8)
    count = round(rain * _STREAKS * height * width / 1e5)
    starts = random.integers(0, [width, height], (count, 2))
    lengths = random.uniform(0.02, 0.06, count) * height
    for (x, y), length in zip(starts.tolist(), lengths.tolist(), strict=True):
        cv2.line(streaks, (x, y), (round(x + 0.15 * length), round(y + length)), 90, 1, cv2.LINE_AA)
    wet = np.flatnonzero(streaks > 0)
    veil = streaks.reshape(-1)[wet, None].astype(np.float32) / 255 * 0.5
    seen = rgb.copy()
    pixels = seen.reshape(-1, 3)
    pixels[wet] = np.rint(pixels[wet] * (1 - veil) + 205.0 * veil)
    return seen


def scatter_dirt(height: int, width: int, dirt: float, random: np.random.Generator) -> Floats:
    """Dirty a lens.

    Args:
        height: of its pictures, pixels.
        width: pixels.
        dirt: 0 clean to 1 very dirty.
        random: decides where the spots are.

    Returns:
        (h, w) transparency, 1 where it is clean.
    """
    spots = np.zeros((height, width), dtype=np.float32)
    for _ in range(round(_SPOTS * dirt)):
        centre = (int(random.integers(width)), int(random.integers(height)))
        radius = int(height * random.uniform(0.01, 0.05)) + 1
        cv2.circle(spots, centre, radius, float(random.uniform(0.3, 0.9)), -1)
    soft = cv2.GaussianBlur(spots, (0, 0), height * 0.012)
    return np.asarray(1 - soft, dtype=np.float32)


def dim(rgb: Picture, clean: Floats) -> Picture:
    """Look through dirt, as `scatter_dirt` made it.

    Args:
        rgb: (h, w, 3).
        clean: (h, w) transparency.

    Returns:
        (h, w, 3), a new picture.
    """
    return np.asarray(cover(rgb, clean, _MUD), dtype=np.uint8)


def refract(rgb: Picture, drops: float, time: float, random: np.random.Generator) -> Picture:
    """Look through drops on the lens: each shows what is around it upside down and out of focus.

    Args:
        rgb: (h, w, 3).
        drops: 0 none to 1 as many as hold.
        time: seconds; drops stay for a while.
        random: fresh, and the same for all pictures of a camera; with the time it decides where they are.

    Returns:
        (h, w, 3), a new picture.
    """
    height, width = rgb.shape[:2]
    least, most = _DROP_RADIUS
    small = (ceil(width / _SOFT), ceil(height / _SOFT))
    soft = cv2.GaussianBlur(
        cv2.resize(rgb, small, interpolation=cv2.INTER_AREA), (0, 0), _OUT_OF_FOCUS * small[1]
    )
    drawn = random.random((round(_DROPS * drops), 5))
    shortest, longest = _DROP_LASTS
    fallen = np.floor(max(0.0, time) / (shortest + (longest - shortest) * drawn[:, 0]) + drawn[:, 1])
    # Where one runs off, the next one falls somewhere else.
    x, y, size = ((drawn[:, 2:] + fallen[:, None] * _NEXT_DROP) % 1.0).T
    places = np.column_stack([x * width, y * height, height * (least + (most - least) * size**2)])
    seen = rgb.copy()
    draw_drops(seen, soft, places, _DROP_SHOWS, _DROP_EDGE)
    return seen


def darken_corners(camera: Camera, share: float) -> Floats:
    """Tell what share of the light reaches each pixel through a lens with vignetting.

    Args:
        camera: its width and height count.
        share: of the light that the corners lose, 0 to 1.

    Returns:
        (h, w, 3), 1 in the middle.
    """
    down = (np.arange(camera.height) + 0.5 - camera.height / 2)[:, None]
    across = (np.arange(camera.width) + 0.5 - camera.width / 2)[None, :]
    square = (down**2 + across**2) / ((camera.height / 2) ** 2 + (camera.width / 2) ** 2)
    return np.repeat((1.0 - share * square)[..., None].astype(np.float32), 3, axis=2)


def scatter_sun(camera: Camera, light: Light, scene: Scene | None) -> Floats:
    """Compute the light of the sun that strays in the lens: a halo, and reflections between its glasses.

    Args:
        camera: where it hangs, and looks.
        light: where the sun is, and how bright.
        scene: what may stand before the sun; None for an open sky.

    Returns:
        (h, w, 3) linear light to add; nothing where the scene hides the sun from the camera.
    """
    height, width = camera.height, camera.width
    sun = camera.axes @ light.sun
    down, across = np.mgrid[0:height, 0:width].astype(np.float32) + np.float32(0.5)
    down, across = down - np.float32(height / 2), across - np.float32(width / 2)
    length = np.sqrt(across**2 + down**2 + np.float32(camera.focal_length**2))
    towards = (across * sun[0] + down * sun[1] + np.float32(camera.focal_length) * sun[2]) / length
    away = np.degrees(np.arccos(np.clip(towards, -1.0, 1.0)))
    halo = sum(bright * np.exp(-away / fall) for bright, fall in _HALO)
    stray = np.repeat(np.asarray(halo, dtype=np.float32)[..., None], 3, axis=2)
    if sun[2] > 0.3:
        x, y = sun[:2] / sun[2] * camera.focal_length
        for beyond, size, colour in _GHOSTS:
            near = np.hypot(across + x * beyond, down + y * beyond) / np.float32(size * height)
            disc = np.clip(4.0 * (1.0 - near), 0.0, 1.0) * (0.5 + 0.5 * np.minimum(1.0, near) ** 2)
            stray += disc[..., None] * np.array(colour, dtype=np.float32) * np.float32(_GHOST)
    stray *= (light.sun_colour * _see_sun(camera, light, scene)).astype(np.float32)
    return stray


def _see_sun(camera: Camera, light: Light, scene: Scene | None) -> float:
    """Measure the share of the sun, and of the sky right around it, that a camera has a free view of."""
    if scene is None:
        return 1.0
    sun = light.sun
    right = np.array([sun[1], -sun[0], 0.0]) / max(1e-9, np.hypot(sun[0], sun[1]))
    turn = np.array([right, np.cross(sun, right), sun])
    focal = _SUN_PIXELS / 2 / np.tan(np.radians(_SUN_DEG) / 2)
    lens = np.array([focal, _SUN_PIXELS / 2, _SUN_PIXELS / 2, 0.2, 2000.0])
    tags = np.full((_SUN_PIXELS, _SUN_PIXELS), -1, dtype=np.int32)
    depths = np.zeros(tags.shape, dtype=np.float32)
    eye = np.array(camera.position) - scene.origin
    draw_mesh(scene.vertices, scene.faces, turn, eye, lens, depths, tags)
    return float((tags < 0).mean())
