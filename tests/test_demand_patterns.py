"""Traffic by a pattern: the same for a seed, another for another one, and what SUMO makes of it."""

import re
import subprocess
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dojo_env.config import build_config
from dojo_env.errors import ConfigError
from dojo_env.local_world import LocalWorld
from dojo_env.recording import read_recording
from dojo_env.replaying import find_map
from dojo_env.scenario import Scenario, find_scenario, open_map
from dojo_maps.bundle import Bundle
from dojo_maps.demand.bus_stops import BusStops
from dojo_maps.demand.changing import ChangingTraffic
from dojo_maps.demand.patterns import Pattern, find_pattern, list_patterns
from dojo_maps.demand.route_file import Trip
from dojo_maps.description import Prop
from dojo_maps.errors import SourceError
from dojo_maps.sumo_programs import find_program


@pytest.fixture(scope="module")
def cologne() -> Bundle:
    return open_map(find_scenario("cologne1"))


def draw(bundle: Bundle, pattern: str | Pattern, seed: int) -> list[ET.Element]:
    """Draw an hour; returns its vehicles and people in their order."""
    found = pattern if isinstance(pattern, Pattern) else find_pattern(pattern)
    text = ChangingTraffic(bundle.road_map, bundle.network, found).format(seed, begin=0, end=3600)
    root = ET.fromstring(text)  # noqa: S314
    edges = {route.get("id"): route.get("edges", "") for route in root.findall("route")}
    for vehicle in root.findall("vehicle"):
        vehicle.set("edges", edges[vehicle.get("route")])
    return [*root.findall("vehicle"), *root.findall("person")]


def test_a_seed_draws_the_same_traffic_and_another_one_other_traffic(cologne: Bundle) -> None:
    traffic = ChangingTraffic(cologne.road_map, cologne.network, find_pattern("mixed"))
    first, again, other = (traffic.format(seed, begin=0, end=900) for seed in (1, 1, 2))
    assert first == again != other


def test_surges_change_side_at_other_times_for_each_seed(cologne: Bundle) -> None:
    def find_busiest(seed: int) -> list[str]:
        """Tell from where most come, in each two minutes."""
        counts = [Counter[str]() for _ in range(30)]
        for vehicle in draw(cologne, "surges", seed):
            start = vehicle.get("edges", "").split()[0]
            counts[int(float(vehicle.get("depart", "0")) // 120)][start] += 1
        return [count.most_common(1)[0][0] for count in counts]

    one, other = find_busiest(1), find_busiest(2)
    assert one != other
    for busiest in (one, other):
        assert len(set(busiest)) >= 3
        assert 4 <= sum(a != b for a, b in pairwise(busiest)) <= 25


def test_platoons_follow_each_other_and_the_pattern_keeps_the_volume(cologne: Bundle) -> None:
    def measure(pattern: str) -> tuple[float, int]:
        """Tell the share of cars that start 2 s after another on their route, and how many there are."""
        vehicles = draw(cologne, pattern, 3)
        times = {(v.get("route"), round(float(v.get("depart", "0")), 1)) for v in vehicles}
        close = sum((route, round(time - 2.0, 1)) in times for route, time in times)
        return close / len(times), len(vehicles)

    usual = replace(find_pattern("platoons"), platoons=(0, 0))
    close, count = measure("platoons")
    alone = len(draw(cologne, usual, 3))
    assert close > 0.7
    assert count == pytest.approx(alone, rel=0.2)


def test_left_turns_grow_and_a_sides_total_does_not(cologne: Bundle) -> None:
    def measure(factor: float) -> tuple[float, int]:
        pattern = Pattern(name="lefts", left_turns=(factor, factor))
        ways = Counter(v.get("edges", "") for v in draw(cologne, pattern, 1))
        lefts = {" ".join(r.roads) for r in traffic._routes if r.direction == "l"}
        return sum(ways[way] for way in lefts) / ways.total(), ways.total()

    traffic = ChangingTraffic(cologne.road_map, cologne.network, Pattern(name="usual"))
    (few, one), (many, other) = measure(1.0), measure(4.0)
    assert many > 1.8 * few
    assert other == pytest.approx(one, rel=0.1)


def run_with_stops(bundle: Bundle, folder: Path) -> list[ET.Element]:
    """Let SUMO drive `x.rou.xml`; returns who stopped where."""
    command = [find_program("sumo"), "-n", bundle.network, "-r", folder / "x.rou.xml", "--end", "1200",
               "--stop-output", folder / "stops.xml", "--no-step-log", "--xml-validation", "never",
               "--time-to-teleport", "-1"]  # fmt: skip
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return ET.parse(folder / "stops.xml").getroot().findall("stopinfo")  # noqa: S314


def test_cars_break_down_where_others_can_pass_as_sumo_tells(cologne: Bundle, tmp_path: Path) -> None:
    pattern = Pattern(name="broken", incidents=(8, 8), incident_seconds=(60, 90))
    traffic = ChangingTraffic(cologne.road_map, cologne.network, pattern)
    text = traffic.format(2, begin=0, end=900)
    (tmp_path / "x.rou.xml").write_text(text)
    stops = run_with_stops(cologne, tmp_path)
    asked = re.findall(r'<stop lane="([^"]+)"', text)
    assert len(asked) >= 1
    assert sorted(stop.get("lane") for stop in stops) == sorted(asked)
    lanes = {lane.id: lane for lane in cologne.road_map.lanes}
    for stop in stops:
        lasted = float(stop.get("ended", "0")) - float(stop.get("started", "0"))
        assert 60 <= lasted <= 95
        road = lanes[stop.get("lane", "")].road
        assert sum(lane.road == road and "passenger" in lane.allow for lane in lanes.values()) >= 2


def test_buses_stop_at_bus_stops(cologne: Bundle, tmp_path: Path) -> None:
    first = next(
        link for link in cologne.road_map.connections if link.signal is not None and "s" in link.direction
    )
    lane = next(lane for lane in cologne.road_map.lanes if lane.id == first.from_lane)
    start, way = lane.shape[0, :2], np.diff(lane.shape[:2, :2], axis=0)[0]
    along = way / np.linalg.norm(way)
    right = np.array([along[1], -along[0]])
    pole, far = ((*(start + 20 * along + metres * right), 0.0) for metres in (3, 200))
    props = tuple(
        Prop(id=f"stop{number}", kind="bus_stop", height=2.5, position=place)
        for number, place in enumerate((pole, far))
    )
    road_map, pattern = replace(cologne.road_map, props=props), Pattern(name="buses", buses=(80, 80))
    traffic = ChangingTraffic(road_map, cologne.network, pattern)
    trips, _ = traffic.draw(4, begin=0, end=900)
    called = [trip for trip in trips if trip.stops]
    assert called
    assert {(trip.vehicle_class, trip.stops[0].lane) for trip in called} == {("bus", lane.id)}
    (tmp_path / "x.rou.xml").write_text(traffic.format(4, begin=0, end=900))
    stops = run_with_stops(cologne, tmp_path)
    assert sorted(stop.get("lane") for stop in stops) == [lane.id] * len(called)


@pytest.mark.parametrize("length", [24.01, 24.05, 24.09])
def test_no_bus_stops_beyond_the_end_of_its_lane(cologne: Bundle, length: float) -> None:
    lane = next(lane for lane in cologne.road_map.lanes if "bus" in lane.allow)
    pole = Prop(id="stop", kind="bus_stop", height=2.5, position=tuple(lane.shape[-1].tolist()))
    lanes = [replace(each, length=length) if each is lane else each for each in cologne.road_map.lanes]
    stops = BusStops(replace(cologne.road_map, lanes=tuple(lanes), props=(pole,)))
    trip = stops.call(Trip(depart=0, roads=(lane.road,), vehicle_class="bus"))
    (stop,) = trip.stops
    assert length - 0.1 < float(f"{stop.place:.1f}") <= length


def test_buses_and_emergency_vehicles_come_now_and_then(cologne: Bundle) -> None:
    kinds = Counter(vehicle.get("type") for vehicle in draw(cologne, "priority", 4))
    assert 10 <= kinds["bus"] <= 45
    assert 1 <= kinds["emergency"] <= 16
    assert kinds["car"] > 20 * kinds["bus"] / 2


def test_an_environment_draws_its_traffic_by_its_seed() -> None:
    world = LocalWorld(build_config(scenario="cologne1-surges", num_seconds=120))

    def run(seed: int) -> tuple[float, int]:
        world.reset(seed)
        ended = False
        while not ended:
            _, _, ended, _ = world.step({})
        figures = world.metrics()
        return figures["travel_time_all"], figures["departed"]

    first, other, again = run(1), run(2), run(1)
    world.close()
    assert first == again != other
    assert first[1] > 20


def test_a_recording_of_drawn_traffic_finds_its_map(tmp_path: Path) -> None:
    config = build_config(scenario="cologne1-night", num_seconds=30, record_name=str(tmp_path / "x"))
    world = LocalWorld(config)
    world.reset(1)
    for _ in range(6):
        world.step({})
    world.close()
    (path,) = tmp_path.glob("x*.npz")
    assert find_map(read_recording(path)).road_map.name == world.map.bundle.road_map.name


def test_a_pattern_fits_any_bundle_and_draws_all_of_its_traffic(cologne: Bundle, tmp_path: Path) -> None:
    found = find_scenario(f"{cologne.folder}-night")
    assert found.map == cologne.folder
    assert found.pattern == find_pattern("night")
    assert found.routes == ()
    (tmp_path / "x.rou.xml").write_text("<routes/>")
    with pytest.raises(ConfigError, match="leave routes out"):
        Scenario(map=cologne.folder, routes=tmp_path / "x.rou.xml", pattern="surges")


def test_a_folder_of_a_packaged_scenarios_name_does_not_hide_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("cologne1", "cologne1-surges"):
        Path(name).mkdir()
        assert find_scenario(name).map == find_scenario("cologne1").map
    assert find_scenario("cologne1-surges").pattern == find_pattern("surges")


def test_walkers_need_crossings(network_path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no crossings"):
        LocalWorld(build_config(scenario="cologne1-walkers"))
    bundle = open_map(Scenario(map=network_path("right_hand")))
    many, usual = (
        sum(each.tag == "person" for each in draw(bundle, pattern, 1))
        for pattern in ("walkers", Pattern(name="usual"))
    )
    assert many > 3 * usual > 0


@pytest.mark.parametrize("name", list_patterns())
def test_every_packaged_pattern_can_be_read(name: str) -> None:
    pattern = find_pattern(name)
    assert pattern.name == name
    assert pattern.summary


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("surge = 3", "surge = 3"),
        ("surge = [3, 1]", "expected two numbers"),
        ("platoons = [0, 2]", "from 0 to 1"),
        ("level = [1, inf]", "expected two numbers"),
        ("wings = [1, 2]", "wings: unknown"),
        ("needs_crossings = 1", "expected bool"),
        ("surge = [", "not TOML"),
    ],
)
def test_a_pattern_that_cannot_be_is_refused(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(SourceError, match=re.escape(words)):
        find_pattern(path)


def test_an_unknown_pattern_is_named() -> None:
    with pytest.raises(SourceError, match="surges"):
        find_pattern("tides")
