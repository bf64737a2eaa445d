"""Where people walk, from a SUMO network's records: sidewalks, crossings and walking areas."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import shapely

from dojo_maps.description import Crossing, Lane, LaneKind, Origin, Points, Sidewalk, WalkingArea
from dojo_maps.geometry.polylines import strip_outline
from dojo_maps.safe_xml import Attributes
from dojo_maps.sources.sumo_xml import EdgeRecord
from dojo_maps.sources.values import MIN_WIDTH, read_float, read_link, read_shape

_CROSSING_WIDTH = 4.0
"""SUMO's default, metres."""
_OUTLINE_AGREES = 0.7
"""Least overlap, as share of the union, of a crossing's outline with the strip along its centre line."""


def walk_connections(connections: list[Attributes]) -> dict[str, Attributes]:
    """Find the signalled way onto each crossing.

    Args:
        connections: the attributes of the network's connections, in file order.

    Returns:
        The first one's attributes by the id of the edge that it leads onto; some lead onto walking areas.
    """
    return {a["to"]: a for a in reversed(connections) if "tl" in a and a.get("to", "").startswith(":")}


def read_crossing(edge: str, record: EdgeRecord, walk: Attributes, path: Path) -> Crossing:
    """Describe a crossing.

    Args:
        edge: its id, `:J_c0`.
        record: its edge, with a lane.
        walk: the attributes of the signalled connection onto it, empty if there is none.
        path: where the network came from, for errors.

    Returns:
        The crossing, 4 m wide where it names no width.

    Raises:
        SourceError: its shape, its width or its link index cannot be used.
    """
    attributes, what = record.lanes[0], f"crossing {edge}"
    shape = read_shape(attributes.get("shape", ""), path, what)
    width = read_float(attributes, "width", path, what, default=_CROSSING_WIDTH, least=MIN_WIDTH)
    signal, link_index = read_link(walk, path, what)
    outline = None
    if "outlineShape" in attributes:
        outline = read_shape(attributes["outlineShape"], path, what)
    return Crossing(
        id=edge,
        origin=Origin.NETWORK,
        junction=_junction_of(edge, "c"),
        roads=tuple(record.attributes.get("crossingEdges", "").split()),
        width=width,
        shape=shape,
        polygon=_crossing_polygon(shape, width, outline),
        signal=signal,
        link_index=link_index,
    )


def read_walking_area(edge: str, record: EdgeRecord, path: Path) -> WalkingArea:
    """Describe a walking area; its lane's shape is its outline.

    Args:
        edge: its id, `:J_w0`.
        record: its edge, with a lane.
        path: where the network came from, for errors.

    Returns:
        The walking area.

    Raises:
        SourceError: its shape cannot be used.
    """
    polygon = read_shape(record.lanes[0].get("shape", ""), path, f"walking area {edge}")
    return WalkingArea(id=edge, origin=Origin.NETWORK, junction=_junction_of(edge, "w"), polygon=polygon)


def sidewalks_of(lanes: Iterable[Lane]) -> Iterator[Sidewalk]:
    """Describe the pavement of each sidewalk lane.

    Args:
        lanes: of any kind.

    Yields:
        The pavement of each sidewalk among them, as wide as its lane.
    """
    for lane in lanes:
        if lane.kind is LaneKind.SIDEWALK:
            ring = strip_outline(lane.shape, lane.width)
            yield Sidewalk(id=lane.id, origin=Origin.NETWORK, road=lane.road, polygon=ring)


def _crossing_polygon(shape: Points, width: float, outline: Points | None) -> Points:
    """Take the crossing's own outline where it is one; netconvert appends stray corners to some."""
    strip = strip_outline(shape, width)
    if outline is None or len(outline) < 3:
        return strip
    drawn, expected = shapely.Polygon(outline[:, :2]), shapely.Polygon(strip[:, :2])
    if not drawn.is_valid or drawn.intersection(expected).area < _OUTLINE_AGREES * drawn.union(expected).area:
        return strip
    return outline


def _junction_of(edge: str, letter: str) -> str:
    """Find the junction in the id of its crossing (:J_c0) or walking area (:J_w0)."""
    return edge.removeprefix(":").rpartition(f"_{letter}")[0]
