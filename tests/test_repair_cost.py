"""What repairs cost traffic is measured with the same demand before and after, and told everywhere."""

import json
import re
from pathlib import Path

import networks
import pytest

from dojo_maps.cli import main
from dojo_maps.input_files import read_bytes
from dojo_maps.repair.cost import measure_cost
from dojo_maps.repair.rounds import fix_network

_PHASE = re.compile(r'<phase [^>]*state="[^"]*y[^"]*"[^>]*/>\s*')


@pytest.fixture
def hasty(tmp_path: Path) -> Path:
    """A signal that shows no yellow."""
    edges = networks._star_edges(["e", "n", "w", "s"], numLanes=1)
    path = networks._build(tmp_path, "hasty", networks._star()[0], edges)
    path.write_text(_PHASE.sub("", path.read_text()))
    return path


def test_same_traffic_waits_before_and_after(hasty: Path) -> None:
    fixed = fix_network(hasty.read_bytes(), hasty)
    cost = measure_cost(fixed)
    assert cost is not None
    assert cost.before is not None
    assert cost.after is not None
    assert cost.before.vehicles == cost.after.vehicles > 50
    # Yellow takes its time from the greens, so some wait longer.
    assert 0 < cost.before.seconds < cost.after.seconds < 200
    assert measure_cost(fixed) == cost


def test_command_tells_the_cost_on_one_line_in_the_patch_and_in_the_record(
    hasty: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    patch, record = tmp_path / "patch", tmp_path / "fix.json"
    assert main(["fix", str(hasty), "--dry-run", "--patch", str(patch), "--json", str(record)]) == 0
    shown = capsys.readouterr().out.splitlines()
    (line,) = (line for line in shown if line.startswith("mean waiting"))
    told = json.loads(record.read_text())
    waits = [told["waiting"][when]["seconds"] for when in ("before", "after")]
    assert line.startswith(f"mean waiting: {waits[0]:.1f} s before, {waits[1]:.1f} s after (")
    assert f"<!-- {line} -->" in (patch / "repair.tll.xml").read_text()
    assert told["format"] == "dojo-repair"
    assert {repair["check"] for repair in told["repairs"]} == {"signals.missing_yellow"}
    assert told["counts"]["after"]["warning"] < told["counts"]["before"]["warning"]


def test_nothing_is_measured_where_neither_signals_nor_right_of_way_changed() -> None:
    path = networks.installed_networks()["fkk_in-ingolstadt"]
    fixed = fix_network(read_bytes(path), path, ["geometry.gap"])
    assert fixed.made
    assert measure_cost(fixed) is None


def test_network_that_sumo_refused_is_measured_once_it_is_mended(hasty: Path) -> None:
    text = re.sub(r'(<phase [^>]*state="[^"]*)."', r'\1"', hasty.read_text(), count=1)
    cost = measure_cost(fix_network(text.encode(), hasty))
    assert cost is not None
    assert cost.before is None
    assert cost.after is not None
    assert "not measured before" in str(cost)
    assert "SUMO: " in cost.reason


def test_network_that_makes_sumo_write_files_is_not_simulated(hasty: Path) -> None:
    text = hasty.read_text().replace("</net>", '<e1Detector id="d" file="/dev/full"/></net>')
    cost = measure_cost(fix_network(text.encode(), hasty))
    assert cost is not None
    assert (cost.before, cost.after) == (None, None)
    assert str(cost) == "mean waiting: not measured (the network holds more than a network)"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ingolstadt7", "fkk_in-ingolstadt"])
def test_what_fix_claims_is_what_validate_finds(name: str, tmp_path: Path) -> None:
    network, record, report = tmp_path / "mended.net.xml", tmp_path / "fix.json", tmp_path / "report.json"
    source = str(networks.installed_networks()[name])
    main(["fix", source, "-o", str(network), "--json", str(record)])
    main(["validate", str(network), "--json", str(report)])
    claimed, found = json.loads(record.read_text()), json.loads(report.read_text())
    assert claimed["counts"]["after"] == found["counts"]
    counts = {check["id"]: check["count"] for check in found["checks"] if check["count"]}
    assert {check["id"]: check["after"] for check in claimed["checks"] if check["after"]} == counts
