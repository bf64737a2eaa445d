"""What is to be built of tracks: their edges, where they meet roads, and the ways across junctions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.graph.street_tracks import StreetPart
from dojo_maps.sources.osm.layout.arms import Arm


class TrackEdge(NamedTuple):
    """An edge that trams, trains or bicycles take.

    Attributes:
        edge: of a track, or of a road.
        lane: of a road, counted from the outermost; -1 for a track, which has one only.
    """

    edge: EdgeId
    lane: int = -1


class TrackLink(NamedTuple):
    """A way across a junction.

    Attributes:
        node: the junction.
        source: where it comes from.
        target: where it leads to.
        through: the tracks inside the junction that it follows, in order.
    """

    node: int
    source: TrackEdge
    target: TrackEdge
    through: tuple[EdgeId, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Meeting:
    """Where a track meets a road: the junction, and the arms that begin there."""

    junction: int
    arms: tuple[Arm, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackLayout:
    """What is to be built of tracks; the first three are known before the roads' junctions have outlines.

    Attributes:
        graph: the tracks, cut at their nodes.
        meetings: where they meet roads, by node.
        streets: the street that sections run in.
        nodes: the junction or the own node of each vertex.
        built: the sections that are edges of their own, and the metres they are drawn back at both ends.
        links: ways across junctions, in order.
        outlines: of the junctions that tracks lead into, as they are without tracks: they keep them.
        closed: junctions that tracks lead over without a link, for their roads would have no room left.
    """

    graph: RoadGraph
    meetings: Mapping[int, Meeting]
    streets: Mapping[str, StreetPart]
    nodes: Mapping[int, int] = field(default_factory=dict)
    built: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    links: Sequence[TrackLink] = ()
    outlines: Mapping[int, Floats] = field(default_factory=dict)
    closed: frozenset[int] = frozenset()
