"""Stream a SUMO network's XML into plain records, safely: no document type, no entities, no surprises.

The records keep SUMO's words and text values; `sumo_net` gives them meaning.
"""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from dojo_maps.safe_xml import Attributes, parse_xml


@dataclass(slots=True)
class EdgeRecord:
    """An edge element with its lanes, in file order."""

    attributes: Attributes
    lanes: list[Attributes] = field(default_factory=list)
    opposites: dict[str, str] = field(default_factory=dict)
    stop_offsets: list[str] = field(default_factory=list)
    """The lane of each stop offset."""


@dataclass(slots=True)
class LogicRecord:
    """A tlLogic element with its phases, and its parameters by key."""

    attributes: Attributes
    phases: list[Attributes] = field(default_factory=list)
    parameters: Attributes = field(default_factory=dict)


@dataclass(slots=True)
class NetRecords:
    """Everything of a network file that the description is made from."""

    net: Attributes = field(default_factory=dict)
    location: Attributes = field(default_factory=dict)
    edges: list[EdgeRecord] = field(default_factory=list)
    junctions: list[Attributes] = field(default_factory=list)
    requests: dict[str, list[Attributes]] = field(default_factory=lambda: defaultdict(list))
    connections: list[Attributes] = field(default_factory=list)
    logics: list[LogicRecord] = field(default_factory=list)


def read_records(data: bytes, path: Path | str) -> NetRecords:
    """Read a network's elements.

    Args:
        data: the file's bytes, unpacked.
        path: named in errors.

    Returns:
        The elements, in file order.

    Raises:
        SourceError: not well-formed, not a SUMO network, or XML with a document type or entities.
    """
    records = NetRecords()

    def stop_offset(_attributes: Attributes) -> None:
        edge = records.edges[-1] if records.edges else None
        if edge is not None and edge.lanes:  # Else it is the edge's own.
            edge.stop_offsets.append(edge.lanes[-1].get("id", ""))

    handlers: dict[str, Callable[[Attributes], None]] = {
        "net": records.net.update,
        "location": records.location.update,
        "edge": lambda a: records.edges.append(EdgeRecord(a)),
        "lane": lambda a: records.edges[-1].lanes.append(a),  # noqa: PLW0108 - the last edge of that moment
        "neigh": lambda a: records.edges[-1].opposites.update(
            {records.edges[-1].lanes[-1].get("id", ""): a.get("lane", "")}
        ),
        "stopOffset": stop_offset,
        "junction": records.junctions.append,
        "request": lambda a: records.requests[records.junctions[-1].get("id", "")].append(a),  # noqa: PLW0108
        "connection": records.connections.append,
        "tlLogic": lambda a: records.logics.append(LogicRecord(a)),
        "phase": lambda a: records.logics[-1].phases.append(a),  # noqa: PLW0108
    }

    owner = ""

    def start(name: str, attributes: Attributes) -> None:
        nonlocal owner
        handler = handlers.get(name)
        if handler:
            handler(attributes)
        if name != "param":
            owner = name
        elif owner in ("tlLogic", "phase"):
            records.logics[-1].parameters[attributes.get("key", "")] = attributes.get("value", "")

    parse_xml(data, path, root="net", kind="SUMO network", start=start)
    return records
