"""Change outlines of junctions and walking areas; untwist those that netconvert draws across themselves."""

import re
from collections.abc import Callable

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.network.net_shapes import read_shape, write_shape

_JUNCTION = re.compile(r'(<junction id="([^":][^"]*)"[^>]*? shape=")([^"]+)(")')
_WALKING_AREA = re.compile(
    r'(<edge id="(:[^"]*)" function="walkingarea"[^>]*>\s*<lane [^>]*? shape=")([^"]+)(")'
)
_GAP = 0.5
"""Metres between parts of an outline that are joined."""
_GRID = 0.01
"""Metres that netconvert rounds to."""


def mend_outlines(data: bytes) -> bytes:
    """Give each junction and walking area of a network an outline that does not cross itself.

    An outline keeps the ground on both sides of where it crossed; nothing but the ground is changed.

    Args:
        data: the network, as netconvert writes it.

    Returns:
        The network with these outlines.
    """
    for pattern in (_JUNCTION, _WALKING_AREA):
        data = _replace(data, pattern, lambda _, corners: untwist(corners))
    return data


def replace_outlines(
    data: bytes, outline: Callable[[str, Floats], Floats | None], *, of_pavement: bool = False
) -> bytes:
    """Give junctions of a network another outline.

    Args:
        data: the network.
        outline: gives the new corners for a junction's id and its old ones, (n, 3) metres; None to keep them.
        of_pavement: change walking areas instead.

    Returns:
        The network with these outlines.
    """
    return _replace(data, _WALKING_AREA if of_pavement else _JUNCTION, outline)


def _replace(data: bytes, pattern: re.Pattern[str], outline: Callable[[str, Floats], Floats | None]) -> bytes:
    def replaced(found: re.Match[str]) -> str:
        new = outline(found[2], read_shape(found[3]))
        return found[0] if new is None else f"{found[1]}{write_shape(new)}{found[4]}"

    return pattern.sub(replaced, data.decode("utf-8")).encode("utf-8")


def untwist(corners: Floats) -> Floats | None:
    """Outline all ground that a twisted outline encloses.

    Args:
        corners: (n, 2), or (n, 3) with heights; metres.

    Returns:
        As many columns; None where the outline does not cross itself, or encloses next to no ground.
    """
    if len(corners) < 4 or shapely.Polygon(corners[:, :2]).is_valid:
        return None
    parts = shapely.make_valid(shapely.Polygon(corners[:, :2]))
    joined = parts.buffer(_GAP, join_style="mitre").buffer(-_GAP, join_style="mitre")
    for whole in (joined, shapely.convex_hull(parts)):
        rounded = shapely.make_valid(shapely.set_precision(whole, _GRID, mode="pointwise"))
        if rounded.geom_type == "Polygon" and rounded.area:
            return outline_of(rounded, corners)
    return None


def outline_of(ground: shapely.Polygon, corners: Floats) -> Floats:
    """Outline some ground, each corner as high as the nearest of those that were there.

    Args:
        ground: without holes, metres.
        corners: (n, 2), or (n, 3) with heights; metres.

    Returns:
        As many columns.
    """
    places = shapely.get_coordinates(ground.exterior)[:-1]
    nearest = [int(np.argmin(np.hypot(*(corners[:, :2] - place).T))) for place in places]
    return np.column_stack([places, corners[nearest, 2:]])
