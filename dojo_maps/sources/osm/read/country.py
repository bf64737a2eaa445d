"""What a country decides for its roads: the side to drive on, where signals hang, speeds without a sign.

The data's own evidence comes first: a tag, then the way its roundabouts turn, then where it lies.
"""

import itertools

from dojo_maps.sources.osm.read.data import OsmData

_LEFT_HAND = (
    (-11.0, 49.85, 1.77, 61.0), (14.1, 35.75, 14.6, 36.1), (32.2, 34.5, 34.7, 35.75),
    (60.9, 23.6, 75.0, 37.1), (68.0, 6.5, 88.2, 27.5), (75.0, 27.5, 81.0, 34.5), (80.0, 26.4, 92.7, 28.3),
    (88.0, 20.6, 92.6, 26.4), (91.5, 21.9, 97.3, 28.0), (72.5, -0.8, 74.0, 7.2), (79.5, 5.8, 82.0, 9.9),
    (97.3, 5.6, 102.2, 19.8), (102.2, 12.5, 105.3, 17.3), (99.5, 0.8, 104.6, 6.5), (109.5, 0.8, 119.3, 7.4),
    (95.0, -11.0, 141.0, 5.9), (113.5, 22.1, 114.5, 22.56), (122.9, 24.0, 131.5, 31.2),
    (129.5, 31.0, 146.0, 45.6), (112.0, -44.0, 154.0, -10.0), (141.0, -11.7, 156.0, -1.0),
    (165.0, -48.0, 180.0, -33.0), (155.5, -12.0, 168.0, -6.0), (176.0, -20.0, 180.0, -12.0),
    (33.9, -4.7, 41.9, 4.6), (29.5, -1.5, 35.0, 4.2), (30.4, -11.7, 40.5, -1.0), (22.0, -18.0, 30.3, -8.2),
    (30.2, -17.2, 35.9, -9.3), (30.2, -26.9, 40.9, -10.5), (11.7, -29.0, 25.3, -17.0),
    (19.9, -26.9, 33.1, -15.6), (16.4, -34.9, 33.0, -22.1), (57.2, -20.6, 57.9, -19.9),
    (-61.4, 1.2, -53.9, 8.6), (-78.4, 17.7, -76.1, 18.6), (-79.0, 20.9, -72.7, 27.3),
    (-62.0, 10.0, -59.4, 14.2), (-61.3, 13.6, -60.8, 14.2), (-64.9, 32.2, -64.6, 32.4),
)  # fmt: skip
"""Boxes in degrees (west, south, east, north) around the countries that drive on the left."""
_RIGHT_HAND = ((-5.8, 49.0, -1.1, 49.85), (96.2, 9.9, 98.4, 19.0), (125.0, 33.0, 129.4, 38.6))
"""Boxes of other countries inside of those."""
_MILES = (
    ((-125.0, 24.5, -66.9, 49.0), {"residential": 25, "": 35}),
    ((-11.0, 49.85, 1.77, 61.0), {"": 30}),
)
"""Where limits are in miles per hour: urban defaults by kind of road."""
_FAR_SIDE = (
    (-168.0, 24.5, -52.0, 72.0), (-161.0, 18.8, -154.0, 22.3), (-11.0, 49.85, 1.77, 61.0),
    (112.0, -44.0, 154.0, -10.0), (165.0, -48.0, 180.0, -33.0), (16.4, -34.9, 33.0, -22.1),
    (129.5, 31.0, 146.0, 45.6), (122.9, 24.0, 131.5, 31.2), (125.8, 33.0, 129.5, 38.6),
    (119.3, 21.8, 122.1, 25.4), (98.7, 23.4, 123.0, 41.5), (108.3, 18.1, 117.5, 23.4),
    (119.0, 41.5, 130.0, 48.0), (99.5, 0.8, 104.6, 6.5),
)  # fmt: skip
"""Boxes around North America, the British Isles, Australia, New Zealand, South Africa, Japan, Korea, Taiwan,
China, Malaysia and Singapore, where signals hang across the junction, too."""
_MPH = 0.44704
_KMH = 1 / 3.6
_URBAN = {
    "motorway": 100, "motorway_link": 60, "trunk": 70, "trunk_link": 50, "residential": 40,
    "living_street": 20, "service": 20,
}  # fmt: skip
_URBAN_OTHER = 50


def drives_left(data: OsmData) -> bool:
    """Tell whether traffic keeps left in an extract."""
    every = [way.tags for way in data.ways.values()] + [found.tags for found in data.relations.values()]
    tagged = [tags["driving_side"] for tags in every if "driving_side" in tags]
    if tagged:
        return tagged.count("left") * 2 > len(tagged)
    turning = [_turning(data, way) for way in data.ways if _is_ring(data, way)]
    if turning:
        return sum(turning) < 0
    lon, lat = centre_of(data)
    return _inside(_LEFT_HAND, lon, lat) and not _inside(_RIGHT_HAND, lon, lat)


def has_far_side_signals(data: OsmData) -> bool:
    """Tell whether traffic in an extract's country also looks at signals across the junction."""
    return bool(data.nodes) and _inside(_FAR_SIDE, *centre_of(data))


def default_speed(kind: str, lon: float, lat: float) -> float:
    """Give the limit, m/s, of an urban road without a sign."""
    for box, miles in _MILES:
        if _inside((box,), lon, lat) and kind in (
            "primary",
            "secondary",
            "tertiary",
            "unclassified",
            "residential",
        ):
            return miles.get(kind, miles[""]) * _MPH
    return _URBAN.get(kind, _URBAN_OTHER) * _KMH


def read_speed(text: str) -> float | None:
    """Read a maxspeed tag into m/s; None where it is not a number."""
    words = text.split(";", maxsplit=1)[0].replace("mph", " mph").split()
    try:
        value = float(words[0])
    except (IndexError, ValueError):
        zone = text.rsplit(":", 1)[-1].removeprefix("zone")
        known = {"urban": 50.0, "rural": 80.0, "motorway": 110.0, "living_street": 20.0, "walk": 7.0}
        value = known.get(zone, 0.0) or (float(zone) if zone.isdecimal() and len(zone) < 4 else 0.0)
        words = []
    unit = _MPH if words[1:2] == ["mph"] else _KMH
    speed = value * unit
    return speed if 1.0 <= speed <= 60.0 else None


def centre_of(data: OsmData) -> tuple[float, float]:
    """Give the middle of an extract's nodes, lon and lat."""
    nodes = data.nodes.values()
    return (
        sum(node.lon for node in nodes) / len(data.nodes),
        sum(node.lat for node in nodes) / len(data.nodes),
    )


def _is_ring(data: OsmData, way: int) -> bool:
    nodes = data.ways[way].nodes
    ring = (
        data.ways[way].tags.get("junction") in ("roundabout", "circular") and "highway" in data.ways[way].tags
    )
    return ring and len(nodes) > 3 and nodes[0] == nodes[-1] and all(node in data.nodes for node in nodes)


def _turning(data: OsmData, way: int) -> int:
    """Give 1 for a ring drawn counter-clockwise, -1 for a clockwise one."""
    places = [(data.nodes[node].lon, data.nodes[node].lat) for node in data.ways[way].nodes]
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in itertools.pairwise(places))
    return 1 if area > 0 else -1


def _inside(boxes: tuple[tuple[float, float, float, float], ...], lon: float, lat: float) -> bool:
    return any(west <= lon <= east and south <= lat <= north for west, south, east, north in boxes)
