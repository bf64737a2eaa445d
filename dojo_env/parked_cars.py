"""Cars that stand parked where the map has them: road users that never move, and are on no lane."""

import numpy as np

from dojo_env.snapshot import Kind, Lights, Snapshot
from dojo_maps.description import RoadMap

FIRST_NUMBER = 1 << 24
"""Number of the first parked car; SUMO's road users are counted from 1, and never get as far."""
_KIND, _CORNERS = "parked_car", 4
_KINDS = {"van": Kind.VAN}
"""By the tag `vehicle`; all others are cars."""
_UNPAINTED = (255, 255, 0)
"""SUMO's colour for who was given none; the renderer chooses one."""
_SMALLEST, _LARGEST = 0.5, 30.0
"""Sides of the boxes that are taken for cars, metres."""


def list_parked(road_map: RoadMap) -> Snapshot:
    """List the parked cars of a map: props whose outlines begin at the right front corner, then the left.

    Args:
        road_map: the map.

    Returns:
        The cars, numbered from `FIRST_NUMBER` on.
    """
    props = [
        prop
        for prop in road_map.props
        if prop.kind == _KIND and prop.polygon is not None and len(prop.polygon) == _CORNERS
    ]
    corners = np.array([prop.polygon for prop in props]).reshape(-1, _CORNERS, 3)
    front, side = (corners[:, 0] + corners[:, 1]) / 2, corners[:, 1] - corners[:, 0]
    ahead = front - (corners[:, 2] + corners[:, 3]) / 2
    heights = np.array([prop.height for prop in props])
    sizes = np.column_stack([np.linalg.norm(ahead, axis=1), np.linalg.norm(side, axis=1), heights])
    kept = np.flatnonzero(((sizes > _SMALLEST) & (sizes < _LARGEST)).all(axis=1))
    ahead, count = ahead[kept], len(kept)
    return Snapshot(
        time=0.0,
        ids=tuple(props[k].id for k in kept),
        numbers=np.arange(FIRST_NUMBER, FIRST_NUMBER + count, dtype=np.int32),
        kinds=np.array(
            [_KINDS.get(dict(props[k].tags).get("vehicle", ""), Kind.CAR) for k in kept], dtype=np.uint8
        ),
        positions=front[kept],
        headings=np.arctan2(ahead[:, 1], ahead[:, 0]),
        slopes=np.arctan2(ahead[:, 2], np.hypot(ahead[:, 0], ahead[:, 1])),
        sizes=sizes[kept],
        colours=np.tile(np.array(_UNPAINTED, np.uint8), (count, 1)),
        lights=np.full(count, Lights.OFF, dtype=np.uint8),
        speeds=np.zeros(count),
        lanes=("",) * count,
    )
