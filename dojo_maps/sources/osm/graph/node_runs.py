"""The nodes that ways run through, as far as an extract holds them, each place once."""

import itertools
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator

from dojo_maps.sources.osm.read.data import OsmData, OsmWay


def known_runs(data: OsmData, ways: Iterable[int]) -> tuple[list[tuple[int, tuple[int, ...]]], list[int]]:
    """Follow ways through the nodes that the extract holds.

    Nodes of a way that lie on one place are one, for all ways: the one that most ways run through.

    Args:
        data: the extract.
        ways: ids of ways in it.

    Returns:
        Each way with each of its unbroken runs of two nodes or more, and the nodes that are missing.
    """
    ways = list(ways)
    missing = {node for way in ways for node in data.ways[way].nodes if node not in data.nodes}
    same = _same_places(data, ways)
    runs = [(way, run) for way in ways for run in _runs(data.ways[way], data, same)]
    return runs, sorted(missing)


def _same_places(data: OsmData, ways: Iterable[int]) -> dict[int, int]:
    """Find which node to take for each one that follows another on the same place."""
    uses = Counter(node for way in ways for node in data.ways[way].nodes)
    pairs = {pair for way in ways for pair in itertools.pairwise(data.ways[way].nodes)}
    groups: dict[tuple[float, float], set[int]] = defaultdict(set)
    for pair in pairs:
        if all(node in data.nodes for node in pair) and _place(data, pair[0]) == _place(data, pair[1]):
            groups[_place(data, pair[0])].update(pair)
    return {
        node: max(group, key=lambda node: (uses[node], bool(data.nodes[node].tags), -node))
        for group in groups.values()
        for node in group
    }


def _place(data: OsmData, node: int) -> tuple[float, float]:
    return data.nodes[node].lon, data.nodes[node].lat


def _runs(way: OsmWay, data: OsmData, same: dict[int, int]) -> Iterator[tuple[int, ...]]:
    for held, nodes in itertools.groupby(way.nodes, key=lambda node: node in data.nodes):
        run = tuple(node for node, _ in itertools.groupby(same.get(node, node) for node in nodes))
        if held and len(run) > 1:
            yield run
