"""Cut the surroundings of a point out of any file of OpenStreetMap data.

    python cut.py finland-latest.osm.pbf junction.osm --point 60.16989,24.93852 --radius 120

Roads are cut off outside of the circle; buildings and parks stay whole. Turn restrictions are kept.
"""

import argparse
import math
import sys
from pathlib import Path

import osmium

AREAS = ("building", "natural", "landuse", "leisure", "waterway")
LINES = ("highway", "railway", "footway", "barrier")
RELATIONS = ("restriction", "multipolygon")


def cut_around(source: Path, target: Path, latitude: float, longitude: float, radius: float) -> None:
    """Write what lies within `radius` metres of a point, in degrees, into a new file."""
    inside, outside = find_nodes(source, latitude, longitude, radius)
    ways = find_ways(source, inside, outside)
    relations = {
        thing.id
        for thing in osmium.FileProcessor(str(source), osmium.osm.RELATION)
        if thing.tags.get("type", "").split(":")[0] in RELATIONS and has_members(thing, ways)
    }
    wanted = inside.union(*ways.values())
    target.unlink(missing_ok=True)
    with osmium.SimpleWriter(str(target)) as writer:
        for thing in osmium.FileProcessor(str(source)):
            if thing.is_node() and thing.id in wanted:
                writer.add_node(thing)
            elif thing.is_way() and thing.id in ways:
                writer.add_way(thing.replace(nodes=ways[thing.id]))
            elif thing.is_relation() and thing.id in relations:
                writer.add_relation(thing)


def find_nodes(source: Path, latitude: float, longitude: float, radius: float) -> tuple[set[int], set[int]]:
    """List the nodes within the circle, and all others."""
    inside, outside = set(), set()
    metres = math.radians(1) * 6_371_000
    shrink = math.cos(math.radians(latitude))
    for node in osmium.FileProcessor(str(source), osmium.osm.NODE):
        north, east = node.lat - latitude, (node.lon - longitude) * shrink
        (inside if math.hypot(north, east) * metres <= radius else outside).add(node.id)
    return inside, outside


def find_ways(source: Path, inside: set[int], outside: set[int]) -> dict[int, list[int]]:
    """List the ways that come into the circle, with the nodes to keep: one more where a road leaves it."""
    ways = {}
    for way in osmium.FileProcessor(str(source), osmium.osm.WAY):
        nodes = [node.ref for node in way.nodes]
        hits = [k for k, node in enumerate(nodes) if node in inside]
        if not hits:
            continue
        if any(key in way.tags for key in LINES) and nodes[0] != nodes[-1]:
            nodes = nodes[max(0, hits[0] - 1) : hits[-1] + 2]
        if any(key in way.tags for key in (*LINES, *AREAS)) or not len(way.tags):
            ways[way.id] = [node for node in nodes if node in inside or node in outside]
    return ways


def has_members(relation: osmium.osm.Relation, ways: dict[int, list[int]]) -> bool:
    """Tell whether all ways of a relation are kept."""
    members = [member.ref for member in relation.members if member.type == "w"]
    return bool(members) and all(member in ways for member in members)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", type=Path, metavar="FILE")
    parser.add_argument("target", type=Path, metavar="OSM_FILE")
    parser.add_argument("--point", required=True, metavar="LAT,LON")
    parser.add_argument("--radius", type=float, default=120.0, metavar="M")
    options = parser.parse_args()
    latitude, longitude = map(float, options.point.split(","))
    cut_around(options.source, options.target, latitude, longitude, options.radius)


if __name__ == "__main__":
    sys.exit(main())
