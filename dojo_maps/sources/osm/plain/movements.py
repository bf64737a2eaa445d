"""Which roads traffic may take from each road into a junction, and from which lane to which.

Inside a junction of several vertices the ways themselves are followed, one-way streets and turn
restrictions included, so that what cannot be driven is not connected. Lanes are numbered from the outermost.
"""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
import shapely
from numpy.typing import NDArray

from dojo_maps.errors import SourceError
from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.plain.lane_connections import arrow_targets
from dojo_maps.sources.osm.read.restrictions import Restriction

_Path = tuple[int, tuple[int, ...], tuple[int, ...]]
"""Where one is, by which ways and vertices one came there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Movement:
    """From one directed road to another: `angle` is the turn, degrees, positive to the inner side."""

    source: Arm
    target: Arm
    angle: float


class Movements:
    """Finds movements at the junctions of a layout."""

    def __init__(self, layout: Layout, restrictions: Sequence[Restriction]) -> None:
        self._layout = layout
        self._graph = layout.graph
        self._ends = layout.graph.ends()
        self._restrictions: dict[int, list[Restriction]] = {}
        for restriction in restrictions:
            self._restrictions.setdefault(restriction.source, []).append(restriction)

    def at(self, junction: int, arms: Sequence[Arm]) -> list[Movement]:
        """List the movements of a junction, outermost turn of each road first.

        Args:
            junction: its lowest vertex.
            arms: all that it has.

        Returns:
            The movements, road by road; none of a road that no traffic arrives through.

        Raises:
            SourceError: more paths lead across it than can be followed.
        """
        found: list[Movement] = []
        for arm in arms:
            if self._layout.arriving(arm):
                found += self._from(arm, set(arms), junction)
        return [movement for movement in found if not self._is_for_twin(movement, found)]

    def _is_for_twin(self, movement: Movement, found: Sequence[Movement]) -> bool:
        """Tell whether a turn lane mapped as a way of its own leaves a movement to the road beside it."""
        lanes = self._layout.arriving(movement.source)
        own = [other for other in found if other.source == movement.source]
        angles, left_hand = [other.angle for other in own], self._graph.left_hand
        painted = {
            arrow_targets(turn, angles, left_hand=left_hand) for lane in lanes for turn in lane.turns
        } - {None}
        if not painted or own.index(movement) in painted or not all(lane.turns for lane in lanes):
            return False
        heading = self._outward(movement.source)
        return any(
            other.target == movement.target
            and other.source != movement.source
            and math.cos(math.radians(self._outward(other.source) - heading))
            > self._layout.rules.movements.side_by_side
            for other in found
        )

    def _from(self, arm: Arm, arms: set[Arm], junction: int) -> list[Movement]:
        reached: dict[Arm, float] = {}
        for target in self._paths(arm, arms, junction):
            if not self._forbidden(arm, target, junction):
                reached[target] = self._angle(arm, target)
        if not reached.keys() - {arm}:
            reached = {target: self._angle(arm, target) for target in self._open(arm, arms, junction)}
        alone = len(reached) == 1
        kept = {
            target: angle + self._aside(arm, target)
            for target, angle in reached.items()
            if target.section != arm.section and (alone or abs(angle) < self._layout.rules.movements.u_turn)
        }
        kept = kept or {target: angle for target, angle in reached.items() if target.section != arm.section}
        if not kept and self._layout.leaving(arm):
            kept = {arm: 180.0}
        targets = sorted(kept, key=lambda target: (kept[target], target))
        self._uncross(arm, targets)
        # Whoever lies farther in turns farther in, wherever his road leads then.
        angles = accumulate((kept[target] for target in targets), max)
        return [
            Movement(source=arm, target=target, angle=angle)
            for target, angle in zip(targets, angles, strict=True)
        ]

    def _uncross(self, arm: Arm, targets: list[Arm]) -> None:
        """Swap roads of a large junction that are not in the order in which ways to them cross none."""
        for last in range(len(targets) - 1, 0, -1):
            before = list(targets)
            for place in range(last):
                outer, inner = targets[place : place + 2]
                if self._cross(arm, outer, inner) and not self._cross(arm, inner, outer):
                    targets[place : place + 2] = inner, outer
            if targets == before:
                break

    def _cross(self, arm: Arm, outer: Arm, inner: Arm) -> bool:
        """Tell whether the way from an outer lane to one road crosses that from an inner one to another."""
        if math.dist(self._vertex(outer), self._vertex(inner)) < self._layout.rules.movements.apart:
            return False
        side = -1.0 if self._graph.left_hand else 1.0
        return shapely.crosses(self._draw(arm, outer, side), self._draw(arm, inner, -side))

    def _draw(self, source: Arm, target: Arm, side: float) -> shapely.LineString:
        """Draw the way from a lane on one side of a road, 1 its right, into another road."""
        begin, behind = self._reach(source)
        back = (behind - begin) / max(math.dist(behind, begin), 1e-6)
        right = np.array([-back[1], back[0]]) * self._layout.rules.movements.beside
        return shapely.LineString([begin + side * right, *self._reach(target)])

    def _reach(self, arm: Arm) -> list[NDArray[np.float64]]:
        """Give two places on a road: where it leaves its junction, about, and one beyond."""
        line = self._graph.line(self._graph.sections[arm.section])
        line = shapely.LineString(line[::-1, :2] if arm.at_end else line[:, :2])
        heading = self._layout.rules.movements.heading
        first = min(max(self._layout.cuts.get(arm, 0.0), heading), line.length / 2)
        return [shapely.get_coordinates(line.interpolate(place))[0] for place in (first, first + heading)]

    def _open(self, arm: Arm, arms: set[Arm], junction: int) -> list[Arm]:
        """List all roads out of a junction that no restriction closes, where its ways lead nowhere."""
        return [
            other
            for other in sorted(arms)
            if other.section != arm.section
            and self._layout.leaving(other)
            and not self._forbidden(arm, other, junction)
        ]

    def _forbidden(self, arm: Arm, target: Arm, junction: int) -> bool:
        """Tell whether a turn between two ways is forbidden at the junction, on whatever path across it."""
        source, goal = (self._graph.sections[name] for name, _ in (arm, target))
        way = source.ways[-1] if arm.at_end else source.ways[0]
        onto = goal.ways[-1] if target.at_end else goal.ways[0]
        of = self._layout.junctions.of
        return any(
            not found.only and found.target == onto and any(of.get(node) == junction for node in found.via)
            for found in self._restrictions.get(way, ())
        )

    def _paths(self, arm: Arm, arms: set[Arm], junction: int) -> Iterator[Arm]:
        """Follow the ways from an arm across the junction to other arms, shortest paths first."""
        section, rules = self._graph.sections[arm.section], self._layout.rules.movements
        vertex = section.end if arm.at_end else section.start
        way = section.ways[-1] if arm.at_end else section.ways[0]
        queue: deque[_Path] = deque([(vertex, (way,), (vertex,))])
        seen: set[tuple[int, tuple[int, ...]]] = set()
        while queue:
            here, ways, vertices = queue.popleft()
            # How one came here matters only to restrictions; by the shortest path one gets farthest.
            state = here, ways if any(each in self._restrictions for each in ways) else ()
            if state in seen:
                continue
            seen.add(state)
            if len(seen) > rules.most_paths:
                raise SourceError(
                    f"junction at node {junction}",
                    f"more than {rules.most_paths} paths lead across it; remove what is drawn many times",
                )
            for step, onward in self._steps(here, ways, vertices):
                if step in arms:
                    yield step
                elif step.section in self._layout.inner and len(vertices) < rules.longest_path:
                    there = onward[0]
                    if there not in vertices and self._layout.junctions.of[there] == junction:
                        queue.append(onward)

    def _steps(
        self, here: int, ways: tuple[int, ...], vertices: tuple[int, ...]
    ) -> Iterator[tuple[Arm, _Path]]:
        """List the sections that may be taken from a vertex, and the path that each makes."""
        for name in self._ends[here]:
            onward = self._graph.sections[name]
            for at_end in (False, True):
                if (onward.end if at_end else onward.start) != here:
                    continue
                if not onward.lanes_towards(end=not at_end):
                    continue
                taken = (*ways, onward.ways[-1] if at_end else onward.ways[0])
                if self._allowed(taken, vertices):
                    there = onward.start if at_end else onward.end
                    last = onward.ways[0] if at_end else onward.ways[-1]
                    yield Arm(name, at_end), (there, (*taken, *_other(taken[-1], last)), (*vertices, there))

    def _allowed(self, ways: tuple[int, ...], vertices: tuple[int, ...]) -> bool:
        """Tell whether the last step onto a way breaks no restriction of the ways before it."""
        target, before = ways[-1], _without_repeats(ways[:-1])
        for back in range(len(before)):
            between = before[len(before) - back :]
            for restriction in self._restrictions.get(before[len(before) - back - 1], ()):
                if restriction.via_ways != between:
                    continue
                if not restriction.via_ways and vertices[-1] not in restriction.via:
                    continue
                if restriction.only != (target == restriction.target) and not (
                    restriction.only and target == before[-1]
                ):
                    return False
        return True

    def _angle(self, source: Arm, target: Arm) -> float:
        arriving = self._outward(source) + 180.0
        turn = (self._outward(target) - arriving + 180.0) % 360.0 - 180.0
        turn = -turn if self._graph.left_hand else turn
        # Whoever is led almost back turns to the side where the road lies.
        if abs(turn) > self._layout.rules.movements.sharp and turn * self._aside(source, target) < 0:
            turn -= math.copysign(360.0, turn)
        return turn

    def _aside(self, source: Arm, target: Arm) -> float:
        """Give the degrees by which a road lies to the side, which tells parallel roads from each other."""
        heading = math.radians(self._outward(source) + 180.0)
        (x, y), (a, b) = (self._vertex(arm) for arm in (source, target))
        ahead = (a - x) * math.cos(heading) + (b - y) * math.sin(heading)
        aside = (b - y) * math.cos(heading) - (a - x) * math.sin(heading)
        turn = math.degrees(math.atan2(aside, max(ahead, 0.0) + 30.0))
        return -turn if self._graph.left_hand else turn

    def _vertex(self, arm: Arm) -> tuple[float, float]:
        section = self._graph.sections[arm.section]
        return self._graph.places[section.end if arm.at_end else section.start]

    def _outward(self, arm: Arm) -> float:
        """Give the heading away from the junction, degrees counter-clockwise from east."""
        section = self._graph.sections[arm.section]
        nodes = section.nodes[::-1] if arm.at_end else section.nodes
        x, y = self._graph.places[nodes[0]]
        for node in nodes[1:]:
            a, b = self._graph.places[node]
            if math.hypot(a - x, b - y) >= self._layout.rules.movements.heading:
                break
        return math.degrees(math.atan2(b - y, a - x))


def _other(way: int, last: int) -> tuple[int, ...]:
    return () if way == last else (last,)


def _without_repeats(ways: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(way for k, way in enumerate(ways) if k == 0 or ways[k - 1] != way)
