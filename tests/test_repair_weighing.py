"""What a repair may cost: lesser issues than those it mends, and never one as severe."""

import re
from pathlib import Path

import networks
import pytest

from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.repair.rounds import fix_network
from dojo_maps.repair.weighing import find_objection

NOTE, WARNING, ERROR = Severity.NOTE, Severity.WARNING, Severity.ERROR


def _issue(check: str, severity: Severity, name: str = "a", x: float = 0.0) -> Issue:
    fault = (Element(kind="signal", id=name),)
    return Issue(
        check=check, severity=severity, elements=fault, position=(x, 0.0, 0.0), message=check, hint=""
    )


@pytest.mark.parametrize("mended", list(Severity))
@pytest.mark.parametrize("brought", list(Severity))
def test_what_is_mended_must_be_more_severe_than_what_is_brought(mended: Severity, brought: Severity) -> None:
    order = [NOTE, WARNING, ERROR]
    objection, costs = find_objection("c.one", [_issue("c.one", mended)], [_issue("c.two", brought)])
    assert costs
    assert (objection == "") == (order.index(mended) > order.index(brought))


def test_new_error_does_not_hide_behind_one_of_its_check_that_goes() -> None:
    before = [_issue("c", ERROR, "a", 1.0), _issue("c", ERROR, "b", 2.0)]
    assert find_objection("c", before, [_issue("c", ERROR, "d", 3.0)])[0]
    assert find_objection("c", before, [_issue("c", ERROR, "a", 4.0)]) == ("", False)
    assert find_objection("c", before, [_issue("c", ERROR, "d", 2.0)]) == ("", False)


def test_error_that_becomes_a_warning_is_mended_and_the_reverse_is_refused() -> None:
    grave, slight = [_issue("c", ERROR)], [_issue("c", WARNING)]
    assert find_objection("c", grave, slight) == ("", False)
    assert find_objection("c", slight, grave)[0]


def test_what_was_hidden_does_not_count_and_what_does_not_help_is_refused() -> None:
    before, after = [_issue("c", NOTE)], [_issue("d", ERROR, "b")]
    assert find_objection("c", before, after)[0]
    assert not find_objection("c", before, after, [Element(kind="signal", id="b")])[0]
    assert find_objection("c", before, before)[0] == "it would not help"


def _crossed(folder: Path, **links: int) -> Path:
    """One crossing at a signal; a program that cuts walkers off and gives the cars green at once."""
    nodes = [networks._node("c", 0, 0, type_="traffic_light"), networks._node("w", -150, 0)]
    nodes.append(networks._node("e", 150, 0))
    edges = networks._star_edges(["w", "e"], numLanes=2, speed=13.89)
    letters = " ".join(f'{name}="{value}"' for name, value in links.items())
    crossing = [f'<crossing node="c" edges="w -w" priority="1" {letters}/>']
    path = networks._build(
        folder,
        "crossed",
        nodes,
        edges,
        "--sidewalks.guess",
        "--walkingareas",
        "--no-turnarounds",
        connections=crossing,
    )
    phases = (
        '<phase duration="30" state="rrrrGG"/><phase duration="3" state="rrrrrr"/>'
        '<phase duration="30" state="GGGGrr"/><phase duration="4" state="yyyyrr"/>'
    )
    text = path.read_text()
    path.write_text(re.sub(r"(<tlLogic[^>]*>).*?(</tlLogic>)", rf"\1{phases}\2", text, flags=re.S))
    return path


def test_crossing_is_cleared_for_those_who_come_the_other_way(tmp_path: Path) -> None:
    path = _crossed(tmp_path, linkIndex=4, linkIndex2=5)
    check = "pedestrians.crossing_clearance"
    fixed = fix_network(path.read_bytes(), path, [check])
    assert fixed.before.counts[check] == (2, 2)
    assert check not in fixed.after.counts
    signal = fixed.after.site.facts.map.signals[0]
    shown = [phase.state[4:6] for phase in signal.programs[0].phases]
    assert set(shown) == {"GG", "rr"}
    cleared = sum(phase.duration for phase in signal.programs[0].phases if phase.state == "rrrrrr")
    length = sum(c.shape[-1][1] - c.shape[0][1] for c in fixed.after.site.facts.crossings.values())
    assert cleared >= abs(length) / 1.2


def test_error_is_mended_though_a_note_appears(tmp_path: Path) -> None:
    path = networks._build(
        tmp_path, "plain", networks._star()[0], networks._star_edges(["e", "n", "w", "s"], numLanes=1)
    )
    # Two phases without yellow; where one is put in, the way across asks for an all-red as well.
    text = re.sub(r'<phase [^>]*state="[^"]*y[^"]*"[^>]*/>\s*', "", path.read_text())
    fixed = fix_network(text.encode(), path, ["signals.missing_yellow"])
    assert fixed.before.counts.get("signals.all_red", (0, 0)) == (0, 0)
    assert fixed.before.counts["signals.missing_yellow"][0] > 0
    assert "signals.missing_yellow" not in fixed.after.counts, fixed.refused
    assert fixed.after.counts["signals.all_red"] == (1, 0)
