"""Signals of crossings between junctions; and the end of signals where no traffic passes."""

import math
from collections.abc import Sequence
from dataclasses import replace

from dojo_maps.sources.osm.junctions.controllers import share_controllers
from dojo_maps.sources.osm.junctions.grouping import Junctions
from dojo_maps.sources.osm.layout.arms import Arm, Layout


def add_crossing_signals(layout: Layout) -> Layout:
    """Give signals to the junctions of crossings that have them, and to those near a signal of no junction.

    Where roads meet beside the crossing, they stop for it as well; near junctions share a controller. A
    junction that nothing drives through has no signals.

    Args:
        layout: with its crossings at their arms.

    Returns:
        The layout with the signals and controllers of its junctions.
    """
    graph, junctions = layout.graph, layout.junctions
    degree = {vertex: len(at) for vertex, at in graph.ends().items()}
    members = junctions.members()
    stray = [graph.places[node] for node in junctions.stray]
    signals = dict(junctions.signals)
    for arm, crossing in layout.hosted.items():
        junction = layout.junction(arm)
        if junction in signals:
            continue
        between = all(degree[vertex] == 2 for vertex in members[junction])
        near = between and any(
            math.dist(place, crossing.place) < layout.rules.signals.signal_at_crossing for place in stray
        )
        if crossing.signalised or near:
            signals[junction] = [crossing.node]
    shared = share_controllers(graph, replace(junctions, signals=signals))
    return replace(layout, junctions=_without_idle(layout, shared))


def _without_idle(layout: Layout, junctions: Junctions) -> Junctions:
    """Take the signals from junctions that no traffic passes."""
    arms = layout.arms()
    passed = {
        junction for junction in junctions.controllers if _leads_through(layout, arms.get(junction, ()))
    }
    return replace(
        junctions,
        signals={junction: nodes for junction, nodes in junctions.signals.items() if junction in passed},
        controllers={junction: of for junction, of in junctions.controllers.items() if junction in passed},
    )


def _leads_through(layout: Layout, arms: Sequence[Arm]) -> bool:
    """Tell whether traffic passes a junction from one road to another."""
    arriving = {arm.section for arm in arms if layout.arriving(arm)}
    leaving = {arm.section for arm in arms if layout.leaving(arm)}
    return bool(arriving and leaving) and len(arriving | leaving) > 1
