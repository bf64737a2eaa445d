"""Imports of OpenStreetMap data: what real and hand-drawn extracts must become."""

import itertools
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import pytest
from osm_drawings import DRAWINGS, SIGNAL, SYDNEY, Drawing, cross
from test_sources_osm import helsinki

from dojo_maps.bundle import Bundle, read_bundle
from dojo_maps.cli import main
from dojo_maps.conversion import convert
from dojo_maps.description import Phase
from dojo_maps.sources.netconvert import NetconvertError, NetconvertResult, run_netconvert
from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.network import netconvert_run

CONTROLLERS = {
    "cross": 1, "dual_carriageways": 1, "dog_leg": 1, "slip_lane": 1, "triangle": 0, "roundabout": 0,
    "left_hand": 1, "approach_signals": 1, "island_crossing": 1, "tram": 1, "sausage": 0, "parallel_ways": 1,
    "bridge": 0, "fork": 0, "tight_carriageways": 1, "wide_median": 1, "crossing_at_lane_change": 1,
}  # fmt: skip


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> tuple[Bundle, dict[str, Any]]:
    return convert(str(helsinki()), tmp_path_factory.mktemp("city") / "city.dojo")


@pytest.fixture(scope="module", params=sorted(DRAWINGS))
def drawn(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("drawn")
    path = DRAWINGS[request.param]().write(folder / f"{request.param}.osm")
    bundle, report = convert(str(path), folder / "drawn.dojo")
    return request.param, bundle, report


@pytest.mark.slow
def test_city_keeps_what_is_mapped(city: tuple[Bundle, dict[str, Any]]) -> None:
    _, report = city
    quality = report["osm"]
    assert report["counts"]["error"] == 0
    assert quality["crossings"]["of"] > 300
    assert quality["crossings"]["share"] >= 0.95
    assert quality["signalised_junctions"]["share"] == 1.0
    assert quality["turn_lanes"]["share"] >= 0.95
    assert quality["sidewalk_metres"]["share"] >= 0.95
    assert quality["road_metres"]["all"]["share"] >= 0.99
    assert quality["edges_under_5_m"] == 0


@pytest.mark.slow
def test_city_has_no_dead_end_inside(city: tuple[Bundle, dict[str, Any]]) -> None:
    check_no_dead_ends(city[0])


@pytest.mark.slow
def test_city_losses_name_their_elements(city: tuple[Bundle, dict[str, Any]]) -> None:
    _, report = city
    losses = [issue for issue in report["issues"] if issue["check"] == "osm.missing_crossing"]
    quality = report["osm"]["crossings"]
    assert len(losses) == quality["of"] - quality["kept"]
    for issue in losses:
        kind, number = issue["elements"][-1]["kind"].removeprefix("osm_"), issue["elements"][-1]["id"]
        assert f"https://www.openstreetmap.org/{kind}/{number}" in issue["message"]
        assert 24.9 < issue["lonlat"][0] < 25.0
        assert 60.1 < issue["lonlat"][1] < 60.2


@pytest.mark.slow
def test_city_positions_lie_where_the_extract_says(city: tuple[Bundle, dict[str, Any]]) -> None:
    """Crossings that are nodes of the extract, projected by pyproj alone."""
    pyproj = pytest.importorskip("pyproj")
    bundle, report = city
    data = read_osm(helsinki())
    projection = bundle.road_map.projection
    project = pyproj.Proj(projection.proj)
    built = [crossing.shape.mean(axis=0) for crossing in bundle.road_map.crossings]
    near = 0
    mapped = [node for node in data.nodes.values() if node.tags.get("highway") == "crossing"]
    for node in mapped:
        x, y = project(node.lon, node.lat)
        x, y = x + projection.net_offset[0], y + projection.net_offset[1]
        near += any(abs(p[0] - x) < 10 and abs(p[1] - y) < 10 for p in built)
    assert near >= 0.9 * report["osm"]["crossings"]["of"]


@pytest.mark.sampled(0)
@pytest.mark.slow
def test_city_is_the_same_every_time(city: tuple[Bundle, dict[str, Any]], tmp_path: Path) -> None:
    bundle, _ = city
    again, _ = convert(str(helsinki()), tmp_path / "city.dojo")
    for file in ("network.net.xml", "map.json", "scene.glb", "report.json", "overview.png"):
        assert (again.folder / file).read_bytes() == (bundle.folder / file).read_bytes()


@pytest.mark.slow
def test_city_signals_never_show_conflicting_greens(city: tuple[Bundle, dict[str, Any]]) -> None:
    check_programs(city[0].network)


@pytest.mark.slow
def test_city_leaves_walkers_time_to_cross(city: tuple[Bundle, dict[str, Any]]) -> None:
    """From the end of a crossing's green to the next unyielding green across it: its length at 1.2 m/s."""
    road_map = city[0].road_map
    rows = {way.link: (way, j) for j in road_map.junctions for way in j.right_of_way}
    index = {c.id: (c.signal, c.link_index) for c in (*road_map.connections, *road_map.crossings)}
    programs = {signal.id: signal.programs[0].phases for signal in road_map.signals}
    walks = [crossing for crossing in road_map.crossings if crossing.signal in programs]
    assert len(walks) > 100
    for crossing in walks:
        way, junction = rows[crossing.id]
        foes = {index.get(junction.right_of_way[k].link, (None, None))[1] for k in way.foes} - {None}
        phases = programs[crossing.signal or ""]
        here = crossing.link_index or 0
        greens = [phase.duration for phase in phases if phase.state[here] == "G"]
        assert sum(greens) >= 7
        for number, phase in enumerate(phases):
            if phase.state[here] == "G" and phases[(number + 1) % len(phases)].state[here] != "G":
                left = _seconds_to_green(phases, number + 1, {int(k) for k in foes if k is not None})
                walked = float(sum(((crossing.shape[1:] - crossing.shape[:-1]) ** 2).sum(axis=1) ** 0.5))
                assert left >= walked / 1.2 - 1e-6, crossing.id


def _seconds_to_green(phases: tuple[Phase, ...], start: int, links: set[int]) -> float:
    passed = 0.0
    for step in range(len(phases)):
        phase = phases[(start + step) % len(phases)]
        if any(phase.state[link] == "G" for link in links):
            return passed
        passed += phase.duration
    return float("inf")


@pytest.mark.slow
def test_city_runs_in_sumo_without_a_word(city: tuple[Bundle, dict[str, Any]], tmp_path: Path) -> None:
    sumo = Path(sys.executable).with_name("sumo")
    done = subprocess.run(
        [str(sumo), "-n", str(city[0].network), "-e", "300", "--no-step-log"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0
    assert done.stderr == ""


@pytest.mark.sampled(5)
def test_drawn_junction_is_whole(drawn: tuple[str, Bundle, dict[str, Any]]) -> None:
    name, bundle, report = drawn
    quality = report["osm"]
    assert not [issue["message"] for issue in report["issues"] if issue["severity"] == "error"]
    assert len(bundle.road_map.signals) == CONTROLLERS[name]
    assert quality["signalised_junctions"]["kept"] == quality["signalised_junctions"]["of"]
    assert quality["turn_lanes"]["kept"] == quality["turn_lanes"]["of"]
    assert quality["crossings"]["kept"] >= quality["crossings"]["of"] - (name == "slip_lane")
    assert quality["edges_under_5_m"] == 0
    assert quality["road_metres"]["all"]["share"] > 0.99
    assert bundle.road_map.left_hand == (name == "left_hand")
    check_no_dead_ends(bundle)
    check_programs(bundle.network)


def cut(lon: float, lat: float, path: Path) -> Path:
    """Cut the ways within 150 m of a place out of the real extract, with all their nodes."""
    osmium = pytest.importorskip("osmium")
    with osmium.BackReferenceWriter(str(path), ref_src=str(helsinki()), remove_tags=False) as writer:
        near = set()
        for element in osmium.FileProcessor(str(helsinki())):
            if element.is_node():
                if abs(element.lon - lon) < 0.0027 and abs(element.lat - lat) < 0.00135:
                    near.add(element.id)
            elif element.is_way() and any(node.ref in near for node in element.nodes):
                writer.add(element)
    return path


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("lon", "lat"), [(24.94276, 60.17053), (24.93874, 60.16987), (24.94218, 60.16758), (24.94996, 60.17821)]
)
def test_import_of_a_cut_junction_is_whole(lon: float, lat: float, tmp_path: Path) -> None:
    bundle, report = convert(str(cut(lon, lat, tmp_path / "cut.osm.pbf")), tmp_path / "cut.dojo")
    quality = report["osm"]
    assert report["counts"]["error"] == 0
    assert quality["crossings"]["share"] >= 0.85
    assert quality["signalised_junctions"]["share"] == 1.0
    assert quality["edges_under_5_m"] == 0
    check_no_dead_ends(bundle)
    check_programs(bundle.network)


@pytest.mark.slow
def test_import_gives_a_junction_one_controller_however_its_signals_are_mapped(tmp_path: Path) -> None:
    for name in ("cross", "approach_signals", "dual_carriageways", "parallel_ways"):
        path = DRAWINGS[name]().write(tmp_path / f"{name}.osm")
        bundle, _ = convert(str(path), tmp_path / f"{name}.dojo")
        (signal,) = bundle.road_map.signals
        assert len(signal.junctions) == 1


def test_import_gives_a_dog_leg_one_controller(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (-22, 0), (22, 0), (150, 0), highway="secondary", lanes="2")
    for x, y in ((-22, 150), (22, -150)):
        drawing.way((x, 0), (x, y), highway="residential")
        drawing.node(x, 0, **SIGNAL)
    bundle, _ = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    assert [len(signal.junctions) for signal in bundle.road_map.signals] == [2]


def test_import_lets_traffic_over_a_median_out_of_it(tmp_path: Path) -> None:
    """Where traffic may go into the median, it may go on across the other carriageway."""
    path = DRAWINGS["wide_median"]().write(tmp_path / "a.osm")
    bundle, _ = convert(str(path), tmp_path / "a.dojo")
    (signal,) = bundle.road_map.signals
    index = {
        tuple(lane.rsplit("_", 1)[0] for lane in (c.from_lane, c.to_lane)): c.link_index
        for c in bundle.road_map.connections
    }
    pairs = [
        (index["1003#0", "1003#1"], index["1003#1", "1003#2"]),
        (index["-1003#2", "-1003#1"], index["-1003#1", "-1003#0"]),
    ]
    for into, out in pairs:
        greens = [phase.state for phase in signal.programs[0].phases if phase.state[into or 0] in "gG"]
        assert greens
        assert all(state[out or 0] in "gG" for state in greens)


def test_import_leaves_other_turns_to_the_road_beside_a_turn_lane(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (0, 0), (150, 0), highway="primary", oneway="yes", lanes="2")
    lane = drawing.way(
        (-90, 0), (-70, 6), (-8, 6), (0, 10), highway="primary_link", oneway="yes", turn__lanes="left"
    )
    drawing.ways[0][0].insert(1, drawing.node(-90, 0))
    drawing.way((0, -100), (0, 0), (0, 10), (0, 100), highway="tertiary", lanes="2")
    bundle, report = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    taken = {c.direction for c in bundle.road_map.connections if c.from_lane.startswith(f"{lane}#")}
    assert taken == {"l"}
    assert report["osm"]["turn_lanes"]["kept"] == report["osm"]["turn_lanes"]["of"]


def test_import_builds_no_sidewalk_where_the_next_road_begins(tmp_path: Path) -> None:
    drawing = Drawing()
    for y in (0, 5):
        drawing.way((-150, y), (150, y), highway="residential", oneway="yes")
    drawing.way((-150, 0), (-160, 2), (-150, 5), highway="residential")
    bundle, _ = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    middles = [lane.shape[:, 1].mean() for lane in bundle.road_map.lanes if lane.kind == "sidewalk"]
    driven = [lane.shape[:, 1].mean() for lane in bundle.road_map.lanes if lane.kind == "driving"]
    long = [y for y in middles if min(driven) < y < max(driven)]
    assert middles
    assert not long


def test_import_leads_turn_lanes_where_they_point(tmp_path: Path) -> None:
    path = DRAWINGS["dual_carriageways"]().write(tmp_path / "a.osm")
    bundle, _ = convert(str(path), tmp_path / "a.dojo")
    directions = defaultdict(set)
    for connection in bundle.road_map.connections:
        if connection.from_lane.startswith("1001#0"):
            directions[connection.from_lane].add(connection.direction)
    lanes = [lane.id for lane in bundle.road_map.lanes if lane.road == "1001#0" and lane.kind != "sidewalk"]
    assert [directions[lane] for lane in lanes] == [{"s", "r"}, {"l"}]


def test_import_keeps_turn_restrictions(tmp_path: Path) -> None:
    drawing = cross()
    drawing.restriction("no_left_turn", 1001, drawing.node(0, 0), 1002)
    bundle, report = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    turns = Counter(c.direction for c in bundle.road_map.connections if c.from_lane.startswith("1001#0"))
    assert turns["l"] == turns["r"] == 0
    assert turns["s"] > 0
    assert report["osm"]["restrictions"] == {"kept": 1, "of": 1, "share": 1.0}


def test_import_tells_of_turns_that_are_forbidden_at_times(tmp_path: Path) -> None:
    drawing = cross()
    drawing.restriction("no_left_turn", 1001, drawing.node(0, 0), 1002)
    _, tags = drawing.relations[0]
    tags["restriction:conditional"] = tags.pop("restriction") + " @ (Mo-Fr 07:00-09:00)"
    bundle, report = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    assert any(c.direction == "l" for c in bundle.road_map.connections if c.from_lane.startswith("1001#0"))
    (issue,) = [i for i in report["issues"] if i["check"] == "osm.restriction_conditional"]
    assert "https://www.openstreetmap.org/relation/1" in issue["message"]


def test_import_hangs_signals_on_the_far_side_where_the_country_does(tmp_path: Path) -> None:
    bundle, _ = convert(str(cross(SYDNEY).write(tmp_path / "b.osm")), tmp_path / "b.dojo")
    assert any(head.far_side for head in bundle.road_map.signals[0].heads)


def test_import_never_doubles_a_sidewalk(tmp_path: Path) -> None:
    drawing = cross()
    drawing.ways[0][1]["sidewalk"] = "separate"
    for y in (-9, 9):
        drawing.way((-150, y), (150, y), highway="footway", footway="sidewalk")
    bundle, _ = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    roads = {road.id: road.lanes for road in bundle.road_map.roads}
    kinds = {lane.id: lane.kind for lane in bundle.road_map.lanes}
    for lanes in roads.values():
        assert [kinds[lane] for lane in lanes].count("sidewalk") <= 1


@pytest.mark.parametrize(("fatal", "attempts"), [("--walkingareas", 1), ("<crossing ", 2)])
def test_import_leaves_out_what_netconvert_fails_on(
    fatal: str, attempts: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def crash(arguments: list[str], *, folder: Path, timeout: float) -> NetconvertResult:
        if fatal in arguments or fatal in (folder / "input.con.xml").read_text():
            raise NetconvertError("netconvert crashed (SIGSEGV); it gave no reason")
        return run_netconvert(arguments, folder=folder, timeout=timeout)

    monkeypatch.setattr(netconvert_run, "run_netconvert", crash)
    _, report = convert(str(cross().write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    issues = [issue for issue in report["issues"] if issue["check"] == "osm.netconvert_failed"]
    assert len(issues) == attempts
    assert all("SIGSEGV" in issue["message"] for issue in issues)


def test_import_says_so_when_netconvert_fails_whatever_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def crash(arguments: list[str], **_: Any) -> NetconvertResult:
        raise NetconvertError("netconvert crashed (SIGSEGV); it gave no reason")

    monkeypatch.setattr(netconvert_run, "run_netconvert", crash)
    path = cross().write(tmp_path / "a.osm")
    assert main(["import-osm", str(path), "-o", str(tmp_path / "a.dojo")]) == 4
    assert "SIGSEGV" in capsys.readouterr().err
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.osm"]


def test_import_osm_command_writes_a_bundle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = cross().write(tmp_path / "my junction.osm")
    assert main(["import-osm", str(path), "-o", str(tmp_path / "a.dojo")]) == 0
    assert "1 signal, " in capsys.readouterr().out
    road_map = read_bundle(tmp_path / "a.dojo").road_map
    assert (road_map.source.kind, road_map.source.file) == ("osm", "my junction.osm")
    assert {road.name for road in road_map.roads} >= {"Long & wide"}
    report = json.loads((tmp_path / "a.dojo" / "report.json").read_text())
    assert "OpenStreetMap" in report["osm"]["attribution"]


def test_import_osm_command_refuses_other_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import-osm", "cologne1"]) == 2
    drawn = cross().write(tmp_path / "a.osm")
    assert main(["convert", str(drawn), "--enrich-net", "-o", str(tmp_path / "a.dojo")]) == 2
    assert main(["import-osm", str(tmp_path / "missing.osm")]) == 3
    assert all(line.startswith("dojo-maps: ") for line in capsys.readouterr().err.splitlines())


ROADS = '<node id="1" lat="1" lon="1"/><node id="2" lat="1.001" lon="1"/><node id="3" lat="1.002" lon="1"/>'
ODD = {
    "no roads": ("", 3),
    "one node": ('<way id="1"><nd ref="1"/><tag k="highway" v="primary"/></way>', 3),
    "missing nodes": ('<way id="1"><nd ref="1"/><nd ref="8"/><nd ref="9"/><tag k="highway" v="primary"/></way>', 3),  # noqa: E501
    "one missing node": (
        '<way id="1"><nd ref="1"/><nd ref="2"/><nd ref="9"/><tag k="highway" v="primary"/></way>', 0,
    ),
    "spread over the earth": (
        '<node id="4" lat="60" lon="100"/>'
        '<way id="1"><nd ref="1"/><nd ref="4"/><tag k="highway" v="primary"/></way>', 3,
    ),
    "same place twice": (
        '<node id="4" lat="1" lon="1"/>'
        '<way id="1"><nd ref="4"/><nd ref="1"/><nd ref="2"/><nd ref="2"/><tag k="highway" v="primary"/></way>', 0,  # noqa: E501
    ),
    "only one place": (
        '<node id="4" lat="1" lon="1"/><way id="1"><nd ref="4"/><nd ref="1"/><tag k="highway" v="primary"/></way>', 3,  # noqa: E501
    ),
    "cyclic relations": (
        '<way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="primary"/></way>'
        '<relation id="1"><member type="relation" ref="2" role="from"/><tag k="type" v="restriction"/>'
        '<tag k="restriction" v="no_left_turn"/></relation>'
        '<relation id="2"><member type="relation" ref="1" role=""/><member type="relation" ref="2" role=""/></relation>', 0,  # noqa: E501
    ),
    "odd tags": (
        '<way id="1"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="highway" v="primary"/><tag k="lanes" v="1e9"/>'  # noqa: E501
        '<tag k="maxspeed" v="-5"/><tag k="width" v="nan"/><tag k="layer" v="many"/><tag k="turn:lanes" v="||||"/>'  # noqa: E501
        '<tag k="name" v="&lt;script&gt;&quot;&amp;"/></way>', 0,
    ),
    "very many lanes": (
        '<way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="primary"/><tag k="lanes" v="99"/></way>', 0,  # noqa: E501
    ),
    "a loop": (
        '<node id="4" lat="1.001" lon="1.001"/>'
        '<way id="1"><nd ref="1"/><nd ref="2"/><nd ref="4"/><nd ref="1"/><tag k="highway" v="primary"/></way>', 0,  # noqa: E501
    ),
    "a figure of eight": (
        '<node id="4" lat="1.001" lon="1.001"/><node id="5" lat="0.999" lon="1.001"/>'
        '<node id="6" lat="0.999" lon="0.999"/>'
        '<way id="1"><nd ref="1"/><nd ref="2"/><nd ref="4"/><nd ref="1"/><nd ref="5"/><nd ref="6"/><nd ref="1"/>'  # noqa: E501
        '<tag k="highway" v="primary"/></way>', 0,
    ),
}  # fmt: skip


@pytest.mark.sampled(6)
@pytest.mark.parametrize(("elements", "status"), ODD.values(), ids=ODD.keys())
def test_import_of_odd_data_is_a_bundle_or_one_error(
    elements: str, status: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "odd.osm"
    path.write_text(f"<osm>{ROADS}{elements}</osm>")
    assert main(["import-osm", str(path), "-o", str(tmp_path / "odd.dojo"), "--quiet"]) == status
    assert len(capsys.readouterr().err.splitlines()) == (status != 0)
    assert {entry.name for entry in tmp_path.iterdir()} == {"odd.osm"} | (
        {"odd.dojo"} if not status else set()
    )


def check_no_dead_ends(bundle: Bundle) -> None:
    """Every lane for vehicles leads on, unless its junction ends the road."""
    road_map = bundle.road_map
    leaving = {connection.from_lane for connection in road_map.connections}
    ends = {road.id: road.to_junction for road in road_map.roads}
    kinds = {junction.id: junction.kind for junction in road_map.junctions}
    for lane in road_map.lanes:
        if lane.kind in ("driving", "bus"):
            assert lane.id in leaving or kinds[ends[lane.road]] == "dead_end", lane.id


def check_programs(network: Path) -> None:
    """Read the network's XML anew: no two greens conflict, every link has its green and its yellow."""
    root = ET.parse(network).getroot()  # noqa: S314
    index: dict[str, tuple[str, int]] = {}
    links: dict[str, list[tuple[str, int]]] = defaultdict(list)
    for connection in root.iter("connection"):
        if connection.get("tl"):
            key = (connection.get("tl", ""), int(connection.get("linkIndex", "")))
            links[key[0]].append(key)
            index[connection.get("via") or f"{connection.get('to')}_0"] = key
    foes = set()
    for junction in root.iter("junction"):
        lanes = junction.get("intLanes", "").split()
        for request in junction.iter("request"):
            here = index.get(lanes[int(request.get("index", ""))])
            for number, bit in enumerate(reversed(request.get("foes", ""))):
                there = index.get(lanes[number])
                if bit == "1" and here and there and here[0] == there[0]:
                    foes.add((here, there))
    walks = {
        (connection.get("tl"), int(connection.get("linkIndex", "")))
        for connection in root.iter("connection")
        if connection.get("tl") and connection.get("from", "").startswith(":")
    }
    for logic in root.iter("tlLogic"):
        name = logic.get("id", "")
        states = [phase.get("state", "") for phase in logic.iter("phase")]
        assert {len(state) for state in states} == {max(number for _, number in links[name]) + 1}
        conflicts = [(one[1], other[1]) for one, other in foes if one[0] == name]
        check_states(states, {number for _, number in set(links[name]) - walks}, conflicts)
        assert all(any(state[number] in "Gg" for state in states) for _, number in links[name])


def check_states(states: list[str], vehicles: set[int], conflicts: list[tuple[int, int]]) -> None:
    for state, following in itertools.pairwise([*states, states[0]]):
        assert not any(state[one] == state[other] == "G" for one, other in conflicts)
        assert not any(state[number] in "Gg" and following[number] == "r" for number in vehicles)


def test_ways_that_an_editor_has_just_drawn_are_roads_like_others(tmp_path: Path) -> None:
    path = cross().write(tmp_path / "drawn.osm")
    numbered, _ = convert(str(path), tmp_path / "numbered.dojo")
    path.write_text(re.sub(r'<way id="(\d+)"', r'<way id="-\1"', path.read_text()))
    drawn, report = convert(str(path), tmp_path / "drawn.dojo")
    names = {road.id.replace("new", "") for road in drawn.road_map.roads}
    assert names == {road.id for road in numbered.road_map.roads}
    assert report["counts"]["error"] == 0
