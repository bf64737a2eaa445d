"""Labels of a picture: what the renderer knows of it, what SUMO knew of the road users in it, and the map."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.datasets.keypoints import model_points, see_points
from dojo_env.datasets.labels import Box, ObjectLabel, SignalLink
from dojo_env.rendering.boxes import Boxes
from dojo_env.rendering.masks import encode_masks
from dojo_env.rendering.outputs import Picture
from dojo_env.rendering.traffic import place_users
from dojo_env.snapshot import Kind, Lights, Snapshot
from dojo_maps.description import RoadMap
from dojo_maps.index import MapIndex

Floats = NDArray[np.float64]
NextLink = tuple[str, int, float] | None
"""A signal, the index of its link, and metres to the stop line."""

OUTPUTS = ("rgb", "depth", "instance", "boxes")
"""What the renderer must draw for labels."""
_WORDS = {
    "s": "straight", "t": "turn", "l": "left", "r": "right", "L": "slight left", "R": "slight right",
}  # fmt: skip
"""SUMO's letters for directions."""
_EDGES = np.array([(a, b) for a in range(8) for b in range(a) if (a ^ b) in (1, 2, 4)])
"""Pairs of a box's corners that an edge joins."""
_FARTHEST = 1e5
"""Pixels beyond which nobody asks where a box ends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """From when on a road user is asked for.

    Attributes:
        least_pixels: visible pixels.
        least_visible: visible share.
    """

    least_pixels: int = 40
    least_visible: float = 0.1

    def hides(self, pixels: int, visible: float) -> bool:
        """Tell whether too little of a road user shows."""
        return pixels < self.least_pixels or visible < self.least_visible


class Instant:
    """The road users of an instant, ready for the labels of any camera's picture."""

    def __init__(
        self, snapshot: Snapshot, links: Mapping[str, NextLink], ways: "Ways", origin: Floats
    ) -> None:
        """Take an instant.

        Args:
            snapshot: everyone on the road.
            links: the signal's link that each vehicle comes to, by SUMO's id.
            ways: of the map.
            origin: (3,) of the scene, metres, map frame.
        """
        self._snapshot, self._links, self._ways = snapshot, links, ways
        users = place_users(snapshot, origin)
        self._rows = {int(number): k for k, number in enumerate(snapshot.numbers)}
        self._points = (
            np.einsum("kij,kcj->kci", users.frames, model_points()[users.models])
            + (users.places + origin)[:, None]
        )

    def label(self, picture: Picture, tracks: "Tracks", thresholds: Thresholds) -> tuple[ObjectLabel, ...]:
        """Label every road user of which a pixel shows.

        Args:
            picture: of this instant, with all of `OUTPUTS`.
            tracks: numbers road users.
            thresholds: who is asked for.
        """
        boxes: Boxes = picture.boxes
        camera = picture.camera
        rows = [self._rows[int(number)] for number in boxes.numbers]
        masks = encode_masks(picture.instance, boxes.numbers, boxes.picture)
        points = np.concatenate([boxes.corners, self._points[rows]], axis=1)
        seen = see_points(points.reshape(-1, 3), camera, picture.depth).reshape(-1, 16, 3)
        return tuple(
            self._label(row, boxes, k, masks[k], seen[k], camera, tracks, thresholds)
            for k, row in enumerate(rows)
        )

    def _label(  # noqa: PLR0917 - all that is known of one road user
        self, row: int, boxes: Boxes, k: int, mask: str, seen: Floats, camera: Camera, tracks: "Tracks",
        thresholds: Thresholds,
    ) -> ObjectLabel:  # fmt: skip
        snapshot = self._snapshot
        kind, pixels, visible = Kind(boxes.kinds[k]), int(boxes.pixels[k]), float(boxes.visible[k])
        whole = find_whole_box(boxes.corners[k], boxes.projected[k], camera)
        length, width, height = map(float, snapshot.sizes[row])
        left, top, right, bottom = map(int, boxes.picture[k])
        return ObjectLabel(
            track=tracks.number(int(boxes.numbers[k])),
            id=boxes.ids[k],
            kind=kind,
            box=(left, top, right, bottom),
            whole_box=whole,
            pixels=pixels,
            visible=visible,
            truncated=_share_outside(whole, camera),
            mask=mask,
            keypoints=None if kind is Kind.PEDESTRIAN else seen,
            corners=boxes.corners[k],
            size=(length, width, height),
            heading=float(snapshot.headings[row]),
            speed=float(snapshot.speeds[row]),
            lane=snapshot.lanes[row],
            lights=Lights(int(snapshot.lights[row])),
            is_ignored=thresholds.hides(pixels, visible),
            **self._ways.follow(snapshot, snapshot.lanes[row], self._links.get(boxes.ids[k])),
        )


class Tracks:
    """Numbers the road users of one episode in the order in which they are first seen."""

    def __init__(self) -> None:
        """Begin with nobody."""
        self._known: dict[tuple[int, int], int] = {}
        self.run = 0
        """Which of the episode's simulations it is; each has its own road users."""

    def number(self, number: int) -> int:
        """Give a road user's track, from its number in the snapshot."""
        return self._known.setdefault((self.run, number), len(self._known) + 1)


class Ways:
    """Where the lanes of a map lead."""

    def __init__(self, road_map: RoadMap) -> None:
        """Index a map."""
        index = MapIndex(road_map)
        self._leaving = index.leaving
        self._inside = {lane: way for way in road_map.connections for lane in way.via}
        self._controlled = {
            (way.signal, way.link_index): way for way in road_map.connections if way.signal is not None
        }

    def follow(self, snapshot: Snapshot, lane: str, coming: NextLink) -> dict[str, Any]:
        """Tell a road user's movement, and the link of a signal that lets it go.

        Args:
            snapshot: the instant.
            lane: that it is on.
            coming: the link that it comes to.

        Returns:
            `movement` and `link` of `ObjectLabel`.
        """
        way = self._inside.get(lane)
        if way is not None:
            coming = None
            if way.signal is not None and way.link_index is not None:
                coming = (way.signal, way.link_index, 0.0)
        elif coming is not None:
            way = self._controlled.get(coming[:2])
        letters = (
            {way.direction} if way is not None else {each.direction for each in self._leaving.get(lane, ())}
        )
        movement = _WORDS.get(letters.pop(), "") if len(letters) == 1 else ""
        return {"movement": movement, "link": _read_link(snapshot, coming)}


def _read_link(snapshot: Snapshot, coming: NextLink) -> SignalLink | None:
    if coming is None:
        return None
    signal, link, distance = coming
    letters = snapshot.signals.get(signal, "")
    if link >= len(letters):
        return None
    return SignalLink(signal=signal, link=link, state=letters[link], distance=round(distance, 2))


def find_whole_box(corners: Floats, projected: Floats, camera: Camera) -> Box:
    """Find the box in the picture of a box in space, as far as that is before the camera.

    Args:
        corners: (8, 3) metres, map frame, in the order of `Boxes.corners`.
        projected: (8, 2) the same in the picture; nan behind the camera.
        camera: that looks.

    Returns:
        Left, top, right, bottom, pixels; not cut by the picture's border.
    """
    away = (corners - camera.position) @ camera.axes[2]
    if away.min() < camera.near:
        a, b = corners[_EDGES[:, 0]], corners[_EDGES[:, 1]]
        near_a, near_b = (away[_EDGES[:, k]] - camera.near for k in (0, 1))
        crosses = near_a * near_b < 0
        share = (near_a[crosses] / (near_a - near_b)[crosses])[:, None]
        cuts = a[crosses] + share * (b[crosses] - a[crosses]) + 1e-6 * camera.axes[2]
        projected = camera.project(np.concatenate([corners[away >= camera.near], cuts]))[0]
    low, high = np.clip([projected.min(axis=0), projected.max(axis=0)], -_FARTHEST, _FARTHEST).tolist()
    return (*low, *high)


def _share_outside(box: Box, camera: Camera) -> float:
    left, top, right, bottom = box
    inside = max(0.0, min(right, camera.width) - max(left, 0.0)) * max(
        0.0, min(bottom, camera.height) - max(top, 0.0)
    )
    return 1.0 - min(1.0, inside / max((right - left) * (bottom - top), 1e-9))


def without_users(snapshot: Snapshot) -> Snapshot:
    """Give the same instant with empty roads."""
    return Snapshot(time=snapshot.time, signals=snapshot.signals)
