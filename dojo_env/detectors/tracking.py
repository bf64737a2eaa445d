"""Road users followed on the ground from look to look, so that each has a speed and counts once.

A track drives along its lane: place and speed along it are a Kalman filter with constant velocity. Tracks and
sightings are paired on the ground, not in the picture: from second to second boxes need not overlap. Who is
not seen for a moment, behind a lorry or between two detections, is kept, and longest who stands.
Source: Bewley et al., Simple Online and Realtime Tracking, 2016.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.detectors.base import Floats
from dojo_env.snapshot import Kind

_ACCELERATION = 2.5
"""m/s², standard deviation of what drivers do."""
_FIRST_SPEED = 8.0
"""m/s, standard deviation of the speed of who has been seen once."""
_ACROSS = 1.3
"""Metres, standard deviation of steps to the side."""
_GATE = 12.0
"""Squared distance, in standard deviations, up to which a sighting may be a track's."""
_BACKWARDS = 0.7
"""Metres that a vehicle may seem to roll back, beside the errors."""
_FASTEST = 40.0
"""m/s."""
_CREEPING = 1.0
"""m/s; who is slower and goes out of sight is taken to stand there."""
_MOVING_PATIENCE, _STANDING_PATIENCE = 2.5, 10.0
"""Seconds for which a track is kept unseen."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sighting:
    """A detection on the ground.

    Attributes:
        kind: what it is.
        lane: number of the lane in the grid.
        left: metres to the lane's end.
        front: (3,) middle of its front, metres, map frame.
        heading: (2,) unit vector, the way traffic drives there.
        error: standard error along the lane, metres.
        length: metres.
        source: numbers of the camera and of the detection.
    """

    kind: Kind
    lane: int
    left: float
    front: Floats
    heading: Floats
    error: float
    length: float
    source: tuple[int, int]


@dataclass(slots=True, kw_only=True, eq=False)
class Track:
    """A road user that is followed.

    Attributes:
        number: above 0, never used again.
        kind: what it is.
        lane: number of the lane in the grid.
        left: metres from its front to the lane's end.
        front: (3,) middle of its front, metres, map frame.
        heading: (2,) unit vector.
        speed: m/s.
        length: metres.
        looks: how often it has been seen.
        seen: time of the last look that showed it, seconds.
        waited: seconds that it has stood in all.
        source: numbers of the camera and of the detection that showed it last.
        covariance: (2, 2) of place along the lane and speed.
    """

    number: int
    kind: Kind
    lane: int
    left: float
    front: Floats
    heading: Floats
    speed: float
    length: float
    looks: int
    seen: float
    waited: float
    source: tuple[int, int]
    covariance: Floats

    @property
    def is_halting(self) -> bool:
        """It has been seen to stand. Boxes tremble, so what creeps stands."""
        return self.looks > 1 and self.speed < _CREEPING


class Tracker:
    """Follows the road users of one place.

    Attributes:
        tracks: those that are there, the oldest first.
    """

    def __init__(self) -> None:
        """Begin with an empty street."""
        self.tracks: list[Track] = []
        self._time: float | None = None
        self._last = 0

    def update(self, time: float, sightings: Sequence[Sighting]) -> None:
        """Take what a look has shown.

        Args:
            time: seconds; later than the last one's.
            sightings: each road user once.
        """
        step = 0.0 if self._time is None else time - self._time
        self._time = time
        for track in self.tracks:
            _predict(track, step)
        pairs = _match(self.tracks, sightings, step)
        for row, column in pairs:
            _correct(self.tracks[row], sightings[column], time)
        for track in self.tracks:
            track.waited += step if track.is_halting else 0.0
        self.tracks = [track for track in self.tracks if _is_kept(track, time)]
        taken = {column for _, column in pairs}
        self.tracks += [self._begin(each, time) for k, each in enumerate(sightings) if k not in taken]

    def _begin(self, sighting: Sighting, time: float) -> Track:
        self._last += 1
        return Track(
            number=self._last,
            kind=sighting.kind,
            lane=sighting.lane,
            left=sighting.left,
            front=sighting.front,
            heading=sighting.heading,
            speed=0.0,
            length=sighting.length,
            looks=1,
            seen=time,
            waited=0.0,
            source=sighting.source,
            covariance=np.diag([sighting.error**2, _FIRST_SPEED**2]),
        )


def _predict(track: Track, step: float) -> None:
    """Let a track drive on at its speed."""
    moved = track.speed * step
    track.front = track.front + np.append(track.heading * moved, 0.0)
    track.left -= moved
    on = np.array([[1.0, step], [0.0, 1.0]])
    shaken = np.array([step**2 / 2, step]) * _ACCELERATION
    track.covariance = on @ track.covariance @ on.T + np.outer(shaken, shaken)


def _match(tracks: Sequence[Track], sightings: Sequence[Sighting], step: float) -> list[tuple[int, int]]:
    """Pair tracks with sightings, the nearest first."""
    if not tracks or not sightings:
        return []
    cost = np.array([[_distance(track, each, step) for each in sightings] for track in tracks])
    pairs, rows, columns = [], set[int](), set[int]()
    for flat in np.argsort(cost, axis=None, kind="stable").tolist():
        row, column = divmod(flat, len(sightings))
        if cost[row, column] > _GATE:
            break
        if row not in rows and column not in columns:
            pairs.append((row, column))
            rows.add(row)
            columns.add(column)
    return pairs


def _distance(track: Track, sighting: Sighting, step: float) -> float:
    """Give the squared distance in standard deviations; infinite where no vehicle could have got there."""
    offset = sighting.front[:2] - track.front[:2]
    along = float(offset @ track.heading)
    across = float(offset @ np.array([-track.heading[1], track.heading[0]]))
    moved = along + track.speed * step
    error = np.sqrt(track.covariance[0, 0] + sighting.error**2)
    slack = _BACKWARDS + 2 * sighting.error
    if not -slack <= moved <= _FASTEST * step + slack or track.heading @ sighting.heading < 0:
        return np.inf
    return float((along / error) ** 2 + (across / _ACROSS) ** 2)


def _correct(track: Track, sighting: Sighting, time: float) -> None:
    """Move a track to where it has been seen, as far as that is sure."""
    offset = sighting.front[:2] - track.front[:2]
    innovation = float(offset @ track.heading)
    gain: NDArray[np.float64] = track.covariance[:, 0] / (track.covariance[0, 0] + sighting.error**2)
    track.covariance = track.covariance - np.outer(gain, track.covariance[0])
    back = (1.0 - gain[0]) * innovation
    track.speed = max(0.0, track.speed + float(gain[1]) * innovation)
    # Sideways it is where it has been seen; along the lane somewhere between.
    track.front = sighting.front - np.append(sighting.heading * back, 0.0)
    track.heading, track.lane, track.left = sighting.heading, sighting.lane, sighting.left + back
    track.kind, track.length, track.source = sighting.kind, sighting.length, sighting.source
    track.seen, track.looks = time, track.looks + 1


def _is_kept(track: Track, time: float) -> bool:
    patience = _STANDING_PATIENCE if track.is_halting else _MOVING_PATIENCE
    unseen = time - track.seen
    return unseen == 0 or (unseen <= patience and track.left > 0)
