"""Traffic light programs and the links they control, from a SUMO network's records."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from dojo_maps.description import Connection, Link, LinkKind, Program, Road, Signal
from dojo_maps.errors import SourceError
from dojo_maps.safe_xml import Attributes
from dojo_maps.signals import programs
from dojo_maps.sources.sumo_xml import LogicRecord
from dojo_maps.sources.values import read_link, read_text


def read_signals(
    path: Path,
    logics: Iterable[LogicRecord],
    connections: Iterable[Connection],
    walks: Iterable[Attributes],
    road_of_lane: Mapping[str, Road],
) -> tuple[Signal, ...]:
    """Describe every controller that has a program or a link.

    Args:
        path: named in errors.
        logics: the tlLogic records.
        connections: the connections between normal edges.
        walks: the signalled connections that start or end inside a junction.
        road_of_lane: the road of each lane id.

    Returns:
        Signals in the order of their first program, then those that only links name.

    Raises:
        SourceError: a program has no signal or cannot be described, or a link index is no whole number.
    """
    found: dict[str, list[Program]] = defaultdict(list)
    for record in logics:
        signal = read_text(record.attributes, "id", path, "tlLogic")
        found[signal].append(read_program(record, path))
    links: dict[str, list[Link]] = defaultdict(list)
    junctions: dict[str, dict[str, None]] = defaultdict(dict)
    for connection in connections:
        if connection.signal is None or connection.link_index is None:
            continue
        link = Link(
            index=connection.link_index,
            kind=LinkKind.VEHICLE,
            from_id=connection.from_lane,
            to_id=connection.to_lane,
            direction=connection.direction,
        )
        links[connection.signal].append(link)
        junctions[connection.signal][road_of_lane[connection.from_lane].to_junction] = None
    for walk in walks:
        # Who comes the other way has a letter of its own where the way that leaves the crossing has one.
        crossing = next((walk[end] for end in ("to", "from") if _is_crossing(walk.get(end, ""))), None)
        if crossing is None:
            continue
        what = f"connection {walk.get('from')}->{walk.get('to')}"
        controller, index = read_link(walk, path, what)
        if controller is None or index is None:
            continue
        link = Link(
            index=index,
            kind=LinkKind.PEDESTRIAN,
            from_id=walk.get("from", ""),
            to_id=walk.get("to", ""),
            direction=walk.get("dir", ""),
        )
        links[controller].append(link)
        junctions[controller][crossing.removeprefix(":").rpartition("_c")[0]] = None
    return tuple(
        Signal(
            id=signal,
            junctions=tuple(junctions[signal]),
            links=tuple(sorted(links[signal], key=lambda link: link.index)),
            programs=tuple(found[signal]),
        )
        for signal in dict.fromkeys([*found, *links])
    )


def _is_crossing(edge: str) -> bool:
    """Tell a crossing (:J_c0) from a walking area (:J_w0), an edge inside a junction (:J_0) and roads."""
    return edge.startswith(":") and edge.rpartition("_")[2].startswith("c")


def read_program(record: LogicRecord, path: Path) -> Program:
    """Describe one program of a controller.

    Args:
        record: with the signal's id.
        path: where the network came from, for errors.

    Returns:
        The program, with its times in seconds.

    Raises:
        SourceError: a time is missing or none, or a phase has no state.
    """
    try:
        return programs.read_program(record.attributes, record.phases, record.parameters)
    except ValueError as error:
        raise SourceError(path, str(error), element=f"tlLogic {record.attributes['id']}") from None
