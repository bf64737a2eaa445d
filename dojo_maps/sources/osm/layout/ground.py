"""The ground under the streets, as `terrain` finds it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

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
        """Give the height of the ground under a section's nearest place.

        Args:
            graph: that has the section.
            name: the section's id.
            place: x and y, metres, map frame.

        Returns:
            Metres above the lowest place; 0 for a section without a profile.
        """
        if name not in self.profiles:
            return 0.0
        line = shapely.LineString(graph.line(graph.sections[name]))
        return float(np.interp(line.project(shapely.Point(place)), *self.profiles[name]))

    def split(self, name: str, metres: float) -> "Ground":
        """Part the profile of a section that is split in two, so many metres along it.

        Args:
            name: the section's id; its pieces are named by `a` and `b` after it.
            metres: along it, from its start.

        Returns:
            The ground with the profiles of both pieces besides.
        """
        at, heights = self.profiles[name]
        here, first = float(np.interp(metres, at, heights)), at < metres
        parts = {
            f"{name}a": (np.append(at[first], metres), np.append(heights[first], here)),
            f"{name}b": (np.append(0.0, at[~first] - metres), np.append(here, heights[~first])),
        }
        return replace(self, profiles={**self.profiles, **parts})

    def under(self, name: str, line: Floats) -> Floats:
        """Lift a section's line by the ground under it; it gets more places where that bends.

        Args:
            name: the id of a section with a profile.
            line: (n, 3), metres, along the section; heights above the ground.

        Returns:
            (m, 3), metres, m >= n; heights above the lowest place of the ground.
        """
        at, heights = self.profiles[name]
        lengths = along(line[:, :2])
        apart = np.abs(at[:, None] - lengths).min(axis=1)
        places = np.sort(np.concatenate([lengths, at[apart > _APART]]))
        lifted = np.column_stack([np.interp(places, lengths, values) for values in line.T])
        lifted[:, 2] += np.interp(places, at, heights)
        return lifted
