"""How much of the source's length was built, by class of road, and why the rest was not.

What counts is the source: every way of a kind that is built, whole, whatever the import made of it.
"""

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.issue import Issue, Severity
from dojo_maps.sources.osm.completeness.losses import Left, loss, share_of
from dojo_maps.sources.osm.graph.projection import way_line
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.read.data import OsmData, Tags
from dojo_maps.sources.osm.read.way_tags import KINDS, why_not_a_road
from dojo_maps.wording import counted

_TRACKS = ("tram", "light_rail", "rail", "subway", "narrow_gauge")


def measure_road_length(data: OsmData, network: OsmNetwork) -> tuple[dict[str, Any], list[Issue]]:
    """Measure the mapped roads against the built ones.

    Args:
        data: the extract.
        network: as it was built from it.

    Returns:
        Metres kept, of how many, by the tag `highway`, and metres by kind of what is not imported at all;
        and an issue for each kind of which something was not built.
    """
    graph, rules = network.layout.graph, network.layout.rules.completeness
    floor = _Floor(network)
    kept: dict[str, float] = defaultdict(float)
    total: dict[str, float] = defaultdict(float)
    lost: dict[str, Left] = defaultdict(Left)
    left_out: dict[str, Left] = defaultdict(Left)
    for way, record in data.ways.items():
        kind = _kind(record.tags)
        line = way_line(graph.projection, data, record) if kind else None
        if kind is None or line is None:
            continue
        if way in graph.track_ways:
            continue
        if way not in graph.ways:
            reason = why_not_a_road(record.tags)
            left_out[f"{kind}{reason and f' ({reason})'}"].add(way, line)
            continue
        rest = floor.outside(line)
        total[record.tags["highway"]] += line.length
        kept[record.tags["highway"]] += line.length - rest.length
        if rest.length > rules.road_lost:
            lost[kind].add(way, rest)
    figures = {
        "road_metres": {
            "all": share_of((round(sum(kept.values())), round(sum(total.values())))),
            **{
                kind: share_of((round(kept[kind]), round(total[kind])))
                for kind in sorted(total, key=lambda kind: (KINDS.get(kind, 0), kind))
            },
        },
        "metres_not_imported": {kind: round(left.metres) for kind, left in sorted(left_out.items())},
    }
    return figures, [*_lost_issues(lost, rules.class_lost), *_left_out_issues(left_out)]


class _Floor:
    """The ground of built roads and junctions."""

    def __init__(self, network: OsmNetwork) -> None:
        beside = network.layout.rules.completeness.road_found
        lanes = [lane for lane in network.road_map.lanes if lane.kind in CARRIAGEWAY]
        shapes = [
            *lane_strips(lanes),
            *(
                shapely.make_valid(shapely.Polygon(junction.polygon[:, :2]))
                for junction in network.road_map.junctions
                if len(junction.polygon) > 2
            ),
        ]
        self._shapes = shapely.buffer(np.array(shapes, dtype=object), beside)
        self._tree = shapely.STRtree(self._shapes)

    def outside(self, line: shapely.LineString) -> shapely.Geometry:
        """Give the part of a line that lies on no road."""
        return line.difference(shapely.union_all(self._shapes[self._tree.query(line)]))


def _kind(tags: Tags) -> str | None:
    """Name what a way is, if anything moves along it."""
    if "highway" in tags and tags.get("area") != "yes":
        return f"highway={tags['highway']}"
    return f"railway={tags['railway']}" if tags.get("railway") in _TRACKS else None


def _lost_issues(lost: dict[str, Left], least: float) -> Iterator[Issue]:
    for kind, left in sorted(lost.items()):
        yield loss(
            "osm.road_lost",
            f"{left.metres:.0f} m of {kind} are not built, most of them here",
            ("way", left.way), left.place,
            "look whether the road vanished in a junction; draw it in netedit if it is missing",
            severity=Severity.WARNING if left.metres > least else Severity.NOTE,
            measured=round(left.metres, 1), limit=least,
        )  # fmt: skip


def _left_out_issues(left_out: dict[str, Left]) -> Iterator[Issue]:
    for kind, left in sorted(left_out.items()):
        yield loss(
            "osm.not_imported",
            f"not imported: {counted(left.ways, 'way')} of {kind}, {left.metres:.0f} m together; the longest",
            ("way", left.way), left.place, "draw what matters to your traffic in netedit",
            severity=Severity.NOTE, measured=round(left.metres, 1),
        )  # fmt: skip
