"""Who gives way in an imported network: roundabouts, signs, and junctions with neither."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import libsumo
import pytest
import sumolib
from osm_drawings import HELSINKI, LONDON, SIGNAL, SYDNEY, Drawing, cross, dog_leg, dual_carriageways

from dojo_maps.bundle import Bundle
from dojo_maps.conversion import ConvertOptions, convert
from dojo_maps.sources.osm.network.precedence import settle_precedence

STREET = {"highway": "residential", "lanes": "2"}
MAIN = {"highway": "secondary", "lanes": "2"}


def built(drawing: Drawing, folder: Path, *, demand: float = 0) -> Bundle:
    path = drawing.write(folder / "a.osm")
    return convert(str(path), folder / "a.dojo", ConvertOptions(demand=demand))[0]


def ring(
    radius: float, arms: int, *, left_hand: bool = False, splitters: bool = False, **tags: str
) -> Drawing:
    d = Drawing(centre=LONDON if left_hand else HELSINKI)
    parts = 4 * arms
    turns = [2 * math.pi * k / parts * (-1 if left_hand else 1) for k in range(parts)]
    places = [(round(radius * math.cos(turn), 3), round(radius * math.sin(turn), 3)) for turn in turns]
    d.way(*places, places[0], **tags)
    for k in range(arms):
        x, y = places[4 * k]
        far = (x / radius * (radius + 130), y / radius * (radius + 130))
        if splitters:
            apart = (x / radius * (radius + 25), y / radius * (radius + 25))
            d.way(far, apart, **STREET)
            d.way(apart, places[(4 * k - 1) % parts], highway="residential", oneway="yes")
            d.way(places[4 * k + 1], apart, highway="residential", oneway="yes")
        else:
            d.way(far, (x, y), **STREET)
    return d


def states(bundle: Bundle, arriving: str) -> set[str]:
    """List the states of the connections that leave a road."""
    lanes = {lane.id for lane in bundle.road_map.lanes if lane.road == arriving}
    found = {c.state for c in bundle.road_map.connections if c.from_lane in lanes and c.direction != "t"}
    assert found
    return found


def check_ring(bundle: Bundle, parts: int) -> None:
    """Who circulates has right of way, and who arrives has not."""
    roads = {road.id for road in bundle.road_map.roads}
    inside = {road for road in roads if road.startswith("1001#")}
    assert len(inside) == parts
    ends = {road.to_junction for road in bundle.road_map.roads if road.id in inside}
    driven = {c.from_lane.rsplit("_", 1)[0] for c in bundle.road_map.connections}
    entering = [
        road
        for road in bundle.road_map.roads
        if road.to_junction in ends and road.id not in inside and road.id in driven
    ]
    assert entering
    for road in inside:
        assert states(bundle, road) == {"M"}
    for road in entering:
        assert states(bundle, road.id) == {"m"}


TAGGED = {"highway": "residential", "junction": "roundabout"}
UNTAGGED = {"highway": "residential", "oneway": "yes"}


@pytest.mark.parametrize(
    ("drawing", "parts"),
    [
        (ring(14.0, 2, **TAGGED), 2),
        (ring(6.0, 4, **TAGGED), 4),
        (ring(10.0, 5, **TAGGED), 5),
        (ring(14.0, 3, left_hand=True, **TAGGED), 3),
        (ring(16.0, 3, **UNTAGGED), 3),
        (ring(22.0, 4, splitters=True, **TAGGED), 8),
    ],
    ids=["two arms", "radius 6", "five arms", "left-hand", "no tag", "splitter islands"],
)
def test_roundabout_is_a_ring_with_right_of_way(drawing: Drawing, parts: int, tmp_path: Path) -> None:
    check_ring(built(drawing, tmp_path), parts)


def check_traffic(bundle: Bundle) -> None:
    """A network's own demand arrives, and nobody waits two minutes."""
    files = ["-n", str(bundle.folder / "network.net.xml"), "-r", str(bundle.folder / "demand.rou.xml")]
    libsumo.start(["sumo", *files, "--no-step-log", "--no-warnings", "--time-to-teleport", "120"])
    try:
        departed = arrived = teleported = 0
        for _ in range(1200):
            libsumo.simulationStep()
            departed += libsumo.simulation.getDepartedNumber()
            arrived += libsumo.simulation.getArrivedNumber()
            teleported += libsumo.simulation.getStartingTeleportNumber()
    finally:
        libsumo.close()
    assert teleported == 0
    assert arrived > 0.9 * departed > 100


@pytest.mark.parametrize("arms", [4, 5])
def test_small_roundabout_lets_its_own_traffic_through(arms: int, tmp_path: Path) -> None:
    bundle = built(ring(2.0 * arms - 2.0, arms, **TAGGED), tmp_path, demand=150 * arms)
    check_traffic(bundle)


def test_square_of_one_way_streets_is_no_roundabout(tmp_path: Path) -> None:
    d = Drawing()
    corners = [(-25, -25), (25, -25), (25, 25), (-25, 25)]
    d.way(*corners, corners[0], **UNTAGGED)
    for x, y in corners:
        d.way((x * 6, y * 6), (x, y), **STREET)
    bundle = built(d, tmp_path)
    inside = [road.id for road in bundle.road_map.roads if road.id.startswith("1001#")]
    assert {"m", "="} & set().union(*(states(bundle, road) for road in inside))


def crossroads(**middle: str) -> Drawing:
    d = Drawing()
    d.way((-150, 0), (-12, 0), (0, 0), (12, 0), (150, 0), **MAIN)
    d.way((0, -150), (0, -12), (0, 0), (0, 12), (0, 150), **STREET)
    if middle:
        d.node(0, 0, **middle)
    return d


def kind(bundle: Bundle) -> str:
    return max(bundle.road_map.junctions, key=lambda junction: len(junction.incoming)).kind


CROSSWAYS = {"W": "1001#0", "E": "-1001#1", "S": "1002#0", "N": "-1002#1"}
"""The roads that arrive at crossroads, from each side."""


def yields_to(bundle: Bundle, waiting: str, others: str) -> set[str]:
    """Ask the network whom a vehicle that goes straight on waits for, by the sides that they come from."""
    net = sumolib.net.readNet(str(bundle.folder / "network.net.xml"))
    node = net.getEdge(CROSSWAYS[waiting]).getToNode()
    straight = {
        c.getFrom().getID(): c
        for c in node.getConnections()
        if c.getDirection() == "s" and c.getFromLane().allows("passenger")
    }
    own = straight[CROSSWAYS[waiting]]
    return {side for side in others if node.forbids(straight[CROSSWAYS[side]], own)}


@pytest.mark.parametrize(("centre", "first"), [(HELSINKI, "E"), (LONDON, "W")])
def test_mini_roundabout_yields_to_who_circulates(
    centre: tuple[float, float], first: str, tmp_path: Path
) -> None:
    """From the north: who keeps right meets those from the east, who keeps left those from the west."""
    drawing = crossroads(highway="mini_roundabout")
    drawing.centre = centre
    assert yields_to(built(drawing, tmp_path), "N", "EW") == {first}


TOKYO, NEW_YORK = (139.7, 35.7), (-74.0, 40.8)


def streets(centre: tuple[float, float], *, arms: int = 4, **minor: str) -> Drawing:
    d = Drawing(centre=centre)
    d.way((-150, 0), (0, 0), (150, 0), **STREET)
    d.way((0, -150), (0, 0), *([(0, 150)] if arms == 4 else []), **(STREET | minor))
    return d


@pytest.mark.parametrize(
    ("centre", "first"),
    [(HELSINKI, "W"), (NEW_YORK, "W"), (SYDNEY, "W"), (TOKYO, "E")],
    ids=["Finland", "United States", "Australia", "Japan"],
)  # fmt: skip
def test_equal_streets_let_one_side_go_first(centre: tuple[float, float], first: str, tmp_path: Path) -> None:
    bundle = built(streets(centre), tmp_path)
    assert yields_to(bundle, "N", "EW") == {first}
    assert yields_to(bundle, "S", "EW") == {"EW".replace(first, "")}


@pytest.mark.parametrize("centre", [LONDON, NEW_YORK], ids=["Britain", "United States"])
def test_road_that_ends_gives_way_where_the_country_has_it_so(
    centre: tuple[float, float], tmp_path: Path
) -> None:
    bundle = built(streets(centre, arms=3), tmp_path)
    assert kind(bundle) == "priority"
    assert "M" not in states(bundle, CROSSWAYS["S"])


def test_right_goes_first_at_a_t_junction_in_finland(tmp_path: Path) -> None:
    assert kind(built(streets(HELSINKI, arms=3), tmp_path)) == "right_before_left"


@pytest.mark.parametrize(
    "minor",
    [{"highway": "living_street"}, {"highway": "tertiary"}, {"priority_road": "designated"}],
    ids=["smaller", "bigger", "priority road"],
)
def test_streets_that_are_not_equal_have_priorities(minor: dict[str, str], tmp_path: Path) -> None:
    bundle = built(streets(HELSINKI, **minor), tmp_path)
    assert kind(bundle) == "priority"
    first = "W" if "living_street" in minor.values() else "S"
    assert "M" in states(bundle, CROSSWAYS[first])


def test_equal_crossroads_let_their_own_traffic_through(tmp_path: Path) -> None:
    """Vehicles from all four sides wait for each other, and none for ever."""
    check_traffic(built(streets(HELSINKI), tmp_path, demand=800))


def test_all_way_stop_stops_all(tmp_path: Path) -> None:
    assert kind(built(crossroads(highway="stop", stop="all"), tmp_path)) == "allway_stop"


def test_signs_on_all_approaches_are_an_all_way_stop(tmp_path: Path) -> None:
    drawing = crossroads()
    for x, y in ((-12, 0), (12, 0), (0, -12), (0, 12)):
        drawing.node(x, y, highway="stop")
    assert kind(built(drawing, tmp_path)) == "allway_stop"


@pytest.mark.parametrize("sign", ["stop", "give_way"])
def test_road_with_signs_gives_way_even_if_it_is_the_bigger_one(sign: str, tmp_path: Path) -> None:
    drawing = crossroads()
    drawing.node(-12, 0, highway=sign, direction="forward")
    drawing.node(12, 0, highway=sign, direction="backward")
    bundle = built(drawing, tmp_path)
    assert kind(bundle) == ("priority_stop" if sign == "stop" else "priority")
    ends = {road.id: road.to_junction for road in bundle.road_map.roads}
    centre = max(bundle.road_map.junctions, key=lambda junction: len(junction.incoming)).id
    signed = [road for road, end in ends.items() if end == centre and "1001" in road]
    free = [road for road, end in ends.items() if end == centre and "1002" in road]
    assert all("M" not in states(bundle, road) for road in signed)
    assert all("M" in states(bundle, road) for road in free)


def test_sign_for_the_other_direction_changes_nothing(tmp_path: Path) -> None:
    drawing = crossroads()
    drawing.node(-12, 0, highway="stop", direction="backward")
    assert kind(built(drawing, tmp_path)) == "priority"


def test_roads_without_a_way_between_them_are_all_built(tmp_path: Path) -> None:
    drawing = crossroads()
    drawing.way((-150, 80), (150, 80), highway="tertiary", layer="1", bridge="yes")
    drawing.way((-150, 300), (150, 300), highway="tertiary")
    bundle, report = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    assert {"1003", "1004"} <= {road.id.lstrip("-").split("#")[0] for road in bundle.road_map.roads}
    assert report["osm"]["road_metres"]["all"]["share"] == 1.0


def test_what_is_not_imported_is_told_by_kind(tmp_path: Path) -> None:
    drawing = crossroads()
    for y in (40, 60):
        drawing.way((0, y), (100, y), highway="track")
    drawing.way((0, 90), (100, 90), highway="residential", access="private")
    _, report = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    assert report["osm"]["metres_not_imported"] == {
        "highway=residential (access=private)": 100,
        "highway=track": 200,
    }
    told = [issue for issue in report["issues"] if issue["check"] == "osm.not_imported"]
    assert [issue["measured"] for issue in told] == pytest.approx([100, 200], abs=0.5)


def test_crossings_are_guessed_at_signals_only_and_told(tmp_path: Path) -> None:
    plain, _ = convert(str(crossroads().write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    assert not plain.road_map.crossings
    _, report = convert(str(crossroads(**SIGNAL).write(tmp_path / "b.osm")), tmp_path / "b.dojo")
    (told,) = [issue for issue in report["issues"] if issue["check"] == "osm.guessed_crossing"]
    assert told["measured"] == 4


@pytest.mark.parametrize("drawing", [cross, dual_carriageways, dog_leg])
def test_no_two_ways_into_one_lane_at_a_signal_wait_for_each_other(
    drawing: Callable[[], Drawing], tmp_path: Path
) -> None:
    road_map = built(drawing(), tmp_path).road_map
    targets = {connection.id: connection.to_lane for connection in road_map.connections}
    waiting = 0
    for junction in road_map.junctions:
        ways = junction.right_of_way
        for one, way in enumerate(ways):
            for other in way.response:
                if junction.kind == "traffic_light" and targets.get(way.link) == targets.get(
                    ways[other].link, ""
                ):
                    waiting += 1
                    assert one not in ways[other].response
    assert waiting > 3


def test_of_two_ways_that_cross_without_waiting_one_waits(tmp_path: Path) -> None:
    bundle = built(cross(), tmp_path)
    junction = next(each for each in bundle.road_map.junctions if each.kind == "traffic_light")
    ways, vehicles = list(junction.right_of_way), {each.id for each in bundle.road_map.connections}
    one, other = next(
        (one, other)
        for one, way in enumerate(ways)
        for other in way.response
        if {way.link, ways[other].link} <= vehicles and one in ways[other].foes
    )
    row = re.compile(
        rf'(<junction id="{junction.id}".*?<request index="{one}"\s+response=")([01]+)', re.DOTALL
    )

    def forget(found: re.Match[str]) -> str:
        bits = list(found[2])
        bits[-1 - other] = "0"
        return found[1] + "".join(bits)

    cleared = row.sub(forget, bundle.network.read_text(), count=1)
    ways[one] = replace(ways[one], response=tuple(way for way in ways[one].response if way != other))
    junctions = tuple(
        replace(each, right_of_way=tuple(ways)) if each is junction else each
        for each in bundle.road_map.junctions
    )
    settled = settle_precedence(cleared.encode(), replace(bundle.road_map, junctions=junctions)).decode()
    (first,) = (found[2] for found in row.finditer(settled))
    second = re.search(row.pattern.replace(f'index="{one}"', f'index="{other}"'), settled, re.DOTALL)
    assert second is not None
    assert (first[-1 - other], second[2][-1 - one]) in (("1", "0"), ("0", "1"))
