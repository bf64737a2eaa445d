"""report.html: one page, readable offline, with the map as vectors and every issue marked, listed and drawn.

The page's script builds everything from the data inside it, as text, never as markup. The data itself is JSON
in which no character is left that could end its element. Phase and time-space diagrams come as SVG, in which
all that a map names is escaped.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from dojo_maps.description import Lane, Origin, Points, RoadMap
from dojo_maps.report.netedit import selection_lines
from dojo_maps.report.phase_diagrams import draw_phases
from dojo_maps.report.time_space import draw_row, find_rows
from dojo_maps.wording import counted

_FOLDER = Path(__file__).parent
_FOLDED = '<details class="diagrams"><summary>{title}</summary>{content}</details>'
_MOST_SIGNALS = 60
"""Whose phases are drawn; each takes some 10 kB."""
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_BODY = """
<header><h1>{name}</h1><small>{about}</small><span id="shown" role="status"></span></header>
<aside>
<form id="filters">
<div><label class="error"><input type="checkbox" name="error" checked> errors <b id="count-error"></b></label>
<label class="warning"><input type="checkbox" name="warning" checked> warnings
<b id="count-warning"></b></label>
<label class="note"><input type="checkbox" name="note" checked> notes <b id="count-note"></b></label></div>
<select name="check" aria-label="check"></select><select name="junction" aria-label="junction"></select>
<input type="search" name="text" placeholder="id or word" aria-label="id or word">
<button type="reset">show all</button>
</form>
<ol id="list"></ol><p id="none" hidden></p>
<details id="demand"><summary id="traffic"></summary><table id="counts"></table></details>
<details id="excluded"><summary id="reasons"></summary><ul id="left-out"></ul></details>
{diagrams}<details><summary id="states"></summary><table id="checks"></table></details>
</aside>
<main><svg id="map" preserveAspectRatio="xMidYMid meet"></svg>
<div id="tools"><button id="in" title="closer">+</button><button id="out" title="farther">&minus;</button>
<button id="all">whole map</button></div>
<div id="scale"><span id="length"></span><span id="bar"></span></div>
<div id="key"><span><i style="background:#f4511e"></i>at fault</span>
<span><i style="background:#ffc400"></i>involved</span></div><div id="place"></div>
</main>
<noscript>This report needs its own script; the same findings stand in report.json.</noscript>
"""


def write_page(report: Mapping[str, Any], road_map: RoadMap, page: Path) -> None:
    """Write a report as a page with its map.

    Args:
        report: as JSON values, with `demand` if there is one to show.
        road_map: what it is about.
        page: of the HTML file; an older one is written over.

    Raises:
        OSError: the file cannot be written.
    """
    style, script = ((_FOLDER / name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    name = escape(str(report["map"]))
    body = _BODY.format(
        name=name, about=escape(_about(report, road_map)), diagrams="".join(_diagrams(road_map))
    )
    page.write_text(
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        f'<meta name="viewport" content="width=device-width"><title>{name}: report</title>'
        f"<style>{style}</style></head><body>{body}"
        f'<script type="application/json" id="data">{_embed(_page_data(report, road_map))}</script>'
        f"<script>{script}</script></body></html>\n",
        encoding="utf-8",
    )


def _about(report: Mapping[str, Any], road_map: RoadMap) -> str:
    """Say which file the report is about, how large it is, and by whose limits it was checked."""
    return f"{road_map.source.file}, {road_map.tell_size()}; profile {report.get('profile', 'default')}"


def _diagrams(road_map: RoadMap) -> Iterator[str]:
    """Draw the phases of the signals, and the rows of those that are coordinated."""
    drawn = [(signal.id, draw_phases(road_map, signal)) for signal in road_map.signals[:_MOST_SIGNALS]]
    phases = [f"<figure><figcaption>{escape(id_)}</figcaption>{svg}</figure>" for id_, svg in drawn if svg]
    if phases:
        more = len(road_map.signals) - _MOST_SIGNALS
        rest = f"<p>and {counted(more, 'signal')} more, not drawn</p>" if more > 0 else ""
        yield _FOLDED.format(title="Phases of the signals", content="".join(phases) + rest)
    rows = "".join(
        f"<figure><figcaption>{escape(name)}</figcaption>{draw_row(road_map, name, stops)}</figure>"
        for name, stops in find_rows(road_map)
    )
    if rows:
        yield _FOLDED.format(title="Coordinated signals, time and way", content=rows)


def _embed(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _page_data(report: Mapping[str, Any], road_map: RoadMap) -> dict[str, Any]:
    shift = np.array(road_map.origin)
    named = {(e["kind"], e["id"]) for issue in report["issues"] for e in issue["elements"]}
    low, high = (np.array(corner) - shift for corner in road_map.bounds)
    junctions_of = _junctions_by_element(road_map)
    return {
        "counts": report["counts"],
        "checks": report["checks"],
        "excluded": report.get("excluded", []),
        "demand": report.get("demand"),
        "origin": list(road_map.origin),
        "bounds": [*low.tolist(), *high.tolist()],
        "areas": [[kind, id_, _centimetres(ring, shift)] for kind, id_, ring in _areas(road_map)],
        "lanes": [_lane(lane, shift) for lane in road_map.lanes],
        "connections": [
            [c.id, _centimetres(c.shape, shift)]
            for c in road_map.connections
            if ("connection", c.id) in named
        ],
        "signals": [[signal.id, signal.junctions] for signal in road_map.signals],
        "issues": [
            {
                **issue,
                "at": [round(float(v), 2) for v in np.array(issue["position"][:2]) - shift],
                "selection": selection_lines([issue]),
                "junctions": sorted(
                    {j for e in issue["elements"] for j in junctions_of.get((e["kind"], e["id"]), ())}
                ),
            }
            for issue in report["issues"]
        ],
    }


def _areas(road_map: RoadMap) -> Iterator[tuple[str, str, Points]]:
    for junction in road_map.junctions:
        yield "junction", junction.id, junction.polygon
    for area in road_map.walking_areas:
        if area.origin is Origin.NETWORK:
            yield "walking_area", area.id, area.polygon
    for crossing in road_map.crossings:
        if crossing.origin is Origin.NETWORK:
            yield "crossing", crossing.id, crossing.polygon


def _lane(lane: Lane, shift: Points) -> list[Any]:
    return [lane.kind.value, lane.id, lane.road, round(lane.width, 2), _centimetres(lane.shape, shift)]


def _centimetres(line: Points, shift: Points) -> list[int]:
    found: list[int] = np.rint((line[:, :2] - shift) * 100).astype(np.int64).ravel().tolist()
    return found


def _junctions_by_element(road_map: RoadMap) -> dict[tuple[str, str], Iterable[str]]:
    """Find the junctions that each element of a map is at."""
    ends = {road.id: (road.from_junction, road.to_junction) for road in road_map.roads}
    road_of = {lane.id: lane.road for lane in road_map.lanes}
    found: dict[tuple[str, str], Iterable[str]] = {("road", road): at for road, at in ends.items()}
    found |= {("lane", lane): ends[road] for lane, road in road_of.items()}
    found |= {("junction", junction.id): (junction.id,) for junction in road_map.junctions}
    found |= {("signal", signal.id): signal.junctions for signal in road_map.signals}
    found |= {("connection", c.id): (ends[road_of[c.from_lane]][1],) for c in road_map.connections}
    found |= {("crossing", crossing.id): (crossing.junction,) for crossing in road_map.crossings}
    return found | {("walking_area", area.id): (area.junction,) for area in road_map.walking_areas}
