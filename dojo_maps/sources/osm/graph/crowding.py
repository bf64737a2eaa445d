"""Bounds on how many roads of an extract lie on one place, beyond which laying them out has no end.

Laying out compares the roads of a junction, and those that lie beside each other, each with each. In a street
network these are a few, however large it is. Where hundreds are drawn over each other, they are all.
"""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import shapely

from dojo_maps.errors import SourceError
from dojo_maps.geometry.polylines import Ints, Shapes
from dojo_maps.sources.osm.graph.shared_nodes import Run
from dojo_maps.sources.osm.read.way_tags import RoadTags
from dojo_maps.sources.osm.rules import CrowdingRules

_APART = 10.0
"""Metres from one place that is looked at to the next, along a road."""
_PAIRS_AT_ONCE = 20_000_000


def check_crowding(
    runs: Sequence[Run],
    roads: Mapping[int, RoadTags],
    places: Mapping[int, tuple[float, float]],
    path: Path | str,
    rules: CrowdingRules,
) -> None:
    """Refuse roads that are drawn over each other many times.

    Args:
        runs: ways with the nodes that they run through.
        roads: what the ways are.
        places: where nodes lie, metres.
        path: named in errors.
        rules: how many may lie on one place.

    Raises:
        SourceError: too many of them lie on one place.
    """
    ends = np.array([pair for _, nodes in runs for pair in itertools.pairwise(nodes)])
    ways = np.repeat([way for way, _ in runs], [len(nodes) - 1 for _, nodes in runs])
    if not len(ends):
        return
    _check_nodes(ends, path, rules)
    lines = shapely.linestrings([[places[node] for node in pair] for pair in ends.tolist()])
    _check_places(lines, ways, roads, path, rules)


def _check_nodes(ends: Ints, path: Path | str, rules: CrowdingRules) -> None:
    nodes, counts = np.unique(ends, return_counts=True)
    if counts.max() > 2 * rules.most_at_node:
        raise SourceError(
            path,
            f"{counts.max()} pieces of road meet here; at most {2 * rules.most_at_node} are laid out",
            element=f"node {nodes[counts.argmax()]}",
        )


def _check_places(
    lines: Shapes, ways: Ints, roads: Mapping[int, RoadTags], path: Path | str, rules: CrowdingRules
) -> None:
    """Look at places along all roads, and count what lies near them."""
    lengths = shapely.length(lines)
    counts = np.maximum(1, np.ceil(lengths / _APART)).astype(int)
    piece = np.repeat(np.arange(len(lines)), counts)
    share = (np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / counts[piece]
    points = shapely.line_interpolate_point(lines[piece], share, normalized=True)
    halves = np.array([roads[way].drives / 2 for way in ways.tolist()])
    weights = np.clip(lengths, rules.least_weight, rules.most_weight)
    tree = shapely.STRtree(lines)
    beside, at_once = 0, max(1, _PAIRS_AT_ONCE // len(lines))
    for first in range(0, len(points), at_once):
        some, own = points[first : first + at_once], piece[first : first + at_once]
        point, other = tree.query(some, "dwithin", distance=rules.near)
        near = np.bincount(point, weights=weights[other])
        if near.max() > rules.most_near_place:
            raise SourceError(
                path,
                f"{near.max():.0f} pieces of road lie within {rules.near:g} m of a place on this one; "
                f"at most {rules.most_near_place:g} are laid out; remove what is drawn many times",
                element=f"way {ways[own[near.argmax()]]}",
            )
        covers = shapely.distance(some[point], lines[other]) < halves[own[point]] + halves[other]
        covers &= ways[other] != ways[own[point]]
        beside += len(np.unique(np.stack([point[covers], ways[other[covers]]]), axis=1).T)
    if float(lengths.sum()) > rules.network and beside > rules.most_beside * len(points):
        raise SourceError(
            path,
            f"its roads lie on each other: on the average place of one {beside / len(points):.1f} others, at "
            f"most {rules.most_beside:g} are laid out; remove what is drawn many times",
        )
