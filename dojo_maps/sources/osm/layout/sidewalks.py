"""Which sides of a road have a sidewalk: by tags, by ways mapped beside it, or as streets in towns do."""

from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Shapes
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.read.foot_tags import is_sidewalk
from dojo_maps.sources.osm.read.way_tags import may_have_sidewalk


def lay_sidewalks(layout: Layout, paved: AbstractSet[str]) -> Layout:
    """Give the sections that are built their sidewalks.

    Args:
        layout: with its heights.
        paved: sections with pavement on both sides whatever is mapped, because crossings lead there.

    Returns:
        The layout with its sidewalks.
    """
    walks, rules = _Sidewalks(layout.graph), layout.rules.sidewalks
    found = {}
    for name, section in sorted(layout.graph.sections.items()):
        if name not in layout.inner:
            left, right = walks.sides(section)
            found[name] = (rules.width * left, rules.width * right)
    return pave(replace(layout, sidewalks=found), paved)


def pave(layout: Layout, paved: AbstractSet[str]) -> Layout:
    """Give sections pavement on both sides where they have no sidewalk, because crossings lead there.

    Args:
        layout: with its sidewalks.
        paved: ids of sections; those that are not built are passed over.

    Returns:
        The layout with this pavement among its sidewalks.
    """
    least = layout.rules.sidewalks.island_width
    more = {
        name: (max(left, least), max(right, least))
        for name, (left, right) in layout.sidewalks.items()
        if name in paved
    }
    return replace(layout, sidewalks={**layout.sidewalks, **more})


class _Sidewalks:
    """Answers for both sides of any section of a graph."""

    def __init__(self, graph: RoadGraph) -> None:
        self._graph = graph
        self._rules, self._opposite = graph.rules.sidewalks, graph.rules.junctions.opposite
        self._mapped = shapely.STRtree(
            [way.line for way in graph.footways if way.line is not None and is_sidewalk(way.tags)]
        )
        self._sections = sorted(graph.sections)
        roads = [shapely.LineString(graph.line(graph.sections[name])) for name in self._sections]
        self._roads = shapely.STRtree(roads)
        halves = [graph.sections[name].road.drives / 2 for name in self._sections]
        self._strips = shapely.STRtree(shapely.buffer(roads, halves, cap_style="flat"))

    def sides(self, section: Section) -> tuple[bool, bool]:
        """Tell whether there is a sidewalk on the left and on the right, seen along the section."""
        left, right = (self._side(section, k) for k in (0, 1))
        return left, right

    def _side(self, section: Section, side: int) -> bool:
        said = section.road.sidewalks[side]
        if said in ("no", "yes"):
            return said == "yes"
        sign = 1 if side == 0 else -1
        if self._is_beside_road(section, sign):
            return False
        if said:
            return True
        if self._share_beside(section, sign) >= self._rules.least_share:
            return True
        inner = section.road.kind.endswith("_link") and side == self._graph.left_hand
        return (
            may_have_sidewalk(section.road, self._rules.fastest_road)
            and not inner
            and not self._is_median(section, sign)
        )

    def _samples(self, section: Section) -> tuple[np.ndarray, np.ndarray]:
        """Take places along a section and the unit vectors to their left."""
        line = shapely.LineString(self._graph.line(section))
        count = max(2, int(line.length / 8))
        at = (np.arange(count) + 0.5) / count * line.length
        ahead = shapely.get_coordinates(line.interpolate(np.minimum(at + 0.5, line.length)))
        behind = shapely.get_coordinates(line.interpolate(np.maximum(at - 0.5, 0)))
        way = ahead - behind
        way /= np.hypot(*way.T)[:, None]
        return (ahead + behind) / 2, np.column_stack([-way[:, 1], way[:, 0]])

    def _rays(self, section: Section, sign: int, reach: float) -> Shapes:
        places, left = self._samples(section)
        rays: Shapes = shapely.linestrings(np.stack([places, places + sign * reach * left], axis=1))
        return rays

    def _share_beside(self, section: Section, sign: int) -> float:
        rays = self._rays(section, sign, section.road.drives / 2 + self._rules.beside_road)
        hit = (
            {int(k) for k in self._mapped.query(rays, predicate="intersects")[0]}
            if len(self._mapped)
            else set()
        )
        return len(hit) / len(rays)

    def _is_beside_road(self, section: Section, sign: int) -> bool:
        """Tell whether another road on the same level leaves no room on that side."""
        rays = self._rays(section, sign, section.road.drives / 2 + self._rules.room)
        hits = set()
        for ray, number in self._strips.query(rays, predicate="intersects").T:
            other = self._graph.sections[self._sections[number]]
            if other.id != section.id and other.road.layer == section.road.layer:
                hits.add(int(ray))
        return len(hits) > len(rays) * (1 - self._rules.least_share)

    def _is_median(self, section: Section, sign: int) -> bool:
        """Tell whether the other carriageway of a divided road lies on that side."""
        inner = 1 if not self._graph.left_hand else -1
        if not section.road.oneway or sign != inner:
            return False
        rays = self._rays(section, sign, section.road.drives / 2 + self._rules.to_other_carriageway)
        heading = self._heading(section)
        hits = 0
        for ray in rays:
            for number in self._roads.query(ray, predicate="intersects"):
                other = self._graph.sections[self._sections[number]]
                if (
                    other.id != section.id
                    and other.road.oneway
                    and float(heading @ self._heading(other)) < -self._opposite
                ):
                    hits += 1
                    break
        return hits * 2 >= len(rays)

    def _heading(self, section: Section) -> np.ndarray:
        line = self._graph.line(section)
        way = line[-1] - line[0]
        size = float(np.hypot(*way))
        return way / size if size else way
