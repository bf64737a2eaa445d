"""Which links of a signal must not be green together, from the network's own foes."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from dojo_maps.description import LinkKind, RoadMap, Signal

Matrix = NDArray[np.bool_]
GREEN = frozenset("Gg")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Conflicts:
    """Pairs of links, by their place in the state.

    Attributes:
        foes: (n, n) symmetric; the ways of two links cross or join.
        yields: (n, n); the first waits for the second where it is green without priority.
    """

    foes: Matrix
    yields: Matrix

    def are_safe(self, state: str, a: int, b: int) -> bool:
        """Tell whether two links may show these letters: no conflict, or one that waits for the other."""
        if not self.foes[a, b] or state[a] not in GREEN or state[b] not in GREEN:
            return True
        return bool((state[a] == "g" and self.yields[a, b]) or (state[b] == "g" and self.yields[b, a]))

    def find_unsafe(self, state: str) -> list[tuple[int, int]]:
        """List the pairs of links that are green together and must not be."""
        green = [index for index, letter in enumerate(state) if letter in GREEN]
        return [pair for pair in combinations(green, 2) if not self.are_safe(state, *pair)]

    def make_safe(self, state: str) -> str:
        """Let who must wait by the network's own right of way be green without priority, or else red."""
        letters = list(state)
        for a, b in self.find_unsafe(state):
            if self.are_safe("".join(letters), a, b):
                continue
            if self.yields[a, b]:
                letters[a] = "g"
            elif self.yields[b, a]:
                letters[b] = "g"
            else:
                letters[b] = "r"
        return "".join(letters)


def list_walks(signal: Signal) -> Iterator[tuple[int, str]]:
    """List the links of walkers, each with both ends of its way: one of them is the crossing."""
    for link in signal.links:
        if link.kind is LinkKind.PEDESTRIAN:
            yield from ((link.index, end) for end in (link.from_id, link.to_id))


def read_conflicts(road_map: RoadMap, signal: Signal, count: int) -> Conflicts:
    """Collect the conflicts of a signal's links at all of its junctions; several ways may share a link."""
    places: dict[str, set[int]] = defaultdict(set)
    for connection in road_map.connections:
        if connection.signal == signal.id and connection.link_index is not None:
            places[connection.id].add(connection.link_index)
    for index, crossing in list_walks(signal):
        places[crossing].add(index)
    foes, yields = np.zeros((count, count), dtype=bool), np.zeros((count, count), dtype=bool)
    waits: dict[tuple[int, int], bool] = {}
    wanted = set(signal.junctions)
    for junction in (j for j in road_map.junctions if j.id in wanted):
        ways = junction.right_of_way
        for own, way in enumerate(ways):
            for other in way.foes:
                for a, b in product(places.get(way.link, ()), places.get(ways[other].link, ())):
                    if a == b or max(a, b) >= count:
                        continue
                    foes[a, b] = foes[b, a] = True
                    # Links that control several ways yield only where all of those ways do.
                    waits[a, b] = waits.get((a, b), True) and other in way.response
                    waits.setdefault((b, a), own in ways[other].response)
    for (a, b), yielding in waits.items():
        yields[a, b] = yielding
    return Conflicts(foes=foes, yields=yields)
