"""Where a way lies on its carriageway, where that is not the middle.

Source: OpenStreetMap wiki, Key:placement. Lanes count from the left, in the direction of their traffic.
"""

import re
from collections.abc import Sequence

from dojo_maps.sources.osm.read.data import Tags
from dojo_maps.sources.osm.read.lane_tags import LaneTags

_PLACEMENT = re.compile(r"(left_of|middle_of|right_of):(\d)", re.ASCII)
_SHARES = {"left_of": 0.0, "middle_of": 0.5, "right_of": 1.0}


def read_placement(
    tags: Tags,
    forward: Sequence[LaneTags],
    backward: Sequence[LaneTags],
    width: float,
    *,
    left_hand: bool,
) -> float:
    """Give the metres by which the carriageway's middle lies to the left of its way.

    Args:
        tags: of the way.
        forward: lanes in its direction, outermost first.
        backward: lanes against it, outermost first.
        width: of a lane without a width of its own, metres.
        left_hand: traffic keeps left.

    Returns:
        Metres, negative to the right; 0 where the tags say nothing that fits the lanes.
    """
    alone = not (forward and backward)
    for sign, side, lanes, others in ((-1, "forward", forward, backward), (1, "backward", backward, forward)):
        keys = (f"placement:{side}", "placement") if alone else (f"placement:{side}",)
        said = next((tags[key] for key in keys if key in tags), "")
        found = _PLACEMENT.fullmatch(said) if lanes else None
        if found is not None:
            from_left = list(lanes if left_hand else lanes[::-1])
            at = _across(from_left, found[1], int(found[2]), width)
            beside = 0.0 if left_hand else _width(others, width)
            if at is not None:
                return round(sign * ((_width(lanes, width) + _width(others, width)) / 2 - beside - at), 2)
    return 0.0


def _across(from_left: Sequence[LaneTags], where: str, number: int, width: float) -> float | None:
    """Measure from the left border of some lanes to a place on one of them; None for no such lane."""
    counted, metres = 0, 0.0
    for lane in from_left:
        own = lane.width or width
        counted += lane.motor
        if lane.motor and counted == number:
            return metres + own * _SHARES[where]
        metres += own
    return None


def _width(lanes: Sequence[LaneTags], width: float) -> float:
    return sum(lane.width or width for lane in lanes)
