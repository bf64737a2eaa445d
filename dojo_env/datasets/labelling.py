"""Labels of a picture: what the renderer knows of it, what SUMO knew of the road users in it, and the map."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.datasets.keypoints import model_points, see_points
from dojo_env.datasets.labels import ObjectLabel, SignalLink
from dojo_env.rendering.boxes import Boxes
from dojo_env.rendering.masks import encode_masks
from dojo_env.rendering.outputs import Picture
from dojo_env.rendering.scene import Scene
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
        """Tell whether too little of a road user shows.

        Args:
            pixels: visible ones.
            visible: share of the pixels that would show if nothing stood in front, 0 to 1.

        Returns:
            True where either is below its threshold.
        """
        return pixels < self.least_pixels or visible < self.least_visible


class Instant:
    """The road users of an instant, ready for the labels of any camera's picture."""

    def __init__(self, snapshot: Snapshot, links: Mapping[str, NextLink], ways: "Ways", scene: Scene) -> None:
        """Take an instant.

        Args:
            snapshot: everyone on the road.
            links: the signal's link that each vehicle comes to, by SUMO's id.
            ways: of the map.
            scene: that they are in.
        """
        self._snapshot, self._links, self._ways = snapshot, links, ways
        self._described: dict[int, dict[str, Any]] = {}
        users = place_users(snapshot, scene.origin, ways=scene.ways)
        self._rows = {int(number): k for k, number in enumerate(snapshot.numbers)}
        self._points = (
            np.einsum("kij,kcj->kci", users.frames, model_points()[users.models])
            + (users.places + scene.origin)[:, None]
        )

    def label(self, picture: Picture, tracks: "Tracks", thresholds: Thresholds) -> tuple[ObjectLabel, ...]:
        """Label every road user of which a pixel shows.

        Args:
            picture: of this instant, with all of `OUTPUTS`.
            tracks: numbers road users.
            thresholds: who is asked for.

        Returns:
            The labels, in the order of the picture's boxes.
        """
        boxes: Boxes = picture.boxes
        rows = np.array([self._rows[int(number)] for number in boxes.numbers], dtype=np.intp)
        points = np.concatenate([boxes.corners, self._points[rows]], axis=1)
        # The picture that is delivered counts: on its way from the renderer it may have been moved.
        shown = encode_masks(picture.instance, boxes.numbers)
        seen = see_points(points.reshape(-1, 3), picture.camera, picture.depth).reshape(points.shape)
        whole = find_whole_boxes(boxes, picture.camera)
        outside = _shares_outside(whole, picture.camera).tolist()
        return tuple(
            ObjectLabel(
                track=tracks.number(int(boxes.numbers[k])),
                box=tuple(shown.boxes[k].tolist()),
                whole_box=tuple(whole[k].tolist()),
                pixels=int(shown.pixels[k]),
                visible=float(boxes.visible[k]),
                truncated=outside[k],
                mask=shown.masks[k],
                keypoints=None if boxes.kinds[k] == Kind.PEDESTRIAN else seen[k],
                corners=boxes.corners[k],
                is_ignored=thresholds.hides(int(shown.pixels[k]), float(boxes.visible[k])),
                **self._describe(int(rows[k])),
            )
            for k in np.flatnonzero(shown.pixels).tolist()
        )

    def _describe(self, row: int) -> dict[str, Any]:
        """Tell what is true of a road user in any picture."""
        if row not in self._described:
            snapshot = self._snapshot
            name, lane = snapshot.ids[row], snapshot.lanes[row]
            length, width, height = snapshot.sizes[row].tolist()
            self._described[row] = {
                "id": name,
                "kind": Kind(snapshot.kinds[row]),
                "size": (length, width, height),
                "heading": float(snapshot.headings[row]),
                "speed": float(snapshot.speeds[row]),
                "lane": lane,
                "lights": Lights(int(snapshot.lights[row])),
                **self._ways.follow(snapshot, lane, self._links.get(name)),
            }
        return self._described[row]


class Tracks:
    """Numbers the road users of one episode in the order in which they are first seen."""

    def __init__(self) -> None:
        """Begin with nobody."""
        self._known: dict[tuple[int, int], int] = {}
        self.run = 0
        """Which of the episode's simulations it is; each has its own road users."""

    def number(self, number: int) -> int:
        """Give a road user's track; who is new gets the next one.

        Args:
            number: the road user's in the snapshot.

        Returns:
            The track, from 1, the same for the road user in all pictures of the simulation.
        """
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


def find_whole_boxes(boxes: Boxes, camera: Camera) -> Floats:
    """Find the boxes in the picture of boxes in space, as far as these are before the camera.

    Args:
        boxes: of the road users.
        camera: that looks.

    Returns:
        (k, 4) left, top, right, bottom, pixels; not cut by the picture's border.
    """
    away = (boxes.corners - camera.position) @ camera.axes[2]
    found = np.concatenate([boxes.projected.min(axis=1), boxes.projected.max(axis=1)], axis=1)
    for k in np.flatnonzero(away.min(axis=1) < camera.near):
        points = camera.project(_cut_off(boxes.corners[k], away[k] - camera.near, camera))[0]
        found[k] = [*points.min(axis=0), *points.max(axis=0)]
    return np.clip(found, -_FARTHEST, _FARTHEST)


def _cut_off(corners: Floats, beyond: Floats, camera: Camera) -> Floats:
    """Give the corners of a box that lie beyond a plane, and where its edges cut that.

    Args:
        corners: (8, 3) metres, map frame.
        beyond: (8,) how far beyond the plane each lies, metres.
        camera: before which the plane is.
    """
    a, b = _EDGES.T
    crosses = beyond[a] * beyond[b] < 0
    a, b = a[crosses], b[crosses]
    share = (beyond[a] / (beyond[a] - beyond[b]))[:, None]
    cuts = corners[a] + share * (corners[b] - corners[a]) + 1e-6 * camera.axes[2]
    return np.concatenate([corners[beyond >= 0], cuts])


def _shares_outside(boxes: Floats, camera: Camera) -> Floats:
    """Tell what share of each box, (k, 4), lies outside of the picture."""
    border = np.array([camera.width, camera.height])
    inside = np.clip(boxes[:, 2:], 0, border) - np.clip(boxes[:, :2], 0, border)
    areas = np.maximum((boxes[:, 2:] - boxes[:, :2]).prod(axis=1), 1e-9)
    return 1.0 - np.minimum(1.0, inside.prod(axis=1) / areas)


def without_users(snapshot: Snapshot) -> Snapshot:
    """Give the same instant with empty roads.

    Args:
        snapshot: of the instant; it stays as it is.

    Returns:
        Its time and the signals' letters, and nobody on the road.
    """
    return Snapshot(time=snapshot.time, signals=snapshot.signals)
