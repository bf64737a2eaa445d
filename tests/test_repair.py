"""`dojo-maps fix` on real networks: what it repairs is repaired, nothing else changes, SUMO agrees."""

import gzip
import os
import re
import subprocess
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree as ET

import networks
import pytest
from conftest import dojo_maps

from dojo_maps.cli import main
from dojo_maps.input_files import read_bytes
from dojo_maps.issue import Issue, Severity
from dojo_maps.repair.fixing import patch_of
from dojo_maps.repair.joining import _overlay
from dojo_maps.repair.net_text import NetText
from dojo_maps.repair.rounds import Fixed, State, fix_network
from dojo_maps.repair.weighing import list_new
from dojo_maps.sources.files import find_network
from dojo_maps.sources.sumo_xml import LogicRecord, read_records

pytestmark = pytest.mark.sampled(2)

# What must fall to zero, by network.
CURED = {
    "arterial4x4": {"signals.yellow_short"},
    "3x3grid-3x3Grid2lanes": {"signals.yellow_short"},
    "ingolstadt7": {"signals.green_conflict"},
    "ingolstadt21": {"signals.green_conflict", "signals.unused_index"},
    "fokr_bs_demo-fokr_bs": {"geometry.gap", "pedestrians.crossing_clearance"},
    "hiking": {"pedestrians.crossing_clearance"},
    "fkk_in-ingolstadt": {"geometry.gap", "signals.missing_yellow", "signals.green_conflict"},
    "DRT-osm": {"pedestrians.crossing_clearance", "pedestrians.walk_min"},
}
FALLS = {"DRT-osm": {"geometry.sidewalk_on_road"}}
UNTOUCHED = ("cologne1", "cologne3", "grid4x4", "RiLSA_example1-rilsa1")


@lru_cache(maxsize=3)
def _fixed(name: str) -> Fixed:
    path = networks.installed_networks()[name]
    return fix_network(read_bytes(path), path)


def _counts(fixed: Fixed) -> dict[str, tuple[int, int]]:
    checks = fixed.before.counts.keys() | fixed.after.counts.keys()
    return {c: (fixed.before.counts.get(c, (0, 0))[0], fixed.after.counts.get(c, (0, 0))[0]) for c in checks}


def _is_error(issue: Issue) -> bool:
    return issue.severity is Severity.ERROR


def _errors(state: State) -> int:
    return sum(map(_is_error, state.issues))


def load_in_sumo(network: Path) -> list[str]:
    """Let SUMO load a network and simulate a second; what it complains about."""
    home = networks._package_folder("sumo")
    done = subprocess.run(
        [
            home / "bin" / "sumo",
            "-n",
            network,
            "--end",
            "1",
            "--no-step-log",
            "--aggregate-warnings",
            "99999",
        ],
        env={**os.environ, "SUMO_HOME": str(home)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [line for line in done.stderr.splitlines() if line.startswith("Warning")]


@pytest.mark.parametrize("name", CURED)
def test_fix_repairs_what_it_names_and_makes_nothing_worse(name: str) -> None:
    counts = _counts(_fixed(name))
    assert {check: counts[check][1] for check in CURED[name]} == dict.fromkeys(CURED[name], 0)
    assert all(counts[check][0] > 0 for check in CURED[name])
    assert all(counts[check][1] < counts[check][0] for check in FALLS.get(name, ()))
    grown = {check for check, count in counts.items() if count[1] > count[0]}
    assert not [
        new for new in list_new(_fixed(name).before.issues, _fixed(name).after.issues) if _is_error(new)
    ]
    assert not grown or _errors(_fixed(name).after) < _errors(_fixed(name).before)
    assert 1 <= _fixed(name).rounds <= 5


@pytest.mark.parametrize("name", CURED)
def test_fixed_network_loads_in_sumo_without_new_warnings(name: str, tmp_path: Path) -> None:
    fixed = _fixed(name)
    warnings = []
    for state in (fixed.before, fixed.after):
        path = tmp_path / "network.net.xml"
        path.write_bytes(state.data)
        # Numbers of phases and seconds in a warning may change with a repair.
        warnings.append({re.sub(r"\d+", "#", line) for line in load_in_sumo(path)})
    assert warnings[1] <= warnings[0]


@pytest.mark.parametrize("name", ["ingolstadt7", "RiLSA1-rilsa1"])
def test_sumo_no_longer_calls_greens_unsafe(name: str, tmp_path: Path) -> None:
    path = tmp_path / "network.net.xml"
    path.write_bytes(_fixed(name).before.data)
    assert any("nsafe green" in line for line in load_in_sumo(path))
    path.write_bytes(_fixed(name).after.data)
    assert not any("nsafe green" in line for line in load_in_sumo(path))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["arterial4x4", "ingolstadt7", "fkk_in-ingolstadt", "fokr_bs_demo-fokr_bs"])
def test_second_fix_changes_nothing_and_the_first_gives_the_same_bytes_again(name: str) -> None:
    first = _fixed(name)
    again = fix_network(first.before.data, Path("again.net.xml"))
    second = fix_network(first.after.data, Path("second.net.xml"))
    assert again.after.data == first.after.data
    assert patch_of(again) == patch_of(first)
    assert second.after.data == first.after.data
    assert not second.made


@pytest.mark.parametrize("name", UNTOUCHED)
def test_sound_network_keeps_every_byte(name: str) -> None:
    fixed = _fixed(name)
    assert fixed.after.data == fixed.before.data
    assert not fixed.made


def test_repair_of_programs_changes_no_byte_outside_of_them() -> None:
    fixed = _fixed("arterial4x4")
    outside = [
        re.sub(rb"<tlLogic.*?</tlLogic>", b"", s.data, flags=re.S) for s in (fixed.before, fixed.after)
    ]
    assert outside[0] == outside[1]
    cycles = [
        {
            logic.attributes["id"]: sum(float(phase["duration"]) for phase in logic.phases)
            for logic in read_records(state.data, "x").logics
        }
        for state in (fixed.before, fixed.after)
    ]
    assert cycles[0] == cycles[1], "longer yellows should not have changed the cycles"


def test_repair_of_clearance_shows_vehicles_the_same(tmp_path: Path) -> None:
    path, _ = find_network(str(networks.installed_networks()["hiking"]))
    fixed = fix_network(read_bytes(path), path, ["pedestrians.crossing_clearance"])
    walking = {
        s.id: {k.index for k in s.links if k.kind.value == "pedestrian"}
        for s in fixed.before.site.facts.map.signals
    }
    for old, new in zip(
        *(read_records(s.data, "x").logics for s in (fixed.before, fixed.after)), strict=True
    ):
        shown = []
        for logic in (old, new):
            rows: list[str] = []
            for phase in logic.phases:
                letters = "".join(
                    c for k, c in enumerate(phase["state"]) if k not in walking[old.attributes["id"]]
                )
                if not rows or rows[-1] != letters:
                    rows.append(letters)
            shown.append(rows)
        assert shown[0] == shown[1]


def test_netconvert_takes_the_patch_and_reaches_the_same(tmp_path: Path) -> None:
    fixed = _fixed("arterial4x4")
    (tmp_path / "in.net.xml").write_bytes(fixed.before.data)
    files = patch_of(fixed)
    assert list(files) == ["repair.tll.xml"]
    (tmp_path / "repair.tll.xml").write_text(files["repair.tll.xml"], encoding="utf-8")
    networks.run_sumo_tool(
        "netconvert",
        "-s",
        tmp_path / "in.net.xml",
        "-i",
        tmp_path / "repair.tll.xml",
        "-o",
        tmp_path / "out.net.xml",
    )
    programs = [
        {
            (r.attributes["id"], r.attributes["programID"]): [
                (float(p["duration"]), p["state"]) for p in r.phases
            ]
            for r in read_records(data, "x").logics
        }
        for data in (fixed.after.data, (tmp_path / "out.net.xml").read_bytes())
    ]
    assert programs[0] == programs[1]


@pytest.mark.parametrize("name", CURED)
def test_patch_is_well_formed_and_in_the_formats_of_netconvert(name: str, tmp_path: Path) -> None:
    files = patch_of(_fixed(name))
    assert files
    options = {"repair.nod.xml": "-n", "repair.edg.xml": "-e", "repair.con.xml": "-x", "repair.tll.xml": "-i"}
    (tmp_path / "in.net.xml").write_bytes(_fixed(name).before.data)
    arguments: list[str | Path] = ["-s", tmp_path / "in.net.xml"]
    for file, text in files.items():
        ET.fromstring(text)  # noqa: S314 - our own
        (tmp_path / file).write_text(text, encoding="utf-8")
        arguments += [options[file], tmp_path / file]
    networks.run_sumo_tool("netconvert", *arguments, "-o", tmp_path / "out.net.xml")


def test_only_repairs_what_is_named(tmp_path: Path) -> None:
    path = networks.installed_networks()["fkk_in-ingolstadt"]
    fixed = fix_network(read_bytes(path), path, ["geometry.gap"])
    changed = {check for check, (old, new) in _counts(fixed).items() if old != new}
    assert changed == {"geometry.gap"}


def test_crossings_are_added_on_request_only(tmp_path: Path) -> None:
    nodes, ends = networks._star()
    edges = networks._star_edges(ends, numLanes=2, speed=13.89)
    bare = networks._build(tmp_path, "plain", nodes, edges, "--sidewalks.guess", "--walkingareas")
    data = read_bytes(bare)
    check = "pedestrians.missing_crossing"
    assert fix_network(data, bare).after.counts[check][0] == 1
    fixed = fix_network(data, bare, [check])
    assert check not in fixed.after.counts, fixed.refused
    assert len(fixed.after.site.facts.crossings) == 4
    assert 'crossing node="c"' in patch_of(fixed)["repair.con.xml"]
    assert _load_bytes(fixed.after.data, tmp_path) == _load_bytes(data, tmp_path)


def _load_bytes(data: bytes, folder: Path) -> list[str]:
    path = folder / "loaded.net.xml"
    path.write_bytes(data)
    return load_in_sumo(path)


def _two_signals(folder: Path) -> Path:
    """Two signals 20 m apart, each with a fixed program, one with an offset."""
    nodes = [
        networks._node("a", 0, 0, type_="traffic_light"),
        networks._node("b", 20, 0, type_="traffic_light"),
        *(
            networks._node(f"{n}", x, y)
            for n, (x, y) in {"w": (-150, 0), "e": (170, 0), "n": (0, 150), "s": (20, -150)}.items()
        ),
    ]
    pairs = (("w", "a"), ("a", "b"), ("b", "e"), ("n", "a"), ("s", "b"))
    edges = [
        e for one, two in pairs for e in networks._both_ways(f"{one}{two}", one, two, numLanes=1, speed=13.89)
    ]
    path = networks._build(folder, "split", nodes, edges, "--no-turnarounds")
    path.write_bytes(
        path.read_bytes().replace(
            b'<tlLogic id="b" type="static" programID="0" offset="0"',
            b'<tlLogic id="b" type="static" programID="0" offset="17"',
        )
    )
    return path


_WATCH = """
import json, sys, libsumo
states = []
libsumo.start(["sumo", "-n", sys.argv[1], "--no-step-log", "--no-warnings"])
for _ in range(200):
    libsumo.simulationStep()
    lights = libsumo.trafficlight
    states.append([lights.getRedYellowGreenState(name) for name in sorted(lights.getIDList())])
libsumo.close()
print(json.dumps(states))
"""


def _watch(path: Path) -> list[list[str]]:
    import json  # noqa: PLC0415
    import sys  # noqa: PLC0415

    done = subprocess.run(
        [sys.executable, "-c", _WATCH, path], capture_output=True, text=True, timeout=120, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_joined_signals_show_what_the_two_showed_at_every_second(tmp_path: Path) -> None:
    path = _two_signals(tmp_path)
    fixed = fix_network(read_bytes(path), path, ["signals.split_signals"])
    assert _counts(fixed)["signals.split_signals"] == (1, 0), fixed.refused
    joined = tmp_path / "joined.net.xml"
    joined.write_bytes(fixed.after.data)
    assert [["".join(pair)] for pair in _watch(path)] == _watch(joined)


def test_programs_of_different_cycles_are_not_joined() -> None:
    rows = [
        LogicRecord({"id": "a"}, [{"duration": "30", "state": "G"}]),
        LogicRecord({"id": "b"}, [{"duration": "31", "state": "r"}]),
    ]
    assert _overlay(*rows) is None


# The command.


@pytest.mark.slow
def test_fix_writes_only_the_file_that_o_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "in.net.xml"
    data = read_bytes(networks.installed_networks()["ingolstadt7"])
    source.write_bytes(data)
    assert main(["fix", str(source), "--dry-run"]) == 0
    shown = capsys.readouterr().out
    assert "--- repair.tll.xml" in shown
    assert re.search(r"signals\.green_conflict +2 +0\n", shown)
    assert main(["fix", str(source), "-o", str(tmp_path / "out.net.xml")]) == 0
    assert source.read_bytes() == data
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in.net.xml", "out.net.xml"]
    assert main(["fix", str(source), "-o", str(source)]) == 0
    assert source.read_bytes() == (tmp_path / "out.net.xml").read_bytes() != data


def test_fix_packs_what_is_named_gz_and_writes_the_patch(tmp_path: Path) -> None:
    out, patch = tmp_path / "out.net.xml.gz", tmp_path / "patch"
    assert main(["fix", "arterial4x4", "-o", str(out), "--patch", str(patch)]) == 0
    assert gzip.decompress(out.read_bytes()) == _fixed("arterial4x4").after.data
    assert [p.name for p in patch.iterdir()] == ["repair.tll.xml"]


@pytest.mark.slow
def test_fix_repairs_the_network_of_a_bundle(converted, tmp_path: Path) -> None:
    bundle = converted("ingolstadt7").bundle
    assert main(["fix", bundle, "-o", str(tmp_path / "out.net.xml")]) == 0
    assert (tmp_path / "out.net.xml").read_bytes() == _fixed("ingolstadt7").after.data


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["arterial4x4"], 2),
        (["arterial4x4", "--dry-run", "--only", "signals.nothing"], 2),
        (["arterial4x4", "-o", "{folder}"], 2),
        (["arterial4x4", "-o", "{folder}/no/such/out.net.xml"], 2),
        (["{folder}/missing.net.xml", "--dry-run"], 3),
        (["{folder}/broken.net.xml", "--dry-run"], 3),
        (["{folder}/entities.net.xml", "--dry-run"], 3),
        (["{folder}/wide.net.xml", "--dry-run"], 3),
        (["fkk", "--dry-run"], 3),
    ],
)
def test_fix_refuses_in_one_line(arguments: list[str], status: int, tmp_path: Path) -> None:
    (tmp_path / "broken.net.xml").write_bytes(b"<net><edge")
    (tmp_path / "entities.net.xml").write_bytes(b'<!DOCTYPE net [<!ENTITY a "b">]><net>&a;</net>')
    (tmp_path / "wide.net.xml").write_bytes("<?xml version='1.0' encoding='UTF-16'?><net/>".encode("utf-16"))
    done = dojo_maps("fix", *(a.format(folder=tmp_path) for a in arguments))
    assert done.returncode == status, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert "Traceback" not in done.stderr
    assert len(list(tmp_path.iterdir())) == 3


def test_fix_ends_with_1_when_errors_are_left() -> None:
    assert main(["fix", str(networks.installed_networks()["racing-spreewaldring"]), "--dry-run"]) == 1


# The text of a network.

_TEXT = """<?xml version='1.0' encoding='ISO-8859-1'?>
<net version="1.0">
  <!-- <edge id="a"> is no edge -->
  <edge id='a>"b' from="x" to="y" name="shape='0,0' é">
     <lane id = "l" index="0" shape='0,0 1,1'
           speed="1"/>
  </edge>\r
  <tlLogic id="s" programID="0"><phase duration="1" state="r"/><param key="k" value="v"/>
    <phase duration="2" state="G" /></tlLogic>
</net>
""".encode("latin-1")


def test_text_changes_nothing_but_what_is_named() -> None:
    text = NetText(_TEXT, Path("t"))
    lane = text.set_attributes(("lane", "l"), {"shape": "2,2 3,3", "speed": None, "width": 'a"<é'})
    changed = text.replaced([lane])
    assert changed == _TEXT.replace(
        b"'0,0 1,1'\n           speed=\"1\"/>", b'"2,2 3,3" width=\'a"&lt;&#233;\'/>'
    )
    name = text.set_attributes(("edge", 'a>"b'), {"to": "z"})
    assert text.replaced([name]) == _TEXT.replace(b'to="y"', b'to="z"')


def test_text_keeps_rows_that_stay_and_what_stands_between_them() -> None:
    text = NetText(_TEXT, Path("t"))
    rows = (
        (("duration", "1"), ("state", "r")),
        (("duration", "9"), ("state", "y")),
        (("duration", "2"), ("state", "G")),
    )
    written = text.replaced([text.set_rows(("tlLogic", "s", "0"), rows)]).decode("latin-1")
    inner = written.partition('programID="0">')[2].partition("</tlLogic>")[0].split("\n")
    assert [line.strip() for line in inner] == [
        '<phase duration="1" state="r"/>',
        '<phase duration="9" state="y"/>',
        '<phase duration="2" state="G" />',
        '<param key="k" value="v"/>',
    ]


def test_text_removes_an_element_with_its_line() -> None:
    text = NetText(_TEXT, Path("t"))
    left = text.replaced([text.remove(("edge", 'a>"b'), 0)])
    assert b"<edge id='" not in left
    assert left.count(b"\n") == _TEXT.count(b"\n") - 4
