"""Ground under imported streets: from a raster, from tags, or none; and rasters that are none."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyproj
import pytest
import tifffile
from osm_drawings import DRAWINGS, HELSINKI, Drawing, cross
from scene_reader import GROUND, read_scene

from dojo_env.rendering import classes
from dojo_env.rendering.scene import build_scene
from dojo_maps.cli import main
from dojo_maps.conversion import ConvertOptions, convert
from dojo_maps.description import BUILDING_FOOTING, foot_of
from dojo_maps.errors import SourceError, UsageError
from dojo_maps.meshes.surfaces import KERB
from dojo_maps.sources.geotiff import read_elevations
from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.completeness.assumptions import tell_ground
from dojo_maps.sources.osm.layout.terrain import read_incline
from dojo_maps.sources.osm.pipeline import OsmNetwork, build_network

Surface = Callable[[np.ndarray, np.ndarray], np.ndarray]
PER_LAT = 111_320.0
PER_LON = PER_LAT * float(np.cos(np.radians(HELSINKI[1])))
SYSTEMS = {4326: 2, 32635: 1, 3067: 1}
"""By EPSG: 2 for degrees, 1 for metres."""


def raster(path: Path, surface: Surface, *, code: int = 4326, point: bool = False, **how: object) -> Path:
    """Write a surface over metres east and north of Helsinki as a GeoTIFF, 1 km wide."""
    to_plane = pyproj.Transformer.from_crs(4326, code, always_xy=True)
    half = np.array([500 / PER_LON, 500 / PER_LAT])
    corners = np.array([HELSINKI - half, HELSINKI + half])
    x, y = to_plane.transform(corners[:, 0], corners[:, 1])
    xs, ys = np.linspace(x[0], x[1], 201), np.linspace(y[1], y[0], 201)
    lon, lat = to_plane.transform(*np.meshgrid(xs, ys), direction="INVERSE")
    values = surface((lon - HELSINKI[0]) * PER_LON, (lat - HELSINKI[1]) * PER_LAT)
    step = (float(xs[1] - xs[0]), float(ys[0] - ys[1]))
    shift = 0.0 if point else 0.5
    tie = (shift, shift, 0.0, float(xs[0]), float(ys[0]), 0.0)
    kind = 2048 if SYSTEMS[code] == 2 else 3072
    keys = (1, 1, 0, 3, 1024, 0, 1, SYSTEMS[code], 1025, 0, 1, 1 + point, kind, 0, 1, code)
    tags = [
        (33550, "d", 3, (*step, 0.0), True),
        (33922, "d", 6, tie, True),
        (34735, "H", len(keys), keys, True),
        (42113, "s", 0, "-9999", True),
    ]
    settings: dict[str, object] = {"compression": "zlib", **how}
    tifffile.imwrite(path, values.astype(settings.pop("kind", "float32")), extratags=tags, **settings)
    return path


def tilted(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 40 + 0.04 * x - 0.02 * y


def places(count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    east, north = np.random.default_rng(1).uniform(-450, 450, (2, count))
    return east, north


@pytest.mark.parametrize("code", SYSTEMS)
@pytest.mark.parametrize("point", [False, True])
def test_raster_gives_the_heights_of_places(code: int, *, point: bool, tmp_path: Path) -> None:
    grid = read_elevations(raster(tmp_path / "a.tif", tilted, code=code, point=point))
    east, north = places()
    found = grid.at(HELSINKI[0] + east / PER_LON, HELSINKI[1] + north / PER_LAT)
    assert found == pytest.approx(tilted(east, north), abs=0.02)


def test_raster_knows_nothing_outside_and_where_nobody_measured(tmp_path: Path) -> None:
    path = raster(tmp_path / "a.tif", lambda x, y: np.where(x > 100, -9999.0, tilted(x, y)), kind="int16")
    grid = read_elevations(path)
    found = grid.at(HELSINKI[0] + np.array([0.0, 200.0, 900.0]) / PER_LON, np.full(3, HELSINKI[1]))
    assert found[0] == pytest.approx(40, abs=1)
    assert np.isnan(found[1:]).all()


def network(drawing: Drawing, folder: Path, surface: Surface | None = None) -> OsmNetwork:
    path = drawing.write(folder / "a.osm")
    grid = None if surface is None else read_elevations(raster(folder / "a.tif", surface))
    return build_network(read_osm(path), path=path, name="a", sha256="0" * 64, raster=grid)


def ground_of(built: OsmNetwork) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """List the lanes' places, metres east and north of Helsinki, and their heights above the sea."""
    projection = built.road_map.projection
    points = np.vstack([lane.shape for lane in built.road_map.lanes])
    x, y = (points[:, :2] - projection.net_offset).T
    lon, lat = pyproj.Proj(projection.proj)(x, y, inverse=True)
    assert built.layout.ground is not None
    base = built.layout.ground.lowest or 0.0
    return (lon - HELSINKI[0]) * PER_LON, (lat - HELSINKI[1]) * PER_LAT, points[:, 2] + base


def slopes(built: OsmNetwork) -> np.ndarray:
    steep = [0.0]
    for lane in built.road_map.lanes:
        step = np.diff(lane.shape, axis=0)
        ahead = np.hypot(step[:, 0], step[:, 1])
        steep += (np.abs(step[:, 2])[ahead > 1] / ahead[ahead > 1]).tolist()
    return np.array(steep)


def test_streets_follow_the_ground(tmp_path: Path) -> None:
    built = network(cross(), tmp_path, tilted)
    east, north, heights = ground_of(built)
    assert np.abs(heights - tilted(east, north)).max() < 1.0
    assert np.ptp(heights) > 8
    assert min(lane.shape[:, 2].min() for lane in built.road_map.lanes) >= 0
    assert "rise to" in tell_ground(built).message


def test_streets_between_two_nodes_follow_a_hill(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-300, 0), (300, 0), highway="residential")
    east, _, heights = ground_of(network(d, tmp_path, lambda x, _: 12 * np.exp(-((x / 90) ** 2))))
    assert np.abs(heights - 12 * np.exp(-((east / 90) ** 2))).max() < 1.5
    assert heights.max() > 10


def test_tracks_follow_the_ground(tmp_path: Path) -> None:
    """A tram beside the street, one that crosses it, and a cycle track around a block."""
    d = cross()
    d.way((-150, -40), (0, -40), (150, -40), railway="tram", oneway="yes")
    d.ways[1][0].insert(1, d.node(0, -40))
    d.way((60, 0), (60, 90), (130, 90), (130, 40), (60, 0), highway="cycleway")
    d.ways[0][0].insert(-1, d.node(60, 0))
    built = network(d, tmp_path, tilted)
    assert {lane.kind for lane in built.road_map.lanes} >= {"bicycle", "rail"}
    east, north, heights = ground_of(built)
    assert np.abs(heights - tilted(east, north)).max() < 1.2
    assert slopes(built).max() < 0.1


@pytest.mark.parametrize(("kind", "steepest"), [("residential", 0.15), ("primary", 0.10), ("trunk", 0.08)])
def test_no_street_is_steeper_than_its_kind_allows(kind: str, steepest: float, tmp_path: Path) -> None:
    """A cliff of 20 m."""
    d = Drawing()
    d.way((-300, 0), (-20, 0), (300, 0), highway=kind)
    built = network(d, tmp_path, lambda x, _: np.where(x > 0, 20.0, 0.0))
    assert slopes(built).max() <= steepest + 0.01
    assert np.ptp(ground_of(built)[2]) > 15


@pytest.mark.parametrize("dip", [0.0, 3.0, 7.0])
def test_bridge_is_clear_of_the_road_below_and_no_higher_than_it_must_be(dip: float, tmp_path: Path) -> None:
    """A road in a cutting, 60 m wide, under a bridge whose ends are on one level."""
    built = network(DRAWINGS["bridge"](), tmp_path, lambda x, _: np.where(np.abs(x) < 30, 30.0 - dip, 30.0))
    by_road: dict[str, list[np.ndarray]] = {}
    for lane in built.road_map.lanes:
        by_road.setdefault(lane.road.lstrip("-").split("#")[0], []).append(lane.shape)
    east, north, heights = ground_of(built)
    middle = (np.abs(east) < 25) & (np.abs(north) < 8)
    deck = heights[middle & (heights > 31 - dip)]
    below = np.vstack(by_road["1004"])[:, 2] + built.layout.ground.lowest
    assert deck.min() - below.min() > 4.0
    assert deck.max() < (31.0 if dip == 7.0 else 36.0)


def test_slopes_and_elevations_are_read_from_tags(tmp_path: Path) -> None:
    d = Drawing()
    d.way((-200, 0), (0, 0), highway="residential", incline="6%")
    d.way((200, 0), (0, 0), highway="residential", incline="-3 %")
    d.way((0, 0), (0, 200), highway="residential")
    d.node(-200, 0, ele="31")
    d.node(0, 200, ele="43")
    built = network(d, tmp_path)
    east, north, heights = ground_of(built)
    assert heights[east.argmin()] == pytest.approx(31, abs=0.5)
    assert heights[north.argmax()] == pytest.approx(43, abs=0.5)
    assert heights[east.argmax()] == pytest.approx(43 + 6, abs=0.8)
    assert "2 places" in tell_ground(built).message


@pytest.mark.parametrize(
    ("text", "slope"),
    [("5%", 0.05), ("-5,5 %", -0.055), ("10°", 0.1763), ("up", None), ("90%", None), ("5", None), ("", None)],
)
def test_read_incline(text: str, slope: float | None) -> None:
    assert read_incline(text, 0.35) == (slope if slope is None else pytest.approx(slope, abs=1e-4))


def test_ground_is_flat_where_nothing_is_known(tmp_path: Path) -> None:
    built = network(cross(), tmp_path)
    assert {float(z) for lane in built.road_map.lanes for z in lane.shape[:, 2]} == {0.0}
    assert tell_ground(built).check == "osm.flat_ground"


def test_bundle_on_a_slope_is_whole(tmp_path: Path) -> None:
    path = cross().write(tmp_path / "a.osm")
    options = ConvertOptions(terrain=raster(tmp_path / "a.tif", tilted))
    _, report = convert(str(path), tmp_path / "a.dojo", options)
    assert report["counts"]["error"] == 0
    assert [issue["check"] for issue in report["issues"] if "ground" in issue["check"]] == ["osm.ground"]


def test_what_stands_beside_the_street_stands_on_the_slope(tmp_path: Path) -> None:
    """A tree, a bus stop, a house, a lawn and a pond, of which nobody tells how high they lie."""
    d = cross()
    d.node(40, 20, natural="tree")
    d.node(-60, -8, highway="bus_stop")
    for (x, y), tags in (
        ((60, 30), {"building": "yes"}), ((-50, 30), {"leisure": "park"}), ((50, -40), {"natural": "water"}),
    ):  # fmt: skip
        d.way((x, y), (x + 20, y), (x + 20, y + 15), (x, y + 15), (x, y), **tags)
    options = ConvertOptions(terrain=raster(tmp_path / "a.tif", tilted))
    made, _ = convert(str(d.write(tmp_path / "a.osm")), tmp_path / "a.dojo", options)
    props = {prop.kind: prop for prop in made.road_map.props}
    assert {"tree", "bus_stop", "building", "green", "water", "lamp"} <= set(props)
    scene = read_scene(made.folder / "scene.glb", made.road_map.origin)
    ground = scene.tops("terrain", *GROUND)
    shift = np.array([*made.road_map.origin, 0.0])
    for prop in made.road_map.props:
        outline = prop.polygon if prop.polygon is not None else np.array([prop.position])
        numbers, _, heights = ground.faces_under(outline - shift)
        away = np.full(len(outline), np.inf)
        np.minimum.at(away, numbers, np.abs(heights - outline[numbers, 2]))
        assert away.max() < KERB + 0.01, prop.id
    lawn, pond = (
        np.concatenate([part.triangles for part in scene.parts if part.name == f"terrain/{name}"])
        for name in ("green", "water")
    )
    middle, tree = lawn.reshape(-1, 3).mean(axis=0), np.array(props["tree"].position) - shift
    assert middle[2] - tree[2] == pytest.approx(tilted(*middle[:2]) - tilted(*tree[:2]), abs=1.0)
    assert np.ptp(pond[..., 2]) < 1e-3
    seen = build_scene(made)
    feet = seen.things[seen.surfaces == classes.Surface.FACADE, 0]
    assert feet == pytest.approx(foot_of(props["building"]) - BUILDING_FOOTING, abs=1e-3)


def far_away(path: Path) -> None:
    moved = raster(path, tilted).read_bytes()
    lon = np.array([HELSINKI[0] - 500 / PER_LON])
    path.write_bytes(moved.replace(lon.tobytes(), (lon + 5).tobytes()))


def no_place(path: Path) -> None:
    tifffile.imwrite(path, np.zeros((4, 4), "float32"))


def colours(path: Path) -> None:
    tifffile.imwrite(path, np.zeros((8, 8, 3), "uint8"), photometric="rgb")


def large(path: Path) -> None:
    tifffile.imwrite(path, np.zeros((5_001, 5_001), "uint8"), compression="zlib")


def unknown_system(path: Path) -> None:
    data = raster(path, tilted).read_bytes()
    path.write_bytes(data.replace(np.uint16(4326).tobytes(), np.uint16(1).tobytes()))


def cut_off(path: Path) -> None:
    data = raster(path, tilted).read_bytes()
    path.write_bytes(data[: len(data) // 2])


HOSTILE: dict[Callable[[Path], object], str] = {
    far_away: "covers 0% of the streets",
    no_place: "expected a GeoTIFF",
    colours: "one band",
    large: "at most",
    unknown_system: "EPSG:1",
    cut_off: "not a TIFF|covers",
    lambda path: path.write_text("no picture"): "not a TIFF",
    lambda path: path.mkdir(): "not a file",
    lambda _path: None: "no such file",
}  # fmt: skip


@pytest.mark.parametrize("make", HOSTILE)
def test_raster_that_is_none_is_refused_in_one_line(
    make: Callable[[Path], object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.tif"
    make(path)
    drawn = cross().write(tmp_path / "a.osm")
    status = main(
        ["import-osm", str(drawn), "-o", str(tmp_path / "a.dojo"), "--terrain", str(path), "--quiet"]
    )
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert status == 3
    assert any(part in line for part in HOSTILE[make].split("|"))
    assert not (tmp_path / "a.dojo").exists()


def test_damaged_raster_is_read_or_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    whole = raster(path, tilted).read_bytes()
    draw = random.Random(7)  # noqa: S311 - no secret
    refused = 0
    for _ in range(150):
        data = bytearray(whole)
        for _ in range(draw.choice((1, 4, 30))):
            data[draw.randrange(min(len(data), 900))] = draw.randrange(256)
        path.write_bytes(data)
        try:
            read_elevations(path)
        except SourceError:
            refused += 1
    assert 10 < refused < 150


def test_raster_is_for_openstreetmap_data_only(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--terrain"):
        convert("cologne1", tmp_path / "a.dojo", ConvertOptions(terrain=tmp_path / "a.tif"))
