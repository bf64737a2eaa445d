"""Lane strips: each lane as the cameras show it, for learners; and what a network sees there.

Two looks a second apart tell who stands. Controllers that run in an environment which observes this act on
what the network tells.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.detectors.measuring import LaneMeasurements, WaitingSum
from dojo_env.errors import ConfigError
from dojo_env.instant import SignalView
from dojo_env.notes import say_once
from dojo_env.sensors.background import Background
from dojo_env.sensors.base import SENSORS, Look, Sensor, Site
from dojo_env.sensors.camera_watch import CameraWatch
from dojo_env.sensors.lane_network import PACKAGED, SEEN, find_chances, read_weights
from dojo_env.sensors.static_objects import StaticObjects
from dojo_env.sensors.strip_geometry import CELL, CELLS, COLUMNS, ROWS, build_strips, cut_strips
from dojo_env.sensors.unseen_queues import UnseenQueues
from dojo_env.signals.plan import ROOM_OF_A_VEHICLE

Floats = NDArray[np.float64]

_STANDING, _MOVING, _EMERGENCY = (SEEN.index(name) for name in ("standing", "moving", "emergency"))
_CAR = 5.0
"""Metres that vehicles are taken to be long."""
_SEEN = 1.0
"""Standing vehicles of a lane from which on its picture must change at green."""
_SURE = 0.5
"""The chance of an emergency vehicle, at this decision and at the last one, from which on it counts."""
_LEAST = 0.1
"""The chance of a vehicle in a cell below which there is none; many small ones are no vehicle."""
_NOTHING = 1e-9
"""A chance that counts for nothing."""
_USUAL, _SELDOM, _DISCHARGE, _LONGEST = 0.08, 0.02, 0.5, 12.0
"""Vehicles a second that come where a camera fails, and where none looks, as to short lanes amid a junction;
those that leave at green; and how many stand at the most."""
_AT_THE_LINE = 2
"""A lane is seen if one of its first so many cells is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneStrips:
    """Strips of the lanes that lead to the signal, and of those away from it.

    Attributes:
        network: a file of weights that `dojo-env train --vision` has kept, for controllers.
        interval: seconds from the last look but one before a decision to the last.
        latency: decisions by which what is seen is late; the signal knows its own phase at once.
    """

    network: Path = PACKAGED
    interval: float = 1.0
    latency: int = 0

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a number is below 0.
        """
        if not (isfinite(self.interval) and min(self.interval, self.latency) >= 0):
            raise ConfigError(f"{self}: expected interval and latency not below 0")

    def mount(self, site: Site) -> Sensor:
        """Watch the lanes of a signal."""
        return _MountedStrips(self, site)


class _MountedStrips(Sensor):
    """A look gives its time and (strips, rows, columns, 3) colours; the agent gets those of two looks."""

    def __init__(self, settings: LaneStrips, site: Site) -> None:
        self._settings, self._plan = settings, site.plan
        cameras = site.eyes.cameras(site.signal)
        self._strips = build_strips(site.eyes.scene, site.plan, cameras)
        self.space = spaces.Box(0, 255, (len(self._strips), ROWS, COLUMNS, 6), np.uint8)
        self.interval, self.delay = settings.interval, settings.latency * site.decision_interval
        self.idle = max(0.0, site.decision_interval - settings.interval)
        used = {strip.camera for strip in self._strips}
        self.views = {camera: ("rgb",) for camera in cameras if camera in used}
        self._geometry = np.stack([strip.geometry for strip in self._strips])
        self._shares = np.stack([strip.shares for strip in self._strips])[:, :, None]
        self._links = [
            [] if strip.is_outgoing else site.plan.list_links(strip.lane) for strip in self._strips
        ]
        rows = {strip.lane: row for row, strip in enumerate(self._strips)}
        self._exits = [
            [[rows[lane] for lane in site.plan.exits[link]] for link in links] for links in self._links
        ]
        self._signal = site.signal

    @cached_property
    def _weights(self) -> dict[str, NDArray[np.float32]]:
        return read_weights(self._settings.network)

    def reset(self, random: np.random.Generator) -> None:
        self._looks: list[tuple[float, NDArray[np.uint8]]] = []
        self._measured: LaneMeasurements | None = None
        self._sums = np.zeros((len(self._strips), len(SEEN)))
        self._shining = np.zeros(len(self._strips))
        self._waiting = WaitingSum(len(self._strips))
        self._watches = {camera: CameraWatch() for camera in self.views}
        self._green = self._must_go = np.zeros(len(self._strips), bool)
        self._objects = StaticObjects(len(self._strips), CELLS)
        self._background = Background()
        self._unseen = UnseenQueues(self._strips)

    def observe(self, look: Look) -> tuple[float, NDArray[np.uint8]]:
        time, pictures = look.snapshot.time, {camera: look.pictures[camera].rgb for camera in self.views}
        state = look.snapshot.signals[self._signal]
        letters = [{state[link] for link in links} for links in self._links]
        self._green = np.array([not each.isdisjoint("Gg") for each in letters])
        # Who yields, or has a queue behind the junction, may stand at green, too.
        stands = self._sums[:, _STANDING] > _SEEN
        self._must_go = np.array([
            each == {"G"} and all(not stands[lanes].all() for lanes in exits)
            for each, exits in zip(letters, self._exits, strict=True)
        ])  # fmt: skip
        shown = self._must_go & stands
        for camera, watch in self._watches.items():
            must_move = any(shown[row] for row, strip in enumerate(self._strips) if strip.camera is camera)
            if watch.note(time, pictures[camera], must_move=must_move):
                say_once(_tell(self._signal, camera.name, watch))
        return time, cut_strips(self._strips, pictures)

    def deliver(self, looks: Sequence[Any], view: SignalView) -> NDArray[np.uint8]:
        """Put the last look and the one before it together."""
        self._looks = [*self._looks[-1:], *looks][-2:]
        return np.concatenate([self._looks[-1][1], self._looks[0][1]], axis=3)

    def perceive(self) -> LaneMeasurements:
        (time, now), (_, before) = self._looks[-1], self._looks[0]
        if self._measured is None or self._measured.time < time:
            fails = np.array([
                strip.camera is not None and bool(self._watches[strip.camera].fault) for strip in self._strips
            ])  # fmt: skip
            strips = np.concatenate([now, before, self._background.add(time, now, fails)], axis=3)
            chances = find_chances(self._weights, strips, self._geometry)
            standing = chances[:, :, _STANDING]
            chances[:, :, _STANDING] = self._objects.leave_out(time, standing, self._green, self._must_go)
            chances[chances < _LEAST] = 0.0
            cells = chances * self._shares
            cells[:, :, _STANDING] += self._unseen.add(time, cells[:, :, _STANDING], self._green)
            self._bridge(time, cells, fails)
            self._sums = cells.sum(axis=1)
            shining, last = cells[:, :, _EMERGENCY].max(axis=1), self._shining
            self._shining = shining
            self._measured = self._measure(time, cells, np.minimum(shining, last) > _SURE)
        return self._measured

    def _bridge(self, time: float, cells: Floats, fails: NDArray[np.bool_]) -> None:
        """Put a usual queue in the place of what no camera shows, or one that fails."""
        passed = 0.0 if self._measured is None else time - self._measured.time
        for row, (strip, length) in enumerate(zip(self._strips, self._plan.lengths, strict=False)):
            if fails[row] or not strip.shares[:_AT_THE_LINE].any():
                comes, most = (_USUAL, _LONGEST) if fails[row] else (_SELDOM, length // ROOM_OF_A_VEHICLE)
                rate = comes - (_DISCHARGE if self._green[row] else 0.0)
                queue = np.clip(self._sums[row, _STANDING] + rate * passed, 0.0, min(most, _LONGEST))
                taken = max(1, ceil(queue * ROOM_OF_A_VEHICLE / CELL))
                cells[row] = 0.0
                cells[row, :taken, _STANDING] = queue / taken

    def _measure(self, time: float, cells: Floats, is_urgent: NDArray[np.bool_]) -> LaneMeasurements:
        standing, moving = self._sums[:, _STANDING], self._sums[:, _MOVING]
        halting = np.rint(standing)
        vehicles = np.maximum(halting, np.rint(standing + moving))
        numbers = np.split(np.arange(int(vehicles.sum())), np.cumsum(vehicles.astype(int))[:-1])
        return LaneMeasurements(
            time=time,
            lanes=tuple(strip.lane for strip in self._strips),
            vehicles=vehicles,
            halting=halting,
            mean_speed=np.full(len(cells), np.nan),
            mean_length=np.where(vehicles > 0, _CAR, 0.0),
            waiting=self._waiting.add(time, vehicles, halting),
            tracks=tuple(tuple(each.tolist()) for each in numbers),
            urgent=frozenset(
                strip.lane
                for strip, urgent in zip(self._strips, is_urgent, strict=True)
                if urgent and not strip.is_outgoing
            ),
            places={
                strip.lane: _find_places(*each)
                for strip, *each in zip(self._strips, cells, halting, vehicles - halting, strict=True)
                if not strip.is_outgoing
            },
        )


def _find_places(cells: Floats, halting: float, moving: float) -> tuple[tuple[float, bool], ...]:
    """Spread so many vehicles over a lane as the chances of its cells are spread."""
    found: list[tuple[float, bool]] = []
    for column, count in ((_STANDING, int(halting)), (_MOVING, int(moving))):
        if not count:
            continue
        # Where nothing is seen the sum must rise, too, to be searched.
        below = np.append(0.0, np.cumsum(cells[:, column] + _NOTHING))
        shares = (np.arange(count) + 0.5) / count
        metres = np.interp(shares * below[-1], below, np.arange(len(below)) * CELL)
        found += [(far, column == _STANDING) for far in metres.tolist()]
    return tuple(sorted(found))


def _tell(signal: str, camera: str, watch: CameraWatch) -> str:
    """Say that a camera fails, or that it is back."""
    if watch.fault:
        return (
            f"signal {signal}: camera {camera} {watch.fault}, at {watch.since:g} s; "
            "until it is back its lanes count as filling as usual, so they get their turn"
        )
    return f"signal {signal}: camera {camera} is back, at {watch.since:g} s"


def _mount(text: str, site: Site) -> Sensor:
    return (LaneStrips(network=Path(text)) if text else LaneStrips()).mount(site)


SENSORS["lane-strips"] = _mount
