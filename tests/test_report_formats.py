"""Reports for other programs: their shapes, and that all of them and both commands say the same."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import networks
import pytest
from conftest import dojo_maps, read_strict_json
from pyproj import Proj

from dojo_maps.cli import main
from dojo_maps.report.formats import as_text
from dojo_maps.validation.catalogue import CHECKS

KINDS = {
    "road", "lane", "connection", "junction", "sidewalk", "crossing", "walking_area", "signal",
    "stop_line", "prop",
}  # fmt: skip
SARIF_LEVELS = {"error", "warning", "note"}
NETEDIT = re.compile(r"(edge|lane|junction|crossing|connection):\S.*")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every report of one network."""
    folder = tmp_path_factory.mktemp("reports")
    files = [f"--{kind}={folder / f'report.{kind}'}" for kind in ("json", "html", "sarif", "geojson")]
    assert main(["validate", "ingolstadt21", *files, f"--netedit={folder / 'netedit'}"]) == 1
    return folder


@pytest.fixture(scope="module")
def report(written: Path) -> dict:
    return read_strict_json(written / "report.json")


def test_json_is_as_the_contract_says(report: dict) -> None:
    assert (report["format"], report["version"], report["map"]) == ("dojo-report", 1, "ingolstadt21")
    severities = [issue["severity"] for issue in report["issues"]]
    assert report["counts"] == {name: severities.count(name) for name in ("error", "warning", "note")}
    assert [check["id"] for check in report["checks"]] == [check.id for check in CHECKS]
    for check in report["checks"]:
        assert check["status"] in {"completed", "skipped", "crashed"}
        assert check["count"] == sum(issue["check"] == check["id"] for issue in report["issues"])
        assert ("reason" in check) == (check["status"] != "completed")
    for issue in report["issues"]:
        assert {
            "check",
            "severity",
            "elements",
            "position",
            "lonlat",
            "message",
            "measured",
            "limit",
            "hint",
        } <= set(issue)
        assert issue["elements"]
        assert all(set(e) == {"kind", "id"} and e["kind"] in KINDS and e["id"] for e in issue["elements"])
        assert len(issue["position"]) == 3
        assert issue["message"]
        assert issue["hint"]


def test_issues_about_links_name_their_signal_and_lanes(report: dict) -> None:
    conflicts = [issue for issue in report["issues"] if issue["check"] == "signals.green_conflict"]
    assert len(conflicts) == 2
    for issue in conflicts:
        kinds = [element["kind"] for element in issue["elements"]]
        assert kinds[0] == "signal"
        assert kinds.count("connection") == 2
        assert kinds.count("lane") >= 3


def test_positions_on_earth_are_those_of_the_projection(written: Path, report: dict) -> None:
    location = ET.parse(networks.installed_networks()["ingolstadt21"]).getroot().find("location")  # noqa: S314
    east, north = map(float, location.get("netOffset").split(","))
    to_earth = Proj(location.get("projParameter"))
    for issue in report["issues"]:
        x, y, _ = issue["position"]
        assert issue["lonlat"] == pytest.approx(to_earth(x - east, y - north, inverse=True), abs=1e-9)


def test_geojson_has_each_issue_at_its_place(written: Path, report: dict) -> None:
    collection = read_strict_json(written / "report.geojson")
    assert collection["type"] == "FeatureCollection"
    assert len(collection["features"]) == len(report["issues"])
    for feature, issue in zip(collection["features"], report["issues"], strict=True):
        assert feature["type"] == "Feature"
        assert feature["geometry"] == {"type": "Point", "coordinates": issue["lonlat"]}
        lon, lat = feature["geometry"]["coordinates"]
        assert 11.3 < lon < 11.5
        assert 48.7 < lat < 48.8
        assert feature["properties"]["check"] == issue["check"]


def test_geojson_of_a_network_without_projection_has_no_places(tmp_path: Path) -> None:
    main(["validate", "arterial4x4", f"--geojson={tmp_path / 'a.geojson'}"])
    features = read_strict_json(tmp_path / "a.geojson")["features"]
    assert len(features) == 96
    assert all(feature["geometry"] is None for feature in features)


def test_sarif_has_the_shape_of_its_version(written: Path, report: dict) -> None:
    log = read_strict_json(written / "report.sarif")
    assert log["version"] == "2.1.0"
    assert log["$schema"].endswith("sarif-2.1.0.json")
    (run,) = log["runs"]
    driver = run["tool"]["driver"]
    assert driver["name"] == "dojo-maps"
    rules = [rule["id"] for rule in driver["rules"]]
    assert len(set(rules)) == len(rules) == len(CHECKS)
    assert all(rule["shortDescription"]["text"] for rule in driver["rules"])
    assert run["invocations"][0]["executionSuccessful"] is True
    lines = networks.installed_networks()["ingolstadt21"].read_text(encoding="utf-8").split("\n")
    assert len(run["results"]) == len(report["issues"])
    for result, issue in zip(run["results"], report["issues"], strict=True):
        assert rules[result["ruleIndex"]] == result["ruleId"] == issue["check"]
        assert result["level"] in SARIF_LEVELS
        assert result["message"]["text"].startswith(issue["message"])
        (location,) = result["locations"]
        place = location["physicalLocation"]
        assert place["artifactLocation"]["uri"] == "ingolstadt21.net.xml"
        line = lines[place["region"]["startLine"] - 1]
        first = issue["elements"][0]["id"]
        assert (
            first.partition("->")[0].rpartition("_")[0] in line if "->" in first else f'id="{first}"' in line
        )
        assert [n["fullyQualifiedName"] for n in location["logicalLocations"]] == [
            e["id"] for e in issue["elements"]
        ]


def test_netedit_files_select_the_elements_and_look_at_the_place(written: Path, report: dict) -> None:
    net = ET.parse(networks.installed_networks()["ingolstadt21"]).getroot()  # noqa: S314
    known = {
        f"{tag}:{element.get('id')}" for tag in ("edge", "lane", "junction") for element in net.iter(tag)
    }
    folder = written / "netedit"
    by_check: dict[str, set[str]] = {}
    for number, issue in enumerate(report["issues"], 1):
        lines = (folder / f"{number:04}.selection.txt").read_text(encoding="utf-8").splitlines()
        by_check.setdefault(issue["check"], set()).update(lines)
        assert all(NETEDIT.fullmatch(line) for line in lines)
        assert all(line in known for line in lines if line.startswith(("edge:", "lane:", "junction:")))
        view = ET.fromstring((folder / f"{number:04}.view.xml").read_text(encoding="utf-8"))  # noqa: S314
        assert view.tag == "viewsettings"
        viewport = view.find("viewport")
        assert [float(viewport.get(k)) for k in "xy"] == pytest.approx(issue["position"][:2], abs=0.01)
    for check, wanted in by_check.items():
        lines = (folder / f"{check}.selection.txt").read_text(encoding="utf-8").splitlines()
        assert len(lines) == len(set(lines))
        assert set(lines) == wanted


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cologne1", "ingolstadt7", "arterial4x4"])
def test_validate_and_convert_agree(
    name: str, converted, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = Path(converted(name).bundle)
    by_convert = read_strict_json(bundle / "report.json")
    statuses = [main(["validate", str(bundle), f"--json={tmp_path / 'b.json'}"])]
    statuses.append(main(["validate", name, f"--json={tmp_path / 'n.json'}"]))
    assert statuses == [converted(name).status] * 2
    by_bundle, by_network = (read_strict_json(tmp_path / file) for file in ("b.json", "n.json"))
    assert by_bundle == by_convert
    meshes = {"geometry.mesh_health"}
    assert [i for i in by_convert["issues"] if i["check"] not in meshes] == by_network["issues"]
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].endswith(list(as_text(by_network))[-1])


def test_reports_are_the_same_bytes_again(written: Path, tmp_path: Path) -> None:
    files = [f"--{kind}={tmp_path / f'report.{kind}'}" for kind in ("json", "html", "sarif", "geojson")]
    main(["validate", "ingolstadt21", *files])
    for kind in ("json", "html", "sarif", "geojson"):
        assert (tmp_path / f"report.{kind}").read_bytes() == (written / f"report.{kind}").read_bytes()


def test_text_gives_a_line_per_issue_and_none_of_the_maps_control_characters(report: dict) -> None:
    evil = json.loads(json.dumps(report))
    evil["map"] = "\x1b[31mred\n"
    evil["issues"][0]["message"] = "two\nlines\x1b[2J\u202e"
    lines = list(as_text(evil))
    assert sum(line.startswith("  ") for line in lines) == len(report["issues"])
    assert all(line.isprintable() for line in lines)


def test_report_that_cannot_be_written_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    done = dojo_maps("validate", "cologne1", "--json", tmp_path / "no" / "report.json")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())
