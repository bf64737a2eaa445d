"""What is measured of a film's lanes: by regions drawn over the picture, or by a camera on a map."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from dojo_env.camera import Camera
from dojo_env.detectors.base import Detections
from dojo_env.detectors.measuring import LaneMeasurements, LaneWatch
from dojo_env.snapshot import Kind
from dojo_maps.description import RoadMap

Box = tuple[float, float, float, float]
"""Left, top, right, bottom, pixels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """A road user in a picture.

    Attributes:
        number: of its track.
        kind: what it is.
        box: where it is in the picture.
        lane: name of the lane it is on; "" for none.
        speed: m/s; None where it is not known yet.
        is_halting: it has been seen to stand.
    """

    number: int
    kind: Kind
    box: Box
    lane: str
    speed: float | None
    is_halting: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """All that one look tells: figures of lanes, and who is in the picture."""

    lanes: LaneMeasurements
    seen: tuple[Seen, ...]

    def rows(self) -> Iterator[tuple[str, int, int, float]]:
        """Give each lane with its vehicles, those that stand, and their mean speed, m/s, or nan."""
        lanes = self.lanes
        for lane, vehicles, halting, speed in zip(
            lanes.lanes, lanes.vehicles, lanes.halting, lanes.mean_speed, strict=True
        ):
            yield lane, int(vehicles), int(halting), float(speed)


class Measurer(Protocol):
    """Follows road users from look to look.

    Attributes:
        part: of the picture that must be looked at: left, top, right, bottom, pixels; None for all of it.
    """

    part: tuple[int, int, int, int] | None

    def update(self, time: float, found: Detections) -> Measured:
        """Take what a look has found.

        Args:
            time: seconds; later than the last one's.
            found: in the whole picture.

        Returns:
            The lanes as they are at that time, and one row for each road user that was found.
        """
        ...


class MapMeasurer:
    """Measures the lanes of a map that a camera sees."""

    def __init__(self, camera: Camera, road_map: RoadMap, lanes: Sequence[str]) -> None:
        """Look where the lanes are in the picture.

        Args:
            camera: as it hangs, in the film's own pixels.
            road_map: the map.
            lanes: ids of those to measure.
        """
        self._watch = LaneWatch((camera,), road_map, lanes)
        (self.part,) = self._watch.regions

    def update(self, time: float, found: Detections) -> Measured:
        """Take what a look has found."""
        measured = self._watch.update(time, (found,))
        shown = {track.source[1]: track for track in self._watch.tracks if track.seen == time}
        seen = []
        for number, (box, kind) in enumerate(zip(found.boxes.tolist(), found.kinds.tolist(), strict=True)):
            track = shown.get(number)
            seen.append(
                Seen(
                    number=track.number if track else 0,
                    kind=Kind(kind),
                    box=(box[0], box[1], box[2], box[3]),
                    lane=self._watch.name_lane(track) if track else "",
                    speed=track.speed if track and track.looks > 1 else None,
                    is_halting=track.is_halting if track else False,
                )
            )
        return Measured(lanes=measured, seen=tuple(seen))
