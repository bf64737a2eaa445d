"""What claims ground: lane strips, junctions, walking areas, sidewalks, islands and tracks, by precedence.

A piece is a polygon as the description has it, overlaps and all. `arrangement` decides who owns what.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import shapely

from dojo_maps.description import Lane, LaneKind, Origin, Points, RoadMap
from dojo_maps.geometry.polylines import Ints, Shapes, drop_repeats

GRID = 1e-3
"""Every corner of every surface lies on this raster, metres, so that neighbours share their corners."""


class Layer(StrEnum):
    """Surfaces, in the words of scene.glb's node names."""

    ROAD = "road"
    PARKING = "road/parking"
    WALKING_AREA = "walking_area"
    JUNCTION = "junction"
    SIDEWALK = "sidewalk"
    ISLAND = "island"
    RAIL = "rail"
    WATER = "terrain/water"
    GREEN = "terrain/green"
    TERRAIN = "terrain"


RAISED = (Layer.WALKING_AREA, Layer.SIDEWALK, Layer.ISLAND)
"""Layers that stand above the carriageway behind a kerb."""

_PARKING = {"parking": Layer.PARKING}
_OPEN_GROUND = {"water": Layer.WATER, "green": Layer.GREEN}
"""What props claim, by kind."""
_MOUTH = 2.0
"""Metres; the wedge between a lane of 3.2 m and a border 30 degrees askew is 1.8 m deep."""
_POLYGON = 3
"""shapely's type number."""
_NOT_ROAD = (LaneKind.SIDEWALK, LaneKind.RAIL, LaneKind.WATERWAY)
_LANE_ORDER = tuple(LaneKind)


@dataclass(frozen=True, slots=True)
class Claim:
    """One polygon that claims ground (shapely, map frame) and the line its heights are taken from."""

    layer: Layer
    id: str
    polygon: shapely.Geometry
    line: Points
    flush: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Pieces:
    """All claims, those that win first; polygons on the raster, in the frame of the map's origin.

    `lines` are those that each piece's heights are known along; `flush` tells which have no kerb.

    `paved` counts the leading pieces that make up the network's own ground, without islands, generated
    pavement and tracks: seams are closed between these only. `mouths` reach on from the lanes' ends into the
    junctions, over the wedges that oblique borders leave there. `cuts` lie across lanes where their slope
    changes, so that surfaces can bend there.
    """

    polygons: Shapes
    layers: tuple[Layer, ...]
    ids: tuple[str, ...]
    lines: tuple[Points, ...]
    flush: tuple[bool, ...]
    paved: int
    mouths: Shapes
    cuts: Shapes


def build_pieces(road_map: RoadMap) -> Pieces:
    """Collect the network's own claims to ground in the order of precedence.

    A lane wins over a walking area, that over a junction's floor, that over a sidewalk. Among lanes, driving
    lanes win, then roads of higher priority.

    Args:
        road_map: its props, its tracks and generated pavement claim nothing yet; see `add_pieces`.

    Returns:
        The claims, all of them `paved`, with mouths and cuts.
    """
    claims = [*_road_claims(road_map), *_walking_area_claims(road_map), *_junction_claims(road_map)]
    pieces = _pieces([*claims, *_sidewalk_claims(road_map, Origin.NETWORK)], road_map)
    return replace(pieces, paved=len(pieces.ids), mouths=_mouths(road_map), cuts=_cuts(road_map))


def add_pieces(pieces: Pieces, road_map: RoadMap) -> Pieces:
    """Add the claims that give way to the network's own.

    Islands come first, then parking bays, generated pavement, tracks, water, and green areas.

    Args:
        pieces: as `build_pieces` makes them.
        road_map: the same map, furnished.

    Returns:
        The pieces, followed by those that are added.
    """
    claims = [*_island_claims(road_map), *_prop_claims(road_map, _PARKING)]
    claims += [*_sidewalk_claims(road_map, Origin.GENERATED), *_rail_claims(road_map)]
    claims += _prop_claims(road_map, _OPEN_GROUND)
    added = _pieces(claims, road_map)
    return replace(
        pieces,
        polygons=np.concatenate([pieces.polygons, added.polygons]),
        layers=pieces.layers + added.layers,
        ids=pieces.ids + added.ids,
        lines=pieces.lines + added.lines,
        flush=pieces.flush + added.flush,
    )


def _pieces(claims: Sequence[Claim], road_map: RoadMap) -> Pieces:
    shift = np.array([*road_map.origin, 0.0])
    polygons = shapely.transform(
        np.array([c.polygon for c in claims], dtype=object), lambda xy: xy - shift[:2]
    )
    polygons, index = flat_polygons(
        shapely.set_precision(shapely.make_valid(polygons), GRID), larger_than=0.01
    )
    kept = [claims[int(i)] for i in index]
    return Pieces(
        polygons=polygons,
        layers=tuple(claim.layer for claim in kept),
        ids=tuple(claim.id for claim in kept),
        lines=tuple(claim.line - shift for claim in kept),
        flush=tuple(claim.flush for claim in kept),
        paved=0,
        mouths=np.empty(0, dtype=object),
        cuts=np.empty(0, dtype=object),
    )


def lane_strips(lanes: Iterable[Lane]) -> Shapes:
    """Buffer centre lines by half their widths, ends flat.

    Args:
        lanes: of any kind.

    Returns:
        (n,) polygons, metres, map frame; empty for a lane without length.
    """
    lanes = list(lanes)
    shapes = [drop_repeats(lane.shape)[:, :2] for lane in lanes]
    lines = [shapely.linestrings(shape) if len(shape) > 1 else shapely.LineString() for shape in shapes]
    return shapely.buffer(
        np.array(lines, dtype=object),
        np.array([lane.width / 2 for lane in lanes]),
        cap_style="flat",
        join_style="mitre",
        mitre_limit=2.0,
    )


def _cuts(road_map: RoadMap) -> Shapes:
    """Lay a line across each lane at every inner point of its shape, where the map has heights."""
    cuts = []
    for lane in road_map.lanes:
        shape = drop_repeats(lane.shape)
        if len(shape) < 3 or not shape[:, 2].any():
            continue
        places = shape[1:-1, :2] - np.array(road_map.origin)
        along = shape[2:, :2] - shape[:-2, :2]
        across = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
        reach = across * (lane.width / 2 + 2 * GRID)
        cuts += [*shapely.linestrings(np.stack([places - reach, places + reach], axis=1))]
    return np.array(cuts, dtype=object)


def flat_polygons(shapes: Shapes, *, larger_than: float = 1e-4) -> tuple[Shapes, Ints]:
    """Take the polygons out of shapes, however deep in collections; drop those of hardly any area.

    Args:
        shapes: (n,) of any type.
        larger_than: square metres.

    Returns:
        (m,) polygons, and the index of each one's shape.
    """
    parts, index = shapely.get_parts(shapes, return_index=True)
    while (shapely.get_type_id(parts) > _POLYGON).any():
        parts, inner = shapely.get_parts(parts, return_index=True)
        index = index[inner]
    kept = (shapely.get_type_id(parts) == _POLYGON) & (shapely.area(parts) > larger_than)
    return parts[kept], index[kept]


def _road_claims(road_map: RoadMap) -> Iterator[Claim]:
    priority = {road.id: road.priority for road in road_map.roads}
    lanes = [lane for lane in road_map.lanes if lane.kind not in _NOT_ROAD]
    lanes.sort(key=lambda lane: (_LANE_ORDER.index(lane.kind), -priority[lane.road]))
    for lane, strip in zip(lanes, lane_strips(lanes), strict=True):
        yield Claim(Layer.ROAD, lane.id, strip, lane.shape)


def _mouths(road_map: RoadMap) -> Shapes:
    """Carry each lane on past the ends where it goes on, straight and at its width."""
    ends = {c.from_lane for c in road_map.connections}
    starts = {c.to_lane for c in road_map.connections}
    lines, widths = [], []
    origin = np.array(road_map.origin)
    for lane in road_map.lanes:
        shape = drop_repeats(lane.shape)[:, :2] - origin
        if lane.kind in _NOT_ROAD or len(shape) < 2:
            continue
        for wanted, border, inner in (
            (lane.id in ends, shape[-1], shape[-2]),
            (lane.id in starts, *shape[:2]),
        ):
            if wanted:
                step = (border - inner) / np.hypot(*(border - inner))
                lines.append([border, border + step * _MOUTH])
                widths.append(lane.width)
    if not lines:
        return np.empty(0, dtype=object)
    mouths = shapely.buffer(shapely.linestrings(lines), np.array(widths) / 2, cap_style="flat")
    return shapely.set_precision(mouths, GRID)


def _rail_claims(road_map: RoadMap) -> Iterator[Claim]:
    lanes = [lane for lane in road_map.lanes if lane.kind is LaneKind.RAIL]
    for lane, strip in zip(lanes, lane_strips(lanes), strict=True):
        yield Claim(Layer.RAIL, lane.id, strip, lane.shape)


def _walking_area_claims(road_map: RoadMap) -> Iterator[Claim]:
    for area in road_map.walking_areas:
        yield _ring_claim(Layer.WALKING_AREA, area.id, area.polygon)


def _junction_claims(road_map: RoadMap) -> Iterator[Claim]:
    for junction in road_map.junctions:
        if len(junction.polygon) > 2:
            yield _ring_claim(Layer.JUNCTION, junction.id, junction.polygon)


def _sidewalk_claims(road_map: RoadMap, origin: Origin) -> Iterator[Claim]:
    for sidewalk in road_map.sidewalks:
        if sidewalk.origin is origin:
            yield _ring_claim(Layer.SIDEWALK, sidewalk.id, sidewalk.polygon, sidewalk.holes)


def _island_claims(road_map: RoadMap) -> Iterator[Claim]:
    for prop in road_map.props:
        if prop.kind == "island" and prop.polygon is not None:
            yield replace(_ring_claim(Layer.ISLAND, prop.id, prop.polygon), flush=prop.height == 0.0)


def _prop_claims(road_map: RoadMap, layers: Mapping[str, Layer]) -> Iterator[Claim]:
    for kind, layer in layers.items():
        for prop in road_map.props:
            if prop.kind == kind and prop.polygon is not None:
                yield _ring_claim(layer, prop.id, prop.polygon, prop.holes)


def _ring_claim(layer: Layer, source: str, ring: Points, holes: tuple[Points, ...] = ()) -> Claim:
    if len(ring) < 3:
        return Claim(layer, source, shapely.Polygon(), ring)
    polygon = shapely.Polygon(ring[:, :2], [hole[:, :2] for hole in holes])
    return Claim(layer, source, polygon, np.vstack([ring, ring[:1]]))
