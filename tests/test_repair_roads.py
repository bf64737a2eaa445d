"""Junctions that only a stub divides become one, on request, and signals keep theirs."""

from pathlib import Path

import networks
from test_repair import load_in_sumo

from dojo_maps.repair.cost import measure_cost
from dojo_maps.repair.fixing import patch_of
from dojo_maps.repair.rounds import fix_network

CHECK = "geometry.short_edge"


def _pair(folder: Path, kind: str) -> Path:
    """Two junctions 14 m apart, each with a leg to one side."""
    places = {"a": (0, 0), "b": (14, 0), "w": (-150, 0), "e": (164, 0), "n": (0, 150), "s": (14, -150)}
    nodes = [networks._node(n, x, y, type_=kind if n in "ab" else "priority") for n, (x, y) in places.items()]
    pairs = (("w", "a"), ("a", "b"), ("b", "e"), ("n", "a"), ("s", "b"))
    edges = [e for one, two in pairs for e in networks._both_ways(f"{one}{two}", one, two, numLanes=1)]
    return networks._build(folder, "pair", nodes, edges, "--no-turnarounds")


def test_short_road_goes_and_its_junctions_become_one_on_request(tmp_path: Path) -> None:
    path = _pair(tmp_path, "priority")
    assert not fix_network(path.read_bytes(), path).made
    fixed = fix_network(path.read_bytes(), path, [CHECK])
    assert fixed.before.counts[CHECK][0] == 2
    assert CHECK not in fixed.after.counts, fixed.refused
    roads = [set(state.site.facts.roads) for state in (fixed.before, fixed.after)]
    assert roads[0] - roads[1] == {"ab", "-ab"}
    assert '<join nodes="a b"/>' in patch_of(fixed)["repair.nod.xml"]
    path.write_bytes(fixed.after.data)
    assert load_in_sumo(path) == []
    cost = measure_cost(fixed)
    assert cost is not None
    assert cost.before is not None
    assert cost.after is not None


def test_signals_are_not_joined(tmp_path: Path) -> None:
    path = _pair(tmp_path, "traffic_light")
    fixed = fix_network(path.read_bytes(), path, [CHECK])
    assert fixed.before.counts[CHECK][0] == 2
    assert fixed.after.data == fixed.before.data
