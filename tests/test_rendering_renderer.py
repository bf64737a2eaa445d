"""The renderer on real maps: what is asked for, the same bytes everywhere, and nothing odd at the edges."""

import hashlib
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import traffic
from conftest import REPOSITORY, command_environment

from dojo_env.camera import Camera
from dojo_env.conditions import Conditions
from dojo_env.errors import ConfigError, SnapshotError
from dojo_env.parked_cars import FIRST_NUMBER
from dojo_env.rendering import compiling, textures
from dojo_env.rendering import renderer as renderer_module
from dojo_env.rendering.classes import SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.compiling import kernel
from dojo_env.rendering.fleet import pack_usual, usual_fleet
from dojo_env.rendering.lanes import draw_lane_map, find_lane
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import _follow_roofs, _normals, _things, build_scene
from dojo_env.rendering.traffic import _looks, _tabulate_looks
from dojo_env.sensors.placement import place_cameras
from dojo_env.snapshot import Kind, Lights, Snapshot
from dojo_maps.bundle import read_bundle
from dojo_maps.description import LaneKind, LinkKind, Prop
from dojo_maps.meshes.buildings import raise_outlines

ALL = ("rgb", "depth", "semantic", "instance", "boxes")


@pytest.fixture(scope="module")
def scene(converted):
    return build_scene(read_bundle(converted("cologne1").folder))


@pytest.fixture(scope="module")
def signal(scene):
    return scene.road_map.signals[0].id


@pytest.fixture(scope="module")
def cameras(scene, signal):
    return place_cameras(scene, signal)


@pytest.fixture(scope="module")
def snapshot(scene, signal):
    return traffic.rush_hour(scene.road_map, signal, kinds=tuple(set(Kind) - {Kind.TRAIN, Kind.SHIP}))


def test_outputs_are_those_asked_for_and_agree(scene, cameras, snapshot):
    renderer = Renderer(scene)
    everyone = snapshot.joined(scene.parked)
    for camera, picture in zip(cameras, renderer.render(snapshot, cameras, ALL), strict=True):
        size = (camera.height, camera.width)
        assert picture.rgb.shape == (*size, 3)
        assert picture.rgb.dtype == np.uint8
        assert (picture.depth.shape, picture.depth.dtype) == (size, np.float32)
        assert (picture.semantic.shape, picture.semantic.dtype) == (size, np.uint8)
        assert (picture.instance.shape, picture.instance.dtype) == (size, np.int32)
        assert picture.depth.min() >= camera.near
        assert picture.depth.max() <= camera.far
        shown = {int(number): picture.instance == number for number in np.unique(picture.instance) if number}
        assert set(shown) == set(picture.boxes.numbers.tolist())
        for k, number in enumerate(picture.boxes.numbers.tolist()):
            mask = shown[number]
            rows, columns = np.nonzero(mask)
            box = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
            assert tuple(picture.boxes.picture[k]) == box
            assert picture.boxes.pixels[k] == mask.sum()
            assert 0 < picture.boxes.visible[k] <= 1
            row = everyone.numbers.tolist().index(number)
            assert picture.boxes.ids[k] == everyone.ids[row]
            assert picture.boxes.parked[k] == (number >= FIRST_NUMBER)
            assert (picture.semantic[mask] == SEMANTIC_OF_KIND[everyone.kinds[row]]).all()
    alone = renderer.render(snapshot, cameras[:1], ("depth",))[0]
    assert alone.rgb is None
    assert alone.instance is None


def test_road_users_are_placed_once_for_all_that_look_at_an_instant(scene, cameras, snapshot, monkeypatch):
    placed = []
    place = renderer_module.place_users

    def count(snapshot: Snapshot, *about, **more):
        placed.append(snapshot)
        return place(snapshot, *about, **more)

    monkeypatch.setattr(renderer_module, "place_users", count)
    renderer, later = Renderer(scene), replace(snapshot, positions=snapshot.positions + np.array([5.0, 0, 0]))
    for instant in (snapshot, later, snapshot):
        for camera in cameras[:2]:
            (picture,) = renderer.render(instant, [camera])
            (anew,) = Renderer(scene).render(instant, [camera])
            placed.pop()
            np.testing.assert_array_equal(picture.rgb, anew.rgb)
    assert placed == [snapshot, later, snapshot]


@pytest.mark.slow
def test_moving_part_changes_nothing_that_it_does_not_cover(scene, cameras, snapshot):
    empty = Renderer(scene).render(replace(snapshot, **_nobody()), cameras, ("rgb", "depth", "semantic"))
    full = Renderer(scene).render(snapshot, cameras, ALL)
    for before, after in zip(empty, full, strict=True):
        free = after.instance == 0
        np.testing.assert_array_equal(before.depth[free], after.depth[free])
        np.testing.assert_array_equal(before.semantic[free], after.semantic[free])
        # Beside road users only their shadows may change colours, and shadows only darken.
        lighter = (after.rgb.astype(int) > before.rgb.astype(int)).any(axis=2)
        assert not (lighter & free).any()


def _nobody():
    blank = Snapshot(time=0.0)
    return {name: getattr(blank, name) for name in blank.__slots__ if name not in ("time", "signals")}


def test_depth_of_static_ground_is_the_distance_to_it(scene, cameras):
    bev = cameras[-1]
    picture = Renderer(scene).render(Snapshot(time=0), [bev], ("depth", "semantic"))[0]
    road = picture.semantic == Semantic.ROAD
    assert road.sum() > 1000
    np.testing.assert_allclose(picture.depth[road], bev.position[2], atol=0.3)


def test_box_corners_enclose_the_silhouette(scene, cameras, snapshot):
    """All but mirrors, which stand out by less than a quarter of a metre on each side."""
    for picture in Renderer(scene).render(snapshot, cameras, ("boxes",)):
        boxes = picture.boxes
        for k in range(len(boxes.ids)):
            if np.isnan(boxes.projected[k]).any():
                continue
            sides = boxes.corners[k].reshape(2, 2, 2, 3)
            out = sides[0, 1, 0] - sides[0, 0, 0]
            out *= 0.25 / np.linalg.norm(out)
            widened = sides + np.array([-out, out])[None, :, None]
            projected, _ = picture.camera.project(widened.reshape(-1, 3))
            low, high = projected.min(axis=0), projected.max(axis=0)
            left, top, right, bottom = boxes.picture[k]
            assert left >= low[0] - 1.5
            assert top >= low[1] - 1.5
            assert right <= high[0] + 1.5
            assert bottom <= high[1] + 1.5


def test_hidden_share_is_measured(scene, signal):
    """A bus in front of a car hides it; alone it is wholly visible."""
    camera = Camera(name="low", position=(0.0, 0.0, 1.5), heading_deg=0.0, pitch_deg=0.0)
    origin = scene.origin
    camera = replace(camera, position=(float(origin[0]), float(origin[1]), 1.5))
    car = (float(origin[0]) + 30.0, float(origin[1]), 0.0, 0.0)
    bus = (float(origin[0]) + 14.0, float(origin[1]) + 6.0, 0.0, np.pi / 2)
    base = traffic.empty(scene.road_map)
    renderer = Renderer(_bare(scene))
    alone = renderer.render(traffic.users([car], [Kind.CAR], base), [camera], ("boxes",))[0].boxes
    assert alone.visible.tolist() == [1.0]
    both = renderer.render(traffic.users([car, bus], [Kind.CAR, Kind.BUS], base), [camera], ("boxes",))[
        0
    ].boxes
    visible = dict(zip(both.ids, both.visible, strict=True))
    assert visible["user1"] == 1.0
    assert visible.get("user0", 0.0) < 0.2


SCRIPT = """
import hashlib, sys
sys.path.insert(0, "tests")
import traffic
from dojo_env.conditions import Conditions
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import _follow_roofs, _normals, _things, build_scene
from dojo_env.sensors.placement import place_cameras
from dojo_env.snapshot import Kind
from dojo_maps.bundle import read_bundle
scene = build_scene(read_bundle(sys.argv[1]))
signal = scene.road_map.signals[0].id
snapshot = traffic.rush_hour(scene.road_map, signal, kinds=(Kind.CAR, Kind.BUS, Kind.BICYCLE))
digest = hashlib.sha256()
for hour in (11.0, 22.0):
    for picture in Renderer(scene, conditions=Conditions(hour=hour)).render(
        snapshot, place_cameras(scene, signal), ("rgb", "depth", "semantic", "instance")
    ):
        for array in (picture.rgb, picture.depth, picture.semantic, picture.instance):
            digest.update(array.tobytes())
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_same_snapshot_gives_same_bytes_in_every_process(converted):
    bundle = converted("cologne1").folder
    digests = set()
    for threads, hash_seed in (("1", "0"), ("4", "1")):
        environment = command_environment(
            PYTHONHASHSEED=hash_seed, OMP_NUM_THREADS=threads, NUMBA_NUM_THREADS=threads
        )
        command = [sys.executable, "-c", SCRIPT, bundle]
        done = subprocess.run(
            command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=True
        )
        digests.add(done.stdout)
    assert len(digests) == 1


LINEAR_ALGEBRA = """
import sys
import numba, numpy as np
from dojo_env.rendering.compiling import kernel
assert kernel(lambda values: values.sum())(np.ones(3)) == 3
print("scipy.linalg" in sys.modules)
print(numba.njit(lambda values: np.dot(values, values))(np.eye(2)).trace())
"""


def test_kernels_load_no_linear_algebra_and_what_users_compile_still_does() -> None:
    pytest.importorskip("scipy")
    done = subprocess.run(
        [sys.executable, "-c", LINEAR_ALGEBRA],
        env=command_environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["False", "2.0"]


def test_rendering_again_and_in_another_order_gives_the_same_bytes(scene, cameras, snapshot):
    renderer = Renderer(scene)
    first = [_digest(p) for p in renderer.render(snapshot, cameras, ALL[:4])]
    renderer.render(traffic.empty(scene.road_map), cameras, ALL[:4])
    again = [_digest(p) for p in renderer.render(snapshot, cameras[::-1], ALL[:4])][::-1]
    assert first == again


def _digest(picture):
    arrays = (picture.rgb, picture.depth, picture.semantic, picture.instance)
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


@pytest.mark.parametrize(("letter", "channel"), [("r", 0), ("G", 1)])
def test_signal_heads_show_the_live_state_to_who_drives_up(scene, signal, letter, channel):
    head = next(s for s in scene.road_map.signals if s.id == signal).heads[0]
    x, y, z = head.position
    eye = (x + 12 * np.cos(head.heading), y + 12 * np.sin(head.heading), z)
    camera = Camera(name="driver", position=eye, heading_deg=float(np.degrees(head.heading)) + 180.0,
                    pitch_deg=0.0, field_of_view_deg=10.0, width=100, height=100)  # fmt: skip
    rgb = (
        Renderer(scene)
        .render(traffic.empty(scene.road_map, letter), [camera])[0]
        .rgb[25:75, 25:75]
        .astype(int)
    )
    dark = (
        Renderer(scene).render(traffic.empty(scene.road_map, "O"), [camera])[0].rgb[25:75, 25:75].astype(int)
    )
    assert _glows(rgb, channel).sum() > 20
    assert not _glows(dark, channel).any()


@pytest.mark.parametrize(("letter", "channel"), [("r", 0), ("G", 1)])
def test_walkers_see_their_own_lamps(converted, letter, channel):
    scene = build_scene(read_bundle(converted("right_hand").folder))
    signal = scene.road_map.signals[0]
    walks = {link.index for link in signal.links if link.kind is LinkKind.PEDESTRIAN}
    head = next(head for head in signal.heads if set(head.link_indices) <= walks)
    x, y, z = head.position
    eye = (x + 6 * np.cos(head.heading), y + 6 * np.sin(head.heading), z)
    camera = Camera(name="walker", position=eye, heading_deg=float(np.degrees(head.heading)) + 180.0,
                    pitch_deg=0.0, field_of_view_deg=10.0, width=100, height=100)  # fmt: skip
    state = "".join(letter if k in walks else "O" for k in range(60))
    shown = replace(traffic.empty(scene.road_map), signals={signal.id: state})
    rgb = Renderer(scene).render(shown, [camera])[0].rgb.astype(int)
    assert _glows(rgb, channel).sum() > 20
    rows = np.nonzero(_glows(rgb, channel))[0]
    assert (rows.mean() < 50) == (letter == "r")


def _glows(rgb, channel):
    """Pixels in which red or green is bright and clearly above the other."""
    return (rgb[..., channel] > 200) & (rgb[..., channel] - rgb[..., 1 - channel] > 80)


def test_brake_lights_and_indicators_show(scene):
    x, y = (float(v) for v in scene.origin[:2])
    camera = Camera(name="behind", position=(x - 15.0, y, 1.0), heading_deg=0.0, pitch_deg=0.0,
                    field_of_view_deg=20.0)  # fmt: skip
    renderer = Renderer(scene)
    base = traffic.empty(scene.road_map)

    def seen(lights):
        lit = np.array([int(lights)], dtype=np.uint8)
        snapshot = traffic.users([(x, y, 0.0, 0.0)], [Kind.CAR], base, lights=lit)
        return renderer.render(snapshot, [camera])[0].rgb.astype(int)

    off, brake, left = seen(Lights.NONE), seen(Lights.BRAKE), seen(Lights.LEFT)
    redder = (brake[..., 0] - off[..., 0] > 80) & (brake[..., 1] < 90)
    assert redder.sum() > 10
    rows, columns = np.nonzero((left != off).any(axis=2))
    assert len(rows)
    assert columns.max() < camera.width / 2


def test_link_paths_are_drawn_in_the_colour_of_their_link(scene, cameras):
    bev = cameras[-1:]
    plain = Renderer(scene).render(traffic.empty(scene.road_map, "G"), bev)[0].rgb.astype(int)
    green = (
        Renderer(scene, show_links=True).render(traffic.empty(scene.road_map, "G"), bev)[0].rgb.astype(int)
    )
    red = Renderer(scene, show_links=True).render(traffic.empty(scene.road_map, "r"), bev)[0].rgb.astype(int)
    changed = (plain != green).any(axis=2)
    assert changed.sum() > 200
    assert (green[changed][:, 1] > 200).mean() > 0.95
    assert (red[(plain != red).any(axis=2)][:, 0] > 200).mean() > 0.95


def test_night_headlights_light_the_ground_ahead(scene):
    x, y = (float(v) for v in scene.origin[:2])
    camera = Camera(name="above", position=(x, y, 30.0), heading_deg=90.0, pitch_deg=-90.0)
    car = traffic.users([(x, y, 0.0, 0.0)], [Kind.CAR], traffic.empty(scene.road_map))
    for hour, lit in ((12.0, False), (0.0, True)):
        renderer = Renderer(scene, conditions=Conditions(hour=hour))
        before = renderer.render(traffic.empty(scene.road_map), [camera])[0].rgb.astype(int)
        after = renderer.render(car, [camera])[0].rgb.astype(int)
        ahead = (slice(100, 156), slice(190, 240))
        assert bool((after - before)[ahead].max() > 10) == lit


def _darkened(scene, hour, overcast):
    """How much a car darkens the ground that a camera right above it sees, pixel by pixel."""
    lane = max(scene.road_map.lanes, key=lambda lane: lane.length * (lane.kind is LaneKind.DRIVING))
    x, y = (float(v) for v in lane.shape[:2, :2].mean(axis=0))
    camera = Camera(name="above", position=(x - 2.0, y, 25.0), heading_deg=90.0, pitch_deg=-90.0,
                    width=600, height=400)  # fmt: skip
    car = traffic.users([(x, y, 0.0, 0.0)], [Kind.CAR], traffic.empty(scene.road_map))
    renderer = Renderer(scene, conditions=Conditions(hour=hour, overcast=overcast))
    before = renderer.render(traffic.empty(scene.road_map), [camera])[0].rgb.astype(float)
    after = renderer.render(car, [camera], ("rgb", "instance"))[0]
    share = 1.0 - after.rgb.sum(axis=2) / before.sum(axis=2)
    covered = after.instance == car.numbers[0]
    return np.where(covered, np.nan, share), covered


def test_car_touches_the_ground_under_a_closed_sky(scene):
    dark, covered = _darkened(scene, 12.0, 1.0)
    rows, columns = np.nonzero(covered)
    beside = dark[rows.min() : rows.max(), columns.max() + 1 : columns.max() + 4]
    assert np.nanmax(beside) > 0.1
    far = dark[:, columns.max() + 60]
    assert np.nanmax(np.abs(far)) == 0.0


def test_sun_shadow_lies_away_from_the_sun_and_has_a_soft_edge(scene):
    dark, covered = _darkened(scene, 16.0, 0.0)  # The sun stands in the west, left in the picture.
    columns = np.nonzero(covered)[1]
    left, right = np.nan_to_num(dark[:, : columns.min()]), np.nan_to_num(dark[:, columns.max() + 1 :])
    assert (right > 0.25).sum() > 10 * max(1, (left > 0.25).sum())
    edge = np.nan_to_num(dark[200, columns.max() + 1 :])
    assert ((edge > 0.05) & (edge < 0.9 * edge.max())).sum() >= 3


def test_plain_look_draws_the_same_things_otherwise(scene, cameras, snapshot):
    street = Renderer(scene).render(snapshot, cameras[:1], ALL[:4])[0]
    plain = Renderer(scene, look="plain").render(snapshot, cameras[:1], ALL[:4])[0]
    assert (street.rgb != plain.rgb).any()
    assert (street.instance == plain.instance).mean() > 0.97
    with pytest.raises(ConfigError, match="street, plain"):
        Renderer(scene, look="pretty")


def test_place_on_a_lane_is_told_along_and_across_it(scene):
    lane = next(lane for lane in scene.road_map.lanes if lane.length > 30.0)
    a, b = lane.shape[:2, :2]
    way = (b - a) / np.linalg.norm(b - a)
    place = a + 0.5 * np.linalg.norm(b - a) * way + 0.4 * np.array([-way[1], way[0]]) - scene.origin[:2]
    found = np.empty(5)
    _find(*place, draw_lane_map(scene.lanes, place, 30.0, 512), found)
    assert found[0] == pytest.approx(0.5 * np.linalg.norm(b - a), abs=1e-6)
    assert found[1] == pytest.approx(0.4, abs=1e-6)
    assert found[3] == pytest.approx(lane.width / 2)


@kernel
def _find(x, y, lanes, found):
    find_lane(x, y, lanes, found)


def test_models_are_the_same_whether_built_or_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(compiling, "_FOLDER", str(tmp_path / "kernels"))
    fleet = usual_fleet()
    tables = (
        (usual_fleet.cache_clear, lambda: usual_fleet().library, pack_usual()),
        (_looks.cache_clear, lambda: _looks(fleet), _tabulate_looks(fleet)),
    )
    for forget, load, built in tables:
        for _ in ("kept now", "kept before"):
            forget()
            for ours, theirs in zip(load(), built, strict=True):
                np.testing.assert_array_equal(ours, theirs)
                assert (ours.dtype, ours.flags.writeable) == (theirs.dtype, True)
    kept = tmp_path / "kernels" / "models" / "faces.npy"
    age = kept.stat().st_mtime_ns
    usual_fleet.cache_clear()
    usual_fleet()
    assert kept.stat().st_mtime_ns == age  # It was read.
    kept.write_bytes(kept.read_bytes()[:-100])
    usual_fleet.cache_clear()
    np.testing.assert_array_equal(usual_fleet().library.faces, pack_usual().faces)
    assert kept.stat().st_mtime_ns != age


@pytest.mark.slow
def test_smooth_pictures_are_the_average_of_finer_ones(scene, cameras, snapshot):
    plain = Renderer(scene).render(snapshot, cameras[:1], ALL[:4])[0]
    smooth = Renderer(scene, smooth=True).render(snapshot, cameras[:1], ALL[:4])[0]
    np.testing.assert_array_equal(plain.instance, smooth.instance)
    np.testing.assert_array_equal(plain.depth, smooth.depth)
    difference = np.abs(plain.rgb.astype(int) - smooth.rgb.astype(int)).max(axis=2)
    assert 0 < (difference > 8).mean() < 0.1
    # A camera with as many pixels as there are samples sees the road users that the mean is of.
    fine = replace(cameras[0], width=3 * cameras[0].width, height=3 * cameras[0].height)
    samples = Renderer(scene).render(snapshot, [fine], ("rgb", "instance"))[0]
    blocks = (cameras[0].height, 3, cameras[0].width, 3)
    moving = (samples.instance > 0) & (samples.instance < FIRST_NUMBER)
    users = moving.reshape(blocks).sum(axis=(1, 3))
    mean = samples.rgb.reshape(*blocks, 3).mean(axis=(1, 3))
    covered = users == 9
    assert covered.sum() > 200
    assert np.abs(mean - smooth.rgb)[covered].max() < 1
    partly = (users > 0) & ~covered
    assert np.abs(mean - smooth.rgb)[partly].mean() < 8


def test_bent_lens_moves_every_output_alike(scene, cameras, snapshot):
    bent = replace(cameras[0], distortion=(-0.2, 0.03, 0.0, 0.0))
    picture = Renderer(scene).render(snapshot, [bent], ALL)[0]
    assert picture.rgb.shape == (256, 356, 3)
    for k, number in enumerate(picture.boxes.numbers.tolist()):
        centre = picture.boxes.corners[k].mean(axis=0, keepdims=True)
        pixels, _ = bent.project(centre)
        left, top, right, bottom = picture.boxes.picture[k]
        if picture.boxes.visible[k] > 0.9 and (right - left) < 100:
            assert left - 3 <= pixels[0, 0] <= right + 3
            assert top - 3 <= pixels[0, 1] <= bottom + 3
        assert (picture.instance == number).sum() == picture.boxes.pixels[k]


def test_camera_inside_a_vehicle_sees_a_picture(scene):
    x, y = (float(v) for v in scene.origin[:2])
    inside = Camera(name="inside", position=(x - 2.0, y, 0.8), heading_deg=0.0, pitch_deg=0.0)
    snapshot = traffic.users([(x, y, 0.0, 0.0)], [Kind.CAR], traffic.empty(scene.road_map))
    picture = Renderer(scene).render(snapshot, [inside], ALL)[0]
    assert np.isfinite(picture.depth).all()
    assert picture.rgb.std() > 1


def test_thousands_of_road_users_are_drawn(scene, cameras):
    generator = np.random.default_rng(2)
    count = 4000
    x, y = scene.origin[:2]
    poses = [
        (x + dx, y + dy, 0.0, h) for dx, dy, h in generator.uniform((-80, -80, -3), (80, 80, 3), (count, 3))
    ]
    kinds = [Kind(int(k)) for k in generator.integers(0, 16, count)]
    snapshot = traffic.users(poses, kinds, traffic.empty(scene.road_map))
    picture = Renderer(scene).render(snapshot, cameras[-1:], ALL)[0]
    assert len(picture.boxes.ids) > 500


def test_gables_end_at_the_slopes_of_their_roofs():
    tags = (("roof:shape", "gabled"), ("roof:direction", "0"), ("roof:height", "4.0"))
    outline = np.array([(0, 0, 1), (10, 0, 1), (10, 8, 1), (0, 8, 1)], dtype=float)
    house = Prop(id="house", kind="building", height=12.0, polygon=outline, tags=tags)
    mesh = raise_outlines("building", [house], np.zeros(3))
    corners = mesh.vertices[mesh.faces]
    things = _things(corners, mesh.sources, mesh.ids)
    _follow_roofs(things, corners)
    walls = np.isclose(_normals(mesh.vertices, mesh.faces)[:, 2], 0.0)
    x, y, z = np.moveaxis(corners[walls], 2, 0)
    _, _, _, over_origin, by_x, by_y = things[walls].T[:, :, None]
    roof = over_origin + by_x * x + by_y * y
    assert np.allclose(roof, 13.0 - np.abs(y - 4.0), atol=1e-3)  # The ridge lies 4 m above the eaves.
    assert np.allclose(roof[z > 1.0], z[z > 1.0], atol=1e-3)
    below = [textures.facade(5.0, 8.0, left, 0.0, 8.0 + left, 0.5, 0.05)[0] for left in (0.1, 0.35, 0.8)]
    assert below[0] > below[2] > below[1]  # Boards, their shadow, and the wall.


def test_woods_at_the_horizon_vanish_in_fog(scene):
    eye = Camera(name="c", position=(0.0, 0.0, 5.0), pitch_deg=0.0)
    rows = slice(eye.height // 2 - 4, eye.height // 2 - 2)
    clear, foggy = (
        Renderer(_bare(scene), conditions=Conditions(fog=fog)).render(Snapshot(time=0), [eye])[0].rgb[rows]
        for fog in (0.0, 0.02)
    )
    assert clear.mean() + 20 < foggy.mean()


def _bare(scene):
    """Nothing but the road map."""
    return replace(scene, vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32),
                   normals=np.empty((0, 3)), semantics=np.empty(0, np.uint8), surfaces=np.empty(0, np.uint8),
                   colours=np.empty((0, 3), np.float32), things=np.empty((0, 6), np.float32),
                   parked=Snapshot(time=0.0))  # fmt: skip


def test_empty_scene_is_bare_ground_and_sky(scene):
    bare = _bare(scene)
    level = Camera(name="c", position=(0.0, 0.0, 5.0), pitch_deg=0.0)
    picture = Renderer(bare).render(Snapshot(time=0), [level], ALL)[0]
    assert (picture.semantic == Semantic.SKY).all()
    assert (picture.depth == level.far).all()
    sky, ground = (
        picture.rgb[:100].astype(int).mean(axis=(0, 1)),
        picture.rgb[200:].astype(int).mean(axis=(0, 1)),
    )
    assert sky[2] > sky[1]
    assert ground[1] > ground[2]


def test_one_pixel_picture_is_a_picture(scene):
    camera = Camera(name="tiny", position=(*map(float, scene.origin[:2]), 10.0), width=1, height=1)
    assert Renderer(scene).render(Snapshot(time=0), [camera], ALL)[0].rgb.shape == (1, 1, 3)


def test_unknown_output_is_refused(scene, cameras):
    with pytest.raises(ConfigError, match="normals"):
        Renderer(scene).render(Snapshot(time=0), cameras, ("rgb", "normals"))


@pytest.mark.parametrize("column", ["positions", "headings", "slopes", "sizes"])
def test_snapshot_without_a_pose_is_refused_by_name(scene, column):
    snapshot = traffic.users([(0.0, 0.0, 0.0, 0.0)] * 2, [Kind.CAR] * 2, traffic.empty(scene.road_map))
    broken = np.array(getattr(snapshot, column))
    broken[1] = np.nan
    with pytest.raises(SnapshotError, match="user1"):
        replace(snapshot, **{column: broken})


def test_unknown_signals_and_short_states_show_nothing(scene, cameras):
    odd = replace(traffic.empty(scene.road_map), signals={"nobody": "GGG", scene.road_map.signals[0].id: "G"})
    assert Renderer(scene, show_links=True).render(odd, cameras[:1])[0].rgb.std() > 1


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize("change", [{}, {"distortion": (-0.2, 0.05, 0.0, 0.0)}])
@pytest.mark.parametrize(("hour", "smooth"), [(12.0, False), (12.0, True), (23.0, True)])
def test_parked_cars_look_as_if_they_had_just_stopped(scene, cameras, hour, smooth, change):
    """What is drawn once into the background is what is drawn as road users in each frame, and no more."""
    empty = Snapshot(time=0.0)
    conditions = Conditions(hour=hour)
    bare = Renderer(replace(scene, parked=empty), conditions=conditions, smooth=smooth)
    seen = [replace(camera, **change) for camera in cameras]
    stood, moved = (
        Renderer(scene, conditions=conditions, smooth=smooth).render(empty, seen, ALL),
        bare.render(scene.parked, seen, ALL),
    )
    assert sum(len(picture.boxes.ids) for picture in stood) > 10
    for still, moving in zip(stood, moved, strict=True):
        if not change:
            assert np.array_equal(still.rgb, moving.rgb)
        for name in ("depth", "semantic", "instance"):
            assert np.array_equal(getattr(still, name), getattr(moving, name))
        for name in ("ids", "numbers", "picture", "pixels", "visible", "corners"):
            assert np.array_equal(getattr(still.boxes, name), getattr(moving.boxes, name))
        assert still.boxes.parked.all()
    without = Renderer(scene, conditions=conditions, smooth=smooth).render(empty, seen, ALL, parked=False)
    for one, other in zip(without, bare.render(empty, seen, ALL), strict=True):
        assert np.array_equal(one.rgb, other.rgb)
        assert not len(one.boxes.ids)


@pytest.mark.slow
def test_who_drives_past_hides_a_parked_car(scene, cameras):
    """A car before a parked one takes its pixels; the box tells the share that is left."""
    camera = replace(next(each for each in cameras if each.name == "bev"), width=1424, height=1024)
    car = scene.parked
    above = replace(
        car, ids=tuple(f"over {name}" for name in car.ids), numbers=np.arange(1, len(car.ids) + 1),
        positions=car.positions + np.array([0.0, 0.0, 3.0]), sizes=car.sizes * [0.5, 1.0, 1.0],
    )  # fmt: skip
    (free,) = Renderer(scene).render(Snapshot(time=0.0), [camera], ALL)
    (hidden,) = Renderer(scene).render(above, [camera], ALL)
    left = dict(zip(hidden.boxes.ids, hidden.boxes.visible, strict=True))
    inside = [
        k
        for k, name in enumerate(free.boxes.ids)
        if free.boxes.visible[k] > 0.95 and free.boxes.pixels[k] > 40
    ]
    assert inside
    for k in inside:
        assert 0.2 < left[free.boxes.ids[k]] < 0.85
