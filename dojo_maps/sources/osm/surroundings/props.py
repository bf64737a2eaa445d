"""What is around the roads of an extract: buildings, trees, bus stops, water and green areas, as props.

Heights come from tags, else from the number of floors, else from the kind of building, else from the
buildings around it.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from dojo_maps.description import Prop, RoadMap, points
from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sources.osm.read.data import OsmData, Tags
from dojo_maps.sources.osm.read.lengths import read_length
from dojo_maps.sources.osm.rules import RULES, SurroundingRules
from dojo_maps.sources.osm.surroundings.areas import MapShapes, areas_of, polygons_of, without_overlaps

_PLACED = ("tree", "bus_stop")
"""Kinds that have a place, and no outline."""
_FLOORS = {
    "house": 2, "detached": 2, "semidetached_house": 2, "terrace": 2, "bungalow": 1, "apartments": 5,
    "residential": 4, "dormitory": 4, "hotel": 6, "office": 5, "commercial": 4, "retail": 2, "supermarket": 2,
    "industrial": 2, "warehouse": 2, "school": 3, "university": 4, "hospital": 5, "public": 4, "civic": 4,
    "church": 5, "cathedral": 8, "mosque": 4, "temple": 3, "train_station": 3, "stadium": 6, "parking": 4,
    "garage": 1, "garages": 1, "shed": 1, "hut": 1, "kiosk": 1, "service": 1, "greenhouse": 1, "toilets": 1,
}  # fmt: skip
"""Usual numbers of floors by kind of building."""
_USUAL_FLOORS = 3.0
_NO_BUILDING = ("no", "roof", "entrance", "demolished", "razed", "proposed")
_WATER = {
    "natural": ("water",), "waterway": ("riverbank", "dock"), "landuse": ("basin", "reservoir", "pond"),
    "leisure": ("swimming_pool",),
}  # fmt: skip
_GREEN = {
    "landuse": ("grass", "forest", "meadow", "village_green", "recreation_ground", "cemetery", "orchard",
                "flowerbed", "allotments", "vineyard"),
    "leisure": ("park", "garden", "pitch", "golf_course"),
    "natural": ("wood", "scrub", "grassland", "heath", "wetland"),
}  # fmt: skip
_KEPT_TAGS = ("name", "building", "building:levels", "height", "natural", "landuse", "leisure", "waterway",
              "leaf_type", "species", "genus", "shelter")  # fmt: skip
_MOST_CORNERS = 2_000
_MOST_NEIGHBOURS = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class _Thing:
    """A candidate: an area or a place, with its distance from what matters on the map."""

    kind: str
    id: str
    tags: Tags
    height: float
    shape: shapely.Geometry
    distance: float


def read_context(
    data: OsmData, road_map: RoadMap, rules: SurroundingRules = RULES.surroundings
) -> tuple[tuple[Prop, ...], tuple[Issue, ...]]:
    """Find the things around the roads of a map in the extract that it was made of.

    Args:
        data: the extract.
        road_map: the map, with its projection.
        rules: how much is kept.

    Returns:
        Buildings, trees, bus stops and areas, which do not overlap others of their kind; and a note for each
        kind that there is too much of.
    """
    if road_map.projection.proj is None:
        return (), ()
    finder = _Finder(data, road_map, rules)
    props: list[Prop] = []
    issues: list[Issue] = []
    for kind, limits in rules.things.items():
        things = sorted(finder.find(kind), key=lambda thing: (thing.distance, thing.id))
        if len(things) > limits.most:
            issues.append(_left_out(kind, len(things), limits.most, road_map))
        kept = things[: limits.most]
        if kind in _PLACED:
            props += _placed_props(kept, kind)
        else:
            props += _area_props(kept, kind, limits.least_area)
    return tuple(props), tuple(issues)


class _Finder:
    """Finds the things of a kind within the map's rectangle."""

    def __init__(self, data: OsmData, road_map: RoadMap, rules: SurroundingRules) -> None:
        self._data = data
        self._rules = rules
        self._shapes = MapShapes(data, road_map.projection)
        low, high = road_map.bounds
        self._frame = shapely.box(
            low[0] - rules.margin, low[1] - rules.margin, high[0] + rules.margin, high[1] + rules.margin
        )
        signalled = {junction for signal in road_map.signals for junction in signal.junctions}
        places = [j.position[:2] for j in road_map.junctions if j.id in signalled]
        self._focus = shapely.multipoints(places or [road_map.origin])
        shapely.prepare(self._frame)
        known = [
            (*place, floors)
            for way in data.ways.values()
            if "building" in way.tags and (floors := read_length(way.tags.get("building:levels", "")))
            for place in self._shapes.line(way)[:1].tolist()
        ]
        self._known = np.array(known).reshape(-1, 3)

    def find(self, kind: str) -> Iterator[_Thing]:
        if kind in _PLACED:
            yield from self._trees() if kind == "tree" else self._stops()
            return
        for element, number, tags in self._areas():
            if not _is_kind(kind, tags):
                continue
            shape = self._shapes.area(element, number)
            if shape is not None and self._frame.intersects(shape):
                height = 0.0
                if kind == "building":
                    height = building_height(tags, self._rules, usual=self._usual_floors(shape))
                yield from self._area_things(kind, f"{element}/{number}", tags, height, shape)

    def _usual_floors(self, shape: shapely.Geometry) -> float:
        """Guess how many floors a building has, from those around it; a small one has one."""
        if shape.area < self._rules.outbuilding:
            return 1.0
        away = np.hypot(*(self._known[:, :2] - shapely.get_coordinates(shape.centroid)).T)
        floors = self._known[away < self._rules.neighbourhood, 2]
        return float(np.median(floors)) if len(floors) >= self._rules.neighbours else _USUAL_FLOORS

    def _areas(self) -> Iterator[tuple[str, int, Tags]]:
        for number, way in self._data.ways.items():
            if way.tags:
                yield "way", number, way.tags
        for number, relation in self._data.relations.items():
            if relation.tags.get("type") == "multipolygon":
                yield "relation", number, relation.tags

    def _area_things(
        self, kind: str, name: str, tags: Tags, height: float, shape: shapely.Geometry
    ) -> Iterator[_Thing]:
        """Take a building whole where its middle lies on the map, and cut other areas at the map's edge."""
        if kind == "building":
            if not self._frame.contains(shape.centroid):
                return
        else:
            shape = shapely.intersection(shape, self._frame)
        limits = self._rules.things[kind]
        shape = _simpler(shape, limits.detail)
        if shape.area > limits.least_area and shapely.get_num_coordinates(shape) <= _MOST_CORNERS:
            distance = round(float(shapely.distance(shape, self._focus)), 3)
            yield _Thing(kind=kind, id=name, tags=tags, height=height, shape=shape, distance=distance)

    def _trees(self) -> Iterator[_Thing]:
        for node, found in self._data.nodes.items():
            place = self._shapes.place(node) if found.tags.get("natural") == "tree" else None
            if place is not None:
                yield from self._tree(f"node/{node}", found.tags, place)
        for number, way in self._data.ways.items():
            if way.tags.get("natural") == "tree_row":
                for k, place in enumerate(_spread(self._shapes.line(way), self._rules)):
                    yield from self._tree(f"way/{number}/{k}", way.tags, place)

    def _stops(self) -> Iterator[_Thing]:
        for node, found in self._data.nodes.items():
            tags = found.tags
            if tags.get("highway") == "bus_stop":
                place = self._shapes.place(node)
                if place is not None:
                    yield from self._placed("bus_stop", f"node/{node}", tags, place, 0.0)

    def _tree(self, name: str, tags: Tags, place: Floats) -> Iterator[_Thing]:
        yield from self._placed("tree", name, tags, place, tree_height(tags, self._rules))

    def _placed(self, kind: str, name: str, tags: Tags, place: Floats, height: float) -> Iterator[_Thing]:
        spot = shapely.Point(place)
        if self._frame.contains(spot):
            distance = round(float(shapely.distance(spot, self._focus)), 3)
            yield _Thing(kind=kind, id=name, tags=tags, height=height, shape=spot, distance=distance)


def building_height(
    tags: Tags, rules: SurroundingRules = RULES.surroundings, *, usual: float = _USUAL_FLOORS
) -> float:
    """Tell a building's height, metres.

    Source: https://wiki.openstreetmap.org/wiki/Simple_3D_Buildings for the tags.

    Args:
        tags: of the building.
        rules: how high floors are.
        usual: floors of a building of no known kind.

    Returns:
        Metres, within the bounds of the rules.
    """
    height = read_length(tags.get("height") or tags.get("building:height") or "")
    if height is None:
        floors = read_length(tags.get("building:levels", ""))
        roof = read_length(tags.get("roof:levels", "")) or 0.0
        usual = _FLOORS.get(tags.get("building", ""), usual)
        height = ((floors or usual) + roof) * rules.storey + rules.roof
    return min(max(height, rules.lowest), rules.tallest)


def tree_height(tags: Tags, rules: SurroundingRules = RULES.surroundings) -> float:
    """Tell a tree's height, metres.

    Args:
        tags: of the tree, or of the row that it stands in.
        rules: how high trees are.

    Returns:
        Metres, within the bounds of the rules.
    """
    return min(
        max(read_length(tags.get("height", "")) or rules.tree, rules.smallest_tree), rules.tallest_tree
    )


def _is_kind(kind: str, tags: Tags) -> bool:
    if kind == "building":
        below = tags.get("location") == "underground" or tags.get("layer", "").startswith("-")
        return tags.get("building", "no") not in _NO_BUILDING and not below
    table = _WATER if kind == "water" else _GREEN
    return any(tags.get(key) in values for key, values in table.items()) and "building" not in tags


def _simpler(shape: shapely.Geometry, detail: float) -> shapely.Geometry:
    simple = shapely.simplify(shape, detail)
    if shapely.get_num_coordinates(simple) > _MOST_CORNERS:
        simple = shapely.simplify(shape, 2.0)
    return areas_of(simple)


def _spread(line: Floats, rules: SurroundingRules) -> Floats:
    """Set places along a line, as far apart as trees of a row stand: (n, 2)."""
    if len(line) < 2:
        return line
    length = along(line)
    count = min(int(length[-1] / rules.tree_spacing) + 1, rules.things["tree"].most)
    wanted = np.linspace(0.0, length[-1], count) if count > 1 else length[-1:] / 2
    return np.column_stack([np.interp(wanted, length, axis) for axis in line.T])


def _area_props(things: list[_Thing], kind: str, least: float) -> Iterator[Prop]:
    """Make areas that do not overlap: the higher building keeps its ground, the smaller lawn or pond."""
    rank = [
        (-thing.height if kind == "building" else thing.shape.area, thing.distance, thing.id)
        for thing in things
    ]
    order = sorted(range(len(things)), key=rank.__getitem__)
    shapes = np.array([thing.shape for thing in things], dtype=object)
    left = without_overlaps(shapes, order, most=_MOST_NEIGHBOURS)
    for index, thing in enumerate(things):
        parts = polygons_of(left[index], larger_than=least) if index in left else []
        for number, part in enumerate(parts):
            yield Prop(
                id=thing.id if number == 0 else f"{thing.id}/{number}",
                kind=kind,
                height=round(thing.height, 2),
                polygon=_ring(part.exterior),
                holes=tuple(_ring(hole) for hole in part.interiors),
                tags=_tags(thing.tags),
            )


def _placed_props(things: Iterable[_Thing], kind: str) -> Iterator[Prop]:
    for thing in things:
        position = (round(thing.shape.x, 3), round(thing.shape.y, 3), 0.0)
        yield Prop(
            id=thing.id, kind=kind, height=round(thing.height, 2), position=position, tags=_tags(thing.tags)
        )


def _ring(ring: shapely.LinearRing) -> Floats:
    return points(np.round(shapely.get_coordinates(ring)[:-1], 3))


def _tags(tags: Tags) -> tuple[tuple[str, str], ...]:
    return tuple((key, tags[key][:255]) for key in _KEPT_TAGS if tags.get(key))


def _left_out(kind: str, count: int, most: int, road_map: RoadMap) -> Issue:
    x, y = road_map.origin
    return Issue(
        check="osm.context_left_out",
        severity=Severity.NOTE,
        elements=(Element(kind="map", id=road_map.name),),
        position=(x, y, 0.0) if math.isfinite(x + y) else (0.0, 0.0, 0.0),
        message=f"of {count} things of the kind {kind}, the {most} nearest to signals are kept",
        measured=float(count),
        limit=float(most),
        hint="import a smaller area to have all of them",
    )
