"""Repair of roads too short to hold a vehicle: the junctions at both ends become one."""

from collections.abc import Iterator, Sequence
from xml.sax.saxutils import quoteattr

from dojo_maps.issue import Element, Issue
from dojo_maps.repair.edits import Edit, Rebuild, Site, named


def join_short_roads(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Join the junctions that short roads lie between; those of signals keep apart, for their programs.

    Args:
        site: the network as it is.
        issues: with the short roads.

    Yields:
        An edit for each group of junctions, named after one of its roads: netconvert builds the network
        anew, with the group as one junction.
    """
    facts = site.facts
    signalled = {junction for signal in facts.map.signals for junction in signal.junctions}
    groups: list[tuple[str, set[str]]] = []
    for id_ in named(issues, "road"):
        road = facts.roads[id_]
        ends = {road.from_junction, road.to_junction}
        short = min(lane.length for lane in facts.lanes_of(id_)) < site.limits.road_length
        if short and len(ends) == 2 and ends <= facts.junctions.keys() and not ends & signalled:
            touching = [group for group in groups if group[1] & ends]
            groups = [group for group in groups if group not in touching]
            groups.append((touching[0][0] if touching else id_, ends.union(*(g[1] for g in touching))))
    for road_id, junctions in groups:
        names = " ".join(sorted(junctions))
        change = Rebuild(nodes=(f"<join nodes={quoteattr(names)}/>",))
        element = Element(kind="road", id=road_id)
        yield Edit(element=element, what=f"junctions {names} joined", changes=(change,))
