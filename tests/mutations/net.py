"""A network's XML tree, what mutations choose from in it, and what they say of what they planted."""

import random
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeVar
from xml.etree import ElementTree as ET

Point = tuple[float, ...]
T = TypeVar("T")


class NoPlaceError(Exception):
    """The network has no place for this kind of defect."""


@dataclass(frozen=True)
class Planted:
    """The check that must report the defect, the element it must name, and who else may speak up about it."""

    check: str
    element: tuple[str, str]
    also: frozenset[str] = frozenset()
    everywhere: bool = False
    """Whether the consequences reach beyond what the element touches."""


@dataclass
class Net:
    """A network's XML tree with the few tables that mutations choose from."""

    root: ET.Element
    edges: dict[str, ET.Element] = field(init=False)

    def __post_init__(self) -> None:
        """Index the edges."""
        self.edges = {edge.get("id", ""): edge for edge in self.root.iter("edge")}

    def connections(self) -> list[ET.Element]:
        """Connections between normal edges."""
        return [
            c
            for c in self.root.iter("connection")
            if not c.get("from", "").startswith(":") and not c.get("to", "").startswith(":")
        ]

    def lanes(self, function: str = "normal") -> list[ET.Element]:
        edges = (e for e in self.root.iter("edge") if e.get("function", "normal") == function)
        return [lane for edge in edges for lane in edge.iter("lane")]

    def lane(self, c: ET.Element, end: str) -> ET.Element:
        """The lane at an end of a connection."""
        return next(
            x for x in self.edges[c.get(end, "")].iter("lane") if x.get("index") == c.get(f"{end}Lane")
        )

    def normal(self) -> list[ET.Element]:
        """Edges between junctions."""
        return [e for e in self.edges.values() if e.get("function", "normal") == "normal"]

    def neighbours(self, junction: str) -> set[str]:
        """The junctions that edges lead to or come from."""
        ends = [(e.get("from", ""), e.get("to", "")) for e in self.normal()]
        return {b if a == junction else a for a, b in ends if junction in (a, b)}

    def remove(self, connections: Iterable[ET.Element]) -> None:
        for c in list(connections):
            self.root.remove(c)

    def ways(self) -> dict[str, list[ET.Element]]:
        """The connections between normal edges by the edge that they leave."""
        found: dict[str, list[ET.Element]] = {}
        for c in self.connections():
            found.setdefault(c.get("from", ""), []).append(c)
        return found

    def chain(self, c: ET.Element) -> list[str]:
        """The internal lanes of a connection, one after the other."""
        onward = {lane_of(x, "from"): x.get("via", "") for x in self.root.iter("connection") if x.get("via")}
        found, lane = [], c.get("via", "")
        while lane and lane not in found:
            found.append(lane)
            lane = onward.get(lane, "")
        return found

    def driven(self) -> list[ET.Element]:
        """Lanes that cars use and that a drawn way leaves."""
        left = {lane_of(c, "from") for c in self.connections() if c.get("via")}
        return [lane for lane in self.lanes() if lane.get("id") in left and is_for_cars(lane)]

    def signals(self) -> list[ET.Element]:
        """Programs of signals that change."""
        return [
            logic
            for logic in self.root.iter("tlLogic")
            if len(list(logic.iter("phase"))) > 1 and not logic.get("type", "static").startswith("rail")
        ]

    def links(self, signal: str) -> dict[int, list[ET.Element]]:
        found: dict[int, list[ET.Element]] = {}
        for c in self.root.iter("connection"):
            if c.get("tl") == signal and int(c.get("linkIndex", "-1")) >= 0:
                found.setdefault(int(c.get("linkIndex", "-1")), []).append(c)
        return found


def lane_of(c: ET.Element, end: str) -> str:
    return f"{c.get(end)}_{c.get(f'{end}Lane')}"


def name_of(c: ET.Element) -> str:
    return f"{lane_of(c, 'from')}->{lane_of(c, 'to')}"


def is_for_cars(lane: ET.Element) -> bool:
    if "allow" in lane.attrib:
        return "passenger" in lane.get("allow", "").split()
    return not {"passenger", "all"} & set(lane.get("disallow", "").split())


def is_sidewalk(lane: ET.Element) -> bool:
    return lane.get("allow") == "pedestrian"


def shape_of(element: ET.Element) -> list[Point]:
    return [tuple(map(float, p.split(","))) for p in element.get("shape", "").split()]


def set_shape(element: ET.Element, points: Iterable[Point]) -> None:
    element.set("shape", " ".join(",".join(f"{v:.2f}" for v in p) for p in points))


def choose(chance: random.Random, options: Iterable[T]) -> T:
    """Choose one.

    Raises:
        NoPlaceError: there is none.
    """
    listed = list(options)
    if not listed:
        raise NoPlaceError
    return chance.choice(listed)


def drives(net: Net, c: ET.Element) -> bool:
    return all(is_for_cars(net.lane(c, end)) for end in ("from", "to"))


def _checks(**names: str) -> frozenset[str]:
    return frozenset(f"{theme}.{name}" for theme, listed in names.items() for name in listed.split())


WAYS = _checks(
    topology="lane_dead_end lane_no_entry edge_not_connected uturn_only components missing_turn "
    "unreachable_edge_in_tls lane_type_mix median_cross",
    geometry="short_connection intersecting_lefts",
)
"""What may follow from ways that are gone or lead elsewhere."""
SHAPES = _checks(
    geometry="gap lane_overlap sidewalk_on_road lane_invalid kink tight_radius length_mismatch "
    "crossing_off_road short_connection intersecting_lefts grade z_jump",
    topology="median_cross missing_turn wrong_way waits_in_path",
)
"""What may follow from a lane that lies elsewhere."""
TIMES = _checks(
    signals="missing_yellow yellow_short all_red always_green rl_form never_green green_conflict cycle "
    "green_fraction unused_index tls_trivial minor_green_fast state_length crossing_uncontrolled_at_tls "
    "no_room",
    pedestrians="crossing_clearance walk_min walk_before_green",
    topology="waits_in_path",
)
"""What may follow from a signal that shows other things, or to others."""
WALKS = _checks(
    pedestrians="crossing_ends crossing_no_target walk_components dead_end_walking_area walkway_extent",
)
"""What may follow from changed ways to walk."""
