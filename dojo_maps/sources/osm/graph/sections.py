"""Cut ways into sections where they meet, and join what only a split of the way or of its tags divides."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from dojo_maps.geometry.polylines import along
from dojo_maps.sources.osm.graph.road_graph import Places, Section, list_ends
from dojo_maps.sources.osm.graph.shared_nodes import Run
from dojo_maps.sources.osm.read.lane_tags import LaneUse
from dojo_maps.sources.osm.read.way_tags import KINDS, RoadTags
from dojo_maps.sources.osm.rules import SectionRules


def cut_sections(runs: Iterable[Run], roads: Mapping[int, RoadTags]) -> list[Section]:
    """Cut ways where they meet; each one-way section runs in its traffic's direction.

    Args:
        runs: ways with the nodes that they run through.
        roads: what the ways are.

    Returns:
        The sections, run by run; their ids are the way's, with a number after `#`.
    """
    runs = list(runs)
    uses: dict[int, int] = defaultdict(int)
    for _, run in runs:
        for node in run:
            uses[node] += 1
        for before, node, after in zip(run, run[1:], run[2:], strict=False):
            uses[node] += before == after
        uses[run[0]] += 1
        uses[run[-1]] += 1
    count: dict[int, int] = defaultdict(int)
    sections = []
    for way, run in runs:
        first = 0
        for index in range(1, len(run)):
            if uses[run[index]] > 1:
                nodes = run[first : index + 1]
                section = Section(
                    id=f"{_way_name(way)}#{count[way]}",
                    nodes=nodes,
                    ways=(way,) * (len(nodes) - 1),
                    road=roads[way],
                )
                count[way] += 1
                sections.append(section if section.road.forward else section.flipped())
                first = index
    return sections


def drop_doubles(sections: Iterable[Section]) -> tuple[dict[str, Section], list[int]]:
    """Keep one of the sections drawn over the same nodes; one-ways against each other make a two-way road.

    Args:
        sections: those on different levels are not on the same nodes.

    Returns:
        The sections that are kept, by id; and a way of each one that is not.
    """
    kept: dict[tuple[int, ...], Section] = {}
    doubled = []
    for section in sections:
        key = (section.road.layer, *min(section.nodes, section.nodes[::-1]))
        twin = kept.get(key)
        if twin is None:
            kept[key] = section
        elif twin.road.oneway and section.road.oneway and twin.nodes != section.nodes:
            kept[key] = replace(twin, road=replace(twin.road, backward=section.road.forward))
        else:
            kept[key], other = sorted((twin, section), key=_importance, reverse=True)
            doubled.append(other.ways[0])
    return {section.id: section for section in kept.values()}, doubled


def join_sections(sections: Mapping[str, Section], places: Places, rules: SectionRules) -> dict[str, Section]:
    """Join sections across vertices that only part them.

    Args:
        sections: by id.
        places: where nodes lie, metres.
        rules: from which length on sections keep lanes of their own.

    Returns:
        The sections that there are then, by id; a joined one has that of its first part.
    """
    joined = dict(sections)
    while _join(joined, places, rules):
        pass
    return joined


def _importance(section: Section) -> tuple[int, float]:
    return KINDS[section.road.kind], section.road.drives


def _join(sections: dict[str, Section], places: Places, rules: SectionRules) -> bool:
    """Join sections in place, each once; tell whether any were."""
    changed = False
    for vertex, at in sorted(list_ends(sections).items()):
        if len(at) != 2 or at[0] == at[1] or any(name not in sections for name in at):
            continue
        before, after = _in_line(sections[at[0]], sections[at[1]], vertex)
        if before is None or after is None or before.start == after.end:
            continue
        road = _common_road(places, before, after, rules)
        if road is None:
            continue
        del sections[at[0]], sections[at[1]]
        sections[before.id] = replace(
            before, nodes=before.nodes + after.nodes[1:], ways=before.ways + after.ways, road=road
        )
        changed = True
    return changed


def _in_line(one: Section, other: Section, vertex: int) -> tuple[Section | None, Section | None]:
    """Order two sections so that the first leads to the vertex and the second leaves it."""
    if one.end != vertex:
        one, other = other, one
    if one.end != vertex:
        return (one.flipped(), other) if not one.road.oneway else (None, None)
    if other.start != vertex:
        if not other.road.oneway:
            return one, other.flipped()
        return (other, one.flipped()) if not one.road.oneway else (None, None)
    return one, other


def _common_road(places: Places, before: Section, after: Section, rules: SectionRules) -> RoadTags | None:
    """Give what both sections are, or what a very short one of them may be taken for."""
    one, other = before.road, after.road
    if one.oneway != other.oneway or one.layer != other.layer or one.roundabout != other.roundabout:
        return None
    if _essence(one) == _essence(other):
        return one
    lengths = [float(along(np.array([places[node] for node in s.nodes]))[-1]) for s in (before, after)]
    parked = _essence(_unparked(one)) == _essence(_unparked(other))
    if min(lengths) >= (rules.shortest_parking if parked else rules.shortest):
        return None
    return one if lengths[0] >= lengths[1] else other


def _unparked(road: RoadTags) -> RoadTags:
    """Give a road without the cars parked along it."""
    forward, backward = (
        tuple(lane for lane in lanes if lane.use is not LaneUse.PARKING)
        for lanes in (road.forward, road.backward)
    )
    return replace(road, forward=forward, backward=backward)


def _essence(road: RoadTags) -> RoadTags:
    return replace(road, name="", width=0.0, kind="", speed=round(road.speed))


def _way_name(way: int) -> str:
    """Name a way; editors number new ones below 0, and a minus stands for the way back."""
    return str(way) if way >= 0 else f"new{-way}"
