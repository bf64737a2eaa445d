"""Lay out what is to be built: place crossings, keep roads off each other, in this order."""

from collections.abc import Set as AbstractSet
from dataclasses import replace

from dojo_maps.sources.geotiff import ElevationGrid
from dojo_maps.sources.osm.junctions.steps import JunctionPlan
from dojo_maps.sources.osm.layout.approach_extension import extend_approaches
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.layout.carriageway_spacing import space_carriageways
from dojo_maps.sources.osm.layout.crossing_arms import align_carriageways, host_crossings
from dojo_maps.sources.osm.layout.crossing_signals import add_crossing_signals
from dojo_maps.sources.osm.layout.fork_trimming import trim_forks
from dojo_maps.sources.osm.layout.heights import clear_by_nature, compute_heights
from dojo_maps.sources.osm.layout.sidewalks import lay_sidewalks
from dojo_maps.sources.osm.layout.terrain import find_ground
from dojo_maps.sources.osm.layout.track_meetings import meet_roads


def lay_out(
    plan: JunctionPlan,
    paved: AbstractSet[str] = frozenset(),
    outlined: frozenset[frozenset[int]] = frozenset(),
    raster: ElevationGrid | None = None,
) -> Layout:
    """Place crossings, and give each road its ground.

    Args:
        plan: the junctions.
        paved: sections with pavement on both sides whatever is mapped, because crossings lead there.
        outlined: junctions, each by its vertices, that reach to the ends of their roads.
        raster: elevations of the ground.

    Returns:
        The layout; its tracks, where there are some, are cut, but not settled.

    Raises:
        SourceError: the raster lies elsewhere.
    """
    layout = Layout(
        graph=plan.graph,
        junctions=plan.junctions,
        crossings=plan.crossings,
        inner=plan.inner,
        outlined=outlined,
        asides={
            name: section.road.offset for name, section in plan.graph.sections.items() if section.road.offset
        },
    )
    layout = meet_roads(host_crossings(extend_approaches(layout)))
    layout = trim_forks(align_carriageways(layout))
    layout = add_crossing_signals(space_carriageways(layout))
    ground = find_ground(layout, raster)
    natural = clear_by_nature(layout.graph, ground) if ground else frozenset()
    graph, heights = compute_heights(layout.graph, natural)
    return lay_sidewalks(replace(layout, graph=graph, heights=heights, ground=ground), paved)
