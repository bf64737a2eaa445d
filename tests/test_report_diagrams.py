"""Phase and time-space diagrams, and the overview's lettering, against what the map says."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest

from dojo_maps.bundle import read_bundle
from dojo_maps.conversion import convert
from dojo_maps.description import Lane, LaneKind, Phase, Program, Projection, Road, RoadMap, Source, points
from dojo_maps.report.overview import draw_overview
from dojo_maps.report.phase_diagrams import draw_phases
from dojo_maps.report.time_space import draw_row, find_rows

NAMESPACE = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def eight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report") / "cologne8.dojo"
    convert("cologne8", folder)
    return read_bundle(folder)


@pytest.mark.slow
def test_draw_phases_shows_an_arrow_for_each_link_with_green(eight):
    for signal in eight.road_map.signals:
        picture = ET.fromstring(draw_phases(eight.road_map, signal))  # noqa: S314 - ours
        cells = picture.findall(f"{NAMESPACE}svg")
        stages = [p for p in signal.programs[0].phases if "g" in p.state.lower() and "y" not in p.state]
        assert len(cells) == len(stages) > 0
        controlled = [c for c in eight.road_map.connections if c.signal == signal.id and len(c.shape) > 1]
        for cell, phase in zip(cells, stages, strict=True):
            colours = [line.get("stroke") for line in cell.iter(f"{NAMESPACE}polyline")]
            for letter, colour in (("G", "#0f9d58"), ("g", "#86d3a8")):
                wanted = sum(phase.state[c.link_index] == letter for c in controlled)
                assert colours.count(colour) == wanted


def test_draw_phases_escapes_ids_and_draws_nothing_without_a_program(eight):
    signal = replace(eight.road_map.signals[0], id="<b>&\"'")
    connections = tuple(
        replace(c, signal=signal.id) if c.signal == eight.road_map.signals[0].id else c
        for c in eight.road_map.connections
    )
    road_map = replace(eight.road_map, connections=connections)
    assert "<b>" not in draw_phases(road_map, signal)
    assert draw_phases(road_map, replace(signal, programs=())) is None


def test_find_rows_follows_the_street_from_signal_to_signal(eight):
    road_map = eight.road_map
    rows = find_rows(road_map)
    assert rows
    centre = {
        s.id: np.mean([j.position[:2] for j in road_map.junctions if j.id in s.junctions], axis=0)
        for s in road_map.signals
    }
    for _, stops in rows:
        assert len({stop.signal for stop in stops}) == len(stops) >= 2
        for a, b in pairwise(stops):
            apart = np.linalg.norm(centre[b.signal] - centre[a.signal])
            # Stop line to stop line on the way is about as far as from middle to middle.
            assert 0.6 * apart - 40 < b.metres - a.metres < 1.5 * apart + 40
            assert 5 < (b.metres - a.metres) / (b.seconds - a.seconds) < 30


def test_draw_row_shows_green_as_long_as_the_program_has_it(eight):
    road_map = eight.road_map
    name, stops = find_rows(road_map)[0]
    picture = ET.fromstring(draw_row(road_map, name, stops))  # noqa: S314 - ours
    programs = {s.id: s.programs[0] for s in road_map.signals}
    for stop, bar in zip(stops, picture.findall(f"{NAMESPACE}rect[@fill='#d9483b']"), strict=True):
        greens = [
            float(rect.get("width"))
            for rect in picture.findall(f"{NAMESPACE}rect[@fill='#0f9d58']")
            if rect.get("y") == bar.get("y")
        ]
        phases = programs[stop.signal].phases
        share = sum(p.duration for p in phases if p.state[stop.link] in "gG") / sum(
            p.duration for p in phases
        )
        assert sum(greens) / float(bar.get("width")) == pytest.approx(share, abs=0.01)


def test_find_rows_leaves_out_signals_that_are_not_coordinated(eight):
    other = Program(
        id="x",
        kind="actuated",
        offset=0,
        phases=(Phase(duration=9, min_duration=None, max_duration=None, state="G" * 40),),
    )
    signals = tuple(replace(s, programs=(other,)) for s in eight.road_map.signals)
    assert find_rows(replace(eight.road_map, signals=signals)) == []
    signals = tuple(replace(s, programs=(*s.programs, other)) for s in eight.road_map.signals)
    assert find_rows(replace(eight.road_map, signals=signals)) == [], "of two programs, SUMO runs the last"


def test_the_report_holds_the_diagrams(eight):
    page = (eight.folder / "report.html").read_text(encoding="utf-8")
    assert len(re.findall("<figcaption>", page)) == len(eight.road_map.signals) + len(
        find_rows(eight.road_map)
    )
    assert len(page) < 400_000


def _one_road(name: str) -> RoadMap:
    lane = Lane(
        id="a_0", road="a", index=0, kind=LaneKind.DRIVING, width=3, speed=10, length=400, allow=(),
        shape=points([(0, 0), (400, 0)]),
    )  # fmt: skip
    road = Road(id="a", name=name, from_junction="", to_junction="", kind="", priority=0, lanes=("a_0",))
    return RoadMap(
        name="one", source=Source(kind="sumo", file="", sha256="", sumo_version=""), origin=(200, 0),
        projection=Projection(proj=None, net_offset=(0, 0)), bounds=((0, -150), (400, 150)), left_hand=False,
        roads=(road,), lanes=(lane,), connections=(), junctions=(), sidewalks=(), crossings=(),
        walking_areas=(), signals=(),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "is_written"), [("Königstraße", True), ("", False), ("Улица Ленина", False)]
)
def test_the_overview_names_streets_and_has_a_scale(tmp_path, name, is_written):
    draw_overview(_one_road(name), (), tmp_path / "a.png")
    picture = cv2.imread(str(tmp_path / "a.png")).astype(int)
    height, width = picture.shape[:2]
    middle = picture[height // 2 - 20 : height // 2 + 20, width // 2 - 100 : width // 2 + 100]
    assert (middle.min(axis=2) > 220).any() == is_written
    # The bar of the scale: as long as it says, 50 m here.
    row = picture[height - 24]
    bright = np.flatnonzero(row.min(axis=1) > 220)
    assert np.ptp(bright) == pytest.approx(50 * width / 416, abs=6)
    assert picture[:60, width - 60 :].min(axis=2).max() > 220, "no arrow to the north"


def test_a_bundle_says_in_one_line_what_it_is_and_shows_its_overview(eight):
    assert len(repr(eight)) < 300
    assert f"{len(eight.road_map.signals)} signals" in repr(eight)
    shown = eight._repr_mimebundle_()
    assert shown["image/png"] == (eight.folder / "overview.png").read_bytes()
