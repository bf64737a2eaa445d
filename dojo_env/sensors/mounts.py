"""What moves a camera: mounts that were set up by hand, once an episode, and wind, picture by picture."""

from collections.abc import Iterable
from dataclasses import replace
from zlib import crc32

import cv2
import numpy as np

from dojo_env.camera import Camera
from dojo_env.conditions import Conditions
from dojo_env.rendering.boxes import Boxes
from dojo_env.rendering.outputs import Picture
from dojo_env.rendering.visibility import Visible


def shake_cameras(cameras: Iterable[Camera], conditions: Conditions) -> tuple[Camera, ...]:
    """Move and turn each camera a little, as a mount that was set up by hand; one draw per seed and name.

    Args:
        cameras: as they were planned.
        conditions: say how much, and hold the seed.

    Returns:
        Each as it hangs, in their order; itself where mounts are not shaken.
    """
    return tuple(_shaken(camera, conditions) for camera in cameras)


def _shaken(camera: Camera, conditions: Conditions) -> Camera:
    if conditions.shake_m == 0 and conditions.shake_deg == 0:
        return camera
    generator = random_of(conditions, camera.name, 0.0, "shake")
    x, y, z = np.array(camera.position) + generator.normal(0.0, conditions.shake_m, 3)
    turned = _turn(camera, generator, conditions.shake_deg)
    return replace(turned, position=(float(x), float(y), float(z)))


def _turn(camera: Camera, generator: np.random.Generator, deviation: float) -> Camera:
    heading, pitch, roll = generator.normal(0.0, deviation, 3)
    return replace(
        camera,
        heading_deg=camera.heading_deg + float(heading),
        pitch_deg=camera.pitch_deg + float(pitch),
        roll_deg=camera.roll_deg + float(roll),
    )


def sway(picture: Picture, conditions: Conditions, time: float) -> Picture:
    """Turn a camera a little for one picture, with all that it shows.

    What comes into view is the edge, drawn out. A lens that bends is taken for a straight one, which is right
    in its middle.

    Args:
        picture: through the camera at rest.
        conditions: say how much.
        time: simulated seconds; with the camera's name and the seed it decides the turn.

    Returns:
        The picture through the turned camera. Visible pixels and shares of its boxes are those at rest.
    """
    rest = picture.camera
    turned = _turn(rest, random_of(conditions, rest.name, time, "sway"), conditions.sway_deg)
    # Pixels of one camera as those of the other: they differ by a rotation. Source: Hartley and Zisserman,
    # Multiple View Geometry, section 8.4.
    matrix = turned.intrinsics @ turned.axes @ rest.axes.T @ np.linalg.inv(rest.intrinsics)
    # OpenCV's pixels have whole numbers in their middles.
    half = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
    warp = np.linalg.inv(half) @ matrix @ half
    outputs = dict(picture.outputs)
    for name, output in outputs.items():
        if isinstance(output, np.ndarray):
            how = cv2.INTER_LINEAR if name == "rgb" else cv2.INTER_NEAREST
            outputs[name] = np.asarray(
                cv2.warpPerspective(
                    output, warp, (rest.width, rest.height), flags=how, borderMode=cv2.BORDER_REPLICATE
                )
            )
        elif isinstance(output, Boxes | Visible):
            outputs[name] = output.turned(turned, matrix)
    return replace(picture, camera=turned, outputs=outputs)


def random_of(conditions: Conditions, camera: str, time: float, purpose: str) -> np.random.Generator:
    """Make a generator that depends on nothing but its arguments, and the seed of the conditions.

    Args:
        conditions: of these only the seed counts.
        camera: its name.
        time: simulated seconds; 0 for what stays for the episode.
        purpose: what is drawn with it, any name; each has numbers of its own.

    Returns:
        A fresh generator.
    """
    instant = int(np.float64(time).view(np.uint64))
    return np.random.default_rng([conditions.seed, crc32(camera.encode()), instant, crc32(purpose.encode())])
