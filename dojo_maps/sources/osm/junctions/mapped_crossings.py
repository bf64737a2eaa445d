"""Where people cross a road, as it is mapped: crossing nodes, and crossing ways over a road."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely

from dojo_maps.sources.osm.graph.road_graph import Footway, RoadGraph
from dojo_maps.sources.osm.read.foot_tags import (
    is_crossing_node,
    is_crossing_way,
    is_marked_crossing,
    is_signalised_crossing,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedCrossing:
    """A crossing of one section.

    Attributes:
        kind, element: the OSM element that it is mapped by, node or way.
        node: the section's node where it lies, or the one nearest to it.
        place: x and y, metres.
        section, along: the section, and the metres from its start.
        signalised: it has lights for those who walk.
        marked: it is painted, so traffic gives way.
    """

    kind: str
    element: int
    node: int
    place: tuple[float, float]
    section: str
    along: float
    signalised: bool
    marked: bool


def find_crossings(graph: RoadGraph) -> list[MappedCrossing]:
    """Find each crossing of a road, once for each section that it crosses, in the order of sections.

    Args:
        graph: the roads, and the ways of people.

    Returns:
        The crossings, by section and the metres along it; of two that are nearly on one place, the one with
        signals is kept, else the first.
    """
    ways = [footway for footway in graph.footways if is_crossing_way(footway.tags)]
    found = _at_nodes(graph, {node: way for way in ways for node in way.nodes})
    found += _across(graph, ways, {crossing.node for crossing in found})
    found.sort(key=lambda c: (c.section, c.along, c.kind, c.element))
    kept: list[MappedCrossing] = []
    same = graph.rules.crossings.same
    for crossing in found:
        last = kept[-1] if kept else None
        if last and last.section == crossing.section and crossing.along - last.along < same:
            if crossing.signalised and not last.signalised:
                kept[-1] = crossing
            continue
        kept.append(crossing)
    return kept


def _at_nodes(graph: RoadGraph, on_way: dict[int, Footway]) -> list[MappedCrossing]:
    """Take crossings at nodes of sections; one at a vertex belongs to the first section there."""
    found = []
    for node, places in sorted(graph.positions().items()):
        tags = graph.tags.get(node, {})
        named = is_crossing_node(tags)
        if not (named or (node in on_way and tags.get("crossing") != "no")):
            continue
        if not named:
            tags = {**on_way[node].tags, **tags}
        section, index = min(places)
        line = graph.line(graph.sections[section])[: index + 1]
        found.append(
            MappedCrossing(
                kind="node" if named else "way",
                element=node if named else on_way[node].way,
                node=node,
                place=graph.places[node],
                section=section,
                along=float(np.hypot(*np.diff(line, axis=0).T).sum()),
                signalised=is_signalised_crossing(tags),
                marked=is_marked_crossing(tags),
            )
        )
    return found


def _across(graph: RoadGraph, ways: Iterable[Footway], known: set[int]) -> list[MappedCrossing]:
    """Take crossing ways that run over a section without a common node, on the ground."""
    names, same = sorted(graph.sections), graph.rules.crossings.same
    lines = [shapely.LineString(graph.line(graph.sections[name])) for name in names]
    tree = shapely.STRtree(lines)
    found = []
    for crossing in ways:
        path = crossing.line
        if path is None or crossing.tags.get("bridge", "no") != "no":
            continue
        for hit in sorted(tree.query(path, predicate="intersects")):
            section = graph.sections[names[hit]]
            if section.road.layer or known.intersection(crossing.nodes) & set(section.nodes):
                continue
            point = lines[hit].intersection(path).representative_point()
            along = float(lines[hit].project(point))
            places = graph.line(section)
            nearest = int(np.argmin(np.hypot(*(places - (point.x, point.y)).T)))
            if section.nodes[nearest] in known and np.hypot(*(places[nearest] - (point.x, point.y))) < same:
                continue
            found.append(
                MappedCrossing(
                    kind="way",
                    element=crossing.way,
                    node=section.nodes[nearest],
                    place=(float(point.x), float(point.y)),
                    section=names[hit],
                    along=along,
                    signalised=is_signalised_crossing(crossing.tags),
                    marked=is_marked_crossing(crossing.tags),
                )
            )
    return found
