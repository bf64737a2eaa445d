"""Observations through sensors: pictures, range images, and the features as cameras measure them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.errors import ConfigError
from dojo_env.eyes import Eyes
from dojo_env.instant import Instant
from dojo_env.reading import HALTING, MIN_GAP
from dojo_env.rendering.classes import Semantic
from dojo_env.sensors.camera import BEV, Camera
from dojo_env.sensors.lidar import Lidar
from dojo_env.signals.plan import SignalPlan

_LARGEST_NUMBER = np.iinfo(np.int32).max


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """One named part of an observation.

    Attributes:
        camera: a camera, or the name of one that is placed from the map, such as `bev` or `approach_0`.
        output: `rgb`, `depth`, `semantic` or `instance`.
    """

    camera: Camera | str = BEV
    output: str = "rgb"


class SensorObserver:
    """Named pictures and range images of every signal, all drawn in one pass."""

    def __init__(self, eyes: Eyes, sensors: Mapping[str, Mapping[str, Any]], *, bare: bool) -> None:
        """Take what to show.

        Args:
            eyes: what draws.
            sensors: by signal, by name.
            bare: observe the only sensor itself instead of a dict.
        """
        self._eyes, self._bare = eyes, bare
        self._sensors = {signal: dict(named) for signal, named in sensors.items()}
        self._cameras = {
            signal: {
                name: self._find(signal, each) for name, each in named.items() if isinstance(each, Sensor)
            }
            for signal, named in self._sensors.items()
        }
        self._looks = {signal: self._plan_look(signal) for signal in self._sensors}

    def _plan_look(self, signal: str) -> tuple[tuple[Camera, ...], tuple[str, ...], dict[str, int]]:
        """List the distinct cameras, their outputs, and which camera each sensor has."""
        cameras = self._cameras[signal]
        outputs = {each.output for each in self._sensors[signal].values() if isinstance(each, Sensor)}
        distinct = tuple(dict.fromkeys(cameras.values()))
        places = {name: distinct.index(camera) for name, camera in cameras.items()}
        return distinct, tuple(sorted(outputs)), places

    def _find(self, signal: str, sensor: Sensor) -> Camera:
        if isinstance(sensor.camera, Camera):
            return sensor.camera
        known = {camera.name: camera for camera in self._eyes.cameras(signal)}
        if sensor.camera not in known:
            raise ConfigError(f"signal {signal!r}: no camera {sensor.camera!r}; it has {', '.join(known)}")
        return known[sensor.camera]

    def space(self, signal: str) -> spaces.Space[Any]:
        """Give the space of one signal's sensors."""
        parts: dict[str, spaces.Space[Any]] = {
            name: self._part(signal, name) for name in self._sensors[signal]
        }
        return next(iter(parts.values())) if self._bare else spaces.Dict(parts)

    def _part(self, signal: str, name: str) -> spaces.Box:
        sensor = self._sensors[signal][name]
        if isinstance(sensor, Lidar):
            return spaces.Box(0.0, sensor.reach, (sensor.channels, sensor.columns), np.float32)
        camera = self._cameras[signal][name]
        size = (camera.height, camera.width)
        if sensor.output == "rgb":
            return spaces.Box(0, 255, (*size, 3), np.uint8)
        if sensor.output == "depth":
            return spaces.Box(0.0, camera.far, size, np.float32)
        if sensor.output == "semantic":
            return spaces.Box(0, int(max(Semantic)), size, np.uint8)
        if sensor.output == "instance":
            return spaces.Box(0, _LARGEST_NUMBER, size, np.int32)
        raise ConfigError(f"sensor {name!r}: no output {sensor.output!r}; rgb, depth, semantic or instance")

    def reset(self, seed: int) -> None:
        """Nothing is kept between decisions."""

    def observe(self, signal: str, instant: Instant) -> Any:
        """Look and scan."""
        distinct, outputs, places = self._looks[signal]
        pictures = self._eyes.look(instant.snapshot, distinct, outputs)
        seen: dict[str, NDArray[Any]] = {}
        for name, sensor in self._sensors[signal].items():
            if isinstance(sensor, Lidar):
                (scan,) = self._eyes.scan(instant.snapshot, [sensor])
                seen[name] = np.minimum(scan.ranges, np.float32(sensor.reach))
            else:
                seen[name] = getattr(pictures[places[name]], sensor.output)
        return next(iter(seen.values())) if self._bare else seen


def build_sensor_observer(
    wanted: str | Mapping[str, Any], eyes: Eyes, plans: Mapping[str, SignalPlan]
) -> "SensorObserver | DetectorObserver":
    """Build the observer `bev`, `multi_view` or `detector`, or one of the sensors that a user names.

    A dict's values are cameras, lidars, `Sensor`s, or names as `bev`, `approach_0:depth`, and `lidar`, which
    hangs where the first camera does.

    Raises:
        ConfigError: no sensor is named, or one is nothing of the kind.
    """
    if wanted == "detector":
        return DetectorObserver(eyes, plans, Detector())
    if wanted == "bev":
        return SensorObserver(eyes, {signal: {BEV: Sensor()} for signal in plans}, bare=True)
    if wanted == "multi_view":
        views = {signal: [c for c in eyes.cameras(signal) if c.name != BEV] for signal in plans}
        named = {signal: {c.name: Sensor(camera=c) for c in cameras} for signal, cameras in views.items()}
        return SensorObserver(eyes, named, bare=False)
    if not isinstance(wanted, Mapping) or not wanted:
        raise ConfigError("observation={}: name at least one sensor")
    sensors = {
        signal: {str(name): _read_sensor(str(name), each, eyes, signal) for name, each in wanted.items()}
        for signal in plans
    }
    return SensorObserver(eyes, sensors, bare=False)


def _read_sensor(name: str, wanted: Any, eyes: Eyes, signal: str) -> Sensor | Lidar:
    if isinstance(wanted, Sensor | Lidar):
        return wanted
    if isinstance(wanted, Camera):
        return Sensor(camera=wanted)
    if wanted == "lidar":
        return Lidar(name=name, position=eyes.cameras(signal)[0].position)
    if isinstance(wanted, str):
        camera, _, output = wanted.partition(":")
        return Sensor(camera=camera, output=output or "rgb")
    raise ConfigError(f"sensor {name!r}: expected a Camera, Lidar, Sensor or a name; got {wanted!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Detector:
    """The features, measured through the cameras of the approaches; the default sees all that is in view.

    Attributes:
        least_pixels: visible pixels from which a vehicle is seen at all.
        least_visible: share of it that must not be hidden.
        missed: probability that a vehicle in view is not detected.
        false_alarms: mean number of vehicles per lane that are not there.
        latency: decisions by which what is measured is late.
    """

    least_pixels: int = 12
    least_visible: float = 0.1
    missed: float = 0.0
    false_alarms: float = 0.0
    latency: int = 0

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        shares = (self.least_visible, self.missed)
        if not all(0 <= share <= 1 for share in shares) or min(self.false_alarms, self.latency) < 0:
            raise ConfigError(f"{self}: shares lie from 0 to 1, false_alarms and latency are not below 0")

    def __call__(self, eyes: Eyes, plans: Mapping[str, SignalPlan]) -> "DetectorObserver":
        """Build the observer."""
        return DetectorObserver(eyes, plans, self)


class DetectorObserver:
    """Phase one-hot, minimum-green flag, lane densities and queues of the vehicles that cameras see."""

    def __init__(self, eyes: Eyes, plans: Mapping[str, SignalPlan], detector: Detector) -> None:
        """Take the detector."""
        self._eyes, self._plans, self._detector = eyes, plans, detector
        self._random = np.random.default_rng(0)
        self._late: dict[str, list[NDArray[np.float32]]] = {}

    def space(self, signal: str) -> spaces.Box:
        """As `features`."""
        plan = self._plans[signal]
        return spaces.Box(0.0, 1.0, (len(plan.phases) + 1 + 2 * len(plan.lanes),), np.float32)

    def reset(self, seed: int) -> None:
        """Begin an episode with nothing seen yet."""
        self._random = np.random.default_rng(seed)
        self._late = {signal: [] for signal in self._plans}

    def observe(self, signal: str, instant: Instant) -> NDArray[np.float32]:
        """Measure the lanes through the cameras; the signal knows its own phase without."""
        view = instant.signals[signal]
        late = self._late.setdefault(signal, [])
        late.append(self._measure(signal, instant))
        measured = late[0]
        del late[: len(late) - self._detector.latency]
        seen = np.zeros(len(view.plan.phases) + 1, dtype=np.float32)
        seen[view.phase] = 1
        seen[-1] = view.may_change
        return np.concatenate([seen, measured])

    def _measure(self, signal: str, instant: Instant) -> NDArray[np.float32]:
        snapshot, lanes = instant.snapshot, self._plans[signal].lanes
        detected = self._detected(signal, instant)
        index = {lane: k for k, lane in enumerate(lanes)}
        count, halting, length = (np.zeros(len(lanes)) for _ in range(3))
        for row, name in enumerate(snapshot.ids):
            k = index.get(snapshot.lanes[row])
            if name in detected and k is not None:
                count[k] += 1
                halting[k] += snapshot.speeds[row] < HALTING
                length[k] += snapshot.sizes[row, 0]
        phantoms = self._random.poisson(self._detector.false_alarms, len(lanes))
        halting += self._random.binomial(phantoms, 0.5)
        mean_length = np.divide(length, count, out=np.full(len(lanes), 5.0), where=count > 0)
        room = (MIN_GAP + mean_length) / self._plans[signal].lengths
        shares = np.minimum(1.0, np.concatenate([(count + phantoms) * room, halting * room]))
        return shares.astype(np.float32)

    def _detected(self, signal: str, instant: Instant) -> set[str]:
        """Ids of the vehicles that some approach's camera shows well enough, less those that are missed."""
        cameras = [camera for camera in self._eyes.cameras(signal) if camera.name != BEV]
        found: dict[str, None] = {}
        for picture in self._eyes.look(instant.snapshot, cameras, ("boxes",)):
            boxes = picture.boxes
            if boxes is None:
                continue
            good = (boxes.pixels >= self._detector.least_pixels) & (
                boxes.visible >= self._detector.least_visible
            )
            found.update(dict.fromkeys(name for name, ok in zip(boxes.ids, good, strict=True) if ok))
        kept = self._random.random(len(found)) >= self._detector.missed
        return {name for name, ok in zip(found, kept, strict=True) if ok}
