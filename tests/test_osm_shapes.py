"""Shapes that junctions have in the wild, and data in a bad state: each the smallest that once failed."""

import itertools
import math
from pathlib import Path
from typing import Any

import pytest
import shapely
from osm_drawings import HELSINKI, LONDON, SIGNAL, SIGNAL_CROSSING, Drawing, cross
from test_osm_import import check_no_dead_ends

from dojo_maps.bundle import Bundle
from dojo_maps.conversion import convert
from dojo_maps.index import MapIndex
from dojo_maps.sources.netconvert import NetconvertResult, run_netconvert
from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.graph.roundabouts import find_rings
from dojo_maps.sources.osm.graph.steps import build_graph
from dojo_maps.sources.osm.junctions.steps import add_midblock_vertices, plan_junctions
from dojo_maps.sources.osm.layout.heights import compute_heights
from dojo_maps.sources.osm.layout.steps import lay_out
from dojo_maps.sources.osm.network import netconvert_run
from dojo_maps.sources.osm.network.junction_outlines import mend_outlines

STREET = {"highway": "tertiary", "lanes": "2"}
ONE_WAY = {"highway": "tertiary", "oneway": "yes"}


def built(drawing: Drawing, folder: Path) -> tuple[Bundle, dict[str, Any]]:
    """Import a drawing; no import may have errors, short edges or lanes that lead nowhere."""
    bundle, report = convert(str(drawing.write(folder / "a.osm")), folder / "a.dojo")
    assert not [issue["message"] for issue in report["issues"] if issue["severity"] == "error"]
    assert report["osm"]["edges_under_5_m"] == 0
    check_no_dead_ends(bundle)
    return bundle, report


def graph_of(drawing: Drawing, folder: Path) -> RoadGraph:
    path = drawing.write(folder / "a.osm")
    return build_graph(read_osm(path), path)


def small_roundabout(*, left_hand: bool, radius: float = 10.0) -> Drawing:
    """Four arms and zebras around a ring of the size that most have."""
    d = Drawing(centre=LONDON if left_hand else HELSINKI)
    turns = [k * math.pi / 8 * (-1 if left_hand else 1) for k in range(16)]
    ring = [(round(radius * math.cos(turn), 3), round(radius * math.sin(turn), 3)) for turn in turns]
    d.way(*ring, ring[0], highway="tertiary", junction="roundabout")
    for x, y in ring[::4]:
        d.way((x * 12, y * 12), (x * 1.7, y * 1.7), (x, y), **STREET)
        d.node(x * 1.7, y * 1.7, highway="crossing", crossing="uncontrolled")
    return d


@pytest.mark.parametrize("left_hand", [False, True])
def test_small_roundabout_keeps_its_ring(left_hand: bool, tmp_path: Path) -> None:
    bundle, report = built(small_roundabout(left_hand=left_hand), tmp_path)
    ring = [road.id for road in bundle.road_map.roads if road.id.startswith("1001#")]
    assert len(ring) == 4
    assert report["osm"]["crossings"] == {"kept": 4, "of": 4, "share": 1.0}


@pytest.mark.parametrize("leads_in", [False, True])
def test_arm_tagged_as_roundabout_is_no_part_of_the_ring(leads_in: bool, tmp_path: Path) -> None:
    d = Drawing()
    arm = [(60.0, 0.0), (10.0, 0.0)]
    d.way(*(arm if leads_in else arm[::-1]), highway="tertiary", junction="roundabout")
    ring = [
        (round(10 * math.cos(k * math.pi / 8), 3), round(10 * math.sin(k * math.pi / 8), 3))
        for k in range(16)
    ]
    d.way(*ring, ring[0], highway="tertiary", junction="roundabout")
    for x, y in ring[4::4]:
        d.way((x * 12, y * 12), (x, y), **STREET)
    (found,) = find_rings(graph_of(d, tmp_path))
    assert [section.ways[0] for section in found] == [1002] * 4


@pytest.mark.parametrize("degrees", [4.0, 8.0, 16.0])
def test_fork_at_a_sharp_angle_has_its_own_ground(degrees: float, tmp_path: Path) -> None:
    d = Drawing()
    d.way((-150, 0), (0, 0), highway="secondary", lanes="4")
    for sign in (1, -1):
        angle = math.radians(degrees * sign / 2)
        d.way((0, 0), (250 * math.cos(angle), 250 * math.sin(angle)), **STREET)
    _, report = built(d, tmp_path)
    assert report["osm"]["overlap_square_metres"] < 5
    assert report["osm"]["road_metres"]["all"]["share"] > 0.99


def test_fork_of_short_roads_at_a_sharp_angle_has_its_own_ground(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-150, 0), (0, 0), highway="secondary", lanes="4")
    d.way((0, 0), (110, 5), (190, 63), highway="secondary", oneway="yes", lanes="3")
    d.way((0, 0), (110, -5), (190, -63), highway="secondary", oneway="yes", lanes="2")
    _, report = built(d, tmp_path)
    assert report["osm"]["overlap_square_metres"] < 5


@pytest.mark.parametrize("aside", [4.0, 8.0])
@pytest.mark.parametrize("leaves", [True, False])
def test_roads_of_a_fork_whose_stem_is_not_mapped_begin_where_they_have_parted(
    leaves: bool, aside: float, tmp_path: Path
) -> None:
    d = Drawing()
    for side in (-1, 1):
        road = [(0.0, 0.0), (46.0, aside * side), (200.0, 48.0 * side)]
        d.way(*(road if leaves else road[::-1]), **ONE_WAY | {"lanes": "2"})
    d.way((46, -120), (46, -aside), (46, aside), (46, 120), **STREET)
    _, report = built(d, tmp_path)
    assert report["osm"]["overlap_square_metres"] < 5
    assert report["osm"]["road_metres"]["all"]["share"] > 0.98
    assert not [issue for issue in report["issues"] if issue["severity"] == "error"]


def test_slip_lane_that_merges_flat_leaves_no_hole(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-150, 0), (0, 0), (60, 0), (150, 0), highway="secondary", lanes="4")
    d.way((-20, 150), (10, 12), (60, 0), highway="secondary_link", oneway="yes", lanes="2")
    d.way((60, 0), (70, -150), **STREET)
    _, report = built(d, tmp_path)
    assert report["osm"]["overlap_square_metres"] < 5
    assert report["osm"]["road_metres"]["all"]["share"] > 0.99


@pytest.mark.parametrize(("before", "lanes"), [(32.0, "3"), (36.0, "2")])
def test_road_behind_a_slip_road_keeps_its_stop_line_and_crossing(
    before: float, lanes: str, tmp_path: Path
) -> None:
    d = Drawing()
    main = {"highway": "primary", "oneway": "yes", "lanes": lanes}
    d.way((-200, 0), (-before, 0), (-10, 0), (0, 0), (200, 0), **main)
    d.way((0, 200), (0, 0), (0, -before), (0, -200), **main)
    d.way((-before, 0), (-10, -9), (0, -before), highway="primary_link", oneway="yes", lanes="1")
    d.node(0, 0, **SIGNAL)
    d.node(-10, 0, **SIGNAL_CROSSING)
    bundle, report = built(d, tmp_path)
    assert report["osm"]["crossings"] == {"kept": 1, "of": 1, "share": 1.0}
    assert sum(len(junction.polygon) > 3 for junction in bundle.road_map.junctions) == 3


def test_short_road_is_entered_in_the_lane_that_leads_on(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-150, 0), (0, 0), highway="tertiary", lanes="3", lanes__forward="2", lanes__backward="1")
    d.way((0, -150), (0, 0), **ONE_WAY | {"lanes": "2", "turn:lanes": "left|right"})
    short = d.way((0, 0), (34, 0), **ONE_WAY | {"lanes": "2", "turn:lanes": "left|right"})
    d.way((34, 0), (34, 150), **ONE_WAY)
    d.way((34, 0), (34, -150), **ONE_WAY)
    bundle, _ = built(d, tmp_path)
    index = MapIndex(bundle.road_map)
    ways = {
        (index.lanes[into.from_lane].road, index.lanes[on.to_lane].road)
        for lane in index.lanes_of(f"{short}#0")
        for into in index.entering.get(lane.id, ())
        for on in index.leaving.get(lane.id, ())
    }
    assert ways == {(source, target) for source in ("1001#0", "1002#0") for target in ("1004#0", "1005#0")}


def test_sausage_link_parts_on_ground_of_its_own(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-200, 0), (-60, 0), **STREET)
    d.way((-60, 0), (-30, -6), (30, -6), (60, 0), **ONE_WAY)
    d.way((60, 0), (30, 6), (-30, 6), (-60, 0), **ONE_WAY)
    d.way((60, 0), (200, 0), **STREET)
    bundle, _ = built(d, tmp_path)
    outlines = [junction.polygon[:, :2] for junction in bundle.road_map.junctions]
    areas = [shapely.Polygon(outline).area for outline in outlines if len(outline) > 3]
    assert len(areas) == 2
    assert min(areas) > 50


def test_loop_at_the_end_of_a_street_stays(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-100, 0), (0, 0), (100, 0), **STREET)
    d.way((0, 0), (0, 60), (11, 71), (0, 82), (-11, 71), (0, 60), highway="residential", oneway="yes")
    bundle, report = built(d, tmp_path)
    assert report["osm"]["road_metres"]["all"]["share"] > 0.99
    assert sum(road.id.lstrip("-").startswith("1002#") for road in bundle.road_map.roads) >= 3


def test_stub_shorter_than_a_metre_is_no_failure(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-100, 0), (0, 0), (100, 0), **STREET)
    d.way((0, 0), (0, 0.8), **STREET)
    built(d, tmp_path)


def test_roads_drawn_twice_are_one(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-100, 0), (0, 0), (100, 0), **STREET)
    d.way((-100, 0), (0, 0), highway="residential")
    d.way((0, 0), (0, 100), **ONE_WAY)
    d.way((0, 100), (0, 0), **ONE_WAY)
    d.way((0, 0), (0, -50), (0, -100), (0, -50), (0, 0), **STREET)
    graph = graph_of(d, tmp_path)
    lanes = {
        tuple(sorted(section.nodes)): (len(section.road.forward), len(section.road.backward))
        for section in graph.sections.values()
    }
    assert len(lanes) == 4
    assert set(lanes.values()) == {(1, 1)}
    assert set(graph.unread.doubled) == {1002, 1005}
    _, report = built(d, tmp_path)
    found = [issue for issue in report["issues"] if issue["check"] == "osm.parallel_ways"]
    assert len(found) == 2


def test_nodes_on_one_place_do_not_tear_a_road(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-100, 0), (0, 0), (1e-6, 0), (100, 0), **STREET)
    d.way((1e-6, 0), (0, 100), **STREET)
    d.way((0, 0), (0, -100), **STREET)
    graph = graph_of(d, tmp_path)
    assert sorted(map(len, graph.ends().values())) == [1, 1, 1, 1, 4]


def test_road_is_down_where_it_passes_under_a_bridge(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-60, 0), (60, 0), bridge="yes", layer="1", **STREET)
    d.way((60, 0), (100, 30), **STREET)
    d.way((-60, 0), (-60, 40), (0, 40), (0, -150), **STREET)
    graph, heights = compute_heights(graph_of(d, tmp_path))
    under = [node for node in graph.places if node < 0]
    assert len(under) == 1
    assert heights.get(under[0], 0.0) == 0.0
    for section in graph.sections.values():
        for one, other in itertools.pairwise(section.nodes):
            rise = abs(heights.get(one, 0.0) - heights.get(other, 0.0))
            assert rise <= 0.16 * math.dist(graph.places[one], graph.places[other])


def test_tunnel_is_at_its_level_where_it_passes_above_a_deeper_one(tmp_path: Path) -> None:
    d = Drawing()
    d.way((0, 0), (-20, 20), (-300, 20), tunnel="yes", layer="-1", **STREET)
    d.way((0, 0), (-40, -20), (-40, 300), tunnel="yes", layer="-2", **STREET)
    d.way((0, 0), (20, 0), (200, 0), tunnel="yes", layer="-3", **STREET)
    graph, heights = compute_heights(graph_of(d, tmp_path))
    above = [node for node in graph.places if node < 0]
    assert [heights[node] for node in above] == [-5.0]


def test_crossing_without_a_place_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a crossing has no room, netconvert may write nan for its corners."""
    gone = '<crossing node="3" edges="-1001#0 1001#0"'

    def spoil(arguments: list[str], *, folder: Path, timeout: float) -> NetconvertResult:
        result = run_netconvert(arguments, folder=folder, timeout=timeout)
        output = folder / "output.net.xml"
        before, found, after = output.read_text().partition('crossingEdges="-1001#0 1001#0"')
        output.write_text(before + found + after.replace(' shape="', ' shape="-nan,-nan ', 1))
        assert bool(found) == (gone in (folder / "input.con.xml").read_text())
        return result

    monkeypatch.setattr(netconvert_run, "run_netconvert", spoil)
    _, report = built(cross(), tmp_path)
    lost = [issue["message"] for issue in report["issues"] if issue["check"] == "osm.netconvert_failed"]
    assert len(lost) == 1
    assert "no place for it" in lost[0]
    assert report["osm"]["crossings"]["kept"] == report["osm"]["crossings"]["of"] - 1


TWISTED_JUNCTION = b'<junction id="a" type="priority" incLanes="b_0" shape="0,0 10,10 10,0 0,10"/>\n'
TWISTED_AREA = (
    b'<edge id=":a_w0" function="walkingarea"><lane id=":a_w0_0" shape="0,0 10,10 10,0 0,10"/></edge>\n'
)


@pytest.mark.parametrize("twisted", [TWISTED_JUNCTION, TWISTED_AREA], ids=["junction", "walking area"])
def test_outline_that_crosses_itself_is_untwisted(twisted: bytes) -> None:
    whole = b'<junction id="c" type="priority" incLanes="" shape="0,0 10,0 10,10 0,10"/>\n'
    inner = TWISTED_JUNCTION.replace(b'"a"', b'":a_0"')
    mended = mend_outlines(twisted + whole + inner)
    first, rest = mended.split(b"\n", maxsplit=1)
    assert rest == whole + inner
    corners = [
        tuple(map(float, corner.split(b","))) for corner in first.split(b'shape="')[1].split(b'"')[0].split()
    ]
    outline = shapely.Polygon(corners)
    assert outline.is_valid
    assert outline.area >= 50


def test_twisted_outline_may_leave_out_heights_of_zero() -> None:
    twisted = b'<junction id="a" type="priority" incLanes="b_0" shape="0,0 10,10,0.5 10,0 0,10"/>'
    corners = mend_outlines(twisted).split(b'"')[-2].split()
    assert shapely.Polygon([tuple(map(float, corner.split(b",")))[:2] for corner in corners]).is_valid
    assert {corner.count(b",") for corner in corners} == {2}


def test_roads_that_cross_without_a_common_node_meet(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-100, 0), (100, 0), **STREET)
    d.way((100, 0), (100, 100), (0, 100), (10, -100), **STREET)
    d.way((-60, 80), (-60, -80), bridge="yes", **STREET)
    d.way((-60, 80), (0, 100), **STREET)
    _, report = built(d, tmp_path)
    found = [issue for issue in report["issues"] if issue["check"] == "osm.unshared_node"]
    assert [issue["elements"][0]["id"] for issue in found] == ["1001"]
    x, y, _ = found[0]["position"]
    graph = graph_of(d, tmp_path)
    meet = min(graph.ends(), key=lambda vertex: math.dist(graph.places[vertex], (x, y)))
    assert len(graph.ends()[meet]) == 4


def test_lanes_of_a_junction_drawn_one_by_one_are_not_tied(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-100, 0), (100, 0), (100, 100), **ONE_WAY)
    d.way((5, -100), (0, 100), (100, 100), **ONE_WAY)
    assert not graph_of(d, tmp_path).unread.unshared


def test_ramps_in_a_building_lie_on_their_levels(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-150, 0), (0, 0), (150, 0), **STREET)
    d.way((0, 0), (0, 100), tunnel="building_passage", layer="-1", **STREET)
    d.way((0, 100), (40, 100), (-40, 40), tunnel="building_passage", layer="-2", **STREET)
    d.way((-40, 40), (-100, 100), tunnel="building_passage", **STREET)
    layers = [section.road.layer for section in graph_of(d, tmp_path).sections.values()]
    assert sorted(layers) == [-2, -1, 0, 0, 0]


def test_crossing_far_inside_a_wide_junction_is_where_it_is_mapped(tmp_path: Path) -> None:
    """Turning lanes leave the roads long before the middle, and people cross behind where they do."""
    d = Drawing()
    for turn in range(4):
        way, aside = (((1, 0), (0, 1)), ((0, 1), (-1, 0)), ((-1, 0), (0, -1)), ((0, -1), (1, 0)))[turn]

        def at(ahead: float, left: float, way: Any = way, aside: Any = aside) -> tuple[float, float]:
            return (way[0] * ahead + aside[0] * left, way[1] * ahead + aside[1] * left)

        one = {"highway": "primary", "oneway": "yes", "lanes": "2"}
        d.way(at(200, 6), at(42, 6), at(18, 6), at(6, 6), at(-6, 6), at(-18, 6), at(-200, 6), **one)
        d.way(at(42, 6), at(28, 10), at(12, 26), at(6, 42), highway="primary_link", oneway="yes")
        for place in (at(18, 6), at(-18, 6), at(20, 18)):
            d.node(*place, highway="crossing", crossing="traffic_signals")
        for place in (at(6, 6), at(20, 6)):
            d.node(*place, highway="traffic_signals")
    _, report = built(d, tmp_path)
    assert report["osm"]["crossings"]["share"] >= 0.9


def test_crossing_of_lanes_mapped_one_by_one_is_built_once_where_it_is_mapped(tmp_path: Path) -> None:
    """The road parts before it, and a road from a side ends nearby, but does not lead there."""
    d = Drawing()
    d.way((150, 0), (26, 0), highway="primary", oneway="yes", lanes="3")
    d.way((0, 150), (0, 7), (0, 0), (0, -7), (0, -150), **STREET)
    for y in (7, 0, -7):
        d.way((26, 0), (8, y / 2), (0, y), highway="primary", oneway="yes")
        d.node(8, y / 2, highway="crossing", crossing="traffic_signals")
        d.node(0, y, highway="traffic_signals")
    d.node(26, 0, highway="traffic_signals")
    bundle, report = built(d, tmp_path)
    assert report["osm"]["crossings"]["kept"] == 3
    lanes = [lane for lane in bundle.road_map.lanes if lane.road.startswith("1001#")]
    assert max(lane.shape[-1, 0] for lane in lanes) - bundle.road_map.origin[0] < 20.0


def lanes_that_part_far() -> Drawing:
    """Ways inside the junction lead to the crossing, and from behind it, and farther."""
    d = Drawing()
    d.way((180, 0), (58, 0), highway="primary", oneway="yes", lanes="3")
    d.way((0, 150), (0, 7), (0, 0), (0, -7), (0, -150), **STREET)
    d.way((58, 0), (25, 2), (8, 3), (0, 7), highway="primary", oneway="yes")
    d.way((58, 0), (25, -3), (8, -4), (0, -7), highway="primary", oneway="yes")
    d.way((25, 2), (8, 0), (0, 0), highway="primary", oneway="yes")
    for y, beyond in ((3, 7), (0, 0), (-4, -7)):
        d.node(8, y, highway="crossing", crossing="traffic_signals")
        d.node(0, beyond, highway="traffic_signals")
    return d


def test_lanes_that_part_far_before_a_crossing_lie_beside_each_other(tmp_path: Path) -> None:
    _, report = built(lanes_that_part_far(), tmp_path)
    assert report["osm"]["crossings"]["kept"] == 3
    assert report["osm"]["overlap_square_metres"] < 5


def test_road_goes_on_to_a_crossing_inside_its_junction(tmp_path: Path) -> None:
    drawing = lanes_that_part_far()
    vertices = {place: number for place, (number, _) in drawing.nodes.items()}
    joined = [(vertices[58, 0], vertices[25, 2]), (vertices[58, 0], vertices[0, 7])]
    plan = plan_junctions(add_midblock_vertices(graph_of(drawing, tmp_path)), joined)
    layout = lay_out(plan)
    (road,) = (section for section in layout.graph.sections.values() if section.ways[0] == 1001)
    x, _ = layout.trimmed(road.id)[-1]
    assert 8 <= x - layout.graph.places[vertices[0, 0]][0] <= 12


@pytest.mark.parametrize(("x", "beyond"), [(60, 0), (70, 8)])
def test_junctions_that_netconvert_would_draw_into_each_other_stay_two(
    x: int, beyond: int, tmp_path: Path
) -> None:
    """It cuts roads that part slowly where their borders meet, and leaves nothing of those in between."""
    d = Drawing()
    one_way = {"highway": "secondary", "oneway": "yes", "lanes": "2"}
    d.way((-150, 0), (0, 0), **one_way | {"lanes": "4"})
    d.way((0, 0), (x, -1), (x + 120, -2), **one_way)
    d.way((0, 0), (20, 5.6), (x + beyond, 14), (x + 35, 44), (x + 38, 150), **one_way)
    d.way((x, -120), (x, -1), **STREET)
    d.way((x + beyond, -120), (x + beyond, 14), (x + beyond, 120), **STREET)
    d.way((0, -120), (0, 0), (0, 120), **STREET)
    for place in ((0, 0), (x, -1)):
        d.node(*place, highway="traffic_signals")
    bundle, _ = built(d, tmp_path)
    grounds = [
        shapely.Polygon(each.polygon[:, :2]).area for each in bundle.road_map.junctions if len(each.polygon)
    ]
    assert sum(ground > 100 for ground in grounds) == 2
    assert max(grounds) < 1000


def test_lane_that_leaves_beside_a_short_road_lies_on_no_other(tmp_path: Path) -> None:
    """It is drawn from where it leaves, and lies on the road beside it to the next fork and beyond."""
    d = Drawing()
    d.way((-150, 0), (0, 0), highway="primary", oneway="yes", lanes="3")
    d.way((0, 0), (40, 0), highway="primary", oneway="yes", lanes="2")
    d.way((0, 0), (6, -3), (46, -4), (30, -40), (0, -60), (-60, -60), highway="residential", oneway="yes")
    d.way((40, 0), (160, 0), highway="primary", oneway="yes", lanes="2")
    d.way((40, 0), (80, 20), (150, 80), highway="primary", oneway="yes")
    _, report = built(d, tmp_path)
    assert report["osm"]["overlap_square_metres"] < 10


def test_lanes_that_part_slowly_and_end_together_lie_side_by_side(tmp_path: Path) -> None:
    d = Drawing()
    d.way((120, 0), (0, 0), highway="primary", oneway="yes", lanes="3")
    d.way((0, 0), (-77, 1), (-83, 0), highway="primary_link", oneway="yes")
    d.way((0, 0), (-77, 3), (-83, 4), highway="primary", oneway="yes", lanes="2")
    d.way((-83, -100), (-83, 0), (-83, 4), (-83, 100), **STREET)
    d.way((-83, 4), (-200, 4), highway="primary", oneway="yes", lanes="2")
    _, report = built(d, tmp_path)
    assert report["osm"]["overlap_square_metres"] < 5


def test_carriageways_move_apart_only_where_no_third_road_lies(tmp_path: Path) -> None:
    d = Drawing()
    d.way((0, 0), (200, 0), highway="primary", oneway="yes", lanes="2")
    d.way((200, 3.8), (0, 3.8), highway="primary", oneway="yes", lanes="2")
    d.way((200, 8.8), (0, 8.8), highway="tertiary", oneway="yes", lanes="1")
    d.way((0, -100), (0, 0), (0, 3.8), (0, 8.8), (0, 100), **STREET)
    _, report = built(d, tmp_path)
    assert report["osm"]["overlap_square_metres"] < 5


def test_signalised_crossing_beside_a_side_street_has_lights(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-150, 0), (-9, 0), (0, 0), (150, 0), highway="secondary", lanes="2")
    d.way((0, 0), (0, -150), **STREET)
    d.node(-9, 0, highway="crossing", crossing="traffic_signals")
    bundle, report = built(d, tmp_path)
    assert [crossing.signal is not None for crossing in bundle.road_map.crossings].count(True) >= 1
    assert report["osm"]["signalised_junctions"] == {"kept": 1, "of": 1, "share": 1.0}


@pytest.mark.parametrize("left_hand", [False, True])
def test_ways_from_one_road_across_a_wide_junction_do_not_cross(left_hand: bool, tmp_path: Path) -> None:
    """A slip road that joins the road straight on begins beyond it, though it leads back to its side."""
    side = -1 if left_hand else 1
    d = Drawing(centre=LONDON if left_hand else HELSINKI)
    wide = {"highway": "secondary", "oneway": "yes", "lanes": "3"}
    d.way((0, -150), (0, 0), (0, 20), (0, 100), (0, 250), **wide)
    d.way((-150 * side, 0), (-14 * side, 0), (0, 0), (150 * side, 0), **wide)
    d.way((150 * side, 20), (0, 20), (-14 * side, 20), (-150 * side, 20), **wide)
    d.way((-14 * side, 0), (-14 * side, 20), highway="secondary", lanes="2")
    slip = ((-14 * side, 20), (-6 * side, 36), (-6 * side, 60), (0, 100))
    d.way(*slip, highway="secondary_link", oneway="yes")
    for place in ((0, 0), (0, 20), (-14 * side, 0), (-14 * side, 20)):
        d.node(*place, highway="traffic_signals")
    bundle, _ = built(d, tmp_path)
    road = {lane.id: lane.road for lane in bundle.road_map.lanes}
    ways = [
        (way, shapely.linestrings(way.shape[:, :2]))
        for way in bundle.road_map.connections
        if road[way.from_lane] == "1001#0"
    ]
    assert len({road[way.to_lane] for way, _ in ways}) == 4
    assert not [
        (one.id, other.id)
        for (one, shape), (other, line) in itertools.combinations(ways, 2)
        if one.from_lane != other.from_lane and shapely.crosses(shape, line)
    ]


@pytest.mark.parametrize("left_hand", [False, True])
def test_way_back_to_the_road_beside_is_no_turn_to_the_outer_side(left_hand: bool, tmp_path: Path) -> None:
    """Who comes in at a slant and is led back would cross everybody from the lane on his side."""
    side = -1 if left_hand else 1
    d = Drawing(centre=LONDON if left_hand else HELSINKI)
    one_way = {"highway": "secondary", "oneway": "yes", "lanes": "2"}
    d.way((0, -150), (0, -20), (12 * side, 0), (12 * side, 150), **one_way)
    d.way((-12 * side, 150), (-12 * side, 0), (-9 * side, -20), (-9 * side, -150), **one_way)
    d.way((-150 * side, 0), (-12 * side, 0), (12 * side, 0), (150 * side, 0), highway="secondary", lanes="2")
    for place in ((12 * side, 0), (-12 * side, 0)):
        d.node(*place, highway="traffic_signals")
    bundle, _ = built(d, tmp_path)
    road = {lane.id: lane.road for lane in bundle.road_map.lanes}
    ways = {road[way.to_lane]: way for way in bundle.road_map.connections if road[way.from_lane] == "1001#0"}
    assert len(ways) == 3
    assert not [road for road in ways if road.startswith("1002")]


def test_road_is_led_on_beyond_a_crossing_but_onto_no_other(tmp_path: Path) -> None:
    """An extract is cut at a crossing, just before a junction."""
    d = Drawing()
    d.way((0, 0), (100, 100), highway="primary", lanes="2", oneway="yes")
    d.way((3, 150), (3, 17), highway="residential", lanes="2", oneway="yes")
    d.way((100, 100), (300, 100), **STREET)
    d.way((3, 150), (300, 150), **STREET)
    d.node(3, 17, highway="crossing", crossing="marked")
    bundle, report = built(d, tmp_path)
    assert not [issue for issue in report["issues"] if issue["check"] == "geometry.lane_overlap"]
    assert len(bundle.road_map.crossings) == 1


def test_signals_of_junctions_beyond_the_border_and_ramp_meters_are_built(tmp_path: Path) -> None:
    """They are always green, for what crosses there is not on the map."""
    d = cross()
    d.way((150, 0), (298, 0), (300, 0), **ONE_WAY)
    d.node(298, 0, highway="traffic_signals")
    d.way((0, 150), (0, 250), (0, 400), **ONE_WAY)
    d.node(0, 250, highway="traffic_signals", traffic_signals="ramp_meter")
    bundle, report = built(d, tmp_path)
    assert report["osm"]["signalised_junctions"] == {"kept": 3, "of": 3, "share": 1.0}
    states = [
        {phase.state for program in signal.programs for phase in program.phases}
        for signal in bundle.road_map.signals
    ]
    assert len(states) == 3
    assert sum(set("".join(each)) == {"G"} for each in states) == 2
