"""Recall: defects planted in real networks are found by the right check at the right element, and only there.

`pytest tests/test_validation_mutations.py --whole` plants every kind several times in every network; by
default a seeded sample of the same mutants runs.
"""

import copy
import logging
import random
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree as ET

import mutations
import networks
import pytest
from places import Places

from dojo_maps.description import RoadMap
from dojo_maps.errors import SourceError
from dojo_maps.issue import Issue
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.validation.runner import find_issues

NETWORKS = (
    "cologne1", "cologne3", "cologne8", "ingolstadt1", "ingolstadt7", "grid4x4", "arterial4x4", "OW",
    "RiLSA1-rilsa1", "fkk_in-ingolstadt", "fokr_bs_demo-fokr_bs", "hiking", "3x3grid-3x3Grid2lanes",
    "highway",
)  # fmt: skip
SEEDS, SAMPLE = 4, 1
LEAST_FOUND = 0.98
NEAR = 5.0
Key = tuple[str, tuple[tuple[str, str], ...], str, float | None, float | None]


@lru_cache(maxsize=len(NETWORKS))
def _base(name: str) -> tuple[ET.Element, dict[Key, Issue]]:
    """A network as it is, and its report."""
    root = ET.fromstring(networks.read_network_bytes(networks.installed_networks()[name]))  # noqa: S314
    return root, _inspect(root)[1]


def _inspect(root: ET.Element) -> tuple[RoadMap, dict[Key, Issue]]:
    data = ET.tostring(root, encoding="utf-8")
    road_map, known = read_network(data, path=Path("mutant.net.xml"), name="mutant", sha256="")
    issues, states = find_issues(road_map, None, known)
    assert not [state for state in states.values() if state.startswith("crashed")], states
    return road_map, {_key(issue): issue for issue in issues}


def _key(issue: Issue) -> Key:
    """What tells an issue from others in a report, rounded as there."""
    elements = tuple((element.kind, element.id) for element in issue.elements)
    numbers = [None if x is None else round(x, 4) for x in (issue.measured, issue.limit)]
    return issue.check, elements, issue.severity.value, numbers[0], numbers[1]


def _surroundings(road_map: RoadMap, planted: Iterable[tuple[str, str]]) -> set[tuple[str, str]]:
    """All that an element touches: lanes, roads, junctions at their ends, signals and what they control."""
    junctions = {junction.id: junction for junction in road_map.junctions}
    roads = {road.id: road for road in road_map.roads}
    at = {lane.id: roads[lane.road] for lane in road_map.lanes}
    near: set[str] = set()
    for kind, id_ in planted:
        names = id_.split("->") if kind == "connection" else [id_]
        for name in names:
            road = at.get(name) or roads.get(name)
            near |= {road.from_junction, road.to_junction} if road else set()
        if kind in ("crossing", "walking_area"):
            near.add(id_[1:].rpartition("_")[0])
        near |= {id_} if kind == "junction" else set()
        near |= {j for signal in road_map.signals if signal.id == id_ for j in signal.junctions}
    near |= {j for s in road_map.signals if set(s.junctions) & near for j in s.junctions}
    found = {("junction", j) for j in near}
    for name in near & set(junctions):
        for road in (*junctions[name].incoming, *junctions[name].outgoing):
            found |= {("road", road), *(("lane", lane) for lane in roads[road].lanes)}
    found |= {("signal", s.id) for s in road_map.signals if set(s.junctions) & near}
    found |= {("crossing", c.id) for c in road_map.crossings if c.junction in near}
    return found | {("walking_area", a.id) for a in road_map.walking_areas if a.junction in near}


def _judge(
    base: dict[Key, Issue], mutant: dict[Key, Issue], road_map: RoadMap, planted: mutations.Planted
) -> str:
    """Say what is wrong with the report on a mutant; nothing if it is right."""
    added, removed = mutant.keys() - base.keys(), base.keys() - mutant.keys()
    about = [key for key in added if key[0] == planted.check]
    if planted.element[1]:
        about = [key for key in about if planted.element in key[1]]
    if not about:
        return f"not found; instead: {sorted(added)[:4]}"
    places = Places(road_map)
    for key in added:
        kind, id_ = key[1][0]
        if (kind, id_) in places and places.distance(kind, id_, mutant[key].position) > NEAR:
            return f"{key[0]} is said to be elsewhere than its {kind} {id_}"
    if planted.everywhere:
        strange = [key for key in added if key[0] not in planted.also | {planted.check}]
        return f"also reported: {strange[:3]}" if strange else ""
    near = _surroundings(road_map, [planted.element]) | {planted.element}
    wrong = [key for key in added - set(about) if key[0] not in planted.also | {planted.check}]
    far = [key for key in added | removed if not near & set(key[1])]
    return f"also reported: {wrong[:3]}; elsewhere: {far[:3]}" if wrong or far else ""


def _mutants(kind: mutations.Kind, count: int) -> Iterator[tuple[str, mutations.Net, mutations.Planted]]:
    """Plant a kind of defect up to so many times, in networks chosen by its name."""
    pairs = [(name, seed) for seed in range(SEEDS) for name in NETWORKS]
    random.Random(kind.__name__).shuffle(pairs)  # noqa: S311 - no secret
    for name, seed in pairs:
        label = f"{name} {kind.__name__} {seed}"
        net = mutations.Net(copy.deepcopy(_base(name)[0]))
        try:
            planted = kind(net, random.Random(label))  # noqa: S311
        except mutations.NoPlaceError:
            continue
        yield label, net, planted
        count -= 1
        if count == 0:
            return


def _fault(label: str, net: mutations.Net, planted: mutations.Planted) -> str:
    try:
        road_map, mutant = _inspect(net.root)
    except SourceError as error:
        return f"refused: {error}"
    return _judge(_base(label.split(maxsplit=1)[0])[1], mutant, road_map, planted)


@pytest.mark.slow
def test_planted_defects_are_found_where_they_are(request: pytest.FixtureRequest) -> None:
    most = len(NETWORKS) * SEEDS if request.config.getoption("--whole") else SAMPLE
    failures, count = [], 0
    for kind in mutations.KINDS:
        before = count
        for label, net, planted in _mutants(kind, most):
            count += 1
            fault = _fault(label, net, planted)
            if fault:
                failures.append(f"{label}: {planted.check} {planted.element}: {fault}")
        assert count > before, f"no network has a place for {kind.__name__}"
    logging.getLogger(__name__).info("%d of %d mutants reported right", count - len(failures), count)
    assert len(failures) <= (1 - LEAST_FOUND) * count, "\n".join(failures)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", NETWORKS)
def test_report_stays_the_same_when_nothing_is_planted(name: str) -> None:
    root, base = _base(name)
    assert _inspect(copy.deepcopy(root))[1].keys() == base.keys()
