"""The report: every check's state, the catalogue's cards, profiles and exclusions."""

import json
import random
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import mutations
import networks
import numpy as np
import pytest
from conftest import Conversion, dojo_maps
from mutations import lights, shapes, ways

from dojo_maps.description import RoadMap
from dojo_maps.errors import SourceError
from dojo_maps.input_files import read_bytes
from dojo_maps.issue import Severity
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.sources.files import find_network
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.validation import runner
from dojo_maps.validation.catalogue import CHECKS
from dojo_maps.validation.check import Finding, Need, element
from dojo_maps.validation.exclusions import read_exclusions
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.geometry_checks import check_mesh_health
from dojo_maps.validation.profiles import DEFAULT, PROFILES, Limits

TETRAHEDRON = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
CODES = {
    *(f"GEO{k:03}" for k in range(1, 20)),
    *(f"TOP{k:03}" for k in range(1, 18)),
    *(f"SIG{k:03}" for k in range(1, 21)),
    *(f"PED{k:03}" for k in range(1, 11)),
    *(f"SUM{k:03}" for k in range(1, 3)),
    *(f"OSM{k:03}" for k in range(1, 14)),
    *(f"IMP{k:03}" for k in (*range(1, 23), *range(24, 28))),
}


def read(name: str) -> RoadMap:
    path, name = find_network(name)
    return read_network(read_bytes(path), path=path, name=name, sha256="")[0]


@pytest.fixture(scope="module")
def road_map() -> RoadMap:
    return read("cologne8")


def make_mesh(faces: np.ndarray, name: str = "sidewalk") -> Mesh:
    vertices = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    return Mesh(name=name, vertices=vertices, faces=faces, sources=np.zeros(len(faces), int), ids=("w",))


def unhealthy(road_map: RoadMap, mesh: Mesh) -> list[str]:
    issues, _ = runner.find_issues(road_map, [mesh], [], checks=[check_mesh_health])
    return [f"{issue.elements[0].id}: {issue.message}" for issue in issues]


def test_mesh_health_is_silent_when_a_solid_is_closed(road_map: RoadMap) -> None:
    assert unhealthy(road_map, make_mesh(TETRAHEDRON)) == []


def test_mesh_health_names_the_solid_that_is_open(road_map: RoadMap) -> None:
    assert unhealthy(road_map, make_mesh(TETRAHEDRON[:3])) == ["w: the mesh sidewalk is not watertight"]


def test_mesh_health_names_the_floor_that_faces_down(road_map: RoadMap) -> None:
    assert unhealthy(road_map, make_mesh(TETRAHEDRON[:1], "road")) == ["w: the mesh road faces down"]


def test_mesh_health_names_faces_without_area(road_map: RoadMap) -> None:
    faces = np.array([(0, 1, 2), (0, 1, 1)])
    assert unhealthy(road_map, make_mesh(faces, "junction")) == [
        "w: the mesh junction has 1 face without area"
    ]


def test_mesh_health_names_positions_that_are_not_numbers(road_map: RoadMap) -> None:
    mesh = make_mesh(TETRAHEDRON)
    mesh.vertices[0, 0] = np.nan
    assert unhealthy(road_map, mesh) == ["w: the mesh sidewalk has positions that are not numbers"]


def test_checks_of_meshes_run_on_a_converted_map(converted: Any) -> None:
    conversion: Conversion = converted("cologne1")
    states = {check["id"]: check["status"] for check in conversion.report["checks"]}
    assert states["geometry.mesh_health"] == "completed"
    assert {check for check, state in states.items() if state != "completed"} == {
        check.id for check in CHECKS if check.needs in {Need.OSM, Need.IMPORT}
    }


def test_check_that_cannot_run_is_skipped_and_says_why(road_map: RoadMap) -> None:
    report = runner.run_checks(road_map, None, [])
    skipped = {check["id"]: check for check in report["checks"] if check["status"] == "skipped"}
    assert {"geometry.mesh_health", "osm.missing_signal", "topology.turn_lane_mismatch"} <= set(skipped)
    assert all(check["count"] == 0 and len(check["reason"]) > 10 for check in skipped.values())


def test_check_that_breaks_is_crashed_and_the_others_go_on(
    road_map: RoadMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = runner.run_checks(road_map, None, [])

    def broken(_facts: Facts, _limits: Limits) -> Iterator[Finding]:
        yield Finding(elements=element("lane", "first"), at=(0.0, 0.0), message="found before the crash")
        raise ZeroDivisionError("by design")

    checks = [replace(check, run=broken) if check.id == "geometry.kink" else check for check in CHECKS]
    monkeypatch.setattr(runner, "CHECKS", tuple(checks))
    report = runner.run_checks(road_map, None, [])
    states = {check["id"]: check for check in report["checks"]}
    assert states["geometry.kink"]["status"] == "crashed"
    assert "by design" in states["geometry.kink"]["reason"]
    kinks = [issue for issue in report["issues"] if issue["check"] == "geometry.kink"]
    assert [issue["severity"] for issue in kinks] == ["warning", "error"]
    assert report["counts"]["error"] == usual["counts"]["error"] + 1
    others = [[i for i in r["issues"] if i["check"] != "geometry.kink"] for r in (usual, report)]
    assert others[0] == others[1]
    assert others[0]


def test_one_defect_hides_no_other() -> None:
    path = networks.installed_networks()["ingolstadt7"]
    net = mutations.Net(ET.fromstring(networks.read_network_bytes(path)))  # noqa: S314
    kinds = (
        ways.duplicate_edge, ways.misname_via, ways.strand_lane, shapes.cross_lanes, shapes.twist_junction,
        shapes.squeeze_width, lights.never_green, lights.shorten_yellow, ways.repeat_connection,
    )  # fmt: skip
    planted = [kind(net, random.Random(k)) for k, kind in enumerate(kinds)]  # noqa: S311
    road_map, known = read_network(ET.tostring(net.root), path=Path("x.net.xml"), name="x", sha256="")
    report = runner.run_checks(road_map, None, known)
    found = {(i["check"], e["kind"], e["id"]) for i in report["issues"] for e in i["elements"]}
    assert {(defect.check, *defect.element) for defect in planted} <= found


def test_every_code_of_the_catalogue_has_a_check() -> None:
    assert {check.code for check in CHECKS} == CODES
    assert len({check.id for check in CHECKS}) == len(CHECKS)


def test_checks_command_lists_each_with_severity_limit_and_source() -> None:
    done = dojo_maps("checks")
    assert done.returncode == 0
    rows = done.stdout.splitlines()
    assert len(rows) == len(CHECKS)
    for row, check in zip(rows, CHECKS, strict=True):
        assert re.fullmatch(
            rf"{re.escape(check.id)} +(error|warning|note) +\S.* \(limit: \S.*; \S.*\)", row
        ), row


def test_profiles_change_limits_and_severities(road_map: RoadMap) -> None:
    reports = {name: runner.run_checks(road_map, None, [], profile) for name, profile in PROFILES.items()}
    assert set(reports) == {"default", "rl", "strict"}
    assert all(report["profile"] == name for name, report in reports.items())
    kinks = {
        name: [i["severity"] for i in report["issues"] if i["check"] == "geometry.tight_radius"]
        for name, report in reports.items()
    }
    assert set(kinks["default"]) == {"warning"}
    assert set(kinks["rl"]) == {"note"}
    assert sum(reports["strict"]["counts"].values()) > sum(reports["default"]["counts"].values())


def test_rl_profile_makes_what_a_controller_cannot_drive_an_error() -> None:
    network = read("two-way")
    signal = network.signals[0]
    stuck = replace(signal, programs=(replace(signal.programs[0], phases=signal.programs[0].phases[:1]),))
    stuck_map = replace(network, signals=(stuck,))
    by_profile = {
        name: {i["check"]: i["severity"] for i in runner.run_checks(stuck_map, None, [], profile)["issues"]}
        for name, profile in PROFILES.items()
    }
    assert by_profile["default"]["signals.rl_form"] == "warning"
    assert by_profile["rl"]["signals.rl_form"] == "error"
    assert by_profile["rl"]["signals.tls_trivial"] == "error"


def excluding(tmp_path: Path, *rules: object) -> Path:
    path = tmp_path / "known.json"
    path.write_text(json.dumps({"exclude": rules}), encoding="utf-8")
    return path


def test_exclusions_are_listed_with_their_reason_and_not_counted(road_map: RoadMap, tmp_path: Path) -> None:
    usual = runner.run_checks(road_map, None, [])
    first = next(issue for issue in usual["issues"] if issue["check"] == "geometry.tight_radius")
    fault = f"{first['elements'][0]['kind']} {first['elements'][0]['id']}"
    path = excluding(
        tmp_path,
        {"check": "geometry.tight_radius", "element": fault, "reason": "a ramp, looked at"},
        {"check": "signals.*", "reason": "timed elsewhere"},
    )
    report = runner.run_checks(road_map, None, [], DEFAULT, read_exclusions(path))
    assert not [issue for issue in report["issues"] if issue["check"].startswith("signals.")]
    assert first not in report["issues"]
    assert {issue["reason"] for issue in report["excluded"]} == {"a ramp, looked at", "timed elsewhere"}
    assert len(report["issues"]) + len(report["excluded"]) == len(usual["issues"])
    assert sum(report["counts"].values()) == len(report["issues"])


@pytest.mark.parametrize(
    "rule",
    [
        {"check": "geometry.kink"},
        {"check": "geometry.kink", "reason": " "},
        {"reason": "no check"},
        {"check": "geometry.kink", "reason": "r", "elements": []},
        {"check": 3, "reason": "r"},
        "geometry.kink",
    ],
)
def test_exclusion_that_is_not_a_rule_with_a_reason_is_refused(rule: object, tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="rule 1"):
        read_exclusions(excluding(tmp_path, rule))


def test_exclusion_file_that_is_missing_or_no_json_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no such file"):
        read_exclusions(tmp_path / "nowhere.json")
    (tmp_path / "bad.json").write_text("[", encoding="utf-8")
    with pytest.raises(SourceError, match="not readable as JSON"):
        read_exclusions(tmp_path / "bad.json")


def test_severities_of_a_report_are_those_of_the_contract(road_map: RoadMap) -> None:
    report = runner.run_checks(road_map, None, [])
    assert set(report["counts"]) == {"error", "warning", "note"} == {s.value for s in Severity}
    for check in report["checks"]:
        assert check["count"] == sum(issue["check"] == check["id"] for issue in report["issues"])
