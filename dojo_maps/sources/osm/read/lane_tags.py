"""The lanes of a way, direction by direction: who may use each, and the turns painted on it.

Lanes are listed from the outermost: the right one where traffic keeps right. Source: OpenStreetMap wiki,
Lanes, Bus lanes, Key:cycleway. Which ways are roads at all: `way_tags`; which lanes make a road count as
built: `description.CARRIAGEWAY`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from dojo_maps.sources.osm.read.data import Tags
from dojo_maps.sources.osm.read.parking_tags import parking_width

MOST_LANES = 8
"""Of one direction."""
_CYCLE_LANE, _CYCLE_TRACK = 1.5, 2.0
"""Metres across."""
_YES = ("yes", "designated", "permissive", "official")
_NO = ("no", "private")
_CYCLE_WIDTHS = {
    "lane": _CYCLE_LANE, "opposite_lane": _CYCLE_LANE, "track": _CYCLE_TRACK, "opposite_track": _CYCLE_TRACK,
}  # fmt: skip
_SIDES = ("forward", "backward")


class LaneUse(StrEnum):
    """Who a lane is for."""

    DRIVING = "driving"
    BUS = "bus"
    BICYCLE = "bicycle"
    CYCLEWAY = "cycleway"
    """A cycle track of its own, where people walk besides."""
    SEGREGATED = "segregated"
    """A cycle track beside which people have a strip of their own."""
    PARKING = "parking"
    TRAM = "tram"
    RAIL = "rail"


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneTags:
    """A lane.

    Attributes:
        use: who it is for.
        turns: painted on it; none where nothing is.
        width: metres; None for that of the road's lanes.
        tram: a tram shares it.
    """

    use: LaneUse = LaneUse.DRIVING
    turns: tuple[str, ...] = ()
    width: float | None = None
    tram: bool = False

    @property
    def bus(self) -> bool:
        """Whether it is for buses only."""
        return self.use is LaneUse.BUS

    @property
    def bicycle(self) -> bool:
        """Whether it is for bicycles only."""
        return self.use is LaneUse.BICYCLE

    @property
    def motor(self) -> bool:
        """Whether motor vehicles drive on it."""
        return self.use in (LaneUse.DRIVING, LaneUse.BUS)


@dataclass(frozen=True, slots=True, kw_only=True)
class LanesRead:
    """The lanes of a way.

    Attributes:
        forward: in the way's direction, outermost first.
        backward: against it, outermost first.
        unkept: what the tags say and no lane shows, in words.
        centre: a lane in the middle that both directions turn from.
    """

    forward: tuple[LaneTags, ...]
    backward: tuple[LaneTags, ...]
    unkept: tuple[str, ...]
    centre: LaneTags | None = None


def read_lanes(tags: Tags, direction: int, *, bus_only: bool, left_hand: bool) -> LanesRead:
    """Read the lanes of a way.

    Args:
        tags: of the way.
        direction: of general traffic: 1 along the way, -1 against it, 0 both.
        bus_only: nobody else may use the road.
        left_hand: traffic keeps left.

    Returns:
        The lanes of both directions, and what the tags say that they do not show.
    """
    counts = _lane_counts(tags, direction)
    unkept = _unkept(tags, direction)
    lanes: list[tuple[LaneTags, ...]] = []
    for side, count, way in zip(_SIDES, counts, (1, -1), strict=True):
        found, agree = _motor_lanes(tags, side, count, oneway=direction == way, left_hand=left_hand)
        if bus_only or direction == -way:
            found = [replace(lane, use=LaneUse.BUS) for lane in found]
        if not agree:
            unkept.append("turn:lanes of another number than its lanes: its arrows")
        outer_cycles, inner_cycles = _cycle_lanes(tags, side, direction, left_hand=left_hand)
        outer, inner = _parking_lanes(tags, side, direction, left_hand=left_hand) if found else ([], [])
        lanes.append((*outer, *outer_cycles, *found, *inner_cycles, *inner))
    centre = LaneTags() if not direction and _count(tags, "lanes:both_ways") else None
    return LanesRead(forward=lanes[0], backward=lanes[1], unkept=tuple(unkept), centre=centre)


def _unkept(tags: Tags, direction: int) -> list[str]:
    """Name what lanes are told to be that none of SUMO's can be."""
    found = []
    if _count(tags, "lanes:both_ways"):
        found.append("lanes:both_ways: the lane in the middle, but for a turn lane at junctions")
    if tags.get("oneway") in ("reversible", "alternating"):
        found.append(f"oneway={tags['oneway']}: its changes of direction; it is two-way")
    if not direction and tags.get("lanes") == "1":
        found.append("lanes=1 for both directions: that they share it; each has a lane of its own")
    if "lanes:reversible" in tags:
        found.append("lanes:reversible: the lanes that change direction")
    if any(key.startswith("hov:lanes") and "designated" in tags[key] for key in tags):
        found.append("hov:lanes: that others may not use these lanes")
    return found


def _count(tags: Tags, key: str) -> int | None:
    text = tags.get(key, "").split(";")[0].split(".")[0].strip()
    return min(int(text), MOST_LANES) if text.isdecimal() and len(text) < 4 and int(text) > 0 else None


def _listed(tags: Tags, side: str) -> int | None:
    keys = (f"turn:lanes:{side}", f"bus:lanes:{side}", f"psv:lanes:{side}", f"vehicle:lanes:{side}")
    found = [len(tags[key].split("|")) for key in keys if key in tags]
    return min(found[0], MOST_LANES) if found else None


def _lane_counts(tags: Tags, direction: int) -> tuple[int, int]:
    """Count the lanes for motor traffic in each direction."""
    total = _count(tags, "lanes")
    if direction:
        side, other = _SIDES if direction > 0 else _SIDES[::-1]
        against = _contraflow_buses(tags, other)
        own = _count(tags, f"lanes:{side}") or (max(total - against, 1) if total else None)
        own = own or _painted_lanes(tags, side) or (2 if tags.get("highway") in ("motorway", "trunk") else 1)
        return (own, against) if direction > 0 else (against, own)
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


def _painted_lanes(tags: Tags, side: str) -> int | None:
    for key in ("turn:lanes", f"turn:lanes:{side}", "vehicle:lanes", "bus:lanes", "psv:lanes"):
        if key in tags:
            return min(tags[key].count("|") + 1, MOST_LANES)
    return None


def _contraflow_buses(tags: Tags, side: str) -> int:
    """Count the lanes on which buses may drive against a one-way."""
    open_to_buses = any(
        tags.get(f"oneway:{key}") == "no" or tags.get(f"{key}:{side}") in _YES for key in ("psv", "bus")
    )
    busways = (tags.get(key, "") for key in ("busway", "busway:left", "busway:right", "busway:both"))
    if not open_to_buses and not any(value.startswith("opposite") for value in busways):
        return 0
    keys = (f"lanes:{side}", f"lanes:psv:{side}", f"lanes:bus:{side}")
    return next((found for key in keys if (found := _count(tags, key))), None) or _listed(tags, side) or 1


def _motor_lanes(
    tags: Tags, side: str, count: int, *, oneway: bool, left_hand: bool
) -> tuple[list[LaneTags], bool]:
    """List the lanes of one direction; and whether they are as many as there are arrows for."""
    if not count:
        return [], True
    suffixes = (f":{side}", "") if oneway else (f":{side}",)
    turns = _per_lane(tags, [f"turn:lanes{suffix}" for suffix in suffixes])
    agree = not turns or len(turns) == count
    painted = [tuple(t for t in entry.split(";") if t not in ("", "none")) for entry in turns if agree]
    buses = _bus_lanes(tags, suffixes, count)
    lanes = [
        LaneTags(
            use=LaneUse.BUS if buses and buses[k] else LaneUse.DRIVING, turns=painted[k] if painted else ()
        )
        for k in range(count)
    ]
    if not left_hand:
        lanes.reverse()
    if not buses:
        _reserve_outermost(tags, lanes, side, suffixes)
    return lanes, agree


def _bus_lanes(tags: Tags, suffixes: Sequence[str], count: int) -> list[bool]:
    """Tell of each lane, from the left, whether it is for buses only; empty where no tag lists lanes."""
    buses = _per_lane(tags, [f"{key}:lanes{suffix}" for key in ("bus", "psv") for suffix in suffixes])
    others = _per_lane(
        tags,
        [f"{key}:lanes{suffix}" for key in ("motor_vehicle", "vehicle", "access") for suffix in suffixes],
    )
    if len(others) == count == len(buses):
        return [
            "designated" in bus or (bus in _YES and other in _NO)
            for bus, other in zip(buses, others, strict=True)
        ]
    return ["designated" in bus for bus in buses] if len(buses) == count else []


def _reserve_outermost(tags: Tags, lanes: list[LaneTags], side: str, suffixes: Iterable[str]) -> None:
    number = max(
        (_count(tags, f"lanes:{key}{suffix}") or 0 for key in ("psv", "bus") for suffix in suffixes),
        default=0,
    )
    near = "right" if side == "forward" else "left"
    if "lane" in (tags.get("busway"), tags.get("busway:both"), tags.get(f"busway:{near}")):
        number = max(number, 1)
    for k in range(min(number, len(lanes) - 1)):
        lanes[k] = replace(lanes[k], use=LaneUse.BUS)


def _per_lane(tags: Tags, keys: Iterable[str]) -> list[str]:
    text = next((tags[key] for key in keys if key in tags), None)
    return [] if text is None else text.split("|")


def _cycle_lanes(
    tags: Tags, side: str, direction: int, *, left_hand: bool
) -> tuple[list[LaneTags], list[LaneTags]]:
    """List the lane or track for bicycles at the outer side of a direction; and at the inner, if one-way.

    Against a one-way there is one only where bicycles may go that way; it lies at that side then.
    """
    near, far = ("left", "right") if (side == "forward") == left_hand else ("right", "left")
    with_traffic = direction == 0 or (direction > 0) == (side == "forward")
    keys = (f"cycleway:{near}", "cycleway:both", "cycleway")
    outer = next((tags[key] for key in keys if key in tags), "no")
    against = outer.startswith("opposite") or (not with_traffic and _open_to_cycles_against(tags, near))
    inner = tags.get(f"cycleway:{far}", "no") if with_traffic and direction else "no"
    if inner.startswith("opposite") or _open_to_cycles_against(tags, far):
        inner = "no"
    said = ("no" if against == with_traffic else outer), inner
    lanes = [
        [LaneTags(use=LaneUse.BICYCLE, width=_CYCLE_WIDTHS[k])] if k in _CYCLE_WIDTHS else [] for k in said
    ]
    return lanes[0], lanes[1]


def _open_to_cycles_against(tags: Tags, side: str) -> bool:
    return tags.get("oneway:bicycle") == "no" or tags.get(f"cycleway:{side}:oneway") in ("-1", "no")


def _parking_lanes(
    tags: Tags, side: str, direction: int, *, left_hand: bool
) -> tuple[list[LaneTags], list[LaneTags]]:
    """List where cars park at the outer side of a direction; and at the inner one, if the road is one-way."""
    near, far = ("left", "right") if (side == "forward") == left_hand else ("right", "left")
    outer, inner = (
        [LaneTags(use=LaneUse.PARKING, width=width)] if (width := parking_width(tags, where)) else []
        for where in (near, far)
    )
    return outer, inner if direction else []
