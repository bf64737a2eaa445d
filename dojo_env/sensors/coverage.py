"""What cameras see of the lanes that they watch: how much of each, and how large."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dojo_env.camera import Camera
from dojo_env.rendering.scene import Scene
from dojo_env.sensors.placement import Approach, Floats, find_seen, point_before_end
from dojo_maps.index import MapIndex

DISTANCES = (0.0, 30.0, 60.0)
"""Metres before the stop line at which pixels are counted."""
WATCHED = 100.0
"""Metres before the stop line to which a lane is watched, where it and what leads into it is that long."""
_HEIGHTS = (0.75, 1.5)
"""Metres above the ground: a bonnet and a roof."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneView:
    """A lane as a camera sees it.

    Attributes:
        lane: its id.
        length: metres before the stop line that are watched.
        seen: share of that which is in the picture, and behind nothing static.
        pixels_per_metre: across the lane, at each of `DISTANCES`; None where that is not in the picture, or
            before the lane begins.
    """

    lane: str
    length: float
    seen: float
    pixels_per_metre: tuple[float | None, ...]


def measure_views(scene: Scene, camera: Camera, approaches: Iterable[Approach]) -> tuple[LaneView, ...]:
    """Measure what a camera sees of each lane of some approaches.

    Args:
        scene: the static world.
        camera: the camera.
        approaches: see `placement.find_approaches`.

    Returns:
        One for each lane, in their order.
    """
    lanes = MapIndex(scene.road_map).lanes
    lines = [
        (lanes[lane], line) for each in approaches for lane, line in zip(each.lanes, each.lines, strict=True)
    ]
    lengths = [min(WATCHED, float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())) for _, line in lines]
    probes = [_probe(line, length) for (_, line), length in zip(lines, lengths, strict=True)]
    seen = np.split(
        find_seen(scene, camera, np.concatenate(probes)), np.cumsum([len(p) for p in probes])[:-1]
    )
    return tuple(
        LaneView(
            lane=lane.id,
            length=round(length, 1),
            seen=round(float(found.mean()), 3),
            pixels_per_metre=tuple(
                _count_pixels(camera, line, lane.width, distance) if distance <= length else None
                for distance in DISTANCES
            ),
        )
        for (lane, line), length, found in zip(lines, lengths, seen, strict=True)
    )


def list_watched(camera: Camera, approaches: Sequence[Approach]) -> Sequence[Approach]:
    """Tell which of a signal's approaches a camera is for: by its name `approach_0` one, else all.

    Args:
        camera: its name counts.
        approaches: in the order of `placement.find_approaches`.

    Returns:
        That one alone; all of them where the name tells none, or one that the signal has not.
    """
    kind, _, number = camera.name.rpartition("_")
    if kind == "approach" and number.isdecimal() and int(number) < len(approaches):
        return [approaches[int(number)]]
    return approaches


def _probe(line: Floats, length: float) -> Floats:
    """Take a point each metre of a lane, at each height: (n, 3)."""
    ground = np.array([point_before_end(line, distance) for distance in np.arange(0.0, length + 1e-6)])
    return np.concatenate([ground + np.array([0.0, 0.0, height]) for height in _HEIGHTS])


def _count_pixels(camera: Camera, line: Floats, width: float, distance: float) -> float | None:
    """Count the pixels of a metre across a lane, on the ground."""
    place, behind = point_before_end(line, distance), point_before_end(line, distance + 1.0)
    before = point_before_end(line, max(0.0, distance - 1.0))
    along = (before - behind)[:2] / max(1e-9, float(np.hypot(*(before - behind)[:2])))
    across = np.array([-along[1], along[0], 0.0]) * width / 2
    pixels, _ = camera.project(np.array([place - across, place, place + across]))
    middle = pixels[1]
    if not (
        (middle > 0).all() and (middle < [camera.width, camera.height]).all() and np.isfinite(pixels).all()
    ):
        return None
    return round(float(np.hypot(*(pixels[2] - pixels[0]))) / width, 2)
