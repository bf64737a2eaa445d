"""What a converted street has to show: stop lines, signal heads, pavement, crossings, paint, sides."""

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from conftest import NO_GENERATED, Conversion
from oracle import ExpectedLane, ExpectedMap, angle_between, floor
from scene_reader import GROUND, PAINT
from shapely import LineString, MultiPoint, Point, Polygon, box
from shapely.affinity import scale, translate

pytestmark = pytest.mark.sampled(5)

POLE_RADIUS = 0.07
RESCO_WITHOUT_SIDEWALKS = ("bare", "village", "left_hand_bare", "cologne1")


def heading_of(lane: ExpectedLane) -> float:
    """The direction in which traffic reaches the lane's end, radians counter-clockwise from east."""
    x, y = lane.end_direction
    return math.atan2(y, x)


def heads_of(description: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    return [(signal["id"], head) for signal in description["signals"] for head in signal["heads"]]


def needs_stop_line(lane: ExpectedLane) -> bool:
    return lane.has_ground and not lane.is_sidewalk


def beside(lane: ExpectedLane, along: float, aside: float) -> Point:
    """A point beside a lane's middle: a share of its length along, metres to the right."""
    line = LineString([point[:2] for point in lane.shape])
    at = line.interpolate(along, normalized=True)
    ahead = line.interpolate(min(1.0, along + 0.01), normalized=True)
    x, y = ahead.x - at.x, ahead.y - at.y
    size = math.hypot(x, y)
    return Point(at.x + aside * y / size, at.y - aside * x / size)


def outer_side(expected: ExpectedMap) -> float:
    """The side on which lane 0 lies: right where traffic keeps right, left where it keeps left."""
    return -1.0 if expected.left_hand else 1.0


def test_every_signalised_vehicle_lane_has_a_stop_line(conversion: Conversion) -> None:
    expected = conversion.expected
    wanted = {name for name in expected.signalised_lanes if needs_stop_line(expected.lanes[name])}
    assert {line["lane"] for line in conversion.description["stop_lines"]} >= wanted


def test_stop_lines_run_across_their_lane_near_its_end(conversion: Conversion) -> None:
    lanes = conversion.expected.lanes
    for line in conversion.description["stop_lines"]:
        lane = lanes[line["lane"]]
        (x0, y0, _), (x1, y1, _) = line["shape"][0], line["shape"][-1]
        way = math.atan2(y1 - y0, x1 - x0)
        lean = abs(math.remainder(way - heading_of(lane) - math.pi / 2, math.pi))
        assert math.degrees(lean) < 30, lane.id
        assert 0.5 * lane.width < math.hypot(x1 - x0, y1 - y0) < 1.3 * lane.width, lane.id
        centre = LineString([point[:2] for point in lane.shape])
        middle = Point((x0 + x1) / 2, (y0 + y1) / 2)
        assert middle.distance(centre) < 0.3 * lane.width, lane.id
        back = centre.length - centre.project(middle)
        assert back < max(8.0, 0.5 * centre.length), lane.id
        assert back < 15.0, lane.id


def test_stop_line_paint_lies_where_the_map_says(conversion: Conversion) -> None:
    scene = conversion.scene
    paint = scene.tops("stop_line").union
    lines = [LineString([p[:2] for p in line["shape"]]) for line in conversion.description["stop_lines"]]
    for line in lines:
        near = scene.to_local(line.buffer(0.6, cap_style="flat"))
        assert paint.intersection(near).area > 0.1 * line.length
    everywhere = scene.to_local(shapely.union_all([line.buffer(1.0) for line in lines]))
    assert paint.difference(everywhere).area <= 0.01 * paint.area


def test_every_vehicle_link_has_a_head(conversion: Conversion) -> None:
    expected = conversion.expected
    shown = {
        (name, index) for name, head in heads_of(conversion.description) for index in head["link_indices"]
    }
    wanted = {pair for pairs in expected.signalised_lanes.values() for pair in pairs}
    assert not wanted - shown


def test_every_signalised_crossing_has_pedestrian_heads(conversion: Conversion) -> None:
    expected = conversion.expected
    heads = heads_of(conversion.description)
    for crossing in expected.crossings.values():
        if crossing.signal not in expected.programs:
            continue
        mine = [
            head
            for name, head in heads
            if name == crossing.signal and crossing.link_index in head["link_indices"]
        ]
        assert len(mine) >= 2, f"{crossing.id} has {len(mine)} heads, one is wanted at either end"
        line = LineString([point[:2] for point in crossing.shape])
        ends = {round(line.project(Point(head["position"][:2]), normalized=True)) for head in mine}
        assert ends == {0, 1}, crossing.id
        assert all(Point(head["position"][:2]).distance(line) < 10.0 for head in mine), crossing.id


def test_heads_show_only_links_that_exist(conversion: Conversion) -> None:
    for signal in conversion.description["signals"]:
        known = {link["index"] for link in signal["links"]}
        for head in signal["heads"]:
            assert head["link_indices"], signal["id"]
            assert set(head["link_indices"]) <= known, signal["id"]


def test_vehicle_heads_face_the_traffic_they_are_for(conversion: Conversion) -> None:
    expected = conversion.expected
    # A vehicle link and a crossing may share an index; their heads cannot be told apart by it.
    walkers = {(crossing.signal, crossing.link_index) for crossing in expected.crossings.values()}
    heads = heads_of(conversion.description)
    for lane_id, pairs in expected.signalised_lanes.items():
        wanted = heading_of(expected.lanes[lane_id]) + math.pi
        for name, index in pairs:
            mine = [head for owner, head in heads if owner == name and index in head["link_indices"]]
            turned = [math.degrees(angle_between(head["heading"], wanted)) for head in mine]
            assert min(turned) <= 45, (lane_id, name, index)
            assert max(turned) <= 60 or (name, index) in walkers, (lane_id, name, index)


def test_vehicle_heads_stand_ahead_of_or_beside_their_lane(conversion: Conversion) -> None:
    expected = conversion.expected
    walkers = {(crossing.signal, crossing.link_index) for crossing in expected.crossings.values()}
    heads = heads_of(conversion.description)
    for lane_id, pairs in expected.signalised_lanes.items():
        lane = expected.lanes[lane_id]
        end = np.array(lane.shape[-1])
        for name, head in heads:
            if not any((name, index) in pairs - walkers for index in head["link_indices"]):
                continue
            step = np.array(head["position"]) - end
            assert np.hypot(*step[:2]) < 60.0, (lane_id, head)
            # A driver at the stop line, a few metres before the lane's end, must see it in front.
            assert step[:2] @ lane.end_direction > -8.0, (lane_id, head)
            assert 1.0 < step[2] < 9.0, (lane_id, head)


def test_heads_are_where_the_scene_has_signals(conversion: Conversion) -> None:
    scene = conversion.scene
    heads = heads_of(conversion.description)
    corners = scene.triangles("signal").reshape(-1, 3)
    assert bool(heads) == bool(len(corners))
    for name, head in heads:
        place = np.array(head["position"]) - [*scene.origin, 0.0]
        assert np.linalg.norm(corners - place, axis=1).min() < 1.2, (name, head)


def test_signal_poles_do_not_stand_on_driving_lanes(conversion: Conversion) -> None:
    scene, expected = conversion.scene, conversion.expected
    if not expected.is_flat:
        pytest.skip("a pole on a lower level may stand under a road")
    corners = scene.triangles("signal").reshape(-1, 3)
    low = corners[corners[:, 2] < 2.0]
    driving = scene.to_local(expected.driving_ground.buffer(-0.3))
    shapely.prepare(driving)
    assert not shapely.contains_xy(driving, low[:, 0], low[:, 1]).any()


def poles_of(description: dict[str, Any]) -> list[dict[str, Any]]:
    return [prop for prop in description["props"] if prop["kind"] == "pole"]


def test_no_pole_stands_where_vehicles_drive(conversion: Conversion) -> None:
    poles = poles_of(conversion.description)
    feet = shapely.points([pole["position"][:2] for pole in poles]) if poles else []
    traffic = conversion.expected.traffic_ground
    shapely.prepare(traffic)
    hit = shapely.dwithin(traffic, feet, POLE_RADIUS)
    assert not hit.any(), [pole["id"] for pole, inside in zip(poles, hit, strict=True) if inside]


def test_every_approach_and_crossing_end_has_its_pole(conversion: Conversion) -> None:
    expected = conversion.expected
    poles = [dict(pole["tags"]) for pole in poles_of(conversion.description)]
    lanes = expected.signalised_lanes
    wanted = {(signal, expected.lanes[name].edge) for name, pairs in lanes.items() for signal, _ in pairs}
    assert {(tags["signal"], tags["road"]) for tags in poles if "road" in tags} >= wanted
    found = Counter(tags.get("crossing") for tags in poles)
    for crossing in expected.crossings.values():
        # netconvert lets some crossings end in the middle of a junction; a slit there is no place for a pole.
        ends = [Point(crossing.shape[end][:2]) for end in (0, -1)]
        halves = (shapely.voronoi_polygons(MultiPoint(ends), extend_to=ends[0].buffer(50.0))).geoms
        around = [end.buffer(5.0).intersection(next(h for h in halves if h.covers(end))) for end in ends]
        free = [circle.difference(expected.traffic_ground).buffer(-0.2) for circle in around]
        reachable = sum(not ground.is_empty for ground in free)
        if crossing.signal in expected.programs:
            assert reachable <= found[crossing.id] <= 2, crossing.id


@pytest.mark.parametrize("name", RESCO_WITHOUT_SIDEWALKS)
def test_network_without_sidewalks_gets_generated_ones(
    name: str, converted: Callable[..., Conversion]
) -> None:
    conversion = converted(name)
    description, scene = conversion.description, conversion.scene
    assert {item["origin"] for item in description["sidewalks"]} == {"generated"}
    assert scene.tops("sidewalk").total_area > 0.1 * scene.tops("road").total_area


@pytest.mark.parametrize("name", ["bare", "left_hand_bare", "cologne1", "no_internal_lanes"])
def test_signalised_junction_without_crossings_gets_generated_stripes(
    name: str, converted: Callable[..., Conversion]
) -> None:
    conversion = converted(name)
    crossings = conversion.description["crossings"]
    assert len(crossings) >= 3
    assert {item["origin"] for item in crossings} == {"generated"}
    assert {item["link_index"] for item in crossings} == {None}
    assert len(conversion.scene.tops("crossing").triangles) > 0


@pytest.mark.parametrize("name", RESCO_WITHOUT_SIDEWALKS)
def test_no_generated_leaves_generated_things_out(name: str, converted: Callable[..., Conversion]) -> None:
    conversion = converted(name, NO_GENERATED)
    description = conversion.description
    assert not description["sidewalks"]
    assert not description["crossings"]
    assert not description["walking_areas"]
    layers = {part.layer for part in conversion.scene.parts}
    assert not layers & {"sidewalk", "walking_area", "crossing"}


@pytest.mark.parametrize("name", ["bare", "left_hand_bare", "two_programs"])
def test_generated_sidewalks_lie_on_the_outer_side_of_each_road(
    name: str, converted: Callable[..., Conversion]
) -> None:
    conversion = converted(name)
    scene, expected = conversion.scene, conversion.expected
    pavement = scene.tops("sidewalk").union
    bays = [prop["polygon"] for prop in conversion.description["props"] if prop["kind"] == "parking"]
    beside_road = shapely.union_all([pavement, *(scene.to_local(Polygon(bay)) for bay in bays)])
    outward = outer_side(expected)
    for lane in expected.lanes.values():
        aside = outward * (lane.width / 2 + 0.8)
        if lane.index == 0:
            assert beside_road.contains(scene.to_local(beside(lane, 0.5, aside))), lane.id
        assert not pavement.contains(scene.to_local(beside(lane, 0.5, -aside))), lane.id


@pytest.mark.parametrize("name", ["right_hand", "left_hand"])
def test_network_sidewalks_lie_on_the_side_of_lane_zero(
    name: str, converted: Callable[..., Conversion]
) -> None:
    conversion = converted(name)
    scene, expected = conversion.scene, conversion.expected
    pavement = scene.tops("sidewalk").union
    for edge in expected.edges:
        walk, bike = expected.lanes[f"{edge}_0"], expected.lanes[f"{edge}_1"]
        assert pavement.contains(scene.to_local(beside(walk, 0.5, 0.0))), edge
        assert pavement.contains(scene.to_local(beside(bike, 0.5, 2.0 * outer_side(expected)))), edge
        assert not pavement.contains(scene.to_local(beside(bike, 0.5, 0.0))), edge


@pytest.mark.parametrize("layer", [*GROUND, *PAINT])
@pytest.mark.parametrize(("right", "left"), [("right_hand", "left_hand"), ("bare", "left_hand_bare")])
def test_left_hand_network_is_the_mirror_image(
    right: str, left: str, layer: str, converted: Callable[..., Conversion]
) -> None:
    there, here = converted(right).scene, converted(left).scene
    wanted = there.tops(layer).union
    x, y = there.origin
    turned = scale(wanted, xfact=-1.0, yfact=1.0, origin=(0.0, 0.0))
    turned = translate(turned, -x - here.origin[0], y - here.origin[1])
    found = here.tops(layer).union
    # netconvert forgets to mirror the outline of left-hand crossings, so what keeps clear of a crossing may
    # be a little further back in one of the two.
    reach = 0.35 if layer in PAINT else 0.0
    beside = found.difference(turned.buffer(reach)), turned.difference(found.buffer(reach))
    assert sum(part.area for part in beside) <= 0.03 * wanted.area + 0.05
    assert found.area == pytest.approx(wanted.area, rel=0.03, abs=0.05)


def test_left_hand_flag_is_the_networks(converted: Callable[..., Conversion]) -> None:
    assert converted("left_hand").description["left_hand"] is True
    assert converted("right_hand").description["left_hand"] is False


def _divider_paint(conversion: Conversion, row: int) -> float:
    """The marking's area along the line between the two lanes of one of the roads, without its ends."""
    scene = conversion.scene
    place = scene.to_local(box(20.0, 60.0 * row - 3.2 - 0.5, 380.0, 60.0 * row - 3.2 + 0.5))
    return scene.tops("marking").union.intersection(place).area


def test_divider_is_dashed_where_lanes_may_be_changed_and_solid_where_not(
    converted: Callable[..., Conversion],
) -> None:
    conversion = converted("lane_changes")
    free, closed, half = (_divider_paint(conversion, row) for row in range(3))
    assert closed > 360.0 * 0.08
    assert 0.1 * closed < free < 0.7 * closed
    assert half > free


def test_divider_paint_is_in_pieces_where_lanes_may_be_changed(
    converted: Callable[..., Conversion],
) -> None:
    scene = converted("lane_changes").scene
    paint = scene.tops("marking").union
    pieces = {}
    for row, name in enumerate(["free", "closed"]):
        place = scene.to_local(box(20.0, 60.0 * row - 3.7, 380.0, 60.0 * row - 2.7))
        pieces[name] = len(shapely.get_parts(paint.intersection(place).buffer(0.01)))
    assert pieces["closed"] <= 2
    assert pieces["free"] >= 15


def test_road_edges_are_marked(converted: Callable[..., Conversion]) -> None:
    scene = converted("lane_changes", NO_GENERATED).scene
    paint = scene.tops("marking").union
    for row in range(3):
        for edge in (0.0, -6.4):
            place = scene.to_local(box(20.0, 60.0 * row + edge - 0.5, 380.0, 60.0 * row + edge + 0.5))
            assert paint.intersection(place).area > 0.5 * 360.0 * 0.08


@pytest.mark.parametrize("name", ["bare", "right_hand", "cologne1"])
def test_approach_lanes_of_a_signalised_junction_have_turn_arrows(
    name: str, converted: Callable[..., Conversion]
) -> None:
    conversion = converted(name)
    scene, expected = conversion.scene, conversion.expected
    arrows = scene.tops("arrow").union
    for lane_id in expected.signalised_lanes:
        lane = expected.lanes[lane_id]
        if lane.is_driving and lane.length > 40.0:
            area = arrows.intersection(scene.to_local(lane.strip)).area
            assert 0.3 < area < 20.0, lane_id


@pytest.mark.parametrize("name", ["bare", "left_hand_bare"])
def test_turn_arrows_lean_to_the_side_they_turn_to(name: str, converted: Callable[..., Conversion]) -> None:
    conversion = converted(name)
    scene, expected = conversion.scene, conversion.expected
    arrows = scene.tops("arrow").union
    for lane_id in expected.signalised_lanes:
        lane = expected.lanes[lane_id]
        turns = {link.direction for link in expected.connections if link.from_lane == lane_id} - {"t"}
        mark = arrows.intersection(scene.to_local(lane.strip))
        line = scene.to_local(LineString([point[:2] for point in lane.shape]))
        right = mark.intersection(line.buffer(-lane.width, single_sided=True)).area
        left = mark.intersection(line.buffer(lane.width, single_sided=True)).area
        if turns == {"r", "s"}:
            assert right > 1.1 * left, lane_id
        if turns == {"l", "s"}:
            assert left > 1.1 * right, lane_id


def test_crossings_are_striped(conversion: Conversion) -> None:
    scene = conversion.scene
    paint = scene.tops("crossing").union
    crossings = conversion.description["crossings"]
    areas = [floor([tuple(point) for point in item["polygon"]]) for item in crossings]
    all_areas = scene.to_local(shapely.union_all(areas))
    assert paint.difference(all_areas.buffer(0.3)).area <= 0.01 * paint.area
    ground = scene.tops("road", "junction").union
    for item, area in zip(crossings, areas, strict=True):
        carriageway = scene.to_local(area).intersection(ground).area
        if carriageway > 8.0 and conversion.expected.is_flat:
            share = paint.intersection(scene.to_local(area)).area / carriageway
            assert 0.15 < share < 0.85, (item["id"], share)


def test_generated_crossings_span_the_road_they_cross(converted: Callable[..., Conversion]) -> None:
    conversion = converted("bare")
    lanes = conversion.expected.lanes
    assert len(conversion.description["crossings"]) == 4
    for item in conversion.description["crossings"]:
        line = LineString([point[:2] for point in item["shape"]])
        crossed = [lane for lane in lanes.values() if lane.edge in item["roads"]]
        assert len(crossed) == 4, item["id"]
        # Four lanes of 3.2 m, and hardly more than the kerbs on either side.
        assert 11.5 < line.length < 20.0, item["id"]
        area = Polygon([point[:2] for point in item["polygon"]])
        for lane in crossed:
            longer = LineString([point[:2] for point in lane.shape]).buffer(3.0)
            assert area.intersects(longer), (item["id"], lane.id)


def test_no_marking_runs_through_a_junction_floor_or_crossing(
    converted: Callable[..., Conversion],
) -> None:
    scene = converted("bare").scene
    marking = scene.tops("marking").union
    assert marking.intersection(scene.tops("crossing").union).area < 0.05
    assert marking.intersection(scene.tops("junction").union.buffer(-0.3)).area < 0.1 * marking.area


def test_islands_lie_beside_the_carriageway(conversion: Conversion) -> None:
    scene, expected = conversion.scene, conversion.expected
    islands = scene.tops("island").union
    if not expected.is_flat or islands.is_empty:
        pytest.skip("no islands to compare")
    driving = scene.to_local(expected.driving_ground)
    assert islands.intersection(driving).area <= 0.002 * islands.area + 0.1
    assert islands.intersection(scene.ground.union).area <= 0.005 * islands.area + 0.1
