"""Where bicycles ride inside junctions: along the tracks that are mapped there.

netconvert leads them straight from track to track, over all lanes of a wide junction.
"""

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.ops import substring

from dojo_maps.description import Lane, RoadMap
from dojo_maps.geometry.polylines import Floats, along, offset_lines
from dojo_maps.index import MapIndex
from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.layout.track_layout import TrackLink
from dojo_maps.sources.osm.network.net_shapes import replace_internal_lanes
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY

_CORNER = 0.5
"""Metres from a lane's end within which a track's corner is left out."""


def follow_tracks(data: bytes, road_map: RoadMap, layout: Layout) -> bytes:
    """Lead bicycles across junctions along the tracks that are mapped inside.

    Args:
        data: the network.
        road_map: the same, read.
        layout: what it was built from.

    Returns:
        The network with other shapes and lengths of internal lanes.
    """
    courses = {lane: (float(along(path)[-1]), path) for lane, path in _paths(road_map, layout)}
    return replace_internal_lanes(data.decode("utf-8"), courses).encode("utf-8")


def _paths(road_map: RoadMap, layout: Layout) -> Iterator[tuple[str, Floats]]:
    """List the internal lanes that lead away from the mapped track, with its path, (n, 3) metres."""
    if layout.tracks is None:
        return
    links = {(str(link.source.edge), str(link.target.edge)): link for link in layout.tracks.links}
    graph, lanes = layout.tracks.graph, MapIndex(road_map).lanes
    for connection in road_map.connections:
        source, target = lanes[connection.from_lane], lanes[connection.to_lane]
        link = links.get((source.road, target.road))
        if link is None or len(connection.via) != 1:
            continue
        line = _mapped_line(graph, link)
        path = None if line is None else _path(line, source, target, _aside(graph, link, source, target))
        if path is None:
            continue
        ridden, mapped = (shapely.LineString(shape[:, :2]) for shape in (connection.shape, path))
        if shapely.hausdorff_distance(ridden, mapped) > layout.graph.rules.tracks.beside_mapped:
            yield connection.via[0], path


def _mapped_line(graph: RoadGraph, link: TrackLink) -> shapely.LineString | None:
    """Give the middle of the cycle tracks that a link follows, as driven; None for any other link."""
    edges = [link.source.edge, *link.through, link.target.edge]
    sections = [graph.sections.get(edge.section) for edge in edges]
    lines = [
        graph.line(section)[:: 1 if edge.forward else -1]
        for edge, section in zip(edges, sections, strict=True)
        if section is not None and section.road.kind == CYCLEWAY
    ]
    return shapely.LineString(np.concatenate(lines)) if len(lines) == len(edges) else None


def _aside(graph: RoadGraph, link: TrackLink, source: Lane, target: Lane) -> float:
    """Tell how far from the mapped middle cyclists ride, metres, positive to the left."""
    ends = (link.source.edge, source), (link.target.edge, target)
    apart = max(0.0 if graph.sections[edge.section].road.oneway else lane.width / 2 for edge, lane in ends)
    return apart if graph.left_hand else -apart


def _path(line: shapely.LineString, source: Lane, target: Lane, aside: float) -> Floats | None:
    """Follow a line from a lane's end to the other's start, beside it; None where it leads back."""
    ends = np.array([source.shape[-1], target.shape[0]])
    begins, stops = shapely.line_locate_point(line, shapely.points(ends[:, :2]))
    if begins >= stops:
        return None
    beside = offset_lines(np.array([substring(line, begins, stops)]), np.array([aside]))[0]
    between = shapely.get_coordinates(beside)
    far = shapely.distance(shapely.points(between), shapely.multipoints(ends[:, :2])) > _CORNER
    path = np.concatenate([ends[:1, :2], between[far], ends[1:, :2]])
    lengths = along(path)
    return np.column_stack([path, np.interp(lengths, lengths[[0, -1]], ends[:, 2])])
