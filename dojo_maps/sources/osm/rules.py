"""The limits that an import goes by, with their units and reasons, in one record.

Each part is named by what it decides; the stage that goes by it is in its first line. The graph carries the
record to the stages after it. What OpenStreetMap, SUMO or a country lays down is not here, nor are bounds on
what is read from hostile files, nor the steps of a computation.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneRules:
    """How wide lanes are (`read`)."""

    usual: float = 3.25
    """m across, where no tag says so."""
    narrowest: float = 2.5
    """m across, below which the width of a carriageway is not believed."""
    widest: float = 4.5
    """m across, above which it is not: the width then holds parked cars or more lanes than are told."""
    beside_parked: float = 2.75
    """m across in a small street, with cars parked along it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionRules:
    """How ways become sections (`graph`)."""

    widest_map: float = 100_000.0
    """m across, of all roads: farther, one projection does not hold."""
    shortest: float = 12.0
    """m of a section between two changes of lanes, below which it takes its neighbour's lanes."""
    shortest_parking: float = 30.0
    """m of it where only parked cars change: they end before crossings, which need the road's length."""
    barrier_gap: float = 1.0
    """m from a barrier to the ends of the road on both sides."""
    same_place: float = 0.5
    """m from where two roads cross to a node of theirs within which the node is taken for the crossing."""
    most_crossing: int = 200
    """places where roads may cross without a common node, ..."""
    most_crossing_share: float = 0.5
    """... and this share of their straight pieces more; streets cross at fewer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CentreLaneRules:
    """What is built of a lane in the middle that both directions turn from (`graph`)."""

    length: float = 60.0
    """m of the turn lane before a junction."""
    street_left: float = 20.0
    """m of a street that are left between its turn lanes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackRules:
    """Where tracks of trams, trains and bicycles are built, and how they meet roads (`graph`, `layout`)."""

    beyond_roads: float = 100.0
    """m beyond the roads' bounds up to which tracks are built."""
    on_road: float = 0.6
    """m between a node of a track and the line of the road that it meets there."""
    heading: float = 5.0
    """m over which the heading of a track or road is taken where they meet."""
    along_road: float = 0.93
    """cosine of the angle between a track and a road from which it runs along it."""
    from_road_end: float = 30.0
    """m from a road's end within which a track that meets it is part of the junction there."""
    from_crossing: float = 15.0
    """m between a track and people who cross the same road, within which they cross at one junction."""
    twin: float = 6.5
    """m between the two tracks of a line, at most."""
    in_street: float = 1.2
    """m that a track's middle may lie outside of the carriageway that it runs in: half of a tram."""
    street_parallel: float = 0.92
    """cosine of the angle between them."""
    street_gap: float = 16.0
    """m without a street between two parts of a track in one street that are one."""
    street_middle: float = 0.9
    """m from the middle of a street within which a two-way track is one for both directions."""
    street_share: float = 0.5
    """share of a road that a tram must run in so that it shares its lanes."""
    beside_road: float = 1.0
    """m between the end of a track and a carriageway."""
    road_left: float = 30.0
    """m of a road that are left when it is drawn back for a track."""
    stray_signal: float = 20.0
    """m from a signal of no junction to the place where a track crosses the road that it stops."""
    least_ground: float = 5.0
    """m² of a junction that has ground of its own."""
    pavement: float = 2.0
    """m around a junction that leave no room for a track."""
    shortest: float = 5.0
    """m up to which a cycle track between two junctions vanishes, ..."""
    shortest_rails: float = 20.0
    """... and rails, with their switches."""
    shortest_built: float = 3.0
    """m of a track as built, below which it becomes part of a junction at its ends, too."""
    widest: float = 40.0
    """m across the nodes of tracks that are one."""
    longest_inside: float = 60.0
    """m of a track that leads back to its junction, up to which it vanishes inside."""
    beside_mapped: float = 1.0
    """m from the mapped track inside a junction up to which bicycles ride as netconvert leads them."""
    sharpest_rails: float = 0.3
    """cosine of the sharpest turn of rails."""
    beside_ahead: float = 15.0
    """m from a junction at which it is told which roads lie beside a track."""
    pavement_beside: float = 6.0
    """m from a segregated cycle track to the middle of a sidewalk that is the strip where people walk, ..."""
    pavement_share: float = 0.8
    """... along this share of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CrowdingRules:
    """How many roads may lie on one place (`graph`); laying out compares each with each."""

    most_at_node: int = 24
    """roads that may begin, end or pass at one node; in OpenStreetMap up to 8 do."""
    most_near_place: float = 40.0
    """pieces of road near one place; junctions drawn lane by lane have up to 16."""
    near: float = 8.0
    """m within which a piece is near a place."""
    least_weight: float = 0.05
    """m that a piece counts for at least: finely drawn bends have many, ..."""
    most_weight: float = 1.0
    """... and at most."""
    most_beside: float = 1.5
    """other roads that lie on the average place; up to 0.9 do, most of them at junctions."""
    network: float = 10_000.0
    """m of road from which that average must be a street network's; a single junction has more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundaboutRules:
    """What a roundabout is, and how far a small one grows (`graph`, `plain`)."""

    largest: float = 60.0
    """m across, of a ring that nothing but its shape makes a roundabout."""
    roundness: float = 0.88
    """its area, as a share of that of a circle of its length; a square has 0.79."""
    most_parts: int = 16
    """sections of such a ring."""
    between_arms: float = 6.5
    """m of ring to keep between the mouths of two arms, with their rounded corners: a car waits there."""
    pavement: float = 2.5
    """m of pavement that a mouth has on each side."""
    most_growth: float = 4.0
    """m by which a radius grows at most."""
    fading: float = 12.0
    """m out from a ring over which its arms give way to it."""
    corner_radius: float = 0.5
    """m by which corners at a ring are rounded; more would leave nothing of a small ring."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JunctionRules:
    """Which vertices are one junction (`junctions`)."""

    short_section: float = 14.0
    """m of a section up to which its ends are one junction."""
    between_signals: float = 25.0
    """m of it where both ends have signals."""
    carriageways_apart: float = 28.0
    """m from one carriageway of a divided road to the other."""
    opposite: float = 0.8
    """cosine of the angle by which they may differ from leading opposite ways."""
    widest: float = 70.0
    """m across the vertices of a junction."""
    widest_joined: float = 150.0
    """m across it where a road beside it would have no length otherwise."""
    beside_road: float = 6.0
    """m from a carriageway's border up to which ground may be a junction's."""
    most_void: float = 200.0
    """m² of farther ground between vertices that are joined; junctions are drawn tighter."""
    vanishing: float = 80.0
    """m of a road inside a junction up to which it can vanish there."""
    vanishing_loop: float = 40.0
    """m of a road that leads back to where it began, up to which it vanishes."""
    vanishing_ring: float = 15.0
    """m of a part of a roundabout inside a junction, up to which it vanishes."""
    short_way_round: float = 1.5
    """lengths of the straight line up to which a part of a roundabout is the short way, and vanishes."""
    thin_loop: float = 0.6
    """widths of a road, as the area of a loop over its length, below which it lies on itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalRules:
    """Which junction a signal is for, and which junctions share a controller (`junctions`, `layout`).

    Times of programs are in `signals.programs`, as the checks have them in `dojo_maps.signals.timing`.
    """

    before_junction: float = 45.0
    """m along an approach from a signal to its junction; stop lines stand back so far at most."""
    crossing_at_junction: float = 22.0
    """m from a junction within which a signalised crossing belongs to its signals."""
    signal_at_crossing: float = 20.0
    """m from a crossing between junctions within which a signal of no junction is its own."""
    one_controller: float = 35.0
    """m along a road between signalised junctions that share a controller: few cars fit between."""
    side_by_side: float = 31.0
    """m in a straight line between such junctions."""
    one_place: float = 50.0
    """m along a road between signals on both sides of a median, or at both legs of a dog-leg."""
    leaves_aside: float = 0.5
    """sine of the angle from which a road leaves to a side."""
    widest_controller: float = 130.0
    """m across the junctions of one controller."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossingRules:
    """Where crossings are built (`junctions`, `layout`)."""

    width: float = 4.0
    """m across."""
    same: float = 5.0
    """m between two crossings of one section that are one."""
    at_border: float = 14.0
    """m from a vertex up to which a crossing lies on the junction's border, and beyond which it has a node of
    its own, so the least length of the road up to it, ..."""
    at_border_with_signals: float = 30.0
    """... and with signals."""
    at_vertex: float = 4.0
    """m from a vertex where nothing meets, up to which it lies there."""
    between: float = 11.0
    """m between two crossings of a section that leave an edge of 5 m between them, and a little."""
    beyond_border: float = 14.0
    """m that a road goes on where the extract ends at a crossing, ..."""
    least_beyond_border: float = 8.0
    """... and at least, where another road lies ahead."""
    farthest_from_arm: float = 30.0
    """m from a vertex up to which a crossing may lie at its arm."""
    road_left: float = 6.0
    """m of a road that is drawn back to a crossing which are left."""
    may_be_moved: float = 4.0
    """m that a crossing may be moved inward where its road is too short for its place."""
    corner: float = 6.0
    """m that a road loses at a junction where nothing draws it back."""
    straight_on: float = 4.0
    """m that an arm may be farther away than others from which a road leads to a crossing in the junction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtensionRules:
    """When a road reaches into a wide junction, to a crossing there (`layout`)."""

    nearest: float = 10.0
    """m from a road's vertex to a crossing from which the road goes on to it, ..."""
    farthest: float = 100.0
    """... and up to which."""
    nearer_from_other_side: float = 0.5
    """share of the way to it within which no road of the other side may be."""
    kept_free: float = 20.0
    """m of a road from a side that are kept free, ..."""
    kept_free_before: float = 15.0
    """... and before its end."""
    from_side: float = 0.5
    """cosine of the angle between roads that arrive from different sides."""
    straight_on: float = 0.8
    """m straight on that each metre of the way to a crossing must bring."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForkRules:
    """How far the roads of a junction that lie on each other are drawn back (`layout`)."""

    farthest: float = 45.0
    """m from a junction within which its roads must have parted, ..."""
    farthest_of_fork: float = 80.0
    """... and long ones of one vertex; netconvert gives no ground where roads are drawn back much farther."""
    gap: float = 0.3
    """m between two roads that have parted."""
    parting: float = 1.5
    """m that a fork's roads must draw apart over that way; carriageways do not."""
    others: float = 3.0
    """m that the other roads are drawn back there, so that the junction has ground of its own."""
    past_crossing: float = 2.0
    """m by which a crossing may be moved out."""
    road_left: float = 14.0
    """m that are left of a road that is drawn back, ..."""
    road_left_of_fork: float = 40.0
    """... and very far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpacingRules:
    """How carriageways are kept off each other (`layout`)."""

    gap: float = 0.3
    """m between two carriageways."""
    narrowest_lane: float = 2.75
    """m across a lane that gives way."""
    farthest: float = 2.5
    """m that a carriageway may be moved to its side."""
    least_overlap: float = 4.0
    """m² that two roads have in common, from which something is done."""
    taken_over: float = 0.75
    """m that one carriageway may move for the other; more would lead it away from its own ends."""
    near_share: float = 0.25
    """share of the places along a road where another may lie nearer: they part slowly."""
    parallel: float = 0.94
    """cosine of the angle between roads that run side by side."""
    on_one_line: float = 8.0
    """m along the road between the ends of two arms that are crossed in one go."""
    island: float = 1.5
    """m between their borders from which people may wait there."""


def _steepest() -> dict[str, float]:
    return {"motorway": 0.06, "trunk": 0.08, "primary": 0.10, "secondary": 0.11, "tertiary": 0.12}


@dataclass(frozen=True, slots=True, kw_only=True)
class HeightRules:
    """How high bridges and tunnels lie (`layout`)."""

    level: float = 5.0
    """m from one level to the next, as a truck needs under a bridge."""
    grade: float = 0.06
    """rise of a ramp over its length, ..."""
    steepest: float = 0.15
    """... and where it ends before it passes under a bridge or above a tunnel."""
    parting: float = 15.0
    """m from where a road leaves a bridge or tunnel, within which it does not pass under or above it."""
    clear: float = 4.5
    """m between two roads that pass, from which the ground itself parts them, and no ramp is needed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainRules:
    """How streets follow the ground (`layout`)."""

    step: float = 15.0
    """m along a street between the places at which a raster is asked."""
    smooth: float = 20.0
    """m along a street over which heights are smoothed: rasters show walls, and steps of whole metres."""
    apart: float = 1.0
    """m along a street from one place to the next, at least."""
    under_bridge: float = 12.0
    """m from a bridge's middle within which a raster may show the bridge in place of the ground."""
    steepest: Mapping[str, float] = field(default_factory=_steepest)
    """rise over length by kind of road, AASHTO's Policy on Geometric Design of Highways and Streets, ..."""
    steepest_other: float = 0.15
    """... and of small streets."""
    steepest_tagged: float = 0.35
    """rise over length of the steepest streets there are; more is not believed."""
    tagged: float = 10.0
    """how much more the slope of a road with `incline` counts than that of one without."""
    covered: float = 0.5
    """share of the streets that a raster must cover."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SidewalkRules:
    """Which roads have sidewalks, and how wide (`layout`)."""

    width: float = 2.5
    """m across."""
    island_width: float = 1.0
    """m of pavement where a crossing leads to a side without a sidewalk: an island or a kerb."""
    beside_road: float = 9.0
    """m from a carriageway's border within which a mapped sidewalk belongs to the road."""
    to_other_carriageway: float = 25.0
    """m within which the other carriageway of a divided road lies: there is a median, not a sidewalk."""
    least_share: float = 0.4
    """share of a road's length beside which one must be mapped."""
    room: float = 1.8
    """m between two roads that leave no room for one."""
    fastest_road: float = 60 / 3.6 + 0.1
    """m/s up to which a street in a town has them where nothing is mapped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MovementRules:
    """Which turns there are (`plain`)."""

    u_turn: float = 150.0
    """degrees from which a turn leads back."""
    sharp: float = 120.0
    """degrees from which a turn is to the side where its road lies, whichever way round is shorter."""
    side_by_side: float = 0.9
    """cosine of the angle between two roads that arrive side by side."""
    heading: float = 15.0
    """m over which a road's heading at a junction is taken."""
    apart: float = 5.0
    """m between the places where two roads leave a junction from which ways to them may cross."""
    beside: float = 1.5
    """m from a road's middle to the lanes from which such ways are drawn."""
    longest_path: int = 14
    """vertices of a way across a junction."""
    most_paths: int = 20_000
    """paths across one junction from one road, told apart by the turn restrictions on them."""
    sign_before_junction: float = 40.0
    """m before a junction within which a sign is for it."""
    to_change_lanes: float = 30.0
    """m of a road between two junctions as it is laid out, on which vehicles can change lanes; netconvert may
    leave half of that, and on less they stand in each other's way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WaitingRules:
    """Where vehicles wait inside junctions (`network`)."""

    widest: float = 2.5
    """m across a vehicle, as a bus is; on narrower lanes there are narrower ones."""
    nearest: float = 1.0
    """m from the stop line: whose way is met before cannot be kept clear."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkRules:
    """What a built network must be like, and how often it is built (`network`)."""

    attempts: int = 8
    """times that netconvert builds a network, at most, until nothing is to be corrected; 1 to 3 are usual."""
    track_attempts: int = 3
    """times that it is built again with tracks, at most."""
    timeout: float = 240.0
    """s that one may take."""
    shortest_edge: float = 5.0
    """m of a road between two junctions: it stores a car."""
    left_by_layout: float = 13.9
    """m of a shorter one that the layout leaves, from which its junctions are outlined anew: a little less
    than forks leave."""
    room_to_move: float = 25.0
    """m of the road beyond a crossing, from which the crossing may move onto it."""
    move_margin: float = 1.0
    """m that it moves farther than it must."""
    longest_merged: float = 60.0
    """m of a road that vanishes in its junction because it lies on another."""
    least_overlap: float = 10.0
    """m² that they have in common, as the check of lanes that lie on each other has it."""
    junction_border: float = 2.0
    """m around a junction's ground where its roads may touch."""
    least_notch: float = 10.0
    """m² of ground far from all roads that are worth a notch in a junction's outline."""
    shoulder: float = 4.0
    """m by which a notch comes nearer to the roads than such ground, ..."""
    verge: float = 1.0
    """... and that it leaves beside each path of vehicles."""
    least_island: float = 5.0
    """m² between a junction and a road around its corner that stay an island."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompletenessRules:
    """From what on something of the source is lost (`completeness`)."""

    crossing_found: float = 10.0
    """m from a mapped crossing to a built one."""
    sidewalk_of_road: float = 25.0
    """m from a road within which a mapped sidewalk is counted as the road's."""
    sidewalk_found: float = 6.0
    """m from built pavement within which a mapped sidewalk counts as built."""
    sidewalk_lost: float = 10.0
    """m of it without pavement from which it is told."""
    road_found: float = 1.0
    """m from built road or junction within which a mapped line counts as built."""
    road_lost: float = 1.0
    """m of a way below which nothing of it is lost."""
    class_lost: float = 10.0
    """m of a class of roads that are lost, from which it is a warning."""
    track_found: float = 2.0
    """m from a built lane within which a track counts as built: a tram in the street is led by its lane."""
    junction_void: float = 50.0
    """m² of a junction that may lie far from all roads."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThingRules:
    """How much of one kind of things around the roads is kept (`surroundings`)."""

    most: int
    """things; the nearest to a signal, or to the map's middle, come first."""
    least_area: float = 0.0
    """m² of an area that is kept."""
    detail: float = 0.0
    """m that an outline may be moved to leave corners out."""


def _things() -> dict[str, ThingRules]:
    return {
        "building": ThingRules(most=4_000, least_area=4.0, detail=0.05),
        "tree": ThingRules(most=2_500),
        "bus_stop": ThingRules(most=300),
        "water": ThingRules(most=500, least_area=10.0, detail=0.4),
        "green": ThingRules(most=1_500, least_area=10.0, detail=0.4),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class SurroundingRules:
    """What is kept of the things around the roads, and how high they are (`surroundings`)."""

    things: Mapping[str, ThingRules] = field(default_factory=_things)
    """by kind."""
    margin: float = 25.0
    """m around the roads within which things are kept."""
    storey: float = 3.2
    """m of a floor of a building, ..."""
    roof: float = 1.0
    """... and of what is above the last one."""
    neighbourhood: float = 150.0
    """m around a building of no known height and kind within which others tell its floors, ..."""
    neighbours: int = 3
    """... if there are so many."""
    outbuilding: float = 50.0
    """m² below which it has one floor."""
    lowest: float = 2.2
    """m of a building at least, ..."""
    tallest: float = 600.0
    """... and at most, whatever is mapped."""
    tree: float = 9.0
    """m of a tree of no known height."""
    smallest_tree: float = 3.0
    """m of a tree at least, ..."""
    tallest_tree: float = 40.0
    """... and at most."""
    tree_spacing: float = 8.0
    """m between the trees of a row."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportRules:
    """All limits of an import."""

    lanes: LaneRules = field(default_factory=LaneRules)
    sections: SectionRules = field(default_factory=SectionRules)
    centre_lanes: CentreLaneRules = field(default_factory=CentreLaneRules)
    tracks: TrackRules = field(default_factory=TrackRules)
    crowding: CrowdingRules = field(default_factory=CrowdingRules)
    roundabouts: RoundaboutRules = field(default_factory=RoundaboutRules)
    junctions: JunctionRules = field(default_factory=JunctionRules)
    signals: SignalRules = field(default_factory=SignalRules)
    crossings: CrossingRules = field(default_factory=CrossingRules)
    extension: ExtensionRules = field(default_factory=ExtensionRules)
    forks: ForkRules = field(default_factory=ForkRules)
    spacing: SpacingRules = field(default_factory=SpacingRules)
    heights: HeightRules = field(default_factory=HeightRules)
    terrain: TerrainRules = field(default_factory=TerrainRules)
    sidewalks: SidewalkRules = field(default_factory=SidewalkRules)
    movements: MovementRules = field(default_factory=MovementRules)
    waiting: WaitingRules = field(default_factory=WaitingRules)
    network: NetworkRules = field(default_factory=NetworkRules)
    completeness: CompletenessRules = field(default_factory=CompletenessRules)
    surroundings: SurroundingRules = field(default_factory=SurroundingRules)


RULES = ImportRules()
"""Those of an import that is told no others."""
