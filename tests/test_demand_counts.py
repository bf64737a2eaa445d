"""Counts that a demand meets, judged by SUMO: it drives the written routes, and its outputs are counted."""

import csv
import itertools
import json
import subprocess
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element, parse

import numpy as np
import pytest
from conftest import dojo_maps
from test_demand import wanted_movements

from dojo_env.cli import main
from dojo_env.scenario import find_scenario, open_map, packaged_scenario
from dojo_maps.bundle import Bundle
from dojo_maps.cli import main as run_maps
from dojo_maps.conversion import convert
from dojo_maps.demand.counts import compute_geh
from dojo_maps.sources.netconvert import find_netconvert

Turn = tuple[str, ...]
HOUR = (25200, 28800)


def write_counts(path: Path, rows: list[dict[str, object]]) -> Path:
    names = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8-sig") as file:  # As spreadsheets write it.
        table = csv.DictWriter(file, names)
        table.writeheader()
        table.writerows(rows)
    return path


def read_xml(path: Path) -> Element:
    return parse(path).getroot()  # noqa: S314


def passages(configuration: Path, folder: Path) -> Counter[tuple[str, Turn]]:
    """Let SUMO drive until all have arrived; count who passed each edge and turn, and people on crossings."""
    routes, places = folder / "driven.xml", folder / "places.xml"
    command = [
        *(find_netconvert().with_name("sumo"), "-c", configuration, "--end", 40_000),
        *("--vehroute-output", routes, "--fcd-output", places, "--fcd-output.attributes", "edge"),
        *("--device.fcd.probability", 0, "--person-device.fcd.probability", 1),
        *("--no-step-log", "--xml-validation", "never", "--time-to-teleport", -1),
    ]
    subprocess.run([str(part) for part in command], capture_output=True, check=True)
    passed: Counter[tuple[str, Turn]] = Counter()
    for vehicle in read_xml(routes).iter("vehicle"):
        route = vehicle.find("route")
        assert route is not None
        edges, kind = route.get("edges", "").split(), vehicle.get("type", "").replace("car", "passenger")
        passed.update((kind, turn) for turn in {*((edge,) for edge in edges), *itertools.pairwise(edges)})
    seen = {(person.get("id"), person.get("edge", "")) for person in read_xml(places).iter("person")}
    passed.update(("pedestrian", (edge,)) for _, edge in seen)
    return passed


@pytest.fixture(scope="module")
def cologne(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return convert("cologne1", tmp_path_factory.mktemp("counts") / "cologne1.dojo")[0]


def turns_of(bundle: Bundle) -> list[tuple[str, str]]:
    return sorted(wanted_movements(bundle))


@pytest.mark.slow
def test_turn_counts_are_met(cologne: Bundle, tmp_path: Path) -> None:
    turns = turns_of(cologne)
    numbers = np.random.default_rng(5).integers(0, 200, len(turns))
    rows: list[dict[str, object]] = [
        {"from_edge": start, "to_edge": end, "count": int(n), "begin": "7:00:00", "end": "8:00:00"}
        for (start, end), n in zip(turns, numbers, strict=True)
    ]
    rows += [{**rows[0], "class": "truck", "count": 17}, {**rows[1], "class": "bicycle", "count": 9}]
    counts = write_counts(tmp_path / "counts.csv", rows)
    done = dojo_maps(
        "demand",
        cologne.network,
        "--counts",
        counts,
        "-o",
        tmp_path / "a.rou.xml",
        "--json",
        tmp_path / "a.json",
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert f"GEH below 5: {len(rows)} of {len(rows)} counts (100%)" in done.stdout
    found = passages(tmp_path / "a.sumocfg", tmp_path)
    for row in rows:
        key = (str(row.get("class", "passenger")), (str(row["from_edge"]), str(row["to_edge"])))
        assert found[key] == row["count"], key
    report = json.loads((tmp_path / "a.json").read_text())["demand"]
    assert [count["modelled"] for count in report["counts"]] == [row["count"] for row in rows]
    assert report["geh_below_5"] == 1.0
    assert (report["begin"], report["end"]) == HOUR


def test_edge_counts_of_quarters_are_met(cologne: Bundle, tmp_path: Path) -> None:
    """Counts of different lengths and places that share vehicles; each departs in its own quarter."""
    start, end = turns_of(cologne)[0]
    rows: list[dict[str, object]] = [
        {"from_edge": start, "count": n, "begin": k * 900, "end": (k + 1) * 900, "to_edge": ""}
        for k, n in enumerate((50, 20, 15, 31))
    ]
    rows.append({"from_edge": start, "to_edge": end, "count": 40, "begin": 0, "end": 3600})
    done = dojo_maps(
        "demand",
        cologne.network,
        "--counts",
        write_counts(tmp_path / "c.csv", rows),
        "-o",
        tmp_path / "a.rou.xml",
    )
    assert done.returncode == 0, done.stderr
    found = passages(tmp_path / "a.sumocfg", tmp_path)
    assert found["passenger", (start,)] == 116
    assert found["passenger", (start, end)] == 40
    root = read_xml(tmp_path / "a.rou.xml")
    over = {route.get("id") for route in root.iter("route") if start in route.get("edges", "").split()}
    quarters = Counter(
        float(each.get("depart", "")) // 900 for each in root.iter("vehicle") if each.get("route") in over
    )
    assert quarters == {0: 50, 1: 20, 2: 15, 3: 31}


def test_people_counted_on_a_crossing_walk_over_it(
    network_path: Callable[[str], Path], tmp_path: Path
) -> None:
    network = network_path("walkers_signal")
    crossing = next(
        edge.get("id", "") for edge in read_xml(network).iter("edge") if edge.get("function") == "crossing"
    )
    rows: list[dict[str, object]] = [
        {"from_edge": crossing, "count": 25, "class": "pedestrian", "begin": 0, "end": 600}
    ]
    done = dojo_maps(
        "demand", network, "--counts", write_counts(tmp_path / "c.csv", rows), "-o", tmp_path / "a.rou.xml"
    )
    assert done.returncode == 0, done.stderr
    assert passages(tmp_path / "a.sumocfg", tmp_path)["pedestrian", (crossing,)] == 25


@pytest.mark.slow
def test_demand_in_a_bundle_is_its_scenario(cologne: Bundle, tmp_path: Path) -> None:
    before = json.loads((cologne.folder / "report.json").read_text())
    done = dojo_maps(
        "demand", cologne.folder, "--volume", 500, "--bicycles", 40, "--begin", "7:00:00", "--seed", 4
    )
    assert done.returncode == 0, done.stderr
    after = json.loads((cologne.folder / "report.json").read_text())
    demand = after.pop("demand")
    assert after == {name: value for name, value in before.items() if name != "demand"}
    assert demand["vehicles"] == pytest.approx(500, rel=0.05)
    assert demand["bicycles"] == pytest.approx(40, rel=0.3)
    assert str(demand["vehicles"]) in (cologne.folder / "report.html").read_text()
    scenario = find_scenario(cologne.folder)
    assert (scenario.begin, scenario.end) == HOUR
    assert open_map(scenario).network == cologne.network
    target = tmp_path / "a.json"
    arguments = ["--scenario", str(cologne.folder), "--controller", "max-pressure", "--json", str(target)]
    assert main(["run", *arguments, "--seconds", "600"]) == 0
    assert json.loads(target.read_text())["summary"]["arrived"]["mean"] > 50


@pytest.mark.slow
def test_the_same_seed_gives_the_same_counted_demand(cologne: Bundle, tmp_path: Path) -> None:
    start, end = turns_of(cologne)[0]
    counts = write_counts(tmp_path / "c.csv", [{"from_edge": start, "to_edge": end, "count": 60}])
    texts = []
    for seed in ("1", "1", "2"):
        routes = tmp_path / "a.rou.xml"
        arguments = [str(cologne.network), "--counts", str(counts), "-o", str(routes), "--seed", seed]
        assert run_maps(["demand", *arguments]) == 0
        texts.append(routes.read_text())
    assert texts[0] == texts[1] != texts[2]


START, END = "23429231#1", "32038051#0"
REFUSED = {
    "from_edge,to_edge,count\n": "has 0 counts",
    "": "the file is empty",
    f"from_edge,count\n{START}x,5\n": f"row 1: the map has no edge '{START}x'; did you mean {START}",
    f"from_edge,to_edge,count\n{START},{END},4\n{START},{END},-5\n": "row 2: count -5 is not a whole number",
    f"from_edge,to_edge,count\n{START},{END},2.5\n": "row 1: count 2.5 is not a whole number",
    f"from_edge,to_edge,count\n{START},{END},nan\n": "row 1: count nan is not a whole number",
    f"from_edge,to_edge,count\n{START},{END},many\n": "row 1: count 'many' is no number",
    f"from_edge,to_edge,count\n{END},{START},3\n": f"row 1: no connection leads passenger from '{END}'",
    f"from_edge,to_edge\n{START},{END}\n": "row 1: has no count",
    f"from_edge,count,class\n{START},3,hovercraft\n": "row 1: class 'hovercraft' is not one of passenger",
    f"from_edge,count,class\n{START},3,pedestrian\n": f"row 1: the map has no crossing '{START}'",
    f"from_edge,count,begin,end\n{START},3,900,0\n": "row 1: begin 900 and end 0",
    f"from_edge,count,begin,end\n{START},3,0,7\n": "its intervals do not fit each other",
    f"from_edge,count\n{START},3\n{START},3\n": "row 2: counts the same as a row before",
    f"from_edge,count\n{START},1000001\n": "row 1: count 1000001 is not",
}  # fmt: skip


@pytest.mark.parametrize("text", REFUSED)
def test_wrong_counts_are_refused_in_one_line(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    counts = tmp_path / "counts.csv"
    counts.write_text(text)
    network = str(packaged_scenario("cologne1").map)
    assert run_maps(["demand", network, "--counts", str(counts), "-o", str(tmp_path / "a.rou.xml")]) == 3
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith(f"dojo-maps: {counts}: {REFUSED[text]}")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["counts.csv"]


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["--volume", "9", "--counts", "c.csv"], 2, "leave one out"),
        (["-o", "routes.xml"], 2, "ends in .rou.xml"),
        (["-o", "nowhere/a.rou.xml"], 2, "nowhere: no such folder"),
        (["--begin", "100", "--end", "50"], 2, "comes before"),
        (["--volume", "-1"], 2, "0 or more"),
        (["--counts", "missing.csv"], 3, "missing.csv: no such file"),
    ],
)
def test_wrong_options_are_refused(
    arguments: list[str], status: int, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert run_maps(["demand", str(packaged_scenario("cologne1").map), *arguments]) == status
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_geh_is_the_engineers_figure() -> None:
    """Values of the Design Manual for Roads and Bridges' formula, worked out by hand."""
    assert compute_geh(100, 100) == 0.0
    assert compute_geh(0, 0) == 0.0
    assert compute_geh(150, 100) == pytest.approx(np.sqrt(2 * 50**2 / 250))


@pytest.mark.slow
def test_routes_replace_a_scenario_s_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    network = packaged_scenario("cologne1").map
    routes = tmp_path / "few.rou.xml"
    assert run_maps(["demand", str(network), "--volume", "200", "-o", str(routes)]) == 0
    target = tmp_path / "a.json"
    arguments = ["--controller", "fixed-time", "--seconds", "300", "--json", str(target)]
    for scenario in ("cologne1", str(network)):
        assert main(["run", "--scenario", scenario, "--routes", str(routes), *arguments]) == 0
        assert 3 < json.loads(target.read_text())["episodes"][0]["departed"] < 30
    capsys.readouterr()
    assert main(["run", "--scenario", "two-way", "--routes", str(routes), *arguments]) == 3
    said = capsys.readouterr().err.splitlines()
    assert said == [
        f"dojo-env: {routes}: leads over '-32038056#3', which two-way does not have; give routes of its own"
    ]
