"""Our reading of a network beside that of sumolib, SUMO's own library: they tell the same."""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sumolib

from dojo_maps.description import RoadMap
from dojo_maps.sources.permissions import VEHICLE_CLASSES
from dojo_maps.sources.sumo_net import read_network

pytestmark = pytest.mark.sampled(6)

Both = tuple[RoadMap, Any]


@pytest.fixture(scope="module")
def both(network: str, network_path: Callable[[str], Path]) -> Both:
    path = network_path(network)
    data = path.read_bytes()
    data = gzip.decompress(data) if path.suffix == ".gz" else data
    road_map, _ = read_network(data, path=path, name=network, sha256="")
    theirs = sumolib.net.readNet(
        str(path),
        withPrograms=True,
        withPedestrianConnections=True,
        withInternal=True,
        withMacroConnectors=True,
    )
    return road_map, theirs


def test_roads_and_lanes_are_the_same(both: Both) -> None:
    ours, theirs = both
    edges = [edge for edge in theirs.getEdges() if edge.getFunction() in ("", "connector")]
    assert [road.id for road in ours.roads] == [edge.getID() for edge in edges]
    lanes = {lane.id: lane for lane in ours.lanes}
    for road, edge in zip(ours.roads, edges, strict=True):
        assert (road.from_junction, road.to_junction) == (
            edge.getFromNode().getID(),
            edge.getToNode().getID(),
        )
        assert (road.name, road.kind, road.priority) == (edge.getName(), edge.getType(), edge.getPriority())
        assert road.bidi == (edge.getBidi().getID() if edge.getBidi() else None)
        assert list(road.lanes) == [lane.getID() for lane in edge.getLanes()]
        for lane in edge.getLanes():
            mine = lanes[lane.getID()]
            measures = (lane.getSpeed(), lane.getLength(), lane.getWidth())
            assert (mine.speed, mine.length, mine.width) == measures
            assert np.array_equal(mine.shape, np.array(lane.getShape3D()))
            assert set(mine.allow) == set(lane.getPermissions()) & set(
                VEHICLE_CLASSES
            )  # The others are old names.


def test_junctions_are_the_same(both: Both) -> None:
    ours, theirs = both
    for junction in ours.junctions:
        node = theirs.getNode(junction.id)
        assert junction.kind == node.getType()
        assert junction.position == node.getCoord3D()
        assert [tuple(p) for p in junction.polygon.tolist()] == [tuple(p) for p in node.getShape3D()]
    assert {j.id for j in ours.junctions} == {node.getID() for node in theirs.getNodes()}


def test_connections_are_the_same(both: Both) -> None:
    ours, theirs = both
    expected = {}
    for edge in theirs.getEdges():
        for connection in (c for group in edge.getOutgoing().values() for c in group):
            start, end = connection.getFromLane().getID(), connection.getToLane().getID()
            if not start.startswith(":") and not end.startswith(":"):
                index = connection.getTLLinkIndex() if connection.getTLLinkIndex() >= 0 else None
                signal = connection.getTLSID() if index is not None else None
                via = connection.getViaLaneID() or None
                expected[start, end] = (connection.getDirection(), connection.getState(), via, signal, index)
    found = {
        (c.from_lane, c.to_lane): (c.direction, c.state, c.via[0] if c.via else None, c.signal, c.link_index)
        for c in ours.connections
    }
    assert found == expected


def test_signal_programs_are_the_same(both: Both) -> None:
    ours, theirs = both
    for tls in theirs.getTrafficLights():
        signal = next(signal for signal in ours.signals if signal.id == tls.getID())
        programs = tls.getPrograms()
        assert [program.id for program in signal.programs] == list(programs)
        for program in signal.programs:
            phases = programs[program.id].getPhases()
            assert [(p.state, p.duration) for p in program.phases] == [(p.state, p.duration) for p in phases]
            assert [list(p.following) for p in program.phases] == [list(p.next) for p in phases]


def test_foes_and_their_numbers_are_the_same(both: Both) -> None:
    ours, theirs = both
    ways = {
        way.link: (theirs.getNode(junction.id), number, way)
        for junction in ours.junctions
        for number, way in enumerate(junction.right_of_way)
    }
    for edge in theirs.getEdges():
        for link in (link for group in edge.getOutgoing().values() for link in group):
            name = f"{link.getFromLane().getID()}->{link.getToLane().getID()}"
            if name in ways and not name.startswith(":"):
                node, number, way = ways[name]
                assert node.getLinkIndex(link) == number
                assert list(way.foes) == [k for k in range(len(node._foes)) if node.areFoes(number, k)]
