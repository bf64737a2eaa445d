"""Generated traffic, judged by SUMO: an hour without a jam, every movement used, people on the crossings."""

import re
import subprocess
import xml.etree.ElementTree as ET
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import gymnasium
import numpy as np
import osm_drawings
import pytest
from test_sources_osm import helsinki

from dojo_env.errors import ConfigError
from dojo_maps.bundle import Bundle
from dojo_maps.conversion import ConvertOptions, convert
from dojo_maps.demand import DemandOptions, write_demand
from dojo_maps.demand.capacities import Capacities
from dojo_maps.demand.movements import find_rides, find_routes
from dojo_maps.demand.route_file import Trip, find_stubs, format_routes
from dojo_maps.demand.volumes import SATURATION, fill_routes
from dojo_maps.sources.netconvert import find_netconvert

WITH_DEMAND = ConvertOptions(demand=None)


@dataclass(frozen=True)
class Hour:
    """What SUMO counted."""

    loaded: int
    inserted: int
    waiting: int
    teleports: int
    walkers: int
    stopped: float
    running: float
    complaints: str


def simulate(bundle: Bundle, folder: Path, seed: int = 3, patience: int = 120) -> Hour:
    """Run an hour of a bundle's demand in SUMO; who stands longer than the patience, seconds, is moved on."""
    statistics, summary = folder / "statistics.xml", folder / "summary.xml"
    sumo = find_netconvert().with_name("sumo")
    command = [
        *(sumo, "-n", bundle.network, "-r", bundle.folder / "demand.rou.xml", "--end", "3600"),
        *("--seed", seed, "--statistic-output", statistics, "--summary", summary, "--no-step-log"),
        *("--xml-validation", "never", "--max-depart-delay", "-1", "--duration-log.statistics"),
        *("--time-to-teleport", patience),
    ]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    root = ET.parse(statistics).getroot()  # noqa: S314

    def count(element: str, name: str) -> int:
        found = root.find(element)
        assert found is not None
        return int(float(found.get(name, "0")))

    steps = [step.attrib for step in ET.parse(summary).getroot()][600:]  # noqa: S314
    return Hour(
        loaded=count("vehicles", "loaded"),
        inserted=count("vehicles", "inserted"),
        waiting=count("vehicles", "waiting"),
        teleports=count("teleports", "total"),
        walkers=count("pedestrianStatistics", "number"),
        stopped=float(np.mean([float(step["halting"]) for step in steps])),
        running=float(np.mean([float(step["running"]) for step in steps])),
        complaints=done.stderr,
    )


def used_movements(bundle: Bundle) -> Counter[tuple[str, str]]:
    """Count the vehicles of each movement in the route file."""
    root = ET.parse(bundle.folder / "demand.rou.xml").getroot()  # noqa: S314
    roads = {route.get("id"): route.get("edges", "").split() for route in root.findall("route")}
    return Counter(
        arc
        for vehicle in root.findall("vehicle")
        for arc in zip(roads[vehicle.get("route")], roads[vehicle.get("route")][1:], strict=False)
    )


def wanted_movements(bundle: Bundle) -> set[tuple[str, str]]:
    """List the signalled movements that cars may make, without turnarounds, from the network itself."""
    root = ET.parse(bundle.network).getroot()  # noqa: S314
    allowed = {
        lane.get("id"): "passenger" in lane.get("allow", "passenger").split()
        and "passenger" not in lane.get("disallow", "").split()
        for lane in root.iter("lane")
    }
    return {
        (c.get("from", ""), c.get("to", ""))
        for c in root.findall("connection")
        if c.get("tl") is not None
        and c.get("dir") != "t"
        and not c.get("from", "").startswith(":")
        and all(allowed.get(f"{c.get(end)}_{c.get(end + 'Lane')}") for end in ("from", "to"))
    }


def assert_flows(bundle: Bundle, hour: Hour) -> None:
    assert hour.teleports == 0, hour.complaints
    assert hour.waiting <= 0.05 * hour.loaded
    assert hour.inserted >= 0.95 * hour.loaded
    assert hour.stopped >= 1, "a junction that is never waited at is empty"
    assert hour.stopped <= 0.75 * hour.running
    assert wanted_movements(bundle) <= set(used_movements(bundle))


def test_cologne1_is_neither_empty_nor_jammed(tmp_path: Path) -> None:
    bundle, report = convert("cologne1", tmp_path / "cologne1.dojo", WITH_DEMAND)
    hour = simulate(bundle, tmp_path)
    assert_flows(bundle, hour)
    assert report["demand"]["vehicles"] == hour.loaded
    assert 1500 < hour.loaded < 3500, "its recorded hour has 2,015"


@pytest.mark.sampled(3)
@pytest.mark.parametrize("shape", ["cross", "dual_carriageways", "dog_leg", "slip_lane", "left_hand"])
def test_drawn_junction_flows(shape: str, tmp_path: Path) -> None:
    path = getattr(osm_drawings, shape)().write(tmp_path / f"{shape}.osm")
    bundle, _ = convert(str(path), tmp_path / f"{shape}.dojo", WITH_DEMAND)
    hour = simulate(bundle, tmp_path)
    assert_flows(bundle, hour)
    assert hour.walkers > 0


@pytest.mark.sampled(0)
def test_city_flows(tmp_path: Path) -> None:
    bundle, report = convert(str(helsinki()), tmp_path / "city.dojo", WITH_DEMAND)
    hour = simulate(bundle, tmp_path, patience=300)  # Some of its reds last 135 s.
    assert wanted_movements(bundle) <= set(used_movements(bundle))
    assert hour.teleports == 0
    assert hour.waiting <= 0.05 * hour.loaded
    assert hour.walkers > 0.9 * report["demand"]["walkers"]


def test_only_those_who_drive_are_impatient(tmp_path: Path) -> None:
    bundle, _ = convert("two-way", tmp_path / "two-way.dojo", WITH_DEMAND)
    demand = ET.parse(bundle.folder / "demand.rou.xml")  # noqa: S314
    types = {each.get("id"): each.get("impatience") for each in demand.iter("vType")}
    assert types["car"] == types["bus"] == "0.5"
    assert types["walker"] is None


def test_demand_is_the_same_for_a_seed_and_differs_between_seeds(tmp_path: Path) -> None:
    bundle, _ = convert("cologne1", tmp_path / "cologne1.dojo", WITH_DEMAND)
    files = [tmp_path / f"{k}.rou.xml" for k in range(3)]
    for path, seed in zip(files, (0, 0, 1), strict=True):
        write_demand(bundle.road_map, bundle.network, path, DemandOptions(seed=seed))
    texts = [path.read_text() for path in files]
    assert texts[0] == texts[1] == (bundle.folder / "demand.rou.xml").read_text()
    assert texts[0] != texts[2]


def test_demand_has_the_volume_that_is_asked_for(tmp_path: Path) -> None:
    bundle, report = convert("cologne1", tmp_path / "cologne1.dojo", ConvertOptions(demand=900.0))
    assert report["demand"]["vehicles"] == pytest.approx(900, rel=0.03)
    assert wanted_movements(bundle) <= set(used_movements(bundle))


def test_filling_saturates_each_route_somewhere(tmp_path: Path) -> None:
    bundle, _ = convert("cologne3", tmp_path / "cologne3.dojo")
    routes = find_routes(bundle.road_map)
    rates, fullest = fill_routes(bundle.road_map, routes)
    assert fullest == pytest.approx(SATURATION)
    assert (rates > 0).all()
    for route in routes:
        assert len(set(route.roads)) == len(route.roads)
        assert route.movement in route.arcs


def test_cyclists_are_as_many_as_their_lanes_take(tmp_path: Path) -> None:
    """Ten an hour on each movement are too many where all of them wait for a short green."""
    drawing = osm_drawings.cross()
    for _, tags in drawing.ways:
        tags["cycleway"] = "lane"
    bundle, report = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo", WITH_DEMAND)
    rides = find_rides(bundle.road_map, own_lanes=True)
    assert 0 < report["demand"]["bicycles"] <= 10 * len(rides)
    _, fullest = fill_routes(bundle.road_map, rides)
    assert fullest == pytest.approx(SATURATION)


def test_vehicles_do_not_depart_on_top_of_each_other_on_a_stub(tmp_path: Path) -> None:
    path = osm_drawings.sausage().write(tmp_path / "a.osm")
    bundle, _ = convert(str(path), tmp_path / "a.dojo")
    stubs = find_stubs(bundle.road_map)
    assert stubs
    lanes = {lane.road: lane for lane in bundle.road_map.lanes}
    assert all((lanes[road.id].length < 15) == (road.id in stubs) for road in bundle.road_map.roads)
    trips = [Trip(depart=k, roads=(road,), vehicle_class="bus") for road in sorted(stubs) for k in range(3)]
    assert format_routes(trips, (), stubs).count('departPos="last"') == len(trips)
    assert "departPos" not in format_routes(trips, ())


def test_short_road_before_a_signal_takes_what_one_green_lets_over(tmp_path: Path) -> None:
    """On 8 m nobody passes who waits for another movement, so its lanes are filled one after the other."""
    road_map, short = convert("ingolstadt7", tmp_path / "a.dojo")[0].road_map, "51857517#1"
    lanes, links = {lane.id: lane for lane in road_map.lanes}, defaultdict(list)
    for link in road_map.connections:
        links[lanes[link.from_lane].road, lanes[link.to_lane].road].append(link)
    programs = {signal.id: signal.programs[0] for signal in road_map.signals}
    seen = 0
    for route in find_routes(road_map):
        ways = [links[arc][:1] for arc in route.arcs]
        room = dict(Capacities(road_map).rooms(ways)).get(short)
        for link in (way[0] for way in ways if lanes[way[0].from_lane].road == short and room is not None):
            program = programs[link.signal or ""]
            green = sum(p.duration for p in program.phases if p.state[link.link_index or 0] in "Gg")
            assert lanes[link.from_lane].length < 20
            assert 0 < (room or 0.0) <= 1_800 * green / sum(p.duration for p in program.phases) + 1
            seen += 1
    assert seen


def test_buses_are_no_more_than_find_room(tmp_path: Path) -> None:
    """One takes as much as two cars; many movements for buses alone meet on one road."""
    road_map = convert(str(osm_drawings.cross().write(tmp_path / "a.osm")), tmp_path / "a.dojo")[0].road_map
    buses = [replace(route, vehicle_class="bus") for route in find_routes(road_map)]
    few, little = fill_routes(road_map, buses)
    many, full = fill_routes(road_map, buses * 12)
    assert few == pytest.approx(6.0)
    assert little < full == pytest.approx(SATURATION, rel=0.01)
    assert 1.0 <= many.min() < many.max() <= 6.0


def test_bundle_with_demand_is_a_scenario(tmp_path: Path) -> None:
    path = osm_drawings.cross().write(tmp_path / "my_junction.osm")
    bundle, _ = convert(str(path), tmp_path / "my_junction.dojo", WITH_DEMAND)
    env = gymnasium.make("dojo_env/TrafficSignal-v0", scenario=str(bundle.folder))
    env.reset(seed=1)
    over = False
    while not over:
        *_, over, _ = env.step(env.action_space.sample())
    metrics = env.unwrapped.metrics()  # type: ignore[attr-defined]
    assert metrics["throughput"] > 300
    assert metrics["pedestrians"] > 0
    env.close()


def test_a_crossing_that_nothing_is_connected_with_has_no_walkers(
    network_path: Callable[[str], Path], tmp_path: Path
) -> None:
    good = network_path("walkers_signal").read_text()
    names = re.findall(r'<edge id="(:\w+_c\d)" function="crossing"', good)
    path = tmp_path / "a.net.xml"
    path.write_text(good.replace(f'<edge id="{names[0]}"', '<edge id=":nowhere_c0"', 1))
    whole, less = (
        convert(str(each), tmp_path / f"{k}.dojo", WITH_DEMAND)[1]["demand"]["walkers"]
        for k, each in enumerate((network_path("walkers_signal"), path))
    )
    assert less < whole or len(names) == 1


def test_no_car_takes_a_connection_that_is_for_bicycles(tmp_path: Path) -> None:
    """SUMO ends at a route over a connection that bars its vehicle, though both of its lanes are open."""
    drawn, _ = convert(str(osm_drawings.cross().write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    barred = next(link for link in drawn.road_map.connections if link.direction == "s" and link.signal)
    roads = {lane.id: lane.road for lane in drawn.road_map.lanes}
    turn = roads[barred.from_lane], roads[barred.to_lane]
    record = f'<connection from="{turn[0]}" to="{turn[1]}" '
    path = tmp_path / "b.net.xml"
    path.write_text(drawn.network.read_text().replace(record, f'{record}allow="bicycle" '))
    bundle, _ = convert(str(path), tmp_path / "b.dojo", WITH_DEMAND)
    links = {(roads[link.from_lane], roads[link.to_lane]): link.allow for link in bundle.road_map.connections}
    assert links.pop(turn) == ("bicycle",)
    assert set(links.values()) == {None}
    assert turn not in used_movements(bundle)
    assert simulate(bundle, tmp_path).loaded > 100


def test_nobody_walks_to_the_other_side_of_the_same_street(tmp_path: Path) -> None:
    """SUMO may look for the crossing at the street's other end, and stops where there is none."""
    path = osm_drawings.cross().write(tmp_path / "cross.osm")
    bundle, report = convert(str(path), tmp_path / "cross.dojo", WITH_DEMAND)
    junctions = {road.id: {road.from_junction, road.to_junction} for road in bundle.road_map.roads}
    walks = re.findall(r'<walk edges="([^ "]+) ([^ "]+)"', (bundle.folder / "demand.rou.xml").read_text())
    assert len(walks) == report["demand"]["walkers"] > 0
    assert all(junctions[start] != junctions[end] for start, end in walks)


def test_people_on_a_narrow_sidewalk_meet_nobody(tmp_path: Path) -> None:
    """Who meets on a single stripe stands, up to 300 s, until SUMO lets one walk through the other."""
    path = tmp_path / "a.net.xml"
    command = [
        *(find_netconvert().with_name("netgenerate"), "--spider", "--spider.arm-number", "4"),
        *("--spider.circle-number", "1", "--default.sidewalk-width", "1"),
        *("--sidewalks.guess", "--crossings.guess", "-j", "traffic_light", "-o", path),
    ]
    subprocess.run([str(part) for part in command], check=True, capture_output=True)
    bundle, report = convert(str(path), tmp_path / "a.dojo", WITH_DEMAND)
    assert report["demand"]["walkers"] > 200
    assert "jammed" not in simulate(bundle, tmp_path, patience=-1).complaints


def test_bundle_without_demand_is_none(tmp_path: Path) -> None:
    bundle, report = convert("cologne1", tmp_path / "cologne1.dojo")
    assert "demand" not in report
    with pytest.raises(ConfigError, match="no demand"):
        gymnasium.make("dojo_env/TrafficSignal-v0", scenario=str(bundle.folder))


def test_map_that_no_car_can_cross_has_no_demand(tmp_path: Path) -> None:
    drawing = osm_drawings.Drawing()
    drawing.way((0, 0), (100, 0), highway="residential")
    bundle, report = convert(str(drawing.write(tmp_path / "one.osm")), tmp_path / "one.dojo", WITH_DEMAND)
    assert "demand" not in report
    assert not (bundle.folder / "demand.rou.xml").exists()
