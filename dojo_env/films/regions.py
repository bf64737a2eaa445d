"""Regions of a picture, by lane: who is in which, for films of places that no map shows.

A region is a polygon in pixels. A road user is in the one that holds the middle of its foot. Speeds come from
how far a box moves between two looks, in car heights of 1.5 m: good enough to tell who stands.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeGuard

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import LARGEST_SIDE
from dojo_env.detectors.base import Detections
from dojo_env.detectors.measuring import LaneMeasurements
from dojo_env.errors import RegionError
from dojo_env.films.measuring import Measured, Seen
from dojo_env.snapshot import Kind
from dojo_maps.safe_json import read_json

Floats = NDArray[np.float64]

_FORMAT = ("dojo-regions", 1)
_MOST, _MOST_CORNERS = 1000, 1000
_FOOT = 0.15
"""Share of a box's height above its lower edge, where a road user stands on the road."""
_CAR_HEIGHT, _CAR_LENGTH = 1.5, 4.7
"""Metres."""
_STANDING = 0.5
"""m/s; boxes tremble, so what is slower stands."""
_NEAR = 1.2
"""Box heights from where a road user is expected within which it may be found."""
_FASTEST = 20.0
"""m/s, of who has been seen once."""
_PATIENCE = 2.0
"""Seconds for which one is remembered unseen."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """A lane's part of the picture.

    Attributes:
        lane: its name; the id of a map's lane where a controller is to know it.
        polygon: (n, 2) pixels.
    """

    lane: str
    polygon: Floats


def read_regions(path: Path) -> tuple[tuple[Region, ...], tuple[int, int]]:
    """Read regions.

    Args:
        path: JSON, `{"format": "dojo-regions", "version": 1, "width": W, "height": H, "regions": {LANE:
            [[u, v], ...]}}`, in pixels of a picture of that size.

    Returns:
        The regions, and width and height of the picture that they were drawn over.

    Raises:
        RegionError: the file is missing, not JSON, or holds no regions.
    """
    value = read_json(path, error=RegionError)
    if not isinstance(value, dict) or (value.get("format"), value.get("version")) != _FORMAT:
        raise RegionError(path, "not a dojo-regions file of version 1")
    width, height, told = (value.get(name) for name in ("width", "height", "regions"))
    if not _is_side(width) or not _is_side(height):
        raise RegionError(path, "width and height are missing; give those of the picture, in pixels")
    if not isinstance(told, dict) or not 1 <= len(told) <= _MOST:
        raise RegionError(path, f"regions: expected an object of 1 to {_MOST} polygons by lane")
    return tuple(_read_region(path, lane, corners) for lane, corners in told.items()), (width, height)


def _is_side(value: object) -> TypeGuard[int]:
    return isinstance(value, int) and 1 <= value <= LARGEST_SIDE


def _read_region(path: Path, lane: str, corners: object) -> Region:
    try:
        polygon = np.array(corners, np.float64)
    except (TypeError, ValueError):
        polygon = np.empty(0)
    if polygon.ndim != 2 or polygon.shape[1:] != (2,) or not 3 <= len(polygon) <= _MOST_CORNERS:
        raise RegionError(path, f"expected 3 to {_MOST_CORNERS} corners [u, v]", f"region {lane!r}")
    if not (np.abs(polygon) <= 1e5).all():
        raise RegionError(path, "its corners are no pixels", f"region {lane!r}")
    return Region(lane=lane, polygon=polygon)


@dataclass(slots=True, kw_only=True, eq=False)
class _Track:
    """A road user followed in the picture; places and speeds are pixels and pixels a second."""

    number: int
    box: Floats
    seen: float
    way: Floats = field(default_factory=lambda: np.zeros(2))
    looks: int = 1
    waited: float = 0.0

    @property
    def speed(self) -> float | None:
        """Estimate m/s, too little where the way leads away from the camera; None after one look."""
        height = max(float(self.box[3] - self.box[1]), 1.0)
        return float(np.hypot(*self.way)) / height * _CAR_HEIGHT if self.looks > 1 else None

    @property
    def is_halting(self) -> bool:
        """It has been seen to stand."""
        return self.speed is not None and self.speed < _STANDING

    def move(self, box: Floats, time: float) -> None:
        """Go to where it has been seen."""
        step = max(time - self.seen, 1e-6)
        way = (_foot(box) - _foot(self.box)) / step
        self.way = way if self.looks == 1 else 0.5 * (self.way + way)
        self.box, self.seen, self.looks = box, time, self.looks + 1
        self.waited += step if self.is_halting else 0.0


class RegionMeasurer:
    """Measures the regions of a picture."""

    part: tuple[int, int, int, int] | None = None

    def __init__(self, regions: Sequence[Region]) -> None:
        """Take the regions, in the picture's own pixels."""
        self.lanes = tuple(region.lane for region in regions)
        self._polygons = [region.polygon.astype(np.float32).reshape(-1, 1, 2) for region in regions]
        self._tracks: list[_Track] = []
        self._last = 0

    def update(self, time: float, found: Detections) -> Measured:
        """Take what a look has found."""
        tracks = self._follow(time, found.boxes)
        self._tracks = [
            *tracks,
            *(t for t in self._tracks if t not in tracks and time - t.seen <= _PATIENCE),
        ]
        seen = tuple(
            self._describe(track, Kind(kind))
            for track, kind in zip(tracks, found.kinds.tolist(), strict=True)
        )
        return Measured(lanes=self._count(time, seen), seen=seen)

    def _describe(self, track: _Track, kind: Kind) -> Seen:
        left, top, right, bottom = track.box.tolist()
        return Seen(
            number=track.number,
            kind=kind,
            box=(left, top, right, bottom),
            lane="" if kind == Kind.PEDESTRIAN else self._find_lane(_foot(track.box)),
            speed=track.speed,
            is_halting=track.is_halting,
        )

    def _count(self, time: float, seen: Sequence[Seen]) -> LaneMeasurements:
        """Count the lanes; who is lowest in the picture is taken to be nearest to the stop line."""
        below = sorted(seen, key=lambda each: -each.box[3])
        held = [[each for each in below if each.lane == lane] for lane in self.lanes]
        waited = {track.number: track.waited for track in self._tracks}
        speeds = [[each.speed for each in on if each.speed is not None] for on in held]
        return LaneMeasurements(
            time=time,
            lanes=self.lanes,
            vehicles=np.array([len(on) for on in held], np.float64),
            halting=np.array([sum(each.is_halting for each in on) for on in held], np.float64),
            mean_speed=np.array([np.mean(each) if each else np.nan for each in speeds]),
            mean_length=np.array([_CAR_LENGTH if on else 0.0 for on in held]),
            waiting=np.array([sum(waited[each.number] for each in on) for on in held]),
            tracks=tuple(tuple(each.number for each in on) for on in held),
        )

    def _find_lane(self, at: Floats) -> str:
        for lane, polygon in zip(self.lanes, self._polygons, strict=True):
            if cv2.pointPolygonTest(polygon, (float(at[0]), float(at[1])), False) >= 0:
                return lane
        return ""

    def _follow(self, time: float, boxes: Floats) -> list[_Track]:
        """Give each box its track: the nearest pairs first, what is left begins new ones."""
        given: dict[int, _Track] = {}
        pairs = sorted(
            (_distance(track, box, time), row, column)
            for row, track in enumerate(self._tracks)
            for column, box in enumerate(boxes)
        )
        used: set[int] = set()
        for distance, row, column in pairs:
            if distance > 1.0:
                break
            if row not in used and column not in given:
                used.add(row)
                given[column] = self._tracks[row]
                given[column].move(boxes[column], time)
        for column, box in enumerate(boxes):
            if column not in given:
                self._last += 1
                given[column] = _Track(number=self._last, box=box, seen=time)
        return [given[column] for column in range(len(boxes))]


def _foot(box: Floats) -> Floats:
    return np.array([(box[0] + box[2]) / 2, box[3] - _FOOT * (box[3] - box[1])])


def _distance(track: _Track, box: Floats, time: float) -> float:
    """How far a box is from where a track's is expected, in what is allowed; sizes must be alike."""
    step = time - track.seen
    sizes = track.box[2:] - track.box[:2], box[2:] - box[:2]
    ratio = sizes[0] / np.maximum(sizes[1], 1e-6)
    if not (ratio > 0.4).all() or not (ratio < 2.5).all():
        return np.inf
    height = float(np.sqrt(sizes[0][1] * sizes[1][1]))
    allowed = _NEAR * height
    if track.looks == 1:
        allowed += _FASTEST / _CAR_HEIGHT * height * min(step, 0.25)
    off = _foot(box) - _foot(track.box) - track.way * step
    return float(np.hypot(*off)) / max(allowed, 1e-6)
