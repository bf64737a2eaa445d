"""Small hand-drawn extracts: one shape of junction each, in metres around a place on the earth."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

HELSINKI, LONDON, SYDNEY = (24.94, 60.17), (-0.12, 51.51), (151.2, -33.87)

SIGNAL = {"highway": "traffic_signals"}
CROSSING = {"highway": "crossing", "crossing": "uncontrolled"}
SIGNAL_CROSSING = {"highway": "crossing", "crossing": "traffic_signals"}


@dataclass
class Drawing:
    """An extract in the making: nodes by place, ways, relations."""

    centre: tuple[float, float] = HELSINKI
    nodes: dict[tuple[float, float], tuple[int, dict[str, str]]] = field(default_factory=dict)
    ways: list[tuple[list[int], dict[str, str]]] = field(default_factory=list)
    relations: list[tuple[list[tuple[str, int, str]], dict[str, str]]] = field(default_factory=list)

    def node(self, x: float, y: float, **tags: str) -> int:
        """Draw a node, or add tags to the one that is there."""
        number, found = self.nodes.setdefault((x, y), (len(self.nodes) + 1, {}))
        found |= {key.replace("__", ":"): value for key, value in tags.items()}
        return number

    def way(self, *places: tuple[float, float], **tags: str) -> int:
        """Draw a way through places; its id."""
        clean = {key.replace("__", ":"): value for key, value in tags.items()}
        self.ways.append(([self.node(*place) for place in places], clean))
        return 1000 + len(self.ways)

    def restriction(self, kind: str, source: int, via: int, target: int) -> None:
        """Draw a turn restriction between ways over a node."""
        members = [("way", source, "from"), ("node", via, "via"), ("way", target, "to")]
        self.relations.append((members, {"type": "restriction", "restriction": kind}))

    def write(self, path: Path) -> Path:
        """Write it as OSM XML."""
        lon, lat = self.centre
        per_lat = 111_320.0
        per_lon = per_lat * math.cos(math.radians(lat))
        lines = ['<osm version="0.6">']
        for (x, y), (number, tags) in self.nodes.items():
            where = f'lat="{lat + y / per_lat:.8f}" lon="{lon + x / per_lon:.8f}"'
            lines += [f'<node id="{number}" {where}>', *_tags(tags), "</node>"]
        for number, (refs, tags) in enumerate(self.ways, start=1001):
            lines += [f'<way id="{number}">', *(f'<nd ref="{ref}"/>' for ref in refs), *_tags(tags), "</way>"]
        for number, (members, tags) in enumerate(self.relations, start=1):
            rows = [f'<member type="{kind}" ref="{ref}" role="{role}"/>' for kind, ref, role in members]
            lines += [f'<relation id="{number}">', *rows, *_tags(tags), "</relation>"]
        path.write_text("\n".join([*lines, "</osm>"]))
        return path


def _tags(tags: dict[str, str]) -> list[str]:
    return [f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in tags.items()]


def cross(centre: tuple[float, float] = HELSINKI) -> Drawing:
    """Two two-way streets, a signal in the middle, signalised crossings on all arms."""
    d = Drawing(centre=centre)
    d.way((-150, 0), (-12, 0), (0, 0), (12, 0), (150, 0), highway="secondary", lanes="4", name="Long & wide")
    d.way((0, -150), (0, -12), (0, 0), (0, 12), (0, 150), highway="tertiary", lanes="2")
    d.node(0, 0, **SIGNAL)
    for x, y in ((-12, 0), (12, 0), (0, -12), (0, 12)):
        d.node(x, y, **SIGNAL_CROSSING)
    return d


def dual_carriageways() -> Drawing:
    """Two divided roads: four vertices, signals on each."""
    d = Drawing()
    one = {"highway": "primary", "oneway": "yes", "lanes": "2"}
    d.way((-200, -9), (-30, -9), (-9, -9), (9, -9), (200, -9), turn__lanes="left|through;right", **one)
    d.way((200, 9), (30, 9), (9, 9), (-9, 9), (-200, 9), **one)
    d.way((9, -200), (9, -30), (9, -9), (9, 9), (9, 200), **one)
    d.way((-9, 200), (-9, 30), (-9, 9), (-9, -9), (-9, -200), **one)
    for x, y in ((9, 9), (-9, 9), (9, -9), (-9, -9)):
        d.node(x, y, **SIGNAL)
    for x, y in ((-30, -9), (30, 9), (9, -30), (-9, 30)):
        d.node(x, y, **SIGNAL_CROSSING)
    return d


def dog_leg() -> Drawing:
    """A street that crosses a main road with a jog of 22 m; signals at both legs."""
    d = Drawing()
    d.way((-150, 0), (-11, 0), (11, 0), (150, 0), highway="secondary", lanes="2")
    d.way((-11, 0), (-11, 150), highway="residential")
    d.way((11, 0), (11, -150), highway="residential")
    d.node(-11, 0, **SIGNAL)
    d.node(11, 0, **SIGNAL)
    return d


def slip_lane() -> Drawing:
    """A crossing with a slip lane for right turns, with its own zebra."""
    d = cross()
    d.way((-45, 0), (-25, -8), (-8, -25), (0, -45), highway="secondary_link", oneway="yes")
    d.ways[0][0].insert(1, d.node(-45, 0))
    d.ways[1][0].insert(1, d.node(0, -45))
    d.node(-25, -8, **CROSSING)
    return d


def triangle() -> Drawing:
    """A junction of three two-way roads whose middles leave a triangle."""
    d = Drawing()
    d.way((-150, 0), (-14, 0), (14, 0), (150, 0), highway="tertiary")
    d.way((-14, 0), (0, 22), (0, 150), highway="tertiary")
    d.way((0, 22), (14, 0), highway="tertiary")
    return d


def roundabout() -> Drawing:
    """A roundabout of 20 m radius with four arms and zebras."""
    d = Drawing()
    ring = [
        (round(20 * math.cos(k * math.pi / 8), 3), round(20 * math.sin(k * math.pi / 8), 3))
        for k in range(16)
    ]
    d.way(*ring, ring[0], highway="tertiary", junction="roundabout", lanes="1")
    for k in range(4):
        x, y = ring[4 * k]
        far, near = (x * 8, y * 8), (x * 1.6, y * 1.6)
        d.way(far, near, (x, y), highway="tertiary", lanes="2")
        d.node(*near, **CROSSING)
    return d


def left_hand() -> Drawing:
    """The crossing of two streets, where traffic keeps left."""
    return cross(LONDON)


def approach_signals() -> Drawing:
    """Signals only where the stop lines are, none on the junction's own node."""
    d = Drawing()
    d.way((-150, 0), (-18, 0), (0, 0), (18, 0), (150, 0), highway="secondary", lanes="2")
    d.way((0, -150), (0, -18), (0, 0), (0, 18), (0, 150), highway="secondary", lanes="2")
    for x, y, way in ((-18, 0, "forward"), (18, 0, "backward"), (0, -18, "forward"), (0, 18, "backward")):
        d.node(x, y, traffic_signals__direction=way, **SIGNAL)
    return d


def island_crossing() -> Drawing:
    """A signalised crossing of a divided road between junctions, in two parts with an island."""
    d = Drawing()
    one = {"highway": "secondary", "oneway": "yes", "lanes": "2"}
    d.way((-150, -7), (0, -7), (150, -7), **one)
    d.way((150, 7), (0, 7), (-150, 7), **one)
    for y in (-7, 7):
        d.node(0, y, **SIGNAL_CROSSING)
    d.way((0, -14), (0, -7), highway="footway", footway="crossing")
    d.way((0, -7), (0, 7), highway="footway")
    d.way((0, 7), (0, 14), highway="footway", footway="crossing")
    d.way((150, -7), (160, 0), (150, 7), **one)
    d.way((-150, 7), (-160, 0), (-150, -7), **one)
    return d


def tram() -> Drawing:
    """A tram line in the middle of a street over a signalised crossing."""
    d = cross()
    d.way((-150, 1), (0, 1), (150, 1), railway="tram")
    d.node(0, 1, railway="tram_level_crossing", highway="traffic_signals")
    return d


def sausage() -> Drawing:
    """Carriageways that part around an island and meet again."""
    d = Drawing()
    one = {"highway": "tertiary", "oneway": "yes"}
    d.way((-200, 0), (-60, 0), highway="tertiary", lanes="2")
    d.way((-60, 0), (-30, -6), (30, -6), (60, 0), **one)
    d.way((60, 0), (30, 6), (-30, 6), (-60, 0), **one)
    d.way((60, 0), (200, 0), highway="tertiary", lanes="2")
    d.way((30, -6), (30, -100), highway="residential")
    return d


def parallel_ways() -> Drawing:
    """A divided avenue with frontage roads, cycle tracks and footways, crossed by a street."""
    d = Drawing()
    one = {"highway": "primary", "oneway": "yes", "lanes": "3"}
    d.way((-200, -8), (0, -8), (200, -8), **one)
    d.way((200, 8), (0, 8), (-200, 8), **one)
    d.way((-200, -24), (0, -24), (200, -24), highway="residential", oneway="yes")
    d.way((200, 24), (0, 24), (-200, 24), highway="residential", oneway="yes")
    for y in (-18, -30, 18, 30):
        d.way((-200, y), (0, y), (200, y), highway="cycleway" if abs(y) == 18 else "footway")
    d.way((0, -150), (0, -30), (0, -24), (0, -18), (0, -8), (0, 8), (0, 18), (0, 24), (0, 30), (0, 150),
          highway="tertiary", lanes="2")  # fmt: skip
    for y in (-24, -8, 8, 24):
        d.node(0, y, **SIGNAL)
    return d


def bridge() -> Drawing:
    """A road over another without a common node, with ramps to the ground."""
    d = Drawing()
    d.way((-250, 0), (-40, 0), highway="secondary", lanes="2")
    d.way((-40, 0), (40, 0), highway="secondary", lanes="2", bridge="yes", layer="1")
    d.way((40, 0), (250, 0), highway="secondary", lanes="2")
    d.way((0, -150), (0, 150), highway="secondary", lanes="2")
    d.way((250, 0), (250, 150), (0, 150), highway="residential")
    return d


def fork() -> Drawing:
    """A ramp that leaves a one-way road at seven degrees."""
    d = Drawing()
    one = {"highway": "secondary", "oneway": "yes", "lanes": "2"}
    d.way((-150, 0), (0, 0), (200, 0), **one)
    d.way((0, 0), (100, 12), (120, 100), highway="secondary_link", oneway="yes")
    return d


def tight_carriageways() -> Drawing:
    """Carriageways of two lanes mapped five metres apart, with a crossing over both at a signal."""
    d = Drawing()
    one = {"highway": "secondary", "oneway": "yes", "lanes": "2"}
    d.way((-150, -2.5), (-14, -2.5), (0, -2.5), (150, -2.5), **one)
    d.way((150, 2.5), (0, 2.5), (-14, 2.5), (-150, 2.5), **one)
    d.way((0, -150), (0, -2.5), (0, 2.5), (0, 150), highway="residential")
    for y in (-2.5, 2.5):
        d.node(0, y, **SIGNAL)
        d.node(-14, y, **SIGNAL_CROSSING)
    return d


def wide_median() -> Drawing:
    """A street that crosses carriageways 42 m apart; signals at both."""
    d = Drawing()
    one = {"highway": "primary", "oneway": "yes", "lanes": "2"}
    d.way((-200, -21), (0, -21), (200, -21), **one)
    d.way((200, 21), (0, 21), (-200, 21), **one)
    d.way((0, -150), (0, -21), (0, 21), (0, 150), highway="tertiary", lanes="2")
    for y in (-21, 21):
        d.node(0, y, **SIGNAL)
    return d


def crossing_at_lane_change() -> Drawing:
    """A signalised crossing between junctions, three metres past the place where a lane begins."""
    d = Drawing()
    d.way((-150, 0), (0, 0), highway="secondary", oneway="yes", lanes="2")
    d.way((0, 0), (3, 0), (150, 0), highway="secondary", oneway="yes", lanes="3")
    d.node(0, 0, **SIGNAL)
    d.node(3, 0, **SIGNAL_CROSSING)
    return d


DRAWINGS: dict[str, Callable[[], Drawing]] = {
    drawing.__name__: drawing
    for drawing in (
        cross, dual_carriageways, dog_leg, slip_lane, triangle, roundabout, left_hand, approach_signals,
        island_crossing, tram, sausage, parallel_ways, bridge, fork, tight_carriageways, wide_median,
        crossing_at_lane_change,
    )
}  # fmt: skip
