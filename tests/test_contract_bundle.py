"""The bundle of `dojo-maps convert`, held against a separate reading of the same network."""

import copy
import hashlib
import json
import math
import re
import struct
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import jsonschema
import networks
import pytest
import shapely
from conftest import NO_GENERATED, REPOSITORY, Conversion, command_environment, dojo_maps
from oracle import ExpectedCrossing, ExpectedProgram, floor
from shapely import LineString, Polygon

pytestmark = pytest.mark.sampled(5)

FILES = {"map.json", "scene.glb", "network.net.xml", "report.json", "report.html", "overview.png"}
SEVERITIES = {"error", "warning", "note"}
ELEMENT_LISTS = {
    "lane": "lanes",
    "road": "roads",
    "connection": "connections",
    "junction": "junctions",
    "signal": "signals",
    "crossing": "crossings",
    "sidewalk": "sidewalks",
    "walking_area": "walking_areas",
    "stop_line": "stop_lines",
    "prop": "props",
}


def by_id(items: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Index a list of map.json, whose ids have to be unique."""
    repeated = [name for name, count in Counter(item["id"] for item in items).items() if count > 1]
    assert not repeated, f"ids used twice: {repeated[:5]}"
    return {item["id"]: item for item in items}


def from_network(items: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return by_id([item for item in items if item["origin"] == "network"])


def as_lists(shape: list[tuple[float, float, float]]) -> list[list[float]]:
    return [list(point) for point in shape]


@lru_cache
def map_schema() -> jsonschema.Draft202012Validator:
    schema = json.loads((REPOSITORY / "dojo_maps" / "map.schema.json").read_bytes())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_bundle_has_every_file_of_the_contract(conversion: Conversion) -> None:
    present = {path.name for path in conversion.folder.iterdir()}
    assert present >= FILES
    assert all((conversion.folder / name).stat().st_size > 0 for name in FILES)


def test_bundle_is_alone_in_its_parent_folder(conversion: Conversion) -> None:
    beside = {path.name for path in conversion.folder.parent.iterdir()}
    assert beside <= {"lock", "conversion.json", conversion.folder.name}


def test_map_json_follows_its_schema(conversion: Conversion) -> None:
    errors = sorted(map_schema().iter_errors(conversion.description), key=str)
    assert not errors, [f"{'/'.join(map(str, e.absolute_path))}: {e.message[:200]}" for e in errors[:5]]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("format",), "dojo-report"),
        (("version",), 2),
        (("lanes", 0, "width"), "3.2"),
        (("lanes", 0, "width"), -1.0),
        (("lanes", 0, "kind"), "carriageway"),
        (("lanes", 0, "shape"), [[0.0, 1.0]]),
        (("left_hand",), 0),
        (("origin",), [0.0]),
        (("roads",), None),
    ],
)
def test_map_schema_refuses_a_wrong_value(
    path: tuple[Any, ...], value: Any, converted: Callable[..., Conversion]
) -> None:
    description = copy.deepcopy(converted("bare").description)
    *parents, last = path
    place = description
    for key in parents:
        place = place[key]
    place[last] = value
    assert list(map_schema().iter_errors(description))


@pytest.mark.parametrize("key", ["format", "version", "lanes", "signals", "props", "source", "projection"])
def test_map_schema_refuses_a_missing_field(key: str, converted: Callable[..., Conversion]) -> None:
    description = copy.deepcopy(converted("bare").description)
    del description[key]
    assert list(map_schema().iter_errors(description))


def test_map_head_agrees_with_network(conversion: Conversion) -> None:
    description, expected = conversion.description, conversion.expected
    assert (description["format"], description["version"]) == ("dojo-map", 1)
    assert description["left_hand"] is expected.left_hand
    assert description["projection"]["net_offset"] == list(expected.net_offset)
    assert (description["projection"]["proj"] is None) == (expected.projection is None)
    (west, south), (east, north) = description["bounds"]
    points = [point for lane in expected.lanes.values() for point in lane.shape]
    assert all(west - 0.01 <= x <= east + 0.01 and south - 0.01 <= y <= north + 0.01 for x, y, _ in points)
    x, y = description["origin"]
    assert west <= x <= east
    assert south <= y <= north


def test_map_source_names_the_input(conversion: Conversion) -> None:
    source, path = conversion.description["source"], Path(conversion.network)
    assert source["kind"] == "sumo"
    assert Path(source["file"]).name == path.name
    assert source["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()


def test_roads_are_the_normal_edges(conversion: Conversion) -> None:
    expected = conversion.expected
    roads = by_id(conversion.description["roads"])
    assert list(roads) == list(expected.edges)
    for edge_id, edge in expected.edges.items():
        road = roads[edge_id]
        lanes = sorted((x for x in expected.lanes.values() if x.edge == edge_id), key=lambda x: x.index)
        assert road["lanes"] == [lane.id for lane in lanes]
        assert (road["from"], road["to"]) == (edge["from"], edge["to"])
        assert road["name"] == edge.get("name", "")
        assert road["kind"] == edge.get("type", "")
        assert "priority" not in edge or road["priority"] == int(edge["priority"])


def test_lanes_equal_the_network_exactly(conversion: Conversion) -> None:
    expected = conversion.expected.lanes
    lanes = by_id(conversion.description["lanes"])
    assert set(lanes) == set(expected)
    for lane_id, lane in expected.items():
        found = lanes[lane_id]
        assert (found["road"], found["index"]) == (lane.edge, lane.index), lane_id
        assert (found["width"], found["speed"], found["length"]) == (lane.width, lane.speed, lane.length)
        assert found["shape"] == as_lists(lane.shape), lane_id


def test_lane_permissions_and_kinds_agree_with_network(conversion: Conversion) -> None:
    lanes = by_id(conversion.description["lanes"])
    for lane_id, lane in conversion.expected.lanes.items():
        assert len(lanes[lane_id]["allow"]) == len(set(lanes[lane_id]["allow"])), lane_id
        assert set(lanes[lane_id]["allow"]) == lane.allow, lane_id
        assert lanes[lane_id]["kind"] in lane.kinds, lane_id


def test_connections_are_each_there_once_with_via_and_signal(conversion: Conversion) -> None:
    expected = Counter(
        (c.from_lane, c.to_lane, c.via, c.direction, c.state, c.signal, c.link_index)
        for c in conversion.expected.connections
    )
    found = Counter(
        (c["from"], c["to"], tuple(c["via"]), c["direction"], c["state"], c["signal"], c["link_index"])
        for c in conversion.description["connections"]
    )
    assert not found - expected, f"not in the network: {list(found - expected)[:3]}"
    assert not expected - found, f"missing: {list(expected - found)[:3]}"


def test_connection_shapes_run_from_lane_to_lane(conversion: Conversion) -> None:
    lanes = conversion.expected.lanes
    for link in conversion.description["connections"]:
        name = f"{link['from']}->{link['to']}"
        assert len(link["shape"]) >= 2, name
        # Real networks have small gaps between a lane and its internal lanes; a shape the wrong way round
        # or of another connection is off by the size of a junction.
        gap_limit = 8.0 if link["via"] else 1e-6
        assert math.dist(link["shape"][0], lanes[link["from"]].shape[-1]) <= gap_limit, name
        assert math.dist(link["shape"][-1], lanes[link["to"]].shape[0]) <= gap_limit, name


def test_junctions_equal_the_network(conversion: Conversion) -> None:
    expected = conversion.expected
    junctions = by_id(conversion.description["junctions"])
    assert set(junctions) == set(expected.junctions)
    for junction_id, junction in expected.junctions.items():
        found = junctions[junction_id]
        assert found["kind"] == junction.kind, junction_id
        assert found["position"] == list(junction.position), junction_id
        assert found["polygon"] == as_lists(junction.shape), junction_id
        incoming = {edge for edge, attributes in expected.edges.items() if attributes["to"] == junction_id}
        outgoing = {edge for edge, attributes in expected.edges.items() if attributes["from"] == junction_id}
        assert Counter(found["incoming"]) == Counter(incoming), junction_id
        assert Counter(found["outgoing"]) == Counter(outgoing), junction_id


def test_network_sidewalks_are_the_pedestrian_lanes(conversion: Conversion) -> None:
    expected = Counter(lane.edge for lane in conversion.expected.lanes.values() if lane.is_sidewalk)
    found = Counter(item["road"] for item in from_network(conversion.description["sidewalks"]).values())
    assert found == expected


def _crossing_areas(crossing: ExpectedCrossing) -> list[shapely.Geometry]:
    line = LineString([point[:2] for point in crossing.shape])
    return [floor(crossing.outline), line.buffer(crossing.width / 2, cap_style="flat")]


def test_network_crossings_equal_the_network(conversion: Conversion) -> None:
    expected = conversion.expected
    crossings = from_network(conversion.description["crossings"])
    assert set(crossings) == set(expected.crossings)
    for crossing_id, crossing in expected.crossings.items():
        found = crossings[crossing_id]
        assert set(found["roads"]) == crossing.roads, crossing_id
        assert (found["width"], found["shape"]) == (crossing.width, as_lists(crossing.shape)), crossing_id
        assert (found["signal"], found["link_index"]) == (crossing.signal, crossing.link_index), crossing_id
        assert crossing_id.startswith(f":{found['junction']}_c"), crossing_id
        area = floor([tuple(point) for point in found["polygon"]])
        agreement = [
            area.intersection(other).area / area.union(other).area for other in _crossing_areas(crossing)
        ]
        assert max(agreement) > 0.9, crossing_id


def test_network_walking_areas_equal_the_network(conversion: Conversion) -> None:
    expected = conversion.expected.walking_areas
    found = from_network(conversion.description["walking_areas"])
    assert {name: item["polygon"] for name, item in found.items()} == {
        name: as_lists(shape) for name, shape in expected.items()
    }
    assert all(name.startswith(f":{item['junction']}_w") for name, item in found.items())


def _same_program(found: dict[str, Any], program: ExpectedProgram) -> bool:
    head = (found["id"], found["kind"], found["offset"]) == (program.id, program.kind, program.offset)
    phases = len(found["phases"]) == len(program.phases)
    for phase, (duration, least, most, state) in zip(found["phases"], program.phases, strict=False):
        phases &= (phase["duration"], phase["state"]) == (duration, state)
        # Where the network gives no limit, the phase's own duration is one; leaving it out is as good.
        phases &= phase["min_duration"] in ([least] if least is not None else [None, duration])
        phases &= phase["max_duration"] in ([most] if most is not None else [None, duration])
    return head and phases


def test_signal_programs_equal_the_network(conversion: Conversion) -> None:
    expected = conversion.expected
    signals = by_id(conversion.description["signals"])
    assert set(signals) >= set(expected.programs)
    controllers = {link.signal for link in expected.connections}
    controllers |= {crossing.signal for crossing in expected.crossings.values()}
    assert set(signals) <= set(expected.programs) | controllers
    for signal_id, signal in signals.items():
        programs = expected.programs.get(signal_id, [])
        assert len(signal["programs"]) == len(programs), signal_id
        for found, program in zip(signal["programs"], programs, strict=True):
            assert _same_program(found, program), (signal_id, found, program)


def test_signal_links_are_the_controlled_connections_and_crossings(conversion: Conversion) -> None:
    expected = conversion.expected
    signals = by_id(conversion.description["signals"])
    vehicles = {
        (c.signal, c.link_index, c.from_lane, c.to_lane, c.direction)
        for c in expected.connections
        if c.signal in signals
    }
    walkers = {(c.signal, c.link_index) for c in expected.crossings.values() if c.signal in signals}
    links = [(signal, link) for signal, item in signals.items() for link in item["links"]]
    assert {
        (signal, link["index"], link["from"], link["to"], link["direction"])
        for signal, link in links
        if link["kind"] == "vehicle"
    } == vehicles
    assert {(signal, link["index"]) for signal, link in links if link["kind"] == "pedestrian"} == walkers


def test_every_reference_in_the_map_names_something(conversion: Conversion) -> None:
    description = conversion.description
    lanes, roads = by_id(description["lanes"]), by_id(description["roads"])
    junctions, signals = by_id(description["junctions"]), by_id(description["signals"])
    assert {road[end] for road in roads.values() for end in ("from", "to")} <= set(junctions)
    assert {lane["road"] for lane in lanes.values()} == set(roads)
    assert {line["lane"] for line in description["stop_lines"]} <= set(lanes)
    assert {item["road"] for item in description["sidewalks"]} - {None} <= set(roads)
    assert {road for item in description["crossings"] for road in item["roads"]} <= set(roads)
    for items in (description["crossings"], description["walking_areas"]):
        assert {item["junction"] for item in items} <= set(junctions)
    linked = [*description["crossings"], *description["connections"]]
    assert {item["signal"] for item in linked} - {None} <= set(signals)
    for signal in signals.values():
        assert signal["junctions"], signal["id"]
        assert set(signal["junctions"]) <= set(junctions)


def test_network_file_is_the_input_byte_for_byte(
    conversion: Conversion, plain_conversion: Conversion
) -> None:
    expected = networks.read_network_bytes(Path(conversion.network))
    assert (conversion.folder / "network.net.xml").read_bytes() == expected
    assert (plain_conversion.folder / "network.net.xml").read_bytes() == expected


def test_generated_things_leave_the_rest_of_the_map_alone(
    conversion: Conversion, plain_conversion: Conversion
) -> None:
    enriched, plain = conversion.description, plain_conversion.description
    for name in ("roads", "lanes", "connections", "junctions", "projection", "origin", "bounds", "source"):
        assert enriched[name] == plain[name], name
    for name in ("sidewalks", "crossings", "walking_areas"):
        assert from_network(enriched[name]) == by_id(plain[name]), name
        assert all(item["origin"] == "network" for item in plain[name]), name
    for one, other in zip(enriched["signals"], plain["signals"], strict=True):
        assert one["programs"] == other["programs"]


def test_report_follows_its_format(conversion: Conversion) -> None:
    report = conversion.report
    assert (report["format"], report["version"]) == ("dojo-report", 1)
    assert report["map"]
    assert set(report["counts"]) == SEVERITIES
    assert report["counts"] == {
        severity: sum(issue["severity"] == severity for issue in report["issues"]) for severity in SEVERITIES
    }
    checks = by_id(report["checks"])
    for check_id, check in checks.items():
        assert re.fullmatch(r"(geometry|topology|signals|pedestrians|osm|sumo)\.[a-z0-9_]+", check_id)
        assert check["title"]
        assert check["status"] in {"completed", "skipped", "crashed"}
        assert check["count"] == sum(issue["check"] == check_id for issue in report["issues"])
    assert all(issue["check"] in checks for issue in report["issues"])


def test_report_issues_name_elements_of_the_map(conversion: Conversion) -> None:
    description, report = conversion.description, conversion.report
    known = {kind: {item.get("id") for item in description[name]} for kind, name in ELEMENT_LISTS.items()}
    known["connection"] = {f"{link['from']}->{link['to']}" for link in description["connections"]}
    known["stop_line"] = {line["lane"] for line in description["stop_lines"]}
    for issue in report["issues"]:
        assert {"message", "measured", "limit", "hint"} <= set(issue)
        assert issue["message"]
        assert issue["elements"]
        assert all(element["id"] in known[element["kind"]] for element in issue["elements"]), issue
        assert len(issue["position"]) == 3
        assert all(math.isfinite(value) for value in issue["position"])
        assert (issue["lonlat"] is None) == (description["projection"]["proj"] is None)


def test_report_page_works_offline(conversion: Conversion) -> None:
    page = (conversion.folder / "report.html").read_text(encoding="utf-8")
    assert "<html" in page.lower()
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)
    assert not re.findall(r"""@import|url\(\s*["']?(?:https?:)?//""", page)


def test_report_page_escapes_names_from_the_network(converted: Callable[..., Conversion]) -> None:
    page = (converted("strange_names").folder / "report.html").read_text(encoding="utf-8")
    assert "<script>alert(1)</script>" not in page
    assert "Söhne <b>" not in page


def test_exit_status_agrees_with_report(conversion: Conversion) -> None:
    assert conversion.status == (1 if conversion.report["counts"]["error"] else 0)
    assert "Traceback" not in conversion.stderr


def _read_png_size(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    assert data[-8:-4] == b"IEND"
    return struct.unpack(">II", data[16:24])


def test_overview_is_1600_pixels_on_its_longer_side(conversion: Conversion) -> None:
    width, height = _read_png_size(conversion.folder / "overview.png")
    assert max(width, height) == 1600
    (west, south), (east, north) = conversion.description["bounds"]
    wide, tall = east - west, north - south
    # A frame around the map, or a least size of a very long one, may change the proportions a little.
    if 0.2 < wide / tall < 5:
        assert (width / height) == pytest.approx(wide / tall, rel=0.35)


@pytest.mark.slow
@pytest.mark.sampled(2)
def test_second_conversion_gives_the_same_bytes(conversion: Conversion, tmp_path: Path) -> None:
    if any(name in conversion.network for name in ("DRT", "ingolstadt21")):
        pytest.skip("tested on networks that take less time")
    again = tmp_path / "elsewhere" / "again.dojo"
    again.parent.mkdir()
    environment = command_environment(PYTHONHASHSEED="4711", TZ="Asia/Tokyo", LC_ALL="C")
    command = [sys.executable, "-m", "dojo_maps", "convert", conversion.network, "-o", again]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == conversion.status
    files = sorted(path.relative_to(conversion.folder) for path in conversion.folder.rglob("*"))
    assert sorted(path.relative_to(again) for path in again.rglob("*")) == files
    for name in files:
        if (again / name).is_file():
            assert (again / name).read_bytes() == (conversion.folder / name).read_bytes(), name


def test_packaged_scenario_can_be_named_instead_of_a_path(
    converted: Callable[..., Conversion], tmp_path: Path
) -> None:
    done = dojo_maps("convert", "cologne1", cwd=tmp_path)
    assert done.returncode in {0, 1}
    by_path = converted("cologne1").folder
    for name in ("map.json", "scene.glb", "network.net.xml"):
        assert (tmp_path / "cologne1.dojo" / name).read_bytes() == (by_path / name).read_bytes()


@pytest.mark.parametrize(
    "name", ["cologne3", "cologne8", "ingolstadt1", "ingolstadt7", "ingolstadt21", "grid4x4", "arterial4x4"]
)
def test_every_benchmark_scenario_has_its_name(name: str, tmp_path: Path) -> None:
    # The output's parent is missing, so a known name stops at the output and an unknown one at the input.
    known = dojo_maps("convert", name, "-o", tmp_path / "missing" / "out.dojo")
    unknown = dojo_maps("convert", f"{name}x", "-o", tmp_path / "out.dojo")
    assert (known.returncode, unknown.returncode) == (2, 3)


def test_default_output_is_the_inputs_name(network_path: Callable[[str], Path], tmp_path: Path) -> None:
    (tmp_path / "corner.net.xml").write_bytes(network_path("bare").read_bytes())
    done = dojo_maps("convert", "corner.net.xml", NO_GENERATED, cwd=tmp_path)
    assert done.returncode in {0, 1}
    assert {path.name for path in tmp_path.iterdir()} == {"corner.net.xml", "corner.dojo"}


def test_second_conversion_replaces_the_bundle(
    converted: Callable[..., Conversion], network_path: Callable[[str], Path], tmp_path: Path
) -> None:
    bundle = tmp_path / "map.dojo"
    for name in ("village", "bare"):
        assert dojo_maps("convert", network_path(name), "-o", bundle).returncode in {0, 1}
    fresh = converted("bare").folder
    assert {path.name for path in bundle.iterdir()} == {path.name for path in fresh.iterdir()}
    assert (bundle / "scene.glb").read_bytes() == (fresh / "scene.glb").read_bytes()


def test_far_away_network_keeps_millimetres(converted: Callable[..., Conversion]) -> None:
    near, far = converted("bare", NO_GENERATED).scene, converted("far_away", NO_GENERATED).scene
    for layer in ("road", "junction", "marking"):
        here, there = near.tops(layer), far.tops(layer)
        assert there.total_area == pytest.approx(here.total_area, rel=1e-3), layer
        assert there.union.symmetric_difference(here.union).area < 1e-3 * here.total_area, layer


def test_polygons_have_an_area_where_the_map_generated_them(conversion: Conversion) -> None:
    description = conversion.description
    for name in ("sidewalks", "crossings", "walking_areas"):
        for item in description[name]:
            if item["origin"] == "generated":
                ring = Polygon([point[:2] for point in item["polygon"]])
                assert ring.is_valid, item["id"]
                assert ring.area > 0.01, item["id"]
