"""Where issues lie on the earth."""

from collections.abc import Sequence

import numpy as np

from dojo_maps.description import Projection
from dojo_maps.issue import Issue


def earth_positions(issues: Sequence[Issue], projection: Projection) -> list[list[float] | None]:
    """Give each issue its longitude and latitude.

    Args:
        issues: whose positions are asked for.
        projection: of the network.

    Returns:
        Longitude and latitude for each issue, degrees; None where the network has no projection, or PROJ does
        not know it or gives no finite position.
    """
    if projection.proj is None or not issues:
        return [None] * len(issues)
    import pyproj  # noqa: PLC0415 - slow to load and needed only for findings on the earth

    places = np.array([issue.position[:2] for issue in issues]) - projection.net_offset
    try:
        lon, lat = pyproj.Proj(projection.proj)(places[:, 0], places[:, 1], inverse=True)
    except pyproj.exceptions.ProjError:
        return [None] * len(issues)
    found = np.column_stack([lon, lat])
    return [pair.tolist() if np.isfinite(pair).all() else None for pair in found]
