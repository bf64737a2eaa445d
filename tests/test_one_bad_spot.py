"""One bad spot costs that spot: the rest of the network is drawn, checked and written all the same."""

import re
from collections import Counter
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from damage import network_of

import dojo_maps
from dojo_maps.description import RoadMap, points
from dojo_maps.drawing import draw
from dojo_maps.geometry.arrangement import paved_ground
from dojo_maps.geometry.pieces import Layer, Pieces
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.files import find_network
from dojo_maps.sources.sumo_net import read_network


def lane_of(**values: str) -> bytes:
    """A network of one road, whose lane has these attributes."""
    plain = {"id": "e0_0", "index": "0", "speed": "13", "length": "100", "shape": "0,0 100,0"}
    written = " ".join(f'{key}="{value}"' for key, value in (plain | values).items())
    return network_of("X").replace(b'id="e0_0" index="0" speed="13" length="9" shape="X"', written.encode())


def convert(data: bytes, folder: Path) -> tuple[dojo_maps.Bundle, dict[str, Any]]:
    network = folder / "x.net.xml"
    network.write_bytes(data)
    return dojo_maps.convert(str(network), folder / "x.dojo")


@pytest.mark.parametrize(
    ("values", "key", "wanted"),
    [
        ({"width": "-1"}, "width", 3.2),
        ({"width": "0"}, "width", 3.2),
        ({"width": "1e9"}, "width", 3.2),
        ({"width": "nan"}, "width", 3.2),
        ({"speed": "-5"}, "speed", 13.89),
        ({"length": "-1"}, "length", 100.0),
        ({"index": "7"}, "index", 0),
        ({"shape": "0,0 nan,1 50,0"}, "shape", [[0, 0, 0], [50, 0, 0]]),
        ({"shape": "0,0 1e7,1 50,0"}, "shape", [[0, 0, 0], [50, 0, 0]]),
        ({"shape": "0,0,1e6 50,0"}, "shape", [[0, 0, 0], [50, 0, 0]]),
        ({"shape": "nan,0 inf,0"}, "shape", [[0, 0, 0], [0, 0, 0]]),
    ],
)
def test_a_value_that_cannot_be_drawn_is_replaced_and_reported(
    values: dict[str, str], key: str, wanted: object
) -> None:
    road_map, issues = read_network(lane_of(**values), path=Path("x"), name="x", sha256="")
    found = getattr(road_map.lanes[0], key)
    assert (found.tolist() if key == "shape" else found) == wanted
    (issue,) = issues
    assert issue.check == "geometry.unusable_value"
    assert [(e.kind, e.id) for e in issue.elements] == [("lane", "e0_0")]
    assert key in issue.message


def test_a_network_far_from_its_projection_s_origin_is_read() -> None:
    data = lane_of().replace(b"<edge", b'<location netOffset="0.00,-1630289528.00"/><edge', 1)
    road_map, issues = read_network(data, path=Path("x"), name="x", sha256="")
    assert road_map.projection.net_offset == (0.0, -1630289528.0)
    assert not issues


def test_lanes_on_one_place_at_two_heights_are_drawn(tmp_path: Path) -> None:
    lane = '<lane id="e0_1" index="1" speed="13" length="9" shape="0,-3 100,-3"/></edge>'
    data = network_of("0,-4.8 100,-4.8,8").replace(b"</edge>", lane.encode(), 1)
    bundle, report = convert(data, tmp_path)
    drawn = {id_ for mesh in bundle.read_meshes() if mesh.layer == "road" for id_ in mesh.ids}
    assert drawn == {"e0_0", "e0_1"}
    assert not [check for check in report["checks"] if check["status"] == "crashed"]


def test_a_network_without_any_ground_is_written(tmp_path: Path) -> None:
    bundle, report = convert(network_of("0,0 0,0", floor="").replace(b"100,0 101,0 101,1", b""), tmp_path)
    assert {mesh.layer for mesh in bundle.read_meshes()} == {"terrain"}
    assert not [check for check in report["checks"] if check["status"] == "crashed"]


def test_joined_ground_holds_no_lines() -> None:
    strip = "39.504 80.807, 39.296 77.613, 18.824 78.942, 4.461 76.847, 3.999 80.013, 18.696 82.158"
    floor = (
        "3.21 72.75, 2.17 72.98, 1.8 73.06, 1.43 73.14, 0.98 73.2, 0.37 73.25, 0.85 79.63, 2.22 79.63, "
        "2.69 79.71, 3.17 79.82, 3.75 79.95, 4.53 80.09"
    )
    polygons = [
        shapely.Polygon([tuple(map(float, p.split())) for p in ring.split(",")]) for ring in (strip, floor)
    ]
    nothing = np.empty(0, dtype=object)
    pieces = Pieces(
        polygons=np.array(polygons, dtype=object),
        layers=(Layer.ROAD, Layer.JUNCTION),
        ids=("lane", "junction"),
        lines=tuple(np.zeros((2, 3)) for _ in polygons),
        flush=(False, False),
        paved=2,
        mouths=nothing,
        cuts=nothing,
    )
    assert paved_ground(pieces).geom_type == "MultiPolygon"


def broken_at(road_map: RoadMap, junctions: Collection[str]) -> RoadMap:
    """Take the last corner of some junctions to where no geometry is."""
    nowhere = [[np.nan] * 3]
    return replace(
        road_map,
        junctions=tuple(
            replace(j, polygon=points(np.vstack([j.polygon[:-1], nowhere]))) if j.id in junctions else j
            for j in road_map.junctions
        ),
    )


def faces_by_source(meshes: Collection[Any]) -> Counter[tuple[str, str]]:
    return Counter((mesh.name, mesh.ids[source]) for mesh in meshes for source in mesh.sources)


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("count", [1, 3])
def test_junctions_that_cannot_be_cut_cost_these_junctions_only(count: int) -> None:
    path, name = find_network("cologne1")
    road_map, _ = read_network(read_bytes(path), path=path, name=name, sha256="")
    broken = [junction.id for junction in road_map.junctions if len(junction.polygon) > 2][:count]
    bare = {j.id: points([]) if j.id in broken else j.polygon for j in road_map.junctions}
    without = replace(road_map, junctions=tuple(replace(j, polygon=bare[j.id]) for j in road_map.junctions))
    _, expected, _ = draw(without)
    drawn, meshes, issues = draw(broken_at(road_map, broken))
    assert faces_by_source(meshes) == faces_by_source(expected)
    assert [(issue.check, issue.elements[0].id) for issue in issues] == [
        ("geometry.uncut_surface", junction) for junction in broken
    ]
    assert len(drawn.junctions[0].polygon) == len(road_map.junctions[0].polygon)


def test_a_crossing_of_one_position_costs_its_bars(network_path: Any, tmp_path: Path) -> None:
    good = network_path("walkers_signal").read_text()
    crossing = re.search(r'<lane id="(:\w+_c0)_0"[^>]* (shape="[^"]*")', good)
    data = good.replace(crossing[0], crossing[0].replace(crossing[2], 'shape="0,0"')).encode()
    _, report = convert(data, tmp_path)
    named = {
        e["id"] for i in report["issues"] for e in i["elements"] if i["check"].startswith("geometry.unc")
    }
    assert named == {crossing[1]}
