"""The 3D page: rendered by a real browser, offline, with the whole map in the first picture."""

import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from browser import CHROMIUM, ONE_LOOK, needs_browser

from dojo_maps.errors import SourceError
from dojo_maps.viewer import write_view

pytestmark = pytest.mark.sampled(1)

_GROUND, _EAST, _NORTH = (0.05, 0.2, 0.05), (0.6, 0.02, 0.02), (0.02, 0.05, 0.6)


def _block(low, high, colour):
    """A box between two corners in the map's frame, with a linear colour as glTF has it."""
    corners = np.array([low, high], dtype=float)[:, [0, 2, 1]] * [1, 1, -1]
    mesh = trimesh.creation.box(bounds=np.sort(corners, axis=0))
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[*colour, 1.0], metallicFactor=0.0, roughnessFactor=1.0
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A ground of 200 m by 200 m with a red block in the east and a blue one in the north."""
    blocks = trimesh.Scene()
    blocks.add_geometry(_block((-100, -100, -1), (100, 100, 0), _GROUND), node_name="terrain")
    blocks.add_geometry(_block((60, -20, 0), (90, 20, 10), _EAST), node_name="building/east")
    blocks.add_geometry(_block((-20, 60, 0), (20, 90, 10), _NORTH), node_name="building/north")
    path = tmp_path_factory.mktemp("scene") / "scene.glb"
    path.write_bytes(blocks.export(file_type="glb"))
    return path


def _photograph(scene: Path, folder: Path, address: str = "", title: str = "blocks") -> np.ndarray:
    """Open the page in a browser and take its picture, (600, 800, 3) RGB."""
    page, picture = folder / "view.html", folder / "view.png"
    write_view(scene, page, title=title)
    command = [CHROMIUM, *ONE_LOOK, f"--user-data-dir={folder / 'profile'}", f"--screenshot={picture}"]
    done = subprocess.run([*command, page.as_uri() + address], capture_output=True, timeout=120, check=False)
    assert picture.exists(), done.stderr[-2000:]
    return cv2.cvtColor(cv2.imread(str(picture)), cv2.COLOR_BGR2RGB).astype(int)


def _where(picture: np.ndarray, channel: int) -> np.ndarray:
    """Rows and columns where one colour channel stands well above both others, (n, 2)."""
    others = np.delete(picture, channel, axis=2).max(axis=2)
    return np.argwhere(picture[..., channel] > others + 60)


@needs_browser
def test_write_view_shows_the_whole_map_from_the_south_when_opened(scene, tmp_path):
    picture = _photograph(scene, tmp_path)
    red, green, blue = _where(picture, 0), np.argwhere(_is_ground(picture)), _where(picture, 2)
    blue = blue[picture[tuple(blue.T)][:, 0] < 100]
    assert len(red) > 500
    assert len(blue) > 500
    assert red.mean(axis=0)[1] > 400 + 80, "the eastern block is not on the right"
    assert blue.mean(axis=0)[0] < red.mean(axis=0)[0] - 50, "the northern block is not farther up"
    (top, left), (bottom, right) = green.min(axis=0), green.max(axis=0)
    assert 0 < top < 150
    assert 0 < left < right < 799
    assert bottom < 599
    assert (right - left) > 0.7 * 800 or (bottom - top) > 0.7 * 600


def _is_ground(picture: np.ndarray) -> np.ndarray:
    """Where the ground's own colour stands: its linear values in sRGB, lit by lights that add up to one."""
    linear = np.array(_GROUND)
    srgb = 255 * (1.055 * linear ** (1 / 2.4) - 0.055)
    return np.abs(picture - srgb).max(axis=2) < 25


@needs_browser
def test_write_view_has_a_sky_lighter_than_the_ground(scene, tmp_path):
    picture = _photograph(scene, tmp_path, "#camera=0,-50,2,0,0,2")
    sky, ground = picture[20, 400], picture[480, 400]
    assert sky[2] > sky[0] + 20, "the sky is not blue"
    assert sky.sum() > ground.sum() + 100


@needs_browser
@pytest.mark.parametrize(("address", "channel"), [("20,0,5,75,0,5", 0), ("0,20,5,0,75,5", 2)])
def test_write_view_looks_where_the_address_says(scene, tmp_path, address, channel):
    picture = _photograph(scene, tmp_path, f"#camera={address}")
    height, width = picture.shape[:2]
    middle = picture[height // 2, width // 2]
    assert middle[channel] > np.delete(middle, channel).max() + 40


@needs_browser
@pytest.mark.parametrize("address", ["#camera=1,2,3", "#camera=a,b,c,d,e,f", "#camera=1,1,1,1,1,1", "#else"])
def test_write_view_shows_the_whole_map_when_the_address_makes_no_sense(scene, tmp_path, address):
    picture = _photograph(scene, tmp_path, address)
    assert len(_where(picture, 0)) > 500
    assert _is_ground(picture).sum() > 20_000


@needs_browser
def test_write_view_keeps_paint_apart_from_the_road_on_a_map_of_twenty_kilometres(tmp_path):
    layers = trimesh.Scene()
    layers.add_geometry(_block((-10_000, -10_000, -1), (10_000, 10_000, 0), _GROUND), node_name="road")
    for row in range(-6, 9, 2):
        stripe = _block((-9_000, row * 1000 - 300, -0.5), (9_000, row * 1000 + 300, 0.01), _EAST)
        layers.add_geometry(stripe, node_name=f"marking/{row}")
    path = tmp_path / "scene.glb"
    path.write_bytes(layers.export(file_type="glb"))
    picture = _photograph(path, tmp_path)
    column = picture[:, 400]
    red = column[:, 0] > column[:, 1] + 60
    runs = np.flatnonzero(np.diff(red.astype(int)) == 1)
    assert len(runs) == 8, "stripes 1 cm above the road are broken up or missing"


@needs_browser
def test_write_view_shows_the_title_as_text_when_it_looks_like_html(scene, tmp_path):
    title = "</title><script>document.body.innerHTML='';</script>&amp;\"'"
    picture = _photograph(scene, tmp_path, title=title)
    assert len(_where(picture, 0)) > 500
    text = (tmp_path / "view.html").read_text(encoding="utf-8")
    assert "<script>document.body" not in text
    assert text.count("&lt;/title&gt;&lt;script&gt;") == 2


def test_write_view_loads_nothing_from_anywhere(scene, tmp_path):
    write_view(scene, tmp_path / "view.html", title="blocks")
    text = (tmp_path / "view.html").read_text(encoding="utf-8")
    markup = "".join(part.rpartition("<script")[0] for part in text.split("</script>"))
    assert "default-src 'none'" in markup
    for loading in ("src=", "href=", "@import", "url("):
        assert loading not in markup
    assert "Copyright 2010-2022 Three.js Authors" in text


def test_write_view_writes_the_same_bytes_again(scene, tmp_path):
    for name in ("one.html", "two.html"):
        write_view(scene, tmp_path / name, title="blocks")
    assert (tmp_path / "one.html").read_bytes() == (tmp_path / "two.html").read_bytes()


@pytest.mark.parametrize(
    ("content", "words"),
    [(None, "no such file"), (b"", "is empty"), (b"PK\x03\x04 no glTF", "convert the map again")],
)
def test_write_view_refuses_what_is_no_scene(tmp_path, content, words):
    path = tmp_path / "scene.glb"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SourceError, match=words):
        write_view(path, tmp_path / "view.html", title="none")
    assert not (tmp_path / "view.html").exists()
