"""Puts the page together: markup, style, three.js, our scripts and the packed data."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from dojo_maps.description import RoadMap
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.viewer.container import Container
from dojo_maps.viewer.map_data import describe_map
from dojo_maps.viewer.playback import Playback, pack_playback
from dojo_maps.viewer.scene_data import pack_meshes
from dojo_maps.whole_file import write_text

_FOLDER = Path(__file__).parent / "page"
_SCRIPTS = ("shaders", "scene", "camera", "signals", "playback", "picking", "panels", "main")
"""In the order in which they use each other; together they are one function."""


def write_view(
    road_map: RoadMap,
    meshes: Sequence[Mesh],
    page: Path,
    *,
    report: Mapping[str, Any] | None = None,
    playback: Playback | None = None,
) -> None:
    """Write the page that shows a map in 3D.

    It opens behind a stop line of the map's first signal. `#camera=x,y,z,tx,ty,tz` after its address opens
    another view: the eye and a point that it looks at, metres east, north and up of the map's origin;
    `#find=ID` one of a lane, road, junction or signal, and `#time=S` an instant.

    Args:
        road_map: the map.
        meshes: its scene, metres, x east, y north, z up, around the map's origin.
        page: the HTML file to write.
        report: what report.json holds, to mark its findings.
        playback: an episode to play.

    Raises:
        UsageError: the page is a folder, or lies in none.
        WriteError: the page cannot be written.
    """
    container = Container()
    value: dict[str, Any] = {"map": describe_map(road_map, report), "meshes": pack_meshes(meshes, container)}
    if playback is not None:
        value["playback"] = pack_playback(playback, container)
    scripts = "\n".join(_read(f"{name}.js") for name in _SCRIPTS)
    text = Template(_read("page.html")).substitute(
        title=html.escape(road_map.name),
        style=_read("page.css"),
        three=_read("three.min.js"),
        script=f'(() => {{\n"use strict";\n{scripts}\n}})();',
        data=container.packed(value),
    )
    write_text(page, text)


def _read(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")
