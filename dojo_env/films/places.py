"""What is known of the place that a film shows: a map and the camera on it, or regions of the picture."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.calibration.fitting import find_seen
from dojo_env.calibration.overlay import draw_overlay
from dojo_env.camera import Camera
from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.films.measuring import MapMeasurer, Measurer
from dojo_env.films.regions import Region, RegionMeasurer
from dojo_env.managers.map import MapManager
from dojo_maps.bundle import Bundle

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

_LINE = (255, 214, 60)
_LOOKED_AT, _STEP = 80.0, 5.0
"""Metres of a lane where it may be seen, and between the places that are tried."""
_FARTHEST = 120.0
"""Metres from a camera beyond which a lane is not measured."""
_LABELLED = (6.0, 15.0, 30.0, 0.0)
"""Metres before a lane's end where its counts are written: the first of them that is in the picture."""
_ALIKE = 0.02
"""Relative difference of two shapes of pictures that still are one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Backdrop:
    """What lies over every frame.

    Attributes:
        lines: (h, w, 3) uint8 RGB, black where nothing is drawn.
        labels: where the counts of each lane are written, pixels.
    """

    lines: Image
    labels: Mapping[str, tuple[float, float]]


class Place(Protocol):
    """Makes what measures a film, once its frames' width and height are known."""

    lanes: tuple[str, ...]

    def measure(self, width: int, height: int) -> Measurer:
        """Make what measures frames of a size.

        Args:
            width: pixels.
            height: pixels.

        Returns:
            What follows road users from frame to frame; nobody has been seen yet.

        Raises:
            ConfigError: the frames are not shaped as the pictures that the place is known by.
        """
        ...

    def draw(self, width: int, height: int) -> Backdrop:
        """Draw the lanes for frames of a size.

        Args:
            width: pixels.
            height: pixels.

        Returns:
            What lies over every frame.

        Raises:
            ConfigError: the frames are not shaped as the pictures that the place is known by.
        """
        ...


class MapPlace:
    """A map, and the camera that hangs there.

    Attributes:
        lanes: those that lead to or from a signal and are in view.
    """

    def __init__(self, bundle: Bundle, camera: Camera, signals: Sequence[str] | None = None) -> None:
        """Find the lanes that are in view.

        Args:
            bundle: the map.
            camera: as it hangs.
            signals: ids of those whose lanes are measured; None takes all.

        Raises:
            ConfigError: the map has no such signal, or none of their lanes is in view.
        """
        self._map, self._camera = bundle.road_map, camera
        chosen = None if signals is None else tuple(signals)
        plans = MapManager(bundle, SignalConfig(ts_ids=chosen)).plans.values()
        incoming = dict.fromkeys(lane for plan in plans for lane in plan.lanes)
        outgoing = dict.fromkeys(lane for plan in plans for lane in plan.out_lanes)
        self._shapes = {lane.id: lane.shape for lane in self._map.lanes}
        self.lanes = tuple(
            lane
            for lane, away in {**dict.fromkeys(outgoing, True), **dict.fromkeys(incoming, False)}.items()
            if self._is_seen(self._shapes[lane], is_start=away)
        )
        if not self.lanes:
            raise ConfigError(f"camera {camera.name!r} sees no lane that leads to or from a signal")

    def measure(self, width: int, height: int) -> Measurer:
        """Measure the lanes on the map."""
        return MapMeasurer(self._fitted(width, height), self._map, self.lanes)

    def draw(self, width: int, height: int) -> Backdrop:
        """Draw all lanes of the map."""
        camera = self._fitted(width, height)
        labels = {}
        for lane in self.lanes:
            pixels, seen = find_seen(camera, _places(self._shapes[lane], np.array(_LABELLED)), 12.0)
            if seen.any():
                u, v = pixels[int(np.argmax(seen))].tolist()
                labels[lane] = (u, v)
        black = np.zeros((height, width, 3), np.uint8)
        return Backdrop(lines=draw_overlay(black, camera, self._map), labels=labels)

    def _is_seen(self, line: Floats, *, is_start: bool) -> bool:
        line = line[::-1] if is_start else line
        places = _places(line, np.arange(0.0, _LOOKED_AT, _STEP))
        near = np.hypot(*(places[:, :2] - self._camera.position[:2]).T) < _FARTHEST
        return bool((find_seen(self._camera, places)[1] & near).any())

    def _fitted(self, width: int, height: int) -> Camera:
        _check_shape(
            (self._camera.width, self._camera.height), (width, height), f"camera {self._camera.name!r}"
        )
        return replace(self._camera, width=width, height=height)


class RegionPlace:
    """Polygons in the picture.

    Attributes:
        lanes: their names.
    """

    def __init__(self, regions: Iterable[Region], drawn: tuple[int, int]) -> None:
        """Take regions, and width and height of the picture that they were drawn over."""
        self._regions, self._drawn = tuple(regions), drawn
        self.lanes = tuple(region.lane for region in self._regions)

    def measure(self, width: int, height: int) -> Measurer:
        """Measure in the picture."""
        return RegionMeasurer(self._fitted(width, height))

    def draw(self, width: int, height: int) -> Backdrop:
        """Draw the regions' borders."""
        black = np.zeros((height, width, 3), np.uint8)
        labels = {}
        for region in self._fitted(width, height):
            corners = np.rint(region.polygon).astype(np.int32).reshape(-1, 1, 2)
            cv2.polylines(black, [corners], True, _LINE, 1, cv2.LINE_AA)
            u, v = region.polygon.mean(axis=0).tolist()
            labels[region.lane] = (u, v)
        return Backdrop(lines=black, labels=labels)

    def _fitted(self, width: int, height: int) -> tuple[Region, ...]:
        _check_shape(self._drawn, (width, height), "regions")
        scale = np.array([width / self._drawn[0], height / self._drawn[1]])
        return tuple(replace(region, polygon=region.polygon * scale) for region in self._regions)


def _places(line: Floats, before: Floats) -> Floats:
    """Find points of a line some metres before its end, or its start."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))
    at = np.maximum(along[-1] - before, 0.0)
    return np.column_stack([np.interp(at, along, line[:, axis]) for axis in range(3)])


def _check_shape(wanted: tuple[int, int], got: tuple[int, int], what: str) -> None:
    if abs(wanted[0] * got[1] / (wanted[1] * got[0]) - 1.0) > _ALIKE:
        raise ConfigError(
            f"{what} is for pictures of {wanted[0]} x {wanted[1]}, the film has {got[0]} x {got[1]}; "
            "take a frame of the film itself"
        )
