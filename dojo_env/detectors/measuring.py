"""What detections tell of lanes: how many vehicles each has, how many stand, and how fast they are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dojo_env.camera import Camera
from dojo_env.detectors.base import Detections, Floats
from dojo_env.detectors.grounding import Grounding, build_grid
from dojo_env.detectors.tracking import Sighting, Track, Tracker
from dojo_env.snapshot import Kind
from dojo_maps.description import RoadMap

_MARGIN = 0.03
"""Share of a picture's sides around what is looked at."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneMeasurements:
    """Figures of lanes at one time; arrays and tuples have one entry per lane.

    Attributes:
        time: seconds.
        lanes: their ids.
        vehicles: (n,) how many there are.
        halting: (n,) how many of them stand.
        mean_speed: (n,) m/s, of those whose speed is known; nan where there is none.
        mean_length: (n,) metres; 0 where there is none.
        waiting: (n,) the sum over the vehicles of the seconds that they have stood in sight.
        tracks: the numbers of the vehicles, who is nearest to the lane's end first.
        urgent: the lanes on which somebody has his blue lights on, as far as that is measured.
        places: by lane, of each vehicle the metres from its front to the end, and whether it stands; who
            is nearest first. Lanes of which this is not measured are left out.
    """

    time: float
    lanes: tuple[str, ...]
    vehicles: Floats
    halting: Floats
    mean_speed: Floats
    mean_length: Floats
    waiting: Floats
    tracks: tuple[tuple[int, ...], ...]
    urgent: frozenset[str] = frozenset()
    places: Mapping[str, tuple[tuple[float, bool], ...]] = field(default_factory=dict)


class WaitingSum:
    """Adds up for how long those have stood who are on lanes now, where only their numbers are known."""

    def __init__(self, lanes: int) -> None:
        """Begin with empty lanes."""
        self._time: float | None = None
        self._vehicles, self._halting, self._waiting = np.zeros(lanes), np.zeros(lanes), np.zeros(lanes)

    def add(self, time: float, vehicles: Floats, halting: Floats) -> Floats:
        """Take the vehicles of each lane at a time; who drives off takes his share of the waiting along.

        Args:
            time: seconds; later than the last one's.
            vehicles: (n,) on each lane.
            halting: (n,) of them that stand.

        Returns:
            (n,) the sum over the vehicles of each lane of the seconds that they have stood.
        """
        passed = 0.0 if self._time is None else time - self._time
        left = np.minimum(1.0, vehicles / np.maximum(self._vehicles, 1.0))
        self._waiting = self._waiting * left + np.minimum(halting, self._halting) * passed
        self._time, self._vehicles, self._halting = time, vehicles, halting
        return self._waiting


class LaneWatch:
    """Follows the traffic of some lanes in the detections of one or more cameras.

    Attributes:
        cameras: they are told apart by their order.
        lanes: ids of the lanes that are measured.
        regions: of each camera's picture the part that shows them, left, top, right and bottom, pixels; None
            where it shows none. The rest need not be looked at.
    """

    def __init__(self, cameras: Sequence[Camera], road_map: RoadMap, lanes: Sequence[str]) -> None:
        """Look where the lanes are in the pictures.

        Args:
            cameras: as they hang, distortion included.
            road_map: the map, with its ground's heights.
            lanes: ids of the lanes to measure.
        """
        self.cameras, self.lanes = tuple(cameras), tuple(lanes)
        self._grid = build_grid(road_map, self.cameras)
        self._groundings = [Grounding(camera, self._grid) for camera in self.cameras]
        heights = np.array([each.heights for each in self._groundings])
        # A place that several cameras show belongs to the one that shows it largest, so nobody counts twice.
        self._owners = np.where(heights.max(axis=0) > 0, heights.argmax(axis=0), -1)
        number = {lane: k for k, lane in enumerate(self.lanes)}
        self._number = np.array([number.get(lane, -1) for lane in self._grid.lanes])
        self.regions = tuple(self._find_region(k) for k in range(len(self.cameras)))
        self.reset()

    def reset(self) -> None:
        """Begin anew with an empty street."""
        self._tracker = Tracker()

    @property
    def tracks(self) -> tuple[Track, ...]:
        """Everyone who is followed now, also on other lanes that are in view."""
        return tuple(self._tracker.tracks)

    def name_lane(self, track: Track) -> str:
        """Give the id of the lane that a track is on.

        Args:
            track: one of `tracks`.

        Returns:
            The id, also of a lane that is not measured; "" on a junction and where cars park.
        """
        return self._grid.lanes[track.lane]

    def update(self, time: float, detections: Sequence[Detections]) -> LaneMeasurements:
        """Take what the cameras have seen at one time.

        Args:
            time: seconds; later than the last one's.
            detections: of each camera, in whole pictures.

        Returns:
            The figures of `lanes`, in their order.
        """
        self._tracker.update(
            time, [each for camera, found in enumerate(detections) for each in self._list(camera, found)]
        )
        return self._measure(time)

    def _list(self, camera: int, detections: Detections) -> list[Sighting]:
        """List what a camera has seen at places that are its own."""
        grid, placed = self._grid, self._groundings[camera].locate(detections)
        return [
            Sighting(
                kind=Kind(detections.kinds[number]),
                lane=int(grid.lane[row]),
                left=float(grid.left[row]),
                front=front,
                heading=grid.headings[row],
                error=error,
                length=length,
                source=(camera, number),
            )
            for number, row, front, error, length in zip(
                placed.detections.tolist(),
                placed.rows.tolist(),
                placed.fronts,
                placed.errors.tolist(),
                placed.lengths.tolist(),
                strict=True,
            )
            if self._owners[row] == camera
        ]

    def _measure(self, time: float) -> LaneMeasurements:
        held: list[list[Track]] = [[] for _ in self.lanes]
        for track in self._tracker.tracks:
            if (number := self._number[track.lane]) >= 0:
                held[number].append(track)
        for tracks in held:
            tracks.sort(key=lambda track: track.left)
        speeds = [[track.speed for track in tracks if track.looks > 1] for tracks in held]
        return LaneMeasurements(
            time=time,
            lanes=self.lanes,
            vehicles=np.array([len(tracks) for tracks in held], np.float64),
            halting=np.array([sum(track.is_halting for track in tracks) for tracks in held], np.float64),
            mean_speed=np.array([np.mean(each) if each else np.nan for each in speeds]),
            mean_length=np.array([np.mean([t.length for t in ts]) if ts else 0.0 for ts in held]),
            waiting=np.array([sum(track.waited for track in tracks) for tracks in held]),
            tracks=tuple(tuple(track.number for track in tracks) for tracks in held),
            places={
                lane: tuple((track.left, track.is_halting) for track in tracks)
                for lane, tracks in zip(self.lanes, held, strict=True)
            },
        )

    def _find_region(self, camera: int) -> tuple[int, int, int, int] | None:
        """Find the part of a picture that shows vehicles on the lanes at places that are the camera's own."""
        mine = (self._owners == camera) & (self._number[self._grid.lane] >= 0)
        if not mine.any():
            return None
        boxes = np.vstack([self._groundings[camera].expect(kind)[mine] for kind in (Kind.CAR, Kind.BUS)])
        size = np.array([self.cameras[camera].width, self.cameras[camera].height])
        low = np.nanmin(boxes[:, :2], axis=0) - _MARGIN * size
        high = np.nanmax(boxes[:, 2:], axis=0) + _MARGIN * size
        left, top = np.maximum(low, 0).astype(int).tolist()
        right, bottom = np.minimum(high, size).astype(int).tolist()
        return left, top, right, bottom


def shift(detections: Detections, left: int, top: int) -> Detections:
    """Turn detections of a part of a picture into detections of the whole.

    Args:
        detections: boxes in pixels of the part.
        left: where the part begins in the whole, pixels.
        top: the same, downwards.

    Returns:
        New ones, with boxes in pixels of the whole.
    """
    return replace(detections, boxes=detections.boxes + np.array([left, top, left, top], np.float64))
