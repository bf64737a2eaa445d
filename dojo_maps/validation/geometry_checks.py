"""Checks of how shapes fit together: joints, short pieces, offsets, crossings, opposite turns, meshes."""

import math
from collections import defaultdict
from collections.abc import Iterator

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Connection, Crossing, Lane
from dojo_maps.geometry.pieces import RAISED
from dojo_maps.geometry.polylines import Floats
from dojo_maps.issue import Element, Severity
from dojo_maps.meshes.mesh import Mesh, is_watertight
from dojo_maps.validation.check import ERROR, NOTE, WARNING, Finding, Need, check, element
from dojo_maps.validation.facts import Facts, direction
from dojo_maps.validation.profiles import Limits
from dojo_maps.wording import counted

_KINDS = {"walking_area": "walking_area", "sidewalk": "sidewalk", "island": "prop"}


@check(
    id="geometry.gap",
    code="GEO008",
    title="Ways across junctions join their lanes",
    severity=WARNING,
    limit="0.1 m along the lane, half its width beside it; error above 0.5 m",
    source="ASAM OpenDRIVE contact_point_no_horizontal_gaps; CommonRoad potential connection",
    hint="rebuild the network with netconvert, which draws the way anew, or move the lane's end back",
)
def check_gap(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find ways across junctions that do not begin where their lane ends, or end where the next begins.

    A way may begin or end beside the middle of its lane, as bicycles ride at the side of a wide one: what
    counts there is the distance along the lane.

    Args:
        facts: of the map.
        limits: `gap`, and `gap_error` from which on it is an error; metres.

    Yields:
        A finding for each torn way, at its widest gap, with the metres of that.
    """
    told = "is torn by {:.2f} m"
    for connection in facts.map.connections:
        steps = [across for across, _ in connection.joints]
        if max(steps, default=0.0) > limits.gap:
            if steps[0] > limits.gap:
                steps[0] = _gap(facts.lanes[connection.from_lane], connection.shape[:2], at_end=True)
            if steps[-1] > limits.gap:
                steps[-1] = _gap(facts.lanes[connection.to_lane], connection.shape[:-3:-1], at_end=False)
            yield from _find_joint(facts, connection, steps, limits.gap, told, bad=limits.gap_error)


def _gap(lane: Lane, step: Floats, *, at_end: bool) -> float:
    """Measure the gap at a lane's end or start, metres.

    Args:
        lane: what a way leads from or to.
        step: (2, 3), metres, the lane's end or start, then the way's.
        at_end: it is the lane's end.
    """
    x, y = (step[1] - step[0])[:2].tolist()
    shape = lane.shape if at_end else lane.shape[::-1]
    ahead = direction(shape[::-1]).tolist()
    length = math.hypot(*ahead)
    if length == 0 or abs(ahead[0] * y - ahead[1] * x) / length > lane.width / 2:
        return math.hypot(x, y)
    return abs(ahead[0] * x + ahead[1] * y) / length


@check(
    id="geometry.z_jump",
    code="GEO009",
    title="Ways across junctions do not jump in height",
    severity=WARNING,
    limit="0.1 m",
    source="autoware_lanelet2_map_validator",
    hint="give the ends of both lanes the junction's height",
)
def check_z_jump(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find steps in the height of ways across junctions.

    Args:
        facts: of the map.
        limits: `z_jump`, metres.

    Yields:
        A finding for each such way, at its highest step, with the metres of that.
    """
    for connection in facts.map.connections:
        steps = [up for _, up in connection.joints]
        yield from _find_joint(facts, connection, steps, limits.z_jump, "jumps by {:.2f} m in height")


def _find_joint(
    facts: Facts,
    connection: Connection,
    steps: list[float],
    limit: float,
    told: str,
    *,
    bad: float = math.inf,
) -> Iterator[Finding]:
    """Find a connection's worst joint beyond a limit."""
    worst = max(steps, default=0.0)
    if worst > limit:
        place = steps.index(worst)
        yield Finding(
            elements=_way(connection, to_first=place > 0),
            at=_joint_place(facts, connection, place),
            message=f"the connection {connection.id} {told.format(worst)}",
            measured=worst,
            limit=limit,
            severity=ERROR if worst > bad else WARNING,
        )


def _way(connection: Connection, *, to_first: bool) -> tuple[Element, ...]:
    lanes = (connection.from_lane, connection.to_lane)
    return (
        *element("connection", connection.id),
        *element("lane", *(reversed(lanes) if to_first else lanes)),
    )


def _joint_place(facts: Facts, connection: Connection, place: int) -> Floats:
    if place == 0:
        return facts.lanes[connection.from_lane].shape[-1]
    if place == len(connection.joints) - 1:
        return facts.lanes[connection.to_lane].shape[0]
    return connection.shape[len(connection.shape) // 2]


@check(
    id="geometry.short_edge",
    code="GEO011",
    title="Roads can hold a vehicle, and before a signal a queue",
    severity=WARNING,
    limit="5 m; 15 m before a signal",
    source="SUMO netcheck.py --short-tls-edges",
    hint="join the junctions at both ends",
)
def check_short_edge(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find roads too short to hold a car, or, before a signal, three.

    Stubs at the map's edge are fine, unless they lead to a signal.

    Args:
        facts: of the map; roads without a lane for cars or buses do not count.
        limits: `road_length`, and `signal_road_length` before a signal; metres.

    Yields:
        A finding for each such road, with the length of its shortest lane for cars or buses, metres.
    """
    for road in facts.map.roads:
        lanes = [lane for lane in facts.lanes_of(road.id) if lane.kind in CARRIAGEWAY]
        if not lanes:
            continue
        signal = facts.kind(road.to_junction).startswith("traffic_light")
        limit = limits.signal_road_length if signal else limits.road_length
        length = min(lane.length for lane in lanes)
        inside = min(facts.legs(road.from_junction), facts.legs(road.to_junction)) > 1
        if length < limit and (inside or signal):
            where = " before a signal" if signal else ""
            yield Finding(
                elements=element("road", road.id),
                at=lanes[0].shape[len(lanes[0].shape) // 2],
                message=f"the road {road.id}{where} is {length:.1f} m long",
                measured=length,
                limit=limit,
            )


@check(
    id="geometry.short_connection",
    code="GEO012",
    title="Ways across junctions have a length",
    severity=NOTE,
    limit="1 m",
    source="netconvert: Connection only %m short",
    hint="increase the junction's radius, or join the roads",
)
def check_short_connection(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find ways across junctions that are hardly there.

    Args:
        facts: of the map; ways without an internal lane and those out of other than cars' and buses' lanes do
            not count.
        limits: `connection_length`, metres.

    Yields:
        A finding for each such way, with its length without gaps, metres.
    """
    for k in np.flatnonzero(facts.way_lengths < limits.connection_length):
        connection, length = facts.map.connections[k], float(facts.way_lengths[k])
        if connection.via and facts.lanes[connection.from_lane].kind in CARRIAGEWAY:
            yield Finding(
                elements=_way(connection, to_first=False),
                at=connection.shape[0],
                message=f"the connection {connection.id} is {length:.2f} m long",
                measured=length,
                limit=limits.connection_length,
            )


@check(
    id="geometry.node_offset",
    code="GEO013",
    title="Junctions are drawn where they are",
    severity=WARNING,
    limit="20 m",
    source="netconvert --geometry.junction-mismatch-threshold",
    hint="move the node, or reset the junction's custom shape",
)
def check_node_offset(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find junctions that are drawn far from where they are said to be.

    Args:
        facts: of the map.
        limits: `node_offset`, metres from the outline to the position.

    Yields:
        A finding for each such junction whose position lies outside its outline, with the metres between.
    """
    junctions = [j for j in facts.map.junctions if len(j.polygon) > 0]
    if not junctions:
        return
    lines = np.array([shapely.linestrings(j.polygon[[*range(len(j.polygon)), 0], :2]) for j in junctions])
    nodes = shapely.points([j.position[:2] for j in junctions])
    distances = shapely.distance(lines, nodes)
    for k in np.flatnonzero(distances > limits.node_offset):
        junction = junctions[k]
        if len(junction.polygon) > 2 and facts.polygons_of([junction.polygon])[0].contains(
            shapely.Point(np.array(junction.position[:2]) - facts.origin[:2])
        ):
            continue
        yield Finding(
            elements=element("junction", junction.id),
            at=junction.polygon[0],
            message=f"the junction {junction.id} is drawn {distances[k]:.1f} m from its node",
            measured=float(distances[k]),
            limit=limits.node_offset,
        )


@check(
    id="geometry.crossing_off_road",
    code="GEO014",
    title="Crossings cross the roads they name",
    severity=ERROR,
    limit="one lane, carried on 15 m into the junction",
    source="autoware_lanelet2_map_validator Crosswalk",
    hint="delete the crossing's custom shape, or correct its roads",
)
def check_crossing_off_road(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find crossings that cross none of the lanes of the roads they name, carried on into the junction.

    Args:
        facts: of the map; generated crossings do not count, nor do roads that it does not have.
        limits: `crossing_reach`, metres by which lanes are carried on.

    Yields:
        A finding for each such crossing, with the metres to the nearest of those lanes.
    """
    for crossing in facts.crossings.values():
        lanes = [lane for road in crossing.roads if road in facts.roads for lane in facts.lanes_of(road)]
        line = shapely.linestrings(crossing.shape[:, :2])
        apart = [_distance(facts, crossing, line, lane, limits.crossing_reach) for lane in lanes]
        if lanes and min(apart) > 0:
            yield Finding(
                elements=(*element("crossing", crossing.id), *element("road", *crossing.roads)),
                at=crossing.shape[len(crossing.shape) // 2],
                message=f"the crossing {crossing.id} crosses no lane of {', '.join(crossing.roads)}",
                measured=min(apart),
                limit=0.0,
            )


def _distance(facts: Facts, crossing: Crossing, line: shapely.Geometry, lane: Lane, reach: float) -> float:
    """Measure from a crossing's line to a lane that is carried on into the junction."""
    at_end = facts.roads[lane.road].to_junction == crossing.junction
    shape = lane.shape[:, :2] if at_end else lane.shape[::-1, :2]
    step = shape[-1] - shape[-2]
    length = float(np.hypot(*step))
    longer = [*shape, shape[-1] + step / length * reach] if length > 0 else shape
    return float(shapely.linestrings(longer).distance(line))


@check(
    id="geometry.intersecting_lefts",
    code="GEO015",
    title="Opposite turns pass each other",
    severity=WARNING,
    limit="paths do not cross; a note without a signal",
    source="netconvert: Intersecting left turns",
    hint="increase the junction's radius, or give the turns phases of their own",
)
def check_intersecting_lefts(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find opposite turns across traffic whose paths cross, so that neither can go while the other waits.

    At small crossings without signals they often do, and drivers take turns: that is a note.

    Args:
        facts: of the map; right turns count where traffic keeps left.
        _limits: there is none to this check.

    Yields:
        A finding for each pair of roads, where the first of their turns cross.
    """
    turn = "r" if facts.map.left_hand else "l"
    by_junction: dict[str, list[Connection]] = defaultdict(list)
    for connection in facts.map.connections:
        if connection.direction == turn and facts.lanes[connection.from_lane].kind in CARRIAGEWAY:
            by_junction[facts.roads[facts.lanes[connection.from_lane].road].to_junction].append(connection)
    for junction, turns in by_junction.items():
        severity = WARNING if facts.kind(junction).startswith("traffic_light") else NOTE
        seen: set[frozenset[str]] = set()
        for k, one in enumerate(turns):
            for other in turns[k + 1 :]:
                roads = frozenset((facts.lanes[one.from_lane].road, facts.lanes[other.from_lane].road))
                if len(roads) == 2 and roads not in seen and _are_opposite(facts, one, other):
                    crossing = shapely.linestrings(one.shape[:, :2]).intersection(
                        shapely.linestrings(other.shape[:, :2])
                    )
                    if not crossing.is_empty:
                        seen.add(roads)
                        yield _crossing_turns(one, other, crossing, severity)


def _crossing_turns(
    one: Connection, other: Connection, crossing: shapely.Geometry, severity: Severity
) -> Finding:
    return Finding(
        elements=(
            *element("connection", one.id, other.id),
            *element("lane", one.from_lane, one.to_lane, other.from_lane, other.to_lane),
        ),
        at=shapely.get_coordinates(crossing)[0],
        message=f"the opposite turns {one.id} and {other.id} cross each other",
        severity=severity,
    )


def _are_opposite(facts: Facts, one: Connection, other: Connection) -> bool:
    """Tell whether two turns come from opposite sides and neither leads to where the other comes from."""
    for turn, facing in ((one, other), (other, one)):
        left, came = (facts.roads[facts.lanes[lane].road] for lane in (turn.to_lane, facing.from_lane))
        if left.to_junction == came.from_junction:
            return False
    ahead = [
        facts.lanes[c.from_lane].shape[-1, :2] - facts.lanes[c.from_lane].shape[-2, :2] for c in (one, other)
    ]
    lengths = np.hypot(*ahead[0]) * np.hypot(*ahead[1])
    return bool(lengths > 0 and float(ahead[0] @ ahead[1]) / lengths < -0.7)


@check(
    id="geometry.mesh_health",
    code="GEO016",
    title="Raised surfaces are closed, floors face up, faces have area, positions are numbers",
    severity=ERROR,
    limit="every edge shared by two faces",
    source="glTF 2.0, trimesh",
    hint="report this with the network: the converter should never write such a mesh",
    needs=Need.MESHES,
)
def check_mesh_health(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find raised surfaces that are not closed, faces without area, and positions that are not numbers.

    Args:
        facts: of the map, with its meshes; without them nothing is found.
        _limits: there is none to this check.

    Yields:
        A finding for each mesh and problem, at the first face that has it, or the mesh's first.
    """
    for mesh in facts.meshes:
        if not np.isfinite(mesh.vertices).all():
            yield _unhealthy(facts, mesh, 0, "has positions that are not numbers")
            continue
        if mesh.name in RAISED and not is_watertight(mesh):
            yield _unhealthy(facts, mesh, 0, "is not watertight")
        if mesh.name in ("road", "junction", *RAISED):
            yield from _bad_faces(facts, mesh)


def _bad_faces(facts: Facts, mesh: Mesh) -> Iterator[Finding]:
    """Find faces without area, and floors that face down; under a bridge some do, though never most."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    empty, down = ~normals.any(axis=1), normals[:, 2] < 0
    if empty.any():
        yield _unhealthy(
            facts, mesh, int(empty.argmax()), f"has {counted(int(empty.sum()), 'face')} without area"
        )
    if mesh.name not in RAISED and down.sum() > len(down) / 2:
        yield _unhealthy(facts, mesh, int(down.argmax()), "faces down")


def _unhealthy(facts: Facts, mesh: Mesh, face: int, problem: str) -> Finding:
    source = mesh.ids[mesh.sources[face]] if len(mesh.faces) else ""
    at = mesh.vertices[mesh.faces[face, 0]] if len(mesh.faces) else np.zeros(3)
    return Finding(
        elements=element(_KINDS.get(mesh.layer, mesh.layer), source),
        at=np.nan_to_num(at) + facts.origin,
        message=f"the mesh {mesh.name} {problem}",
    )
