"""What stands along pavement, generated from the map alone: street lamps, signs, rows of trees, hedges."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from dojo_maps.description import Lane, LaneKind, Points, Prop
from dojo_maps.enrichment.houses import GENERATED, chance
from dojo_maps.enrichment.vicinity import FORECOURT, Vicinity
from dojo_maps.geometry.pieces import GRID, flat_polygons
from dojo_maps.geometry.polylines import Flags, Floats, Shapes, drop_repeats, places_on

LAMP_HEIGHT = 8.0
_LAMP_SPACING = 30.0
_FROM_ENDS = 6.0
"""How far from the ends of a lane the first and last lamps stand, metres."""
_BEHIND_KERB = 0.5
"""Metres from the carriageway to a lamp's or sign's post."""
_POST_CLEAR = 0.3
"""Metres that a post stands from where vehicles drive, at least."""
_APART = 2.0
"""Metres between the posts of any two things."""
_SIGN_HEIGHT = 2.6
_SIGNED = 4
"""Junctions of more carriageways than these have signs behind them."""
_SIGN_AFTER = 14.0
"""Where along a road its sign stands, metres after the junction."""

_SHELTER_HEIGHT, _SHELTER_HALF, _SHELTER_BEHIND = 2.45, (1.7, 0.6), 1.3
"""Height of a shelter, half its length and depth, and how far behind the kerb its middle is, metres."""
_SHELTERS_APART = 25.0
_STOP_AFTER, _STREETS_WITH_STOPS = 24.0, 0.35
"""Where along a street an invented stop is, metres, and the share of the streets that have one."""

_TREE_SPACING = 10.0
_BEHIND_PAVEMENT = 1.2
"""Metres from the pavement's outer edge to a row of trees."""
_TALLEST, _LOWEST = 9.0, 4.5
_CROWN = 0.37
"""Largest radius of a crown, as a share of the tree's height."""
_CLEAR_OF_LANES = 1.0
"""Metres between crowns and lanes, at least."""
_TRUNK_CLEAR = 1.5
"""Metres between trunks and walls."""
_ROW = 70.0
"""Side of the squares that have a row of trees, or have none, metres."""
_WITH_ROW, _MISSING = 0.7, 0.12
"""Shares of the squares with rows, and of the places in rows where a tree is missing."""
_YARD_FROM, _YARD_SPACING = 6.0, 18.0
"""How far behind houses trees stand, and how far apart, metres."""

_HEDGE_HEIGHT, _HEDGE_HALF = 1.2, 0.4
_HEDGE_BEHIND = 0.7
"""Metres from the pavement's outer edge to the middle of a hedge."""
_NO_LAMPS = (LaneKind.SIDEWALK, LaneKind.RAIL, LaneKind.WATERWAY)


class Roadside:
    """Finds room for what stands beside the streets of a vicinity; every thing that is put takes its room."""

    def __init__(self, near: Vicinity, walls: Shapes) -> None:
        """Take a vicinity and the outlines of its houses (n,), map frame."""
        road_map = near.road_map
        self._near = near
        self._driven, self._walked = shapely.STRtree(near.driven), shapely.STRtree(near.walked)
        self._sights, self._walls = shapely.STRtree(near.sights), shapely.STRtree(walls)
        crossings = [shapely.Polygon(crossing.polygon[:, :2]) for crossing in road_map.crossings]
        self._crossings = shapely.STRtree(shapely.make_valid(np.array(crossings, dtype=object)))
        poles = [prop.position[:2] for prop in road_map.props if prop.position is not None]
        self._posts = [shapely.points(np.array(poles).reshape(-1, 2))]

    @property
    def walls(self) -> Shapes:
        """Outlines of the houses."""
        return self._walls.geometries

    @property
    def posts(self) -> Shapes:
        """Where posts stand so far."""
        return np.concatenate(self._posts)

    def keep_off(self, ground: Shapes) -> None:
        """Let nothing that is put from now on stand on some ground.

        Args:
            ground: (n,) polygons, metres, map frame.
        """
        self._driven = shapely.STRtree(np.concatenate([self._driven.geometries, ground]))

    def put_lamps(self) -> tuple[Prop, ...]:
        """Put street lamps behind the kerb, about every 30 m; their arms reach over the carriageway."""
        spots, headings = [np.empty((0, 2))], [np.empty(0)]
        for lane, shape in self._outer_lanes():
            length = shapely.LineString(shape[:, :2]).length
            if length > 2 * _FROM_ENDS:
                count = max(1, round((length - 2 * _FROM_ENDS) / _LAMP_SPACING)) + 1
                spot, outward, _ = self._beside(
                    lane, shape, np.linspace(_FROM_ENDS, length - _FROM_ENDS, count)
                )
                spots.append(spot)
                headings.append(outward + np.pi)
        places, arms = np.concatenate(spots), np.concatenate(headings)
        kept = self._take(places, apart=_LAMP_SPACING / 2)
        tags = [(_tell_heading(arm),) for arm in arms[kept]]
        return self._stand("lamp", places[kept], [LAMP_HEIGHT] * len(tags), tags)

    def put_signs(self) -> tuple[Prop, ...]:
        """Put a sign with the speed limit where a road begins behind a junction of several roads."""
        roads = self._near.road_map.roads
        ends = Counter(end for road in roads for end in (road.from_junction, road.to_junction))
        joined = {junction for junction, count in ends.items() if count > _SIGNED}
        begins = {road.id: road.from_junction for road in roads}
        spots, headings, speeds = [np.empty((0, 2))], [np.empty(0)], []
        for lane, shape in self._outer_lanes():
            if begins[lane.road] in joined and shapely.LineString(shape[:, :2]).length > 3 * _SIGN_AFTER:
                spot, _, ahead = self._beside(lane, shape, np.array([_SIGN_AFTER]))
                spots.append(spot)
                headings.append(ahead + np.pi)
                speeds.append(round(lane.speed * 3.6))
        places, faced = np.concatenate(spots), np.concatenate(headings)
        kept = self._take(places, apart=_APART)
        tags = [
            (_tell_heading(heading), ("maxspeed", str(speed)))
            for heading, speed in zip(faced[kept], np.array(speeds)[kept], strict=True)
        ]
        return self._stand("sign", places[kept], [_SIGN_HEIGHT] * len(tags), tags)

    def put_shelters(self, stops: Floats) -> tuple[Prop, ...]:
        """Put shelters with benches on the pavement where buses stop.

        Args:
            stops: (n, 2) metres, beside the street or on it; where there are none, some are invented.

        Returns:
            Props of kind `shelter`; stops without room have none.
        """
        stands = [
            self._beside(lane, shape, np.array([at]), _SHELTER_BEHIND)[:2]
            for lane, shape, at in self._find_stops(stops)
        ]
        places = np.concatenate([np.empty((0, 2)), *(spot for spot, _ in stands)])
        faced = np.concatenate([np.empty(0), *(outward + np.pi for _, outward in stands)])
        along = np.column_stack([-np.sin(faced), np.cos(faced)]) * _SHELTER_HALF[0]
        across = np.column_stack([np.cos(faced), np.sin(faced)]) * _SHELTER_HALF[1]
        corners = [places + a * along + b * across for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
        ground = shapely.polygons(np.stack(corners, axis=1))
        free = self._take(places, apart=_SHELTERS_APART)
        for things, distance in ((self._driven, 0.1), (self._walls, 0.2), (self._crossings, 1.5)):
            free[things.query(ground, "dwithin", distance=distance)[0]] = False
        self._driven = shapely.STRtree(np.concatenate([self._driven.geometries, ground[free]]))
        tags = [(_tell_heading(heading),) for heading in faced[free]]
        return self._stand("shelter", places[free], [_SHELTER_HEIGHT] * len(tags), tags)

    def plant_trees(self) -> tuple[Prop, ...]:
        """Plant rows of trees behind the pavement, and some trees in the yards behind houses."""
        rows = self._along(shapely.buffer(self._near.cleared, _BEHIND_PAVEMENT - FORECOURT), _TREE_SPACING)
        beside = self._is_close(self._walked, rows, _BEHIND_PAVEMENT + 0.2)
        beside &= self._chances("row", rows // _ROW) < _WITH_ROW
        rows = rows[beside & (self._chances("tree", rows) > _MISSING)]
        walls = shapely.buffer(self._walls.geometries, _YARD_FROM)
        yards = self._along(shapely.union_all(walls), _YARD_SPACING)
        yards = yards[~self._is_close(self._walked, yards, 3 * FORECOURT)]
        yards = yards[self._chances("tree", yards) > 0.4]
        spots = np.concatenate([rows, yards])
        height = np.minimum(_TALLEST - 2.0 * self._chances("height", spots), self._room(spots) / _CROWN)
        height *= 0.9 + 0.1 * self._chances("age", spots)
        free = (height > _LOWEST) & ~self._is_close(self._walls, spots, _TRUNK_CLEAR)
        free &= ~self._is_close(self._sights, spots, _CROWN * _TALLEST)
        spots, height = spots[free], height[free]
        kept = self._take(spots, apart=_APART + 1.0)
        heights = [round(float(tall), 2) for tall in height[kept]]
        return self._stand("tree", spots[kept], heights, [()] * len(heights))

    def plant_hedges(self, gardens: Shapes) -> tuple[Prop, ...]:
        """Plant hedges between the pavement and the gardens of houses, with a gate before each house.

        Args:
            gardens: (n,) outlines of the houses that have gardens, metres, map frame.

        Returns:
            Props of kind `hedge`, with outlines.
        """
        if not len(gardens):
            return ()
        edge = shapely.boundary(shapely.buffer(self._near.cleared, _HEDGE_BEHIND - FORECOURT))
        before = shapely.union_all(shapely.buffer(gardens, FORECOURT + 1.0, join_style="mitre"))
        gates = shapely.buffer(shapely.shortest_line(shapely.centroid(gardens), edge), 1.2)
        open_ground = shapely.union_all([*gates, *self._near.sights, *self._crossings.geometries])
        line = shapely.difference(shapely.intersection(edge, before), open_ground)
        hedges = shapely.buffer(line, _HEDGE_HALF, cap_style="flat")
        near = self._driven.geometries[self._driven.query(hedges, "intersects")]
        hedges = shapely.difference(hedges, shapely.union_all(near))
        parts = flat_polygons(np.array([shapely.set_precision(hedges, GRID)]), larger_than=1.0)[0]
        return tuple(
            Prop(
                id=f"generated:hedge:{ring[0, 0]:.1f}:{ring[0, 1]:.1f}",
                kind="hedge",
                height=_HEDGE_HEIGHT,
                polygon=ring,
                tags=(GENERATED,),
            )
            for ring in self._near.lift_outlines(parts[shapely.get_num_interior_rings(parts) == 0])
        )

    def _stand(
        self, kind: str, places: Floats, heights: Sequence[float], tags: Sequence[tuple[tuple[str, str], ...]]
    ) -> tuple[Prop, ...]:
        """Stand things of one kind on the ground at (n, 2) places, each with its height and tags."""
        return tuple(
            Prop(
                id=f"generated:{kind}:{x:.1f}:{y:.1f}",
                kind=kind,
                height=height,
                position=(float(x), float(y), float(z)),
                tags=(GENERATED, *own),
            )
            for (x, y, z), own, height in zip(self._near.lift(places), tags, heights, strict=True)
        )

    def _find_stops(self, stops: Floats) -> Iterator[tuple[Lane, Points, float]]:
        """Find the lanes beside which buses stop, and how far along; without any stops, invent some."""
        lanes = list(self._outer_lanes())
        lines = [shapely.LineString(shape[:, :2]) for _, shape in lanes]
        if not len(stops):
            for (lane, shape), line in zip(lanes, lines, strict=True):
                if line.length > 3 * _STOP_AFTER and chance("stop", lane.road) < _STREETS_WITH_STOPS:
                    yield lane, shape, _STOP_AFTER
        elif lanes:
            places = shapely.points(stops)
            for stop, k in zip(places, shapely.STRtree(lines).nearest(places).tolist(), strict=True):
                yield *lanes[k], float(shapely.line_locate_point(lines[k], stop))

    def _outer_lanes(self) -> Iterator[tuple[Lane, Points]]:
        """List each road's outermost lane that vehicles use, with its shape without repeats."""
        found: set[str] = set()
        for lane in self._near.road_map.lanes:
            if lane.kind not in _NO_LAMPS and lane.road not in found:
                found.add(lane.road)
                shape = drop_repeats(lane.shape)
                if len(shape) > 1:
                    yield lane, shape

    def _beside(
        self, lane: Lane, shape: Points, distances: Floats, behind: float = _BEHIND_KERB
    ) -> tuple[Floats, Floats, Floats]:
        """Find places behind a lane's kerb (n, 2), the headings out of the street, and those of the lane."""
        positions, ahead = places_on(shape, distances)
        outward = ahead + (np.pi / 2 if self._near.road_map.left_hand else -np.pi / 2)
        away = np.column_stack([np.cos(outward), np.sin(outward)])
        return positions[:, :2] + (lane.width / 2 + behind) * away, outward, ahead

    def _take(self, places: Floats, *, apart: float) -> Flags:
        """Choose the places (n, 2) that are free and take them; of those close to each other, the first."""
        spots = shapely.points(places)
        kept = shapely.contains(self._near.focus, spots)
        kept &= ~self._is_close(self._driven, places, _POST_CLEAR) & ~self._is_close(
            self._crossings, places, 1.5
        )
        kept &= ~self._is_close(self._walls, places, _POST_CLEAR)
        kept &= ~self._is_close(shapely.STRtree(np.concatenate(self._posts)), places, _APART)
        one, other = shapely.STRtree(spots).query(spots, "dwithin", distance=apart)
        for first, second in sorted(zip(one.tolist(), other.tolist(), strict=True)):
            if first < second and kept[first]:
                kept[second] = False
        self._posts.append(spots[kept])
        return kept

    def _room(self, places: Floats) -> Floats:
        """Measure how wide a crown may be at each place before it comes near a lane, metres."""
        spot, distance = self._driven.query_nearest(
            shapely.points(places), return_distance=True, all_matches=False
        )
        room = np.zeros(len(places))
        room[spot[0]] = distance - _CLEAR_OF_LANES
        return room

    @staticmethod
    def _along(area: shapely.Geometry, spacing: float) -> Floats:
        """Set places along the outline of an area: (n, 2)."""
        rings = shapely.get_rings(shapely.get_parts(area))
        length = shapely.length(rings)
        count = (length / spacing).astype(np.int64)
        ring = np.repeat(np.arange(len(rings)), count)
        number = np.arange(len(ring)) - np.repeat(np.cumsum(count) - count, count)
        return shapely.get_coordinates(shapely.line_interpolate_point(rings[ring], (number + 0.5) * spacing))

    @staticmethod
    def _is_close(tree: shapely.STRtree, places: Floats, distance: float) -> Flags:
        close = np.zeros(len(places), dtype=bool)
        close[tree.query(shapely.points(places), "dwithin", distance=distance)[0]] = True
        return close

    @staticmethod
    def _chances(what: str, places: Floats) -> Floats:
        return np.array([chance(what, f"{x:.1f}", f"{y:.1f}") for x, y in places])


def _tell_heading(heading: float) -> tuple[str, str]:
    """Make the tag of `description.heading_of`, radians."""
    return "heading", f"{np.remainder(heading, 2 * np.pi):.4f}"
