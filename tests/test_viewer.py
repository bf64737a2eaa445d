"""The 3D page in a real browser: what is seen, found, picked and played; and that data stays data."""

import base64
import json
import re
import struct
import zlib
from collections import Counter
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import WITH_GL, Browser, needs_browser

from dojo_maps.bundle import read_bundle
from dojo_maps.conversion import convert
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.viewer import Model, Playback, write_view
from dojo_maps.viewer.container import Container
from dojo_maps.viewer.map_data import describe_map
from dojo_maps.viewer.scene_data import pack_meshes

EVIL = "</script><script>document.title='evil'</script><img src=x onerror=alert(1)>&amp;\"'`${1}"
SIZE = (640, 400)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    folder = tmp_path_factory.mktemp("view") / "cologne1.dojo"
    convert("cologne1", folder)
    return read_bundle(folder)


@pytest.fixture(scope="module")
def played(bundle):
    """A red car that drives 20 m from the stop line of the first view over the junction, in two seconds."""
    eye = np.array(describe_map(bundle.road_map, None)["signals"][0]["view"])
    ahead = (eye[3:5] - eye[:2]) / np.linalg.norm(eye[3:5] - eye[:2])
    stop = eye[:2] + 26 * ahead
    box = np.array([[x, y, z] for x in (-1, 0) for y in (-0.5, 0.5) for z in (0, 1)], dtype=float)
    faces = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [1, 5, 7],
         [1, 7, 3]]
    )  # fmt: skip
    model = Model(vertices=box, faces=faces.astype(np.int32), parts=np.zeros(len(faces), np.uint8))
    states = ("G" * 20, "r" * 20)
    return Playback(
        times=np.array([100.0, 101.0, 102.0]),
        counts=np.array([1, 1, 1], np.int32),
        users=np.zeros(3, np.int32),
        places=np.array([[*(stop + ahead * d), 0.0] for d in (0, 10, 20)]),
        headings=np.full(3, np.arctan2(ahead[1], ahead[0])),
        slopes=np.zeros(3),
        poses=np.zeros(3, np.int32),
        lights=np.zeros(3, np.uint8),
        ids=[EVIL],
        sizes=np.array([[4.5, 2.4, 2.0]]),
        colours=np.full((1, 1, 3), (230, 10, 10), np.uint8),
        models=[(model, model)],
        palette=np.zeros((1, 3), np.uint8),
        own=np.zeros(1, np.int8),
        lit=np.zeros(1, np.uint8),
        signals=[bundle.road_map.signals[0].id],
        states=states,
        shown=np.array([[0], [0], [1]], np.int32),
    )


def _unpack(page: Path):
    text = page.read_text(encoding="utf-8")
    packed = text.partition('id="data">')[2].partition("</script>")[0]
    whole = zlib.decompress(base64.b64decode(packed))
    (length,) = struct.unpack_from("<I", whole)
    return json.loads(whole[4 : 4 + length]), whole[4 + length :]


def _open(page: Path, folder: Path, address: str = "") -> Browser:
    return Browser(page.as_uri() + address, folder / "profile", size=SIZE, flags=WITH_GL)


def _settle(browser: Browser) -> np.ndarray:
    """Wait for the picture that is drawn once nothing moves: (400, 640, 3) RGB."""
    browser.wait(lambda: browser.run("document.documentElement?.dataset.firstPicture"))
    browser.wait(lambda: browser.run("dojoView.view.isFine && !dojoView.view.pending"))
    picture = cv2.imdecode(np.frombuffer(browser.photograph(), np.uint8), cv2.IMREAD_COLOR)
    return cv2.cvtColor(picture, cv2.COLOR_BGR2RGB).astype(int)


def _project(browser: Browser, place) -> tuple[int, int]:
    column, row = browser.run(f"dojoView.view.project({','.join(f'{v:.3f}' for v in place)})")
    return round(row), round(column)


@pytest.mark.slow
@needs_browser
def test_view_opens_behind_the_stop_line_with_sky_road_and_lamps(bundle, tmp_path):
    page = tmp_path / "page.html"
    write_view(bundle.road_map, bundle.read_meshes(), page, report={"issues": [_finding()]})
    with _open(page, tmp_path) as browser:
        picture = _settle(browser)
        row, column = _project(browser, _on_the_road(browser))
        sky, road = picture[12, 420], np.median(picture[row - 4 : row + 5, column - 9 : column], axis=(0, 1))
        assert sky[2] > sky[0] + 20
        assert sky.sum() > 450, "no sky at the top"
        assert np.ptp(road) < 25, "the road is not grey"
        assert 40 < road.mean() < 140
        lamps = _lamps(bundle, browser)
        first = _lit(picture, lamps)
        assert first.any()
        # Half a cycle on, others have green.
        browser.run("(e => { e.value = 50; e.oninput(); })(document.getElementById('time'))")
        browser.run("dojoView.view.isFine = null")
        later = _lit(_settle(browser), lamps)
        assert (first != later).any(), "the lamps do not follow the slider"
        _search_and_pick(browser, bundle)


def _on_the_road(browser):
    """A place between the eye and the stop line, in the middle of the approach."""
    at = np.array(browser.run("dojoView.view.controls.target.toArray()"))
    eye = np.array(browser.run("dojoView.view.camera.position.toArray()"))
    return [*(eye[:2] + 0.4 * (at - eye)[:2]), 0.0]


def _lamps(bundle, browser) -> list[tuple[int, int]]:
    """Places in the picture of the red lamps that shine towards the eye."""
    shift = np.array([*bundle.road_map.origin, 0])
    heads = [head for head in bundle.road_map.signals[0].heads if len(head.link_indices)]
    eye = np.array(browser.run("dojoView.view.camera.position.toArray()"))
    found = []
    for head in heads:
        lamp = head.lamps(3)[0] - shift
        if np.dot((eye - lamp)[:2], [np.cos(head.heading), np.sin(head.heading)]) > 0:
            found.append(_project(browser, lamp))
    return [(row, column) for row, column in found if 20 < row < 380 and 260 < column < 620]


def _lit(picture: np.ndarray, lamps) -> np.ndarray:
    """Which of the red lamps are lit."""
    near = [picture[row - 3 : row + 4, column - 3 : column + 4].reshape(-1, 3) for row, column in lamps]
    return np.array([(each[:, 0] > each[:, 1:].max(axis=1) + 90).any() for each in near])


def _search_and_pick(browser, bundle):
    lane = bundle.road_map.lanes[0]
    browser.run(
        f"(e => {{ e.value = {lane.id!r}; e.oninput(); }})(document.getElementById('search')),"
        "document.querySelector('#results button').click()"
    )
    assert lane.road in browser.text("what") + browser.text("facts")
    browser.run("document.getElementById('close').click()")
    browser.run("dojoView.panels.standAt(0)")
    row, column = _project(browser, _on_the_road(browser))
    browser.run(
        f"(c => {{ for (const type of ['pointerdown', 'click']) c.dispatchEvent(new PointerEvent(type,"
        f" {{clientX: {column}, clientY: {row}, bubbles: true}})); }})(document.getElementById('scene'))"
    )
    kind, _, picked = browser.text("what").partition(" ")
    assert kind == "Lane"
    assert picked in {lane.id for lane in bundle.road_map.lanes}
    assert "km/h" in browser.text("facts")
    assert browser.run("document.getElementById('copy').title").startswith(
        f"lane:{picked.removeprefix('Lane ')}"
    )
    browser.run("dojoView.panels.setLayer('issues', true)")
    assert EVIL in browser.text("findings")
    assert browser.run("document.title") == bundle.road_map.name
    assert browser.run("document.querySelectorAll('img, #findings script').length") == 0


def _finding():
    return {
        "check": "test.made_up", "severity": "warning", "message": EVIL, "hint": EVIL, "position": [0, 0, 0],
        "elements": [{"kind": "lane", "id": EVIL}],
    }  # fmt: skip


@pytest.mark.slow
@needs_browser
def test_a_recording_shows_its_vehicle_where_it_is_and_its_signals_as_they_were(bundle, played, tmp_path):
    page = tmp_path / "page.html"
    write_view(bundle.road_map, bundle.read_meshes(), page, playback=played)
    with _open(page, tmp_path, "#time=100.5") as browser:
        picture = _settle(browser)
        # Half way between two instants.
        place = (played.places[0] + played.places[1]) / 2 + [0, 0, 1.0]
        row, column = _project(browser, place)
        red, green, blue = picture[row, column]
        assert red > 100
        assert red > max(green, blue) + 60, "no red car where it should be"
        lamps = _lamps(bundle, browser)
        assert not _lit(picture, lamps).any(), "a lamp is red while the recording has green"
        browser.run("dojoView.clock.set(102)")
        browser.run("dojoView.view.isFine = null")
        assert _lit(_settle(browser), lamps).all()


def test_the_page_asks_for_nothing_and_says_whose_code_it_holds(bundle, tmp_path):
    page = tmp_path / "page.html"
    write_view(bundle.road_map, bundle.read_meshes(), page)
    text = page.read_text(encoding="utf-8")
    markup = "".join(part.rpartition("<script")[0] for part in text.split("</script>"))
    assert "default-src 'none'" in markup
    for loading in ("src=", "href=", "@import", "url("):
        assert loading not in markup
    assert "three.js authors" in text
    assert len(text) < 1_400_000, "a page for one junction has grown"
    first = page.read_bytes()
    write_view(bundle.road_map, bundle.read_meshes(), page)
    assert page.read_bytes() == first


def test_a_map_with_names_like_markup_stays_data(bundle, tmp_path):
    road_map = replace(bundle.road_map, name=EVIL)
    page = tmp_path / "page.html"
    write_view(road_map, (), page, report={"issues": [_finding(), {"position": ["x", 1, 2]}, 7]})
    text = page.read_text(encoding="utf-8")
    assert "<img src=x" not in text
    value, _ = _unpack(page)
    assert value["map"]["name"] == EVIL
    assert [issue["message"] for issue in value["map"]["issues"]] == [EVIL]


@pytest.mark.parametrize("report", [{}, {"issues": None}, {"issues": [{"position": [1, 2]}, []]}])
def test_a_report_that_is_not_as_it_should_be_marks_nothing(bundle, report):
    assert describe_map(bundle.road_map, report)["issues"] == []


def test_of_solids_alone_the_inside_is_left_out(bundle):
    script = (files("dojo_maps.viewer") / "page" / "scene.js").read_text(encoding="utf-8")
    closed = re.compile(script.partition("const CLOSED = /")[2].partition("/;")[0])
    solids = [mesh for mesh in bundle.read_meshes() if closed.match(mesh.name) and "signal/" not in mesh.name]
    assert {"building", "building/car/tyre", "sidewalk", "signal", "tree"} <= {mesh.name for mesh in solids}
    assert "tree/leaves" not in {mesh.name for mesh in solids}
    for mesh in solids:
        a, b, c = np.moveaxis((mesh.vertices - mesh.vertices.mean(axis=0))[mesh.faces], 1, 0)
        _, corners = np.unique(mesh.vertices.round(4), axis=0, return_inverse=True)
        edges = corners.ravel()[mesh.faces[:, [0, 1, 1, 2, 2, 0]]].reshape(-1, 2).tolist()
        assert Counter(map(tuple, edges)) == Counter((end, start) for start, end in edges), mesh.name
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0, f"{mesh.name} is inside out"


@pytest.mark.parametrize("far", [0.0, 900.0, 50_000.0])
def test_packed_positions_are_where_the_corners_are(far):
    corners = np.array([[far, 0, 0], [far + 10, 0.013, 0], [far, 10, 25], [far + 600, 0, 0]])
    faces = np.array([[0, 1, 2], [0, 3, 2]])
    mesh = Mesh(name="road", vertices=corners, faces=faces, sources=np.array([0, 1]), ids=("a", "b"))
    container = Container()
    records = pack_meshes([mesh], container)
    found = set()
    for record in records:
        kind, start, count = record["positions"]
        steps = np.frombuffer(bytes(container._data), kind, count, start).reshape(-1, 4)[:, :3]
        places = steps * record["scale"] + record["origin"]
        apart = np.linalg.norm(corners[:, None] - places[None], axis=2)
        assert apart.min(axis=0).max() < 0.007
        found |= set(np.flatnonzero(apart.min(axis=1) < 0.007).tolist())
    assert found == {0, 1, 2, 3}


def test_the_first_view_looks_along_an_approach_over_its_stop_line(bundle):
    road_map = bundle.road_map
    *eye, x, y, _ = describe_map(road_map, None)["signals"][0]["view"]
    shift = np.array(road_map.origin)
    approaches = {link.from_id for link in road_map.signals[0].links}
    ends = [lane.shape[-1][:2] - shift for lane in road_map.lanes if lane.id in approaches]
    line = np.array([x, y]) - eye[:2]
    line /= np.linalg.norm(line)
    aside = [abs(line[0] * (end - eye[:2])[1] - line[1] * (end - eye[:2])[0]) for end in ends]
    ahead = [float(np.dot(end - eye[:2], line)) for end in ends]
    assert 8 <= eye[2] <= 12
    assert any(a < 4 and 20 < d < 32 for a, d in zip(aside, ahead, strict=True))
