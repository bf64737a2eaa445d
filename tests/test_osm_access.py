"""Which roads and lanes an import builds, and for whom: service roads, barriers, buses, bicycles."""

import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from osm_drawings import HELSINKI, LONDON, SIGNAL, Drawing

from dojo_maps.bundle import Bundle
from dojo_maps.conversion import convert
from dojo_maps.description import LaneKind

MAIN = {"highway": "secondary", "lanes": "2"}


def built(drawing: Drawing, folder: Path) -> tuple[Bundle, dict[str, Any]]:
    return convert(str(drawing.write(folder / "a.osm")), folder / "a.dojo")


def main_road(**middle: str) -> Drawing:
    d = Drawing()
    d.way((-150, 0), (0, 0), (150, 0), **MAIN)
    if middle:
        d.node(0, 0, **middle)
    return d


def ways(bundle: Bundle) -> set[str]:
    return {road.id.lstrip("-").split("#")[0] for road in bundle.road_map.roads}


def test_service_road_at_a_signal_is_an_arm(tmp_path: Path) -> None:
    drawing = main_road(**SIGNAL)
    drawing.way((0, 0), (0, 70), highway="service", lanes="3")
    bundle, report = built(drawing, tmp_path)
    assert "1002" in ways(bundle)
    (signal,) = bundle.road_map.signals
    assert any("1002" in link.from_id for link in signal.links)
    assert report["osm"]["signalised_junctions"]["share"] == 1.0


def test_service_road_elsewhere_is_left_out_and_told(tmp_path: Path) -> None:
    drawing = main_road()
    drawing.way((0, 0), (0, 70), highway="service")
    bundle, report = built(drawing, tmp_path)
    assert ways(bundle) == {"1001"}
    assert report["osm"]["metres_not_imported"] == {"highway=service": 70}


def test_parking_aisle_at_a_signal_is_no_arm(tmp_path: Path) -> None:
    drawing = main_road(**SIGNAL)
    drawing.way((0, 0), (0, 70), highway="service", service="parking_aisle")
    drawing.way((0, 0), (0, -70), **MAIN)
    assert ways(built(drawing, tmp_path)[0]) == {"1001", "1003"}


def test_barrier_lets_no_car_through(tmp_path: Path) -> None:
    drawing = main_road(**SIGNAL)
    drawing.way((0, 0), (0, 60), (0, 150), **MAIN)
    drawing.node(0, 60, barrier="bollard")
    drawing.way((0, 0), (0, -60), (0, -150), **MAIN)
    drawing.node(0, -60, barrier="gate", motor_vehicle="yes")
    bundle, report = built(drawing, tmp_path)
    closed = {road.id for road in bundle.road_map.roads if "1002" in road.id}
    owner = {lane.id: lane.road for lane in bundle.road_map.lanes}
    passing = {
        (owner[c.from_lane], owner[c.to_lane])
        for c in bundle.road_map.connections
        if owner[c.from_lane] in closed and owner[c.to_lane] in closed and c.direction != "t"
    }
    assert not passing
    assert [road.id.lstrip("-") for road in bundle.road_map.roads if "1003" in road.id] == ["1003#0"] * 2
    (told,) = [issue for issue in report["issues"] if issue["check"] == "osm.road_closed"]
    assert "bollard" in told["message"]


def test_signal_for_walkers_between_junctions_has_a_crossing(tmp_path: Path) -> None:
    drawing = main_road(highway="traffic_signals", traffic_signals="pedestrian_crossing")
    bundle, _ = built(drawing, tmp_path)
    assert len(bundle.road_map.signals) == 1
    (crossing,) = bundle.road_map.crossings
    assert crossing.signal == bundle.road_map.signals[0].id


def test_buses_reach_the_signal_through_a_pedestrian_zone(tmp_path: Path) -> None:
    drawing = main_road(**SIGNAL)
    drawing.way((0, 0), (0, 120), highway="pedestrian", bus="yes")
    bundle, _ = built(drawing, tmp_path)
    lanes = [lane for lane in bundle.road_map.lanes if "1002" in lane.id]
    assert {lane.kind for lane in lanes} == {"bus", "sidewalk"}


def test_cycle_lanes_go_on_across_a_signal(tmp_path: Path) -> None:
    drawing = main_road(**SIGNAL)
    drawing.ways[0][1]["cycleway"] = "lane"
    drawing.way((0, -120), (0, 0), (0, 120), **MAIN)
    bundle, report = built(drawing, tmp_path)
    kinds = {lane.id: lane.kind for lane in bundle.road_map.lanes}
    assert sum(kind == "bicycle" for kind in kinds.values()) == 4
    ahead = [
        c
        for c in bundle.road_map.connections
        if kinds[c.from_lane] == kinds[c.to_lane] == "bicycle" and c.direction == "s"
    ]
    assert len(ahead) == 2
    assert report["counts"]["error"] == 0


def test_cycle_lane_at_the_inner_side_of_a_oneway_street_goes_on_there(tmp_path: Path) -> None:
    drawing = Drawing()
    street = MAIN | {"oneway": "yes", "cycleway__left": "lane"}
    drawing.way((-150, 0), (0, 0), (150, 0), **street)
    drawing.way((0, -120), (0, 0), (0, 120), **MAIN)
    drawing.node(0, 0, **SIGNAL)
    bundle, report = built(drawing, tmp_path)
    lanes = {lane.id: lane for lane in bundle.road_map.lanes}
    cycles = [lane for lane in lanes.values() if lane.kind == "bicycle"]
    assert len(cycles) == 2
    for lane in cycles:
        driven = [other for other in lanes.values() if other.road == lane.road and other.kind == "driving"]
        assert lane.index > max(other.index for other in driven)
    onward = [c for c in bundle.road_map.connections if c.from_lane in {lane.id for lane in cycles}]
    assert {c.direction for c in onward} == {"s", "l"}
    assert report["counts"]["error"] == 0


def test_nobody_changes_lanes_inside_a_junction_or_waits_on_a_cycle_lane(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (-60, 0), highway="secondary", oneway="yes", lanes="1")
    drawing.way((-60, 0), (0, 0), highway="secondary", oneway="yes", lanes="3", cycleway="lane")
    drawing.way((0, 0), (150, 0), highway="secondary", oneway="yes", lanes="2")
    drawing.way((0, -120), (0, 0), (0, 120), **MAIN)
    drawing.node(0, 0, **SIGNAL)
    built(drawing, tmp_path)
    (network,) = tmp_path.glob("**/network.net.xml")
    links = [link for link in ET.parse(network).iter("connection") if "via" in link.attrib]  # noqa: S314
    opening = [link for link in links if link.get("from") == "1001#0"]
    turning = [link for link in links if link.get("from") == "1002#0" and link.get("dir") == "r"]
    assert len(opening) >= 3
    straight = [link for link in links if link.get("from") == "1002#0" and link.get("to") == "1003#0"]
    assert len(straight) >= 2
    assert all({"changeLeft", "changeRight"} <= link.attrib.keys() for link in (*opening, *straight))
    cars = [link for link in turning if link.get("fromLane") != "1"]
    assert cars
    assert all(link.get("contPos") == "0.00" for link in cars)


def test_lanes_that_become_one_wait_before_the_junction(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((0, -150), (0, 0), highway="secondary", oneway="yes", lanes="3")
    drawing.way((-150, 0), (0, 0), (150, 0), **MAIN)
    drawing.node(0, 0, **SIGNAL)
    built(drawing, tmp_path)
    (network,) = tmp_path.glob("**/network.net.xml")
    links = [link for link in ET.parse(network).iter("connection") if link.get("from") == "1001#0"]  # noqa: S314
    onto = Counter((link.get("to"), link.get("toLane")) for link in links)
    merging = [link for link in links if onto[link.get("to"), link.get("toLane")] > 1]
    assert len(merging) >= 2
    assert all(link.get("contPos") == "0.00" for link in merging)


def test_signal_without_a_junction_is_told_where_it_has_no_room(tmp_path: Path) -> None:
    """It is for traffic that leaves a junction without signals, right behind it."""
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), (4, 0), (150, 0), **MAIN)
    drawing.way((0, 0), (0, 120), **MAIN)
    drawing.node(4, 0, **SIGNAL, traffic_signals__direction="forward")
    _, report = built(drawing, tmp_path)
    (told,) = [issue for issue in report["issues"] if issue["check"] == "osm.missing_signal"]
    assert "no junction or crossing" in told["message"]
    assert report["osm"]["signalised_junctions"] == {"kept": 0, "of": 1, "share": 0.0}


def test_tag_that_no_lane_can_show_is_told_once_for_all_ways(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), highway="secondary", lanes="5", lanes__both_ways="1")
    drawing.way((0, 0), (150, 0), highway="secondary", lanes="5", lanes__both_ways="1")
    drawing.way((0, 0), (0, 100), **MAIN)
    _, report = built(drawing, tmp_path)
    (told,) = [issue for issue in report["issues"] if issue["check"] == "osm.tag_not_kept"]
    assert told["measured"] == 2
    assert "the lane in the middle" in told["message"]


@pytest.mark.parametrize(("centre", "turn"), [(HELSINKI, "l"), (LONDON, "r")])
def test_centre_lane_is_a_turn_lane_before_the_junction(
    tmp_path: Path, centre: tuple[float, float], turn: str
) -> None:
    drawing = Drawing(centre=centre)
    tags = {"highway": "secondary", "lanes": "3", "lanes__both_ways": "1"}
    drawing.way((-150, 0), (0, 0), (150, 0), **tags)
    drawing.way((0, -100), (0, 0), (0, 100), **MAIN)
    bundle, report = built(drawing, tmp_path)
    lanes = {lane.id: lane for lane in bundle.road_map.lanes}
    wide = [r for r in bundle.road_map.roads if sum(lanes[k].kind is LaneKind.DRIVING for k in r.lanes) == 2]
    assert len(wide) == 2
    for road in wide:
        inner = road.lanes[-1]
        assert {c.direction for c in bundle.road_map.connections if c.from_lane == inner} == {turn}
        assert lanes[inner].length > 20
    assert report["counts"]["error"] == 0
