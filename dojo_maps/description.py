"""The one description of a road map: the vocabulary that every other module shares.

Sources build it, enrichment adds to it, geometry, validation and exports read it. Every position is in
the network's own coordinates: metres, x east, y north, z up. A ring closes implicitly: its last point
joins its first. Letters for directions, link states and phases are SUMO's own.
"""

import re
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_maps.wording import counted

FORMAT = "dojo-map"
VERSION = 1

Points = NDArray[np.float64]
"""(n, 3) positions, metres, map frame; read-only."""


def points(values: Any) -> Points:
    """Make a read-only (n, 3) array of positions; two-dimensional input gets z = 0, none is fine.

    Args:
        values: positions, (n, 2) or (n, 3), metres.

    Returns:
        (n, 3), metres.

    Raises:
        ValueError: they have another shape.
    """
    array = np.array(values, dtype=np.float64)
    if array.size == 0:
        array = np.empty((0, 3))
    elif array.shape[1:] == (2,):
        array = np.column_stack([array, np.zeros(len(array))])
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"positions of shape {array.shape}, expected (n, 2) or (n, 3)")
    array.setflags(write=False)
    return array


class LaneKind(StrEnum):
    """What a lane is for, from the vehicle classes allowed on it."""

    DRIVING = "driving"
    BUS = "bus"
    BICYCLE = "bicycle"
    SIDEWALK = "sidewalk"
    SHOULDER = "shoulder"
    RAIL = "rail"
    WATERWAY = "waterway"
    OTHER = "other"


CARRIAGEWAY = (LaneKind.DRIVING, LaneKind.BUS)
"""Lanes of motor traffic, which make a road."""


class Origin(StrEnum):
    """Whether a thing stands in the network or was added to be looked at."""

    NETWORK = "network"
    GENERATED = "generated"


class LinkKind(StrEnum):
    """Who a signal link is for."""

    VEHICLE = "vehicle"
    PEDESTRIAN = "pedestrian"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Source:
    """The file a map was made from; `sha256` is of its bytes as they lie on disk.

    `network_sha256` is of the SUMO network that the description speaks of, as it lies in the bundle.
    """

    kind: str
    file: str
    sha256: str
    sumo_version: str
    network_sha256: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Projection:
    """How map coordinates relate to the earth: projected = map - net_offset; `proj` is a PROJ string."""

    proj: str | None
    net_offset: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Road:
    """A directed section between two junctions; `kind` is the network's edge type, such as highway.primary.

    `lanes` are in index order: index 0 is the outermost lane, rightmost where traffic keeps right. `bidi` is
    the road of the opposite direction that shares ground with this one.
    """

    id: str
    name: str
    from_junction: str = field(metadata={"json": "from"})
    to_junction: str = field(metadata={"json": "to"})
    kind: str
    priority: int
    lanes: tuple[str, ...]
    bidi: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lane:
    """A lane and its centre line, in driving direction.

    `speed` is the limit in m/s, `length` the length SUMO drives with, which may differ from the shape's.
    `change_inward` and `change_outward` tell whether ordinary traffic may change to the neighbour with the
    next higher or lower index; `opposite` is the lane that may be used to overtake against its direction.
    """

    id: str
    road: str
    index: int
    kind: LaneKind
    width: float
    speed: float
    length: float
    allow: tuple[str, ...]
    shape: Points
    change_inward: bool = True
    change_outward: bool = True
    opposite: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Connection:
    """A way from lane to lane across a junction; `shape` runs from the one's end to the other's start.

    `joints` tells how far apart the parts lie where one meets the next, from the lane's end over each
    internal lane to the next lane's start: metres across and metres up; none without internal lanes.
    `waits` tells how far from the lane's end its vehicles wait inside the junction for others, metres; None
    where they do not. `allow` names SUMO's vehicle classes that may take it; None for all
    that may use both of its lanes.
    """

    from_lane: str = field(metadata={"json": "from"})
    to_lane: str = field(metadata={"json": "to"})
    via: tuple[str, ...]
    direction: str
    state: str
    signal: str | None
    link_index: int | None
    shape: Points
    joints: tuple[tuple[float, float], ...] = ()
    waits: float | None = None
    allow: tuple[str, ...] | None = None

    @property
    def id(self) -> str:
        """The connection's name in reports."""
        return f"{self.from_lane}->{self.to_lane}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RightOfWay:
    """What the network says of one way across a junction: a connection's id or a crossing's.

    `foes` are the ways that cross or join it, `response` those of them that it must let go first, both as
    places in the junction's `right_of_way`; `cont` tells whether it may wait inside the junction. Ways that
    no record of the network names have an empty `link`.
    """

    link: str
    foes: tuple[int, ...]
    response: tuple[int, ...]
    cont: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Junction:
    """Where roads meet; `kind` is SUMO's junction type; `polygon` may have no area where only shapes bend."""

    id: str
    kind: str
    position: tuple[float, float, float]
    polygon: Points
    incoming: tuple[str, ...]
    outgoing: tuple[str, ...]
    right_of_way: tuple[RightOfWay, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sidewalk:
    """Pavement along a road (`road`) or around a corner (None), before the carriageway is cut out of it."""

    id: str
    origin: Origin
    road: str | None
    polygon: Points
    holes: tuple[Points, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Crossing:
    """A pedestrian crossing over `roads`; `shape` is its centre line from kerb to kerb."""

    id: str
    origin: Origin
    junction: str
    roads: tuple[str, ...]
    width: float
    shape: Points
    polygon: Points
    signal: str | None
    link_index: int | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WalkingArea:
    """Pavement at a junction that joins sidewalks and crossings."""

    id: str
    origin: Origin
    junction: str
    polygon: Points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Walk:
    """A step on foot between a sidewalk's lane, a walking area and a crossing, by their ids, either way."""

    from_id: str = field(metadata={"json": "from"})
    to_id: str = field(metadata={"json": "to"})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Link:
    """What one letter of a signal's state controls: lane to lane, or walking area to crossing."""

    index: int
    kind: LinkKind
    from_id: str = field(metadata={"json": "from"})
    to_id: str = field(metadata={"json": "to"})
    direction: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Phase:
    """One state of a signal program and how long it lasts, in seconds.

    `following` are the places of the phases that may come next; none is the one after it. `yellow` and `red`
    are those that a NEMA phase shows of itself where it ends.
    """

    duration: float
    min_duration: float | None
    max_duration: float | None
    state: str
    following: tuple[int, ...] = ()
    yellow: float | None = None
    red: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Program:
    """A signal program; `kind` is SUMO's logic type, such as static, actuated or NEMA.

    `rings` are those of a NEMA program: per ring and side of a barrier, the places of its phases.
    """

    id: str
    kind: str
    offset: float
    phases: tuple[Phase, ...]
    rings: tuple[tuple[tuple[int, ...], ...], ...] = ()


LAMP_SPACING = 0.3
"""Metres between the centres of a head's lamps."""
LAMP_RADIUS = 0.11
LAMP_AHEAD = 0.12
"""Metres from a head's position to the plane of its lamps, along its heading."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalHead:
    """A signal face: where it hangs and the heading it shines to (radians, counter-clockwise from east).

    A head on the far side hangs across the junction from the traffic that it is for.
    """

    link_indices: tuple[int, ...]
    position: tuple[float, float, float]
    heading: float
    far_side: bool = False

    def lamps(self, count: int) -> Points:
        """Place the centres of `count` lamps, red on top: (count, 3).

        Args:
            count: of lamps.

        Returns:
            (count, 3), metres, map frame.
        """
        ahead = LAMP_AHEAD * np.array([np.cos(self.heading), np.sin(self.heading), 0.0])
        up = ((count - 1) / 2 - np.arange(count)) * LAMP_SPACING
        return points(np.array(self.position) + ahead + np.column_stack([np.zeros((count, 2)), up]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signal:
    """A traffic light controller, the junctions and links it controls, and where its heads stand."""

    id: str
    junctions: tuple[str, ...]
    links: tuple[Link, ...]
    programs: tuple[Program, ...]
    heads: tuple[SignalHead, ...] = ()

    @property
    def program(self) -> Program | None:
        """The program that SUMO runs: the last one."""
        return self.programs[-1] if self.programs else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StopLine:
    """Where traffic on a lane stops, across the lane."""

    lane: str
    shape: Points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prop:
    """A thing beside the road: a polygon (island, building) or a position (pole, tree), and its height."""

    id: str
    kind: str
    height: float
    polygon: Points | None = None
    position: tuple[float, float, float] | None = None
    tags: tuple[tuple[str, str], ...] = ()
    holes: tuple[Points, ...] = ()


BUILDING_FOOTING = 0.3
"""How far walls reach below a building's foot, metres; farther where the ground slopes."""
STREET_LAMP_REACH = 1.4
"""Metres from a street lamp's post to the lamp, along the heading in its tags."""


def heading_of(prop: Prop) -> float:
    """Tell which way a prop faces by its tag, radians counter-clockwise from east; 0 where it has none.

    Args:
        prop: any.

    Returns:
        Radians.
    """
    found = re.fullmatch(r"-?\d{1,4}(\.\d{1,17})?", dict(prop.tags).get("heading", ""), re.ASCII)
    return float(found[0]) if found else 0.0


def outline_of(prop: Prop) -> Points:
    """Give a prop's outline, or the one point where it stands.

    Args:
        prop: any.

    Returns:
        (n, 3), metres, map frame; zeros for a prop that has neither.
    """
    return prop.polygon if prop.polygon is not None else points([prop.position or (0.0, 0.0, 0.0)])


def foot_of(building: Prop) -> float:
    """Tell how high the ground is where a building stands, in the middle of the heights at its corners.

    Args:
        building: a prop with an outline.

    Returns:
        Metres, map frame.
    """
    return float(np.median(np.asarray(building.polygon)[:, 2]))


def hung_lamp(post: Prop) -> Points:
    """Tell where the light of a prop of kind `lamp` is: (3,) metres, at the end of its arm.

    Args:
        post: of kind `lamp`.

    Returns:
        (3,), metres, map frame.
    """
    heading = heading_of(post)
    arm = STREET_LAMP_REACH * np.array([np.cos(heading), np.sin(heading), 0.0])
    hung: Points = np.array(post.position) + arm + [0.0, 0.0, post.height]
    return hung


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class RoadMap:
    """Everything known of a map. Lists keep the order of the source; ids are unique within a list.

    Attributes:
        name: the file's, without its suffixes, or the packaged scenario's.
        source: the file that it was made from.
        projection: how positions relate to the earth.
        origin: x and y, metres, around which scene.glb is drawn.
        bounds: lower left and upper right corner, metres.
        left_hand: traffic keeps to the left.
        roads: every normal edge of the network.
        lanes: of the roads, ids as in the network.
        connections: from lane to lane, each once.
        junctions: with the ground that they cover.
        sidewalks: the network's, and generated ones.
        crossings: the network's, and generated ones.
        walking_areas: where sidewalks and crossings meet.
        signals: with their links, programs and heads.
        stop_lines: one for each lane that has to stop.
        props: buildings, trees, poles, islands and whatever else stands beside the road.
        walks: from pavement to pavement, over crossings.
    """

    name: str
    source: Source
    projection: Projection
    origin: tuple[float, float]
    bounds: tuple[tuple[float, float], tuple[float, float]]
    left_hand: bool
    roads: tuple[Road, ...]
    lanes: tuple[Lane, ...]
    connections: tuple[Connection, ...]
    junctions: tuple[Junction, ...]
    sidewalks: tuple[Sidewalk, ...]
    crossings: tuple[Crossing, ...]
    walking_areas: tuple[WalkingArea, ...]
    signals: tuple[Signal, ...]
    stop_lines: tuple[StopLine, ...] = ()
    props: tuple[Prop, ...] = ()
    walks: tuple[Walk, ...] = ()

    def __repr__(self) -> str:
        """Tell its name and how much there is."""
        return f"RoadMap({self.name!r}, {self.tell_size()})"

    def tell_size(self) -> str:
        """Tell how much there is, in words.

        Returns:
            The numbers of roads, lanes and so on.
        """
        things = ("road", "lane", "junction", "signal", "crossing")
        return ", ".join(counted(len(getattr(self, f"{thing}s")), thing) for thing in things)
