"""Configurations of SUMO as data: what is taken, by any of its names, and that every option is decided on."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from networks import run_sumo_tool

from dojo_env.errors import ScenarioError
from dojo_env.sumo_options import (
    FILES,
    NEVER,
    OUTPUT_FILES,
    OUTPUTS,
    READ,
    SIMULATION,
    full_name,
    read_configuration,
)


@pytest.fixture(scope="module")
def options(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ET.Element]:
    """The installed SUMO's own list of its options."""
    path = tmp_path_factory.mktemp("sumo") / "template.xml"
    run_sumo_tool("sumo", "--save-template", path)
    return {option.tag: option for topic in ET.parse(path).getroot() for option in topic}  # noqa: S314


def write(folder: Path, text: str) -> Path:
    path = folder / "x.sumocfg"
    path.write_text(f"<configuration>{text}</configuration>", encoding="utf-8")
    return path


def test_every_option_of_sumo_is_taken_or_left_out_on_purpose(options: dict[str, ET.Element]) -> None:
    decided = [*FILES, *SIMULATION, *OUTPUTS, *NEVER]
    assert len(set(decided)) == len(decided)
    assert set(decided) == set(options)


def test_all_that_names_a_file_and_is_taken_is_known_to(options: dict[str, ET.Element]) -> None:
    taken = {*FILES, *SIMULATION, *OUTPUTS}
    files = {name for name in taken if options[name].get("type") == "FILE"}
    files |= {name for name in taken if name.endswith(("file", "output", "files"))}
    assert files <= {*FILES, *OUTPUT_FILES, *READ}


def test_short_and_old_names_are_known(options: dict[str, ET.Element]) -> None:
    for name in {*FILES, *SIMULATION, *OUTPUTS}:
        for other in options[name].get("synonymes", "").split():
            assert full_name(other) == name


def test_options_are_read_as_sumo_reads_them(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        """<input><n v="a%20b.net.xml"/><routes value="r1.xml, ../r2.xml"/></input><scale value="0.5"/>
        <deep><er><device.routing.period value="30"/><b value="3"/></er></deep>
        <additional-files value=""/><output><tripinfo value="t.xml"/><fcd-output.geo value="true"/></output>
        <traci_server><remote-port value="8813"/></traci_server><v value="true"/><unheard-of value="1"/>""",
    )
    found = read_configuration(path)
    assert found.files == {
        "net-file": (tmp_path / "a b.net.xml",),
        "route-files": (tmp_path / "r1.xml", tmp_path / "../r2.xml"),
    }
    assert found.options == {"scale": "0.5", "device.rerouting.period": "30", "begin": "3"}
    assert found.outputs == {"tripinfo-output": "t.xml", "fcd-output.geo": "true"}
    assert found.left_out == ("remote-port", "v", "unheard-of")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "<n value='a.xml'/><net-file value='b.xml'/>",
            "net-file: the option stands here twice|n: the option",
        ),
        ("<net-file value='${HOME}/a.xml'/>", "environment"),
        ("<scale value='${PID}'/>", "environment"),
        ("<phemlight-path value='/dev/null'/>", "neither a file nor a folder"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        read_configuration(write(tmp_path, text))


def test_many_unknown_options_are_told_in_one_short_line(tmp_path: Path) -> None:
    found = read_configuration(write(tmp_path, "".join(f"<z{'y' * k} value='1'/>" for k in range(500))))
    assert found.left_out[-1] == "480 more"
    assert len(", ".join(found.left_out)) < 2000
