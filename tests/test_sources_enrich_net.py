"""Networks with real crossings: vehicles' signals stay as they were, pedestrians' are safe, and people walk.

Conflicts are judged here by which roads a crossing crosses, not by the request matrix that the code reads;
programs are played second by second.
"""

import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from decimal import Decimal
from functools import lru_cache
from itertools import pairwise
from math import ceil
from pathlib import Path

import pytest

from dojo_maps.errors import DojoError, SourceError
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.enrich_net import compare_programs, enrich_network
from dojo_maps.sources.files import find_network
from dojo_maps.sources.netconvert import NetconvertError, find_netconvert
from dojo_maps.sources.pedestrian_links import TransplantError
from dojo_maps.sources.pedestrian_timing import Foe, TimedPhase, Walk, compute_greens, traffic_letter

RESCO = (
    "cologne3", "cologne8", "grid4x4", "cologne1", "ingolstadt1", "ingolstadt7", "arterial4x4",
    "ingolstadt21",
)  # fmt: skip
CROSSINGS = {
    "cologne1": 6, "cologne3": 37, "cologne8": 121, "ingolstadt1": 10, "ingolstadt7": 75, "ingolstadt21": 660,
    "grid4x4": 64, "arterial4x4": 64,
}  # fmt: skip
WALKING_SPEED = 1.2
COLOGNE1_SIGNAL = "GS_cluster_357187_359543"


@lru_cache
def enriched(name: str):
    path, _ = find_network(name)
    data = read_bytes(path)
    result, report = enrich_network(data, path=path)
    return parse(data), parse(result), report, result


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", RESCO)
def test_enrich_network_keeps_every_vehicle_letter_of_every_second(name):
    old, new, report, _ = enriched(name)
    programs = {(logic.get("id"), logic.get("programID")): logic for logic in new.iterfind("tlLogic")}
    logics = old.findall("tlLogic")
    assert len(programs) == len(logics)
    for logic in logics:
        after = programs[logic.get("id"), logic.get("programID")]
        assert dict(after.attrib) == dict(logic.attrib)
        size = len(logic.find("phase").get("state"))
        assert [state[:size] for state in seconds(after)] == list(seconds(logic))
    reported = [program for signal in report["signals"] for program in signal["programs"]]
    assert [program["vehicle_letters_equal"] for program in reported] == [True] * len(logics)
    assert len(report["crossings_added"]) == CROSSINGS[name]


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", RESCO)
def test_enrich_network_keeps_every_connection_and_its_letter(name):
    old, new, report, _ = enriched(name)
    before = {
        (report["lane_ids"][start], report["lane_ids"][end]): control
        for (start, end), control in connections(old).items()
    }
    assert connections(new) == before
    assert set(report["lane_ids"]) == set(road_lanes(old))
    added = set(road_lanes(new)) - set(report["lane_ids"].values())
    assert added == set(report["sidewalks_added"])


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", RESCO)
def test_enrich_network_reports_every_changed_length(name):
    old, new, report, _ = enriched(name)
    before, after = road_lanes(old), road_lanes(new)
    changed = {
        lane: (float(before[was].get("length")), float(after[lane].get("length")))
        for was, lane in report["lane_ids"].items()
        if before[was].get("length") != after[lane].get("length")
    }
    assert {entry["lane"]: (entry["before"], entry["after"]) for entry in report["lengths"]} == changed


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", RESCO)
def test_enrich_network_never_shows_a_walker_green_against_traffic(name):
    _, new, report, _ = enriched(name)
    greens = 0
    for crossing, conflicts, letters in played(new):
        for second, letter in enumerate(letters):
            for kind, link in conflicts:
                vehicle = link[second]
                assert not (letter == "G" and vehicle == "G"), f"{crossing} at {second} s: both protected"
                if letter in "Gg":
                    assert kind == "turns" or vehicle in "rs", f"{crossing} at {second} s: traffic moves"
                    assert vehicle in "rsgG", f"{crossing} at {second} s: turners at {vehicle}"
        greens += any(letter in "Gg" for letter in letters)
    times = [
        crossing["green"]
        for signal in report["signals"]
        for program in signal["programs"]
        for crossing in program["crossings"]
    ]
    assert greens == sum(time > 0 for time in times) > 0


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", RESCO)
def test_enrich_network_leaves_time_to_walk_across_before_the_next_conflicting_green(name):
    _, new, _, _ = enriched(name)
    lengths = crossing_lengths(new)
    for crossing, conflicts, letters in played(new):
        cycle = len(letters)
        walking = [letter in "Gg" for letter in letters]
        if all(walking) or not any(walking):
            continue
        for second in range(cycle):
            if not walking[second - 1] or walking[second]:
                continue
            assert all(walking[second - back] for back in (1, 2, 3, 4)), f"{crossing}: under 4 s of green"
            for later in range(ceil(round(lengths[crossing] / WALKING_SPEED, 6))):
                now, before = (second + later) % cycle, (second + later - 1) % cycle
                for kind, link in conflicts:
                    begins = link[now] == "G" and link[before] != "G"
                    moves = kind == "blocks" and link[now] in "Gg"
                    assert not begins, f"{crossing}: green {later} s after the walk ended"
                    assert not moves, f"{crossing}: traffic {later} s after the walk ended"


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", RESCO)
def test_enrich_network_makes_networks_that_sumo_loads_without_new_complaints(name, tmp_path):
    _, _, _, result = enriched(name)
    path, _ = find_network(name)
    (tmp_path / "net.net.xml").write_bytes(result)
    before, after = (
        run_sumo("-n", net, "--end", "1", folder=tmp_path).splitlines() for net in (path, "net.net.xml")
    )
    assert not [line for line in after if "Error" in line]
    # Crossings that stay red are in the report, and SUMO says so too.
    news = [line for line in after if "Missing green phase" not in line]
    assert len(news) <= len([line for line in before if "Missing green phase" not in line])


def test_enrich_network_lets_people_cross_while_traffic_runs(tmp_path):
    _, new, _, result = enriched("cologne1")
    (tmp_path / "net.net.xml").write_bytes(result)
    walks = [
        ("28198821#3", "32038056#0"), ("28198821#3", "-32038056#3"), ("-32038056#3", "-28198821#4"),
        ("32038056#0", "28198821#3"),
    ]  # fmt: skip
    begin, people = 25200, 0
    with (tmp_path / "walkers.rou.xml").open("w") as file:
        file.write("<routes>")
        for wait in range(0, 90, 15):
            for start, end in walks:
                people += 1
                file.write(
                    f'<person id="p{people}" depart="{begin + wait}" departPos="50">'
                    f'<walk from="{start}" to="{end}" arrivalPos="10"/></person>'
                )
        file.write("</routes>")
    routes = find_network("cologne1")[0].with_name("cologne1.rou.xml")
    diagnostics = run_sumo(
        *("-n", "net.net.xml", "-r", f"{routes},walkers.rou.xml", "-b", str(begin), "-e", str(begin + 900)),
        *("--tripinfo-output", "trips.xml", "--fcd-output", "fcd.xml", "--collision.action", "warn"),
        folder=tmp_path,
    )
    assert "Error" not in diagnostics
    assert "collision" not in diagnostics
    arrived = parse((tmp_path / "trips.xml").read_bytes()).findall("personinfo")
    assert len(arrived) == people
    assert len(parse((tmp_path / "trips.xml").read_bytes()).findall("tripinfo")) > 100
    entries = walker_entries(parse((tmp_path / "fcd.xml").read_bytes()), ":cluster_357187_359543_c")
    assert len(entries) >= people
    letters = {crossing: letters for crossing, _, letters in played(new)}
    for second, crossing in entries:
        shown = letters[crossing]
        assert {shown[(second + back) % len(shown)] for back in (-2, -1, 0)} & set("Gg")


def test_enrich_network_gives_the_same_bytes_for_the_same_input():
    path, _ = find_network("cologne3")
    _, _, report, result = enriched("cologne3")
    assert enrich_network(read_bytes(path), path=path) == (result, report)
    assert b"<!--" not in result


def test_enrich_network_returns_the_input_when_nothing_is_left_to_add():
    _, _, _, result = enriched("cologne1")
    again, report = enrich_network(result, path=Path("again.net.xml"))
    assert again == result
    assert report["crossings_added"] == report["sidewalks_added"] == report["lengths"] == []
    assert all(old == new for old, new in report["lane_ids"].items())


def test_enrich_network_restores_letters_in_any_order():
    old = cologne1()
    size = len(old.find("tlLogic/phase").get("state"))
    for connection in old.iterfind("connection"):
        if "tl" in connection.attrib:
            connection.set("linkIndex", str(size + 2 - int(connection.get("linkIndex"))))
    for phase in old.iterfind("tlLogic/phase"):
        phase.set("state", "rrr" + phase.get("state")[::-1])
    result, report = enrich_network(ET.tostring(old), path=Path("turned.net.xml"))
    new = parse(result)
    assert {
        (report["lane_ids"][start], report["lane_ids"][end]): control
        for (start, end), control in connections(old).items()
    } == connections(new)
    assert [link["index"] for link in report["signals"][0]["links_appended"]] == list(range(23, 29))
    assert [state[:23] for state in seconds(new.find("tlLogic"))] == list(seconds(old.find("tlLogic")))


def actuated_cologne1() -> ET.Element:
    """Let the junction's program end its long phases between 20 and 50 s, by detectors."""
    old = cologne1()
    logic = old.find("tlLogic")
    logic.set("type", "actuated")
    ET.SubElement(logic, "param", key="max-gap:28198821#3_0", value="4")
    ET.SubElement(logic, "param", key="detector-gap", value="2")
    for phase in logic.iterfind("phase"):
        if phase.get("minDur"):
            phase.set("minDur", "20" if phase.get("duration") == "29" else "5")
    return old


def test_enrich_network_splits_actuated_phases_only_before_they_may_end():
    old = actuated_cologne1()
    result, report = enrich_network(ET.tostring(old), path=Path("actuated.net.xml"))
    after = parse(result).find("tlLogic")
    assert compare_programs(old.find("tlLogic"), after)
    program = report["signals"][0]["programs"][0]
    assert (after.get("type"), program["kind"]) == ("actuated", "actuated")
    fixed = [
        float(phase.get("duration"))
        for phase in after.iterfind("phase")
        if phase.get("minDur") == phase.get("maxDur") == phase.get("duration")
    ]
    assert fixed
    assert max(fixed) < 20
    assert sum(crossing["green"] > 0 for crossing in program["crossings"]) > 0
    assert {parameter.get("key") for parameter in after.iterfind("param")} == {
        "max-gap:28198821#3_1", "detector-gap",
    }  # fmt: skip
    assert program["parameters_renamed"] == {"max-gap:28198821#3_0": "max-gap:28198821#3_1"}


def test_enrich_network_leaves_an_actuated_signal_deciding_as_it_did(tmp_path):
    old = actuated_cologne1()
    result, _ = enrich_network(ET.tostring(old), path=Path("actuated.net.xml"))
    whole = parse(result)
    logic, phases = whole.find("tlLogic"), old.find("tlLogic").findall("phase")
    for phase in logic.findall("phase"):
        logic.remove(phase)
    for phase in phases:
        phase.set("state", phase.get("state") + "r" * 6)
        logic.append(phase)
    routes = find_network("cologne1")[0].with_name("cologne1.rou.xml")
    played_letters = []
    for name, data in (("split", result), ("whole", ET.tostring(whole))):
        (tmp_path / "net.net.xml").write_bytes(data)
        (tmp_path / "log.add.xml").write_text(
            f'<additional><timedEvent type="SaveTLSStates" dest="{name}.xml"/></additional>'
        )
        run_sumo(
            *("-n", "net.net.xml", "-r", routes, "-a", "log.add.xml", "-b", "25200", "-e", "25800"),
            folder=tmp_path,
        )
        states = parse((tmp_path / f"{name}.xml").read_bytes()).findall("tlsState")
        played_letters.append([state.get("state")[:20] for state in states])
    assert played_letters[0] == played_letters[1]
    assert len(played_letters[0]) >= 600


def test_enrich_network_lets_next_name_the_same_phases_after_a_split():
    old = cologne1()
    logic = old.find("tlLogic")
    phases = logic.findall("phase")
    for number, phase in enumerate(phases):
        phase.set("next", str((number + 1) % len(phases)))
    phases[1].set("next", "2 4")
    result, _ = enrich_network(ET.tostring(old), path=Path("next.net.xml"))
    after = parse(result).find("tlLogic")
    parts = after.findall("phase")
    assert compare_programs(logic, after)
    assert len(parts) > len(phases)
    for phase in phases:
        group = [part for part in parts if part.get("state").startswith(phase.get("state"))]
        named = [parts[int(index)].get("state")[:20] for index in group[-1].get("next").split()]
        assert named == [phases[int(index)].get("state") for index in phase.get("next").split()]
        assert all("next" not in part.attrib for part in group[:-1])


@pytest.mark.parametrize(
    ("kind", "reason"), [("NEMA", "type NEMA"), ("actuated", "coordinated"), ("static", "conditions")]
)
def test_enrich_network_keeps_crossings_red_when_times_are_unknown(kind, reason):
    old = cologne1()
    logic = old.find("tlLogic")
    logic.set("type", kind)
    if kind == "actuated":
        logic.find("phase").set("latestEnd", "30")
    if kind == "static":
        ET.SubElement(logic, "condition", id="never", value="0")
    result, report = enrich_network(ET.tostring(old), path=Path("unknown.net.xml"))
    after = parse(result).find("tlLogic")
    assert len(after.findall("phase")) == 8
    assert {phase.get("state")[20:] for phase in after.iterfind("phase")} == {"rrrrrr"}
    for crossing in report["signals"][0]["programs"][0]["crossings"]:
        assert reason in crossing["never_green"]


def test_enrich_network_keeps_a_switched_off_program_off():
    old = cologne1()
    logic = old.find("tlLogic")
    logic.set("programID", "off")
    for phase in logic.findall("phase")[1:]:
        logic.remove(phase)
    logic.find("phase").set("state", "o" * 20)
    result, _ = enrich_network(ET.tostring(old), path=Path("off.net.xml"))
    assert [phase.get("state") for phase in parse(result).iterfind("tlLogic/phase")] == ["o" * 26]


def test_enrich_network_adds_crossings_to_a_left_hand_network_without_changing_sides(tmp_path):
    generate = find_netconvert().with_name("netgenerate")
    options = "--grid --grid.number 2 --grid.attach-length 80 -j traffic_light --lefthand -o left.net.xml"
    command = [generate, *options.split()]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=60)
    data = (tmp_path / "left.net.xml").read_bytes()
    result, report = enrich_network(data, path=tmp_path / "left.net.xml")
    new = parse(result)
    assert new.get("lefthand") == "true"
    assert len(report["crossings_added"]) == 16
    lanes = road_lanes(new)
    for sidewalk in report["sidewalks_added"]:
        assert sidewalk.endswith("_0")
        assert lanes[sidewalk].get("allow") == "pedestrian"


def test_enrich_network_names_the_junction_when_netconvert_changes_its_control():
    old = cologne1()
    next(junction for junction in old.iterfind("junction") if junction.get("id") == "360130").set(
        "type", "rail_crossing"
    )
    with pytest.raises(TransplantError, match="made priority of the rail_crossing junction 360130"):
        enrich_network(ET.tostring(old), path=Path("rails.net.xml"))


def test_enrich_network_refuses_states_that_are_too_short():
    old = cologne1()
    for phase in old.iterfind("tlLogic/phase"):
        phase.set("state", phase.get("state")[:-1])
    with pytest.raises(DojoError, match=r"short\.net\.xml.*(20 links|exit status|crashed)"):
        enrich_network(ET.tostring(old), path=Path("short.net.xml"))


def test_enrich_network_says_why_netconvert_refuses(tmp_path):
    with pytest.raises(NetconvertError, match=r"bad\.net\.xml: no sidewalks and crossings could be added"):
        enrich_network(b"<net version='x'><edge id='e' from='a'/></net>", path=Path("bad.net.xml"))


@pytest.mark.parametrize(
    "data", [b"<!DOCTYPE net [<!ENTITY a 'b'>]><net>&a;</net>", b"<routes/>", b"no xml", b""]
)
def test_enrich_network_refuses_what_is_not_a_safe_network(data):
    with pytest.raises(SourceError, match=r"bad\.net\.xml"):
        enrich_network(data, path=Path("bad.net.xml"))


def test_compare_programs_sees_every_change_for_vehicles():
    def logic(*phases: tuple[str, str], kind: str = "static") -> ET.Element:
        element = ET.Element("tlLogic", id="s", type=kind, programID="0", offset="0")
        for duration, state in phases:
            ET.SubElement(element, "phase", duration=duration, state=state)
        return element

    old = logic(("10", "Gr"), ("3", "yr"))
    assert compare_programs(old, logic(("4", "GrG"), ("6", "Grr"), ("3", "yrr")))
    assert not compare_programs(old, logic(("4", "GrG"), ("5", "Grr"), ("3", "yrr")))
    assert not compare_programs(old, logic(("10", "GrG"), ("3", "rrr")))
    assert not compare_programs(old, logic(("10", "GrG")))
    assert not compare_programs(old, logic(("10", "GrG"), ("3", "yrr"), ("3", "yrr")))
    assert not compare_programs(old, logic(("10", "GrG"), ("3", "yrr"), kind="actuated"))


def test_traffic_letter_tells_who_must_wait():
    walk = Walk(crossing="c", index=2, length=6.0, foes=(foe(0, blocks=True), foe(1)))
    letters = {
        "rr": "G", "rg": "G", "rG": "g", "ry": "-", "rs": "G", "Gr": "r", "gr": "r", "yr": "r", "ur": "r",
        "sr": "G", "oo": "o", "OO": "o", "or": "r", "YG": "r", "rY": "-",
    }  # fmt: skip
    assert {state: traffic_letter(walk, state) for state in letters} == letters


def test_compute_greens_ends_early_enough_across_phases():
    walk = Walk(crossing="c", index=1, length=12.0, foes=(foe(0, blocks=True),))
    phases = cycle(("G", 20), ("y", 3), ("r", 8), ("r", 6))
    assert [green.seconds for green in compute_greens(phases, walk)] == [0, 0, 4, 0]
    assert [green.seconds for green in compute_greens(cycle(("G", 20), ("r", 13)), walk)] == [0, 0]
    assert [green.seconds for green in compute_greens(cycle(("r", 5)), walk)] == [5]


def test_compute_greens_shares_with_protected_turns_only_when_it_must():
    walk = Walk(crossing="c", index=2, length=6.0, foes=(foe(0, blocks=True), foe(1)))
    both = compute_greens(cycle(("Gr", 20), ("rG", 20), ("rr", 10)), walk)
    assert [green.seconds for green in both] == [0, 0, 5]
    forced = compute_greens(cycle(("Gr", 20), ("rG", 20)), walk)
    assert [(green.letter, green.seconds) for green in forced] == [("r", 0), ("g", 15)]


def parse(data: bytes) -> ET.Element:
    return ET.fromstring(data)  # noqa: S314 (networks that the package itself has checked, or SUMO wrote)


def foe(index: int, *, blocks: bool = False) -> Foe:
    return Foe(index=index, blocks=blocks, yields=True)


def cycle(*phases: tuple[str, int]) -> list[TimedPhase]:
    return [
        TimedPhase(state=state, least=Decimal(least), following=((number + 1) % len(phases),))
        for number, (state, least) in enumerate(phases)
    ]


def cologne1() -> ET.Element:
    return parse(read_bytes(find_network("cologne1")[0]))


def seconds(logic: ET.Element) -> Iterator[str]:
    """Play a program for one cycle."""
    for phase in logic.iterfind("phase"):
        duration = float(phase.get("duration"))
        assert duration == int(duration)
        yield from [phase.get("state")] * int(duration)


def road_lanes(root: ET.Element) -> dict[str, ET.Element]:
    return {
        lane.get("id"): lane
        for edge in root.iterfind("edge")
        if edge.get("function", "normal") == "normal"
        for lane in edge.iterfind("lane")
    }


def connections(root: ET.Element) -> dict[tuple[str, str], tuple[str | None, str | None]]:
    """Find who controls each way from lane to lane."""
    lanes = road_lanes(root)
    ways = {
        (f"{c.get('from')}_{c.get('fromLane')}", f"{c.get('to')}_{c.get('toLane')}"): (
            c.get("tl"),
            c.get("linkIndex"),
        )
        for c in root.iterfind("connection")
    }
    return {way: control for way, control in ways.items() if way[0] in lanes and way[1] in lanes}


def crossing_lengths(root: ET.Element) -> dict[str, float]:
    return {
        edge.get("id"): float(edge.find("lane").get("length"))
        for edge in root.iterfind("edge")
        if edge.get("function") == "crossing"
    }


def played(root: ET.Element) -> Iterator[tuple[str, list[tuple[str, str]], str]]:
    """Give each signalled crossing, its conflicting links and its own letters, each played second by second.

    A vehicle link conflicts if it leaves or enters a road that is crossed, at the crossing's junction. One
    without a letter of this signal may always go.
    """
    edges = {edge.get("id"): edge for edge in root.iterfind("edge")}
    links = root.findall("connection")
    ways = [link for link in links if not (link.get("from") + link.get("to")).count(":")]
    for logic in root.iterfind("tlLogic"):
        states = list(seconds(logic))

        def letters(link: ET.Element, logic=logic, states=states) -> str:
            index = int(link.get("linkIndex", "-1")) if link.get("tl") == logic.get("id") else -1
            return "".join(state[index] if index >= 0 else "g" for state in states)

        for walk in links:
            crossing = walk.get("to")
            if walk.get("tl") != logic.get("id") or edges[crossing].get("function") != "crossing":
                continue
            crossed = edges[crossing].get("crossingEdges").split()
            conflicts = [
                (
                    "turns" if link.get("from") not in crossed and link.get("dir") in "lrt" else "blocks",
                    letters(link),
                )
                for link in ways
                if crossing.startswith(f":{edges[link.get('from')].get('to')}_c")
                and {link.get("from"), link.get("to")} & set(crossed)
            ]
            assert conflicts
            yield crossing, conflicts, letters(walk)


def kind(link: ET.Element, crossed: list[str]) -> str:
    """Tell a turn onto a crossed road, which may come while people walk, from all other traffic."""
    return "turns" if link.get("from") not in crossed and link.get("dir") in "lrt" else "blocks"


def run_sumo(*arguments: object, folder: Path) -> str:
    """Run SUMO and return what it had to say."""
    sumo = find_netconvert().with_name("sumo")
    command = [sumo, *map(str, arguments), "--no-step-log", "--aggregate-warnings", "100000", "--seed", "1"]
    run = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    return run.stderr


def walker_entries(fcd: ET.Element, prefix: str) -> list[tuple[int, str]]:
    """Find when each person stepped onto each crossing."""
    entries = []
    steps = [(int(float(step.get("time"))), step) for step in fcd.iterfind("timestep")]
    for (_, before), (second, step) in pairwise(steps):
        at = {person.get("id"): person.get("edge") for person in before.iterfind("person")}
        for person in step.iterfind("person"):
            edge = person.get("edge")
            if edge.startswith(prefix) and at.get(person.get("id")) != edge:
                entries.append((second, edge))
    return entries
