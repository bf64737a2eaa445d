"""Where issues are said to be: within five metres of the element at fault, and right on the earth."""

from typing import Any

import networks
import numpy as np
import pytest
import sumolib
from places import Places

from dojo_maps.description import RoadMap
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.validation.runner import run_checks

NEAR = 5.0


def inspected(name: str) -> tuple[RoadMap, dict[str, Any]]:
    path = networks.installed_networks()[name]
    data = networks.read_network_bytes(path)
    road_map, known = read_network(data, path=path, name=name, sha256="")
    return road_map, run_checks(road_map, None, known)


@pytest.mark.sampled(16)
@pytest.mark.parametrize("name", networks.installed_networks())
def test_issues_lie_at_the_element_at_fault(name: str, request: pytest.FixtureRequest) -> None:
    if name in networks.SLOW and not request.config.getoption("--whole"):
        pytest.skip("large: needs --whole")
    road_map, report = inspected(name)
    places = Places(road_map)
    for issue in report["issues"]:
        fault = issue["elements"][0]
        apart = places.distance(fault["kind"], fault["id"], issue["position"])
        assert apart <= NEAR, (issue["check"], fault, apart)


@pytest.mark.parametrize("name", ["cologne8", "ingolstadt7", "fkk_in-ingolstadt"])
def test_positions_on_the_earth_are_those_of_sumolib(name: str) -> None:
    path = networks.installed_networks()[name]
    net = sumolib.net.readNet(str(path))
    issues = inspected(name)[1]["issues"]
    assert issues
    expected = [net.convertXY2LonLat(*issue["position"][:2]) for issue in issues]
    assert np.allclose([issue["lonlat"] for issue in issues], expected, rtol=0, atol=1e-7)


def test_positions_on_the_earth_are_null_without_a_projection() -> None:
    issues = inspected("4x4loop")[1]["issues"]
    assert issues
    assert all(issue["lonlat"] is None for issue in issues)
