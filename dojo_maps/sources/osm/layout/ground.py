"""The ground under the streets, as `terrain` finds it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.graph.road_graph import RoadGraph

_APART = 1.0
"""Metres along a street from its nodes to a place that bends it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """The ground under the streets, metres above its lowest place.

    Attributes:
        vertices: the height of each junction's vertices.
        profiles: for each section, metres from its start, and the height there.
        told_by: where they are from, in words.
        lowest: metres above the sea, None where only slopes are known.
        steepest: metres up for each metre ahead.
    """

    vertices: Mapping[int, float]
    profiles: Mapping[str, tuple[Floats, Floats]]
    told_by: str
    lowest: float | None
    steepest: float

    def at(self, graph: RoadGraph, name: str, place: tuple[float, float]) -> float:
        """Give the height of the ground under a section's nearest place."""
        if name not in self.profiles:
            return 0.0
        line = shapely.LineString(graph.line(graph.sections[name]))
        return float(np.interp(line.project(shapely.Point(place)), *self.profiles[name]))

    def under(self, name: str, line: Floats) -> Floats:
        """Lift a section's line, (n, 3), by the ground under it; it gets more places where that bends."""
        at, heights = self.profiles[name]
        lengths = along(line[:, :2])
        apart = np.abs(at[:, None] - lengths).min(axis=1)
        places = np.sort(np.concatenate([lengths, at[apart > _APART]]))
        lifted = np.column_stack([np.interp(places, lengths, values) for values in line.T])
        lifted[:, 2] += np.interp(places, at, heights)
        return lifted
