"""What programs ask of maps: the same as commands do."""

import json
from pathlib import Path

import pytest
from conftest import REPOSITORY

import dojo_maps

EXTRACT = REPOSITORY / "examples" / "osm" / "left_hand_t.osm"


def test_validate_reports_and_writes(tmp_path: Path) -> None:
    report = dojo_maps.validate("two-way", json=tmp_path / "report.json", html=tmp_path / "report.html")
    assert report["counts"]["error"] == sum(issue["severity"] == "error" for issue in report["issues"]) > 0
    assert json.loads((tmp_path / "report.json").read_text("utf-8")) == json.loads(json.dumps(report))
    assert "yellow" in (tmp_path / "report.html").read_text("utf-8")


def test_fix_mends_what_validate_finds(tmp_path: Path) -> None:
    mended = tmp_path / "mended.net.xml"
    done = dojo_maps.fix("two-way", mended, only=["signals.yellow_short"], patch=tmp_path / "patch")
    assert [repair["check"] for repair in done["repairs"]] == ["signals.yellow_short"]
    assert any((tmp_path / "patch").iterdir())
    left = {issue["check"] for issue in dojo_maps.validate(mended)["issues"]}
    assert "signals.yellow_short" not in left
    assert dojo_maps.fix(mended)["repairs"] == []


def test_import_osm_and_demand(tmp_path: Path) -> None:
    bundle, report = dojo_maps.import_osm(EXTRACT, tmp_path / "t.dojo")
    assert report["demand"]["vehicles"] > 0
    assert dojo_maps.open_bundle(bundle.folder).road_map.left_hand
    before = (bundle.folder / "demand.rou.xml").read_bytes()
    told, start = dojo_maps.add_demand(bundle.folder, dojo_maps.DemandOptions(volume=100, seed=2))
    assert start == bundle.folder
    assert told["vehicles"] < report["demand"]["vehicles"]
    assert (bundle.folder / "demand.rou.xml").read_bytes() != before


@pytest.mark.parametrize(
    ("area", "words"),
    [
        ({}, "exactly one"),
        ({"source": EXTRACT, "place": "Helsinki"}, "exactly one"),
        ({"source": EXTRACT, "radius": 5}, "a file is given"),
        ({"source": "a.net.xml"}, "not named as OpenStreetMap data"),
        ({"bbox": (13.4, 52.5, 13.3, 52.6)}, "west below east"),
        ({"bbox": (13.4, 52.5, 13.5)}, "expected west, south, east and north"),
        ({"point": (91, 0)}, "not a place"),
    ],
)
def test_area_that_cannot_be_is_told(area: dict[str, object], words: str) -> None:
    with pytest.raises(dojo_maps.UsageError, match=words):
        dojo_maps.import_osm(**area)


def test_unknown_profile_is_told() -> None:
    with pytest.raises(dojo_maps.UsageError, match="expected one of default, rl, strict"):
        dojo_maps.validate("two-way", profile="loose")
