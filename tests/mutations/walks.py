"""Defects of the network that people walk on."""

import copy
import random
from xml.etree import ElementTree as ET

import shapely

from mutations.net import (
    TIMES,
    WALKS,
    WAYS,
    Net,
    NoPlaceError,
    Planted,
    choose,
    is_for_cars,
    is_sidewalk,
    set_shape,
    shape_of,
)  # fmt: skip


def shorten_clearance(net: Net, chance: random.Random) -> Planted:
    """Let walkers start until the very phase in which a vehicle that they meet gets its green."""
    places = []
    for logic in net.signals():
        phases = list(logic.iter("phase"))
        for index, cs in net.links(logic.get("id", "")).items():
            crossings = [
                c.get("to", "") for c in cs if "_c" in c.get("to", "") and c.get("to", "").startswith(":")
            ]
            for k, phase in enumerate(phases):
                before = phases[k - 1].get("state", "")
                starts = _starts_for(net, crossings, logic.get("id", ""), before, phase.get("state", ""))
                walked = any(p.get("state", "")[index] == "G" for p in phases)
                if (
                    crossings
                    and starts
                    and walked
                    and phase.get("state", "")[index] == "r"
                    and before[index] == "r"
                ):
                    places.append((crossings[0], phases[k - 1], index))
    chosen = choose(chance, places)
    crossing, phase, index = chosen
    state = phase.get("state", "")
    phase.set("state", f"{state[:index]}G{state[index + 1 :]}")
    return Planted("pedestrians.crossing_clearance", ("crossing", crossing), TIMES)


def _starts_for(net: Net, crossings: list[str], signal: str, before: str, after: str) -> bool:
    roads = {road for c in crossings for road in net.edges[c].get("crossingEdges", "").split()}
    for index, cs in net.links(signal).items():
        straight = any(c.get("from") in roads and c.get("dir") in "slr" for c in cs)
        if straight and before[index] not in "Gg" and after[index] == "G":
            return True
    return False


def walk_before_green(net: Net, chance: random.Random) -> Planted:
    """Let people walk while those who stand before their crossing have a green that yields."""
    places = []
    for logic in net.signals():
        links = net.links(logic.get("id", ""))
        crossings = {
            c.get("to", ""): index
            for index, cs in links.items()
            for c in cs
            if net.edges[c.get("to", "")].get("function") == "crossing"
        }
        places += [
            (phase, crossing, walk)
            for phase in logic.iter("phase")
            for crossing, walk in crossings.items()
            for drive, cs in links.items()
            if phase.get("state", "")[drive] == "g"
            and any(c.get("from") in net.edges[crossing].get("crossingEdges", "").split() for c in cs)
        ]
    phase, crossing, walk = choose(chance, places)
    state = phase.get("state", "")
    phase.set("state", f"{state[:walk]}G{state[walk + 1 :]}")
    return Planted("pedestrians.walk_before_green", ("crossing", crossing), TIMES)


def unlink_crossing(net: Net, chance: random.Random) -> Planted:
    signalised = {
        j.get("id") for j in net.root.iter("junction") if j.get("type", "").startswith("traffic_light")
    }
    c = choose(
        chance,
        (
            c
            for c in net.root.iter("connection")
            if "tl" in c.attrib and c.get("to", "")[1:].rpartition("_c")[0] in signalised
        ),
    )
    for way in net.root.iter("connection"):
        if way.get("to") == c.get("to"):
            way.attrib.pop("tl", None)
            way.attrib.pop("linkIndex", None)
    return Planted("signals.crossing_uncontrolled_at_tls", ("crossing", c.get("to", "")), TIMES)


def drop_crossing_target(net: Net, chance: random.Random) -> Planted:
    crossing = choose(chance, _edges(net, "crossing"))
    net.remove(w for w in net.root.findall("connection") if w.get("from") == crossing)
    return Planted("pedestrians.crossing_no_target", ("crossing", crossing), WALKS)


def _edges(net: Net, function: str) -> list[str]:
    return [id_ for id_, edge in net.edges.items() if edge.get("function") == function]


def _joined(net: Net, area: str) -> list[ET.Element]:
    """The connections from and to a walking area or crossing."""
    return [c for c in net.root.findall("connection") if area in (c.get("from"), c.get("to"))]


def isolate_walking_area(net: Net, chance: random.Random) -> Planted:
    area = choose(chance, _edges(net, "walkingarea"))
    net.remove(_joined(net, area))
    return Planted(
        "pedestrians.walk_components", ("walking_area", area), WALKS | TIMES | WAYS, everywhere=True
    )


def _corners(net: Net) -> list[ET.Element]:
    """Walking areas that do more than carry one path on into the next."""
    lanes = {lane.get("id", "").rpartition("_")[0]: lane for lane in net.lanes("walkingarea")}
    crossings = set(_edges(net, "crossing"))
    joins = {area: _partners(net, area) for area in lanes}
    return [lane for area, lane in lanes.items() if len(joins[area]) > 2 or joins[area] & crossings]


def shrink_walking_area(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, (x for x in _corners(net) if shapely.Polygon(shape_of(x)).buffer(0).area > 2))
    points = shape_of(lane)
    x, y, *z = points[0]
    set_shape(lane, [(x + (p[0] - x) * 0.05, y + (p[1] - y) * 0.05, *z) for p in points])
    also = WALKS | {"geometry.sidewalk_on_road"}
    return Planted(
        "pedestrians.walking_area_invalid", ("walking_area", lane.get("id", "").rpartition("_")[0]), also
    )


def move_crossing(net: Net, chance: random.Random) -> Planted:
    lane = choose(chance, net.lanes("crossing"))
    set_shape(lane, [(p[0] + 300, p[1] + 300, *p[2:]) for p in shape_of(lane)])
    lane.attrib.pop("outlineShape", None)
    return Planted("geometry.crossing_off_road", ("crossing", lane.get("id", "").rpartition("_")[0]), WALKS)


def split_walking_area(net: Net, chance: random.Random) -> Planted:
    """Make two of a walking area, one of them with a single way to walk off."""
    area = choose(chance, (a for a in _edges(net, "walkingarea") if len(_partners(net, a)) > 2))
    partner = choose(chance, sorted(_partners(net, area)))
    junction = next(j for j in net.root.iter("junction") if j.get("id") == area[1:].rpartition("_")[0])
    if len(net.neighbours(junction.get("id", ""))) < 2:
        raise NoPlaceError
    part = copy.deepcopy(net.edges[area])
    part.set("id", f"{area}0")
    for lane in part.iter("lane"):
        lane.set("id", f"{area}0_0")
    net.root.insert(list(net.root).index(net.edges[area]), part)
    for c in _joined(net, area):
        for end in ("from", "to"):
            if partner in (c.get("from"), c.get("to")) and c.get(end) == area:
                c.set(end, f"{area}0")
    return Planted(
        "pedestrians.dead_end_walking_area", ("walking_area", f"{area}0"), WALKS | TIMES, everywhere=True
    )


def _partners(net: Net, area: str) -> set[str]:
    ends = {(c.get(end, ""), c.get(f"{end}Lane")) for c in _joined(net, area) for end in ("from", "to")}
    return {name for name, _ in ends if name != area}


def leave_crossing_one_end(net: Net, chance: random.Random) -> Planted:
    """Take the ways between a crossing and the walking area at its start."""
    crossing = choose(chance, (c for c in _edges(net, "crossing") if _is_left(net, c)))
    start = next(c.get("from", "") for c in _joined(net, crossing) if c.get("to") == crossing)
    net.remove(c for c in _joined(net, crossing) if start in (c.get("from"), c.get("to")))
    return Planted(
        "pedestrians.crossing_ends", ("crossing", crossing), WALKS | TIMES | {_UNLIT}, everywhere=True
    )


_UNLIT = "signals.crossing_uncontrolled_at_tls"


def _is_left(net: Net, crossing: str) -> bool:
    """Tell whether a way leads off a crossing to another walking area than the one it starts at."""
    starts = {c.get("from") for c in _joined(net, crossing) if c.get("to") == crossing}
    ends = {c.get("to") for c in _joined(net, crossing) if c.get("from") == crossing}
    return bool(starts and ends - starts)


def misname_crossed_road(net: Net, chance: random.Random) -> Planted:
    crossing = choose(chance, _edges(net, "crossing"))
    net.edges[crossing].set("crossingEdges", "nowhere")
    also = WALKS | {"geometry.crossing_off_road", "pedestrians.missing_crossing"}
    return Planted("topology.dangling_reference", ("crossing", crossing), also)


def twist_walking_area(net: Net, chance: random.Random) -> Planted:
    lanes = [x for x in _corners(net) if len(shape_of(x)) > 4]
    chance.shuffle(lanes)
    for lane in lanes:
        points = shape_of(lane)
        points[1], points[3] = points[3], points[1]
        before, after = (shapely.Polygon([p[:2] for p in ring]) for ring in (shape_of(lane), points))
        if before.is_valid and not after.is_valid and shapely.make_valid(after).area > 1.05 * abs(after.area):
            set_shape(lane, points)
            also = WALKS | {"geometry.sidewalk_on_road"}
            area = lane.get("id", "").rpartition("_")[0]
            return Planted("pedestrians.walking_area_invalid", ("walking_area", area), also)
    raise NoPlaceError


def hurry_walkers(net: Net, chance: random.Random) -> Planted:
    """Leave walkers two seconds of green."""
    options = []
    for logic in net.signals():
        for index, cs in net.links(logic.get("id", "")).items():
            crossings = [
                c.get("to", "") for c in cs if net.edges[c.get("to", "")].get("function") == "crossing"
            ]
            greens = [p for p in logic.iter("phase") if p.get("state", "")[index] in "Gg"]
            if crossings and len(greens) == 1 and float(greens[0].get("duration", "0")) >= 7:
                options.append((crossings[0], greens[0]))
    crossing, phase = choose(chance, options)
    phase.set("duration", "2")
    phase.attrib.pop("minDur", None)
    return Planted("pedestrians.walk_min", ("crossing", crossing), TIMES)


def drop_crossing(net: Net, chance: random.Random) -> Planted:
    """Take the crossings off a leg of a signal that has sidewalks on both sides."""
    lit = {
        j.get("id", "") for j in net.root.iter("junction") if j.get("type", "").startswith("traffic_light")
    }
    options = []
    for junction in sorted(name for name in lit if len(net.neighbours(name)) > 2):
        for edge in net.normal():
            ends = (edge.get("from"), edge.get("to"))
            backs = [e for e in net.normal() if ends == (e.get("to"), e.get("from"))]
            legs = [edge, *backs]
            if edge.get("to") == junction and len(backs) == 1 and all(map(_has_sidewalk, legs)):
                crossings = _crossings_of(net, junction, {leg.get("id", "") for leg in legs})
                options += [(junction, crossings)] if crossings else []
    junction, crossings = choose(chance, options)
    for crossing in crossings:
        net.remove(_joined(net, crossing))
        net.root.remove(net.edges[crossing])
    also = WALKS | TIMES | {"topology.request_mismatch"}
    return Planted("pedestrians.missing_crossing", ("junction", junction), also)


def _has_sidewalk(edge: ET.Element) -> bool:
    lanes = list(edge.iter("lane"))
    return any(map(is_sidewalk, lanes)) and any(map(is_for_cars, lanes))


def _crossings_of(net: Net, junction: str, roads: set[str]) -> list[str]:
    """The crossings of a junction that cross some of the roads."""
    return [
        name
        for name in _edges(net, "crossing")
        if name.rpartition("_")[0] == f":{junction}"
        and roads & set(net.edges[name].get("crossingEdges", "").split())
    ]


def cramp_walkers(net: Net, chance: random.Random) -> Planted:
    """Press the walking area at the end of a crossing together."""
    options = []
    for crossing in _edges(net, "crossing"):
        areas = [c.get("to", "") for c in _joined(net, crossing) if c.get("from") == crossing]
        options += [(crossing, area) for area in areas if net.edges[area].get("function") == "walkingarea"]
    crossing, area = choose(chance, options)
    x, y, *z = shape_of(next(net.edges[crossing].iter("lane")))[-1]
    for lane in net.edges[area].iter("lane"):
        set_shape(lane, [(x + (p[0] - x) * 0.05, y + (p[1] - y) * 0.05, *z) for p in shape_of(lane)])
    also = WALKS | {"geometry.sidewalk_on_road", "pedestrians.walking_area_invalid"}
    return Planted("pedestrians.walkway_extent", ("crossing", crossing), also)
