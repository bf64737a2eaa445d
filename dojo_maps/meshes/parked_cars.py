"""Parked cars in scene.glb: plain bodies for viewers. Cameras draw those cars as they draw all road users."""

from collections.abc import Iterator, Sequence
from functools import cache
from zlib import crc32

import numpy as np

from dojo_maps.description import Prop
from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.mesh import Mesh, join

PREFIX = "building/car/"
"""Names of their nodes begin with it, then a paint's name, `glass` or `tyre`."""
PAINTS = ("white", "white", "grey", "grey", "black", "silver", "blue", "red")

Stations = tuple[tuple[float, float, float, float, float], ...]
"""Cuts across a body: how far from the nose, half the width below and above, the lower and the upper height,
as shares of length, half the width, and height."""
_CAR: dict[str, Stations] = {
    "paint": (
        (0.0, 0.8, 0.82, 0.18, 0.44), (0.05, 0.95, 0.94, 0.13, 0.53), (0.27, 1.0, 0.96, 0.12, 0.62),
        (0.78, 1.0, 0.96, 0.12, 0.66), (0.96, 0.94, 0.9, 0.14, 0.62), (1.0, 0.82, 0.8, 0.22, 0.55),
    ),
    "glass": (
        (0.25, 0.9, 0.88, 0.58, 0.63), (0.42, 0.92, 0.74, 0.6, 0.97), (0.72, 0.92, 0.74, 0.62, 0.97),
        (0.93, 0.88, 0.84, 0.6, 0.66),
    ),
    "roof": ((0.42, 0.75, 0.72, 0.965, 1.0), (0.74, 0.75, 0.72, 0.965, 1.0)),
}  # fmt: skip
_VAN: dict[str, Stations] = {
    "paint": (
        (0.0, 0.85, 0.85, 0.13, 0.36), (0.03, 0.96, 0.94, 0.1, 0.46), (0.17, 1.0, 0.96, 0.1, 0.55),
        (1.0, 0.98, 0.96, 0.12, 0.58),
    ),
    "glass": ((0.15, 0.92, 0.9, 0.5, 0.55), (0.32, 0.94, 0.82, 0.5, 0.96)),
    "roof": ((0.32, 0.97, 0.86, 0.55, 1.0), (0.99, 0.96, 0.86, 0.55, 1.0)),
}  # fmt: skip
_AXLES, _RADIUS, _TYRE = (0.19, 0.8), 0.31, 0.2
"""Where wheels are, as shares of the length; their radius and width, metres."""
_SIDES = 8


def parked_car_meshes(props: Sequence[Prop], shift: Floats) -> Iterator[Mesh]:
    """Build the bodies of parked cars, a mesh for each paint, and one of glass and one of tyres.

    Args:
        props: parked cars, whose outlines begin at the right front corner, then the left, map frame.
        shift: (3,) the origin of the scene, metres.

    Yields:
        The meshes in the order of their names, in the frame of the scene.
    """
    parts: dict[str, list[tuple[str, Floats, Ints]]] = {}
    for prop in props:
        outline = np.asarray(prop.polygon) - shift
        paint = PAINTS[crc32(prop.id.encode()) % len(PAINTS)]
        shapes = _VAN if dict(prop.tags).get("vehicle") == "van" else _CAR
        for part, stations in shapes.items():
            name = "glass" if part == "glass" else paint
            parts.setdefault(name, []).append((prop.id, *_put(*_loft(stations), outline, prop.height)))
        parts.setdefault("tyre", []).append((prop.id, *_wheels(outline)))
    for name in sorted(parts):
        yield join(PREFIX + name, parts[name])


@cache
def _loft(stations: Stations) -> tuple[Floats, Ints]:
    """Close a body around its stations: unit lengths, nose at 0, the right side below 0."""
    rings = [[(x, -a, low), (x, a, low), (x, b, high), (x, -b, high)] for x, a, b, low, high in stations]
    count = len(rings)
    quads = [
        (4 * k + side, 4 * k + (side + 1) % 4, 4 * (k + 1) + (side + 1) % 4, 4 * (k + 1) + side)
        for k in range(count - 1)
        for side in range(4)
    ]
    quads += [(3, 2, 1, 0), (4 * count - 4, 4 * count - 3, 4 * count - 2, 4 * count - 1)]
    return np.array(rings).reshape(-1, 3), _halve(quads)


@cache
def _wheel() -> tuple[Floats, Ints]:
    """Make a wheel of radius 1 and width 1 around y."""
    turns = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    near, far = (np.column_stack([np.cos(turns), 0 * turns + y, np.sin(turns)]) for y in (-0.5, 0.5))
    following = (np.arange(_SIDES) + 1) % _SIDES
    tread = [(k, k + _SIDES, int(following[k]) + _SIDES, int(following[k])) for k in range(_SIDES)]
    discs = [(0, k, k + 1) for k in range(1, _SIDES - 1)]
    discs += [(_SIDES, _SIDES + k + 1, _SIDES + k) for k in range(1, _SIDES - 1)]
    return np.concatenate([near, far]), np.concatenate([_halve(tread), np.array(discs)])


def _wheels(outline: Floats) -> tuple[Floats, Ints]:
    vertices, faces = _wheel()
    length = np.linalg.norm(outline[0] - outline[3])
    half = np.linalg.norm(outline[0] - outline[1]) / 2
    size = np.array([_RADIUS / length, _TYRE / half, _RADIUS])
    places = [(x, side * (1.02 - 0.5 * _TYRE / half), _RADIUS) for x in _AXLES for side in (-1.0, 1.0)]
    wheels = [_put(vertices * size + np.array(place), faces, outline, 1.0) for place in places]
    starts = len(vertices) * np.arange(len(wheels))
    return (
        np.concatenate([corners for corners, _ in wheels]),
        np.concatenate([own + start for (_, own), start in zip(wheels, starts, strict=True)]),
    )


def _put(vertices: Floats, faces: Ints, outline: Floats, height: float) -> tuple[Floats, Ints]:
    """Stand a shape of unit lengths on an outline (4, 3): x points behind, so its faces are turned around."""
    nose, behind = (
        (outline[0] + outline[1]) / 2,
        (outline[2] + outline[3]) / 2 - (outline[0] + outline[1]) / 2,
    )
    aside = (outline[1] - outline[0]) / 2
    placed: Floats = nose + vertices[:, :1] * behind + vertices[:, 1:2] * aside
    return placed + vertices[:, 2:] * [0.0, 0.0, height], faces[:, ::-1]


def _halve(quads: Sequence[tuple[int, int, int, int]]) -> Ints:
    """Divide quads into triangles."""
    corners = np.array(quads, dtype=np.int64)
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
