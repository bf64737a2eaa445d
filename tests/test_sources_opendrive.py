"""OpenDRIVE as an input: the exported map comes back, what is lost is told, hostile files are one line."""

import json
from pathlib import Path

import pytest

from dojo_maps import cli
from dojo_maps.errors import SourceError
from dojo_maps.exports import EXPORTERS
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.files import find_network, map_name
from dojo_maps.sources.opendrive import build_network, is_opendrive
from dojo_maps.sources.sumo_net import read_network

_ROAD = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="7"/>
<road id="1" junction="-1" length="{length}"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="{length}"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
</right></laneSection></lanes>
<objects><object id="7" type="tree" s="5" t="4" zOffset="0"/></objects></road>
<road id="2" junction="-1" length="9"><planView>
<geometry s="0" x="0" y="90" hdg="0" length="9"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center></laneSection></lanes></road>
</OpenDRIVE>
"""


@pytest.mark.parametrize("name", ["cologne1", "left_hand"])
def test_convert_takes_an_exported_map_back(network_path, tmp_path, name):
    path, _ = find_network(str(network_path(name)))
    before, _ = read_network(read_bytes(path), path=path, name=name, sha256="")
    EXPORTERS["opendrive"](before, tmp_path)
    bundle = tmp_path / "back.dojo"
    source = tmp_path / f"{before.name}.xodr"
    assert cli.main(["convert", str(source), "-o", str(bundle), "--quiet"]) in {0, 1}
    described = json.loads((bundle / "map.json").read_text(encoding="utf-8"))
    assert described["source"]["kind"] == "opendrive"
    assert described["source"]["file"] == source.name
    assert described["left_hand"] == before.left_hand
    assert len(described["roads"]) == len(before.roads)
    assert len(described["lanes"]) >= len(before.lanes)
    assert b"opendrive-files" not in (bundle / "network.net.xml").read_bytes()


def test_convert_tells_what_of_an_opendrive_file_is_lost(tmp_path, capsys):
    source = tmp_path / "one.xodr"
    source.write_text(_ROAD.format(length=80), encoding="utf-8")
    assert cli.main(["convert", str(source), "-o", str(tmp_path / "out"), "--quiet"]) in {0, 1}
    report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    lost = [issue for issue in report["issues"] if issue["check"] == "sumo.opendrive_lost"]
    assert [(issue["severity"], issue["elements"]) for issue in lost] == [
        ("warning", [{"kind": "road", "id": "2"}]),
        ("note", []),
    ]
    assert "1 object of type 'tree'" in lost[1]["message"]


def test_build_network_ties_warnings_to_the_elements_that_they_name(network_path, tmp_path):
    path, _ = find_network(str(network_path("village")))
    road_map, _ = read_network(read_bytes(path), path=path, name="village", sha256="")
    EXPORTERS["opendrive"](road_map, tmp_path)
    built = build_network(read_bytes(tmp_path / "village.xodr"), path=Path("village.xodr"))
    back, _ = read_network(built.data, path=path, name="village", sha256="")
    notes = [issue for issue in built.issues(back) if issue.check == "sumo.opendrive_warning"]
    assert notes
    assert all(note.elements for note in notes if "at edge" in note.message)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("<net/>", "expected <OpenDRIVE>"),
        ("<OpenDRIVE>", "not well-formed"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><OpenDRIVE/>', "document type"),
        ("<OpenDRIVE/>", "netconvert"),
        (_ROAD.format(length="1e300"), "length"),
        (_ROAD.format(length="nan"), "length"),
        (_ROAD.format(length="-5"), "length"),
    ],
)
def test_convert_refuses_a_broken_opendrive_file_in_one_line(tmp_path, capsys, text, problem):
    source = tmp_path / "x.xodr"
    source.write_text(text, encoding="utf-8")
    assert cli.main(["convert", str(source), "-o", str(tmp_path / "out"), "--quiet"]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert problem in line
    assert not (tmp_path / "out").exists()


def test_build_network_refuses_roads_without_an_end():
    piece = '<geometry s="0" x="0" y="0" hdg="0" length="1e6"><line/></geometry>'
    many = f"<OpenDRIVE><road><planView>{piece * 1001}</planView></road></OpenDRIVE>"
    with pytest.raises(SourceError, match="longer than"):
        build_network(many.encode(), path=Path("x.xodr"))


def test_is_opendrive_goes_by_the_name():
    assert is_opendrive("a/Town01.XODR")
    assert is_opendrive(Path("x.xodr.gz"))
    assert not is_opendrive("x.xodr.net.xml")
    assert map_name(Path("a/town.xodr.gz")) == "town"
