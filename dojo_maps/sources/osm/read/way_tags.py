"""What the tags of an OpenStreetMap way say of a road: lanes, turns, speed, sidewalks, who may drive."""

from collections.abc import Iterable
from dataclasses import dataclass

from dojo_maps.sources.osm.read.country import default_speed, read_speed
from dojo_maps.sources.osm.read.data import Tags

KINDS = {
    "motorway": 13, "motorway_link": 12, "trunk": 11, "trunk_link": 10, "primary": 9, "primary_link": 8,
    "secondary": 7, "secondary_link": 6, "tertiary": 5, "tertiary_link": 4, "unclassified": 3,
    "residential": 3, "road": 3, "living_street": 2, "busway": 4, "bus_guideway": 4,
}  # fmt: skip
"""Roads that are kept, by the tag `highway`, and their priority."""
_BUS_ONLY = ("busway", "bus_guideway")
_NO = ("no", "private", "emergency", "military", "forestry", "agricultural", "delivery")
_YES = ("yes", "designated", "permissive", "destination", "customers", "official")
_ACCESS = ("motorcar", "motor_vehicle", "vehicle", "access")
"""Tags that say whether cars may drive; the first that is there counts."""
_MOST_LANES = 8
_LANE_WIDTH = 3.25
_SIDEWALK_KINDS = {kind for kind, rank in KINDS.items() if rank <= 9} - {"busway", "bus_guideway"}
_SIDEWALK_SPEED = 60 / 3.6 + 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneTags:
    """A lane: for buses only or for all, and the turns painted on it (none where nothing is)."""

    bus: bool = False
    turns: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadTags:
    """A road in the direction of its way.

    Attributes:
        forward: lanes in the way's direction, outermost first; empty against a one-way.
        backward: lanes against it, outermost first.
        sidewalks: for the left and the right side: yes, no, separate, or "" where nothing is said.
        layer: level above ground, from bridges and tunnels.
        width: of a lane, metres.
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

    @property
    def oneway(self) -> bool:
        """Whether traffic runs in one direction only."""
        return not (self.forward and self.backward)

    @property
    def drives(self) -> float:
        """Width of all lanes together, metres."""
        return self.width * (len(self.forward) + len(self.backward))


def read_road(tags: Tags, *, lon: float, lat: float, left_hand: bool) -> tuple[RoadTags | None, bool]:
    """Read a way's tags.

    Returns:
        The road, None where the way is none that cars or buses use; and whether lanes and turns agree.
    """
    if why_not_a_road(tags) is not None:
        return None, True
    kind = tags["highway"]
    bus_only = not _cars(tags)
    direction = _direction(tags)
    counts = _lane_counts(tags, direction)
    lanes, agree = [], True
    for side, count in zip(("forward", "backward"), counts, strict=True):
        found, fits = _lanes(tags, side, count, oneway=direction != 0, left_hand=left_hand)
        lanes.append(tuple(LaneTags(bus=True, turns=e.turns) for e in found) if bus_only else found)
        agree = agree and fits
    speed = read_speed(tags.get("maxspeed", "")) or default_speed(kind, lon, lat)
    return RoadTags(
        kind=kind,
        name=tags.get("name", ""),
        speed=round(speed, 2),
        width=_lane_width(tags, sum(map(len, lanes))),
        forward=lanes[0],
        backward=lanes[1],
        sidewalks=_sidewalks(tags),
        layer=_layer(tags),
        roundabout=tags.get("junction") in ("roundabout", "circular"),
    ), agree


def why_not_a_road(tags: Tags) -> str | None:
    """Tell why a way is not built: its access, or an empty text for its kind; None for a road that is."""
    if tags.get("highway") not in KINDS or tags.get("area") == "yes":
        return ""
    if _cars(tags) or _buses(tags):
        return None
    key = next(key for key in _ACCESS if key in tags)
    return f"{key}={tags[key]}"


def may_have_sidewalk(road: RoadTags) -> bool:
    """Tell whether a road without a word about sidewalks has them, as streets in towns have."""
    return road.kind in _SIDEWALK_KINDS and road.speed <= _SIDEWALK_SPEED and not road.roundabout


def _cars(tags: Tags) -> bool:
    if tags.get("highway") in _BUS_ONLY:
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
    implied = tags.get("junction") in ("roundabout", "circular") or tags.get("highway", "").startswith(
        "motorway"
    )
    return 1 if value in ("yes", "true", "1") or (implied and value != "no") else 0


def _count(tags: Tags, key: str) -> int | None:
    text = tags.get(key, "").split(";")[0].split(".")[0].strip()
    return min(int(text), _MOST_LANES) if text.isdecimal() and len(text) < 4 and int(text) > 0 else None


def _listed(tags: Tags, side: str) -> int | None:
    keys = (f"turn:lanes:{side}", f"bus:lanes:{side}", f"psv:lanes:{side}")
    found = [len(tags[key].split("|")) for key in keys if key in tags]
    return min(found[0], _MOST_LANES) if found else None


def _lane_counts(tags: Tags, direction: int) -> tuple[int, int]:
    total = _count(tags, "lanes")
    fast = tags.get("highway") in ("motorway", "trunk")
    if direction:
        painted = tags["turn:lanes"].count("|") + 1 if "turn:lanes" in tags else None
        count = total or min(painted or (2 if fast else 1), _MOST_LANES)
        return (count, 0) if direction > 0 else (0, count)
    forward = _count(tags, "lanes:forward") or _listed(tags, "forward")
    backward = _count(tags, "lanes:backward") or _listed(tags, "backward")
    if total:
        total -= min(_count(tags, "lanes:both_ways") or 0, total - 1)
    total = total or (forward or 1) + (backward or 1)
    if forward is None and backward is None:
        forward = (total + 1) // 2
    forward = forward if forward is not None else total - (backward or 1)
    backward = backward if backward is not None else total - forward
    return max(forward, 1), max(backward, 1)


def _lanes(
    tags: Tags, side: str, count: int, *, oneway: bool, left_hand: bool
) -> tuple[tuple[LaneTags, ...], bool]:
    """List the lanes of one direction, outermost first."""
    suffixes = (f":{side}", "") if oneway else (f":{side}",)
    turns = _per_lane(tags, [f"turn:lanes{suffix}" for suffix in suffixes])
    buses = _per_lane(tags, [f"{key}:lanes{suffix}" for key in ("bus", "psv") for suffix in suffixes])
    agree = not count or not turns or len(turns) == count
    painted = [tuple(t for t in entry.split(";") if t not in ("", "none")) for entry in turns]
    if not agree:
        painted = []
    reserved = ["designated" in entry for entry in buses] if len(buses) == count else []
    lanes = [
        LaneTags(bus=bool(reserved) and reserved[k], turns=painted[k] if painted else ())
        for k in range(count)
    ]
    if not left_hand:
        lanes.reverse()
    if not reserved and count:
        _reserve_outermost(tags, lanes, side, suffixes)
    return tuple(lanes), agree


def _reserve_outermost(tags: Tags, lanes: list[LaneTags], side: str, suffixes: Iterable[str]) -> None:
    number = max(
        (_count(tags, f"lanes:{key}{suffix}") or 0 for key in ("psv", "bus") for suffix in suffixes),
        default=0,
    )
    near = "right" if side == "forward" else "left"
    if "lane" in (tags.get("busway"), tags.get("busway:both"), tags.get(f"busway:{near}")):
        number = max(number, 1)
    for k in range(min(number, len(lanes) - 1)):
        lanes[k] = LaneTags(bus=True, turns=lanes[k].turns)


def _per_lane(tags: Tags, keys: Iterable[str]) -> list[str]:
    text = next((tags[key] for key in keys if key in tags), None)
    return [] if text is None else text.split("|")


def _lane_width(tags: Tags, lanes: int) -> float:
    for key in ("width:carriageway", "width"):
        try:
            width = float(tags.get(key, "").removesuffix("m").strip()) / max(lanes, 1)
        except ValueError:
            continue
        if 2.5 <= width <= 4.5:
            return round(width, 2)
    return _LANE_WIDTH


def _layer(tags: Tags) -> int:
    """Give the level of a bridge, a tunnel, or of a passage through a building that names one."""
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
