"""SUMO's own word on a network: what it refuses is an error of the report; it uses no other files."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dojo_maps.conversion import convert
from dojo_maps.input_files import read_bytes
from dojo_maps.inspection import inspect
from dojo_maps.issue import Issue
from dojo_maps.repair.edits import Edit, SetPhases, Site
from dojo_maps.repair.repairs import REPAIRS
from dojo_maps.repair.rounds import fix_network
from dojo_maps.sources.files import find_network
from dojo_maps.sumo_loading import loading

COLOGNE = read_bytes(find_network("cologne1")[0])
SIGNAL = "GS_cluster_357187_359543"
REFUSED = {
    "program lost": (rb"<tlLogic.*?</tlLogic>", b"", ("signal", SIGNAL)),
    "signal renamed": (rb' tl="[^"]*"', b' tl="nowhere"', ("signal", "nowhere")),
    "program of a railway": (rb'type="static"', b'type="rail_signal"', ("signal", SIGNAL)),
    "phase after the last": (rb"<phase ", b'<phase next="99" ', ("signal", SIGNAL)),
    "request lost": (rb"<request [^>]*>", b"", ("junction", "360130")),
    "junction without a type": (rb'(<junction id="cluster_357187_359543") type="\w+"', rb"\1", None),
    "connection without a state": (rb' state="[a-zA-Z=]"/>', b"/>", None),
    "no such projection": (rb'projParameter="[^"]*"', b'projParameter="+proj=utm +zone=99"', None),
}


def damaged(pattern: bytes, instead: bytes) -> bytes:
    found = re.sub(pattern, instead, COLOGNE, count=0 if b" tl=" in pattern else 1, flags=re.DOTALL)
    assert found != COLOGNE
    return found


def report_on(data: bytes, folder: Path) -> dict[str, Any]:
    (folder / "n.net.xml").write_bytes(data)
    return inspect(str(folder / "n.net.xml"))[1]


def issues_of(check: str, data: bytes, folder: Path) -> list[dict[str, Any]]:
    return [issue for issue in report_on(data, folder)["issues"] if issue["check"] == check]


def states(report: dict[str, Any]) -> dict[str, str]:
    return {check["id"]: check["status"] for check in report["checks"]}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("kind", REFUSED)
def test_network_that_sumo_refuses_has_an_error_that_quotes_sumo(kind: str, tmp_path: Path) -> None:
    pattern, instead, fault = REFUSED[kind]
    issues = issues_of("sumo.refused", damaged(pattern, instead), tmp_path)
    assert {issue["severity"] for issue in issues} == {"error"}
    assert all(issue["message"].startswith("SUMO") for issue in issues)
    if fault:
        named = {(e["kind"], e["id"]) for issue in issues for e in issue["elements"]}
        assert fault in named


def test_green_of_an_actuated_program_that_no_vehicle_can_lengthen_is_an_issue(tmp_path: Path) -> None:
    actuated = COLOGNE.replace(b'type="static"', b'type="actuated"')
    actuated = re.sub(rb' (min|max)Dur="[^"]*"', b"", actuated)
    actuated = re.sub(rb'<phase (?=[^>]*state="[^y"]*")', b'<phase minDur="5" maxDur="50" ', actuated)
    lanes = sorted(set(re.findall(rb'<connection from="([^":]+)" [^>]*fromLane="(\d)"[^>]* tl=', actuated)))
    blind = b"".join(b'<param key="%s_%s" value="NO_DETECTOR"/>' % lane for lane in lanes)
    seen = issues_of("signals.no_detector", actuated, tmp_path)
    found = issues_of("signals.no_detector", actuated.replace(b"</tlLogic>", blind + b"</tlLogic>"), tmp_path)
    assert len(found) > len(seen)
    assert any("actuated phase" in issue["message"] for issue in found)
    assert {issue["severity"] for issue in found} == {"warning"}
    assert all(issue["elements"][0] == {"kind": "signal", "id": SIGNAL} for issue in found)
    assert not issues_of("sumo.warning", actuated.replace(b"</tlLogic>", blind + b"</tlLogic>"), tmp_path)


def test_network_that_sumo_loads_without_a_word_has_no_issue_of_sumo(tmp_path: Path) -> None:
    report = report_on(COLOGNE, tmp_path)
    assert states(report)["sumo.refused"] == states(report)["sumo.warning"] == "completed"
    assert not [issue for issue in report["issues"] if issue["check"].startswith("sumo.")]


def test_warning_of_sumo_names_the_signal_and_its_way_and_lies_there(tmp_path: Path) -> None:
    red = re.sub(rb'state="\w', b'state="r', COLOGNE)
    red = re.sub(rb'(<connection [^>]*) state="r', rb'\1 state="o', red)
    (warning,) = issues_of("sumo.warning", red, tmp_path)
    assert (warning["severity"], "Missing green phase" in warning["message"]) == ("warning", True)
    assert [e["kind"] for e in warning["elements"][:2]] == ["signal", "connection"]
    assert warning["elements"][0]["id"] == SIGNAL
    (same,) = issues_of("signals.never_green", red, tmp_path)
    assert {(e["kind"], e["id"]) for e in warning["elements"]} <= {
        (e["kind"], e["id"]) for e in same["elements"]
    }


def test_conversion_reports_what_sumo_refuses(tmp_path: Path) -> None:
    (tmp_path / "n.net.xml").write_bytes(damaged(*REFUSED["program lost"][:2]))
    _, report = convert(str(tmp_path / "n.net.xml"), tmp_path / "n.dojo")
    assert [i["check"] for i in report["issues"] if i["severity"] == "error"][:1] == ["sumo.refused"]


@pytest.mark.parametrize(
    "more",
    [
        b'<inductionLoop id="d" lane="%s" pos="1" period="1" file="%s"/>',
        b'<tlLogic id="t" programID="0" type="actuated"><param value="%.0s%s" key="file"/></tlLogic>',
        b'<include href="%.0s%s"/>',
    ],
)
def test_network_that_would_make_sumo_use_files_is_not_given_to_sumo(more: bytes, tmp_path: Path) -> None:
    lane = re.search(rb'<lane id="([^":]+)"', COLOGNE)
    assert lane
    target = tmp_path / "written.xml"
    more %= (lane[1], bytes(target))
    with loading(COLOGNE.replace(b"</net>", more + b"</net>")) as sumo:
        assert sumo is None
    report = report_on(COLOGNE.replace(b"</net>", more + b"</net>"), tmp_path)
    assert states(report)["sumo.refused"] == "skipped"
    assert not target.exists()


def test_missing_sumo_skips_its_checks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    monkeypatch.delenv("SUMO_HOME", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert states(report_on(COLOGNE, tmp_path))["sumo.refused"] == "skipped"


def test_sumo_ends_with_the_context() -> None:
    with loading(COLOGNE) as sumo:
        assert sumo
        child = sumo._child
    assert child.returncode is not None


def test_repair_that_sumo_would_refuse_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    path, _ = find_network("two-way")
    data, check = read_bytes(path), "signals.yellow_short"
    lengthen = REPAIRS[check]

    def spoil(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
        for edit in lengthen(site, issues):
            (change,) = edit.changes
            assert isinstance(change, SetPhases)
            phases = (*change.phases[:-1], (*change.phases[-1], ("next", "99")))
            yield replace(edit, changes=(replace(change, phases=phases),))

    monkeypatch.setitem(REPAIRS, check, spoil)
    fixed = fix_network(data, path, [check])
    assert (fixed.after.data, fixed.made) == (data, [])
    assert fixed.refused
    assert all("sumo.refused" in made.reason and "nextPhase 99" in made.reason for made in fixed.refused)
