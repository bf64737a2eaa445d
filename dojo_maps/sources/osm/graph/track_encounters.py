"""Where tracks meet roads: at which of a track's nodes, and how far along the road."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section

_SAME = 0.1
"""Metres below which there is no heading."""

Encounters = Mapping[tuple[str, int], Sequence[tuple[str, float]]]
"""By track and the number of its node: roads, and the metres along each."""


def find_encounters(graph: RoadGraph, tracks: Iterable[Section]) -> Encounters:
    """Find the roads that tracks meet at a node, and leave to a side.

    Args:
        graph: the roads.
        tracks: on the same nodes.

    Returns:
        By track and the number of its node, each road there with the metres along it; without nodes that are
        on no road.
    """
    tracks = list(tracks)
    names = sorted(graph.sections)
    roads = [shapely.LineString(graph.line(graph.sections[name])) for name in names]
    nodes = [(track, index) for track in tracks for index in range(len(track.nodes))]
    points = shapely.points([graph.places[track.nodes[index]] for track, index in nodes])
    rules = graph.rules.tracks
    found: dict[tuple[str, int], list[tuple[str, float]]] = defaultdict(list)
    hits = shapely.STRtree(roads).query(points, "dwithin", distance=rules.on_road)
    for number, hit in sorted(hits.T.tolist()):
        track, index = nodes[number]
        section = graph.sections[names[hit]]
        if track.nodes[index] not in section.nodes and section.road.layer != track.road.layer:
            continue
        line = graph.line(track)
        path, at = shapely.LineString(line), float(along(line)[index])
        place = float(roads[hit].project(points[number]))
        sides = [
            _headings(other, metres, rules.heading) for other, metres in ((path, at), (roads[hit], place))
        ]
        if any(all(float(a @ b) < rules.along_road for b in sides[1]) for a in sides[0]):
            found[track.id, index].append((section.id, place))
    return dict(found)


def _headings(line: shapely.LineString, place: float, ahead: float) -> list[Floats]:
    """Give the unit vectors from a place on a line to where it comes from and goes."""
    at = [place, max(place - ahead, 0.0), min(place + ahead, line.length)]
    here, *others = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
    ways = [other - here for other in others]
    return [way / float(np.hypot(*way)) for way in ways if float(np.hypot(*way)) > _SAME]
