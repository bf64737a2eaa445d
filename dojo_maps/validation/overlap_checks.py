"""Checks of ground that is claimed twice: lanes on lanes, pavement on lanes, junctions on junctions."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely

from dojo_maps.description import Lane, LaneKind, Points
from dojo_maps.geometry.polylines import Floats, Ints, Shapes
from dojo_maps.validation.check import ERROR, WARNING, Finding, check, element
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import Limits

_Shared = tuple[shapely.Geometry, int, int]
"""Common ground of two lanes, and their places in `drivable`."""
_SINE = 0.5
"""Of 30 degrees, at which strips that cross share twice the product of their widths."""
_SLIVER = 0.05
"""Metres: common ground that is nowhere twice as wide is rounding of coordinates, most of all in bends."""


@check(
    id="geometry.lane_overlap",
    code="GEO001",
    title="Lanes of different roads do not lie on each other",
    severity=WARNING,
    limit="1 m² within 4 m of height; error above 10 m² and 1 m deep; bridges without heights stay warnings",
    source="netconvert --geometry.check-overlap, --geometry.check-overlap.vertical-threshold",
    hint="move the roads apart, join them, or give the bridge its height",
)
def check_lane_overlap(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find drivable lanes of different roads, or lanes that swap sides within one, on the same ground.

    Where two roads meet at a junction their lanes may touch: what lies within 2 m of it does not count.

    Args:
        facts: of the map.
        limits: `overlap`, square metres of two lanes, `level_height` below which they lie on one level, and
            `border` around junctions, metres; `overlap_error`, square metres, and `overlap_depth`, metres,
            from which on it is an error.

    Yields:
        A finding for each pair of roads, with the square metres of all their lanes.
    """
    lanes, strips = facts.drivable, facts.road_strips
    one, other = _pairs(facts.road_tree, strips)
    border = _JunctionBorders(facts, limits.border)
    pairs: dict[tuple[str, str], list[_Shared]] = defaultdict(list)
    shared = shapely.intersection(strips[one], strips[other])
    large = shapely.area(shared) > limits.overlap
    for i, j, common in zip(one[large], other[large], shared[large], strict=True):
        ground = border.cut_off(common, lanes[i], lanes[j])
        if ground.area <= limits.overlap or _is_sliver(ground) or _is_declared(facts, lanes[i], lanes[j]):
            continue
        at = _inside(ground)
        if facts.near_level(lanes[i].shape, lanes[j].shape, at + facts.origin[:2], limits.level_height):
            key = tuple(sorted((lanes[i].road, lanes[j].road)))
            pairs[key[0], key[1]].append((ground, int(i), int(j)))
    for roads, found in pairs.items():
        yield _lane_overlap(facts, limits, roads, found)


def _lane_overlap(facts: Facts, limits: Limits, roads: tuple[str, str], found: list[_Shared]) -> Finding:
    found.sort(key=lambda row: -row[0].area)
    area = sum(row[0].area for row in found)
    strips = shapely.buffer([row[0] for row in found], 0)  # Without the lines that hang on to them.
    depth = 2 * float(shapely.length(shapely.maximum_inscribed_circle(strips, 0.05)).max())
    lanes = dict.fromkeys(facts.drivable[k].id for _, i, j in found for k in (i, j))
    first, second = (facts.drivable[k] for k in found[0][1:])
    one_way = _one_lane_both_ways(facts, first, second)
    bridge = facts.flat and all(_cross(facts, *row) for row in found)
    bad = area > limits.overlap_error and depth > limits.overlap_depth and not one_way and not bridge
    what = f"lie on each other for {area:.1f} m², up to {depth:.1f} m deep"
    if one_way:
        what = "are one strip, driven both ways"
    elif bridge:
        what = f"cross without a junction, {area:.1f} m² on one level: one is a bridge without its height"
    return Finding(
        elements=(*element("lane", *lanes), *element("road", *dict.fromkeys(roads))),
        at=_inside(found[0][0]) + facts.origin[:2],
        message=f"the lanes {first.id} and {second.id} {what}",
        measured=area,
        limit=limits.overlap,
        severity=ERROR if bad else WARNING,
    )


def _cross(facts: Facts, ground: shapely.Geometry, i: int, j: int) -> bool:
    """Tell whether two lanes go over each other at 30 degrees or more, and both go on at either side."""
    lanes = facts.drivable[i], facts.drivable[j]
    lines = [shapely.LineString(lane.shape[:, :2] - facts.origin[:2]) for lane in lanes]
    ends = shapely.MultiPoint([end for line in lines for end in (line.coords[0], line.coords[-1])])
    most = lanes[0].width * lanes[1].width / _SINE
    return bool(lines[0].crosses(lines[1]) and ground.area <= most and ground.distance(ends) > 0)


def _is_declared(facts: Facts, first: Lane, second: Lane) -> bool:
    """Tell whether the network says itself that two lanes share their ground, one for each direction."""
    return facts.roads[first.road].bidi == second.road and facts.roads[second.road].bidi == first.road


def _one_lane_both_ways(facts: Facts, first: Lane, second: Lane) -> bool:
    """Tell whether two lanes are opposite directions drawn on one line, as SUMO does on narrow streets."""
    one, other = facts.roads[first.road], facts.roads[second.road]
    return (one.from_junction, one.to_junction) == (other.to_junction, other.from_junction)


class _JunctionBorders:
    """Takes the surroundings of junctions that two lanes share out of their common ground."""

    def __init__(self, facts: Facts, width: float) -> None:
        self._facts = facts
        self._width = width
        self._areas: dict[str, shapely.Geometry] = {}

    def cut_off(self, ground: shapely.Geometry, one: Lane, other: Lane) -> shapely.Geometry:
        ends = [
            {self._facts.roads[lane.road].from_junction, self._facts.roads[lane.road].to_junction}
            for lane in (one, other)
        ]
        for junction in sorted(ends[0] & ends[1]):
            ground = ground.difference(self._area(junction))
        return ground

    def _area(self, junction: str) -> shapely.Geometry:
        if junction not in self._areas:
            found = self._facts.junctions.get(junction)
            area = shapely.Point()
            if found is not None:
                corners = [*found.polygon[:, :2].tolist(), found.position[:2]]
                polygon = self._facts.polygons_of([found.polygon])[0]
                points = shapely.MultiPoint(np.array(corners) - self._facts.origin[:2])
                area = shapely.union(polygon, points).buffer(self._width)
            self._areas[junction] = area
        return self._areas[junction]


@check(
    id="geometry.sidewalk_on_road",
    code="GEO002",
    title="Pavement does not lie on the carriageway",
    severity=WARNING,
    limit="0.5 m²",
    source="measured: 12,006 m² in one city network",
    hint="move the sidewalk, narrow it or the lanes beside it, or enlarge the junction's radius",
)
def check_sidewalk_on_road(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find sidewalks and walking areas that lie on a carriageway.

    Args:
        facts: of the map; lanes on which people may walk do not count.
        limits: `pavement_overlap`, square metres, and `level_height` below which both lie on one level,
            metres.

    Yields:
        A finding for each sidewalk's lane or walking area, with its square metres on all drivable lanes.
    """
    sidewalks = [lane for lane in facts.map.lanes if lane.kind is LaneKind.SIDEWALK]
    areas = list(facts.walking_areas.values())
    pavement = np.concatenate(
        [facts.strips_of(sidewalks), facts.polygons_of([area.polygon for area in areas])]
    )
    names = [("lane", lane.id) for lane in sidewalks] + [("walking_area", area.id) for area in areas]
    lines = [lane.shape for lane in sidewalks] + [area.polygon for area in areas]
    which, lane = facts.road_tree.query(pavement, predicate="intersects")
    shared = shapely.intersection(pavement[which], facts.road_strips[lane])
    large = (shapely.area(shared) > 0.01) & ~_is_sliver(shared)
    on: dict[int, list[tuple[float, int, Floats]]] = defaultdict(list)
    for k, j, ground in zip(which[large], lane[large], shared[large], strict=True):
        at = _inside(ground)
        if facts.near_level(
            lines[k], facts.drivable[j].shape, at + facts.origin[:2], limits.level_height
        ) and not _is_open(facts.drivable[j]):
            on[int(k)].append((ground.area, int(j), at))
    for k, found in on.items():
        area = sum(row[0] for row in found)
        if area > limits.pavement_overlap:
            found.sort(key=lambda row: -row[0])
            yield Finding(
                elements=(
                    *element(*names[k]),
                    *element("lane", *(facts.drivable[j].id for _, j, _ in found)),
                ),
                at=found[0][2] + facts.origin[:2],
                message=f"{area:.1f} m² of the pavement {names[k][1]} lie on the carriageway",
                measured=area,
                limit=limits.pavement_overlap,
            )


def _is_open(lane: Lane) -> bool:
    """Tell whether people may walk on a lane, so that pavement on it is a matter of drawing only."""
    return "pedestrian" in lane.allow


@check(
    id="geometry.junction_overlap",
    code="GEO003",
    title="Junctions do not lie on each other",
    severity=WARNING,
    limit="1 m² within 4 m of height",
    source="osm2streets: trimmed roads",
    hint="join the junctions in netedit, or with a join of both nodes in a node file",
)
def check_junction_overlap(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find junctions that lie on each other.

    Args:
        facts: of the map.
        limits: `junction_overlap`, square metres, and `level_height` below which both lie on one level,
            metres.

    Yields:
        A finding for each pair of junctions, with the square metres that they share.
    """
    junctions = facts.map.junctions
    polygons = facts.polygons_of([junction.polygon for junction in junctions])
    for i, j, area, at in _overlaps(facts, polygons, [j.polygon for j in junctions], limits):
        yield Finding(
            elements=element("junction", junctions[i].id, junctions[j].id),
            at=at,
            message=f"the junctions {junctions[i].id} and {junctions[j].id} share {area:.1f} m²",
            measured=area,
            limit=limits.junction_overlap,
        )


def _overlaps(
    facts: Facts, polygons: Shapes, lines: Sequence[Points], limits: Limits
) -> Iterator[tuple[int, int, float, Floats]]:
    one, other = _pairs(shapely.STRtree(polygons), polygons)
    shared = shapely.intersection(polygons[one], polygons[other])
    areas = shapely.area(shared)
    for k in np.flatnonzero(areas > limits.junction_overlap):
        i, j = int(one[k]), int(other[k])
        at = _inside(shared[k]) + facts.origin[:2]
        if facts.near_level(lines[i], lines[j], at, limits.level_height):
            yield i, j, float(areas[k]), at


def _pairs(tree: shapely.STRtree, shapes: Shapes) -> tuple[Ints, Ints]:
    """Find each pair of shapes that share ground, once, in order; those that only touch are left out."""
    one, other = tree.query(shapes, predicate="intersects")
    kept = one < other
    one, other = one[kept], other[kept]
    order = np.lexsort((other, one))
    return one[order], other[order]


def _is_sliver(ground: shapely.Geometry | Shapes) -> Any:
    """Tell of common ground, or of each of many, whether it is nowhere wide enough to be seen."""
    return shapely.is_empty(shapely.buffer(ground, -_SLIVER, quad_segs=1))


def _inside(ground: shapely.Geometry) -> Floats:
    return shapely.get_coordinates(shapely.point_on_surface(ground))[0]
