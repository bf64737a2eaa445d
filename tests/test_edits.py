"""Edits survive: kept as a patch, put on the next import, and reported where they no longer fit."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import osm_drawings
import pytest

from dojo_maps.bundle import Bundle
from dojo_maps.cli import main
from dojo_maps.conversion import convert
from dojo_maps.errors import SourceError
from dojo_maps.sources.netconvert import find_netconvert
from dojo_maps.sumo_programs import sumo_environment


def drawing(*, arm: bool = True, speed: str = "50") -> osm_drawings.Drawing:
    """Draw a crossroads whose northern arm may be missing, and whose roads may have another limit."""
    drawn = osm_drawings.Drawing()
    drawn.node(0, 0, **osm_drawings.SIGNAL)
    tags = {"highway": "secondary", "lanes": "2", "sidewalk": "both", "maxspeed": speed}
    drawn.way((-120, 0), (0, 0), name="West", **tags)
    drawn.way((0, 0), (120, 0), name="East", **tags)
    drawn.way((0, -120), (0, 0), name="South", **tags)
    if arm:
        drawn.way((0, 0), (0, 120), name="North", **tags)
    return drawn


def netconvert(*arguments: str, folder: Path) -> None:
    program = find_netconvert()
    command = [str(program), *arguments]
    subprocess.run(command, cwd=folder, env=sumo_environment(program), check=True, capture_output=True)


def edit(bundle: Bundle, folder: Path, *, slow: str, seconds: int) -> Path:
    """Change a road's limit and a phase's length as netedit does: plain XML out, plain XML in."""
    netconvert("-s", str(bundle.network), "--plain-output-prefix", "plain", folder=folder)
    edges = (folder / "plain.edg.xml").read_text()
    found = re.search(rf'<edge id="{slow}"[^>]*>', edges)
    assert found is not None
    changed = re.sub(r' speed="[\d.]+"', ' speed="5.55"', found[0])
    (folder / "plain.edg.xml").write_text(edges.replace(found[0], changed))
    logics = (folder / "plain.tll.xml").read_text()
    logics = re.sub(r'<phase duration="\d+"', f'<phase duration="{seconds}"', logics, count=1)
    (folder / "plain.tll.xml").write_text(logics)
    files = ["-n", "plain.nod.xml", "-e", "plain.edg.xml", "-x", "plain.con.xml", "-i", "plain.tll.xml"]
    options = ["--offset.disable-normalization", "--no-turnarounds.except-deadend", "-o", "edited.net.xml"]
    netconvert(*files, *options, folder=folder)
    return folder / "edited.net.xml"


def road_named(bundle: Bundle, name: str) -> str:
    return next(road.id for road in bundle.road_map.roads if road.name == name)


def speeds(bundle: Bundle) -> dict[str, float]:
    return {lane.road: lane.speed for lane in bundle.road_map.lanes}


def misfits(report: dict[str, Any]) -> list[str]:
    return [issue["message"] for issue in report["issues"] if issue["check"] == "osm.edit_lost"]


@pytest.fixture
def edited(tmp_path: Path) -> tuple[Bundle, str]:
    """A bundle that keeps edits of its northern road and of its signal."""
    bundle, _ = convert(str(drawing().write(tmp_path / "a.osm")), tmp_path / "my.dojo")
    slow = road_named(bundle, "North")
    saved = edit(bundle, tmp_path, slow=slow, seconds=33)
    assert main(["keep", str(bundle.folder), str(saved)]) == 0
    return bundle, slow


@pytest.mark.slow
def test_edits_are_applied_on_the_next_import(edited: tuple[Bundle, str], tmp_path: Path) -> None:
    old, slow = edited
    before = speeds(old)
    new, report = convert(str(tmp_path / "a.osm"), old.folder)
    assert misfits(report) == []
    assert {road for road, speed in speeds(new).items() if speed != before[road]} == {slow}
    assert speeds(new)[slow] == 5.55
    assert new.road_map.signals[0].programs[0].phases[0].duration == 33
    assert len(new.road_map.crossings) == len(old.road_map.crossings)
    assert len(new.road_map.connections) == len(old.road_map.connections)
    assert new.road_map.source.kind == "osm"


@pytest.mark.slow
def test_edits_are_applied_to_newer_data_and_again(edited: tuple[Bundle, str], tmp_path: Path) -> None:
    old, slow = edited
    newer = str(drawing(speed="40").write(tmp_path / "b.osm"))
    for _ in range(2):
        new, report = convert(newer, old.folder)
        assert misfits(report) == []
        assert speeds(new)[slow] == 5.55
        assert {round(speed * 3.6) for road, speed in speeds(new).items() if road != slow} == {40}
        assert (new.folder / "base.net.xml").is_file()


@pytest.mark.slow
def test_second_edits_add_to_the_first(edited: tuple[Bundle, str], tmp_path: Path) -> None:
    old, slow = edited
    new, _ = convert(str(tmp_path / "a.osm"), old.folder)
    other = road_named(new, "South")
    saved = edit(new, tmp_path, slow=other, seconds=44)
    assert main(["keep", str(new.folder), str(saved)]) == 0
    newest, report = convert(str(tmp_path / "a.osm"), old.folder)
    assert misfits(report) == []
    assert speeds(newest)[slow] == speeds(newest)[other] == 5.55
    assert newest.road_map.signals[0].programs[0].phases[0].duration == 44


def test_edits_that_no_longer_fit_are_reported(edited: tuple[Bundle, str], tmp_path: Path) -> None:
    old, slow = edited
    kept = (old.folder / "edits" / "edg.xml").read_bytes()
    new, report = convert(str(drawing(arm=False).write(tmp_path / "c.osm")), old.folder)
    assert any(
        f"edge {slow} no longer fits: the network has no edge {slow}" in text for text in misfits(report)
    )
    assert slow not in speeds(new)
    assert report["counts"]["error"] == 0
    states = {len(phase.state) for phase in new.road_map.signals[0].programs[0].phases}
    assert states == {max(link.index for link in new.road_map.signals[0].links) + 1}
    assert (old.folder / "edits" / "edg.xml").read_bytes() == kept, "they may fit again later"


def test_keep_refuses_what_is_no_network(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bundle, _ = convert(str(drawing().write(tmp_path / "a.osm")), tmp_path / "my.dojo")
    (tmp_path / "bad.net.xml").write_text("<net><edge")
    assert main(["keep", str(bundle.folder), str(tmp_path / "bad.net.xml")]) == 3
    assert main(["keep", str(tmp_path), str(bundle.network)]) == 3
    assert main(["keep", str(bundle.folder), str(tmp_path / "none.net.xml")]) == 3
    assert "Traceback" not in capsys.readouterr().err
    assert not (bundle.folder / "edits").exists()


@pytest.mark.parametrize(
    "text", ["<edges", "<nodes/>", '<!DOCTYPE edges [<!ENTITY a "b">]><edges>&a;</edges>', ""]
)
def test_hostile_edits_stop_the_import(text: str, edited: tuple[Bundle, str], tmp_path: Path) -> None:
    bundle, _ = edited
    before = json.loads((bundle.folder / "map.json").read_text())
    (bundle.folder / "edits" / "edg.xml").write_text(text)
    with pytest.raises(SourceError, match="edits"):
        convert(str(tmp_path / "a.osm"), bundle.folder)
    assert json.loads((bundle.folder / "map.json").read_text()) == before
