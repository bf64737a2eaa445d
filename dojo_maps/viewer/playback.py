"""A recorded episode as a page plays it: where everybody was, what they looked like, what signals showed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_maps.viewer.container import Container

_MOST_ROWS = 3_000_000
"""Places that one page holds; a browser needs some hundred bytes for each."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Model:
    """The body of a road user in one pose, in a box from x = -1 (tail) to 0 (nose), y to 0.5, z from 0 to 1.

    Attributes:
        vertices: (n, 3) in the unit box.
        faces: (m, 3) vertex indices, counter-clockwise from outside.
        parts: (m,) row of `Playback.palette`.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    parts: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Playback:
    """What moves on a map. Rows are road users at an instant, one instant after the other.

    Attributes:
        times: (t,) simulated seconds, rising.
        counts: (t,) rows of each instant.
        users: (r,) index into `ids`.
        places: (r, 3) middle of the front end on the ground, metres around the map's origin.
        headings: (r,) radians, counter-clockwise from east.
        slopes: (r,) radians, positive uphill.
        poses: (r,) index into `models`.
        lights: (r,) bits: 1 brakes, 2 left, 4 right, 8 blue.
        ids: of the road users, (u,).
        sizes: (u, 3) length, width and height as drawn, metres.
        colours: (u, c, 3) each user's own colours, sRGB.
        models: what they look like: near and far.
        palette: (p, 3) sRGB by part.
        own: (p,) which of a user's own colours a part has; -1 for the palette's.
        lit: (p,) bit of `lights` that makes a part shine; 0 for none.
        signals: ids of the signals.
        states: every state that one of them showed.
        shown: (t, s) index into `states`.
    """

    times: NDArray[np.float64]
    counts: NDArray[np.int32]
    users: NDArray[np.int32]
    places: NDArray[np.float64]
    headings: NDArray[np.float64]
    slopes: NDArray[np.float64]
    poses: NDArray[np.int32]
    lights: NDArray[np.uint8]
    ids: Sequence[str]
    sizes: NDArray[np.float64]
    colours: NDArray[np.uint8]
    models: Sequence[tuple[Model, Model]]
    palette: NDArray[np.uint8]
    own: NDArray[np.int8]
    lit: NDArray[np.uint8]
    signals: Sequence[str]
    states: Sequence[str]
    shown: NDArray[np.int32]


def pack_playback(playback: Playback, container: Container) -> dict[str, Any]:
    """Add an episode to a page's data; of a long one only every second instant, or third, and so on.

    Args:
        playback: the episode.
        container: takes the arrays.

    Returns:
        JSON values by the names of `Playback`, arrays as the container gives them: places in centimetres,
        headings in 1/65536 of a turn, slopes in 1/200 radian; `ownColours` is how many colours each user has.
    """
    stride = -(-len(playback.users) // _MOST_ROWS) or 1
    kept = np.arange(len(playback.times)) % stride == 0
    rows = np.repeat(kept, playback.counts)
    turns = np.rint(playback.headings[rows] / (2 * np.pi) * 65536).astype(np.int64) % 65536
    slopes = np.clip(np.rint(playback.slopes[rows] * 200), -127, 127)
    return {
        "times": playback.times[kept].tolist(),
        "counts": container.add(playback.counts[kept]),
        "users": container.add(playback.users[rows].astype(np.int32)),
        "places": container.add(np.rint(playback.places[rows] * 100).astype(np.int32)),
        "headings": container.add(turns.astype(np.uint16)),
        "slopes": container.add(slopes.astype(np.int8)),
        "poses": container.add(playback.poses[rows].astype(np.uint16)),
        "lights": container.add(playback.lights[rows]),
        "ids": list(playback.ids),
        "sizes": container.add(playback.sizes.astype(np.float32)),
        "colours": container.add(playback.colours),
        "ownColours": playback.colours.shape[1],
        "models": [[_pack_model(model, container) for model in levels] for levels in playback.models],
        "palette": playback.palette.tolist(),
        "own": playback.own.tolist(),
        "lit": playback.lit.tolist(),
        "signals": list(playback.signals),
        "states": list(playback.states),
        "shown": container.add(playback.shown[kept].astype(np.int32)),
    }


def _pack_model(model: Model, container: Container) -> list[Any]:
    """Store corners once for each part that they belong to: places in 1/8192 of the box, and the part."""
    corners = np.column_stack([model.faces.ravel(), np.repeat(model.parts, 3)])
    both, numbered = np.unique(corners, axis=0, return_inverse=True)
    places = np.clip(np.rint(model.vertices[both[:, 0]] * 8192), -32768, 32767)
    return [
        container.add(np.column_stack([places, both[:, 1]]).astype(np.int16)),
        container.add(numbered.ravel().astype(np.uint16)),
    ]
