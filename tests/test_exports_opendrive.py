"""OpenDRIVE: read back by netconvert, the same bytes on every run; and the table of all exporters."""

import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from conftest import command_environment

from dojo_maps.description import RoadMap
from dojo_maps.errors import DojoError, ExportError
from dojo_maps.exports import EXPORTERS, file_stem, opendrive
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.files import find_network
from dojo_maps.sources.netconvert import run_netconvert
from dojo_maps.sources.sumo_net import read_network


def _read(network: str | Path) -> tuple[RoadMap, Path]:
    path, name = find_network(str(network))
    return read_network(read_bytes(path), path=path, name=name, sha256="")[0], path


def _export(road_map: RoadMap, path: Path, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    EXPORTERS["opendrive"](road_map, path, folder)
    (written,) = folder.iterdir()
    return written


def _parse(path: Path) -> ET.Element:
    return ET.parse(path).getroot()  # noqa: S314 (our own)


def _road_ids(path: Path) -> set[str]:
    """The SUMO edges that the normal roads of an OpenDRIVE file stand for."""
    roads = _parse(path).iterfind("road")
    return {r.find("userData[@code='sumoId']").get("value") for r in roads if r.get("junction") == "-1"}


@pytest.mark.parametrize("name", ["cologne1", "left_hand_bare"])
def test_write_opendrive_keeps_every_lane_in_its_place(network_path, tmp_path, name):
    road_map, path = _read(name if name == "cologne1" else network_path(name))
    written = _export(road_map, path, tmp_path / "out")
    assert written.name == f"{road_map.name}.xodr"
    assert _road_ids(written) == {road.id for road in road_map.roads}
    run_netconvert(["--opendrive-files", str(written), "-o", "back.net.xml"], folder=tmp_path)
    back, _ = _read(tmp_path / "back.net.xml")
    shift = np.array(back.projection.net_offset) - road_map.projection.net_offset
    lines = [shapely.LineString(lane.shape[:, :2] - shift) for lane in back.lanes]
    assert len(lines) == len(road_map.lanes)
    for lane in road_map.lanes:
        middle = shapely.LineString(lane.shape[:, :2]).interpolate(0.5, normalized=True)
        assert min(line.distance(middle) for line in lines) < 0.05


def test_write_opendrive_writes_the_same_bytes_again(tmp_path):
    road_map, path = _read("cologne1")
    first = _export(road_map, path, tmp_path / "one").read_bytes()
    time.sleep(1.1)
    assert _export(road_map, path, tmp_path / "two").read_bytes() == first
    assert str(tmp_path).encode() not in first
    assert b"generated on" not in first
    assert b" date=" not in first


def test_write_opendrive_puts_left_hand_traffic_on_the_left(network_path, tmp_path):
    road_map, path = _read(network_path("left_hand"))
    root = _parse(_export(road_map, path, tmp_path / "out"))
    assert root.find("header").get("revMinor") == "5"
    assert {road.get("rule") for road in root.iterfind("road")} == {"LHT"}
    assert not root.findall(".//laneSection/right")
    assert {int(lane.get("id")) > 0 for lane in root.iterfind(".//laneSection/left/lane")} == {True}


def test_write_opendrive_names_no_rule_for_right_hand_traffic(network_path, tmp_path):
    root = _parse(_export(*_read(network_path("right_hand")), tmp_path / "out"))
    assert root.find("header").get("revMinor") == "4"
    assert {road.get("rule") for road in root.iterfind("road")} == {None}


def test_write_opendrive_stays_well_formed_when_names_are_strange(network_path, tmp_path):
    road_map, path = _read(network_path("strange_names"))
    road_map = replace(road_map, name="\"><&'b c/d")
    written = _export(road_map, path, tmp_path / "out")
    assert written.name == "_____b_c_d.xodr"
    assert _parse(written).find("header").get("name") == road_map.name


def test_write_opendrive_takes_a_path_that_netconvert_would_split(tmp_path):
    road_map, path = _read("cologne1")
    odd = tmp_path / "a, b.net.xml"
    shutil.copyfile(path, odd)
    assert _export(road_map, odd, tmp_path / "out").stat().st_size > 10_000


def test_write_opendrive_fails_clearly_when_netconvert_does(tmp_path):
    road_map, _ = _read("cologne1")
    broken = tmp_path / "broken.net.xml"
    broken.write_text("<net")
    (tmp_path / "out").mkdir()
    with pytest.raises(DojoError, match="netconvert"):
        EXPORTERS["opendrive"](road_map, broken, tmp_path / "out")
    assert not list((tmp_path / "out").iterdir())


def test_write_opendrive_refuses_a_file_of_another_form(tmp_path, monkeypatch):
    def write_other(_arguments, *, folder):
        (folder / "map.xodr").write_text("<OpenDRIVE><header/></OpenDRIVE>")

    monkeypatch.setattr(opendrive, "run_netconvert", write_other)
    with pytest.raises(ExportError, match="header"):
        EXPORTERS["opendrive"](*_read("cologne1"), tmp_path)


def test_exporters_load_only_when_they_are_called():
    code = (
        "import sys, dojo_maps.exports as e; print(sorted(e.EXPORTERS)); "
        "print([m for m in sys.modules if m.startswith('dojo_maps.exports.') or m == 'pyproj'])"
    )
    environment = command_environment()
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["['geojson', 'metadrive', 'opendrive']", "[]"]


@pytest.mark.parametrize(
    ("name", "stem"),
    [("cologne1", "cologne1"), ("../../etc/x", ".._.._etc_x"), ("Straße 5", "Straße_5"), ("", "map")],
)
def test_file_stem_is_safe_as_a_file_s_name(name, stem):
    road_map, _ = _read("cologne1")
    assert file_stem(replace(road_map, name=name)) == stem
