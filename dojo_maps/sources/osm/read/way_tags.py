"""What the tags of an OpenStreetMap way say of a road: lanes, turns, speed, sidewalks, who may drive."""

from dataclasses import dataclass

from dojo_maps.sources.osm.read.country import Country, is_roundabout, read_speed
from dojo_maps.sources.osm.read.data import Tags
from dojo_maps.sources.osm.read.lane_tags import LaneTags, LaneUse, read_lanes
from dojo_maps.sources.osm.read.lengths import read_length
from dojo_maps.sources.osm.read.placement_tags import read_placement
from dojo_maps.sources.osm.rules import RULES, LaneRules

KINDS = {
    "motorway": 13, "motorway_link": 12, "trunk": 11, "trunk_link": 10, "primary": 9, "primary_link": 8,
    "secondary": 7, "secondary_link": 6, "tertiary": 5, "tertiary_link": 4, "unclassified": 3,
    "residential": 3, "road": 3, "living_street": 2, "busway": 4, "bus_guideway": 4, "service": 1,
}  # fmt: skip
"""Roads that are built, by the tag `highway`, and their priority; service roads at signals only.
Where a road tells no speed limit, `Country.default_speed` has it."""
DRIVES = ("parking_aisle", "driveway", "drive-through", "emergency_access")
"""Service roads that are no arms of a junction, by the tag `service`."""
_BUS_ONLY = ("busway", "bus_guideway")
_NO = ("no", "private", "emergency", "military", "forestry", "agricultural", "delivery")
_YES = ("yes", "designated", "permissive", "destination", "customers", "official")
_ACCESS = ("motorcar", "motor_vehicle", "vehicle", "access")
"""Tags that say whether cars may drive; the first that is there counts."""
_TIMED = ("access", "vehicle", "motor_vehicle", "motorcar", "oneway", "lanes", "maxspeed", "bus", "psv")
"""Tags of a road that may hold at some times only."""
_SMALL = ("residential", "living_street", "unclassified", "service")
_SIDEWALK_KINDS = {kind for kind, rank in KINDS.items() if 1 < rank <= 9} - {"busway", "bus_guideway"}


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadTags:
    """A road in the direction of its way.

    Attributes:
        forward: lanes in the way's direction, outermost first; empty against a one-way.
        backward: lanes against it, outermost first.
        sidewalks: for the left and the right side: yes, no, separate, or "" where nothing is said.
        layer: level above ground, from bridges and tunnels.
        width: of a lane, metres.
        offset: metres by which the carriageway's middle lies to the left of the way.
        centre: a lane in the middle that both directions turn from.
    """

    kind: str
    name: str
    speed: float
    width: float
    forward: tuple[LaneTags, ...]
    backward: tuple[LaneTags, ...]
    sidewalks: tuple[str, str]
    layer: int
    roundabout: bool
    offset: float = 0.0
    centre: LaneTags | None = None

    @property
    def oneway(self) -> bool:
        """Whether traffic runs in one direction only."""
        return not (self.forward and self.backward)

    @property
    def drives(self) -> float:
        """Width of all lanes together, metres."""
        return self.across(self.forward) + self.across(self.backward)

    def across(self, lanes: tuple[LaneTags, ...]) -> float:
        """Measure some lanes together, metres.

        Args:
            lanes: some of the road's; those with no width of their own are as wide as the road says.

        Returns:
            Metres across; 0 for no lanes.
        """
        return sum(lane.width or self.width for lane in lanes)


def read_road(
    tags: Tags,
    country: Country,
    *,
    service: bool = False,
    rules: LaneRules = RULES.lanes,
) -> tuple[RoadTags | None, list[str]]:
    """Read a way's tags.

    Args:
        tags: of the way.
        country: its rules.
        service: service roads are roads, too.
        rules: how wide lanes are.

    Returns:
        The road, None where the way is none that cars or buses use; and what its tags say and the road does
        not show, in words.
    """
    if why_not_a_road(tags, service=service) is not None:
        return None, []
    kind = tags["highway"] if _cars(tags) else "busway"
    lanes = read_lanes(tags, _direction(tags), bus_only=not _cars(tags), left_hand=country.left_hand)
    timed = [key for key in tags if key.endswith(":conditional") and key.partition(":")[0] in _TIMED]
    speed = read_speed(tags.get("maxspeed", "")) or country.default_speed(kind)
    width = _lane_width(tags, lanes.forward + lanes.backward, rules)
    road = RoadTags(
        kind=kind,
        name=tags.get("name", ""),
        speed=round(speed, 2),
        width=width,
        forward=lanes.forward,
        backward=lanes.backward,
        sidewalks=("yes", "yes") if tags["highway"] == "pedestrian" else _sidewalks(tags),
        layer=read_layer(tags),
        roundabout=is_roundabout(tags),
        offset=read_placement(tags, lanes.forward, lanes.backward, width, left_hand=country.left_hand),
        centre=lanes.centre,
    )
    return road, [*lanes.unkept, *(f"{key}: what holds at some times only" for key in timed)]


def why_not_a_road(tags: Tags, *, service: bool = False) -> str | None:
    """Tell why a way is not built.

    Args:
        tags: of the way.
        service: service roads are built, too.

    Returns:
        The tag that keeps traffic out, such as `access=private`; an empty text where ways of its kind are not
        built; None for a road that is.
    """
    kind = tags.get("highway")
    named = kind in KINDS and (service or kind != "service")
    if tags.get("area") == "yes" or not (named or _is_bus_road(tags)):
        return ""
    if _cars(tags) or _buses(tags):
        return None
    key = next((key for key in _ACCESS if key in tags), "highway")
    return f"{key}={tags[key]}"


def may_have_sidewalk(road: RoadTags, fastest: float) -> bool:
    """Tell whether a road without a word about sidewalks has them, as streets in towns have.

    Args:
        road: what it is.
        fastest: metres a second up to which it may have them.

    Returns:
        Whether it may; roundabouts, motorways, trunk, service and bus roads may not.
    """
    return road.kind in _SIDEWALK_KINDS and road.speed <= fastest and not road.roundabout


def _is_bus_road(tags: Tags) -> bool:
    """Tell whether buses drive where others may not: through pedestrian zones, on service roads of theirs."""
    kind = tags.get("highway")
    own = kind == "service" and tags.get("service") not in DRIVES and not _cars(tags)
    return _buses(tags) and (kind == "pedestrian" or own)


def _cars(tags: Tags) -> bool:
    if tags.get("highway") in (*_BUS_ONLY, "pedestrian"):
        return False
    for key in _ACCESS:
        if key in tags:
            return tags[key] not in _NO
    return True


def _buses(tags: Tags) -> bool:
    return tags.get("highway") in _BUS_ONLY or any(tags.get(key) in _YES for key in ("bus", "psv"))


def _direction(tags: Tags) -> int:
    """Give 1 for one-way along the way, -1 against it, 0 for two-way."""
    value = tags.get("oneway", "")
    if value in ("-1", "reverse"):
        return -1
    implied = is_roundabout(tags) or tags.get("highway", "").startswith("motorway")
    if value in ("yes", "true", "1") or (implied and value != "no"):
        return 1
    shut = [
        side for side in ("forward", "backward") if any(tags.get(f"{key}:{side}") in _NO for key in _ACCESS)
    ]
    return {"forward": -1, "backward": 1}[shut[0]] if len(shut) == 1 else 0


def _lane_width(tags: Tags, lanes: tuple[LaneTags, ...], rules: LaneRules) -> float:
    """Divide the width of a carriageway among its lanes, metres."""
    narrow = sum(lane.width or 0.0 for lane in lanes)
    wide = max(sum(lane.width is None for lane in lanes), 1)
    for key in ("width:carriageway", "width"):
        whole = read_length(tags.get(key, ""))
        if whole is not None and rules.narrowest <= (whole - narrow) / wide <= rules.widest:
            return round((whole - narrow) / wide, 2)
    parked = any(lane.use is LaneUse.PARKING for lane in lanes)
    return rules.beside_parked if parked and tags.get("highway") in _SMALL else rules.usual


def read_layer(tags: Tags) -> int:
    """Give the level of a bridge, a tunnel, or of a passage through a building that names one.

    Args:
        tags: of the way.

    Returns:
        Levels above the ground, from -5 to 5; 0 for what lies on it.
    """
    bridge, tunnel = (tags.get(key, "no") for key in ("bridge", "tunnel"))
    if bridge == tunnel == "no":
        return 0
    try:
        layer = int(tags.get("layer", ""))
    except ValueError:
        layer = 0
    if tunnel != "building_passage":
        layer = layer or (1 if bridge != "no" else -1)
    return max(-5, min(5, layer))


def _sidewalks(tags: Tags) -> tuple[str, str]:
    whole = tags.get("sidewalk", "")
    sides = []
    for side in ("left", "right"):
        said = tags.get(f"sidewalk:{side}", tags.get("sidewalk:both", ""))
        if not said and whole:
            known = {"both": "yes", "yes": "yes", side: "yes", "separate": "separate"}
            said = known.get(whole, "no" if whole in ("left", "right", "no", "none") else "")
        sides.append("no" if said in ("no", "none") else said)
    return sides[0], sides[1]
