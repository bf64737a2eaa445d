"""The report: every check's state, findings with all that is needed to look at them, and safe pages."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dojo_maps.description import RoadMap
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.report.page import write_page
from dojo_maps.sources.files import find_network, read_bytes
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.validation import runner
from dojo_maps.validation.geometry_checks import check_mesh_health

TETRAHEDRON = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])


@pytest.fixture(scope="module")
def road_map() -> RoadMap:
    path, name = find_network("cologne1")
    return read_network(read_bytes(path), path=path, name=name, sha256="")[0]


def make_mesh(faces: np.ndarray) -> Mesh:
    vertices = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    return Mesh(
        name="sidewalk", vertices=vertices, faces=faces, sources=np.zeros(len(faces), int), ids=("w",)
    )


def test_mesh_health_is_silent_when_a_solid_is_closed(road_map: RoadMap) -> None:
    assert not list(check_mesh_health(road_map, [make_mesh(TETRAHEDRON)]))


def test_mesh_health_names_the_solid_that_is_open(road_map: RoadMap) -> None:
    issues = list(check_mesh_health(road_map, [make_mesh(TETRAHEDRON[:3])]))
    assert [issue.elements[0].id for issue in issues] == ["w"]


def test_check_that_breaks_is_crashed_and_the_others_go_on(
    road_map: RoadMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_map: RoadMap, _meshes: Sequence[Mesh]) -> Iterator[Issue]:
        raise ZeroDivisionError("by design")

    checks = [replace(check, run=broken if check.run else None) for check in runner.CHECKS]
    monkeypatch.setattr(runner, "CHECKS", tuple(checks))
    report = runner.run_checks(road_map, [], [])
    states = {check["id"]: check["status"] for check in report["checks"]}
    assert states["geometry.mesh_health"] == "crashed"
    assert states["topology.duplicate_id"] == "completed"
    assert report["counts"]["error"] == 1


def test_duplicate_and_dangling_elements_are_reported() -> None:
    path, name = find_network("cologne1")
    text = read_bytes(path).decode()
    edge = text[text.index('    <edge id="-28198821#4"') :].partition("</edge>\n")[0] + "</edge>\n"
    broken = text.replace(edge, edge + edge).replace(
        "</net>",
        '<connection from="-28198821#4" to="nowhere" fromLane="0" toLane="0" dir="s" state="M"/></net>',
    )
    road_map, issues = read_network(broken.encode(), path=path, name=name, sha256="")
    report = runner.run_checks(road_map, [], issues)
    found = {issue["check"]: issue for issue in report["issues"]}
    assert set(found) == {"topology.duplicate_id", "topology.dangling_reference"}
    dangling = found["topology.dangling_reference"]
    assert dangling["elements"][0] == {"kind": "connection", "id": "-28198821#4_0->nowhere_0"}
    lon, lat = dangling["lonlat"]
    assert 6.9 < lon < 7.0
    assert 50.9 < lat < 51.0


def test_page_escapes_everything_from_the_map(tmp_path: Path, road_map: RoadMap) -> None:
    evil = '<script>alert("x")</script>'
    issue = Issue(
        check="topology.duplicate_id",
        severity=Severity.ERROR,
        elements=(Element(kind="lane", id=evil),),
        position=(0.0, 0.0, 0.0),
        message=evil,
        hint=evil,
    )
    report = runner.run_checks(replace(road_map, name=evil), [], [issue])
    (tmp_path / "p.png").write_bytes(b"png")
    write_page(report, tmp_path / "p.png", tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "<script" not in page
    assert "&lt;script&gt;" in page
