"""Junctions as nodes of SUMO's plain XML: their place, type, controller, corner radius and outline."""

from collections.abc import Mapping

import numpy as np

from dojo_maps.sources.osm.layout.arms import Arm, Layout
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
        if junction in outlines:
            kind += f' shape="{" ".join(f"{x:.2f},{y:.2f},{z:.2f}" for x, y, z in outlines[junction])}"'
        z = sum(layout.height(vertex) for vertex in members[junction]) / len(places)
        lines.append(f'<node id="{junction}" x="{x:.2f}" y="{y:.2f}" z="{z:.2f}" {kind}/>')
    return lines
