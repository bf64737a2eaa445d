"""Who gives way at a junction without signals: by the signs mapped there, else by the country's rule.

Signs are nodes: at the junction itself, or on an approach within sight of it. netconvert decides by the type
of a junction and the priorities of its edges, so an approach with a sign gets the lowest priority there is,
and a road tagged as a priority road the highest. Small roads of one kind that meet without signs are equal;
who goes first there differs between countries. All else is netconvert's: the bigger road, or the one that
goes on.
"""

import itertools
import math
from collections.abc import Sequence

from dojo_maps.sources.osm.graph.road_graph import Section
from dojo_maps.sources.osm.graph.sign_direction import sign_direction
from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.read.country import EqualRoads
from dojo_maps.sources.osm.read.way_tags import KINDS

_SIGNED, _PRIORITY_ROAD = 1, 20
"""Priorities of an approach with a sign and of a priority road; those of other roads lie between."""
_EQUAL_KINDS = ("residential", "living_street")
_EQUAL_SPEED = 30 / 3.6 + 0.1
"""Metres a second: the limit up to which roads of other kinds are equal, too, in zones of 30 km/h."""
_STOP, _GIVE_WAY = "stop", "give_way"


class RightOfWay:
    """The signs at the junctions of a layout."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._signs: dict[Arm, str] = {}
        self._all_way: set[int] = set()
        self._mini: set[int] = set()
        self._minor: dict[int, str] = {}
        for name, section in layout.graph.sections.items():
            if name not in layout.inner:
                self._read_approach(section)
        for vertex in layout.junctions.of:
            self._read_junction(vertex)

    def kind(self, junction: int, arms: Sequence[Arm]) -> str:
        """Name the type that netconvert gives a junction without signals.

        Args:
            junction: its lowest vertex.
            arms: all that it has.

        Returns:
            `allway_stop`, `priority_stop`, `priority`, `right_before_left` or `left_before_right`.
        """
        arriving = [arm for arm in arms if self._arrives(arm)]
        if junction in self._mini:
            # Who circulates comes from the side that traffic does not keep to.
            return self._first_from(right=self._layout.graph.left_hand)
        stopping = [arm for arm in arriving if self.sign(arm, arms) == _STOP]
        if junction in self._all_way or (len(arriving) > 2 and len(stopping) == len(arriving)):
            return "allway_stop"
        if stopping:
            return "priority_stop"
        rule = self._layout.graph.country.equal_roads
        if rule is EqualRoads.ROAD_THAT_ENDS or not self._equal(arms):
            return "priority"
        if rule is EqualRoads.RIGHT_AT_CROSSROADS and len(arms) < 4:
            return "priority"
        return self._first_from(right=rule is not EqualRoads.LEFT_FIRST)

    def sign(self, arm: Arm, arms: Sequence[Arm]) -> str | None:
        """Name the sign of an approach: its own, or that of the minor roads of a junction.

        Args:
            arm: that the approach arrives through.
            arms: all of its junction.

        Returns:
            `stop` or `give_way`; None for no sign.
        """
        junction = self._layout.junction(arm)
        if arm in self._signs or junction not in self._minor:
            return self._signs.get(arm)
        ranks = [self._rank(other) for other in arms]
        return self._minor[junction] if self._rank(arm) < max(ranks) else None

    def priority(self, arm: Arm, arms: Sequence[Arm]) -> int:
        """Give the priority of the road that arrives through an arm, for netconvert.

        Args:
            arm: that it arrives through.
            arms: all of its junction.

        Returns:
            The higher, the more it goes first; the lowest there is for a road with a sign.
        """
        if self.sign(arm, arms):
            return _SIGNED
        return _PRIORITY_ROAD if self._is_priority_road(arm) else self._rank(arm)

    def _first_from(self, *, right: bool) -> str:
        """Name the type that lets one side go first; netconvert mirrors networks that keep left."""
        return "right_before_left" if right != self._layout.graph.left_hand else "left_before_right"

    def _equal(self, arms: Sequence[Arm]) -> bool:
        """Tell whether small roads of one kind meet, none of them with a sign."""
        roads = [self._layout.graph.sections[arm.section].road for arm in arms]
        small = all(road.kind in _EQUAL_KINDS or road.speed <= _EQUAL_SPEED for road in roads)
        signed = any(self.sign(arm, arms) or self._is_priority_road(arm) for arm in arms)
        alike = len({KINDS[road.kind] for road in roads}) == 1 and not any(road.roundabout for road in roads)
        return len(arms) > 2 and small and alike and not signed

    def _is_priority_road(self, arm: Arm) -> bool:
        graph = self._layout.graph
        way = graph.sections[arm.section].ways[-1 if arm.at_end else 0]
        return graph.ways[way].tags.get("priority_road") in ("designated", "yes_unposted")

    def _rank(self, arm: Arm) -> int:
        return KINDS[self._layout.graph.sections[arm.section].road.kind]

    def _arrives(self, arm: Arm) -> bool:
        return bool(self._layout.arriving(arm))

    def _read_approach(self, section: Section) -> None:
        graph = self._layout.graph
        steps = [math.dist(graph.places[a], graph.places[b]) for a, b in itertools.pairwise(section.nodes)]
        for index, node in enumerate(section.nodes[1:-1], 1):
            sign = graph.tags.get(node, {}).get("highway")
            if sign not in (_STOP, _GIVE_WAY):
                continue
            before, after = sum(steps[:index]), sum(steps[index:])
            said = sign_direction(graph, section, node)
            at_end = after < before if said == 0 else said > 0
            arm, farthest = Arm(section.id, at_end), graph.rules.movements.sign_before_junction
            if (after if at_end else before) <= farthest and self._arrives(arm):
                self._signs[arm] = sign

    def _read_junction(self, vertex: int) -> None:
        tags = self._layout.graph.tags.get(vertex, {})
        junction = self._layout.junctions.of[vertex]
        kind = tags.get("highway")
        if kind == "mini_roundabout":
            self._mini.add(junction)
        elif kind == _STOP and tags.get("stop") == "all":
            self._all_way.add(junction)
        elif kind in (_STOP, _GIVE_WAY):
            self._minor[junction] = kind
