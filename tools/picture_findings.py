"""Draw what the validator finds: a picture of the first finding of each check, cut from the converted map.

    python tools/picture_findings.py FOLDER NETWORK ... [--severity error] [--check ID]

The elements of the finding are outlined, the one at fault in red. Pictures are called NETWORK-CHECK.png.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely

from dojo_maps import convert
from dojo_maps.description import RoadMap
from dojo_maps.errors import WriteError
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.report.overview import draw_overview
from dojo_maps.sources.files import find_network

_SIZE = 360
_LEAST, _MOST = 12.0, 60.0
"""Metres from a picture's middle to its sides."""
_RED, _OTHER = (40, 40, 220), (230, 140, 30)


def draw(road_map: RoadMap, meshes: tuple[Mesh, ...], issue: dict[str, Any], path: Path) -> None:
    """Draw a finding and its surroundings, north up."""
    middle = np.array(issue["position"][:2])
    shapes = [(k, shape) for k, e in enumerate(issue["elements"]) for shape in outline(road_map, e)]
    reach = [np.abs(np.array(shape.bounds).reshape(2, 2) - middle).max() for k, shape in shapes if k == 0]
    half = float(np.clip(max(reach, default=0.0) * 1.1, _LEAST, _MOST))
    window = (tuple(middle - half), tuple(middle + half))
    draw_overview(replace(road_map, bounds=window), meshes, path)
    picture = cv2.resize(cv2.imread(str(path)), (_SIZE, _SIZE), interpolation=cv2.INTER_AREA)
    margin = max(5.0, 0.04 * half)
    scale = _SIZE / (2 * (half + margin))
    for k, shape in reversed(shapes):
        for line in lines_of(shape):
            pixels = (np.array(line.coords)[:, :2] - middle) * [scale, -scale] + _SIZE / 2
            points = np.round(pixels * 16).astype(np.int32)
            cv2.polylines(picture, [points], False, _OTHER if k else _RED, 2, cv2.LINE_AA, 4)
    cv2.circle(picture, (_SIZE // 2, _SIZE // 2), 5, _RED, -1, cv2.LINE_AA)
    if not cv2.imwrite(str(path), picture // 16 * 16 + 8, [cv2.IMWRITE_PNG_COMPRESSION, 9]):
        raise WriteError(f"{path}: cannot be written; is the disk full?")


def outline(road_map: RoadMap, element: dict[str, str]) -> Iterator[shapely.Geometry]:
    """Outline what an element names, if it has a place."""
    kind, id_ = element["kind"], element["id"]
    if kind == "lane":
        yield from lane_strips([lane for lane in road_map.lanes if lane.id == id_])
    elif kind == "road":
        yield from lane_strips([lane for lane in road_map.lanes if lane.road == id_])
    elif kind == "connection":
        yield from (shapely.LineString(c.shape[:, :2]) for c in road_map.connections if c.id == id_)
    elif kind in ("junction", "crossing", "walking_area"):
        things = {"junction": road_map.junctions, "crossing": road_map.crossings}.get(
            kind, road_map.walking_areas
        )
        rings = [thing.polygon[:, :2] for thing in things if thing.id == id_ and len(thing.polygon) > 2]
        yield from map(shapely.LinearRing, rings)


def lines_of(shape: shapely.Geometry) -> Iterator[shapely.Geometry]:
    """List the lines to draw for a shape."""
    for part in shapely.get_parts(shape):
        yield part.exterior if part.geom_type == "Polygon" else part


def main() -> int:
    """Draw a picture for each network and check, and list what was found as rows of a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("networks", nargs="+", metavar="NETWORK")
    parser.add_argument("--severity", default="error")
    parser.add_argument("--check", default="")
    parser.add_argument("--most", type=int, default=1, help="pictures per network and check")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for network in options.networks:
        path, _ = find_network(network)
        stem, above = path.name.split(".")[0], path.parent.name
        label = stem if stem == above else f"{above}-{stem}"
        with tempfile.TemporaryDirectory() as folder:
            bundle, report = convert(network, Path(folder) / "map.dojo")
            meshes, drawn = bundle.read_meshes(), dict[str, int]()
            for issue in report["issues"]:
                check = issue["check"]
                if issue["severity"] != options.severity or options.check not in check:
                    continue
                count = drawn[check] = drawn.get(check, 0) + 1
                if count <= options.most:
                    name = f"{label}-{check}{f'-{count}' if count > 1 else ''}.png"
                    draw(bundle.road_map, meshes, issue, options.folder / name)
                    print(f"{name}: {issue['message']}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
