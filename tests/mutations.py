"""Defects planted in real networks: each kind changes one thing, and says who must report it and where.

A kind takes a parsed network and a source of chance and changes the network in place. It returns what it
planted, or None where the network has no place for it.
"""

import copy
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

import shapely

Point = tuple[float, ...]


@dataclass(frozen=True)
class Planted:
    """The check that must report the defect, the element it must name, and who else may speak up about it."""

    check: str
    element: tuple[str, str]
    also: frozenset[str] = frozenset()
    everywhere: bool = False
    """Whether the consequences reach beyond what the element touches."""


@dataclass
class Net:
    """A network's XML tree with the few tables that mutations choose from."""

    root: ET.Element
    edges: dict[str, ET.Element] = field(init=False)

    def __post_init__(self) -> None:
        self.edges = {edge.get("id", ""): edge for edge in self.root.iter("edge")}

    def connections(self) -> list[ET.Element]:
        """Connections between normal edges."""
        return [
            c
            for c in self.root.iter("connection")
            if not c.get("from", "").startswith(":") and not c.get("to", "").startswith(":")
        ]

    def lanes(self, function: str = "normal") -> list[ET.Element]:
        edges = (e for e in self.root.iter("edge") if e.get("function", "normal") == function)
        return [lane for edge in edges for lane in edge.iter("lane")]

    def driven(self) -> list[ET.Element]:
        """Lanes that cars use and that a drawn way leaves."""
        left = {_lane(c, "from") for c in self.connections() if c.get("via")}
        return [lane for lane in self.lanes() if lane.get("id") in left and _is_for_cars(lane)]

    def signals(self) -> list[ET.Element]:
        """Programs of signals that change."""
        return [
            logic
            for logic in self.root.iter("tlLogic")
            if len(list(logic.iter("phase"))) > 1 and not logic.get("type", "static").startswith("rail")
        ]

    def links(self, signal: str) -> dict[int, list[ET.Element]]:
        found: dict[int, list[ET.Element]] = {}
        for c in self.root.iter("connection"):
            if c.get("tl") == signal and int(c.get("linkIndex", "-1")) >= 0:
                found.setdefault(int(c.get("linkIndex", "-1")), []).append(c)
        return found


def _lane(c: ET.Element, end: str) -> str:
    return f"{c.get(end)}_{c.get(f'{end}Lane')}"


def _name(c: ET.Element) -> str:
    return f"{_lane(c, 'from')}->{_lane(c, 'to')}"


def _is_for_cars(lane: ET.Element) -> bool:
    if "allow" in lane.attrib:
        return "passenger" in lane.get("allow", "").split()
    return not {"passenger", "all"} & set(lane.get("disallow", "").split())


def _is_sidewalk(lane: ET.Element) -> bool:
    return lane.get("allow") == "pedestrian"


def _shape(element: ET.Element) -> list[Point]:
    return [tuple(map(float, p.split(","))) for p in element.get("shape", "").split()]


def _set_shape(element: ET.Element, points: Iterable[Point]) -> None:
    element.set("shape", " ".join(",".join(f"{v:.2f}" for v in p) for p in points))


def _choose(chance: random.Random, options: Iterable):
    options = list(options)
    return chance.choice(options) if options else None


_WAYS = frozenset(
    "topology.lane_dead_end topology.lane_no_entry topology.edge_not_connected topology.uturn_only "
    "topology.components topology.missing_turn topology.unreachable_edge_in_tls topology.lane_type_mix "
    "topology.median_cross geometry.short_connection geometry.intersecting_lefts".split()
)
_SHAPES = frozenset(
    "geometry.gap geometry.lane_overlap geometry.sidewalk_on_road geometry.lane_invalid geometry.kink "
    "geometry.tight_radius geometry.length_mismatch geometry.short_connection geometry.intersecting_lefts "
    "geometry.grade geometry.z_jump topology.median_cross topology.missing_turn topology.wrong_way "
    "geometry.crossing_off_road".split()
)
_TIMES = frozenset(
    "signals.missing_yellow signals.yellow_short signals.all_red signals.always_green signals.rl_form "
    "signals.never_green signals.green_conflict signals.cycle signals.green_fraction signals.unused_index "
    "signals.tls_trivial signals.minor_green_fast signals.state_length pedestrians.crossing_clearance "
    "pedestrians.walk_min signals.crossing_uncontrolled_at_tls".split()
)
_WALKS = frozenset(
    "pedestrians.crossing_ends pedestrians.crossing_no_target pedestrians.walk_components "
    "pedestrians.dead_end_walking_area pedestrians.walkway_extent".split()
)


def drop_connection(net: Net, chance: random.Random) -> Planted | None:
    c = _choose(chance, (c for c in net.connections() if c.get("via") and _drives(net, c)))
    if c is None:
        return None
    net.root.remove(c)
    return Planted("topology.missing_turn", ("connection", _name(c)), _WAYS | _TIMES)


def _drives(net: Net, c: ET.Element) -> bool:
    lanes = {lane.get("id"): lane for e in ("from", "to") for lane in net.edges[c.get(e, "")].iter("lane")}
    return all(_is_for_cars(lanes[_lane(c, e)]) for e in ("from", "to"))


def dangle_connection(net: Net, chance: random.Random) -> Planted | None:
    c = _choose(chance, (c for c in net.connections() if _drives(net, c)))
    if c is None:
        return None
    c.set("to", "nowhere")
    return Planted("topology.dangling_reference", ("connection", _name(c)), _WAYS | _TIMES)


def forbid_lane(net: Net, chance: random.Random) -> Planted | None:
    c = _choose(chance, (c for c in net.connections() if _drives(net, c)))
    if c is None:
        return None
    lane = next(x for x in net.edges[c.get("to", "")].iter("lane") if x.get("index") == c.get("toLane"))
    lane.attrib.pop("disallow", None)
    lane.set("allow", "ship")
    also = _WAYS | _SHAPES | {"geometry.short_edge", "geometry.width", "pedestrians.missing_crossing"}
    return Planted("topology.lane_type_mix", ("connection", _name(c)), also)


def cross_lanes(net: Net, chance: random.Random) -> Planted | None:
    pairs = []
    for edge in net.edges.values():
        lanes = [lane for lane in edge.iter("lane") if _is_for_cars(lane)]
        if edge.get("function", "normal") == "normal" and len(lanes) > 1 and float(lanes[0].get("length", "0")) > 20:
            pairs.append(lanes[:2])
    pair = _choose(chance, pairs)
    if pair is None:
        return None
    one, other = (_shape(lane) for lane in pair)
    _set_shape(pair[0], [*one[:-1], other[-1]])
    _set_shape(pair[1], [*other[:-1], one[-1]])
    return Planted("geometry.lane_overlap", ("lane", pair[0].get("id", "")), _SHAPES)


def shift_sidewalk(net: Net, chance: random.Random) -> Planted | None:
    found = []
    for edge in net.edges.values():
        lanes = list(edge.iter("lane"))
        if len(lanes) > 1 and edge.get("function", "normal") == "normal" and _is_sidewalk(lanes[0]):
            beside = next((lane for lane in lanes[1:] if _is_for_cars(lane)), None)
            walkable = beside is None or "disallow" not in beside.attrib and "allow" not in beside.attrib
            if not walkable and "pedestrian" not in (beside.get("allow") or "") and float(beside.get("length", "0")) > 5:
                found.append((lanes[0], beside))
    pair = _choose(chance, found)
    if pair is None:
        return None
    pair[0].set("shape", pair[1].get("shape", ""))
    return Planted("geometry.sidewalk_on_road", ("lane", pair[0].get("id", "")), _SHAPES)


def tear_lane(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, net.driven())
    if lane is None:
        return None
    *rest, (x, y, *z) = _shape(lane)
    _set_shape(lane, [*rest, (x + chance.choice([-1, 1]), y + chance.choice([-1, 1]), *z)])
    return Planted("geometry.gap", ("lane", lane.get("id", "")), _SHAPES)


def squeeze_width(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, (x for x in net.lanes() if _is_for_cars(x) and float(x.get("width", "3.2")) > 2))
    if lane is None:
        return None
    lane.set("width", f"{chance.uniform(0.5, 1.7):.2f}")
    return Planted("geometry.width", ("lane", lane.get("id", "")), _SHAPES)


def squeeze_crossing(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, (x for x in net.lanes("crossing") if float(x.get("width", "4")) >= 2))
    if lane is None:
        return None
    lane.set("width", "1.00")
    return Planted("geometry.width", ("crossing", lane.get("id", "").rpartition("_")[0]), _WALKS)


def turn_lane_around(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, (x for x in net.driven() if float(x.get("length", "0")) > 10 and _is_open_line(x)))
    if lane is None:
        return None
    _set_shape(lane, _shape(lane)[::-1])
    return Planted("topology.wrong_way", ("lane", lane.get("id", "")), _SHAPES | _WAYS)


def _is_open_line(lane: ET.Element) -> bool:
    points = _shape(lane)
    return ((points[0][0] - points[-1][0]) ** 2 + (points[0][1] - points[-1][1]) ** 2) ** 0.5 > 10


def repeat_point(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, net.driven())
    if lane is None:
        return None
    first, *rest = _shape(lane)
    _set_shape(lane, [first, (first[0] + 0.02, *first[1:]), *rest])
    return Planted("geometry.lane_invalid", ("lane", lane.get("id", "")), _SHAPES)


def kink_lane(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, (x for x in net.driven() if float(x.get("length", "0")) > 30))
    if lane is None:
        return None
    points = _shape(lane)
    (x, y, *z), (u, v, *_) = points[0], points[1]
    length = ((u - x) ** 2 + (v - y) ** 2) ** 0.5
    if length < 12:
        return None
    ahead = ((u - x) / length, (v - y) / length)
    spike = (x + ahead[0] * 6 - ahead[1] * 8, y + ahead[1] * 6 + ahead[0] * 8, *z)
    _set_shape(lane, [points[0], (x + ahead[0] * 5, y + ahead[1] * 5, *z), spike, *points[1:]])
    return Planted("geometry.kink", ("lane", lane.get("id", "")), _SHAPES)


def lift_lane_end(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, net.driven())
    if lane is None:
        return None
    *rest, last = [(*p[:2], p[2] if len(p) > 2 else 0.0) for p in _shape(lane)]
    _set_shape(lane, [*rest, (*last[:2], last[2] + chance.uniform(0.3, 3.0))])
    return Planted("geometry.z_jump", ("lane", lane.get("id", "")), _SHAPES)


def stretch_length(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, (x for x in net.lanes() if _is_for_cars(x) and x.get("index") == "0"))
    if lane is None:
        return None
    lane.set("length", f"{float(lane.get('length', '0')) * 1.5 + 20:.2f}")
    return Planted("geometry.length_mismatch", ("lane", lane.get("id", "")), frozenset({"geometry.short_edge"}))


def twist_junction(net: Net, chance: random.Random) -> Planted | None:
    junctions = [j for j in net.root.iter("junction") if len(_shape(j)) > 5 and j.get("type") != "internal"]
    chance.shuffle(junctions)
    for junction in junctions:
        points = _shape(junction)
        points[1], points[3] = points[3], points[1]
        polygon = shapely.Polygon([p[:2] for p in points])
        if not polygon.is_valid and shapely.Polygon([p[:2] for p in _shape(junction)]).is_valid:
            if shapely.make_valid(polygon).area - polygon.area < 0.02 * polygon.convex_hull.area:
                continue
            _set_shape(junction, points)
            also = frozenset({"geometry.junction_overlap", "geometry.lane_overlap", "geometry.node_offset"})
            return Planted("geometry.junction_invalid", ("junction", junction.get("id", "")), also)
    return None


def move_node(net: Net, chance: random.Random) -> Planted | None:
    junction = _choose(chance, (j for j in net.root.iter("junction") if _shape(j) and j.get("type") != "internal"))
    if junction is None:
        return None
    east = max(point[0] for point in _shape(junction))
    junction.set("x", f"{east + 40:.2f}")
    also = frozenset({"signals.split_signals", "geometry.lane_overlap"})
    return Planted("geometry.node_offset", ("junction", junction.get("id", "")), also)


def duplicate_edge(net: Net, chance: random.Random) -> Planted | None:
    edge = _choose(chance, (e for e in net.edges.values() if e.get("function", "normal") == "normal"))
    if edge is None:
        return None
    net.root.insert(list(net.root).index(edge), copy.deepcopy(edge))
    return Planted("topology.duplicate_id", ("road", edge.get("id", "")))


def drop_request(net: Net, chance: random.Random) -> Planted | None:
    junction = _choose(chance, (j for j in net.root.iter("junction") if len(j) > 1))
    if junction is None:
        return None
    junction.remove(_choose(chance, junction.iter("request")))
    return Planted("topology.request_mismatch", ("junction", junction.get("id", "")), _TIMES)


def cut_network(net: Net, chance: random.Random) -> Planted | None:
    middles = {
        edge.get("id", ""): _shape(edge.find("lane"))[0][chance.choice([0])]
        for edge in net.edges.values()
        if edge.get("function", "normal") == "normal" and any(map(_is_for_cars, edge.iter("lane")))
    }
    border = sorted(middles.values())[int(len(middles) * chance.uniform(0.3, 0.7))]
    cut = [
        c
        for c in net.connections()
        if c.get("from") in middles
        and c.get("to") in middles
        and (middles[c.get("from", "")] < border) != (middles[c.get("to", "")] < border)
    ]
    sides = [sum(x < border for x in middles.values()), sum(x >= border for x in middles.values())]
    if not cut or not min(sides):
        return None
    for c in cut:
        net.root.remove(c)
    return Planted("topology.components", ("road", ""), _WAYS | _TIMES, everywhere=True)


def green_foes(net: Net, chance: random.Random) -> Planted | None:
    places = []
    for logic in net.signals():
        ways = {_name(c): i for i, cs in net.links(logic.get("id", "")).items() for c in cs}
        places += [(logic, pair) for pair in _foes(net, ways)]
    chosen = _choose(chance, places)
    if chosen is None:
        return None
    logic, (one, other) = chosen
    phase = _choose(chance, logic.iter("phase"))
    indices = [int(c.get("linkIndex", "0")) for c in net.connections() if _name(c) in (one, other)]
    state = list(phase.get("state", ""))
    for index in indices:
        state[index] = "G"
    phase.set("state", "".join(state))
    return Planted("signals.green_conflict", ("connection", one), _TIMES)


def _foes(net: Net, ways: dict[str, int]) -> list[tuple[str, str]]:
    """Pairs of connections with different letters that a junction's rules call foes."""
    by_via = {}
    onward = {
        f"{c.get('from')}_{c.get('fromLane')}": c.get("via")
        for c in net.root.iter("connection")
        if c.get("from", "").startswith(":") and c.get("via")
    }
    for c in net.connections():
        via = c.get("via")
        while via in onward:
            via = onward[via]
        by_via[via] = _name(c)
    pairs = []
    for junction in net.root.iter("junction"):
        lanes = junction.get("intLanes", "").split()
        names = [by_via.get(lane) for lane in lanes]
        for k, request in enumerate(junction.iter("request")):
            bits = request.get("foes", "")[::-1]
            for j, bit in enumerate(bits[:k]):
                if bit == "1" and names[k] in ways and names[j] in ways and ways[names[k]] != ways[names[j]]:
                    pairs.append((names[k], names[j]))
    return pairs


def never_green(net: Net, chance: random.Random) -> Planted | None:
    logic = _choose(chance, net.signals())
    if logic is None:
        return None
    links = net.links(logic.get("id", ""))
    vehicles = [i for i, cs in links.items() if not any(c.get("to", "").startswith(":") for c in cs)]
    index = _choose(chance, vehicles)
    if index is None:
        return None
    for phase in logic.iter("phase"):
        state = phase.get("state", "")
        phase.set("state", f"{state[:index]}r{state[index + 1 :]}")
    return Planted("signals.never_green", ("connection", _name(links[index][0])), _TIMES)


def cut_state(net: Net, chance: random.Random) -> Planted | None:
    logic = _choose(chance, (x for x in net.root.iter("tlLogic") if net.links(x.get("id", "")) and len(x)))
    if logic is None:
        return None
    phase = _choose(chance, logic.iter("phase"))
    phase.set("state", phase.get("state", "")[:-1])
    if not phase.get("state"):
        return None
    return Planted("signals.state_length", ("signal", logic.get("id", "")), _TIMES)


def _yellow_phases(net: Net, logic: ET.Element) -> list[tuple[int, ET.Element]]:
    vehicles = {
        i for i, cs in net.links(logic.get("id", "")).items() if not any(c.get("to", "").startswith(":") for c in cs)
    }
    phases = list(logic.iter("phase"))
    return [
        (k, phase)
        for k, phase in enumerate(phases)
        if not phase.get("next")
        and any(
            i in vehicles and letter == "y" and phases[k - 1].get("state", "")[i] in "Gg"
            for i, letter in enumerate(phase.get("state", ""))
        )
    ]


def remove_yellow(net: Net, chance: random.Random) -> Planted | None:
    chosen = _choose(chance, ((x, p) for x in net.signals() for _, p in _yellow_phases(net, x)))
    if chosen is None:
        return None
    logic, phase = chosen
    phase.set("state", phase.get("state", "").replace("y", "r"))
    return Planted("signals.missing_yellow", ("signal", logic.get("id", "")), _TIMES)


def shorten_yellow(net: Net, chance: random.Random) -> Planted | None:
    chosen = _choose(
        chance,
        (
            (x, p)
            for x in net.signals()
            for _, p in _yellow_phases(net, x)
            if float(p.get("duration", "0")) >= 3 and not _yellow_goes_on(x, p)
        ),
    )
    if chosen is None:
        return None
    logic, phase = chosen
    phase.set("duration", "1")
    phase.attrib.pop("minDur", None)
    return Planted("signals.yellow_short", ("signal", logic.get("id", "")), _TIMES)


def _yellow_goes_on(logic: ET.Element, phase: ET.Element) -> bool:
    phases = list(logic.iter("phase"))
    after = phases[(phases.index(phase) + 1) % len(phases)].get("state", "")
    return any(a == b == "y" for a, b in zip(phase.get("state", ""), after, strict=True))


def shorten_clearance(net: Net, chance: random.Random) -> Planted | None:
    """Let walkers start until the very phase in which a vehicle that they meet gets its green."""
    places = []
    for logic in net.signals():
        phases = list(logic.iter("phase"))
        for index, cs in net.links(logic.get("id", "")).items():
            crossings = [c.get("to", "") for c in cs if "_c" in c.get("to", "") and c.get("to", "").startswith(":")]
            for k, phase in enumerate(phases):
                before = phases[k - 1].get("state", "")
                starts = _starts_for(net, crossings, logic.get("id", ""), before, phase.get("state", ""))
                walked = any(p.get("state", "")[index] == "G" for p in phases)
                if crossings and starts and walked and phase.get("state", "")[index] == "r" and before[index] == "r":
                    places.append((crossings[0], phases[k - 1], index))
    chosen = _choose(chance, places)
    if chosen is None:
        return None
    crossing, phase, index = chosen
    state = phase.get("state", "")
    phase.set("state", f"{state[:index]}G{state[index + 1 :]}")
    return Planted("pedestrians.crossing_clearance", ("crossing", crossing), _TIMES)


def _starts_for(net: Net, crossings: list[str], signal: str, before: str, after: str) -> bool:
    roads = {road for c in crossings for road in net.edges[c].get("crossingEdges", "").split()}
    for index, cs in net.links(signal).items():
        straight = any(c.get("from") in roads and c.get("dir") in "slr" for c in cs)
        if straight and before[index] not in "Gg" and after[index] == "G":
            return True
    return False


def unlink_crossing(net: Net, chance: random.Random) -> Planted | None:
    signalised = {j.get("id") for j in net.root.iter("junction") if j.get("type", "").startswith("traffic_light")}
    c = _choose(
        chance,
        (
            c
            for c in net.root.iter("connection")
            if "tl" in c.attrib and c.get("to", "")[1:].rpartition("_c")[0] in signalised
        ),
    )
    if c is None:
        return None
    for way in net.root.iter("connection"):
        if way.get("to") == c.get("to"):
            way.attrib.pop("tl", None)
            way.attrib.pop("linkIndex", None)
    return Planted("signals.crossing_uncontrolled_at_tls", ("crossing", c.get("to", "")), _TIMES)


def drop_crossing_target(net: Net, chance: random.Random) -> Planted | None:
    c = _choose(chance, (c for c in net.root.iter("connection") if "_c" in c.get("from", "") and c.get("from", "")[0] == ":"))
    if c is None or net.edges.get(c.get("from", ""), ET.Element("x")).get("function") != "crossing":
        return None
    for way in [w for w in net.root.findall("connection") if w.get("from") == c.get("from")]:
        net.root.remove(way)
    return Planted("pedestrians.crossing_no_target", ("crossing", c.get("from", "")), _WALKS)


def isolate_walking_area(net: Net, chance: random.Random) -> Planted | None:
    area = _choose(chance, (e.get("id") for e in net.edges.values() if e.get("function") == "walkingarea"))
    if area is None:
        return None
    for way in [w for w in net.root.findall("connection") if area in (w.get("from"), w.get("to"))]:
        net.root.remove(way)
    return Planted("pedestrians.walk_components", ("walking_area", area), _WALKS | _TIMES | _WAYS, everywhere=True)


def shrink_walking_area(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, (x for x in net.lanes("walkingarea") if shapely.Polygon(_shape(x)).buffer(0).area > 2))
    if lane is None:
        return None
    points = _shape(lane)
    x, y, *z = points[0]
    _set_shape(lane, [(x + (p[0] - x) * 0.05, y + (p[1] - y) * 0.05, *z) for p in points])
    also = _WALKS | {"geometry.sidewalk_on_road"}
    return Planted("pedestrians.walking_area_invalid", ("walking_area", lane.get("id", "").rpartition("_")[0]), also)


def move_crossing(net: Net, chance: random.Random) -> Planted | None:
    lane = _choose(chance, net.lanes("crossing"))
    if lane is None:
        return None
    _set_shape(lane, [(p[0] + 300, p[1] + 300, *p[2:]) for p in _shape(lane)])
    lane.attrib.pop("outlineShape", None)
    return Planted("geometry.crossing_off_road", ("crossing", lane.get("id", "").rpartition("_")[0]), _WALKS)


KINDS: tuple[Callable[[Net, random.Random], Planted | None], ...] = (
    drop_connection,
    dangle_connection,
    forbid_lane,
    cross_lanes,
    shift_sidewalk,
    tear_lane,
    squeeze_width,
    squeeze_crossing,
    turn_lane_around,
    repeat_point,
    kink_lane,
    lift_lane_end,
    stretch_length,
    twist_junction,
    move_node,
    duplicate_edge,
    drop_request,
    cut_network,
    green_foes,
    never_green,
    cut_state,
    remove_yellow,
    shorten_yellow,
    shorten_clearance,
    unlink_crossing,
    drop_crossing_target,
    isolate_walking_area,
    shrink_walking_area,
    move_crossing,
)
