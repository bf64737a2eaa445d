"""A network as netconvert built it, with all that it was built from."""

from dataclasses import dataclass

from dojo_maps.description import RoadMap
from dojo_maps.issue import Issue
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.plain.plain_xml import Plain
from dojo_maps.sources.osm.read.restrictions import Restriction


@dataclass(frozen=True, slots=True, kw_only=True)
class OsmNetwork:
    """A built network and what it was built from.

    Attributes:
        data: the network's bytes.
        warnings: netconvert's own.
    """

    data: bytes
    road_map: RoadMap
    layout: Layout
    plain: Plain
    restrictions: tuple[Restriction, ...]
    issues: tuple[Issue, ...]
    warnings: tuple[str, ...]
