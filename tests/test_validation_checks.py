"""Checks on what real networks hardly have: the smallest failing maps, and maps that are fine."""

import re
from dataclasses import replace

import networks
import numpy as np
import pytest

from dojo_maps.description import RoadMap, Signal, points
from dojo_maps.issue import Issue
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.validation.runner import find_issues


def read(name: str) -> RoadMap:
    path = networks.installed_networks()[name]
    data = networks.read_network_bytes(path)
    return read_network(data, path=path, name=name, sha256="")[0]


def issues_of(road_map: RoadMap, check: str) -> list[Issue]:
    return [issue for issue in find_issues(road_map, None, ())[0] if issue.check == check]


@pytest.fixture(scope="module")
def grid() -> RoadMap:
    return read("grid4x4")


def joined(grid: RoadMap) -> RoadMap:
    """Let one signal control the junctions A0 and B0."""
    parts = [signal for signal in grid.signals if signal.id in ("A0", "B0")]
    whole = replace(
        parts[0],
        junctions=tuple(junction for part in parts for junction in part.junctions),
        links=tuple(link for part in parts for link in part.links),
    )
    rest: list[Signal] = [signal for signal in grid.signals if signal not in parts]
    return replace(grid, signals=(*rest, whole))


def test_unreachable_edge_in_tls_names_the_road_that_nothing_enters(grid: RoadMap) -> None:
    road_map = joined(grid)
    assert not issues_of(road_map, "topology.unreachable_edge_in_tls")
    cut = tuple(c for c in road_map.connections if not c.to_lane.startswith("A0B0_"))
    found = issues_of(replace(road_map, connections=cut), "topology.unreachable_edge_in_tls")
    assert [issue.elements[0].id for issue in found] == ["A0B0"]


def lifted(road_map: RoadMap, road: str, height: float) -> RoadMap:
    lanes = tuple(
        replace(lane, shape=points(lane.shape + np.array([0, 0, height]))) if lane.road == road else lane
        for lane in road_map.lanes
    )
    return replace(road_map, lanes=lanes)


def test_lane_overlap_is_silent_when_one_road_is_a_bridge() -> None:
    road_map = read("A10KW-osm")
    bridge = "240042212"
    before = issues_of(road_map, "geometry.lane_overlap")
    assert [i for i in before if ("road", bridge) in {(e.kind, e.id) for e in i.elements}]
    after = issues_of(lifted(road_map, bridge, 6.0), "geometry.lane_overlap")
    assert not [i for i in after if ("road", bridge) in {(e.kind, e.id) for e in i.elements}]


def shifted_way(road_map: RoadMap, along: float, aside: float) -> RoadMap:
    """Move the inside of the first straight way across a junction, ahead and to the left, metres."""
    k = next(k for k, c in enumerate(road_map.connections) if c.id == "A0A1_1->A1A2_1")
    way = road_map.connections[k]
    start, end = way.shape[[0, -1]]
    ahead = (end - start) / np.hypot(*(end - start)[:2])
    shift = along * ahead + aside * np.array([-ahead[1], ahead[0], 0.0])
    gap = (float(np.hypot(along, aside)), 0.0)
    torn = replace(way, shape=points(np.array([start, start + shift, end + shift, end])), joints=(gap, gap))
    return replace(road_map, connections=(*road_map.connections[:k], torn, *road_map.connections[k + 1 :]))


@pytest.mark.parametrize(
    ("along", "aside", "severities"),
    [(0, 1.5, []), (0, -1.5, []), (0.3, 1, ["warning"]), (-0.8, 0, ["error"]), (0, 2, ["error"])],
)
def test_gap_counts_along_the_lane_and_beside_it_from_its_edge(
    grid: RoadMap, along: float, aside: float, severities: list[str]
) -> None:
    found = issues_of(shifted_way(grid, along, aside), "geometry.gap")
    assert [issue.severity for issue in found] == severities


def laid_beside(road_map: RoadMap, lane: str, other: str, apart: float) -> RoadMap:
    """Draw a lane beside another one, `apart` metres to the left of its middle."""
    shape = next(x.shape for x in road_map.lanes if x.id == other)
    ahead = (shape[-1] - shape[0]) / np.hypot(*(shape[-1] - shape[0])[:2])
    moved = points(shape + apart * np.array([-ahead[1], ahead[0], 0.0]))
    lanes = tuple(replace(x, shape=moved) if x.id == lane else x for x in road_map.lanes)
    return replace(road_map, lanes=lanes)


@pytest.mark.parametrize(("depth", "severity"), [(0.5, "warning"), (2.0, "error")])
def test_lane_overlap_is_an_error_where_strips_lie_deep_in_each_other(
    grid: RoadMap, depth: float, severity: str
) -> None:
    outer, far = "A0B0_0", "C2D2_0"
    width = next(x.width for x in grid.lanes if x.id == far)
    found = issues_of(laid_beside(grid, far, outer, depth - width), "geometry.lane_overlap")
    (pair,) = (i for i in found if {"A0B0", "C2D2"} <= {e.id for e in i.elements})
    assert pair.severity == severity
    assert pair.measured
    assert pair.measured > 10


@pytest.mark.parametrize(
    ("degrees", "height", "severity"),
    [(90, 0, "warning"), (40, 0, "warning"), (10, 0, "error"), (90, 1, "error")],
)
def test_lane_overlap_takes_a_crossing_without_heights_for_a_bridge(
    grid: RoadMap, degrees: float, height: float, severity: str
) -> None:
    under, over = (next(x for x in grid.lanes if x.id == name) for name in ("A0B0_0", "C2D2_0"))
    middle = under.shape[[0, -1]].mean(axis=0)
    ahead = (under.shape[-1] - under.shape[0]) / np.hypot(*(under.shape[-1] - under.shape[0])[:2])
    angle = np.radians(degrees)
    turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ ahead[:2]
    line = middle + np.outer([-40.0, 40.0], [*turned, 0.0]) + [0.0, 0.0, height]
    lanes = tuple(replace(x, shape=points(line)) if x.id == over.id else x for x in grid.lanes)
    found = issues_of(replace(grid, lanes=lanes), "geometry.lane_overlap")
    (pair,) = (i for i in found if {"A0B0", "C2D2"} <= {e.id for e in i.elements})
    assert pair.severity == severity
    assert ("bridge" in pair.message) == (severity == "warning")


def test_lane_overlap_is_silent_where_the_network_declares_it(grid: RoadMap) -> None:
    shape = next(x.shape for x in grid.lanes if x.id == "A0B0_1")[::-1]
    lanes = tuple(replace(x, shape=points(shape)) if x.id == "B0A0_1" else x for x in grid.lanes)
    shared = replace(grid, lanes=lanes)
    assert [issue.severity for issue in issues_of(shared, "geometry.lane_overlap")] == ["warning"]
    pair = {"A0B0": "B0A0", "B0A0": "A0B0"}
    roads = tuple(replace(road, bidi=pair.get(road.id)) for road in shared.roads)
    assert not issues_of(replace(shared, roads=roads), "geometry.lane_overlap")


def test_junction_invalid_is_an_error_where_its_ways_lose_ground(grid: RoadMap) -> None:
    junction = next(j for j in grid.junctions if j.id == "B1")
    x, y, z = junction.position
    square = [(x - 14, y - 14), (x + 14, y - 14), (x + 14, y + 14), (x - 14, y + 14)]
    corner = [*square, (x - 24, y + 4), (x - 24, y + 14), (x - 14, y + 4)]
    for ring, severity in (
        (square, []),
        (corner, ["warning"]),
        ([square[k] for k in (0, 2, 1, 3)], ["error"]),
        (square * 2, ["warning"]),
    ):
        polygon = points(np.array([(*place, z) for place in ring]))
        drawn = tuple(replace(j, polygon=polygon) if j is junction else j for j in grid.junctions)
        found = issues_of(replace(grid, junctions=drawn), "geometry.junction_invalid")
        assert [issue.severity for issue in found] == severity


def test_junction_invalid_is_silent_when_the_outline_has_no_area(grid: RoadMap) -> None:
    first, *rest = grid.junctions
    x, y, z = first.position
    line = points(np.array([(x, y, z), (x + 9, y, z), (x + 3, y, z)]))
    flat = replace(grid, junctions=(replace(first, polygon=line), *rest))
    assert not issues_of(flat, "geometry.junction_invalid")


def test_dead_ends_at_the_edge_of_the_map_are_no_defects(grid: RoadMap) -> None:
    edges = [j for j in grid.junctions if j.kind == "dead_end" and j.incoming]
    assert edges
    found = [issue for issue in find_issues(grid, None, ())[0] if issue.check.startswith("topology.")]
    assert not found


def test_lanes_of_both_directions_are_equally_long(grid: RoadMap) -> None:
    def with_opposite(length: float) -> RoadMap:
        pair = {"A0B0_2": {"opposite": "B0A0_2"}, "B0A0_2": {"opposite": "A0B0_2", "length": length}}
        return replace(grid, lanes=tuple(replace(x, **pair.get(x.id, {})) for x in grid.lanes))

    length = next(x.length for x in grid.lanes if x.id == "A0B0_2")
    assert not issues_of(with_opposite(length), "topology.unequal_lengths")
    (issue,) = issues_of(with_opposite(length + 1), "topology.unequal_lengths")
    assert [e.id for e in issue.elements] == ["A0B0_2", "B0A0_2"]


def test_what_sumo_ignores_in_lanes_is_reported() -> None:
    path = networks.installed_networks()["grid4x4"]
    data = networks.read_network_bytes(path).decode()
    odd = re.sub(
        r'(<lane id="A0B0_0"[^>]*?)/?>(</lane>)?',
        r'\1 allow="bus zeppelin"><stopOffset value="1"/><stopOffset value="2"/></lane>',
        data,
        count=1,
    )
    issues = read_network(odd.encode(), path=path, name="odd", sha256="")[1]
    assert [(i.check, i.elements[0].id) for i in issues] == [
        ("topology.unknown_class", "A0B0_0"),
        ("topology.stop_offset_repeated", "A0B0_0"),
    ]
    whole = re.sub(r'(<edge id="A0B0"[^>]*>)', r'\1<stopOffset value="1"/><stopOffset value="2"/>', data)
    assert not read_network(whole.encode(), path=path, name="plain", sha256="")[1]


def test_green_conflict_is_an_error_where_the_ways_of_foes_meet() -> None:
    road_map = read("cologne1")
    (signal,) = road_map.signals
    program = signal.programs[0]
    all_green = replace(program, phases=tuple(replace(p, state="G" * len(p.state)) for p in program.phases))
    unsafe = replace(road_map, signals=(replace(signal, programs=(all_green,)),))
    found = issues_of(unsafe, "signals.green_conflict")
    assert sum(issue.severity == "error" for issue in found) > 10
    assert all(("cross or join" in issue.message) == (issue.severity == "error") for issue in found)
    apart = tuple(
        replace(way, shape=points(way.shape + np.array([1e3 * k, 0.0, 0.0])))
        for k, way in enumerate(unsafe.connections)
    )
    still = issues_of(replace(unsafe, connections=apart), "signals.green_conflict")
    assert {issue.severity for issue in still} == {"warning"}
    assert all("do not meet" in issue.message for issue in still)


def in_turns(grid: RoadMap, *, together: bool) -> RoadMap:
    """Let one signal control A0 and B0, with green for all links of both, or of one after the other."""
    size = {name: sum(c.signal == name for c in grid.connections) for name in ("A0", "B0")}
    shift = {"A0": 0, "B0": size["A0"]}
    connections = tuple(
        replace(c, signal="A0", link_index=(c.link_index or 0) + shift[c.signal]) if c.signal in shift else c
        for c in grid.connections
    )
    signal = next(signal for signal in grid.signals if signal.id == "A0")
    other = next(signal for signal in grid.signals if signal.id == "B0")
    states = ["G" * size["A0"] + ("G" if together else "r") * size["B0"], "r" * size["A0"] + "G" * size["B0"]]
    phases = tuple(replace(signal.programs[0].phases[0], duration=20.0, state=state) for state in states)
    whole = replace(
        signal,
        junctions=("A0", "B0"),
        links=(*signal.links, *(replace(x, index=x.index + shift["B0"]) for x in other.links)),
        programs=(replace(signal.programs[0], phases=phases),),
    )
    rest = [each for each in grid.signals if each.id not in shift]
    lanes = tuple(replace(x, length=6.0) if x.road == "A0B0" else x for x in grid.lanes)
    return replace(grid, lanes=lanes, connections=connections, signals=(*rest, whole))


def test_no_room_names_the_lane_that_is_filled_and_never_emptied_meanwhile(grid: RoadMap) -> None:
    assert not issues_of(in_turns(grid, together=True), "signals.no_room")
    found = issues_of(in_turns(grid, together=False), "signals.no_room")
    lanes = {lane.id for lane in grid.lanes if lane.road == "A0B0"}
    assert {issue.elements[0].id for issue in found} <= lanes
    assert len(found) == sum(c.to_lane in lanes for c in grid.connections)
    assert {issue.measured for issue in found} == {6.0}


def test_walk_before_green_names_the_crossing_before_a_stop_line() -> None:
    road_map = read("hiking")
    check = "pedestrians.walk_before_green"
    assert not issues_of(road_map, check)
    crossing = next(c for c in road_map.crossings if c.signal is not None)
    roads = {lane.id: lane.road for lane in road_map.lanes}
    signal = next(signal for signal in road_map.signals if signal.id == crossing.signal)
    size = len(signal.programs[0].phases[0].state)

    def shown(letter: str, road: str) -> list[Issue]:
        """Show walkers G and the vehicles of a road a letter, and all others red."""
        driving = {
            c.link_index for c in road_map.connections if c.signal == signal.id and roads[c.from_lane] == road
        }
        state = "".join(
            letter if k in driving else "G" if k == crossing.link_index else "r" for k in range(size)
        )
        first, *others = signal.programs[0].phases
        program = replace(signal.programs[0], phases=(replace(first, duration=11.0, state=state), *others))
        changed = replace(signal, programs=(program,))
        return issues_of(
            replace(road_map, signals=tuple(changed if s is signal else s for s in road_map.signals)), check
        )

    controlled = {roads[c.from_lane] for c in road_map.connections if c.signal == signal.id}
    own = next(road for road in crossing.roads if road in controlled)
    found = shown("g", own)
    assert [(issue.elements[0].id, issue.measured) for issue in found] == [(crossing.id, 11.0)]
    assert not shown("r", own)
    for road in controlled - {own}:
        assert not shown("g", road)
