"""Defects of what leads where: connections, permissions, ids, references."""

import copy
import random
from xml.etree import ElementTree as ET

from mutations.net import (
    SHAPES,
    TIMES,
    WAYS,
    Net,
    NoPlaceError,
    Planted,
    choose,
    drives,
    is_for_cars,
    lane_of,
    name_of,
    shape_of,
)


def drop_connection(net: Net, chance: random.Random) -> Planted:
    c = choose(chance, (c for c in net.connections() if c.get("via") and drives(net, c)))
    net.root.remove(c)
    return Planted("topology.missing_turn", ("connection", name_of(c)), WAYS | TIMES)


def dangle_connection(net: Net, chance: random.Random) -> Planted:
    c = choose(chance, (c for c in net.connections() if drives(net, c)))
    c.set("to", "nowhere")
    return Planted("topology.dangling_reference", ("connection", name_of(c)), WAYS | TIMES)


def forbid_lane(net: Net, chance: random.Random) -> Planted:
    """Give a lane to cars alone and the one after it to ships."""
    c = choose(chance, (c for c in net.connections() if drives(net, c)))
    for end, user in (("from", "passenger"), ("to", "ship")):
        net.lane(c, end).attrib.pop("disallow", None)
        net.lane(c, end).set("allow", user)
    also = WAYS | SHAPES | {"geometry.short_edge", "geometry.width", "pedestrians.missing_crossing"}
    return Planted("topology.lane_type_mix", ("connection", name_of(c)), also)


def duplicate_edge(net: Net, chance: random.Random) -> Planted:
    edge = choose(chance, net.normal())
    net.root.insert(list(net.root).index(edge), copy.deepcopy(edge))
    return Planted("topology.duplicate_id", ("road", edge.get("id", "")))


def drop_request(net: Net, chance: random.Random) -> Planted:
    junction = choose(chance, (j for j in net.root.iter("junction") if len(j) > 1))
    junction.remove(choose(chance, junction.iter("request")))
    return Planted("topology.request_mismatch", ("junction", junction.get("id", "")), TIMES)


def cut_network(net: Net, chance: random.Random) -> Planted:
    middles = {
        edge.get("id", ""): shape_of(next(edge.iter("lane")))[0][0]
        for edge in net.normal()
        if any(map(is_for_cars, edge.iter("lane")))
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
        raise NoPlaceError
    net.remove(cut)
    return Planted("topology.components", ("road", ""), WAYS | TIMES, everywhere=True)


def repeat_connection(net: Net, chance: random.Random) -> Planted:
    c = choose(chance, net.connections())
    net.root.append(copy.deepcopy(c))
    return Planted("topology.duplicate_id", ("connection", name_of(c)), TIMES)


def misname_via(net: Net, chance: random.Random) -> Planted:
    c = choose(chance, (c for c in net.connections() if c.get("via")))
    c.set("via", ":nowhere_0_0")
    also = WAYS | TIMES | SHAPES | {"topology.request_mismatch"}
    return Planted("topology.dangling_reference", ("connection", name_of(c)), also)


def misname_junction(net: Net, chance: random.Random) -> Planted:
    edge = choose(chance, net.normal())
    edge.set("to", "nowhere")
    also = WAYS | TIMES | SHAPES | {"geometry.short_edge", "pedestrians.missing_crossing"}
    return Planted("topology.dangling_reference", ("road", edge.get("id", "")), also, everywhere=True)


def _leads_on(net: Net, edge: str, c: ET.Element) -> bool:
    """Tell whether a connection leads elsewhere than back."""
    return net.edges[c.get("to", "")].get("to") != net.edges[edge].get("from") and c.get("dir") in "slrLR"


def strand_lane(net: Net, chance: random.Random) -> Planted:
    """Take all ways from one lane of a road whose other lanes lead on."""
    options = []
    for edge, ways in net.ways().items():
        for lane in net.edges[edge].iter("lane"):
            own = [c for c in ways if c.get("fromLane") == lane.get("index")]
            rest = [c for c in ways if c not in own and drives(net, c) and _leads_on(net, edge, c)]
            if is_for_cars(lane) and rest and any(drives(net, c) for c in own):
                options.append((lane, own))
    lane, own = choose(chance, options)
    net.remove(own)
    return Planted("topology.lane_dead_end", ("lane", lane.get("id", "")), WAYS | TIMES)


def strand_edge(net: Net, chance: random.Random) -> Planted:
    """Take all ways from a road whose junction others leave."""
    edge, ways = choose(chance, _driven_on(net))
    net.remove(ways)
    return Planted("topology.edge_not_connected", ("road", edge), WAYS | TIMES, everywhere=True)


def _driven_on(net: Net) -> list[tuple[str, list[ET.Element]]]:
    return [
        (edge, ways)
        for edge, ways in net.ways().items()
        if any(drives(net, c) and _leads_on(net, edge, c) and c.get("via") for c in ways)
    ]


def turn_back_only(net: Net, chance: random.Random) -> Planted:
    options = [
        (edge, [c for c in ways if c.get("dir") != "t"])
        for edge, ways in _driven_on(net)
        if any(c.get("dir") == "t" and drives(net, c) for c in ways)
    ]
    edge, onward = choose(chance, options)
    net.remove(onward)
    return Planted("topology.uturn_only", ("road", edge), WAYS | TIMES, everywhere=True)


def close_lane(net: Net, chance: random.Random) -> Planted:
    """Take all ways into a lane that several roads lead into."""
    entered: dict[str, list[ET.Element]] = {}
    for c in net.connections():
        entered.setdefault(lane_of(c, "to"), []).append(c)
    options = [
        (lane, ways)
        for lane, ways in entered.items()
        if len({c.get("from") for c in ways if drives(net, c) and _leads_on(net, c.get("from", ""), c)}) > 1
    ]
    lane, ways = choose(chance, options)
    net.remove(ways)
    return Planted("topology.lane_no_entry", ("lane", lane), WAYS | TIMES, everywhere=True)
