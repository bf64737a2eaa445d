"""Untwist the junction outlines that netconvert draws across themselves where roads meet at sharp angles."""

import re

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats

_JUNCTION = re.compile(r'(<junction id="[^":][^>]*? shape=")([^"]+)(")')
_GAP = 0.5
"""Metres between parts of an outline that are joined."""
_GRID = 0.01
"""Metres that netconvert rounds to."""


def mend_outlines(data: bytes) -> bytes:
    """Give each junction of a network an outline that does not cross itself.

    An outline keeps the ground on both sides of where it crossed; nothing but the ground is changed.
    """
    return _JUNCTION.sub(_mended, data.decode("utf-8")).encode("utf-8")


def _mended(found: re.Match[str]) -> str:
    corners = np.array([[float(value) for value in corner.split(",")] for corner in found[2].split()])
    if len(corners) < 4 or shapely.Polygon(corners[:, :2]).is_valid:
        return found[0]
    outline = _untwisted(corners[:, :2])
    if outline is None:
        return found[0]
    heights = [corners[np.argmin(np.hypot(*(corners[:, :2] - place).T)), 2:] for place in outline]
    rows = [[*place, *height] for place, height in zip(outline, heights, strict=True)]
    return found[1] + " ".join(",".join(f"{value:.2f}" for value in row) for row in rows) + found[3]


def _untwisted(corners: Floats) -> Floats | None:
    """Outline all ground that a twisted line encloses; None where it encloses next to none."""
    parts = shapely.make_valid(shapely.Polygon(corners))
    joined = parts.buffer(_GAP, join_style="mitre").buffer(-_GAP, join_style="mitre")
    for whole in (joined, shapely.convex_hull(parts)):
        rounded = shapely.set_precision(whole, _GRID)
        if rounded.geom_type == "Polygon" and rounded.area:
            return shapely.get_coordinates(rounded.exterior)[:-1]
    return None
