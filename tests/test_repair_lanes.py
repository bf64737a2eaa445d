"""Lanes that lead nowhere get a connection, and nothing else of the network changes."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import networks
import pytest
from test_repair import load_in_sumo

from dojo_maps.repair.fixing import patch_of
from dojo_maps.repair.rounds import Fixed, fix_network
from dojo_maps.signals.conflicts import list_foes

CHECK = "topology.lane_dead_end"


def _star(folder: Path, kind: str, *connections: str, lanes: int = 2) -> Path:
    """Four legs, that in the west with two lanes; from there only these connections lead on."""
    nodes, _ = networks._star(kind)
    edges = [*networks._star_edges(["w"], numLanes=2), *networks._star_edges(["e", "n", "s"], numLanes=lanes)]
    written = [f'<connection from="w" to="{c[:-2]}" fromLane="0" toLane="{c[-1]}"/>' for c in connections]
    return networks._build(folder, "star", nodes, edges, "--no-turnarounds", connections=written)


def _right_of_way(state: object) -> dict[frozenset[str], set[str]]:
    return {
        frozenset((foes.one, foes.other)): {
            name for name, waits in ((foes.one, foes.one_waits), (foes.other, foes.other_waits)) if waits
        }
        for junction in state.site.facts.map.junctions  # type: ignore[attr-defined]
        for foes in list_foes(junction)
    }


def _outside(data: bytes) -> dict[str, dict[str, str]]:
    root = ET.fromstring(data)  # noqa: S314 - netconvert's
    return {lane.get("id", ""): lane.attrib for lane in root.iter("lane") if lane.get("id", "")[0] != ":"}


def _check_only_the_way_is_new(fixed: Fixed, way: str, folder: Path) -> None:
    assert fixed.before.counts[CHECK] == (1, 1)
    assert CHECK not in fixed.after.counts, fixed.refused
    connections = [set(state.site.facts.connections) for state in (fixed.before, fixed.after)]
    assert connections[1] - connections[0] == {way}
    assert connections[0] < connections[1]
    rules = [_right_of_way(state) for state in (fixed.before, fixed.after)]
    assert {pair: waits for pair, waits in rules[1].items() if way not in pair} == rules[0]
    assert all(waits for waits in rules[1].values())
    assert _outside(fixed.before.data) == _outside(fixed.after.data)
    path = folder / "mended.net.xml"
    path.write_bytes(fixed.after.data)
    assert load_in_sumo(path) == []


@pytest.mark.parametrize("kind", ["priority", "right_before_left", "traffic_light"])
def test_lane_leads_into_the_lane_that_nobody_enters(kind: str, tmp_path: Path) -> None:
    path = _star(tmp_path, kind, "-s_0", "-e_0")
    fixed = fix_network(path.read_bytes(), path, [CHECK])
    _check_only_the_way_is_new(fixed, "w_1->-e_1", tmp_path)
    added = '<connection from="w" fromLane="1" to="-e" toLane="1"/>'
    assert added in patch_of(fixed)["repair.con.xml"]


def test_lane_merges_where_there_is_one_lane_only(tmp_path: Path) -> None:
    path = _star(tmp_path, "traffic_light", "-s_0", "-e_0", lanes=1)
    fixed = fix_network(path.read_bytes(), path, [CHECK])
    _check_only_the_way_is_new(fixed, "w_1->-e_0", tmp_path)
    signals = [state.site.facts.map.signals[0] for state in (fixed.before, fixed.after)]
    states = [[phase.state for phase in signal.programs[0].phases] for signal in signals]
    assert [state[:-1] for state in states[1]] == states[0]
    assert "signals.green_conflict" not in fixed.after.counts


def test_connection_that_would_tear_the_network_is_given_up(tmp_path: Path) -> None:
    path = _star(tmp_path, "priority", "-s_0", "-e_0")
    # The road ends 20 m before the junction: netconvert would draw it anew.
    text = re.sub(r'(<lane id="w_[01]"[^>]*shape="[^"]*) [^ "]*"', r'\1 -40.00,-3.00"', path.read_text())
    fixed = fix_network(text.encode(), path, [CHECK])
    assert fixed.before.counts[CHECK][0] > 0
    assert not fixed.made
    assert fixed.after.data == fixed.before.data
