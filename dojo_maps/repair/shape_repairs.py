"""Repairs of drawn lines: torn ends put together, repeated points left out, pavement kept off roads."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from dojo_maps.description import Connection, Lane
from dojo_maps.geometry.polylines import Floats
from dojo_maps.issue import Element, Issue
from dojo_maps.repair.edits import Edit, SetAttributes, Site, named
from dojo_maps.sources.osm.network.junction_outlines import untwist
from dojo_maps.validation.facts import Facts
from dojo_maps.wording import counted

_TINY = 2.0
"""Metres: a wider gap is no slip of a pen, and somebody has to look at it."""
_AGREES = 0.02
_STEP, _STRIDE = 0.05, 0.25
"""Metres by which pavement is narrowed, or moved, at a time."""
_FARTHEST = 4.0
"""Metres; pavement that lies farther off belongs to something else."""


def close_gaps(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Put a lane's end where all its ways meet, if they agree, and else draw the ways from end to end.

    Args:
        site: the network as it is.
        issues: with the connections that are torn.

    Yields:
        An edit for each lane whose end moves, then one for each connection whose way is drawn anew; none for
        gaps too wide to be a slip.
    """
    torn = [
        site.facts.connections[id_] for id_ in named(issues, "connection") if id_ in site.facts.connections
    ]
    moved: dict[tuple[str, int], str] = {}
    for connection in torn:
        for lane, end in ((connection.from_lane, -1), (connection.to_lane, 0)):
            place = None if (lane, end) in moved else _agreed_place(site, lane, end)
            if place is not None:
                moved[lane, end] = place
    for (lane, end), place in moved.items():
        shape = _tokens(site, lane)
        shape[end] = place
        yield _reshape("lane", lane, lane, shape, f"its {'end' if end else 'start'} moved to {place}")
    for connection in torn:
        yield from _draw_through(site, connection, moved)


def _agreed_place(site: Site, lane: str, end: int) -> str | None:
    """Find the one place where all ways of a lane begin or end, near the lane's end but not on it."""
    ways = (site.facts.leaving if end else site.facts.entering)[lane]
    places = {_tokens(site, way.via[0 if end else -1])[0 if end else -1] for way in ways if way.via}
    if len(ways) < 2 or len(places) != 1:
        return None
    place = places.pop()
    return place if _AGREES < _apart(_tokens(site, lane)[end], place) <= _TINY else None


def _draw_through(site: Site, connection: Connection, moved: dict[tuple[str, int], str]) -> Iterator[Edit]:
    start = moved.get((connection.from_lane, -1), _tokens(site, connection.from_lane)[-1])
    last = moved.get((connection.to_lane, 0), _tokens(site, connection.to_lane)[0])
    shapes = {lane: _tokens(site, lane) for lane in connection.via}
    if not shapes or any(len(shape) < 2 for shape in shapes.values()):
        return
    joints = [start, *(shapes[lane][-1] for lane in connection.via[:-1]), last]
    changes = []
    for lane, before, after in zip(connection.via, joints, joints[1:], strict=False):
        drawn = [before, *shapes[lane][1:-1], after]
        if max(_apart(shapes[lane][0], before), _apart(shapes[lane][-1], after)) > _TINY:
            return
        if drawn != shapes[lane]:
            changes.append(SetAttributes(key=("lane", lane), values=(("shape", " ".join(drawn)),)))
    if changes:
        element = Element(kind="connection", id=connection.id)
        yield Edit(element=element, what="its way drawn from lane to lane", changes=tuple(changes))


def drop_repeated_points(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Leave out points of a lane that lie on the one before; its ends stay.

    Args:
        site: the network as it is; its limits say how close points may lie.
        issues: with the lanes.

    Yields:
        An edit for each lane that has such points.
    """
    for lane in named(issues, "lane"):
        shape = _tokens(site, lane)
        kept = shape[:1]
        for place in shape[1:-1]:
            if min(_apart(kept[-1], place), _apart(place, shape[-1])) >= site.limits.repeated_point:
                kept.append(place)
        kept.append(shape[-1])
        if len(kept) < len(shape):
            yield _reshape(
                "lane", lane, lane, kept, f"{counted(len(shape) - len(kept), 'repeated point')} left out"
            )


def untwist_outlines(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Outline all ground that a junction's crossed outline runs around.

    Args:
        site: the network as it is.
        issues: with the junctions.

    Yields:
        An edit for each junction; none where the outline does not cross itself or encloses next to no ground.
    """
    for id_ in named(issues, "junction"):
        key = ("junction", id_)
        tokens = site.text.elements.get(key, {}).get("shape", "").split()
        widths = {token.count(",") for token in tokens}
        if len(widths) != 1:
            continue
        outline = untwist(np.array([[float(value) for value in token.split(",")] for token in tokens]))
        if outline is not None:
            shape = " ".join(",".join(f"{value:.2f}" for value in corner) for corner in outline)
            change = SetAttributes(key=key, values=(("shape", shape),))
            element = Element(kind="junction", id=id_)
            yield Edit(element=element, what=f"outline of {len(outline)} corners", changes=(change,))


def trim_pavement(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Narrow sidewalks on the side where they lie on the road, and cut the road out of walking areas.

    Args:
        site: the network as it is.
        issues: each with a sidewalk's lane or a walking area, then the lanes that it lies on.

    Yields:
        An edit for each that gets off the road so: sidewalks wide enough and not far from where they were,
        walking areas in one piece.
    """
    facts = site.facts
    for issue in issues:
        fault = issue.elements[0]
        roads = [facts.lanes[e.id] for e in issue.elements[1:] if e.kind == "lane" and e.id in facts.lanes]
        if fault.kind == "lane" and fault.id in facts.lanes:
            yield from _narrow(site, facts.lanes[fault.id], _union(facts, roads))
        elif fault.kind == "walking_area" and fault.id in facts.walking_areas:
            yield from _cut_out(site, fault.id, _union(facts, roads))


def _union(facts: Facts, lanes: Sequence[Lane]) -> shapely.Geometry:
    return shapely.union_all(shapely.set_precision(facts.strips_of(lanes), 0.001))


def _narrow(site: Site, lane: Lane, road: shapely.Geometry) -> Iterator[Edit]:
    """Narrow a sidewalk from the left, the right or both sides, or else move it outwards."""
    middle = shapely.LineString(lane.shape[:, :2] - site.facts.origin[:2])
    for cut in np.arange(_STEP, lane.width - site.limits.sidewalk_width + 1e-9, _STEP):
        for side in (-0.5, 0.5, 0.0):
            moved = _clear_of(site, _shifted(middle, side * cut), lane.width - cut, road)
            if moved is not None:
                width = ("width", f"{lane.width - cut:.2f}")
                yield _redrawn(site, lane, moved, f"{cut:.2f} m narrower, off the road", width)
                return
    outwards = 1 if site.facts.map.left_hand else -1
    for distance in np.arange(_STRIDE, _FARTHEST + 1e-9, _STRIDE):
        moved = _clear_of(site, _shifted(middle, outwards * distance), lane.width, road)
        if moved is not None:
            yield _redrawn(site, lane, moved, f"moved {distance:.2f} m outwards, off the road")
            return


def _shifted(line: shapely.LineString, left: float) -> shapely.Geometry:
    return shapely.offset_curve(line, left, join_style="mitre", mitre_limit=2.0) if left else line


def _clear_of(
    site: Site, line: shapely.Geometry, width: float, road: shapely.Geometry
) -> shapely.LineString | None:
    """Give a line back if a strip along it keeps off the road."""
    if line.geom_type != "LineString" or line.is_empty:
        return None
    strip = line.buffer(width / 2, cap_style="flat", join_style="mitre", mitre_limit=2.0)
    return line if strip.intersection(road).area <= site.limits.pavement_overlap / 2 else None


def _redrawn(site: Site, lane: Lane, line: shapely.LineString, what: str, *more: tuple[str, str]) -> Edit:
    """Draw a lane along a line, at the heights that it has along its own."""
    places = np.array(line.coords)
    steps = (np.linspace(0, 1, len(places)), np.linspace(0, 1, len(lane.shape)))
    places = np.column_stack([places + site.facts.origin[:2], np.interp(*steps, lane.shape[:, 2])])
    flat = not lane.shape[:, 2].any()
    return _reshape("lane", lane.id, lane.id, [_token(place, flat=flat) for place in places], what, more)


def _cut_out(site: Site, area: str, road: shapely.Geometry) -> Iterator[Edit]:
    ring = site.facts.walking_areas[area].polygon
    ground = shapely.make_valid(shapely.Polygon(ring[:, :2] - site.facts.origin[:2]))
    left = shapely.get_parts(shapely.difference(ground, road.buffer(0.01, join_style="mitre")))
    whole = [part for part in left if part.geom_type == "Polygon" and part.area > site.limits.walking_area]
    if len(whole) == 1:
        places = np.array(whole[0].exterior.coords)[:-1] + site.facts.origin[:2]
        flat, height = not ring[:, 2].any(), np.full((len(places), 1), ring[:, 2].mean())
        tokens = [_token(place, flat=flat) for place in np.hstack([places, height])]
        yield _reshape("walking_area", area, f"{area}_0", tokens, "the road cut out of it")


def _reshape(
    kind: str,
    id_: str,
    lane: str,
    shape: Sequence[str],
    what: str,
    more: tuple[tuple[str, str], ...] = (),
) -> Edit:
    change = SetAttributes(key=("lane", lane), values=(("shape", " ".join(shape)), *more))
    return Edit(element=Element(kind=kind, id=id_), what=what, changes=(change,))


def _tokens(site: Site, lane: str) -> list[str]:
    return site.text.elements[("lane", lane)].get("shape", "").split()


def _token(place: Floats, *, flat: bool) -> str:
    return ",".join(f"{value:.2f}" for value in (place[:2] if flat else place))


def _apart(one: str, other: str) -> float:
    (x, y), (u, v) = (tuple(map(float, token.split(",")[:2])) for token in (one, other))
    return math.hypot(x - u, y - v)
