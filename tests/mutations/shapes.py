"""Defects of shapes: lanes, junctions, widths, heights, lengths."""

import itertools
import math
import random
from xml.etree import ElementTree as ET

import shapely
import shapely.ops

from mutations.net import (
    SHAPES,
    TIMES,
    WALKS,
    WAYS,
    Net,
    NoPlaceError,
    Planted,
    Point,
    choose,
    drives,
    is_for_cars,
    is_sidewalk,
    lane_of,
    name_of,
    set_shape,
    shape_of,
)  # fmt: skip


def cross_lanes(net: Net, chance: random.Random) -> Planted:
    """Let two lanes of a road change places on their longest piece."""
    one, other, k = choose(chance, _pieces_side_by_side(net))
    shapes = [shape_of(lane) for lane in (one, other)]
    set_shape(one, [*shapes[0][:k], *shapes[1][k:]])
    set_shape(other, [*shapes[1][:k], *shapes[0][k:]])
    return Planted("geometry.lane_overlap", ("lane", one.get("id", "")), SHAPES)


def swap_lanes(net: Net, chance: random.Random) -> Planted:
    """Exchange the shapes of two lanes of a straight road."""
    pairs = [(one, other) for one, other, _ in _pieces_side_by_side(net) if len(shape_of(one)) == 2]
    one, other = choose(chance, pairs)
    shape = one.get("shape", "")
    one.set("shape", other.get("shape", ""))
    other.set("shape", shape)
    return Planted("geometry.lane_invalid", ("lane", one.get("id", "")), SHAPES)


def _pieces_side_by_side(net: Net) -> list[tuple[ET.Element, ET.Element, int]]:
    """Lanes beside each other, and where their longest piece, over 15 m, ends."""
    found = []
    for edge in net.normal():
        lanes = [lane for lane in edge.iter("lane") if is_for_cars(lane)]
        shapes = [shape_of(lane) for lane in lanes[:2]]
        if len(shapes) == 2 and len(shapes[0]) == len(shapes[1]):
            steps = [min(math.dist(s[k - 1], s[k]) for s in shapes) for k in range(1, len(shapes[0]))]
            if max(steps) > 15:
                found.append((lanes[0], lanes[1], 1 + steps.index(max(steps))))
    return found


def shift_sidewalk(net: Net, chance: random.Random) -> Planted:
    sidewalk, road = choose(chance, _sidewalks_beside_roads(net))
    sidewalk.set("shape", road.get("shape", ""))
    return Planted("geometry.sidewalk_on_road", ("lane", sidewalk.get("id", "")), SHAPES)


def _sidewalks_beside_roads(net: Net) -> list[tuple[ET.Element, ET.Element]]:
    """Sidewalks, each with a lane of its road that cars use and people may not walk on."""
    found = []
    for edge in net.normal():
        first, *rest = edge.iter("lane")
        beside = next((lane for lane in rest if is_for_cars(lane)), None)
        if not is_sidewalk(first) or beside is None or float(beside.get("length", "0")) <= 5:
            continue
        forbidden = "disallow" in beside.attrib or "allow" in beside.attrib
        if forbidden and "pedestrian" not in beside.get("allow", ""):
            found.append((first, beside))
    return found


def tear_lane(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, net.driven())
    *rest, (x, y, *z) = shape_of(lane)
    set_shape(lane, [*rest, (x + chance.choice([-1, 1]), y + chance.choice([-1, 1]), *z)])
    return Planted("geometry.gap", ("lane", lane.get("id", "")), SHAPES)


def squeeze_width(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in net.lanes() if is_for_cars(x) and float(x.get("width", "3.2")) > 2))
    lane.set("width", f"{chance.uniform(0.5, 1.7):.2f}")
    return Planted("geometry.width", ("lane", lane.get("id", "")), SHAPES)


def squeeze_crossing(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in net.lanes("crossing") if float(x.get("width", "4")) >= 2))
    lane.set("width", "1.00")
    return Planted("geometry.width", ("crossing", lane.get("id", "").rpartition("_")[0]), WALKS)


def turn_lane_around(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in net.driven() if float(x.get("length", "0")) > 10 and _is_open_line(x)))
    set_shape(lane, shape_of(lane)[::-1])
    return Planted("topology.wrong_way", ("lane", lane.get("id", "")), SHAPES | WAYS)


def _is_open_line(lane: ET.Element) -> bool:
    points = shape_of(lane)
    return ((points[0][0] - points[-1][0]) ** 2 + (points[0][1] - points[-1][1]) ** 2) ** 0.5 > 10


def repeat_point(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, net.driven())
    first, *rest = shape_of(lane)
    set_shape(lane, [first, (first[0] + 0.02, *first[1:]), *rest])
    return Planted("geometry.lane_invalid", ("lane", lane.get("id", "")), SHAPES)


def kink_lane(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in net.driven() if float(x.get("length", "0")) > 30))
    points = shape_of(lane)
    (x, y, *z), (u, v, *_) = points[0], points[1]
    length = ((u - x) ** 2 + (v - y) ** 2) ** 0.5
    if length < 12:
        raise NoPlaceError
    ahead = ((u - x) / length, (v - y) / length)
    spike = (x + ahead[0] * 3 - ahead[1] * 8, y + ahead[1] * 3 + ahead[0] * 8, *z)
    set_shape(lane, [points[0], (x + ahead[0] * 5, y + ahead[1] * 5, *z), spike, *points[1:]])
    return Planted("geometry.kink", ("lane", lane.get("id", "")), SHAPES)


def lift_lane_end(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, net.driven())
    *rest, last = [(*p[:2], p[2] if len(p) > 2 else 0.0) for p in shape_of(lane)]
    set_shape(lane, [*rest, (*last[:2], last[2] + chance.uniform(0.3, 3.0))])
    return Planted("geometry.z_jump", ("lane", lane.get("id", "")), SHAPES)


def stretch_length(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in net.lanes() if is_for_cars(x) and x.get("index") == "0"))
    lane.set("length", f"{float(lane.get('length', '0')) * 1.5 + 20:.2f}")
    return Planted(
        "geometry.length_mismatch", ("lane", lane.get("id", "")), frozenset({"geometry.short_edge"})
    )


def twist_junction(net: Net, chance: random.Random) -> Planted:
    junctions = [j for j in _drawn_junctions(net) if len(shape_of(j)) > 5]
    chance.shuffle(junctions)
    for junction in junctions:
        points = shape_of(junction)
        points[1], points[3] = points[3], points[1]
        before, after = (shapely.Polygon([p[:2] for p in ring]) for ring in (shape_of(junction), points))
        if before.is_valid and not after.is_valid and _twisted(after) > 0.02 * after.convex_hull.area:
            set_shape(junction, points)
            also = frozenset({"geometry.junction_overlap", "geometry.lane_overlap", "geometry.node_offset"})
            return Planted("geometry.junction_invalid", ("junction", junction.get("id", "")), also)
    raise NoPlaceError


def _twisted(polygon: shapely.Polygon) -> float:
    return shapely.make_valid(polygon).area - polygon.area


def _drawn_junctions(net: Net) -> list[ET.Element]:
    return [j for j in net.root.iter("junction") if len(shape_of(j)) > 2 and j.get("type") != "internal"]


def move_node(net: Net, chance: random.Random) -> Planted:
    junction = choose(chance, _drawn_junctions(net))
    east = max(point[0] for point in shape_of(junction))
    junction.set("x", f"{east + 40:.2f}")
    also = frozenset({"signals.split_signals", "geometry.lane_overlap"})
    return Planted("geometry.node_offset", ("junction", junction.get("id", "")), also)


def stack_junctions(net: Net, chance: random.Random) -> Planted:
    """Draw a junction where another one is."""
    large = [
        j for j in _drawn_junctions(net) if shapely.Polygon([p[:2] for p in shape_of(j)]).buffer(0).area > 5
    ]
    one, other = choose(chance, [(a, b) for a, b in itertools.pairwise(large) if a is not b])
    one.set("shape", other.get("shape", ""))
    also = frozenset({"geometry.node_offset", "geometry.lane_overlap"})
    return Planted("geometry.junction_overlap", ("junction", one.get("id", "")), also, everywhere=True)


def lay_on_opposite(net: Net, chance: random.Random) -> Planted:
    """Draw a lane on one of the opposite direction."""
    by_ends = {(e.get("from"), e.get("to")): next(e.iter("lane")) for e in net.normal()}
    pairs = [
        (lane, by_ends[ends[::-1]])
        for ends, lane in by_ends.items()
        if ends[::-1] in by_ends
        and is_for_cars(lane)
        and is_for_cars(by_ends[ends[::-1]])
        and _is_open_line(lane)
    ]
    lane, other = choose(chance, pairs)
    set_shape(lane, shape_of(other)[::-1])
    return Planted("geometry.lane_overlap", ("lane", lane.get("id", "")), SHAPES)


def widen_lane(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in net.lanes() if is_for_cars(x) and float(x.get("width", "3.2")) <= 4.5))
    lane.set("width", f"{chance.uniform(5, 9):.2f}")
    return Planted("geometry.width", ("lane", lane.get("id", "")), SHAPES)


def squeeze_sidewalk(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in net.lanes() if is_sidewalk(x) and float(x.get("width", "3.2")) > 1.2))
    lane.set("width", "0.60")
    return Planted("geometry.width", ("lane", lane.get("id", "")), SHAPES)


def raise_lane_middle(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in net.driven() if _is_open_line(x)))
    (x, y, *z), (u, v, *w) = shape_of(lane)[:2]
    heights = [z[0] if z else 0.0, w[0] if w else 0.0]
    lift = 0.15 * math.dist((x, y), (u, v)) + 0.5
    middle = ((x + u) / 2, (y + v) / 2, sum(heights) / 2 + lift)
    rest = [(*p[:2], p[2] if len(p) > 2 else 0.0) for p in shape_of(lane)]
    set_shape(lane, [rest[0], middle, *rest[1:]])
    return Planted("geometry.grade", ("lane", lane.get("id", "")), SHAPES)


def hook_lane_end(net: Net, chance: random.Random) -> Planted:
    """Let a lane turn by 50° on its last two metres."""
    lane = choose(chance, (x for x in net.driven() if math.dist(*shape_of(x)[-2:]) > 10))
    *rest, before, last = shape_of(lane)
    length = math.dist(before[:2], last[:2])
    ahead = [(b - a) / length * 2 for a, b in zip(before[:2], last[:2], strict=True)]
    c, s = math.cos(math.radians(50)), math.sin(math.radians(50))
    corner = (last[0] - ahead[0], last[1] - ahead[1], *last[2:])
    end = (corner[0] + ahead[0] * c - ahead[1] * s, corner[1] + ahead[0] * s + ahead[1] * c, *last[2:])
    set_shape(lane, [*rest, before, corner, end])
    return Planted("geometry.tight_radius", ("road", lane.get("id", "").rpartition("_")[0]), SHAPES)


def loop_lane(net: Net, chance: random.Random) -> Planted:
    """Let a lane cross itself."""
    lane = choose(chance, (x for x in net.driven() if _is_open_line(x)))
    first, second, *rest = shape_of(lane)
    (x, y, *z), (u, v, *_) = first, second
    set_shape(
        lane,
        [first, ((x + 3 * u) / 4, (y + 3 * v) / 4, *z), ((x + u) / 2 + 3, (y + v) / 2 + 3, *z),
         ((x + u) / 2 - 3, (y + v) / 2 - 3, *z), ((x + u) / 2 + (v - y) / 4, (y + v) / 2 - (u - x) / 4, *z),
         second, *rest],
    )  # fmt: skip
    if shapely.LineString([p[:2] for p in shape_of(lane)]).is_simple:
        raise NoPlaceError
    return Planted("geometry.lane_invalid", ("lane", lane.get("id", "")), SHAPES)


def shorten_edge(net: Net, chance: random.Random) -> Planted:
    edges = [e for e in net.normal() if all(float(x.get("length", "0")) > 20 for x in e.iter("lane"))]
    inside = [e for e in edges if all(len(net.neighbours(e.get(end, ""))) > 1 for end in ("from", "to"))]
    edge = choose(chance, (e for e in inside if any(map(is_for_cars, e.iter("lane")))))
    for lane in edge.iter("lane"):
        lane.set("length", "2.00")
    return Planted("geometry.short_edge", ("road", edge.get("id", "")), SHAPES)


def _inner_lanes(net: Net) -> dict[str, ET.Element]:
    return {lane.get("id", ""): lane for lane in net.lanes("internal")}


def shrink_way(net: Net, chance: random.Random) -> Planted:
    """Leave of a way across a junction a stump in its middle."""
    inner = _inner_lanes(net)
    onward = {lane_of(c, "from") for c in net.root.iter("connection") if c.get("via")}
    ways = [c for c in net.connections() if c.get("via") in inner and c.get("via") not in onward]
    c = choose(chance, (c for c in ways if is_for_cars(net.lane(c, "from"))))
    lane = inner[c.get("via", "")]
    x, y, *z = shape_of(lane)[0]
    set_shape(lane, [(x, y, *z), (x + 0.3, y, *z)])
    return Planted("geometry.short_connection", ("connection", name_of(c)), SHAPES | TIMES)


def cross_turns(net: Net, chance: random.Random) -> Planted:
    """Let a turn across traffic swing out over the opposite one."""
    inner = _inner_lanes(net)
    turns: dict[str, list[tuple[ET.Element, list[Point]]]] = {}
    for c in net.connections():
        if c.get("dir") == "l" and c.get("via") in inner and drives(net, c):
            turns.setdefault(c.get("from", ""), []).append(
                (c, [p for lane in net.chain(c) for p in shape_of(inner[lane])])
            )
    pairs = [
        (one, other)
        for one in turns
        for other in turns
        if one != other and _pass_each_other(net, [c for c, _ in turns[one]], [c for c, _ in turns[other]])
        and not any(_meet(a, b) for _, a in turns[one] for _, b in turns[other])
    ]  # fmt: skip
    one, other = choose(chance, pairs)
    (c, way), (_, other_way) = turns[one][0], turns[other][0]
    first = inner[c.get("via", "")]
    (x, y, *z), (u, v, *_) = way[0], other_way[len(other_way) // 2]
    swung = [way[0], (x + (u - x) * 1.3, y + (v - y) * 1.3, *z), shape_of(first)[-1]]
    if not _meet(swung, other_way):
        raise NoPlaceError
    set_shape(first, swung)
    return Planted("geometry.intersecting_lefts", ("connection", name_of(c)), SHAPES | TIMES)


def _meet(one: list[Point], other: list[Point]) -> bool:
    return shapely.LineString([p[:2] for p in one]).intersects(shapely.LineString([p[:2] for p in other]))


def _pass_each_other(net: Net, one: list[ET.Element], other: list[ET.Element]) -> bool:
    """Tell whether turns come to one junction from opposite sides."""
    ends = [shape_of(net.lane(turns[0], "from"))[-2:] for turns in (one, other)]
    at = {net.edges[turns[0].get("from", "")].get("to") for turns in (one, other)}
    return len(at) == 1 and _are_opposite(*ends)


def _are_opposite(one: list[Point], other: list[Point]) -> bool:
    ahead = [(b[0] - a[0], b[1] - a[1]) for a, b in (one, other)]
    dot = ahead[0][0] * ahead[1][0] + ahead[0][1] * ahead[1][1]
    return dot < -0.8 * math.hypot(*ahead[0]) * math.hypot(*ahead[1])


def stray_over_road(net: Net, chance: random.Random) -> Planted:
    """Lead a way across a junction over a road that it does not join."""
    inner = _inner_lanes(net)
    at = {}
    for edge in net.normal():
        at.setdefault(edge.get("from"), []).append(edge)
    options = [
        (c, third)
        for c in net.connections()
        if c.get("via") in inner and drives(net, c) and c.get("dir") != "t"
        for third in at.get(net.edges[c.get("from", "")].get("to"), [])
        if third.get("id") != c.get("to") and all(map(_is_drivable_line, third.iter("lane")))
    ]
    c, third = choose(chance, options)
    lane, (start, after, *_) = inner[c.get("via", "")], shape_of(next(third.iter("lane")))
    far = 6 / math.dist(start[:2], after[:2])
    out = tuple(a + (b - a) * far for a, b in zip(start, after, strict=True))
    set_shape(lane, [shape_of(lane)[0], start, out, shape_of(lane)[-1]])
    also = SHAPES | TIMES
    return Planted("topology.median_cross", ("connection", name_of(c)), also)


def _is_drivable_line(lane: ET.Element) -> bool:
    return is_for_cars(lane) and math.dist(*(p[:2] for p in shape_of(lane)[:2])) > 8


def wait_in_path(net: Net, chance: random.Random) -> Planted:
    """Let a turn wait inside a junction where its way has all but left it, beyond the ways of others."""
    inner = _inner_lanes(net)
    others = {
        j.get("id"): [lane for lane in j.get("intLanes", "").split() if "_c" not in lane]
        for j in net.root.iter("junction")
        if j.get("type") == "internal"
    }
    options = [
        (c, chain)
        for c in net.connections()
        if drives(net, c) and "tl" not in c.attrib and len(chain := net.chain(c)) == 2
        if others.get(chain[1])
        if shapely.LineString(shape_of(inner[chain[1]])).length > 5
    ]
    c, (before, after) = choose(chance, options)
    whole = shapely.LineString([*shape_of(inner[before]), *shape_of(inner[after])[1:]])
    for lane, part in ((before, (0.0, -0.5)), (after, (-0.5, whole.length))):
        piece = shapely.ops.substring(whole, *part)
        set_shape(inner[lane], shapely.get_coordinates(piece, include_z=whole.has_z).tolist())
        inner[lane].set("length", f"{piece.length:.2f}")
    return Planted("topology.waits_in_path", ("connection", name_of(c)), SHAPES)
