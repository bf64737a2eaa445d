"""Tags that hold at some times only: what they say at a moment, and what an import makes of it."""

import json
from pathlib import Path
from typing import Any

import pytest
import sumolib
from osm_drawings import SIGNAL, Drawing

from dojo_maps.bundle import Bundle
from dojo_maps.cli import main
from dojo_maps.conversion import ConvertOptions, convert
from dojo_maps.errors import UsageError
from dojo_maps.sources.osm.read.conditions import holds, read_moment


@pytest.mark.parametrize(
    ("condition", "moment", "expected"),
    [
        ("(Mo-Fr 07:00-09:00)", "Mo 08:00", True),
        ("(Mo-Fr 07:00-09:00)", "Mo 09:00", False),
        ("(Mo-Fr 07:00-09:00)", "Sa 08:00", False),
        ("Mo-Fr 07:00-09:00,16:00-19:00; Sa 08:00-12:00; PH off", "Sa 09:00", True),
        ("Mo-Fr 07:00-09:00,16:00-19:00; PH off", "We 17:30", True),
        ("Mo-Fr 07:00-09:00, Sa 10:00-12:00", "Mo 08:00", True),
        ("Mo-Fr 07:00-09:00, Sa 10:00-12:00", "Sa 11:00", True),
        ("22:00-06:00", "Tu 05:59", True),
        ("Fr 22:00-06:00", "Sa 02:00", True),
        ("Fr 22:00-06:00", "Fr 02:00", False),
        ("Su,PH 10:00-12:00", "Su 10:00", True),
        ("PH", "Su 10:00", False),
        ("Sa-Mo", "Su 23:59", True),
        ("Mo-Su 07:00-19:00; We off", "We 08:00", False),
        ("Mo-Fr 07:00-19:00; We 10:00-11:00", "We 08:00", False),
        ("24/7", "Mo 01:00", True),
        ("weight>7.5", "Mo 01:00", None),
        ("Nov-Mar", "Mo 01:00", None),
        ("sunrise-sunset", "Mo 01:00", None),
        ("Mo-Fr 07:00-09:00 AND wet", "Mo 08:00", None),
        ("", "Mo 08:00", None),
    ],
)
def test_holds_reads_opening_hours(condition: str, moment: str, expected: bool | None) -> None:
    assert holds(condition, read_moment(moment)) is expected


@pytest.mark.parametrize("text", ["Mo", "monday 08:00", "Mo 24:00", "Mo 08:60", ""])
def test_read_moment_refuses_what_is_none(text: str) -> None:
    with pytest.raises(UsageError, match="expected a weekday and a time"):
        read_moment(text)


def street(**tags: str) -> Drawing:
    """A crossroads at a signal; its northern arm has further tags."""
    drawing = Drawing()
    drawing.way((-100, 0), (0, 0), (100, 0), highway="secondary", lanes="2")
    drawing.way((0, -100), (0, 0), highway="secondary", lanes="2")
    drawing.way((0, 0), (0, 100), highway="secondary", lanes="2", **tags)
    drawing.node(0, 0, **SIGNAL)
    return drawing


def built(drawing: Drawing, folder: Path, at: str | None) -> tuple[Bundle, dict[str, Any]]:
    options = ConvertOptions(surroundings=False, at=at)
    return convert(str(drawing.write(folder / "a.osm")), folder / "a.dojo", options)


def northern(bundle: Bundle) -> list[Any]:
    net = sumolib.net.readNet(str(bundle.network))
    return [e for e in net.getEdges() if e.getID().lstrip("-").startswith("1003") and e.allows("passenger")]


@pytest.mark.parametrize(
    ("tags", "at", "ways", "speed"),
    [
        ({"oneway__conditional": "yes @ (Mo-Fr 07:00-09:00)"}, "Mo 08:00", 1, 50),
        ({"oneway__conditional": "yes @ (Mo-Fr 07:00-09:00)"}, "Mo 10:00", 2, 50),
        ({"motor_vehicle__conditional": "no @ (22:00-06:00)"}, "Mo 23:00", 0, 0),
        ({"motor_vehicle__conditional": "no @ (22:00-06:00)"}, "Mo 12:00", 2, 50),
        ({"motor_vehicle__forward__conditional": "no @ (Mo-Fr 07:00-09:00)"}, "Mo 08:00", 1, 50),
        ({"maxspeed": "50", "maxspeed__conditional": "30 @ (22:00-06:00); 40 @ Sa,Su"}, "Mo 05:00", 2, 30),
        ({"maxspeed": "50", "maxspeed__conditional": "30 @ (22:00-06:00); 40 @ Sa,Su"}, "Sa 12:00", 2, 40),
    ],
)
def test_conditional_tag_holds_at_its_time(
    tmp_path: Path, tags: dict[str, str], at: str, ways: int, speed: float
) -> None:
    bundle, report = built(street(**tags), tmp_path, at)
    edges = northern(bundle)
    assert len(edges) == ways
    assert all(edge.getSpeed() * 3.6 == pytest.approx(speed, abs=0.1) for edge in edges)
    assert not [i for i in report["issues"] if i["check"] in ("osm.tag_not_kept", "osm.condition_unread")]
    assert report["osm"]["at"] == at


def test_condition_that_is_not_understood_is_named(tmp_path: Path) -> None:
    _, report = built(street(motor_vehicle__conditional="no @ (weight>3.5)"), tmp_path, "Mo 08:00")
    (issue,) = [i for i in report["issues"] if i["check"] == "osm.condition_unread"]
    assert "motor_vehicle:conditional=no @ (weight>3.5)" in issue["message"]


@pytest.mark.parametrize(("at", "turns"), [("Mo 08:00", 2), ("Mo 10:00", 3)])
def test_turn_restriction_holds_at_its_time(tmp_path: Path, at: str, turns: int) -> None:
    drawing = street()
    drawing.restriction("no_left_turn", 1002, drawing.node(0, 0), 1001)
    tags = drawing.relations[0][1]
    tags["restriction:conditional"] = tags.pop("restriction") + " @ (Mo-Fr 07:00-09:00)"
    drawing.ways[0][0][:] = drawing.ways[0][0][:2]  # The way to the left alone.
    drawing.way((0, 0), (100, 0), highway="secondary", lanes="2")
    bundle, report = built(drawing, tmp_path, at)
    net = sumolib.net.readNet(str(bundle.network))
    (arriving,) = [e for e in net.getEdges() if e.getID() == "1002#0"]
    assert len(arriving.getOutgoing()) == turns
    assert not [i for i in report["issues"] if i["check"] == "osm.restriction_conditional"]


def test_command_takes_a_moment(tmp_path: Path) -> None:
    path = street(oneway__conditional="yes @ (Mo-Fr 07:00-09:00)").write(tmp_path / "a.osm")
    out = tmp_path / "a.dojo"
    assert main(["convert", str(path), "-o", str(out), "--at", "Mo 08:00", "--no-surroundings"]) == 0
    assert json.loads((out / "report.json").read_text())["osm"]["at"] == "Mo 08:00"
    assert main(["convert", str(path), "-o", str(out), "--at", "8 o'clock"]) == 2


def test_moment_is_for_openstreetmap_only() -> None:
    with pytest.raises(UsageError, match="--at is for"):
        convert("two-way", "never.dojo", ConvertOptions(at="Mo 08:00"))
