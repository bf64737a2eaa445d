"""Where people walk, from a SUMO network's records: sidewalks, crossings and walking areas."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import shapely

from dojo_maps.description import (
    Crossing,
    Lane,
    LaneKind,
    Origin,
    Points,
    Sidewalk,
    WalkingArea,
    points,
)
from dojo_maps.geometry.polylines import Flags, strip_outlines
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


def read_crossings(
    records: Sequence[EdgeRecord], walks: Mapping[str, Attributes], path: Path
) -> list[Crossing]:
    """Describe crossings.

    Args:
        records: their edges, `:J_c0`, each with a lane.
        walks: the attributes of the signalled connections onto edges, by their ids.
        path: where the network came from, for errors.

    Returns:
        A crossing for each, 4 m wide where it names no width.

    Raises:
        SourceError: a shape, a width or a link index cannot be used.
    """
    read = [_read_line(record, path) for record in records]
    strips = strip_outlines([shape for shape, _, _ in read], [width for _, width, _ in read])
    agrees = _agree([outline for _, _, outline in read], strips)
    found = []
    for record, (shape, width, outline), strip, agreed in zip(records, read, strips, agrees, strict=True):
        edge = record.attributes["id"]
        signal, link_index = read_link(walks.get(edge, {}), path, f"crossing {edge}")
        found.append(
            Crossing(
                id=edge,
                origin=Origin.NETWORK,
                junction=_junction_of(edge, "c"),
                roads=tuple(record.attributes.get("crossingEdges", "").split()),
                width=width,
                shape=shape,
                polygon=outline if agreed else strip,
                signal=signal,
                link_index=link_index,
            )
        )
    return found


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
    walks = [lane for lane in lanes if lane.kind is LaneKind.SIDEWALK]
    rings = strip_outlines([lane.shape for lane in walks], [lane.width for lane in walks])
    for lane, ring in zip(walks, rings, strict=True):
        yield Sidewalk(id=lane.id, origin=Origin.NETWORK, road=lane.road, polygon=ring)


def _read_line(record: EdgeRecord, path: Path) -> tuple[Points, float, Points]:
    """Read a crossing's centre line, its width, and its own outline; one without corners if it has none."""
    attributes, what = record.lanes[0], f"crossing {record.attributes['id']}"
    shape = read_shape(attributes.get("shape", ""), path, what)
    width = read_float(attributes, "width", path, what, default=_CROSSING_WIDTH, least=MIN_WIDTH)
    drawn = "outlineShape" in attributes
    return shape, width, read_shape(attributes["outlineShape"], path, what) if drawn else points([])


def _agree(outlines: Sequence[Points], strips: Sequence[Points]) -> Flags:
    """Tell which crossings' own outlines are such; netconvert appends stray corners to some."""
    drawn, expected = (
        np.array([shapely.Polygon(ring[:, :2] if len(ring) > 2 else None) for ring in rings], dtype=object)
        for rings in (outlines, strips)
    )
    agrees: Flags = shapely.is_valid(drawn) & ~shapely.is_empty(drawn)
    common = shapely.area(shapely.intersection(drawn[agrees], expected[agrees]))
    either = shapely.area(shapely.union(drawn[agrees], expected[agrees]))
    agrees[agrees] = common >= _OUTLINE_AGREES * either
    return agrees


def _junction_of(edge: str, letter: str) -> str:
    """Find the junction in the id of its crossing (:J_c0) or walking area (:J_w0)."""
    return edge.removeprefix(":").rpartition(f"_{letter}")[0]
