"""From a CityFlow road network to a SUMO network: read strictly, built by netconvert, what is lost counted.

CityFlow (https://cityflow.readthedocs.io) counts lanes from the road's middle, knows no yellow, and lets each
lane lead to every lane of the next road. SUMO counts from the kerb, and here each lane leads to one lane of a
road; drivers change lanes behind the junction.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

from dojo_maps.description import RoadMap
from dojo_maps.errors import SourceError
from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.safe_json import read_json
from dojo_maps.signals.conflicts import read_conflicts
from dojo_maps.sources.cityflow_files import (
    Fields,
    Flow,
    RoadLink,
    RoadNetwork,
    Traffic,
    read_road_network,
    read_traffic,
)
from dojo_maps.sources.netconvert import NetconvertError, build_from_files, warning_issue
from dojo_maps.sources.sumo_net import read_network

YELLOW = 3.0
"""Seconds, where a link loses its green; the program's next phase is as much shorter."""
_OPTIONS = ("--offset.disable-normalization", "--no-turnarounds")
_CHECK = "sumo.cityflow_lost"

Way = tuple[int, int]
"""A lane of one road and a lane of the next, counted from the middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CityFlowNetwork:
    """A network as netconvert built it.

    Attributes:
        path: of the road network.
        data: the network's bytes.
        routes: SUMO's route file of the traffic; "" without any.
        warnings: netconvert's own.
        losses: what of the file is not in the network, in words, and the signals or roads that it is about.
    """

    path: Path
    data: bytes
    routes: str
    warnings: tuple[str, ...]
    losses: tuple[tuple[str, tuple[Element, ...]], ...]

    def issues(self, road_map: RoadMap) -> tuple[Issue, ...]:
        """List what netconvert warned of, and what of the file is not in the network.

        Args:
            road_map: the description of `data`.

        Returns:
            Notes: of each warning at what it names, then of each loss.
        """
        index = MapIndex(road_map)
        hint = "look at the place in netedit; correct the CityFlow file where it is wrong"
        return (
            *(
                warning_issue(warning, index, check="sumo.cityflow_warning", hint=hint)
                for warning in self.warnings
            ),
            *(
                Issue(
                    check=_CHECK,
                    severity=Severity.NOTE,
                    elements=elements,
                    position=(*road_map.origin, 0.0),
                    message=message,
                    hint="add what is missing in netedit",
                )
                for message, elements in self.losses
            ),
        )


def build_network(path: Path, *, traffic: Path | None = None) -> CityFlowNetwork:
    """Build the network of a CityFlow road network.

    Args:
        path: the file.
        traffic: the file of its traffic, if any.

    Returns:
        The network and its traffic, with what of the files was lost.

    Raises:
        SourceError: it is no road network of CityFlow's, or netconvert refuses it.
        ToolMissingError: netconvert is not installed.
    """
    network = read_road_network(Fields(read_json(path), path))
    flows = read_traffic(traffic) if traffic is not None else None
    ways = {id(link): _choose_ways(link, network) for place in network.places for link in place.links}
    states = {place.id: list(_list_states(place.links, place.phases, ways)) for place in network.places}
    signals = [place.id for place in network.places if len(states[place.id]) > 1]
    plain = _write_plain(network, ways, set(signals))

    def build() -> tuple[bytes, tuple[str, ...]]:
        programs = _write_programs(network, ways, {name: states[name] for name in signals})
        try:
            return build_from_files({**plain, "-i": programs}, _OPTIONS)
        except NetconvertError as error:
            raise SourceError(path, f"netconvert makes no network of it: {error}") from error

    built, warnings = build()
    described, _ = read_network(built, path=path, name=path.stem, sha256="")
    yielding = _let_yield(described, states)
    if yielding:
        built, warnings = build()
    routes, lost = _write_routes(flows, network) if flows is not None else ("", [])
    return CityFlowNetwork(
        path=path,
        data=built,
        routes=routes,
        warnings=warnings,
        losses=(*_tell_losses(network, ways, signals, yielding), *((words, ()) for words in lost)),
    )


def _choose_ways(link: RoadLink, network: RoadNetwork) -> list[Way]:
    """Give each lane that a link begins with one lane to lead to, its own wherever there is room.

    Left turns fill the next road from its middle, right turns from its kerb; straight on, lanes stay.
    """
    width = len(network.roads[link.end].lanes)
    by_lane: dict[int, list[int]] = {}
    for start, end in link.ways:
        by_lane.setdefault(start, []).append(end)
    chosen: list[Way] = []
    taken: set[int] = set()
    for start in sorted(by_lane, reverse=link.turn == "turn_right"):
        wanted = {"go_straight": start, "turn_right": width - 1}.get(link.turn, 0)
        ends = sorted(by_lane[start], key=lambda end: (end in taken, abs(end - wanted), end))
        taken.add(ends[0])
        chosen.append((start, ends[0]))
    return sorted(chosen)


def _list_states(
    links: Sequence[RoadLink], phases: Sequence[tuple[float, frozenset[int]]], ways: Mapping[int, list[Way]]
) -> Iterator[tuple[float, str]]:
    """List a signal's phases with a yellow wherever a link loses its green."""
    shown = [(seconds, available) for seconds, available in phases if seconds > 0]
    if not any(available for _, available in shown):
        return
    late = [bool(shown[k - 1][1] - available) * YELLOW for k, (_, available) in enumerate(shown)]
    for k, (seconds, available) in enumerate(shown):
        following = shown[(k + 1) % len(shown)][1]
        left = seconds - late[k] if seconds > late[k] else seconds
        yield left, _write_state(links, ways, available, frozenset())
        if available - following:
            yield YELLOW, _write_state(links, ways, available & following, available - following)


def _write_state(
    links: Sequence[RoadLink], ways: Mapping[int, list[Way]], green: frozenset[int], yellow: frozenset[int]
) -> str:
    letters = ("G" if k in green else "y" if k in yellow else "r" for k in range(len(links)))
    return "".join(letter * len(ways[id(link)]) for letter, link in zip(letters, links, strict=True))


def _let_yield(road_map: RoadMap, states: dict[str, list[tuple[float, str]]]) -> list[str]:
    """Let who conflicts yield by the network's right of way; list the signals where somebody does."""
    changed = []
    for signal in road_map.signals:
        own = states.get(signal.id, [])
        if not own:
            continue
        conflicts = read_conflicts(road_map, signal, len(own[0][1]))
        safe = [(seconds, conflicts.make_safe(state)) for seconds, state in own]
        if safe != own:
            states[signal.id] = safe
            changed.append(signal.id)
    return changed


def _write_plain(network: RoadNetwork, ways: Mapping[int, list[Way]], signals: set[str]) -> dict[str, str]:
    """Write netconvert's plain files, by the options that take them."""
    nodes = [
        f"<node id={quoteattr(place.id)} x='{place.x}' y='{place.y}' "
        f"type='{'traffic_light' if place.id in signals else 'priority'}'/>"
        for place in network.places
    ]
    edges = []
    for name, road in network.roads.items():
        shape = " ".join(f"{x},{y}" for x, y in road.points)
        edges.append(
            f"<edge id={quoteattr(name)} from={quoteattr(road.start)} to={quoteattr(road.end)} "
            f"numLanes='{len(road.lanes)}' shape='{shape}'>"
        )
        for place, (width, speed) in enumerate(reversed(road.lanes)):
            edges.append(f"<lane index='{place}' width='{width}' speed='{speed}'/>")
        edges.append("</edge>")
    leading = {link.start for place in network.places for link in place.links}
    connections = [f"<connection from={quoteattr(name)}/>" for name in network.roads if name not in leading]
    connections += [
        f"<connection {words}/>" for place in network.places for words in _connect(network, place.links, ways)
    ]
    return {
        "-n": _element("nodes", nodes),
        "-e": _element("edges", edges),
        "-x": _element("connections", connections),
    }


def _connect(network: RoadNetwork, links: Sequence[RoadLink], ways: Mapping[int, list[Way]]) -> Iterator[str]:
    """Write the attributes of each connection, in the order of the signal's letters."""
    for link in links:
        last, first = (len(network.roads[name].lanes) - 1 for name in (link.start, link.end))
        for start, end in ways[id(link)]:
            yield (
                f"from={quoteattr(link.start)} to={quoteattr(link.end)} "
                f"fromLane='{last - start}' toLane='{first - end}'"
            )


def _write_programs(
    network: RoadNetwork, ways: Mapping[int, list[Way]], states: Mapping[str, list[tuple[float, str]]]
) -> str:
    lines = []
    for name, phases in states.items():
        lines.append(f"<tlLogic id={quoteattr(name)} type='static' programID='0' offset='0'>")
        lines += [f"<phase duration='{seconds:g}' state='{state}'/>" for seconds, state in phases]
        lines.append("</tlLogic>")
    for place in network.places:
        if place.id in states:
            lines += [
                f"<connection {words} tl={quoteattr(place.id)} linkIndex='{number}'/>"
                for number, words in enumerate(_connect(network, place.links, ways))
            ]
    return _element("tlLogics", lines)


def _element(root: str, lines: Sequence[str]) -> str:
    return "\n".join([f"<{root}>", *lines, f"</{root}>", ""])


def _tell_losses(
    network: RoadNetwork, ways: Mapping[int, list[Way]], signals: Sequence[str], yielding: Sequence[str]
) -> Iterator[tuple[str, tuple[Element, ...]]]:
    """Tell what of a file is not in the network."""
    links = [link for place in network.places for link in place.links]
    known, kept = sum(len(set(link.ways)) for link in links), sum(len(ways[id(link)]) for link in links)
    if kept < known:
        yield (
            f"{known - kept} of {known} lane links are not in the network: each lane leads to one lane of a "
            "road, and drivers change lanes behind",
            (),
        )
    if signals:
        yield (
            f"CityFlow has no yellow: wherever a link loses its green, the network's programs show "
            f"{YELLOW:g} s of it, and the phase after it is as much shorter",
            _signals(signals),
        )
    if yielding:
        yield (
            "links that are green together and conflict yield by the network's right of way",
            _signals(yielding),
        )
    without = [p.id for p in network.places if p.phases and p.links and p.id not in signals]
    if without:
        named = tuple(Element(kind="junction", id=name) for name in without)
        yield "these junctions have a signal with fewer than two phases; they have none here", named
    if any(place.width > 0 for place in network.places):
        yield "the junctions' widths and the shapes of lane links are netconvert's own", ()


def _signals(names: Sequence[str]) -> tuple[Element, ...]:
    return tuple(Element(kind="signal", id=name) for name in names)


def _write_routes(traffic: Traffic, network: RoadNetwork) -> tuple[str, list[str]]:
    """Write SUMO's route file, and tell what of the traffic is not in it."""
    linked = {(link.start, link.end) for place in network.places for link in place.links}
    types: dict[tuple[tuple[str, float], ...], str] = {}
    departures: list[tuple[float, str]] = []
    unknown = far = 0
    for number, flow in enumerate(traffic.flows):
        if not flow.route or any(road not in network.roads for road in flow.route):
            unknown += 1
            continue
        kind = types.setdefault(tuple(flow.vehicle.items()), f"vehicle_{len(types)}")
        whole = all(pair in linked for pair in pairwise(flow.route))
        far += not whole
        departures.append((flow.start, _write_flow(flow, f"flow_{number}", kind, whole=whole)))
    departures.sort(key=lambda departure: departure[0])
    count = len(traffic.flows)
    told = (
        (unknown, f"{unknown} of {count} flows drive on no road of the network, and are left out"),
        (far, f"{far} of {count} flows skip roads; SUMO finds the way between"),
        (traffic.endless, f"{traffic.endless} of {count} flows have no end; they last for a day here"),
    )
    kinds = [f"<vType id='{name}' {_attributes(values)}/>" for values, name in types.items()]
    lines = [*kinds, *(line for _, line in departures)]
    return _element("routes", lines), [words for number, words in told if number]


def _write_flow(flow: Flow, name: str, kind: str, *, whole: bool) -> str:
    """Write a flow whose roads follow each other, or for which SUMO finds the way."""
    last = flow.start + flow.count * flow.interval
    head = (
        f"<flow id='{name}' type='{kind}' departLane='best' begin='{flow.start:g}' end='{last:g}' "
        f"number='{flow.count}'"
    )
    if whole:
        return f"{head}><route edges={quoteattr(' '.join(flow.route))}/></flow>"
    first, *between, goal = flow.route
    via = f" via={quoteattr(' '.join(between))}" if between else ""
    return f"{head} from={quoteattr(first)} to={quoteattr(goal)}{via}/>"


def _attributes(vehicle: Sequence[tuple[str, float]]) -> str:
    return " ".join(f"{name}='{value:g}'" for name, value in vehicle)
