"""A SUMO network as an element tree that can be changed and written again, with what refers to what.

Only for networks whose bytes `sumo_xml.read_records` has accepted: it is what refuses unsafe XML.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from dojo_maps.errors import SourceError
from dojo_maps.sources.permissions import allowed_classes
from dojo_maps.sources.sumo_xml import read_records

VehicleKey = tuple[str, int, str, int]
"""A connection between roads: from, fromLane, to, toLane."""
WalkKey = tuple[str, frozenset[str], bool, int]
"""A signalled way: its junction, the roads that its crossing crosses, whether it leads onto it, and a number
that tells crossings over the same roads apart."""

_ROAD_FUNCTIONS = ("normal", "connector")
_XSI = "http://www.w3.org/2001/XMLSchema-instance"


class NetTree:
    """A parsed network and its elements by id.

    Attributes:
        root: the `net` element.
        roads: edges that vehicles or pedestrians travel between junctions.
        crossings: crossing edges.
        walking_areas: walking area edges.
        junctions: without the internal ones.
        vehicle_links: connections between roads.
        walk_links: signalled connections onto or off crossings.
        link_of_lane: the connection between roads that an internal lane of a junction's list belongs to.
    """

    def __init__(self, data: bytes, *, path: Path) -> None:
        """Parse a network.

        Raises:
            SourceError: not a SUMO network, or unsafe; see `read_records`.
        """
        read_records(data, path)
        self.path = path
        self.root: Element = ElementTree.fromstring(data)  # noqa: S314 (checked in the line before)
        self.roads: dict[str, Element] = {}
        self.crossings: dict[str, Element] = {}
        self.walking_areas: dict[str, Element] = {}
        tables = {"crossing": self.crossings, "walkingarea": self.walking_areas}
        tables |= dict.fromkeys(_ROAD_FUNCTIONS, self.roads)
        for edge in self.root.iterfind("edge"):
            table = tables.get(edge.get("function", "normal"))
            if table is not None:
                table[edge.get("id", "")] = edge
        self.junctions = {
            junction.get("id", ""): junction
            for junction in self.root.iterfind("junction")
            if junction.get("type") != "internal"
        }
        self.vehicle_links: dict[VehicleKey, Element] = {}
        self.walk_links: dict[WalkKey, Element] = {}
        self.link_of_lane: dict[str, Element] = {}
        self._read_connections()

    def lanes(self, road: str) -> list[Element]:
        """List a road's lanes by index.

        Args:
            road: its id.

        Returns:
            Their elements; the first is the outermost.

        Raises:
            SourceError: an index is no whole number.
        """
        return sorted(self.roads[road].iterfind("lane"), key=lambda lane: self.number(lane, "index"))

    def logics(self) -> Iterator[Element]:
        """Go through the signal programs in file order."""
        return self.root.iterfind("tlLogic")

    def crossing_length(self, crossing: str) -> float:
        """Measure a crossing from kerb to kerb.

        Args:
            crossing: its id, `:J_c0`.

        Returns:
            Metres; 0 where it has no lane.
        """
        lane = self.crossings[crossing].find("lane")
        return float(lane.get("length", "0")) if lane is not None else 0.0

    def number(self, element: Element, key: str) -> int:
        """Read a whole number of an element.

        Args:
            element: of this network.
            key: the attribute.

        Returns:
            The number.

        Raises:
            SourceError: the attribute is missing or no whole number.
        """
        text = element.get(key, "")
        try:
            return int(text)
        except ValueError:
            raise SourceError(
                self.path,
                f"{key}={text[:80]!r}, expected a whole number",
                element=f"{element.tag} {name(element)}",
            ) from None

    def to_bytes(self) -> bytes:
        """Write the network: the same tree gives the same bytes."""
        ElementTree.register_namespace("xsi", _XSI)
        ElementTree.indent(self.root, "    ")
        text: bytes = ElementTree.tostring(self.root, encoding="UTF-8", xml_declaration=True)
        return text + b"\n"

    def _read_connections(self) -> None:
        after: dict[str, str] = {}
        for connection in self.root.iterfind("connection"):
            start, end = connection.get("from", ""), connection.get("to", "")
            if start in self.roads and end in self.roads:
                first, last = self.number(connection, "fromLane"), self.number(connection, "toLane")
                self.vehicle_links[start, first, end, last] = connection
            elif connection.get("tl") and (start in self.crossings or end in self.crossings):
                self._add_walk_link(connection, onto=end in self.crossings)
            if start.startswith(":") and "via" in connection.attrib:
                after[f"{start}_{connection.get('fromLane')}"] = connection.attrib["via"]
        for connection in self.vehicle_links.values():
            lane = connection.get("via")
            # A turn that waits inside the junction has several lanes; the junction lists the last.
            while lane is not None:
                self.link_of_lane[lane] = connection
                lane = after.pop(lane, None)

    def _add_walk_link(self, connection: Element, *, onto: bool) -> None:
        crossing = connection.get("to" if onto else "from", "")
        crossed = frozenset(self.crossings[crossing].get("crossingEdges", "").split())
        key = (crossing_junction(crossing), crossed, onto)
        number = sum(key == known[:3] for known in self.walk_links)
        self.walk_links[*key, number] = connection


def crossing_junction(crossing: str) -> str:
    """Find the junction in a crossing's id, `:J_c0`.

    Args:
        crossing: the crossing's id.

    Returns:
        The junction's id.
    """
    return crossing.removeprefix(":").rpartition("_c")[0]


def name(element: Element) -> str:
    """Name an element in a message.

    Args:
        element: with an id, or a connection.

    Returns:
        Its id, or `from->to` where it has none.
    """
    return element.get("id") or f"{element.get('from', '')}->{element.get('to', '')}"


def shifted(key: VehicleKey, shift: Mapping[str, int]) -> VehicleKey:
    """Move a connection's lanes by as much as the lanes of their roads moved.

    Args:
        key: the connection in the old network.
        shift: by road, how far its lanes' indices moved.

    Returns:
        The connection in the new network.
    """
    return key[0], key[1] + shift[key[0]], key[2], key[3] + shift[key[2]]


def lane_classes(lane: Element) -> set[str]:
    """List the vehicle classes that may use a lane.

    Args:
        lane: its element.

    Returns:
        Their names, as SUMO has them today.
    """
    return set(allowed_classes(lane.get("allow"), lane.get("disallow")))
