"""The video detector: the features of lanes as a detector finds them in pictures of the approaches."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.camera import BEV, Camera
from dojo_env.detectors import NOTHING, Detections, DetectorModel, load_detector
from dojo_env.detectors.measuring import LaneMeasurements, LaneWatch, shift
from dojo_env.errors import ConfigError
from dojo_env.instant import SignalView
from dojo_env.perceived import read_lanes
from dojo_env.sensors.base import SENSORS, Look, Sensor, Site
from dojo_maps.short_repr import short_repr

TRUE_BOXES = "boxes"
"""In place of a model: the true boxes of what is well in view, the best that any detector could tell."""
PICTURE = (1280, 896)
"""Width and height that traffic cameras have and detectors need, pixels; agents' pictures are smaller."""
_LEAST_VISIBLE, _LEAST_HEIGHT = 0.25, 14
"""Visible share, and pixels of height, from which on the true boxes are told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoDetector:
    """The features, measured in pictures: detected, followed from look to look, found on the map.

    Its pictures are those of the cameras at the approaches, with the environment's conditions. Controllers
    that run in an environment which observes this act on what it measures. Mean speeds, queues and lengths
    come from tracks, so it looks more often than decisions are made.

    Attributes:
        model: a detector's file, as `load_detector` takes it, a `DetectorModel`, or `boxes`.
        interval: seconds from look to look; 0 looks at each decision, and then nobody is known to stand.
        latency: decisions by which what is measured is late; the signal knows its own phase at once.
    """

    model: str | Path | DetectorModel
    interval: float = 1.0
    latency: int = 0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: the model is nothing of the kind, or a number is below 0.
        """
        if not isinstance(self.model, str | Path | DetectorModel):
            raise ConfigError(f"video detector: model={self.model!r}; expected a file or a DetectorModel")
        if not (isfinite(self.interval) and min(self.interval, self.latency) >= 0):
            raise ConfigError(f"{self}: expected interval and latency not below 0")

    def mount(self, site: Site) -> Sensor:
        """Watch the lanes of a signal.

        Raises:
            ConfigError: the detector cannot be loaded.
        """
        return _MountedVideoDetector(self, site)


class _MountedVideoDetector(Sensor):
    """A look gives `LaneMeasurements` of the lanes that lead to the signal, and away from it."""

    def __init__(self, settings: VideoDetector, site: Site) -> None:
        plan = self._plan = site.plan
        self._model = _open_model(settings.model)
        self.space = spaces.Box(0.0, 1.0, (len(plan.phases) + 1 + 2 * len(plan.lanes),), np.float32)
        self.interval, self.delay = settings.interval, settings.latency * site.decision_interval
        self._cameras = tuple(each for each in site.eyes.cameras(site.signal) if each.name != BEV)
        lanes = tuple(dict.fromkeys((*plan.lanes, *plan.out_lanes)))
        self._watch = LaneWatch(self._cameras, site.eyes.scene.road_map, lanes)
        output = TRUE_BOXES if self._model is None else "rgb"
        self.views = dict.fromkeys(self._cameras, (output,))

        self._newest: LaneMeasurements

    def reset(self, random: np.random.Generator) -> None:
        self._watch.reset()

    def observe(self, look: Look) -> LaneMeasurements:
        found = [
            NOTHING if region is None else self._detect(look, camera, region)
            for camera, region in zip(self._cameras, self._watch.regions, strict=True)
        ]
        return self._watch.update(look.snapshot.time, found)

    def deliver(self, looks: Sequence[Any], view: SignalView) -> NDArray[np.float32]:
        """Put phase one-hot and minimum-green flag before what was measured."""
        self._newest = looks[-1]
        known = np.zeros(len(self._plan.phases) + 1)
        known[view.phase] = 1
        known[-1] = view.may_change
        return np.concatenate([known, read_lanes(looks[-1], self._plan).shares]).astype(np.float32)

    def perceive(self) -> LaneMeasurements:
        return self._newest

    def _detect(self, look: Look, camera: Camera, region: tuple[int, int, int, int]) -> Detections:
        picture = look.pictures[camera]
        if self._model is None:
            return list_true_boxes(picture.boxes)
        left, top, right, bottom = region
        return shift(self._model.detect(picture.rgb[top:bottom, left:right]), left, top)


def list_true_boxes(boxes: Any) -> Detections:
    """Give the boxes of what is well in view, as a perfect detector would.

    Args:
        boxes: the output `boxes` of a picture.

    Returns:
        Those that are large enough and little hidden, in their order; all scores are 1.
    """
    heights = boxes.picture[:, 3] - boxes.picture[:, 1]
    rows = np.flatnonzero((boxes.visible >= _LEAST_VISIBLE) & (heights >= _LEAST_HEIGHT))
    return Detections(
        boxes=boxes.picture[rows].astype(np.float64), scores=np.ones(len(rows)), kinds=boxes.kinds[rows]
    )


def _open_model(wanted: str | Path | DetectorModel) -> DetectorModel | None:
    if wanted == TRUE_BOXES:
        return None
    return load_detector(wanted) if isinstance(wanted, str | Path) else wanted


def _mount(text: str, site: Site) -> Sensor:
    if not text:
        raise ConfigError(f"sensor {site.name!r}: expected video-detector:FILE, or VideoDetector(...)")
    return VideoDetector(model=text).mount(site)


SENSORS["video-detector"] = _mount
