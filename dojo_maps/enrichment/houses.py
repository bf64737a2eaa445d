"""Houses around the blocks between streets, generated from the map alone, for maps that tell of none.

A block is ground between streets, drawn back by the depth of a forecourt. The band along its edge is cut
across into plots, so houses stand in rows, never on each other and never on a street:

    street   ========================================
    forecourt
             +-----+-------+----+------+   +--------+
    band     |     |       |    |      |gap|        |
             +-----+-------+----+------+   |   +----+
    yard                                   |   |
"""

import zlib
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import shapely

from dojo_maps.description import LaneKind, Origin, Points, Prop, Sidewalk
from dojo_maps.enrichment.vicinity import FORECOURT, Vicinity
from dojo_maps.geometry.pieces import GRID, flat_polygons, lane_strips
from dojo_maps.geometry.polylines import Flags, Floats, Ints, Shapes, along

GENERATED = ("origin", "generated")
"""The tag of things that no source tells of."""
_NOT_ROAD = (LaneKind.RAIL, LaneKind.WATERWAY)
_DEPTH = 11.0
_ROOM = _DEPTH + 4.0
"""Blocks narrower than twice this, two rows with a yard between, are not built upon, metres."""
_HOUSE = 13.0
"""Mean width of a house, metres."""
_UNEVEN = 0.35
"""By how much widths differ from the mean, as a share."""
_SHARP = np.cos(np.radians(25.0))
_SMALLEST, _LARGEST = 60.0, 900.0
"""Square metres that a house stands on."""
_GAP = 0.06
"""Share of plots that stay open."""
_STRAIGHTENED = 0.4
_BESIDE = 9.0
"""Houses this close to a lane stand along its road, metres."""
_URBAN, _FASTEST = 15.3, 20.1
"""Up to 55 km/h houses stand wall to wall, up to 72 km/h by themselves, and along faster roads none, m/s."""
_APART = 1.5
"""How far a house that stands by itself keeps from the border of its plot, metres."""
_FLOOR = 3.0
_PARAPET = 0.4
_GABLED = 0.75
"""Share of the four-cornered houses in rows that have a gable roof; low ones have one, or a second floor."""


def chance(*parts: object) -> float:
    """Draw a number from 0 to 1 for what a thing is called or where it is, the same in every process."""
    return zlib.crc32(":".join(map(str, parts)).encode()) / 2**32


def generate_houses(near: Vicinity) -> tuple[Prop, ...]:
    """Build houses along the pavement.

    Args:
        near: the vicinity; houses stand within its `focus`.

    Returns:
        Props of kind `building`, with the tags of OpenStreetMap.
    """
    blocks = _blocks(near)
    plots, is_alone = _plots(blocks, near)
    if not len(plots):
        return ()
    edges = shapely.multilinestrings([*shapely.get_exterior_ring(blocks)])
    ways = shapely.get_coordinates(shapely.shortest_line(shapely.centroid(plots), edges)).reshape(-1, 2, 2)
    outlines = near.lift_outlines(plots)
    block = shapely.STRtree(blocks).nearest(plots)
    is_plain = shapely.get_num_coordinates(shapely.simplify(plots, 0.3)) == 5
    return tuple(
        _house(
            outlines[k],
            front=ways[k, 1] - ways[k, 0],
            floors=max(2 - is_plain[k], _floors(blocks[block[k]], plots[k], is_alone=is_alone[k])),
            may_have_gables=is_plain[k],
        )
        for k in range(len(plots))
    )


def generate_forecourts(near: Vicinity, houses: Shapes, bays: Shapes) -> tuple[Sidewalk, ...]:
    """Pave what lies between the street, its bays, and houses wall to wall, in parts without holes.

    Args:
        near: the vicinity.
        houses: (n,) outlines of the houses wall to wall, metres, map frame; without any, nothing is paved.
        bays: (m,) outlines of the parking bays, metres, map frame.

    Returns:
        Pavement that belongs to no road.
    """
    if not len(houses):
        return ()
    rows = shapely.buffer(shapely.multipolygons(houses), FORECOURT + _STRAIGHTENED, join_style="mitre")
    rails = lane_strips([lane for lane in near.road_map.lanes if lane.kind in _NOT_ROAD])
    paved = shapely.difference(shapely.intersection(rows, near.cleared), shapely.union_all([*rails, *bays]))
    parts = flat_polygons(np.array([shapely.set_precision(paved, GRID)]), larger_than=1.0)[0]
    pieces = np.array([piece for part in parts for piece in _without_holes(part)], dtype=object)
    return tuple(
        Sidewalk(
            id=f"generated:forecourt:{_name(piece)}", origin=Origin.GENERATED, road=None, polygon=outline
        )
        for piece, outline in zip(pieces, near.lift_outlines(pieces), strict=True)
    )


def _blocks(near: Vicinity) -> Shapes:
    """Find the ground between streets that is wide enough to be built upon."""
    closed = shapely.union_all([near.cleared, *near.sights], grid_size=GRID)
    ground = shapely.difference(near.reach, closed, grid_size=GRID)
    core = shapely.buffer(ground, -_ROOM, join_style="mitre")
    wide = shapely.intersection(shapely.buffer(core, _ROOM, join_style="mitre"), ground, grid_size=GRID)
    return flat_polygons(np.array([shapely.simplify(wide, _STRAIGHTENED)]), larger_than=_SMALLEST)[0]


def _plots(blocks: Shapes, near: Vicinity) -> tuple[Shapes, Flags]:
    """Cut the edges of blocks into plots, and tell on which a house stands by itself."""
    inner = shapely.buffer(blocks, -_DEPTH, join_style="mitre", mitre_limit=2.0)
    rings = shapely.get_rings(shapely.orient_polygons(blocks))
    cuts = [cut for ring in rings for cut in _cuts(shapely.get_coordinates(ring))]
    lines = [
        *shapely.boundary(blocks),
        *shapely.boundary(inner),
        *shapely.linestrings(np.reshape(cuts, (-1, 2, 2))),
    ]
    plots = shapely.get_parts(shapely.polygonize([shapely.union_all(lines, grid_size=GRID)]))
    size, middle = shapely.area(plots), shapely.point_on_surface(plots)
    kept = (size > _SMALLEST) & (size < _LARGEST) & shapely.contains(near.focus, middle)
    plots, middle = plots[kept], middle[kept]
    behind = shapely.STRtree(inner).query(middle, "within")[0]
    before = shapely.STRtree(blocks).query(middle, "within")[0]
    walked = shapely.STRtree(near.walked).query(plots, "dwithin", distance=FORECOURT + 2 * _STRAIGHTENED)[0]
    numbers = np.setdiff1d(np.intersect1d(before, walked), behind)
    numbers = np.setdiff1d(numbers, _beside(plots, near, faster_than=_FASTEST))
    numbers = np.array([k for k in numbers if chance("gap", _name(plots[k])) > _GAP], dtype=np.int64)
    is_alone = np.isin(numbers, _beside(plots, near, faster_than=_URBAN))
    plots = plots[numbers]
    plots[is_alone] = shapely.buffer(plots[is_alone], -_APART, join_style="mitre")
    whole = (shapely.get_type_id(plots) == shapely.GeometryType.POLYGON) & (shapely.area(plots) > _SMALLEST)
    return plots[whole], is_alone[whole]


def _beside(plots: Shapes, near: Vicinity, *, faster_than: float) -> Ints:
    """List the plots along roads that are faster than a speed, m/s."""
    fast = [lane for lane in near.road_map.lanes if lane.speed > faster_than and lane.kind not in _NOT_ROAD]
    return np.unique(shapely.STRtree(lane_strips(fast)).query(plots, "dwithin", distance=_BESIDE)[0])


def _cuts(ring: Floats) -> Iterator[Floats]:
    """Draw lines (2, 2) across the band inside a closed ring (n, 2), whose inside is on the left.

    Houses at sharp corners reach around them; between corners the edge is divided into uneven widths.
    """
    step = np.diff(ring, axis=0)
    ahead = step / np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    bends = np.flatnonzero((ahead * np.roll(ahead, 1, axis=0)).sum(axis=1) < _SHARP)
    if len(bends):
        ring = np.vstack([ring[bends[0] : -1], ring[: bends[0] + 1]])
        ahead = np.roll(ahead, -bends[0], axis=0)
    length = along(ring)
    corners = [*length[bends - bends[0]], length[-1]] if len(bends) else [0.0, length[-1]]
    for start, end in pairwise(corners):
        margin = _DEPTH + 1.0 if len(bends) else 0.0
        width = end - start - 2 * margin
        if width <= 0.0:
            continue
        count = max(1, round(width / _HOUSE))
        where = np.round(ring[np.searchsorted(length, start + 1e-6) - 1], 1)
        shares = [1.0 + _UNEVEN * (2 * chance("width", *where, k) - 1) for k in range(count)]
        places = start + margin + width * np.append(0.0, np.cumsum(shares) / sum(shares))
        edge = np.clip(np.searchsorted(length, places, side="right") - 1, 0, len(ahead) - 1)
        spots = np.column_stack([np.interp(places, length, axis) for axis in ring.T])
        inward = np.column_stack([-ahead[edge, 1], ahead[edge, 0]])
        yield from np.stack([spots - 0.5 * inward, spots + (_DEPTH + 0.5) * inward], axis=1)


def _floors(block: shapely.Geometry, plot: shapely.Geometry, *, is_alone: bool) -> int:
    """Choose how high a house is: much like its neighbours."""
    if is_alone:
        return 1 + (chance("floors", _name(plot)) < 0.8)
    usual = 3 + int(2.99 * chance("floors", _name(block)))
    return min(6, max(3, usual + int(3 * chance("floors", _name(plot))) - 1))


def _house(outline: Points, *, front: Floats, floors: int, may_have_gables: bool) -> Prop:
    name = f"generated:house:{outline[0, 0]:.1f}:{outline[0, 1]:.1f}"
    tags = [
        GENERATED,
        ("building", "apartments" if floors > 2 else "house"),
        ("building:levels", str(floors)),
    ]
    height = _FLOOR * floors + _PARAPET
    if may_have_gables and (floors < 3 or chance("roof", name) < _GABLED):
        roof = round(2.6 + 1.4 * chance("ridge", name), 1)
        height += roof
        compass = round(float(np.degrees(np.arctan2(*front)))) % 360
        tags += [("roof:shape", "gabled"), ("roof:direction", str(compass)), ("roof:height", str(roof))]
    return Prop(id=name, kind="building", height=round(height, 2), polygon=outline, tags=tuple(tags))


def _name(shape: shapely.Geometry) -> str:
    """Name a shape by where it begins."""
    x, y = shapely.get_coordinates(shape)[0]
    return f"{x:.1f}:{y:.1f}"


def _without_holes(area: shapely.Polygon) -> Iterator[shapely.Polygon]:
    """Divide an area with holes in halves, until none has one."""
    if not len(area.interiors):
        yield area
        return
    low_x, low_y, high_x, high_y = area.bounds
    middle = area.interiors[0].centroid.x
    for half in (shapely.box(low_x, low_y, middle, high_y), shapely.box(middle, low_y, high_x, high_y)):
        for part in flat_polygons(np.array([shapely.intersection(area, half, grid_size=GRID)]))[0]:
            yield from _without_holes(part)
