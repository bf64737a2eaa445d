"""Checks of single shapes: broken outlines, sharp bends, slopes, widths and lengths."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Junction, Lane, LaneKind
from dojo_maps.geometry.polylines import Floats, Ints, along
from dojo_maps.validation.check import ERROR, NOTE, WARNING, Finding, check, element
from dojo_maps.validation.facts import Facts, in_a_row, twisted_share
from dojo_maps.validation.profiles import Limits

_STUB = 1.0
"""Metres: bends and slopes over shorter pieces are rounding of coordinates."""
_TRACK, _EDGE = 1.8, 0.1
"""Metres: the width of a car's track, and what is too thin to count."""
_STRAIGHT = 0.9
"""Share of its length that a lane's ends are apart if one can tell its left from its right by them."""


@check(
    id="geometry.junction_invalid",
    code="GEO004",
    title="Outlines of junctions do not cross themselves",
    severity=ERROR,
    limit="no crossing; outlines under 1 m² do not count; error where 1 m² of the ways across is left out",
    source="OGC simple features; autoware_lanelet2_map_validator IntersectionAreaValidity",
    hint="reset the junction's shape in netedit, or delete its custom shape",
)
def check_junction_invalid(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find junctions whose outline crosses itself; nodes that only bend a road have no area and are fine.

    Args:
        facts: of the map.
        limits: `twisted`, a share of the ground, and `junction_lost`, square metres; beyond both it is an
            error.

    Yields:
        A finding for each such junction, with the share of its ground that is twisted.
    """
    junctions = [junction for junction in facts.map.junctions if len(junction.polygon) > 2]
    polygons = [shapely.Polygon(j.polygon[:, :2] - facts.origin[:2]) for j in junctions]
    shapes = np.array(polygons, dtype=object)
    wrong = ~shapely.is_valid(shapes) & (shapely.area(shapely.convex_hull(shapes)) >= 1.0)
    for k in np.flatnonzero(wrong):
        share = twisted_share(shapes[k])
        if share > 0:
            lost = _lost_ground(facts, junctions[k], shapes[k])
            bad = share > limits.twisted and lost > limits.junction_lost
            cost = f" and leaves out {lost:.1f} m² of the ways across" if bad else ""
            yield Finding(
                elements=element("junction", junctions[k].id),
                at=junctions[k].polygon[0],
                message=f"the outline of the junction {junctions[k].id} crosses itself{cost}",
                measured=share,
                limit=0.0,
                severity=ERROR if bad else WARNING,
            )


def _lost_ground(facts: Facts, junction: Junction, outline: shapely.Polygon) -> float:
    """Measure what a crossed outline leaves out of the ground that vehicles drive on, square metres."""
    ways = [
        shapely.linestrings(way.shape[:, :2] - facts.origin[:2])
        for road in junction.incoming
        for lane in facts.lanes_of(road)
        for way in facts.leaving.get(lane.id, ())
        if len(way.shape) > 1
    ]
    lanes = [lane for road in (*junction.incoming, *junction.outgoing) for lane in facts.lanes_of(road)]
    driven = shapely.union_all(shapely.buffer(ways, _TRACK / 2, cap_style="flat"))
    lost = driven.difference(shapely.make_valid(outline)).difference(
        shapely.union_all(facts.strips_of(lanes))
    )
    return float(lost.buffer(-_EDGE).buffer(_EDGE).area)


@check(
    id="geometry.lane_invalid",
    code="GEO005",
    title="Lanes have no repeated points, do not cross themselves and keep their order",
    severity=WARNING,
    limit="points 5 cm apart",
    source="lanelet2_validation PointsTooClose",
    hint="remove the point, or redraw the lane, in netedit; netconvert --geometry.min-dist thins points",
)
def check_lane_invalid(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find lanes with points on one place, lanes that cross themselves, and neighbours that swapped sides.

    Args:
        facts: of the map.
        limits: `repeated_point`, metres between two points, and `drive_width_error`: half of it, metres, is
            how far a lane has to lie on the wrong side.

    Yields:
        A finding for each lane that crosses itself, for the first repeated point of each other lane, and for
        each pair of neighbours that swapped sides.
    """
    lanes = facts.map.lanes
    places, owners = in_a_row([lane.shape for lane in lanes])
    steps = np.hypot(*np.diff(places[:, :2], axis=0).T)
    inner = owners[1:] == owners[:-1]
    twisted = set(
        np.flatnonzero(~shapely.is_simple(shapely.linestrings(places[:, :2], indices=owners))).tolist()
    )
    for k in sorted(twisted):
        if len(np.unique(lanes[k].shape[:, :2], axis=0)) > 1:
            yield _broken(lanes[k], lanes[k].shape[0], f"the lane {lanes[k].id} crosses itself", None, None)
    for place in np.flatnonzero(inner & (steps < limits.repeated_point)):
        k, step = int(owners[place]), float(steps[place])
        if k not in twisted:
            twisted.add(k)
            problem = f"the lane {lanes[k].id} has two points {step * 100:.1f} cm apart"
            yield _broken(lanes[k], places[place], problem, step, limits.repeated_point)
    for road in facts.map.roads:
        if len(road.lanes) > 1:
            yield from _swapped(facts, facts.lanes_of(road.id), limits)


def _broken(lane: Lane, at: Floats, problem: str, measured: float | None, limit: float | None) -> Finding:
    return Finding(elements=element("lane", lane.id), at=at, message=problem, measured=measured, limit=limit)


def _swapped(facts: Facts, lanes: list[Lane], limits: Limits) -> Iterator[Finding]:
    """Find lanes on the wrong side of the next one further out: on its right, where traffic keeps right."""
    for outer, inner in itertools.pairwise(lanes):
        (x0, y0), (x1, y1) = outer.shape[[0, -1], :2].tolist()
        (x2, y2), (x3, y3) = inner.shape[[0, -1], :2].tolist()
        along_x, along_y = x1 - x0, y1 - y0
        length = math.hypot(along_x, along_y)
        if length < _STUB or length < _STRAIGHT * float(along(outer.shape)[-1]):
            continue
        offset_x, offset_y = (x2 + x3 - x0 - x1) / 2, (y2 + y3 - y0 - y1) / 2
        left = (along_x * offset_y - along_y * offset_x) / length
        if (-left if facts.map.left_hand else left) < -limits.drive_width_error / 2:
            yield Finding(
                elements=element("lane", inner.id, outer.id),
                at=inner.shape[0],
                message=f"the lane {inner.id} lies on the outer side of {outer.id}",
            )


@check(
    id="geometry.kink",
    code="GEO006",
    title="Lanes do not bend sharply",
    severity=WARNING,
    limit="99° between two pieces (strict: 60°); streets do turn square corners",
    source="netconvert --geometry.max-angle (99°)",
    hint="smooth the road's shape, or split it at a junction",
)
def check_kink(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find sharp bends inside drivable lanes.

    Args:
        facts: of the map.
        limits: `kink_deg`, degrees.

    Yields:
        A finding for each such lane, at its sharpest bend, with the degrees of that.
    """
    points, angles, _, owners = _bends(facts)
    worst: dict[int, int] = {}
    for k in np.flatnonzero(np.degrees(angles) > limits.kink_deg):
        lane = int(owners[k])
        if lane not in worst or angles[k] > angles[worst[lane]]:
            worst[lane] = int(k)
    for lane, corner in worst.items():
        bend = float(np.degrees(angles[corner]))
        yield Finding(
            elements=element("lane", facts.drivable[lane].id),
            at=points[corner],
            message=f"the lane {facts.drivable[lane].id} bends by {bend:.0f}° at once",
            measured=bend,
            limit=limits.kink_deg,
        )


@check(
    id="geometry.tight_radius",
    code="GEO007",
    title="Roads end without tight turns",
    severity=WARNING,
    limit="9 m",
    source="netconvert --geometry.min-radius",
    hint="netconvert --geometry.min-radius.fix, or move the shape's last point",
)
def check_tight_radius(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find roads whose first or last bend is too tight to drive; the radius is netconvert's own measure.

    Args:
        facts: of the map.
        limits: `radius`, metres.

    Yields:
        A finding for each such road, at the tightest bend of its drivable lanes, with the metres of that.
    """
    points, angles, ends, owners = _bends(facts)
    at_end = ends > 0
    with np.errstate(divide="ignore"):
        radii = np.where(angles > np.radians(1.0), np.tan((np.pi - angles) / 2) * ends, np.inf)
    tightest: dict[str, int] = {}
    for k in np.flatnonzero(at_end & (radii < limits.radius)):
        road = facts.drivable[int(owners[k])].road
        if road not in tightest or radii[k] < radii[tightest[road]]:
            tightest[road] = int(k)
    for road, corner in tightest.items():
        lane = facts.drivable[int(owners[corner])]
        yield Finding(
            elements=(*element("road", road), *element("lane", lane.id)),
            at=points[corner],
            message=f"the road {road} turns with a radius of {radii[corner]:.1f} m at its end",
            measured=float(radii[corner]),
            limit=limits.radius,
        )


def _bends(facts: Facts) -> tuple[Floats, Floats, Floats, Ints]:
    """List every inner corner of drivable lanes.

    Returns:
        Its place (n, 3), how far the lane turns there (n,) in radians, the length of the lane's end piece,
        the shorter one, if it is the first or last corner and else 0, and its lane's place in `drivable`.
    """
    corners, owners = facts.corners
    if len(corners) < 3:
        return np.empty((0, 3)), np.empty(0), np.empty(0), np.empty(0, dtype=np.int64)
    steps = np.diff(corners[:, :2], axis=0)
    lengths = np.hypot(*steps.T)
    inner = (owners[2:] == owners[:-2]) & (lengths[1:] > 0.01) & (lengths[:-1] > 0.01)
    k = np.flatnonzero(inner) + 1
    before, after = steps[k - 1], steps[k]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    angles = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
    counts = np.bincount(owners)
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    last = first[owners[k]] + counts[owners[k]] - 1
    at_first = np.where(k == first[owners[k]] + 1, lengths[k - 1], np.inf)
    at_last = np.where(k == last - 1, lengths[k], np.inf)
    ends = np.minimum(at_first, at_last)
    return corners[k], angles, np.where(np.isfinite(ends), ends, 0.0), owners[k]


@check(
    id="geometry.grade",
    code="GEO009",
    title="Lanes are not too steep",
    severity=WARNING,
    limit="10 %",
    source="netconvert --geometry.max-grade",
    hint="correct the heights, or smooth them with netconvert --geometry.max-grade.fix",
)
def check_grade(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find drivable lanes that are too steep.

    Args:
        facts: of the map; without heights nothing is found.
        limits: `grade`, metres up per metre along.

    Yields:
        A finding for each such lane, where its steepest piece begins, with the slope of that.
    """
    if facts.flat:
        return
    for lane in facts.drivable:
        distance = np.hypot(*np.diff(lane.shape[:, :2], axis=0).T)
        slopes = np.abs(np.diff(lane.shape[:, 2])) / np.maximum(distance, _STUB)
        k = int(slopes.argmax())
        if slopes[k] > limits.grade:
            yield Finding(
                elements=element("lane", lane.id),
                at=lane.shape[k],
                message=f"the lane {lane.id} has a slope of {slopes[k] * 100:.0f} %",
                measured=float(slopes[k]),
                limit=limits.grade,
            )


@check(
    id="geometry.width",
    code="GEO010",
    title="Lanes and crossings have a usable width",
    severity=WARNING,
    limit="drive 2.5 to 4.5 m (error below 1.8), sidewalk 1.2, cycle lane 1.0, crossing 2.0 m",
    source="netconvert --opendrive.min-width (1.8 m) and default widths",
    hint="correct the lane's width",
)
def check_width(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find lanes and crossings that are too narrow for their users, and lanes that are two in truth.

    Args:
        facts: of the map; generated crossings do not count.
        limits: the least `drive_width`, `sidewalk_width`, `cycle_width` and `crossing_width`, the largest
            `drive_width_most`, and `drive_width_error` below which it is an error; metres.

    Yields:
        A finding for each such lane and crossing, with its width, metres.
    """
    least = dict.fromkeys(CARRIAGEWAY, limits.drive_width)
    least |= {LaneKind.SIDEWALK: limits.sidewalk_width, LaneKind.BICYCLE: limits.cycle_width}
    for lane in facts.map.lanes:
        limit, drivable = least.get(lane.kind, 0.0), lane.kind in CARRIAGEWAY
        if drivable and lane.width > limits.drive_width_most:
            limit = limits.drive_width_most
        elif lane.width >= limit:
            continue
        yield Finding(
            elements=element("lane", lane.id),
            at=_middle(lane),
            message=f"the lane {lane.id} for {lane.kind.value} is {lane.width:.2f} m wide",
            measured=lane.width,
            limit=limit,
            severity=ERROR if drivable and lane.width < limits.drive_width_error else WARNING,
        )
    for crossing in facts.crossings.values():
        if crossing.width < limits.crossing_width:
            yield Finding(
                elements=element("crossing", crossing.id),
                at=crossing.shape[0],
                message=f"the crossing {crossing.id} is {crossing.width:.2f} m wide",
                measured=crossing.width,
                limit=limits.crossing_width,
            )


@check(
    id="geometry.length_mismatch",
    code="GEO017",
    title="Lanes are as long as they are drawn",
    severity=NOTE,
    limit="5 % and 1 m",
    source="measured: netconvert changed lanes by up to 23.8 m",
    hint="remove the custom length unless it is meant",
)
def check_length_mismatch(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find roads that SUMO drives at another length than they are drawn with.

    Args:
        facts: of the map.
        limits: `length_difference`, metres, and `length_share`, of the length as drawn; both have to be
            exceeded.

    Yields:
        A finding for the first such lane of each road, with its length as said and, as the limit, as drawn,
        metres.
    """
    seen: set[str] = set()
    for lane in facts.drivable:
        drawn = float(along(lane.shape)[-1])
        apart = abs(drawn - lane.length)
        if apart > limits.length_difference and apart > limits.length_share * drawn and lane.road not in seen:
            seen.add(lane.road)
            yield Finding(
                elements=(*element("lane", lane.id), *element("road", lane.road)),
                at=_middle(lane),
                message=f"the lane {lane.id} is {lane.length:.1f} m long as said, {drawn:.1f} m as drawn",
                measured=lane.length,
                limit=drawn,
            )


def _middle(lane: Lane) -> Floats:
    return lane.shape[len(lane.shape) // 2]
