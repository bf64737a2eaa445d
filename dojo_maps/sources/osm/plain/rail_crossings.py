"""Where people walk over railways at a junction: between the pavements on both sides of the tracks."""

import math
from collections import defaultdict
from collections.abc import Iterator

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.layout.arms import Arm, Layout, ray
from dojo_maps.sources.osm.layout.track_layout import TrackLayout
from dojo_maps.sources.osm.read.track_tags import RAIL


def rail_crossings(layout: Layout, tracks: TrackLayout) -> Iterator[tuple[int, list[str]]]:
    """Find the tracks that part the pavements of a junction, those side by side together.

    Args:
        layout: with its sidewalks.
        tracks: of it, settled.

    Yields:
        The junction, and the tracks that end there.
    """
    rails: dict[int, list[Arm]] = defaultdict(list)
    for name in sorted(tracks.built):
        section = tracks.graph.sections[name]
        for at_end, vertex in ((False, section.start), (True, section.end)):
            if section.road.kind == RAIL and tracks.nodes[vertex] in layout.junctions.of:
                rails[tracks.nodes[vertex]].append(Arm(name, at_end))
    arms = layout.arms()
    for junction, found in sorted(rails.items()):
        middle = _middle(layout, junction)
        around = [(_angle(middle, _far_point(layout, arm)), arm) for arm in arms.get(junction, ())]
        for gap in _gaps(sorted(around)):
            before, after = gap
            between = [
                track.section
                for track in found
                if 0.0
                < _turn(before[0], _angle(middle, _track_point(tracks, track)))
                < _turn(before[0], after[0])
            ]
            if between and _paved(layout, before[1], left=True) and _paved(layout, after[1], left=False):
                yield junction, between


def crossing_line(layout: Layout, junction: int, names: list[str]) -> str:
    """Write a crossing; people let trains go first where no signal tells them to.

    Args:
        layout: with its controllers.
        junction: that the crossing belongs to.
        names: of the edges that it leads over.

    Returns:
        A line of XML.
    """
    return (
        f'<crossing node="{junction}" edges="{" ".join(sorted(names))}" '
        f'width="{layout.rules.crossings.width:.2f}" '
        f'priority="{str(junction in layout.junctions.controllers).lower()}"/>'
    )


def _gaps(around: list[tuple[float, Arm]]) -> list[tuple[tuple[float, Arm], tuple[float, Arm]]]:
    return list(zip(around, [*around[1:], *around[:1]], strict=True))


def _turn(one: float, other: float) -> float:
    """Turn from one heading counter-clockwise to another; a full turn to the same."""
    return (other - one) % math.tau or math.tau


def _paved(layout: Layout, arm: Arm, *, left: bool) -> bool:
    """Tell whether a road has a sidewalk on its left or right, seen from the junction."""
    return bool(layout.sidewalks[arm.section][0 if left != arm.at_end else 1])


def _middle(layout: Layout, junction: int) -> tuple[float, float]:
    places = [layout.graph.places[v] for v, of in layout.junctions.of.items() if of == junction]
    x, y = (sum(values) / len(places) for values in zip(*places, strict=True))
    return x, y


def _far_point(layout: Layout, arm: Arm) -> Floats:
    place, way = ray(layout.graph, arm)
    return place + way * (layout.cuts.get(arm, 0.0) + layout.rules.tracks.beside_ahead)


def _track_point(tracks: TrackLayout, track: Arm) -> Floats:
    place, way = ray(tracks.graph, track)
    return place + way * (tracks.built[track.section][track.at_end] + tracks.graph.rules.tracks.beside_ahead)


def _angle(middle: tuple[float, float], point: Floats) -> float:
    return math.atan2(point[1] - middle[1], point[0] - middle[0])
