"""ASAM OpenDRIVE, written by SUMO's netconvert from the network and stripped of what changes on each run.

Roads carry the network's edge id as `userData`. Left-hand maps get their lanes on the left and the rule LHT,
which OpenDRIVE has since 1.5: netconvert's own default for them mixes both sides and names no rule.
"""

import re
import shutil
from pathlib import Path
from xml.sax.saxutils import quoteattr

from dojo_maps.description import RoadMap
from dojo_maps.errors import ExportError
from dojo_maps.exports import file_stem
from dojo_maps.sources.netconvert import run_netconvert
from dojo_maps.whole_file import work_folder

_NETWORK, _RESULT = "network.net.xml", "map.xodr"
_HEADER = re.compile(r'<header revMajor="1" revMinor="\d+" name="" version="([^"]*)" date="[^"]*"')


def write_opendrive(road_map: RoadMap, network: Path, folder: Path) -> None:
    """Write `<name>.xodr`.

    Raises:
        ToolMissingError: netconvert is not installed.
        DojoError: netconvert refused the network, crashed, or took too long.
        ExportError: what it wrote is not what is expected of it.
    """
    arguments = ["-s", _NETWORK, "--opendrive-output", _RESULT, "--output.original-names"]
    if road_map.left_hand:
        arguments.append("--opendrive-output.lefthand-left")
    with work_folder() as work:
        # Under a plain name, because netconvert splits paths at commas and spaces.
        shutil.copyfile(network, work / _NETWORK)
        run_netconvert(arguments, folder=work)
        text = (work / _RESULT).read_text(encoding="utf-8")
    (folder / f"{file_stem(road_map)}.xodr").write_text(_settle(text, road_map), encoding="utf-8")


def _settle(text: str, road_map: RoadMap) -> str:
    """Drop the time and the command line, and say what netconvert leaves unsaid: the name and the rule."""
    start = text.find("<OpenDRIVE")
    header = _HEADER.search(text, start) if start >= 0 else None
    if header is None:
        raise ExportError(
            "netconvert's OpenDRIVE has no header of the expected form; please report its version"
        )
    minor = 5 if road_map.left_hand else 4
    name = quoteattr(road_map.name)
    settled = f'<header revMajor="1" revMinor="{minor}" name={name} version="{header[1]}"'
    roads = text[header.end() :]
    if road_map.left_hand:
        roads = roads.replace("<road ", '<road rule="LHT" ')
    declaration = '<?xml version="1.0" encoding="UTF-8"?>\n\n'
    return declaration + text[start : header.start()] + settled + roads
