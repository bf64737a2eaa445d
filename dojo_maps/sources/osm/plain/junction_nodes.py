"""Junctions as nodes of SUMO's plain XML: their place, type, controller, corner radius and outline."""

from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.layout.arms import Arm, Layout, divider, shift
from dojo_maps.sources.osm.plain.right_of_way import RightOfWay
from dojo_maps.sources.osm.plain.track_edges import TrackEdges


def write_nodes(
    layout: Layout, arms: Mapping[int, list[Arm]], rights: RightOfWay, tracks: TrackEdges
) -> list[str]:
    """Write the roads' junctions; those that tracks lead into have types and outlines of their own.

    Args:
        layout: what to build.
        arms: of each junction, as `Layout.arms` lists them.
        rights: who gives way there.
        tracks: of the layout.

    Returns:
        A line of XML for each junction, in the order of their numbers.
    """
    members = layout.junctions.members()
    entered, level_crossings = tracks.junctions, tracks.rail_crossings()
    outlines = layout.tracks.outlines if layout.tracks is not None else {}
    lines = []
    for junction in sorted(arms):
        places = np.array([layout.graph.places[vertex] for vertex in members[junction]])
        x, y = (places.min(axis=0) + places.max(axis=0)) / 2
        controller = layout.junctions.controllers.get(junction)
        kind = f'type="{rights.kind(junction, arms[junction])}"'
        if controller is not None:
            kind = f'type="traffic_light" tl="{controller}"'
        elif junction in level_crossings:
            kind = 'type="rail_crossing"'
        elif junction not in entered and not any(layout.leaving(arm) for arm in arms[junction]):
            kind = 'type="dead_end"'
        if any(layout.graph.sections[name].road.roundabout for name, _ in arms[junction]):
            kind += f' radius="{layout.rules.roundabouts.corner_radius}"'
        kept = outlines.get(junction)
        reaches = frozenset(members[junction]) in layout.outlined or _lacks_stem(layout, arms[junction])
        outline = _outline(layout, arms[junction]) if kept is None and reaches else kept
        if outline is not None:
            kind += f' shape="{" ".join(f"{x:.2f},{y:.2f},{z:.2f}" for x, y, z in outline)}"'
        z = sum(layout.height(vertex) for vertex in members[junction]) / len(places)
        lines.append(f'<node id="{junction}" x="{x:.2f}" y="{y:.2f}" z="{z:.2f}" {kind}/>')
    return lines


def _lacks_stem(layout: Layout, arms: Sequence[Arm]) -> bool:
    """Tell whether this is a fork whose stem is not mapped, and whose roads are drawn back.

    netconvert takes roads that all leave in one direction for one, and draws them to the junction's middle.

    Args:
        layout: with its cuts.
        arms: of one junction.
    """
    goes_through = any(map(layout.arriving, arms)) and any(map(layout.leaving, arms))
    return not goes_through and len(arms) > 1 and any(layout.cuts.get(arm) for arm in arms)


def _outline(layout: Layout, arms: Sequence[Arm]) -> Floats | None:
    """Outline the ground between the ends of a junction's roads, where they are drawn back to.

    It leads from road to road; where that is twisted, or leaves most of the ground out, around all of them.

    Args:
        layout: with its sidewalks.
        arms: of one junction.

    Returns:
        (n, 3), metres, map frame; None where they lie on one line.
    """
    ends = np.array([_borders(layout, arm) for arm in arms])
    hull = shapely.convex_hull(shapely.multipoints(ends.reshape(-1, 3)))
    if not hull.area:
        return None
    x, y = (ends.mean(axis=1) - ends.mean(axis=(0, 1)))[:, :2].T
    ring = shapely.Polygon(ends[np.argsort(np.arctan2(y, x))].reshape(-1, 3))
    outline = ring if ring.is_valid and ring.area > hull.area / 2 else hull
    return shapely.get_coordinates(outline.exterior, include_z=True)[:-1]


def _borders(layout: Layout, arm: Arm) -> Floats:
    """Give both borders of a road, sidewalks included, where its junction begins.

    Args:
        layout: with its sidewalks.
        arm: of a road that is built.

    Returns:
        (2, 3), metres, map frame; counterclockwise around the junction.
    """
    section = layout.graph.sections[arm.section]
    lanes = [section.road.across(section.road.backward), section.road.across(section.road.forward)]
    left, right = np.add(lanes[::-1] if layout.graph.left_hand else lanes, layout.sidewalks[arm.section])
    line = divider(layout, section)
    sides = (left, -right) if arm.at_end else (-right, left)
    return np.array([shift(line, metres)[-1 if arm.at_end else 0] for metres in sides])
