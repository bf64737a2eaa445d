"""Who conflicts with whom at a junction and who waits, and which links of a signal must not go together."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from dojo_maps.description import Junction, LinkKind, RoadMap, Signal
from dojo_maps.signals.programs import GREEN

Matrix = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Foes:
    """Two ways across a junction that cross or join: a connection's id or a crossing's, and who waits."""

    one: str
    other: str
    one_waits: bool
    other_waits: bool


def list_foes(junction: Junction) -> Iterator[Foes]:
    """List each pair of ways that cross or join once, in the order of the junction's requests.

    Args:
        junction: with the network's right of way.

    Yields:
        The two ways, and who waits.
    """
    ways = junction.right_of_way
    pairs = {(min(k, foe), max(k, foe)) for k, way in enumerate(ways) for foe in way.foes if k != foe}
    for k, foe in sorted(pairs):
        yield Foes(
            one=ways[k].link,
            other=ways[foe].link,
            one_waits=foe in ways[k].response,
            other_waits=k in ways[foe].response,
        )


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
        """Tell whether two links may show these letters: no conflict, or one that waits for the other.

        Args:
            state: the signal's letters.
            a: the place of one link in it.
            b: the place of the other.

        Returns:
            True also where one of them is not green.
        """
        if not self.foes[a, b] or state[a] not in GREEN or state[b] not in GREEN:
            return True
        return bool((state[a] == "g" and self.yields[a, b]) or (state[b] == "g" and self.yields[b, a]))

    def find_unsafe(self, state: str) -> list[tuple[int, int]]:
        """List the pairs of links that are green together and must not be.

        Args:
            state: the signal's letters.

        Returns:
            Their places in the state, the lower one first.
        """
        green = [index for index, letter in enumerate(state) if letter in GREEN]
        return [pair for pair in combinations(green, 2) if not self.are_safe(state, *pair)]

    def make_safe(self, state: str) -> str:
        """Let who must wait by the network's own right of way be green without priority, or else red.

        Args:
            state: the signal's letters.

        Returns:
            The letters; where neither of two links waits for the other, the later one in the state is red.
        """
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
    """List the links of walkers, each with both ends of its way: one of them is the crossing.

    Args:
        signal: whose links they are.

    Yields:
        The link's index, and the id of one end; twice for each link.
    """
    for link in signal.links:
        if link.kind is LinkKind.PEDESTRIAN:
            yield from ((link.index, end) for end in (link.from_id, link.to_id))


def read_conflicts(road_map: RoadMap, signal: Signal, count: int) -> Conflicts:
    """Collect the conflicts of a signal's links at all of its junctions; several ways may share a link.

    Args:
        road_map: the map.
        signal: one of its signals.
        count: n, the letters of its states; links beyond are left out.

    Returns:
        The conflicts, by the links' places in a state.
    """
    places: dict[str, set[int]] = defaultdict(set)
    for connection in road_map.connections:
        if connection.signal == signal.id and connection.link_index is not None:
            places[connection.id].add(connection.link_index)
    for index, crossing in list_walks(signal):
        places[crossing].add(index)
    foes, yields = np.zeros((count, count), dtype=bool), np.ones((count, count), dtype=bool)
    wanted = set(signal.junctions)
    for junction in (j for j in road_map.junctions if j.id in wanted):
        for pair in list_foes(junction):
            for a, b in product(places.get(pair.one, ()), places.get(pair.other, ())):
                if a != b and max(a, b) < count:
                    foes[a, b] = foes[b, a] = True
                    # Links that control several ways yield only where all of those ways do.
                    yields[a, b] &= pair.one_waits
                    yields[b, a] &= pair.other_waits
    return Conflicts(foes=foes, yields=yields & foes)
