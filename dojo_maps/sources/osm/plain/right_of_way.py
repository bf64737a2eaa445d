"""Who gives way at a junction without signals: by the signs mapped there, else as netconvert has it.

Signs are nodes: at the junction itself, or on an approach within sight of it. netconvert decides by the type
of a junction and the priorities of its edges, so an approach with a sign gets the lowest priority there is.
"""

import itertools
import math
from collections.abc import Sequence

from dojo_maps.sources.osm.graph.road_graph import Section
from dojo_maps.sources.osm.graph.sign_direction import sign_direction
from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.read.way_tags import KINDS

SIGNED_PRIORITY = 1
"""Of an approach with a sign; other roads have more."""
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
        """Name the type that netconvert gives a junction without signals."""
        arriving = [arm for arm in arms if self._arrives(arm)]
        if junction in self._mini:
            # Who circulates comes from the side that traffic does not keep to.
            return "right_before_left" if self._layout.graph.left_hand else "left_before_right"
        stopping = [arm for arm in arriving if self.sign(arm, arms) == _STOP]
        if junction in self._all_way or (len(arriving) > 2 and len(stopping) == len(arriving)):
            return "allway_stop"
        return "priority_stop" if stopping else "priority"

    def sign(self, arm: Arm, arms: Sequence[Arm]) -> str | None:
        """Name the sign of an approach: its own, or that of the minor roads of a junction."""
        junction = self._layout.junction(arm)
        if arm in self._signs or junction not in self._minor:
            return self._signs.get(arm)
        ranks = [self._rank(other) for other in arms]
        return self._minor[junction] if self._rank(arm) < max(ranks) else None

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
