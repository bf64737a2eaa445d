"""Stream a SUMO network's XML into plain records, safely: no document type, no entities, no surprises.

The records keep SUMO's words and text values; `sumo_net` gives them meaning.
"""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from dojo_maps.errors import SourceError

Attributes = dict[str, str]


@dataclass(slots=True)
class EdgeRecord:
    """An edge element with its lanes, in file order."""

    attributes: Attributes
    lanes: list[Attributes] = field(default_factory=list)
    opposites: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class LogicRecord:
    """A tlLogic element with its phases."""

    attributes: Attributes
    phases: list[Attributes] = field(default_factory=list)


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

    Raises:
        SourceError: not well-formed, not a SUMO network, or XML with a document type or entities.
    """
    records = NetRecords()
    handlers: dict[str, Callable[[Attributes], None]] = {
        "net": records.net.update,
        "location": records.location.update,
        "edge": lambda a: records.edges.append(EdgeRecord(a)),
        "lane": lambda a: records.edges[-1].lanes.append(a),  # noqa: PLW0108 - the last edge of that moment
        "neigh": lambda a: records.edges[-1].opposites.update(
            {records.edges[-1].lanes[-1].get("id", ""): a.get("lane", "")}
        ),
        "junction": records.junctions.append,
        "request": lambda a: records.requests[records.junctions[-1].get("id", "")].append(a),  # noqa: PLW0108
        "connection": records.connections.append,
        "tlLogic": lambda a: records.logics.append(LogicRecord(a)),
        "phase": lambda a: records.logics[-1].phases.append(a),  # noqa: PLW0108
    }
    open_elements: list[str] = []

    def start(name: str, attributes: Attributes) -> None:
        if not open_elements and name != "net":
            raise SourceError(path, f"not a SUMO network: the root element is <{name[:80]}>, expected <net>")
        if len(open_elements) > 16:
            raise SourceError(path, f"<{name[:80]}> is nested more than 16 deep; not a SUMO network")
        open_elements.append(name)
        handler = handlers.get(name)
        if handler:
            try:
                handler(attributes)
            except IndexError:
                raise SourceError(path, f"<{name}> stands where SUMO allows none", element=_at()) from None

    def refuse(*_: object) -> None:
        raise SourceError(
            path, "has a document type or entities, which no SUMO network has; refused as unsafe"
        )

    def _at() -> str:
        return f"line {parser.CurrentLineNumber}"

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _name: open_elements.pop()
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        problem = expat.ErrorString(error.code) or "unknown problem"
        raise SourceError(path, f"not well-formed XML ({problem})", element=f"line {error.lineno}") from error
    except (LookupError, ValueError) as error:
        raise SourceError(path, f"its text encoding cannot be read: {error}; save it as UTF-8") from error
    return records
