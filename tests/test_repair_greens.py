"""Links that never get green: with those that they do not cross, or in a phase of their own."""

import re
from pathlib import Path

import networks
import pytest
from test_repair import load_in_sumo

from dojo_maps.description import Program
from dojo_maps.repair.rounds import Fixed, fix_network

CHECK = "signals.never_green"


@pytest.fixture
def star(tmp_path: Path) -> Path:
    """Four legs, a lane each; the links of a leg are three letters in a row."""
    edges = networks._star_edges(["e", "n", "w", "s"], numLanes=1)
    return networks._build(tmp_path, "star", networks._star()[0], edges, "--no-turnarounds")


def _with_programs(path: Path, *programs: list[tuple[int, str]]) -> Path:
    written = "".join(
        f'<tlLogic id="c" type="static" programID="{number}" offset="0">'
        + "".join(f'<phase duration="{seconds}" state="{state}"/>' for seconds, state in phases)
        + "</tlLogic>"
        for number, phases in enumerate(programs)
    )
    path.write_text(re.sub(r"<tlLogic.*</tlLogic>", written, path.read_text(), flags=re.S))
    return path


def _fix(path: Path) -> tuple[Fixed, list[Program]]:
    fixed = fix_network(path.read_bytes(), path, [CHECK])
    return fixed, list(fixed.after.site.facts.map.signals[0].programs)


def test_link_goes_with_those_that_it_does_not_cross(star: Path) -> None:
    _with_programs(
        star, [(30, "GGrrrrGGgrrr"), (4, "yyrrrryyyrrr"), (30, "rrrGGgrrrGGg"), (4, "rrryyyrrryyy")]
    )
    fixed, (program,) = _fix(star)
    assert fixed.before.counts[CHECK] == (1, 1)
    assert CHECK not in fixed.after.counts, fixed.refused
    assert not any(issue.severity == "error" for issue in fixed.after.issues)
    # A turn to the left, link 2, crosses the oncoming traffic: it gets a phase of its own.
    green = [phase for phase in program.phases if phase.state[2] in "Gg"]
    assert [phase.state for phase in green] == ["rrGrrrrrrrrr"]
    assert sum(phase.state[2] == "y" for phase in program.phases) == 1


def test_link_joins_the_longest_phase_in_which_it_is_free(star: Path) -> None:
    _with_programs(
        star, [(30, "rGgrrrrGgrrr"), (4, "ryyrrrryyrrr"), (20, "rrrGGgrrrGGg"), (4, "rrryyyrrryyy")]
    )
    fixed, (program,) = _fix(star)
    assert fixed.before.counts[CHECK] == (2, 2)
    assert CHECK not in fixed.after.counts, fixed.refused
    assert len(program.phases) == 4
    assert [phase.state[0] for phase in program.phases] == ["G", "y", "r", "r"]


def test_single_phase_gets_a_second_with_yellow_between(star: Path, tmp_path: Path) -> None:
    _with_programs(star, [(40, "GGgrrrGGgrrr")])
    fixed, (program,) = _fix(star)
    assert CHECK not in fixed.after.counts, fixed.refused
    assert "signals.missing_yellow" not in fixed.after.counts
    assert "signals.green_conflict" not in fixed.after.counts
    assert all(set("".join(p.state[k] for p in program.phases)) >= set("Gy") for k in (3, 4, 9, 10))
    path = tmp_path / "mended.net.xml"
    path.write_bytes(fixed.after.data)
    assert load_in_sumo(path) == []


def test_links_that_another_program_lets_go_are_left_as_they_are(star: Path) -> None:
    _with_programs(star, [(40, "GGgrrrGGgrrr")], [(40, "rrrGGgrrrGGg")], [(40, "rrrrrrrrrrrr")])
    fixed, _ = _fix(star)
    assert fixed.before.counts[CHECK][0] > 0
    assert not fixed.made
    assert fixed.after.data == fixed.before.data


def test_walkers_get_time_to_cross_before_the_next_green(tmp_path: Path) -> None:
    path = networks.build_walkers_signal(tmp_path)
    path.write_text(re.sub(r'state="([^"]*)[rGg]"', r'state="\1r"', path.read_text()))
    fixed = fix_network(path.read_bytes(), path, [CHECK])
    assert fixed.before.counts[CHECK] == (1, 1)
    assert not any(issue.severity == "error" for issue in fixed.after.issues), fixed.refused
