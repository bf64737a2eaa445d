"""What tags mean: lanes, turns, speeds, sidewalks; and where lanes lead."""

import numpy as np
import pytest

from dojo_maps.sources.osm.layout.arms import trim
from dojo_maps.sources.osm.plain.lane_connections import connect_lanes
from dojo_maps.sources.osm.read.country import Country, read_speed
from dojo_maps.sources.osm.read.lane_tags import LaneTags, LaneUse
from dojo_maps.sources.osm.read.parking_tags import parking_width
from dojo_maps.sources.osm.read.way_tags import RoadTags, read_road

FINLAND = Country(code="FI", left_hand=False, told_by="a test")


def road(*, left_hand: bool = False, code: str = "FI", **tags: str) -> RoadTags:
    named = {"highway": "secondary"} | {key.replace("__", ":"): value for key, value in tags.items()}
    found, _ = read_road(named, Country(code=code, left_hand=left_hand, told_by="a test"))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("tags", "lanes"),
    [
        ({}, (1, 1)),
        ({"lanes": "4"}, (2, 2)),
        ({"lanes": "3"}, (2, 1)),
        ({"lanes": "3", "lanes__backward": "2"}, (1, 2)),
        ({"lanes": "3", "lanes__both_ways": "1"}, (1, 1)),
        ({"lanes": "1"}, (1, 1)),
        ({"oneway": "yes"}, (1, 0)),
        ({"oneway": "-1", "lanes": "2"}, (0, 2)),
        ({"oneway": "yes", "turn__lanes": "left|through|right"}, (3, 0)),
        ({"turn__lanes__forward": "left|through"}, (2, 1)),
        ({"highway": "motorway"}, (2, 0)),
        ({"junction": "roundabout"}, (1, 0)),
        ({"lanes": "99"}, (4, 4)),
        ({"oneway": "yes", "lanes__forward": "3"}, (3, 0)),
        ({"oneway": "yes", "lanes": "3", "oneway__psv": "no", "lanes__backward": "1"}, (2, 1)),
        ({"oneway": "yes", "lanes": "3", "busway": "opposite_lane"}, (2, 1)),
        ({"oneway": "-1", "lanes": "3", "oneway__bus": "no"}, (1, 2)),
    ],
)
def test_read_road_counts_lanes(tags: dict[str, str], lanes: tuple[int, int]) -> None:
    found = road(**tags)
    assert (len(found.forward), len(found.backward)) == lanes


def test_read_road_lists_lanes_outermost_first() -> None:
    tags = {"oneway": "yes", "lanes": "2", "turn__lanes": "left|through;right", "bus__lanes": "|designated"}
    right, left = road(**tags), road(left_hand=True, **tags)
    assert [lane.turns for lane in right.forward] == [("through", "right"), ("left",)]
    assert [lane.bus for lane in right.forward] == [True, False]
    assert left.forward == right.forward[::-1]


BUS, CAR, BICYCLE = LaneUse.BUS, LaneUse.DRIVING, LaneUse.BICYCLE


@pytest.mark.parametrize(
    ("tags", "forward", "backward"),
    [
        ({"oneway": "yes", "lanes": "3", "oneway__psv": "no"}, [CAR, CAR], [BUS]),
        (
            {"oneway": "yes", "lanes": "3", "vehicle__lanes": "yes|yes|no", "bus__lanes": "yes|yes|yes"},
            [BUS, CAR, CAR],
            [],
        ),
        (
            {"lanes": "2", "cycleway__right": "lane", "cycleway__left": "track"},
            [BICYCLE, CAR],
            [BICYCLE, CAR],
        ),
        ({"lanes": "2", "cycleway": "lane"}, [BICYCLE, CAR], [BICYCLE, CAR]),
        ({"oneway": "yes", "cycleway": "lane"}, [BICYCLE, CAR], []),
        ({"oneway": "yes", "cycleway": "opposite_lane"}, [CAR], [BICYCLE]),
        ({"oneway": "yes", "oneway__bicycle": "no", "cycleway__left": "lane"}, [CAR], [BICYCLE]),
        ({"oneway": "yes", "cycleway__left": "lane"}, [CAR, BICYCLE], []),
        ({"oneway": "yes", "cycleway__left": "lane", "cycleway__left__oneway": "-1"}, [CAR], [BICYCLE]),
        ({"oneway": "-1", "cycleway__right": "track"}, [], [CAR, BICYCLE]),
        ({"lanes": "2", "cycleway": "shared_lane"}, [CAR], [CAR]),
    ],
)
def test_read_road_tells_who_lanes_are_for(
    tags: dict[str, str], forward: list[LaneUse], backward: list[LaneUse]
) -> None:
    found = road(**tags)
    assert [lane.use for lane in found.forward] == forward
    assert [lane.use for lane in found.backward] == backward


def test_read_road_keeps_cycle_lanes_on_their_side_where_traffic_keeps_left() -> None:
    found = road(left_hand=True, lanes="2", cycleway__left="lane")
    assert [lane.use for lane in found.forward] == [BICYCLE, CAR]
    assert [lane.use for lane in found.backward] == [CAR]


@pytest.mark.parametrize(
    ("tags", "word"),
    [
        ({"lanes": "1"}, "lanes=1"),
        ({"lanes": "3", "oneway": "reversible"}, "reversible"),
        ({"lanes": "5", "lanes__both_ways": "1"}, "both_ways"),
        ({"oneway": "yes", "hov__lanes": "designated|"}, "hov"),
        ({"motor_vehicle__conditional": "no @ (22:00-06:00)"}, "motor_vehicle:conditional"),
        ({"turn__lanes__forward": "left|through", "lanes__forward": "1"}, "turn:lanes"),
    ],
)
def test_read_road_says_what_it_does_not_keep(tags: dict[str, str], word: str) -> None:
    named = {"highway": "secondary"} | {key.replace("__", ":"): value for key, value in tags.items()}
    (told,) = read_road(named, FINLAND)[1]
    assert word in told


@pytest.mark.parametrize(
    ("tags", "left", "right"),
    [
        ({"parking:both": "street_side"}, 2.0, 2.0),
        ({"parking:left": "on_kerb", "parking:right": "separate"}, 0.0, 0.0),
        ({"parking:lane:right": "parallel", "parking:lane:right:parallel": "on_kerb"}, 0.0, 0.0),
        ({"parking:lane:both": "no_parking"}, 0.0, 0.0),
        ({"parking:lane:left": "diagonal", "parking:lane:right": "parallel"}, 4.3, 2.0),
        ({}, 0.0, 0.0),
    ],
)
def test_parking_width_reads_both_ages_of_tags(tags: dict[str, str], left: float, right: float) -> None:
    assert (parking_width(tags, "left"), parking_width(tags, "right")) == (left, right)


def test_read_road_takes_parked_cars_off_its_width() -> None:
    found = road(lanes="2", width="10", parking__both="lane")
    assert found.width == pytest.approx(3.0)
    assert found.drives == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("tags", "offset"),
    [
        ({"oneway": "yes", "lanes": "3", "placement": "right_of:1"}, -1.625),
        ({"oneway": "yes", "lanes": "3", "placement": "middle_of:2"}, 0.0),
        ({"oneway": "-1", "lanes": "3", "placement": "right_of:1"}, 1.625),
        ({"oneway": "yes", "lanes": "2", "placement": "left_of:1"}, -3.25),
        ({"lanes": "4", "placement__forward": "left_of:1"}, 0.0),
        ({"lanes": "4", "placement__forward": "right_of:1"}, 3.25),
        ({"lanes": "4", "placement__backward": "middle_of:2"}, -4.875),
        ({"oneway": "yes", "lanes": "2", "placement": "transition"}, 0.0),
        ({"oneway": "yes", "lanes": "2", "placement": "right_of:5"}, 0.0),
    ],
)
def test_read_road_places_the_carriageway_beside_its_way(tags: dict[str, str], offset: float) -> None:
    assert road(**tags).offset == pytest.approx(offset, abs=0.01)
    # The same street seen in a mirror.
    lanes = {key: value for key, value in tags.items() if "placement" not in key}
    mirrored = {"left_of": "right_of", "right_of": "left_of"}
    for key in tags.keys() - lanes.keys():
        kind, _, number = tags[key].partition(":")
        count = len(
            road(**lanes).backward
            if "backward" in key or tags.get("oneway") == "-1"
            else road(**lanes).forward
        )
        number = str(count + 1 - int(number)) if number and int(number) <= count else number
        lanes[key] = f"{mirrored.get(kind, kind)}:{number}".rstrip(":")
    assert road(left_hand=True, **lanes).offset == pytest.approx(-offset, abs=0.01)


@pytest.mark.parametrize("text", ["7.5", "7.5 m", "24.6 ft", "24'7\""])
def test_read_road_reads_widths_in_any_unit(text: str) -> None:
    assert road(lanes="2", width=text).width == pytest.approx(3.75, abs=0.01)


@pytest.mark.parametrize(
    "tags",
    [
        {"highway": "footway"},
        {"highway": "service"},
        {"highway": "secondary", "access": "no"},
        {"highway": "secondary", "motor_vehicle": "private"},
        {"highway": "secondary", "area": "yes"},
        {},
    ],
)
def test_read_road_leaves_out_what_cars_do_not_use(tags: dict[str, str]) -> None:
    assert read_road(tags, FINLAND)[0] is None


def test_read_road_keeps_roads_for_buses() -> None:
    for found in (
        road(motor_vehicle="no", psv="yes"),
        road(highway="pedestrian", bus="yes"),
        road(highway="service", access="no", bus="designated"),
    ):
        assert all(lane.bus for lane in found.forward + found.backward)


@pytest.mark.parametrize(
    ("tags", "sides"),
    [
        ({}, ("", "")),
        ({"sidewalk": "both"}, ("yes", "yes")),
        ({"sidewalk": "left"}, ("yes", "no")),
        ({"sidewalk": "none"}, ("no", "no")),
        ({"sidewalk": "separate"}, ("separate", "separate")),
        ({"sidewalk__both": "separate"}, ("separate", "separate")),
        ({"sidewalk__left": "no", "sidewalk__right": "yes"}, ("no", "yes")),
    ],
)
def test_read_road_reads_sidewalks(tags: dict[str, str], sides: tuple[str, str]) -> None:
    assert road(**tags).sidewalks == sides


@pytest.mark.parametrize(
    ("text", "kmh"),
    [("50", 50), ("30 mph", 48.28), ("30mph", 48.28), ("FI:urban", 50), ("DE:zone30", 30), ("60;80", 60)],
)
def test_read_speed_reads_numbers_units_and_zones(text: str, kmh: float) -> None:
    speed = read_speed(text)
    assert speed is not None
    assert speed * 3.6 == pytest.approx(kmh, abs=0.01)


@pytest.mark.parametrize("text", ["", "none", "signals", "-5", "1e9", "nan", "mph"])
def test_read_speed_knows_none(text: str) -> None:
    assert read_speed(text) is None


def test_read_road_takes_the_speed_of_the_country() -> None:
    assert road(code="US", highway="residential").speed == pytest.approx(25 * 0.44704, abs=0.01)
    assert road(highway="residential").speed == pytest.approx(40 / 3.6, abs=0.01)


PLAIN = LaneTags()


def test_connect_lanes_gives_turns_the_lane_on_their_side() -> None:
    found = connect_lanes([PLAIN] * 3, [[PLAIN], [PLAIN] * 3, [PLAIN]], [-90, 0, 90], left_hand=False)
    assert found == [(0, 0, 0), (0, 1, 0), (1, 1, 1), (2, 1, 2), (2, 2, 0)]


def test_connect_lanes_follows_arrows() -> None:
    lanes = [LaneTags(turns=("right",)), LaneTags(turns=("through",)), LaneTags(turns=("left",))]
    found = connect_lanes(lanes, [[PLAIN], [PLAIN] * 2, [PLAIN]], [-90, 0, 90], left_hand=False)
    assert [(lane, movement) for lane, movement, _ in found] == [(0, 0), (1, 1), (2, 2)]


def test_connect_lanes_takes_an_arrow_back_for_no_turn_to_the_outer_side() -> None:
    """Where the way back is not mapped, a sharp turn to the other side is not meant."""
    lanes = [LaneTags(turns=("left",)), LaneTags(turns=("left", "reverse"))]
    found = connect_lanes(lanes, [[PLAIN], [PLAIN] * 2], [-183, 117], left_hand=False)
    assert found == [(0, 0, 0), (0, 1, 0), (1, 1, 1)]
    assert (1, 1, 0) in connect_lanes(lanes, [[PLAIN] * 2, [PLAIN]], [90, 183], left_hand=False)


@pytest.mark.parametrize(
    ("turns", "angles"),
    [
        ((("left",), ("reverse", "left")), [-90, 50, 77]),
        ((("through",), ("through",), ("left",)), [0, 50, 77]),
        ((("right",), ("right",), ("through",)), [-77, -50, 0]),
    ],
)
def test_connect_lanes_crosses_no_lane_of_the_road_where_an_arrow_is_missing(
    turns: tuple[tuple[str, ...], ...], angles: list[float]
) -> None:
    """One lane less has an arrow than there are ways to go."""
    lanes = [LaneTags(turns=turn) for turn in turns]
    found = connect_lanes(lanes, [[PLAIN] * 2] * 3, angles, left_hand=False)
    assert {movement for _, movement, _ in found} == {0, 1, 2}
    ways = {lane: {movement for number, movement, _ in found if number == lane} for lane in range(len(lanes))}
    assert all(max(ways[lane]) <= min(ways[lane + 1]) for lane in range(len(lanes) - 1))


def test_connect_lanes_splits_a_road_that_ends() -> None:
    found = connect_lanes([PLAIN] * 2, [[PLAIN], [PLAIN]], [-90, 90], left_hand=False)
    assert found == [(0, 0, 0), (1, 1, 0)]


@pytest.mark.parametrize("lanes", range(1, 6))
@pytest.mark.parametrize("angles", [[0], [-90, 0], [0, 90], [-90, 90], [-90, 0, 90], [-120, -30, 20, 100]])
def test_connect_lanes_leaves_no_lane_and_no_road_out(lanes: int, angles: list[float]) -> None:
    for bus in (False, True):
        sources = [LaneTags(use=LaneUse.BUS if bus and k == 0 else LaneUse.DRIVING) for k in range(lanes)]
        found = connect_lanes(sources, [[PLAIN] * 2 for _ in angles], angles, left_hand=False)
        assert {lane for lane, _, _ in found} == set(range(lanes))
        assert {movement for _, movement, _ in found} == set(range(len(angles)))


def test_connect_lanes_merges_no_lanes_that_lead_elsewhere() -> None:
    two, one = [LaneTags(), LaneTags()], [LaneTags()]
    turning = connect_lanes(two, [one, two], [-85.0, 0.0], left_hand=False)
    assert [link for link in turning if link[1] == 0] == [(0, 0, 0)]
    ahead = connect_lanes(two, [one, one], [0.0, 85.0], left_hand=False)
    assert ahead == [(0, 0, 0), (1, 1, 0)]
    painted = [LaneTags(turns=("through",)), LaneTags(turns=("through", "left"))]
    assert (1, 0, 0) in connect_lanes(painted, [one, one], [0.0, 85.0], left_hand=False)


BUS = LaneTags(use=LaneUse.BUS)


@pytest.mark.parametrize(
    ("lanes", "onto", "expected"),
    [
        ([BUS, PLAIN], 3, [(0, 0), (1, 1), (1, 2)]),
        ([PLAIN, BUS], 3, [(0, 0), (0, 1), (1, 2)]),
        ([BUS, PLAIN, PLAIN], 2, [(0, 0), (1, 0), (2, 1)]),
        ([PLAIN, PLAIN, BUS], 2, [(0, 0), (1, 1), (2, 1)]),
    ],
)
def test_connect_lanes_keeps_buses_on_their_side(
    lanes: list[LaneTags], onto: int, expected: list[tuple[int, int]]
) -> None:
    found = connect_lanes(lanes, [[PLAIN] * onto], [0.0], left_hand=False)
    assert [(lane, end) for lane, _, end in found] == expected
    turning = [LaneTags(use=lane.use, turns=("through",)) for lane in lanes]
    ways = connect_lanes(turning, [[PLAIN], [PLAIN] * onto], [-85.0, 0.0], left_hand=False)
    ahead = [(lane, end) for lane, movement, end in ways if movement == 1]
    assert not any(a < b and d < c for a, c in ahead for b, d in ahead)


def test_trim_leaves_a_line_of_every_road() -> None:
    line = np.array([[0.0, 0.0], [30.0, 0.0]])
    assert trim(line, 4.0, 6.0)[:, 0].tolist() == [4.0, 24.0]
    assert np.ptp(trim(line, 40.0, 40.0)[:, 0]) == pytest.approx(1.0)
    assert trim(line / 60, 0.0, 0.0)[:, 0].tolist() == [0.0, 0.5]
