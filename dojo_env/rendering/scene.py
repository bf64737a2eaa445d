"""The static world of a map, ready to draw: triangles and what they are, signal lamps, and link paths."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dojo_env.parked_cars import list_parked
from dojo_env.rendering.classes import LAYERS, OTHER_LAYER, Semantic, Surface
from dojo_env.rendering.fleet import Fleet, build_fleet, usual_fleet
from dojo_env.rendering.lanes import lane_pieces
from dojo_env.rendering.lighting import to_linear
from dojo_env.rendering.ways import Ways, lay_ways
from dojo_env.snapshot import Snapshot
from dojo_env.vehicle_models import VehicleModel
from dojo_maps.bundle import Bundle
from dojo_maps.description import BUILDING_FOOTING, LinkKind, RoadMap, Signal, foot_of

Floats = NDArray[np.float64]

LAMP_COLOURS = to_linear(np.array([(255, 40, 24), (255, 190, 30), (40, 255, 130)], dtype=np.uint8))
"""Linear light of a lit lamp: red, yellow, green."""
_DARK_LAMP = 0.4
_PLASTERS = to_linear(
    np.array(
        [
            (214, 204, 184), (196, 182, 164), (226, 220, 208), (206, 186, 140), (178, 168, 158),
            (190, 158, 134), (150, 96, 76), (188, 172, 148), (222, 206, 166), (128, 110, 98),
        ],
        dtype=np.uint8,
    )
)  # fmt: skip
"""Linear colours of plaster and brick."""
_TILES, _GRAVEL = to_linear(np.array([(118, 78, 64), (132, 130, 126)], dtype=np.uint8))
_PITCHED, _LEVEL_ROOF = 0.2, 0.95
"""Upward part of the normal from which a face is a roof, and a level one."""
_LAMPS = ("signal/red", "signal/yellow", "signal/green")
_PARKED = "building/car/"
"""Names of the meshes of parked cars begin so; those are drawn as road users are."""
_PATH_HALF_WIDTH = 0.22
_PATH_LIFT = 0.08
_PATH_STEP = 0.02
"""Paths lie over each other by colour, green on top, metres."""
_STATES_KEPT = 256
_RED, _YELLOW, _GREEN = 0, 1, 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """Everything that does not move.

    Attributes:
        road_map: the description.
        origin: (3,) the scene's frame is the map's, moved so that this point is 0.
        vertices: (n, 3) metres, scene frame.
        faces: (m, 3) vertex indices.
        normals: (m, 3) unit vectors, upward where a face is level.
        semantics: (m,) `Semantic`.
        surfaces: (m,) `Surface`.
        colours: (m, 3) linear.
        things: (m, 6) of the thing that each face belongs to: its lowest and highest place, metres, and a
            number of its own from 0 to 1; then how high its roof would be over the origin, and by how much
            it rises for each metre of x and of y. Along a wall it is the roof over that wall.
        lanes: (k, 10) pieces of lanes, see `LaneMap`.
        parked: the cars that stand in it; they are no part of its meshes.
        ways: the middles of lanes.
        fleet: what road users are drawn as.
    """

    road_map: RoadMap
    origin: Floats
    vertices: Floats
    faces: NDArray[np.int32]
    normals: Floats
    semantics: NDArray[np.uint8]
    surfaces: NDArray[np.uint8]
    colours: NDArray[np.float32]
    things: NDArray[np.float32]
    lanes: Floats
    parked: Snapshot
    ways: Ways
    fleet: Fleet

    @property
    def ground(self) -> float:
        """Height of the lowest ground, metres."""
        return float(self.vertices[:, 2].min()) if len(self.vertices) else 0.0


def build_scene(
    bundle: Bundle, models: Mapping[str, VehicleModel] | None = None, *, parked: bool = True
) -> Scene:
    """Read a bundle's meshes and tell what each face is.

    Args:
        bundle: the map.
        models: of a user's, by SUMO's vehicle type, in place of ours.
        parked: whether cars stand parked where it has them.

    Returns:
        The static world, in a frame whose origin the map gives.

    Raises:
        DescriptionError: the bundle's scene is missing or broken.
        ModelError: a model's file cannot be read.
    """
    vertices: list[Floats] = [np.empty((0, 3))]
    faces = [np.empty((0, 3), dtype=np.int64)]
    colours, things = [np.empty((0, 3), np.float32)], [np.empty((0, 6), np.float32)]
    looks: list[tuple[int, Semantic, Surface]] = []
    count = 0
    houses = [p for p in bundle.road_map.props if p.kind == "building" and p.polygon is not None]
    feet = {house.id: foot_of(house) - BUILDING_FOOTING for house in houses}
    for mesh in bundle.read_meshes():
        if mesh.name.startswith(_PARKED):
            continue
        semantic, surface, colour = LAYERS.get(mesh.name) or LAYERS.get(mesh.layer, OTHER_LAYER)
        dark = _DARK_LAMP if mesh.name in _LAMPS else 1.0
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + count)
        looks.append((len(mesh.faces), semantic, surface))
        corners = mesh.vertices[mesh.faces]
        own = _things(corners, mesh.sources, mesh.ids)
        if surface == Surface.FACADE:
            # Walls reach down as far as the ground slopes; storeys count from the building's foot.
            own[:, 0] = np.array([feet.get(name, -np.inf) for name in mesh.ids])[mesh.sources].clip(own[:, 0])
            _follow_roofs(own, corners)
        things.append(own.astype(np.float32))
        plain = np.tile(to_linear(np.array(colour)) * dark, (len(mesh.faces), 1))
        up = _normals(mesh.vertices, mesh.faces)[:, 2:]
        colours.append(_coloured(plain, things[-1][:, 2:3], surface, up).astype(np.float32))
        count += len(mesh.vertices)
    counts = [look[0] for look in looks]
    places, triangles = np.concatenate(vertices), np.concatenate(faces)
    return Scene(
        road_map=bundle.road_map,
        origin=np.array([*bundle.road_map.origin, 0.0]),
        vertices=places,
        faces=triangles.astype(np.int32),
        normals=_normals(places, triangles),
        semantics=np.repeat(np.array([look[1] for look in looks], dtype=np.uint8), counts),
        surfaces=np.repeat(np.array([look[2] for look in looks], dtype=np.uint8), counts),
        colours=np.concatenate(colours),
        things=np.concatenate(things),
        lanes=lane_pieces(bundle.road_map),
        parked=list_parked(bundle.road_map) if parked else Snapshot(time=0.0),
        ways=lay_ways(bundle.road_map),
        fleet=build_fleet(models) if models else usual_fleet(),
    )


def _things(corners: Floats, sources: NDArray[np.int64], ids: Sequence[str]) -> Floats:
    """Measure the thing that each face of a mesh belongs to; see `Scene.things`.

    Args:
        corners: (m, 3, 3) of the faces, metres.
        sources: (m,) index into `ids`.
        ids: names of the things.
    """
    heights = corners[:, :, 2]
    low, high = np.full(len(ids), np.inf), np.full(len(ids), -np.inf)
    np.minimum.at(low, sources, heights.min(axis=1))
    np.maximum.at(high, sources, heights.max(axis=1))
    numbers = np.array([(crc32(name.encode()) & 0xFFFF) / 0xFFFF for name in ids])
    flat = np.zeros((2, len(ids)))
    things: Floats = np.stack([low, high, numbers, high, *flat], axis=1).reshape(-1, 6)[sources]
    return things


def _follow_roofs(things: Floats, corners: Floats) -> None:
    """Let walls end where the roof above them does, not at its ridge.

    Args:
        things: (m, 6) of a building's faces, see `Scene.things`; changed.
        corners: (m, 3, 3) of the faces, metres.
    """
    places, place = np.unique(corners[:, :, 0].round(3) + 1j * corners[:, :, 1].round(3), return_inverse=True)
    place = place.reshape(-1, 3)
    start, end = place.min(axis=1), place.max(axis=1)
    at_start, at_end = place == start[:, None], place == end[:, None]
    walls = np.flatnonzero((start < end) & (at_start | at_end).all(axis=1))
    edges, edge = np.unique(start[walls] * len(places) + end[walls], return_inverse=True)
    tops = np.full((2, len(edges)), -np.inf)
    for top, is_there in zip(tops, (at_start, at_end), strict=True):
        np.maximum.at(top, edge, np.where(is_there, corners[:, :, 2], -np.inf).max(axis=1)[walls])
    begin, way = places[edges // len(places)], places[edges % len(places)] - places[edges // len(places)]
    rise = (tops[1] - tops[0]) * way / np.abs(way) ** 2
    over_origin = tops[0] - rise.real * begin.real - rise.imag * begin.imag
    things[walls, 3:] = np.stack([over_origin, rise.real, rise.imag], axis=1)[edge]


def _coloured(plain: Floats, numbers: NDArray[np.float32], surface: Surface, up: Floats) -> Floats:
    """Give buildings plasters and roofs, and trees greens, of their own.

    Args:
        plain: (m, 3) the layer's colour, linear.
        numbers: (m, 1) of the things that the faces belong to.
        surface: the layer's.
        up: (m, 1) upward part of the faces' normals.
    """
    if surface == Surface.FOLIAGE:
        lighter, yellower = 0.75 + 0.5 * numbers, 0.7 + 0.6 * (7.3 * numbers % 1)
        return plain * np.hstack([lighter * yellower, lighter, lighter])
    if surface != Surface.FACADE:
        return plain
    walls = _PLASTERS[(numbers[:, 0] * 7919).astype(int) % len(_PLASTERS)]
    return np.where(up > _LEVEL_ROOF, _GRAVEL, np.where(up > _PITCHED, _TILES, walls))


def _normals(vertices: Floats, faces: NDArray[np.int64]) -> Floats:
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-12), [0.0, 0.0, 1.0])


class Lamps(NamedTuple):
    """The lamps that are lit.

    Attributes:
        centres: (k, 3) metres, scene frame.
        directions: (k, 3) where they shine to.
        colours: (k,) index into `LAMP_COLOURS`.
    """

    centres: Floats
    directions: Floats
    colours: NDArray[np.int32]


NO_LAMPS = Lamps(centres=np.empty((0, 3)), directions=np.empty((0, 3)), colours=np.empty(0, dtype=np.int32))


class Paths(NamedTuple):
    """The ways across the junctions, in the colour that each link shows.

    Attributes:
        triangles: (k, 3, 3) metres, scene frame.
        colours: (k,) index into `LAMP_COLOURS`.
    """

    triangles: Floats
    colours: NDArray[np.int32]


NO_PATHS = Paths(triangles=np.empty((0, 3, 3)), colours=np.empty(0, dtype=np.int32))
States = tuple[tuple[str, str], ...]
"""(signal id, state) of each signal."""


class SignalFaces:
    """Knows where every lamp and link path is, and which show what in a state."""

    def __init__(self, scene: Scene) -> None:
        """Find the lamps and paths of a scene's signals."""
        signals, shift = scene.road_map.signals, scene.origin
        self._heads = {signal.id: list(_heads(signal, shift)) for signal in signals}
        self._paths: dict[str, list[tuple[int, Floats]]] = {signal.id: [] for signal in signals}
        for connection in scene.road_map.connections:
            if connection.signal in self._paths and connection.link_index is not None:
                path = _ribbon(connection.shape - shift)
                self._paths[connection.signal].append((connection.link_index, path))
        self.lit = lru_cache(maxsize=_STATES_KEPT)(self._lit)
        self.paths = lru_cache(maxsize=_STATES_KEPT)(self._painted)

    def _lit(self, states: States) -> Lamps:
        lit = [
            (lamps[min(colour, len(lamps) - 1)], direction, colour)
            for signal, state in states
            for links, lamps, direction in self._heads.get(signal, ())
            for colour in _shown({state[k] for k in links if k < len(state)}, len(lamps))
        ]
        return Lamps(
            centres=np.array([centre for centre, _, _ in lit]).reshape(-1, 3),
            directions=np.array([direction for _, direction, _ in lit]).reshape(-1, 3),
            colours=np.array([colour for _, _, colour in lit], dtype=np.int32),
        )

    def _painted(self, states: States) -> Paths:
        painted = [
            (path, (_shown({state[index]}, 3) or (_RED,))[-1])
            for signal, state in states
            for index, path in self._paths.get(signal, ())
            if index < len(state)
        ]
        lifted = [path + np.array([0.0, 0.0, _PATH_STEP * colour]) for path, colour in painted]
        return Paths(
            triangles=np.concatenate([NO_PATHS.triangles, *lifted]),
            colours=np.repeat([colour for _, colour in painted], [len(path) for path, _ in painted]).astype(
                np.int32
            ),
        )


def _heads(signal: Signal, shift: Floats) -> Iterator[tuple[tuple[int, ...], Floats, Floats]]:
    walks = {link.index for link in signal.links if link.kind is LinkKind.PEDESTRIAN}
    for head in signal.heads:
        walking = head.link_indices[0] in walks
        direction = np.array([np.cos(head.heading), np.sin(head.heading), 0.0])
        yield head.link_indices, head.lamps(2 if walking else 3) - shift, direction


def _shown(letters: set[str], lamps: int) -> tuple[int, ...]:
    """Which lamps the links of a head light; the most permissive link decides. Letters are SUMO's."""
    if letters & set("gG"):
        return (_GREEN,)
    if lamps == 2:
        return (_RED,) if letters - set("oO") else ()
    if letters & set("yo"):
        return (_YELLOW,)
    if "u" in letters:
        return (_RED, _YELLOW)
    return (_RED,) if letters - set("O") else ()


def _ribbon(line: Floats) -> Floats:
    """Make the triangles of a flat band along a line."""
    steps = np.diff(line[:, :2], axis=0)
    length = np.hypot(*steps.T)
    line, steps, length = line[np.append(True, length > 1e-6)], steps[length > 1e-6], length[length > 1e-6]
    if len(line) < 2:
        return np.empty((0, 3, 3))
    sides = np.column_stack([-steps[:, 1], steps[:, 0]]) / length[:, None]
    corners = np.vstack([sides[:1], (sides[:-1] + sides[1:]) / 2, sides[-1:]]) * _PATH_HALF_WIDTH
    offset = np.column_stack([corners, np.zeros(len(corners))])
    line = line + np.array([0.0, 0.0, _PATH_LIFT])
    left, right = line + offset, line - offset
    first = np.stack([right[:-1], right[1:], left[:-1]], axis=1)
    second = np.stack([left[:-1], right[1:], left[1:]], axis=1)
    return np.concatenate([first, second])
