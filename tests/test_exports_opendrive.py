"""OpenDRIVE: clean by ASAM's own checker, read back by netconvert; and the table of all exporters."""

import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from conftest import command_environment

from dojo_maps.description import Origin, RoadMap
from dojo_maps.drawing import draw
from dojo_maps.exports import EXPORTERS, file_stem
from dojo_maps.exports.reference_lines import ReferenceLine, curve, unit
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.files import find_network
from dojo_maps.sources.netconvert import run_netconvert
from dojo_maps.sources.sumo_net import read_network


def _read(network: str | Path) -> RoadMap:
    path, name = find_network(str(network))
    return read_network(read_bytes(path), path=path, name=name, sha256="")[0]


def _export(road_map: RoadMap, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    EXPORTERS["opendrive"](road_map, folder)
    (written,) = folder.iterdir()
    return written


def _parse(path: Path) -> ET.Element:
    return ET.parse(path).getroot()  # noqa: S314 (our own)


def _sumo_ids(elements) -> set[str]:
    return {element.find("userData[@code='sumoId']").get("value") for element in elements}


def _asam_issues(path: Path) -> list[str]:
    """What ASAM's checker says; a program of its own, because it asks for an older numpy than we do."""
    checker = shutil.which("qc_opendrive")
    if checker is None:
        pytest.skip("ASAM's checker is not installed; `pipx install asam-qc-opendrive`")
    result, config = path.parent / "result.xqar", path.parent / "config.xml"
    config.write_text(
        f'<Config><Param name="InputFile" value="{path}"/><CheckerBundle application="xodrBundle">'
        f'<Param name="resultFile" value="{result}"/></CheckerBundle></Config>',
        encoding="utf-8",
    )
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    subprocess.run([checker, "-c", config], env=environment, capture_output=True, check=True, cwd=path.parent)
    checkers = list(_parse(result).iter("Checker"))
    assert sum(one.get("status") == "completed" for one in checkers) > 20
    assert not [one.get("checkerId") for one in checkers if one.get("status") == "error"]
    return [f"{one.get('ruleUID')}: {one.get('description')}" for one in _parse(result).iter("Issue")]


@pytest.mark.sampled(6)
def test_write_opendrive_passes_asam_s_checker(network, network_path, tmp_path):
    road_map = _read(network_path(network))
    assert _asam_issues(_export(draw(road_map)[0], tmp_path / "out")) == []


@pytest.mark.parametrize("name", ["cologne1", "left_hand_bare", "rail-net"])
def test_write_opendrive_keeps_every_lane_in_its_place(network_path, tmp_path, name):
    road_map = _read(network_path(name))
    written = _export(road_map, tmp_path / "out")
    assert written.name == f"{road_map.name}.xodr"
    roads = _parse(written).findall("road[@junction='-1']")
    assert _sumo_ids(roads) == {road.id for road in road_map.roads}
    assert _sumo_ids(lane for r in roads for lane in r.iter("lane") if lane.get("id") != "0") == {
        lane.id for lane in road_map.lanes
    }
    options = ["--opendrive-files", str(written), "--opendrive.import-all-lanes", "-o", "back.net.xml"]
    run_netconvert(options, folder=tmp_path)
    back = _read(tmp_path / "back.net.xml")
    shift = np.array(back.projection.net_offset) - road_map.projection.net_offset
    lines = [shapely.LineString(lane.shape[:, :2] - shift) for lane in back.lanes]
    for lane in road_map.lanes:
        middle = shapely.LineString(lane.shape[:, :2]).interpolate(0.5, normalized=True)
        assert min(line.distance(middle) for line in lines) < 0.05


def test_write_opendrive_writes_the_same_bytes_again(tmp_path):
    road_map = _read("cologne1")
    first = _export(road_map, tmp_path / "one").read_bytes()
    assert _export(road_map, tmp_path / "two").read_bytes() == first
    assert str(tmp_path).encode() not in first


@pytest.mark.parametrize(
    ("name", "rule", "side"), [("left_hand", "LHT", "left"), ("right_hand", "RHT", "right")]
)
def test_write_opendrive_puts_traffic_on_its_side(network_path, tmp_path, name, rule, side):
    root = _parse(_export(_read(network_path(name)), tmp_path / "out"))
    assert {road.get("rule") for road in root.iterfind("road")} == {rule}
    lanes = root.findall(f".//laneSection/{side}/lane")
    assert len(lanes) == len(root.findall(".//lane")) - len(root.findall("road"))
    assert {int(lane.get("id")) > 0 for lane in lanes} == {side == "left"}


def test_write_opendrive_links_each_connection_and_says_who_yields(network_path, tmp_path):
    road_map = _read(network_path("village"))
    root = _parse(_export(road_map, tmp_path / "out"))
    lane_of = {}
    for road in root.iterfind("road[@junction='-1']"):
        for lane in road.iter("lane"):
            for name in lane.iterfind("userData"):
                lane_of[road.get("id"), lane.get("id")] = name.get("value")
    found, number_of = set(), {}
    for connection in root.iterfind("junction/connection"):
        road = root.find(f"road[@id='{connection.get('connectingRoad')}']")
        ends = [road.find(f"link/{tag}").get("elementId") for tag in ("predecessor", "successor")]
        lanes = [road.find(f".//lane/link/{tag}").get("id") for tag in ("predecessor", "successor")]
        link = "->".join(lane_of[end] for end in zip(ends, lanes, strict=True))
        found.add(link)
        number_of[link] = road.get("id")
    assert found == {connection.id for connection in road_map.connections}
    yields = {
        (number_of[j.right_of_way[k].link], number_of[way.link])
        for j in road_map.junctions
        for way in j.right_of_way
        for k in way.response
    }
    assert yields
    assert {(p.get("high"), p.get("low")) for p in root.iterfind("junction/priority")} == yields


@pytest.mark.parametrize("name", ["right_hand", "left_hand", "bare"])
def test_write_opendrive_has_the_street_s_furniture(network_path, tmp_path, name):
    road_map = _read(network_path(name))
    road_map, _, _ = draw(road_map, far_side_signals=True)
    root = _parse(_export(road_map, tmp_path / "out"))
    objects = root.findall(".//object")
    crosswalks = [o for o in objects if o.get("type") == "crosswalk"]
    assert sorted(o.get("name") for o in crosswalks) == sorted(c.id for c in road_map.crossings)
    assert crosswalks
    assert {float(o.get("length")) < float(o.get("width")) for o in crosswalks} == {True}
    stops = [o.get("name") for o in objects if o.get("subtype") == "stopLine"]
    assert sorted(stops) == sorted(line.lane for line in road_map.stop_lines)
    heads = [signal.get("id") for signal in root.iter("signal")]
    assert len(heads) == sum(len(signal.heads) for signal in road_map.signals) > 0
    far = [head.position for signal in road_map.signals for head in signal.heads if head.far_side]
    inertial = [tuple(float(p.get(axis)) for axis in "xyz") for p in root.iterfind(".//positionInertial")]
    assert np.allclose(sorted(inertial), sorted(far), atol=1e-3)
    assert far
    controlled = [control.get("signalId") for control in root.iterfind("controller/control")]
    assert sorted(controlled) == sorted(heads)
    assert root.findall("junction/controller")
    generated = [s.road for s in road_map.sidewalks if s.origin is Origin.GENERATED and s.road]
    sidewalks = [lane for lane in root.iter("lane") if lane.get("type") == "sidewalk"]
    pavement = [lane for lane in sidewalks if lane.find("userData") is None]
    assert len(pavement) == len(generated)
    widths = {float(lane.find("width").get("a")) for lane in pavement}
    # The mean along a road; around parking bays there is more of it.
    assert all(1.9 < width < 2.9 for width in widths), widths


def test_write_opendrive_outlines_a_crosswalk_where_it_lies(network_path, tmp_path):
    road_map = _read(network_path("six_legs"))
    root = _parse(_export(road_map, tmp_path / "out"))
    lines = {road.id: ReferenceLine(_innermost(road_map, road)) for road in road_map.roads}
    crossings = {crossing.id: crossing for crossing in road_map.crossings}
    for road in root.iterfind("road"):
        for crosswalk in road.iterfind("objects/object[@type='crosswalk']"):
            line = lines[road.find("userData").get("value")]
            s, t, turned = (float(crosswalk.get(key)) for key in ("s", "t", "hdg"))
            start, heading = line.beside(s, t)
            forward, left = unit(heading + turned), unit(heading + turned + np.pi / 2)
            corners = [
                start + float(corner.get("u")) * forward + float(corner.get("v")) * left
                for corner in crosswalk.iter("cornerLocal")
            ]
            outline = crossings.pop(crosswalk.get("name")).polygon[:, :2]
            np.testing.assert_allclose(corners, outline, atol=1e-5)
    assert not crossings


def _innermost(road_map, road):
    return next(lane.shape for lane in road_map.lanes if lane.id == road.lanes[-1])


def test_reference_line_rounds_corners_within_five_centimetres():
    corner = np.array([[0, 0, 0], [50, 0, 1], [50, 40, 1], [50, 40, 1], [20, 40.0005, 1]], dtype=float)
    line = ReferenceLine(corner)
    places = [line.place(s) for s in np.linspace(0, line.length, 2000)]
    path = shapely.LineString(corner[:, :2])
    assert max(path.distance(shapely.Point(position)) for position, _ in places) < 1e-6 + 0.05
    turns = np.diff(np.unwrap([heading for _, heading in places]))
    assert np.abs(turns).max() < 0.7
    np.testing.assert_allclose(places[-1][0], corner[-1, :2], atol=1e-6)
    s, t = line.locate(np.array([25.0, 3.0]))
    assert (s, t) == (pytest.approx(25.0), pytest.approx(3.0))
    assert line.height(25.0) == pytest.approx(0.5, abs=0.01)


def test_curve_begins_and_ends_as_it_is_told():
    between = np.array([[-1.0, 0.0], [8.0, 1.0], [14.0, 6.0], [15.0, 25.0]])
    pieces = curve((np.zeros(2), 0.0), (np.array([15.0, 20.0]), np.pi / 2), between)
    assert len(pieces) == 3
    np.testing.assert_array_equal(pieces[0].start, [0.0, 0.0])
    last = pieces[-1]
    ahead, left = last.cubic.sum(axis=1)
    end = last.start + ahead * unit(last.heading) + left * unit(last.heading + np.pi / 2)
    np.testing.assert_allclose(end, [15.0, 20.0])


def test_write_opendrive_takes_lanes_without_length_and_without_width(tmp_path):
    road_map = _read("cologne1")
    first, second, *rest = road_map.lanes
    odd = (replace(first, shape=first.shape[:1]), replace(second, width=-1.0), *rest)
    assert _asam_issues(_export(replace(road_map, lanes=odd), tmp_path / "out")) == []


def test_write_opendrive_stays_well_formed_when_names_are_strange(network_path, tmp_path):
    road_map = _read(network_path("strange_names"))
    road_map = replace(road_map, name="\"><&'b c/d")
    written = _export(road_map, tmp_path / "out")
    assert written.name == "_____b_c_d.xodr"
    assert _parse(written).find("header").get("name") == road_map.name


def test_exporters_load_only_when_they_are_called():
    code = (
        "import sys, dojo_maps.exports as e; print(sorted(e.EXPORTERS)); "
        "print([m for m in sys.modules if m.startswith('dojo_maps.exports.') or m == 'pyproj'])"
    )
    environment = command_environment()
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["['geojson', 'lanelet2', 'metadrive', 'opendrive']", "[]"]


@pytest.mark.parametrize(
    ("name", "stem"),
    [("cologne1", "cologne1"), ("../../etc/x", ".._.._etc_x"), ("Straße 5", "Straße_5"), ("", "map")],
)
def test_file_stem_is_safe_as_a_file_s_name(name, stem):
    road_map = _read("cologne1")
    assert file_stem(replace(road_map, name=name)) == stem
