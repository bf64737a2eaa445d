"""What a country decides for its roads: the side to drive on, who goes first, where signals hang, speeds.

The side that a user names comes first, then what the data itself shows: a tag, the way that all its
roundabouts turn; then the country in whose boundaries it lies.
"""

import itertools
from dataclasses import dataclass
from enum import Enum
from statistics import median

from dojo_maps.sources.osm.read.boundaries import country_at
from dojo_maps.sources.osm.read.data import OsmData, Tags


def _codes(text: str) -> frozenset[str]:
    return frozenset(text.split())


_LEFT_HAND = _codes("""
    AG AI AU BB BD BM BN BS BT BW CC CK CX CY DM FJ FK GB GD GG GS GY HK ID IE IM IN JE JM JP KE KI KN KY LC
    LK LS MO MS MT MU MV MW MY MZ NA NF NP NR NU NZ PG PK PN SB SC SG SH SR SZ TC TH TK TL TO TT TV TZ UG VC
    VG VI WS ZA ZM ZW
""")
"""Countries and territories that drive on the left."""
_FAR_SIDE = _codes("US CA PR GB IE IM JE GG AU NZ ZA JP KR TW CN HK MO MY SG")
"""Where signals hang across the junction, too."""
_AMERICAN, _BRITISH = _codes("US PR VI GU AS MP"), _codes("GB IM JE GG")
"""Where limits are in miles per hour, with urban defaults of 35 (25 in residential streets) and of 30."""
_MPH = 0.44704
_KMH = 1 / 3.6
_URBAN = {
    "motorway": 100, "motorway_link": 60, "trunk": 70, "trunk_link": 50, "residential": 40,
    "living_street": 20, "service": 20,
}  # fmt: skip
_URBAN_OTHER = 50


class EqualRoads(Enum):
    """Who goes first where roads of the same kind meet without signs.

    The Convention on Road Traffic (Vienna 1968), article 18: where traffic keeps right, the right goes first;
    where it keeps left, countries decide. In North America (Uniform Vehicle Code 11-401), Australia (Road
    Rules 72 and 73) and New Zealand (Road User Rule 4.2) the right goes first at crossroads, and a road that
    ends gives way. In Japan the left goes first (Road Traffic Act, article 36). Britain, Ireland and others
    like them paint lines on the road that ends.
    """

    ROAD_THAT_ENDS = "the road that ends gives way"
    RIGHT_AT_CROSSROADS = "the road that ends gives way, at crossroads right before left"
    RIGHT_FIRST = "right before left"
    LEFT_FIRST = "left before right"


_EQUAL_ROADS = {
    **dict.fromkeys(
        _codes("""
            AD AL AT BA BE BG BY CH CZ DE DK EE ES FI FR GR HR HU IS IT LI LT LU LV MC MD ME MK NL NO PL PT RO
            RS RU SE SI SK SM TR UA VA
        """),
        EqualRoads.RIGHT_FIRST,
    ),
    **dict.fromkeys(_codes("US CA PR AU NZ"), EqualRoads.RIGHT_AT_CROSSROADS),
    "JP": EqualRoads.LEFT_FIRST,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Country:
    """The rules of the country that an extract lies in.

    Attributes:
        code: of two letters (ISO 3166-1), empty where none is known.
        left_hand: traffic keeps left.
        told_by: how the side is known, in words.
        doubted: what speaks for the other side, in words; empty for nothing.
    """

    code: str
    left_hand: bool
    told_by: str
    doubted: str = ""

    @property
    def far_side_signals(self) -> bool:
        """Whether traffic also looks at signals across the junction."""
        return self.code in _FAR_SIDE

    @property
    def equal_roads(self) -> EqualRoads:
        """Who goes first where roads of the same kind meet without signs."""
        return _EQUAL_ROADS.get(self.code, EqualRoads.ROAD_THAT_ENDS)

    def default_speed(self, kind: str) -> float:
        """Give the limit, m/s, of an urban road without a sign.

        Args:
            kind: of the road, by the tag `highway`.

        Returns:
            m/s; that of 50 km/h for a kind without a limit of its own.
        """
        if kind in ("primary", "secondary", "tertiary", "unclassified", "residential"):
            if self.code in _AMERICAN:
                return (25 if kind == "residential" else 35) * _MPH
            if self.code in _BRITISH:
                return 30 * _MPH
        return _URBAN.get(kind, _URBAN_OTHER) * _KMH


def read_country(data: OsmData, drive: str | None = None) -> Country:
    """Find the country of an extract and the side that its traffic keeps to.

    Args:
        data: the extract.
        drive: left or right, where a user names the side.

    Returns:
        The country's rules; its code is empty where the extract lies in none, or has no nodes.
    """
    code = country_at(*_centre_of(data)) if data.nodes else ""
    lawful = code in _LEFT_HAND
    rings = [_turns_clockwise(data, way) for way in data.ways if _is_ring(data, way)]
    every = [way.tags for way in data.ways.values()] + [found.tags for found in data.relations.values()]
    tagged = [tags["driving_side"] == "left" for tags in every if "driving_side" in tags]
    if drive is not None:
        left_hand, told_by = drive == "left", "it was asked for"
    elif tagged:
        left_hand, told_by = sum(tagged) * 2 > len(tagged), "driving_side is tagged"
    elif rings and lawful not in rings:
        left_hand, told_by = not lawful, "all its roundabouts turn so"
    else:
        left_hand, told_by = lawful, f"the area lies in {code}" if code else "the area lies in no country"
    against = []
    if code and lawful != left_hand:
        against.append(f"the area lies in {code}, which drives on the other side")
    if (not left_hand) in rings:
        against.append(f"{rings.count(not left_hand)} of {len(rings)} roundabouts turn the other way")
    return Country(code=code, left_hand=left_hand, told_by=told_by, doubted=", and ".join(against))


def read_speed(text: str) -> float | None:
    """Read a maxspeed tag.

    Args:
        text: its value: km/h, or with `mph`; of several the first; or a zone such as `DE:urban`.

    Returns:
        m/s; None where it is no speed, or one below 1 m/s or above 60 m/s.
    """
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


def _centre_of(data: OsmData) -> tuple[float, float]:
    """Give the middle of an extract's nodes, lon and lat; single ones may lie far away."""
    nodes = data.nodes.values()
    return median(node.lon for node in nodes), median(node.lat for node in nodes)


def is_roundabout(tags: Tags) -> bool:
    """Tell whether a way is part of a roundabout, by its tags.

    Args:
        tags: of the way.

    Returns:
        Whether it is; `junction=circular` is one, too.
    """
    return tags.get("junction") in ("roundabout", "circular")


def _is_ring(data: OsmData, way: int) -> bool:
    nodes = data.ways[way].nodes
    ring = is_roundabout(data.ways[way].tags) and "highway" in data.ways[way].tags
    return ring and len(nodes) > 3 and nodes[0] == nodes[-1] and all(node in data.nodes for node in nodes)


def _turns_clockwise(data: OsmData, way: int) -> bool:
    places = [(data.nodes[node].lon, data.nodes[node].lat) for node in data.ways[way].nodes]
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in itertools.pairwise(places))
    against = data.ways[way].tags.get("oneway") in ("-1", "reverse")
    return (area < 0) != against
