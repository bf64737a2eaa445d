"""The detector: the features of lanes as the cameras of the approaches measure them; no loop in the road."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, compress, pairwise
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.camera import BEV
from dojo_env.detectors.measuring import LaneMeasurements, WaitingSum
from dojo_env.errors import ConfigError
from dojo_env.instant import SignalView
from dojo_env.perceived import read_lanes
from dojo_env.reading import HALTING
from dojo_env.sensors.base import SENSORS, Look, Sensor, Site
from dojo_env.sensors.strip_geometry import measure_along
from dojo_env.signals.plan import REACH
from dojo_env.snapshot import Lights, Snapshot
from dojo_maps.index import MapIndex
from dojo_maps.short_repr import short_repr

_USUAL_LENGTH = 5.0
"""Metres, of vehicles that are not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Detector:
    """The features, measured through the cameras of the approaches; the default sees all that is in view.

    Attributes:
        least_pixels: visible pixels from which a vehicle is seen at all.
        least_visible: share of it that must not be hidden.
        missed: probability that a vehicle in view is not detected.
        false_alarms: mean number of vehicles per lane that are not there.
        interval: seconds from look to look; 0 looks at each decision.
        latency: decisions by which what is measured is late; the signal knows its own phase at once.
    """

    least_pixels: int = 12
    least_visible: float = 0.1
    missed: float = 0.0
    false_alarms: float = 0.0
    interval: float = 0.0
    latency: int = 0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a share lies outside 0 to 1, or a number is below 0.
        """
        shares = (self.least_visible, self.missed)
        if not all(0 <= share <= 1 for share in shares) or min(self.false_alarms, self.latency) < 0:
            raise ConfigError(
                f"{self}: expected least_visible and missed from 0 to 1, false_alarms and latency not below 0"
            )

    def mount(self, site: Site) -> Sensor:
        """Detect at a signal."""
        return _MountedDetector(self, site)


class _Detected(NamedTuple):
    """What a look has found: counts of each lane, and what tells places on those that lead to the signal."""

    measured: LaneMeasurements
    snapshot: Snapshot
    rows: list[list[int]]
    phantoms: list[int]
    still: list[int]


class _MountedDetector(Sensor):
    """A look gives what it has detected on the plan's lanes, and nothing on those away from the signal.

    Where on their lanes vehicles are is worked out for controllers that ask, as learners see counts alone.
    """

    def __init__(self, settings: Detector, site: Site) -> None:
        plan = self._plan = site.plan
        self._settings = settings
        self._random = self._phantoms = np.random.default_rng(0)
        self._waiting = WaitingSum(0)
        self._watched = tuple(dict.fromkeys((*plan.lanes, *plan.out_lanes)))
        self._lanes = {lane: k for k, lane in enumerate(plan.lanes)}
        known = MapIndex(site.eyes.scene.road_map).lanes
        self._lines = [known[lane].shape[::-1] for lane in plan.lanes]
        self._newest: _Detected
        self._perceived: tuple[_Detected, LaneMeasurements] | None = None
        self.space = spaces.Box(0.0, 1.0, (len(plan.phases) + 1 + 2 * len(plan.lanes),), np.float32)
        self.interval, self.delay = settings.interval, settings.latency * site.decision_interval
        cameras = site.eyes.cameras(site.signal)
        self.views = {camera: ("visible",) for camera in cameras if camera.name != BEV}

    def reset(self, random: np.random.Generator) -> None:
        self._random = random
        (self._phantoms,) = random.spawn(1)
        self._waiting = WaitingSum(len(self._watched))
        self._perceived = None

    def observe(self, look: Look) -> _Detected:
        snapshot, lanes = look.snapshot, self._plan.lanes
        # Plain lists first: each touch of an array's item costs as much as all else of a vehicle.
        counts, standing, lengths = ([0.0] * len(self._watched) for _ in range(3))
        stands, long = (snapshot.speeds < HALTING).tolist(), snapshot.sizes[:, 0].tolist()
        rows: list[list[int]] = [[] for _ in lanes]
        for row in sorted(self._detected(look)):
            k = self._lanes.get(snapshot.lanes[row])
            if k is not None:
                counts[k] += 1
                standing[k] += stands[row]
                lengths[k] += long[row]
                rows[k].append(row)
        count, halting, length = np.array(counts), np.array(standing), np.array(lengths)
        phantoms = self._random.poisson(self._settings.false_alarms, len(lanes))
        mean_length = np.divide(length, count, out=np.full(len(count), _USUAL_LENGTH), where=count > 0)
        still = self._random.binomial(phantoms, 0.5)
        halting[: len(lanes)] += still
        count[: len(lanes)] += phantoms
        waiting = self._waiting.add(snapshot.time, count, halting)
        ends = accumulate(map(int, count.tolist()), initial=0)
        measured = LaneMeasurements(
            time=snapshot.time,
            lanes=self._watched,
            vehicles=count,
            halting=halting,
            mean_speed=np.full(len(count), np.nan),
            mean_length=np.where(count > 0, mean_length, 0.0),
            waiting=waiting,
            tracks=tuple(tuple(range(first, last)) for first, last in pairwise(ends)),
        )
        return _Detected(measured, snapshot, rows, phantoms.tolist(), still.tolist())

    def deliver(self, looks: Sequence[Any], view: SignalView) -> NDArray[np.float32]:
        """Put phase one-hot and minimum-green flag before what was measured."""
        self._newest = looks[-1]
        known = np.zeros(len(self._plan.phases) + 1)
        known[view.phase] = 1
        known[-1] = view.may_change
        return np.concatenate([known, read_lanes(looks[-1].measured, self._plan).shares]).astype(np.float32)

    def perceive(self) -> LaneMeasurements:
        newest = self._newest
        if self._perceived is None or self._perceived[0] is not newest:
            lanes, lights = self._plan.lanes, newest.snapshot.lights
            shine = [(lights[rows] & Lights.BLUE).any() for rows in newest.rows]
            places = {lane: self._find_places(newest, k) for k, lane in enumerate(lanes)}
            self._perceived = (
                newest,
                replace(newest.measured, urgent=frozenset(compress(lanes, shine)), places=places),
            )
        return self._perceived[1]

    def _find_places(self, found: _Detected, lane: int) -> tuple[tuple[float, bool], ...]:
        """Tell how far from a lane's end each vehicle is, and whether it stands; phantoms are anywhere."""
        rows = found.rows[lane]
        far, _ = measure_along(self._lines[lane], found.snapshot.positions[rows])
        stands = (found.snapshot.speeds[rows] < HALTING).tolist()
        anywhere = self._phantoms.uniform(0.0, min(self._plan.lengths[lane], REACH), found.phantoms[lane])
        phantoms = ((metres, k < found.still[lane]) for k, metres in enumerate(anywhere.tolist()))
        return tuple(sorted([*zip(far.tolist(), stands, strict=True), *phantoms]))

    def _detected(self, look: Look) -> Iterator[int]:
        """List the snapshot's rows that some camera shows well enough, less those that are missed."""
        found: dict[int, None] = {}
        for camera in self.views:
            seen = look.pictures[camera].visible
            is_good = seen.pixels >= self._settings.least_pixels
            is_good &= seen.visible >= self._settings.least_visible
            found.update(dict.fromkeys(seen.rows[is_good].tolist()))
        kept = self._random.random(len(found)) >= self._settings.missed
        return compress(found, kept.tolist())


def _mount(text: str, site: Site) -> Sensor:
    if text:
        raise ConfigError(f"sensor {site.name!r}: 'detector:{text}', expected 'detector' or Detector(...)")
    return Detector().mount(site)


SENSORS["detector"] = _mount
