"""The views of an instant: the cameras of one signal, or of several signals the one above each."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import BEV, LARGEST_SIDE, Camera
from dojo_env.sensors.eyes import Eyes
from dojo_env.snapshot import Snapshot
from dojo_env.watching.board import Board

Image = NDArray[np.uint8]
_VIEWER = "person"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """What is shown of an instant.

    Attributes:
        board: its figures.
        views: (h, w, 3) uint8 RGB by title; the first is the main one.
    """

    board: Board
    views: Mapping[str, Image]


def choose_cameras(eyes: Eyes, signals: Iterable[str]) -> dict[str, Camera]:
    """Choose what to show, by title: all cameras of a single signal, of several the main one of each.

    The main one is the bird's eye view, drawn twice as large where it is not the only kind.

    Args:
        eyes: what places the cameras.
        signals: ids, at least one.

    Returns:
        Cameras by title; the title is the signal's id where there are several signals.

    Raises:
        ConfigError: the map has no such signal, or no lane leads to it.
    """
    names = list(signals)
    if len(names) > 1:
        return {name: _main(eyes.cameras(name)) for name in names}
    cameras = eyes.cameras(names[0])
    main = _main(cameras)
    scale = 2 if 2 * max(main.width, main.height) <= LARGEST_SIDE else 1
    large = replace(main, width=scale * main.width, height=scale * main.height)
    return {_title(main): large} | {_title(camera): camera for camera in cameras if camera is not main}


def draw_views(eyes: Eyes, cameras: Mapping[str, Camera], snapshot: Snapshot) -> dict[str, Image]:
    """Draw an instant through each camera.

    Args:
        eyes: what draws; what the agents' own lenses remember stays as it is.
        cameras: by title.
        snapshot: the instant.

    Returns:
        (h, w, 3) uint8 RGB by title, in the cameras' order.

    Raises:
        ConfigError: the renderer is pybullet's, and a camera's lens bends.
    """
    pictures: Any = eyes.look(snapshot, tuple(cameras.values()), viewer=_VIEWER)
    return {title: picture.rgb for title, picture in zip(cameras, pictures, strict=True)}


def _main(cameras: Iterable[Camera]) -> Camera:
    first, *rest = cameras
    return next((camera for camera in (first, *rest) if camera.name == BEV), first)


def _title(camera: Camera) -> str:
    """Name a view for people: `approach_0` becomes Approach 1."""
    kind, _, number = camera.name.rpartition("_")
    if camera.name == BEV:
        return "From above"
    return f"Approach {int(number) + 1}" if kind == "approach" and number.isdecimal() else camera.name
