"""Trams, trains and cycle tracks of an import: where they are built, how they pass junctions, who waits."""

import re
from pathlib import Path
from typing import Any

import pytest
import shapely
import sumolib
from networks import run_sumo_tool
from osm_drawings import SIGNAL, Drawing, cross

from dojo_maps.bundle import Bundle
from dojo_maps.conversion import ConvertOptions, convert
from dojo_maps.description import Connection, Junction

STREET = {"highway": "secondary", "lanes": "2"}


def built(drawing: Drawing, folder: Path) -> tuple[Bundle, dict[str, Any]]:
    return convert(
        str(drawing.write(folder / "a.osm")), folder / "a.dojo", ConvertOptions(surroundings=False)
    )


def network(bundle: Bundle) -> Any:
    return sumolib.net.readNet(str(bundle.network))


def edges_for(net: Any, vehicle: str, *, alone: bool = False) -> list[Any]:
    return [e for e in net.getEdges() if e.allows(vehicle) and not (alone and e.allows("passenger"))]


def crossed_by_a_track() -> Drawing:
    """A signalised junction; a cycle track crosses one of its streets there."""
    drawing = cross()
    drawing.ways[0][0].insert(1, drawing.node(-18, 0))
    drawing.way((-18, -60), (-18, 0), (-18, 60), highway="cycleway")
    drawing.node(-18, 0, highway="crossing", crossing="traffic_signals", bicycle="yes")
    return drawing


def cycle_tracks(net: Any) -> list[Any]:
    return [e for e in edges_for(net, "bicycle", alone=True) if e.getType() == "highway.cycleway"]


def track_links(bundle: Bundle) -> list[Connection]:
    kinds = {road.id: road.kind for road in bundle.road_map.roads}
    kind = {lane.id: kinds.get(lane.road) for lane in bundle.road_map.lanes}
    return [
        link
        for link in bundle.road_map.connections
        if {kind[link.from_lane], kind[link.to_lane]} == {"highway.cycleway"}
    ]


def drive(bundle: Bundle, folder: Path, trips: list[tuple[str, str, str]]) -> dict[str, str]:
    """Drive from edge to edge by SUMO's own router; what the simulation counts."""
    types = "".join(f'<vType id="{name}" vClass="{name}"/>' for name in {name for name, _, _ in trips})
    rows = "".join(
        f'<trip id="{k}" type="{name}" depart="{3 * k}" from="{start}" to="{end}"/>'
        for k, (name, start, end) in enumerate(trips)
    )
    (folder / "a.rou.xml").write_text(f"<routes>{types}{rows}</routes>")
    run_sumo_tool(
        *("sumo", "-n", bundle.network, "-r", folder / "a.rou.xml", "--end", "600"),
        *("--collision.check-junctions", "--collision.action", "warn", "--no-step-log"),
        *("--statistic-output", folder / "stat.xml", "--time-to-teleport", "120"),
    )
    found: dict[str, str] = {}
    for record in sumolib.xml.parse(str(folder / "stat.xml"), ["vehicles", "teleports", "safety"]):
        found |= {f"{record.name}.{key}": value for key, value in record.getAttributes()}
    return found


def walk(bundle: Bundle, folder: Path, trips: list[tuple[str, str]]) -> int:
    """Walk from edge to edge by SUMO's own router; how many people arrive in 15 minutes."""
    rows = "".join(
        f'<person id="{k}" depart="{3 * k}"><personTrip from="{start}" to="{end}"/></person>'
        for k, (start, end) in enumerate(trips)
    )
    (folder / "p.rou.xml").write_text(f"<routes>{rows}</routes>")
    run_sumo_tool(
        *("sumo", "-n", bundle.network, "-r", folder / "p.rou.xml", "--end", "900", "--no-step-log"),
        *("--tripinfo-output", folder / "trips.xml"),
    )
    return len(list(sumolib.xml.parse(str(folder / "trips.xml"), ["personinfo"])))


def assert_flows(found: dict[str, str], count: int) -> None:
    assert found["vehicles.inserted"] == str(count)
    assert found["vehicles.running"] == "0"
    assert found["teleports.total"] == "0"
    assert found["safety.collisions"] == "0"


def test_tram_in_the_street_shares_its_inner_lanes(tmp_path: Path) -> None:
    drawing = cross()
    drawing.way((-150, 0), (-12, 0), (0, 0), (12, 0), (150, 0), railway="tram")
    bundle, report = built(drawing, tmp_path)
    net = network(bundle)
    assert {e.getType() for e in edges_for(net, "tram")} == {"highway.secondary"}
    for edge in edges_for(net, "tram"):
        assert [lane.allows("tram") for lane in edge.getLanes()] == [False, False, True]
    assert report["osm"]["track_metres"]["tram"]["share"] == 1.0
    signal = bundle.road_map.signals[0].id
    onward = [
        (c.getFromLane(), c.getToLane())
        for e in edges_for(net, "tram")
        for conns in e.getOutgoing().values()
        for c in conns
        if c.getTLSID() == signal and c.getFromLane().allows("tram") and c.getToLane().allows("tram")
    ]
    assert len(onward) == 2
    trips = [
        (kind, a.getEdge().getID(), b.getEdge().getID()) for kind in ("tram", "passenger") for a, b in onward
    ] * 3
    assert_flows(drive(bundle, tmp_path, trips), len(trips))


def test_tram_beside_the_street_has_tracks_of_its_own_with_signals(tmp_path: Path) -> None:
    drawing = cross()
    drawing.ways[1][0][1:1] = [drawing.node(0, -34), drawing.node(0, -30)]
    northern = drawing.way((150, -30), (0, -30), (-150, -30), railway="tram")
    drawing.way((150, -34), (0, -34), (-150, -34), railway="tram")
    for y in (-30, -34):
        drawing.node(0, y, railway="tram_level_crossing", **SIGNAL)
    bundle, report = built(drawing, tmp_path)
    net = network(bundle)
    own = edges_for(net, "tram", alone=True)
    assert len(own) == 4
    assert {e.getType() for e in own} == {"railway.tram"}
    assert not any(e.allows("pedestrian") for e in own)
    links = [c for e in own for conns in e.getOutgoing().values() for c in conns]
    assert len(links) == 2
    assert all(c.getTLSID() for c in links)
    # Traffic keeps right: the northern track leads west.
    for link in links:
        leads_west = link.getFrom().getShape()[-1][0] < link.getFrom().getShape()[0][0]
        assert leads_west == link.getFrom().getID().startswith(str(northern))
    assert report["osm"]["track_metres"]["tram"]["share"] == 1.0
    assert not [i for i in report["issues"] if i["check"] in ("osm.track_lost", "osm.not_imported")]
    trips = [("tram", c.getFrom().getID(), c.getTo().getID()) for c in links] * 3
    assert_flows(drive(bundle, tmp_path, trips), len(trips))


def test_tram_leaves_the_street_at_a_junction(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), (150, 0), **STREET)
    drawing.way((0, 0), (0, 150), **STREET)
    drawing.way((-150, 0), (0, 0), (40, -15), (150, -60), railway="tram")
    bundle, report = built(drawing, tmp_path)
    net = network(bundle)
    start, end = (
        next(
            e.getID() for e in edges_for(net, "tram") if e.getType() == kind and not e.getID().startswith("-")
        )
        for kind in ("highway.secondary", "railway.tram")
    )
    assert_flows(drive(bundle, tmp_path, [("tram", start, end), ("tram", f"-{end}", f"-{start}")]), 2)
    assert report["osm"]["track_metres"]["tram"]["share"] > 0.95


def test_train_closes_the_road_that_it_crosses(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), (150, 0), **STREET)
    drawing.way((0, -200), (0, 0), (0, 200), railway="rail")
    drawing.node(0, 0, railway="level_crossing")
    bundle, report = built(drawing, tmp_path)
    net = network(bundle)
    (crossing,) = [n for n in net.getNodes() if n.getType() == "rail_crossing"]
    rails = [e for e in crossing.getIncoming() if e.allows("rail")]
    assert len(rails) == 2
    assert all(e.getBidi() is not None for e in rails)
    road = next(e for e in crossing.getIncoming() if e.allows("passenger"))
    onto = next(e for e in road.getOutgoing() if e.getToNode() != road.getFromNode())
    train = rails[0].getOutgoing()
    onward = next(e for e in train if e.getToNode() != rails[0].getFromNode())
    trips = [("rail", rails[0].getID(), onward.getID())]
    trips += [("passenger", road.getID(), onto.getID())] * 5
    assert_flows(drive(bundle, tmp_path, trips), 6)
    walks = [i for i in report["issues"] if i["check"].startswith("pedestrians.")]
    assert not walks


def test_railway_that_meets_no_road_is_told_and_not_built(tmp_path: Path) -> None:
    drawing = cross()
    drawing.way((-150, 60), (150, 60), railway="rail", bridge="yes", layer="1")
    bundle, report = built(drawing, tmp_path)
    assert not edges_for(network(bundle), "rail", alone=True)
    assert report["osm"]["metres_not_imported"] == {"railway=rail": 301}


def test_cyclists_wait_before_junctions_not_in_them(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), (150, 0), **STREET)
    drawing.way((0, -60), (0, 0), (0, 60), highway="cycleway", foot="designated")
    drawing.node(0, 0, highway="crossing", crossing="traffic_signals", bicycle="yes")
    bundle, report = built(drawing, tmp_path)
    ridden = {e.getID() for e in edges_for(network(bundle), "bicycle", alone=True)}
    lane_road = {lane.id: lane.road for lane in bundle.road_map.lanes}
    links = [c for c in bundle.road_map.connections if lane_road[c.from_lane] in ridden]
    assert len(links) == 2
    assert all(len(link.via) == 1 for link in links)
    assert report["osm"]["crossings"]["share"] == 1.0


def test_cycle_track_crosses_at_the_signal(tmp_path: Path) -> None:
    bundle, report = built(crossed_by_a_track(), tmp_path)
    net = network(bundle)
    tracks = cycle_tracks(net)
    assert len(tracks) == 4
    links = [c for e in tracks for conns in e.getOutgoing().values() for c in conns]
    assert len(links) == 2
    assert {c.getTLSID() for c in links} == {bundle.road_map.signals[0].id}
    assert report["osm"]["track_metres"]["cycleway"]["share"] == 1.0
    assert report["osm"]["crossings"]["share"] == 1.0
    trips = [("bicycle", c.getFrom().getID(), c.getTo().getID()) for c in links] * 3
    assert_flows(drive(bundle, tmp_path, trips), len(trips))


def test_cyclists_do_not_stop_for_who_stands_where_a_track_meets_a_pavement(tmp_path: Path) -> None:
    bundle, _ = built(crossed_by_a_track(), tmp_path)
    tracks = {track.getID() for track in cycle_tracks(network(bundle))}
    links = re.findall(r'<connection from="([^"]+)" to="([^"]+)"', bundle.network.read_text())
    areas = {area for link in links for area in link if re.search(r"_w\d+$", area)}
    crossed = areas & {area for link in links if re.search(r"_c\d+\b", " ".join(link)) for area in link}
    assert len(crossed) > 2
    assert not [(track, area) for track, area in links if track in tracks and area in crossed]
    # People still walk from each track to a pavement, and back.
    joined = {track for area, track in links if area in crossed and track in tracks}
    pavement = min(
        road for area, road in links if area in crossed and not road.startswith(":") and road not in tracks
    )
    walks = [trip for track in sorted(joined) for trip in ((track, pavement), (pavement, track))]
    assert walk(bundle, tmp_path, walks) == len(walks) > 2


def walkers_of(bundle: Bundle, edges: set[str]) -> set[str]:
    """List the lanes of edges that people get onto or off."""
    lanes = {lane.id for lane in bundle.road_map.lanes if lane.road in edges}
    return lanes & {end for walk in bundle.road_map.walks for end in (walk.from_id, walk.to_id)}


@pytest.mark.parametrize(("foot", "walked"), [("designated", True), ("no", False)])
def test_people_walk_on_cycle_tracks_where_they_may(tmp_path: Path, foot: str, walked: bool) -> None:
    drawing = crossed_by_a_track()
    drawing.ways[2][1]["foot"] = foot
    bundle, report = built(drawing, tmp_path)
    net = network(bundle)
    tracks = cycle_tracks(net)
    assert {track.allows("pedestrian") for track in tracks} == {walked}
    assert bool(walkers_of(bundle, {track.getID() for track in tracks})) is walked
    inside = re.findall(r'<lane id=":[^"]*"[^>]* allow="([^"]*bicycle)"', bundle.network.read_text())
    assert set(inside) == {"pedestrian bicycle" if walked else "bicycle"}
    assert report["osm"]["track_metres"]["cycleway"]["share"] == 1.0
    assert report["osm"]["crossings"]["share"] == 1.0
    assert not [issue for issue in report["issues"] if issue["check"] == "pedestrians.walk_components"]


@pytest.mark.parametrize("segregated", ["yes", "no"])
def test_people_walk_on_the_pavement_beside_a_segregated_track(tmp_path: Path, segregated: str) -> None:
    drawing = Drawing()
    tags = {"highway": "cycleway", "foot": "designated", "segregated": segregated}
    drawing.way((-150, 0), (0, 0), (150, 0), sidewalk="both", **STREET)
    drawing.way((0, 0), (0, 150), sidewalk="both", **STREET)
    drawing.way((-150, -8), (0, -8), (150, -8), **tags)
    drawing.way((0, -8), (0, 0), **tags)
    drawing.way((0, 150), (0, 300), **tags)
    bundle, _ = built(drawing, tmp_path)
    tracks = cycle_tracks(network(bundle))
    walked = {track.getID().lstrip("-").split("#")[0]: track.allows("pedestrian") for track in tracks}
    assert walked["1003"] is (segregated == "no")
    assert walked["1005"]


def test_bicycles_ride_around_the_corner_where_the_track_is_mapped(tmp_path: Path) -> None:
    drawing = cross()
    drawing.way((-80, -12), (0, -12), (12, -12), (12, 0), (12, 80), highway="cycleway")
    bundle, _ = built(drawing, tmp_path)
    links = track_links(bundle)
    assert len(links) == 2
    (signal,) = bundle.road_map.signals
    middle = next(j for j in bundle.road_map.junctions if j.id == signal.id).position
    corner = shapely.Point(middle[0] + 12, middle[1] - 12)
    assert max(shapely.LineString(link.shape[:, :2]).distance(corner) for link in links) < 2.0
    road = {lane.id: lane.road for lane in bundle.road_map.lanes}
    trips = [("bicycle", road[link.from_lane], road[link.to_lane]) for link in links] * 3
    assert_flows(drive(bundle, tmp_path, trips), len(trips))


def test_cyclists_who_meet_inside_a_junction_are_a_lane_apart(tmp_path: Path) -> None:
    drawing = cross()
    drawing.way((-80, -12), (0, -12), (12, -12), highway="cycleway")
    drawing.way((12, -12), (12, 0), (12, 80), highway="cycleway")
    drawing.way((12, -12), (80, -12), highway="cycleway", oneway="yes")
    bundle, _ = built(drawing, tmp_path)
    road = {lane.id: lane.road for lane in bundle.road_map.lanes}
    ways = {
        (road[link.from_lane][:5], road[link.to_lane][:5]): shapely.LineString(link.shape[:, :2])
        for link in track_links(bundle)
    }
    for onto in ("-1003", "1005#"):
        middle = ways["-1004", onto].interpolate(0.5, normalized=True)
        assert middle.distance(ways["1003#", "1004#"]) == pytest.approx(1.5, abs=0.1)


def test_bicycles_take_the_shortest_way_where_a_track_leads_all_around(tmp_path: Path) -> None:
    ring = [(-12, -12), (0, -12), (12, -12), (12, 0), (12, 12), (0, 12), (-12, 12), (-12, 0), (-12, -12)]
    drawing = cross()
    drawing.way(*ring, highway="cycleway")
    for corner in (-12, 12):
        drawing.way((corner, -12), (5 * corner, -30), highway="cycleway")
    bundle, _ = built(drawing, tmp_path)
    links = track_links(bundle)
    assert len(links) == 2
    assert max(shapely.LineString(link.shape[:, :2]).length for link in links) < 40


def waiting_in_a_circle(junction: Junction) -> set[int]:
    left = {number: set(way.response) for number, way in enumerate(junction.right_of_way)}
    while free := [way for way, others in left.items() if not others & left.keys()]:
        for way in free:
            del left[way]
    return set(left)


@pytest.mark.parametrize("ends", [[(0, 60), (0, -60), (60, -30)], [(0, 60), (0, -60), (60, 30)]])
def test_nobody_waits_in_a_circle_where_tracks_meet_at_a_road(
    tmp_path: Path, ends: list[tuple[float, float]]
) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), (150, 0), highway="unclassified")
    for end in ends:
        drawing.way((0, 0), end, highway="cycleway")
    bundle, _ = built(drawing, tmp_path)
    assert not any(waiting_in_a_circle(junction) for junction in bundle.road_map.junctions)
    ways = [way for junction in bundle.road_map.junctions for way in junction.right_of_way]
    assert all(set(way.response) <= set(way.foes) for way in ways)
    tracks = [e for e in network(bundle).getEdges() if e.getType() == "highway.cycleway"]
    trips = [("bicycle", e.getID(), onto.getID()) for e in tracks for onto in e.getOutgoing()] * 5
    assert_flows(drive(bundle, tmp_path, trips), len(trips))


def test_turning_cars_that_wait_inside_a_junction_look_for_cyclists(tmp_path: Path) -> None:
    bundle, _ = built(crossed_by_a_track(), tmp_path)
    cycled = {link.id for link in track_links(bundle)}
    (signal,) = [junction for junction in bundle.road_map.junctions if junction.kind == "traffic_light"]
    turns = {number for number, way in enumerate(signal.right_of_way) if way.cont}
    ridden = [(number, way) for number, way in enumerate(signal.right_of_way) if way.link in cycled]
    assert len([foe for _, way in ridden for foe in way.foes if foe in turns]) > 1
    for number, way in ridden:
        assert not turns & {*way.response}
        assert all(number in signal.right_of_way[foe].response for foe in turns & {*way.foes})


@pytest.mark.parametrize("drive", ["left", "right"])
def test_who_turns_to_the_outer_side_over_a_track_waits_before_the_junction(
    tmp_path: Path, drive: str
) -> None:
    source = crossed_by_a_track().write(tmp_path / "a.osm")
    bundle, _ = convert(str(source), tmp_path / "a.dojo", ConvertOptions(surroundings=False, drive=drive))
    cycled = {link.id for link in track_links(bundle)}
    ways = {c.id: shapely.LineString(c.shape[:, :2]) for c in bundle.road_map.connections}
    crossing = [
        c
        for c in bundle.road_map.connections
        if c.id not in cycled and any(ways[c.id].crosses(ways[track]) for track in cycled)
    ]
    outer, inner = ("r", "l") if drive == "right" else ("l", "r")
    waits = {side: {len(c.via) for c in crossing if c.direction == side} for side in (outer, inner)}
    assert waits == {outer: {1}, inner: {2}}


def test_track_without_room_between_two_junctions_is_part_of_one(tmp_path: Path) -> None:
    drawing = cross()
    drawing.way((-80, -12), (0, -12), (12, -12), (12, 0), (12, 12), (12, 17), highway="cycleway")
    drawing.way((12, 17), (12, 100), highway="cycleway", width="4")
    drawing.way((12, 17), (18, 11), (60, 15), highway="cycleway", width="4")
    bundle, report = built(drawing, tmp_path)
    tracks = [e for e in network(bundle).getEdges() if e.getType() == "highway.cycleway"]
    assert len(tracks) == 6
    assert min(track.getLength() for track in tracks) > 3.0
    assert report["osm"]["track_metres"]["cycleway"]["share"] > 0.98
    trips = [("bicycle", e.getID(), onto.getID()) for e in tracks for onto in e.getOutgoing()]
    assert len(trips) == 6
    assert_flows(drive(bundle, tmp_path, trips), len(trips))


@pytest.mark.parametrize("tags", [{"highway": "cycleway"}, {"highway": "path", "bicycle": "designated"}])
def test_cycle_track_joins_the_road_where_it_ends(tmp_path: Path, tags: dict[str, str]) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), (150, 0), **STREET)
    drawing.way((0, 0), (0, 80), **tags)
    bundle, _ = built(drawing, tmp_path)
    net = network(bundle)
    (away,) = [e for e in net.getEdges() if e.getType() == "highway.cycleway" and e.getOutgoing() == {}]
    roads = [e for e in net.getEdges() if e.allows("passenger")]
    start = next(e for e in roads if away in e.getOutgoing())
    back = next(e for e in net.getEdges() if e.getType() == "highway.cycleway" and e is not away)
    assert back.getOutgoing()
    end = next(e for e in roads if e in back.getOutgoing())
    trips = [("bicycle", start.getID(), away.getID()), ("bicycle", back.getID(), end.getID())]
    assert_flows(drive(bundle, tmp_path, trips), 2)


def test_one_way_cycle_track_is_one_edge(tmp_path: Path) -> None:
    drawing = cross()
    drawing.way((-100, 40), (-20, 40), highway="cycleway", oneway="yes", width="2.2")
    bundle, _ = built(drawing, tmp_path)
    (track,) = [e for e in network(bundle).getEdges() if e.getType() == "highway.cycleway"]
    assert track.getLanes()[0].getWidth() == pytest.approx(2.2)


def test_lanes_are_counted_by_kind(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (150, 0), cycleway__right="lane", **STREET)
    lanes = built(drawing, tmp_path)[1]["osm"]["lane_metres"]
    assert lanes["bicycle"] == {"kept": 301, "of": 301, "share": 1.0}
    assert lanes["driving"]["of"] == 601


@pytest.mark.parametrize(
    ("tags", "widths"),
    [
        ({"parking__right": "lane", "parking__right__orientation": "diagonal"}, (4.3, 0)),
        ({"parking__both": "lane", "parking__left__width": "7 ft"}, (2.0, 2.13)),
        ({"parking__left": "half_on_kerb", "parking__right": "no"}, (0, 1.0)),
        ({"parking__lane__both": "perpendicular"}, (5.0, 5.0)),
    ],
)
def test_parked_cars_have_their_width(
    tmp_path: Path, tags: dict[str, str], widths: tuple[float, float]
) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), **STREET, **tags)
    drawing.way((0, 0), (150, 0), highway="secondary", lanes="2")
    bundle, report = built(drawing, tmp_path)
    net = network(bundle)
    for name, width in zip(("1001#0", "-1001#0"), widths, strict=True):
        parking = [lane for lane in net.getEdge(name).getLanes() if not lane.getPermissions()]
        assert [lane.getWidth() for lane in parking] == ([pytest.approx(width, abs=0.01)] if width else [])
    assert report["counts"]["error"] == 0
    assert_flows(
        drive(bundle, tmp_path, [("passenger", "1001#0", "1002#0"), ("bicycle", "-1002#0", "-1001#0")]), 2
    )


@pytest.mark.parametrize(("parked_to", "crossed_at"), [(-14, -6), (-18, -9), (-40, -9)])
def test_crossing_between_a_junction_and_parked_cars_is_built(
    tmp_path: Path, parked_to: float, crossed_at: float
) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (parked_to, 0), parking__both="lane", **STREET)
    drawing.way((parked_to, 0), (crossed_at, 0), (0, 0), (150, 0), **STREET)
    drawing.way((0, -100), (0, 0), (0, 100), **STREET)
    drawing.node(crossed_at, 0, highway="crossing", crossing="marked")
    bundle, report = built(drawing, tmp_path)
    assert report["osm"]["crossings"]["share"] == 1.0
    assert len(bundle.road_map.roads) == (8 if parked_to > -30 else 10)
