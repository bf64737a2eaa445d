"""Which cameras take the pictures, read from texts; more names of cameras are added here alone."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from dojo_env.camera import BEV, Camera, read_cameras
from dojo_env.camera_presets import CAMERA_PRESETS, PAPER
from dojo_env.errors import ConfigError
from dojo_env.rendering.scene import Scene
from dojo_env.sensors.placement import place_cameras

ALL, APPROACH = "all", "approach"
NAMES = (APPROACH, BEV, ALL, *CAMERA_PRESETS)
"""Names beside files: a camera per approach of every signal, as the paper has them or as a preset hangs them;
one above each signal; and the first and the second of these."""


def choose_cameras(
    texts: Sequence[str], scene: Scene, signals: Sequence[str], size: tuple[int, int]
) -> tuple[Camera, ...]:
    """Choose the cameras of a scenario; each gets a name that no other has.

    Args:
        texts: of `NAMES`, or files of cameras.
        scene: of the scenario.
        signals: at which cameras are placed.
        size: width and height of the pictures of those that are placed, pixels.

    Returns:
        The cameras, text by text, those that are placed signal by signal.

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
    """See that each text is a name or a file of cameras.

    Args:
        texts: of `NAMES`, or paths of files that `write_cameras` wrote.

    Returns:
        The files among them, in their order.

    Raises:
        ConfigError: one is neither, or its file cannot be read.
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
    preset = text if text in CAMERA_PRESETS else PAPER
    prefix = "" if preset == PAPER else f"{preset}_"
    return [
        replace(camera, name=f"{signal}_{prefix}{camera.name}")
        for signal in signals
        for camera in place_cameras(scene, signal, preset=preset, width=width, height=height)
        if text == ALL or (camera.name == BEV) == (text == BEV)
    ]
