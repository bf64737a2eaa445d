"""The stages of an import: each makes a value of those before it, by one record of limits."""

from dataclasses import replace
from pathlib import Path

import pytest
from osm_drawings import Drawing, cross

from dojo_maps.geometry.polylines import along
from dojo_maps.signals.waiting import find_meetings
from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.steps import build_graph
from dojo_maps.sources.osm.junctions.steps import add_midblock_vertices, plan_junctions
from dojo_maps.sources.osm.layout.steps import lay_out
from dojo_maps.sources.osm.layout.track_settling import settle_tracks
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


def test_tracks_leave_the_stages_before_them_as_they_are(tmp_path: Path) -> None:
    drawing = two_junctions(60)
    drawing.way((30, -80), (30, 0), (30, 80), railway="tram")
    drawing.way((-200, 20), (-100, 20), (-100, 0), highway="cycleway")
    path = drawing.write(tmp_path / "a.osm")
    plan = plan_junctions(add_midblock_vertices(build_graph(read_osm(path), path)))
    layout = lay_out(plan)
    before = repr((plan, layout))
    settled = settle_tracks(layout, {}).tracks
    closed = settle_tracks(layout, {}, layout.junctions.of.keys()).tracks
    assert repr((plan, layout)) == repr((plan, lay_out(plan))) == before
    assert settled is not None
    assert closed is not None
    assert len(settled.built) >= 3
    assert {link.node for link in settled.links} & layout.junctions.of.keys()
    assert not {link.node for link in closed.links} & layout.junctions.of.keys()


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


def test_who_waits_inside_a_junction_stands_in_nobodys_way(tmp_path: Path) -> None:
    """netconvert lets them wait where the middles of two ways meet: a bus would stand in the other's."""
    depths, lengths = [], []
    for widest in (0.0, 2.5):
        rules = replace(RULES, waiting=replace(RULES.waiting, widest=widest))
        road_map = build(cross(), tmp_path, rules).road_map
        states = {s.id: [phase.state for phase in s.programs[0].phases] for s in road_map.signals}
        found = list(find_meetings(road_map, states, widest=2.5, nearest=1.0, walkers=True))
        depths.append(max((m.connection.waits or 0.0) - m.place for m in found))
        lengths.append([float(along(c.shape)[-1]) for c in road_map.connections])
    assert depths[0] > 0.1
    assert depths[1] == pytest.approx(0.0, abs=0.02)
    assert lengths[0] == pytest.approx(lengths[1], abs=0.05), "the ways stay as they are"
