"""The stages of an import: each makes a value of those before it, by one record of limits."""

from dataclasses import replace
from pathlib import Path

import pytest
from osm_drawings import Drawing

from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.steps import build_graph
from dojo_maps.sources.osm.junctions.steps import add_midblock_vertices, plan_junctions
from dojo_maps.sources.osm.layout.steps import lay_out
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.pipeline import build_network
from dojo_maps.sources.osm.rules import RULES, ImportRules

STREET = {"highway": "tertiary", "lanes": "2"}


def two_junctions(apart: float) -> Drawing:
    """Two streets from the south into one, and a zebra and a bridge, so that every stage has work to do."""
    d = Drawing()
    d.way((-200, 0), (0, 0), (apart, 0), (100, 0), (200, 0), **STREET)
    for x in (0, apart):
        d.way((x, -150), (x, 0), **STREET)
    d.node(100, 0, highway="crossing", crossing="marked")
    d.way((150, -100), (150, 100), bridge="yes", layer="1", **STREET)
    return d


def build(drawing: Drawing, folder: Path, rules: ImportRules = RULES) -> OsmNetwork:
    path = drawing.write(folder / "a.osm")
    return build_network(read_osm(path), path=path, name="a", sha256="0", rules=rules)


@pytest.mark.parametrize("name", ["12#0", "-12#0", "new3#1ab", "-new3#1ab"])
def test_edge_is_named_as_sumo_names_it(name: str) -> None:
    edge = EdgeId.read(name)
    assert str(edge) == f"{edge}" == name
    assert not edge.section.startswith("-")
    assert edge.forward == (name == edge.section)


def test_stages_leave_their_inputs_as_they_are(tmp_path: Path) -> None:
    path = two_junctions(40).write(tmp_path / "a.osm")
    graph = build_graph(read_osm(path), path)
    graphs = [graph, add_midblock_vertices(graph)]
    plan = plan_junctions(graphs[1])
    before = repr((graphs, plan))
    layout = lay_out(plan)
    assert repr((graphs, plan_junctions(graphs[1]))) == repr((graphs, plan)) == before
    assert len(graph.sections) < len(plan.graph.sections)
    assert len(plan.graph.places) < len(layout.graph.places)


def test_attempts_that_do_not_settle_a_network_are_told(tmp_path: Path) -> None:
    drawing = two_junctions(16)
    once = replace(RULES, network=replace(RULES.network, attempts=1))
    found = [issue for issue in build(drawing, tmp_path, once).issues if issue.check == "osm.not_converged"]
    assert [(issue.elements[0].kind, issue.measured) for issue in found] == [("osm_node", 2)]
    settled = build(drawing, tmp_path)
    assert not [issue for issue in settled.issues if issue.check == "osm.not_converged"]
    assert len(settled.road_map.junctions) < len(build(drawing, tmp_path, once).road_map.junctions)


def test_limits_are_those_that_an_import_is_given(tmp_path: Path) -> None:
    narrow = replace(
        RULES,
        crossings=replace(RULES.crossings, width=2.5),
        lanes=replace(RULES.lanes, usual=3.0),
        heights=replace(RULES.heights, level=7.0),
    )
    built = build(two_junctions(40), tmp_path, narrow).road_map
    assert {crossing.width for crossing in built.crossings} == {2.5}
    driven = [lane for lane in built.lanes if lane.kind == "driving"]
    assert {lane.width for lane in driven} == {3.0}
    assert max(float(lane.shape[:, 2].max()) for lane in driven) == 7.0
