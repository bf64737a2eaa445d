"""Turns to the outer side that lead over a cycle track."""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.layout.arms import Arm, Layout, trim
from dojo_maps.sources.osm.layout.track_layout import TrackEdge, TrackLayout, TrackLink
from dojo_maps.sources.osm.plain.lane_connections import STRAIGHT
from dojo_maps.sources.osm.plain.movements import Movement
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY


def find_turns_over_tracks(layout: Layout, movements: Iterable[Movement]) -> set[Movement]:
    """Find the turns to the outer side that cyclists on a track cross, each drawn straight.

    Args:
        layout: with its tracks settled.
        movements: of all junctions.

    Returns:
        Those of the movements; none where there are no tracks.
    """
    if layout.tracks is None:
        return set()
    ways = defaultdict(list)
    for link in layout.tracks.links:
        if _is_cycled(layout.tracks, link):
            ways[link.node].append(shapely.LineString(_draw(layout, layout.tracks, link)))
    found = set()
    for turn in movements:
        if turn.angle < -STRAIGHT and (crossing := ways.get(layout.junction(turn.source))):
            line = shapely.LineString([_end(layout, turn.source), _end(layout, turn.target)])
            if shapely.crosses(crossing, line).any():
                found.add(turn)
    return found


def _is_cycled(tracks: TrackLayout, link: TrackLink) -> bool:
    names = (link.source.edge.section, link.target.edge.section, *(edge.section for edge in link.through))
    return any(n in tracks.graph.sections and tracks.graph.sections[n].road.kind == CYCLEWAY for n in names)


def _draw(layout: Layout, tracks: TrackLayout, link: TrackLink) -> Floats:
    """Draw a way across a junction, (n, 2) metres."""
    inside = [_driven(tracks, edge) for edge in link.through]
    begin = _place(layout, tracks, link.source, at_end=link.source.edge.forward)
    end = _place(layout, tracks, link.target, at_end=not link.target.edge.forward)
    return np.vstack([begin, *inside, end])


def _driven(tracks: TrackLayout, edge: EdgeId) -> Floats:
    line = tracks.graph.line(tracks.graph.sections[edge.section])
    return line if edge.forward else line[::-1]


def _place(layout: Layout, tracks: TrackLayout, edge: TrackEdge, *, at_end: bool) -> Floats:
    """Give where an edge ends at a junction, or begins there, (2,) metres."""
    name = edge.edge.section
    if edge.lane >= 0:
        return _end(layout, Arm(name, at_end))
    line = trim(tracks.graph.line(tracks.graph.sections[name]), *tracks.built[name])
    return line[-1 if at_end else 0]


def _end(layout: Layout, arm: Arm) -> Floats:
    return layout.trimmed(arm.section)[-1 if arm.at_end else 0]
