"""Which cameras take the pictures, read from texts; more names of cameras are added here alone."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from dojo_env.camera import BEV, Camera, read_cameras
from dojo_env.errors import ConfigError
from dojo_env.rendering.scene import Scene
from dojo_env.sensors.placement import place_cameras

NAMES = ("approach", "bev", "all")
"""Names beside files: a camera per approach of every signal, one above each, and both."""


def choose_cameras(
    texts: Sequence[str], scene: Scene, signals: Sequence[str], size: tuple[int, int]
) -> tuple[Camera, ...]:
    """Choose the cameras of a scenario; each gets a name that no other has.

    Args:
        texts: of `NAMES`, or files of cameras.
        scene: of the scenario.
        signals: at which cameras are placed.
        size: width and height of the pictures of those that are placed, pixels.

    Raises:
        ConfigError: a text is neither, or two cameras share a name.
    """
    found = [camera for text in texts for camera in _choose(text, scene, signals, size)]
    names = [camera.name for camera in found]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise ConfigError(f"cameras {' '.join(texts)}: two are called {sorted(twice)[0]!r}; leave one out")
    return tuple(found)


def check_cameras(texts: Sequence[str]) -> tuple[Path, ...]:
    """See that each text is a name or a file of cameras; returns the files.

    Raises:
        ConfigError: it is neither.
    """
    files = tuple(Path(text) for text in texts if text not in NAMES)
    for file in files:
        if not file.suffix:
            raise ConfigError(
                f"cameras {str(file)!r}: expected {', '.join(NAMES)}, or a file that write_cameras wrote"
            )
        read_cameras(file)
    return files


def _choose(text: str, scene: Scene, signals: Sequence[str], size: tuple[int, int]) -> list[Camera]:
    if text not in NAMES:
        return list(read_cameras(text))
    width, height = size
    return [
        replace(camera, name=f"{signal}_{camera.name}")
        for signal in signals
        for camera in place_cameras(scene, signal, width=width, height=height)
        if text == "all" or (camera.name == BEV) == (text == BEV)
    ]
