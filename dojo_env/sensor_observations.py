"""Observations through sensors: asks the named sensors of each signal, and keeps intervals and delays."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any
from zlib import crc32

import numpy as np
from gymnasium import spaces

from dojo_env.camera import BEV, Camera
from dojo_env.errors import ConfigError
from dojo_env.instant import Instant, SignalView
from dojo_env.perceived import PerceivedInstant
from dojo_env.sensors import detector, events, lane_strips, lidar, video_detector  # noqa: F401 - each adds its kind
from dojo_env.sensors.base import Look, Sensor, SensorSettings, Site, mount_sensor
from dojo_env.sensors.eyes import Eyes
from dojo_env.sensors.picture import CameraSensor
from dojo_env.signals.plan import SignalPlan
from dojo_env.snapshot import Snapshot
from dojo_env.turn_guesses import TurnGuesses

_SOON = 1e-6
"""Seconds by which times may differ that are the same."""


class SensorObserver:
    """Asks sensors; what those of a signal need of cameras is drawn in one pass, each camera once."""

    def __init__(self, eyes: Eyes, sensors: Mapping[str, Mapping[str, Sensor]], *, bare: bool) -> None:
        """Take the sensors.

        Args:
            eyes: what draws.
            sensors: by signal, by name.
            bare: observe the only sensor itself instead of a dict.
        """
        self._eyes, self._bare = eyes, bare
        self._channels = {
            signal: tuple(_Channel(name, sensor) for name, sensor in named.items())
            for signal, named in sensors.items()
        }
        self._timed = [
            (signal, timed)
            for signal, channels in self._channels.items()
            if (timed := [channel for channel in channels if channel.sensor.interval > 0])
        ]
        self._views: dict[tuple[str, tuple[str, ...]], tuple[Sequence[Camera], Sequence[str]]] = {}

    def space(self, signal: str) -> spaces.Space[Any]:
        """Give the space of one signal's sensors.

        Args:
            signal: its id.

        Returns:
            The space of a bare sensor, or a dict of spaces by the sensors' names.
        """
        parts = {channel.name: channel.sensor.space for channel in self._channels[signal]}
        return next(iter(parts.values())) if self._bare else spaces.Dict(parts)

    def reset(self, seed: int) -> None:
        """Begin an episode: every name has a noise of its own, which its sensors at all signals share.

        Args:
            seed: of the episode.
        """
        self._turns = TurnGuesses()
        noises: dict[str, np.random.Generator] = {}
        for channels in self._channels.values():
            for channel in channels:
                name = channel.name
                if name not in noises:
                    own = seed if self._bare else [seed, crc32(name.encode())]
                    noises[name] = np.random.default_rng(own)
                channel.reset(noises[name])

    def is_due(self, time: float) -> bool:
        """Tell whether a sensor wants to look now, at a time between decisions.

        Args:
            time: simulated seconds.

        Returns:
            Whether one does.
        """
        return any(channel.is_due(time) for _, timed in self._timed for channel in timed)

    def look(self, snapshot: Snapshot) -> None:
        """Let the sensors look that want to, at a time between decisions.

        Args:
            snapshot: the present second.
        """
        for signal, timed in self._timed:
            self._look(signal, snapshot, [channel for channel in timed if channel.is_due(snapshot.time)])

    def observe(self, signal: str, instant: Instant) -> Any:
        """Let the sensors look that want to, and give what has arrived of all.

        Args:
            signal: its id.
            instant: the decision.

        Returns:
            What its space holds.
        """
        channels = self._channels[signal]
        due = [channel for channel in channels if channel.is_due(instant.time)]
        if due:
            self._look(signal, instant.snapshot, due)
        view = instant.signals[signal]
        seen = {channel.name: channel.deliver(instant.time, view) for channel in channels}
        return next(iter(seen.values())) if self._bare else seen

    def perceive(self, instant: Instant) -> Instant:
        """Give a decision as sensors have measured it, if every signal has such, or else as it is.

        Args:
            instant: the decision, as it is.

        Returns:
            The decision, as it was measured.
        """
        measured = {
            signal: found
            for signal, channels in self._channels.items()
            for channel in channels
            if (found := channel.sensor.perceive()) is not None
        }
        if len(measured) < len(self._channels):
            return instant
        return PerceivedInstant(instant, measured, self._turns.note(instant, measured))

    def _look(self, signal: str, snapshot: Snapshot, due: "Sequence[_Channel]") -> None:
        key = (signal, tuple(channel.name for channel in due))
        if key not in self._views:
            self._views[key] = _join_views(due)
        cameras, outputs = self._views[key]
        pictures = self._eyes.look(snapshot, cameras, outputs) if cameras else ()
        look = Look(snapshot=snapshot, pictures=dict(zip(cameras, pictures, strict=True)))
        for channel in due:
            channel.look(look)


class _Channel:
    """A sensor of one signal, and its looks on their way to the agent."""

    def __init__(self, name: str, sensor: Sensor) -> None:
        self.name, self.sensor = name, sensor
        self._next = -np.inf
        self._coming: deque[tuple[float, Any]] = deque()
        self._arrived: list[Any] = []

    def reset(self, random: np.random.Generator) -> None:
        self._next, self._arrived = -np.inf, []
        self._coming.clear()
        self.sensor.reset(random)

    def is_due(self, time: float) -> bool:
        return time >= self._next - _SOON

    def look(self, look: Look) -> None:
        time, interval = look.snapshot.time, self.sensor.interval
        self._coming.append((time + self.sensor.delay, self.sensor.observe(look)))
        # An interval that is no whole number of SUMO's steps holds in the mean.
        planned = self._next + interval
        self._next = planned if planned > time + _SOON else time + interval

    def deliver(self, time: float, view: SignalView) -> Any:
        self._next = max(self._next, time + self.sensor.idle)
        arrived = []
        while self._coming and self._coming[0][0] <= time + _SOON:
            arrived.append(self._coming.popleft()[1])
        if not arrived:
            arrived = self._arrived or [self._coming[0][1]]
        elif self.sensor.interval or self.sensor.delay:
            # Only then may a later decision have nothing new, so that this is given again.
            self._arrived = arrived
        return self.sensor.deliver(arrived, view)


def _join_views(channels: Sequence[_Channel]) -> tuple[Sequence[Camera], Sequence[str]]:
    """List the distinct cameras of some sensors, and all outputs that any of them needs."""
    views = [channel.sensor.views for channel in channels]
    outputs = {output for each in views for wanted in each.values() for output in wanted}
    return tuple(dict.fromkeys(camera for each in views for camera in each)), tuple(sorted(outputs))


def build_sensor_observer(
    wanted: str | Mapping[str, Any] | SensorSettings,
    eyes: Eyes,
    plans: Mapping[str, SignalPlan],
    *,
    interval: float,
) -> SensorObserver:
    """Build one of the observers that are known by name, that of one sensor, or of those that a user names.

    Args:
        wanted: `multi_view`, `bev`, `detector` or `lane-strips`, settings such as `EventCamera(...)`, or
            sensors by name: cameras and all that `sensors.base.mount_sensor` takes.
        eyes: what draws.
        plans: of the signals to observe.
        interval: seconds from decision to decision.

    Returns:
        The observer.

    Raises:
        ConfigError: no sensor is named, or one is nothing of the kind.
    """
    if isinstance(wanted, Mapping) and not wanted:
        raise ConfigError("observation={}: name at least one sensor")
    sensors = {}
    for signal, plan in plans.items():
        if isinstance(wanted, Mapping):
            named = dict(wanted)
        elif wanted == "multi_view":
            named = {camera.name: camera for camera in eyes.cameras(signal) if camera.name != BEV}
        else:
            named = {"observation": wanted}
        sensors[signal] = {
            str(name): mount_sensor(
                CameraSensor(camera=each) if isinstance(each, Camera) else each,
                Site(name=str(name), signal=signal, plan=plan, eyes=eyes, decision_interval=interval),
            )
            for name, each in named.items()
        }
    return SensorObserver(eyes, sensors, bare=not isinstance(wanted, Mapping) and wanted != "multi_view")
