"""What is known of one picture and of the road users in it: the records that every format writes from."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from math import asin
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.conditions import Conditions
from dojo_env.imaging import Imaging
from dojo_env.snapshot import Kind, Lights

Box = tuple[float, float, float, float]
"""Left, top, right, bottom, pixels; right and bottom are exclusive."""


class Category(StrEnum):
    """Classes of road users, by COCO's names."""

    PERSON = "person"
    BICYCLE = "bicycle"
    CAR = "car"
    MOTORCYCLE = "motorcycle"
    BUS = "bus"
    TRAIN = "train"
    TRUCK = "truck"
    BOAT = "boat"


COCO_IDS: Mapping[Category, int] = MappingProxyType(
    {
        Category.PERSON: 1, Category.BICYCLE: 2, Category.CAR: 3, Category.MOTORCYCLE: 4,
        Category.BUS: 6, Category.TRAIN: 7, Category.TRUCK: 8, Category.BOAT: 9,
    }
)  # fmt: skip
"""COCO's own numbers."""
_CATEGORIES = {
    Kind.BUS: Category.BUS, Kind.COACH: Category.BUS, Kind.TRUCK: Category.TRUCK,
    Kind.TRAILER: Category.TRUCK, Kind.FIRE_ENGINE: Category.TRUCK, Kind.TRAM: Category.TRAIN,
    Kind.TRAIN: Category.TRAIN, Kind.MOTORCYCLE: Category.MOTORCYCLE, Kind.SCOOTER: Category.MOTORCYCLE,
    Kind.BICYCLE: Category.BICYCLE, Kind.PEDESTRIAN: Category.PERSON, Kind.SHIP: Category.BOAT,
    Kind.ARTICULATED_BUS: Category.BUS, Kind.ROAD_TRAIN: Category.TRUCK, Kind.MOPED: Category.MOTORCYCLE,
}  # fmt: skip
"""All other kinds are cars."""

KEYPOINTS = (
    *("nose_right_bottom", "nose_right_top", "nose_left_bottom", "nose_left_top"),
    *("tail_right_bottom", "tail_right_top", "tail_left_bottom", "tail_left_top"),
    *("wheel_front_left", "wheel_front_right", "wheel_rear_left", "wheel_rear_right"),
    *("headlamp_left", "headlamp_right", "rear_lamp_left", "rear_lamp_right"),
)
"""Keypoints of a vehicle: the corners of its box, its outermost wheels' outer centres, its lamps' middles."""
SKELETON = (
    *((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)),
    *((8, 10), (9, 11), (8, 9), (10, 11), (12, 13), (14, 15)),
)
"""Pairs of keypoints that are joined when they are drawn, by their places in `KEYPOINTS`."""
HIDDEN, SHOWN = 1, 2
"""What COCO says of a keypoint in the picture: behind something, or seen. 0 is outside, or there is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalLink:
    """The link of a signal that a road user comes to, or crosses the junction on.

    Attributes:
        signal: its id.
        link: index into the signal's letters.
        state: SUMO's letter.
        distance: metres to the stop line; 0 on the junction.
    """

    signal: str
    link: int
    state: str
    distance: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObjectLabel:
    """One road user in a picture.

    Attributes:
        track: number of the road user, the same in all pictures of an episode.
        id: SUMO's; of a parked car the map's.
        kind: what it is.
        box: of its visible pixels.
        whole_box: of its box in space, as far as that is before the camera; not cut by the border.
        pixels: visible ones.
        visible: share of the pixels that would show if nothing stood in front.
        truncated: share of `whole_box` outside of the picture.
        mask: `counts` of COCO's compressed run lengths.
        keypoints: (16, 3) x, y in pixels, and 0, `HIDDEN` or `SHOWN`; see `KEYPOINTS`. None of people.
        corners: (8, 3) of its box in space, in the order of `KEYPOINTS`, metres, map frame.
        size: length, width, height, metres.
        heading: radians, counter-clockwise from east.
        speed: m/s.
        lane: id of its lane; "" where it is on none.
        movement: where it goes at the next junction: `straight`, `left` and so on; "" where unknown.
        link: the signal's link that it comes to; None where there is none.
        lights: the lights that are lit.
        is_ignored: too little of it shows to be asked for, by the thresholds of the data set.
    """

    track: int
    id: str
    kind: Kind
    box: tuple[int, int, int, int]
    whole_box: Box
    pixels: int
    visible: float
    truncated: float
    mask: str
    keypoints: NDArray[np.float64] | None
    corners: NDArray[np.float64]
    size: tuple[float, float, float]
    heading: float
    speed: float
    lane: str
    movement: str
    link: SignalLink | None
    lights: Lights
    is_ignored: bool

    @property
    def category(self) -> Category:
        """Its class."""
        return _CATEGORIES.get(self.kind, Category.CAR)

    @property
    def is_parked(self) -> bool:
        """Whether it is a parked car of the map, which SUMO does not know."""
        return bool(self.lights & Lights.OFF)

    @property
    def occlusion(self) -> int:
        """KITTI's level: 0 fully visible, 1 partly hidden, 2 more than half hidden; never 3, unknown."""
        return sum(self.visible < limit for limit in (0.9, 0.5))

    def cut_box(self, camera: Camera) -> Box:
        """Give the box of all of it that lies in the picture, hidden or not: cut at the border.

        Args:
            camera: that took the picture.

        Returns:
            Left, top, right, bottom, pixels; it holds `box`, too.
        """
        left, top, right, bottom = self.whole_box
        return (
            min(max(left, 0.0), self.box[0]),
            min(max(top, 0.0), self.box[1]),
            max(min(right, camera.width), self.box[2]),
            max(min(bottom, camera.height), self.box[3]),
        )

    def describe(self) -> dict[str, Any]:
        """Give everything as JSON takes it."""
        low = 0.5 * (self.corners[0] + self.corners[6])
        high = 0.5 * (self.corners[1] + self.corners[7])
        return {
            "track": self.track,
            "id": self.id,
            "category": self.category.value,
            "kind": self.kind.name.lower(),
            "parked": self.is_parked,
            "box": self.box,
            "whole_box": _rounded(self.whole_box, 2),
            "pixels": self.pixels,
            "visible": round(self.visible, 4),
            "occlusion": self.occlusion,
            "truncated": round(self.truncated, 4),
            "ignored": self.is_ignored,
            "box_3d": {
                "centre": _rounded(0.5 * (low + high), 3),
                "size": _rounded(self.size, 3),
                "heading": round(self.heading, 5),
                "slope": round(_slope(self.corners), 5),
            },
            "keypoints": None if self.keypoints is None else _rounded(self.keypoints, 2),
            "mask": self.mask,
            "speed": round(self.speed, 3),
            "lane": self.lane,
            "movement": self.movement,
            "signal": None if self.link is None else _flat(self.link),
            "lights": [light.name.lower() for light in Lights(self.lights & ~Lights.OFF) if light.name],
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PictureLabels:
    """One picture of a data set.

    Attributes:
        number: from 1, unique in the data set.
        file: the picture, from the data set's folder on.
        depth: the file of its depths; "" where there is none.
        split: `train`, `val` or `test`.
        scenario: its name.
        episode: number of the simulated hour that it comes from; pictures of one are never divided.
        sequence: name of the camera's pictures of an episode.
        frame: place in the sequence, from 1.
        seed: SUMO's, of the episode.
        controller: who set the signals.
        time: simulated seconds.
        camera: as it hung, shaken mount and all.
        conditions: light, weather and lens.
        imaging: how the camera works.
        signals: the letters that each signal shows, by its id.
        is_empty: all road users were taken out of it.
        objects: the road users in it.
    """

    number: int
    file: str
    depth: str
    split: str
    scenario: str
    episode: int
    sequence: str
    frame: int
    seed: int
    controller: str
    time: float
    camera: Camera
    conditions: Conditions
    imaging: Imaging
    signals: Mapping[str, str]
    is_empty: bool
    objects: tuple[ObjectLabel, ...]

    def describe(self) -> dict[str, Any]:
        """Give everything as JSON takes it; a point X of the map falls on the pixel K (R X + t)."""
        camera = self.camera
        return {
            "id": self.number,
            "file": self.file,
            "depth": self.depth or None,
            "split": self.split,
            "scenario": self.scenario,
            "episode": self.episode,
            "sequence": self.sequence,
            "frame": self.frame,
            "seed": self.seed,
            "controller": self.controller,
            "time": self.time,
            "width": camera.width,
            "height": camera.height,
            "camera": {
                **_flat(camera),
                "K": _rounded(camera.intrinsics, 9),
                "R": _rounded(camera.axes, 9),
                "t": _rounded(-camera.axes @ camera.position, 9),
            },
            "conditions": _flat(self.conditions),
            "imaging": _flat(self.imaging),
            "signals": dict(self.signals),
            "empty": self.is_empty,
            "objects": [each.describe() for each in self.objects],
        }


def _flat(record: Any) -> dict[str, Any]:
    """Give the fields of a record of plain values: `asdict` copies each, which takes longer than all else."""
    return {each.name: getattr(record, each.name) for each in fields(record)}


def _slope(corners: NDArray[np.float64]) -> float:
    ahead = corners[0] - corners[4]
    return asin(float(ahead[2] / max(np.linalg.norm(ahead), 1e-9)))


def _rounded(values: Any, digits: int) -> Any:
    """Round numbers of an array of any shape; gives plain lists of them."""
    return np.round(values, digits).tolist()
