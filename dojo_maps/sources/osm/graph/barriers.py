"""Barriers that no car passes: the road ends on both sides of each."""

import math
from collections.abc import Sequence

from dojo_maps.sources.osm.graph.road_graph import free_number
from dojo_maps.sources.osm.graph.shared_nodes import Run
from dojo_maps.sources.osm.read.data import OsmData, Tags

_CLOSED = ("bollard", "block", "jersey_barrier", "log", "chain", "kerb", "debris", "planter", "wall", "fence")
_CLOSED_UNLESS_OPEN = ("gate", "lift_gate", "swing_gate", "sliding_gate", "rising_bollard", "bus_trap")
_ACCESS = ("motorcar", "motor_vehicle", "vehicle", "access")
_NO, _YES = ("no", "private"), ("yes", "permissive", "designated", "destination", "customers")


def is_closed(tags: Tags) -> bool:
    """Tell whether a node stops cars: by what stands there, and what it says of access.

    Args:
        tags: of the node.

    Returns:
        Whether it does; not at a gate that does not say so.
    """
    kind = tags.get("barrier", "")
    said = next((tags[key] for key in _ACCESS if key in tags), None)
    if kind in _CLOSED:
        return said not in _YES
    return kind in _CLOSED_UNLESS_OPEN and said in _NO


def cut_at_barriers(
    data: OsmData, runs: Sequence[Run], places: dict[int, tuple[float, float]], apart: float
) -> tuple[list[Run], list[int]]:
    """End roads at both sides of each barrier inside them.

    Args:
        data: the extract.
        runs: ways with the nodes that they run through.
        places: where nodes lie, metres; the new ends, negative numbers, are added.
        apart: metres from a barrier to the ends on both sides.

    Returns:
        The runs, more than before where one is cut; and the barriers.
    """
    found: list[Run] = []
    barriers: set[int] = set()
    for way, nodes in runs:
        rest = list(nodes)
        for node in nodes[1:-1]:
            if node in data.nodes and is_closed(data.nodes[node].tags):
                index = rest.index(node)
                before = _near(places, node, rest[index - 1], apart)
                after = _near(places, node, rest[index + 1], apart)
                found.append((way, (*rest[:index], before)))
                rest = [after, *rest[index + 1 :]]
                barriers.add(node)
        found.append((way, tuple(rest)))
    return found, sorted(barriers)


def _near(places: dict[int, tuple[float, float]], node: int, other: int, apart: float) -> int:
    """Add a node a little away from one, towards another."""
    here, there = places[node], places[other]
    share = min(apart / max(math.dist(here, there), 1e-6), 0.5)
    number = free_number(places)
    x, y = (round(a + (b - a) * share, 3) for a, b in zip(here, there, strict=True))
    places[number] = (x, y)
    return number
