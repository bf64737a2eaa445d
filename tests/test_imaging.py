"""How cameras work: shutter, exposure, lens, sensor and compression, and wind in their mounts."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import traffic

from dojo_env.camera import Camera
from dojo_env.conditions import Conditions
from dojo_env.config import SensingConfig
from dojo_env.errors import ConfigError
from dojo_env.imaging import IMAGING_LIMITS, IMAGING_PRESETS, Imaging, read_imaging, sample_imaging
from dojo_env.rendering.lighting import compute_light, to_linear
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import build_scene
from dojo_env.sensors.eyes import Eyes
from dojo_env.sensors.h264 import Stream
from dojo_env.sensors.noise import Lens
from dojo_env.sensors.optics import scatter_sun
from dojo_env.snapshot import Kind
from dojo_maps.bundle import read_bundle

CAMERA = Camera(name="c", position=(0.0, 0.0, 8.0), width=120, height=80)
SPEED = 20.0


@pytest.fixture(scope="module")
def bundle(converted):
    return read_bundle(converted("right_hand").folder)


@pytest.fixture(scope="module")
def scene(bundle):
    return build_scene(bundle)


@pytest.fixture(scope="module")
def beside(scene):
    """A camera level with the road that looks north, and a bus that crosses its picture to the right."""
    x, y = (float(v) for v in scene.origin[:2])
    camera = Camera(
        name="beside",
        position=(x, y - 25.0, 1.7),
        heading_deg=90.0,
        pitch_deg=0.0,
        field_of_view_deg=60.0,
        width=400,
        height=300,
    )
    bus = traffic.users([(x + 6.0, y, 0.0, 0.0)], [Kind.BUS], traffic.empty(scene.road_map))
    return camera, bus


def see(bundle, camera, snapshot, outputs=("rgb",), *, conditions=None, imaging=None, seed=5):
    eyes = Eyes(bundle, SensingConfig(conditions=conditions or Conditions(), imaging=imaging or Imaging()))
    eyes.reset(seed)
    return eyes.look(snapshot, [camera], outputs)[0]


def light(rgb):
    return to_linear(rgb)


def flat(level, camera=CAMERA):
    return np.full((camera.height, camera.width, 3), level, dtype=np.uint8)


def changed_columns(picture, without, rows):
    """First and last column, in some rows, where a picture is not that of an empty street."""
    differs = (picture[rows].astype(int) != without[rows]).any(axis=(0, 2))
    return np.flatnonzero(differs)[[0, -1]]


def test_perfect_cameras_deliver_the_renderers_bytes(bundle, scene, beside):
    camera, bus = beside
    moving = replace(bus, speeds=np.array([SPEED]))
    np.testing.assert_array_equal(
        see(bundle, camera, moving).rgb, Renderer(scene).render(moving, [camera])[0].rgb
    )


def test_an_open_shutter_draws_out_what_moves_as_far_as_it_goes(bundle, scene, beside):
    camera, bus = beside
    empty = Renderer(scene).render(traffic.empty(scene.road_map), [camera])[0].rgb
    still = see(bundle, camera, bus, imaging=Imaging(shutter_s=0.05)).rgb
    np.testing.assert_array_equal(still, see(bundle, camera, bus).rgb)
    moving = replace(bus, speeds=np.array([SPEED]))
    blurred = see(bundle, camera, moving, ("rgb", "instance"), imaging=Imaging(shutter_s=0.05))
    # Half way up the bus; its side, 23.75 m away, goes 1 m.
    rows = slice(140, 150)
    sharp, drawn = changed_columns(still, empty, rows), changed_columns(blurred.rgb, empty, rows)
    gone = SPEED * 0.05 * camera.focal_length / 23.75
    assert sharp[0] - drawn[0] == pytest.approx(gone / 2, abs=2.0)
    assert drawn[1] - sharp[1] == pytest.approx(gone / 2, abs=2.0)
    # Truth is that of the middle of the exposure.
    np.testing.assert_array_equal(blurred.instance, see(bundle, camera, moving, ("instance",)).instance)


def test_a_blurred_edge_is_a_ramp_of_light(bundle, scene, beside):
    camera, bus = beside
    empty = light(Renderer(scene).render(traffic.empty(scene.road_map), [camera])[0].rgb)
    there = light(see(bundle, camera, bus).rgb)
    moving = replace(bus, speeds=np.array([SPEED]))
    blurred = light(see(bundle, camera, moving, imaging=Imaging(shutter_s=0.05)).rgb)
    # What a moving bus takes from a row of the street is what it takes at rest, spread over more columns.
    rows = slice(140, 150)
    assert (blurred - empty)[rows].sum() == pytest.approx((there - empty)[rows].sum(), rel=0.1)


def test_a_rolling_shutter_shears_what_moves(bundle, scene, beside):
    camera, bus = beside
    empty = Renderer(scene).render(traffic.empty(scene.road_map), [camera])[0].rgb
    moving = replace(bus, speeds=np.array([SPEED]))
    rolled = see(bundle, camera, moving, imaging=Imaging(readout_s=0.1)).rgb
    still = see(bundle, camera, moving).rgb
    for rows, middle in ((slice(137, 141), 139), (slice(163, 167), 165)):
        shift = np.mean(
            np.subtract(changed_columns(rolled, empty, rows), changed_columns(still, empty, rows))
        )
        late = (middle / camera.height - 0.5) * 0.1
        assert shift == pytest.approx(SPEED * late * camera.focal_length / 23.75, abs=1.5)


def test_automatic_exposure_is_settled_at_first_and_then_follows():
    lens = Lens(Conditions(), Imaging(auto_exposure=1.0, adaptation_s=2.0))
    dark, bright = flat(60), flat(200)
    assert light(lens.spoil(dark, CAMERA, 0.0)).mean() == pytest.approx(0.18, rel=0.03)
    then = light(lens.spoil(bright, CAMERA, 1.0)).mean()
    wanted = np.log2(light(bright).mean() / light(dark).mean()) * np.exp(-0.5)
    assert np.log2(min(1.0, then) / 0.18) == pytest.approx(min(wanted, np.log2(1 / 0.18)), abs=0.1)
    assert light(lens.spoil(bright, CAMERA, 60.0)).mean() == pytest.approx(0.18, rel=0.03)
    half = Lens(Conditions(), Imaging(auto_exposure=0.5)).spoil(dark, CAMERA, 0.0)
    assert light(half).mean() == pytest.approx((0.18 * light(dark).mean()) ** 0.5, rel=0.03)


def test_corners_lose_their_share_of_the_light():
    seen = light(Lens(Conditions(), Imaging(vignetting=0.5)).spoil(flat(200), CAMERA, 0.0))
    whole = light(flat(200))[0, 0, 0]
    assert seen[40, 60, 0] == pytest.approx(whole, rel=0.02)
    assert seen[0, 0, 0] == pytest.approx(0.5 * whole, rel=0.05)


@pytest.mark.parametrize(("hour", "gain"), [(12.0, 1.0), (0.0, 9.0)])
def test_noise_has_the_deviation_of_photons_and_of_reading(hour, gain):
    body = Imaging(shot_noise=2.0, read_noise=0.4, night_gain=9.0)
    large = replace(CAMERA, width=300, height=300)
    for level in (100, 180):
        mean = light(flat(level))[0, 0, 0]
        seen = light(Lens(Conditions(hour=hour), body).spoil(flat(level, large), large, 0.0))
        wanted = np.sqrt(2.0**2 * gain * mean + (0.4 * gain) ** 2) / 255
        assert np.std(seen) == pytest.approx(wanted, rel=0.06)
        assert np.mean(seen) == pytest.approx(mean, rel=0.02)


@pytest.mark.parametrize(
    ("conditions", "body"), [(Conditions(noise=6.0), Imaging()), (Conditions(), Imaging(read_noise=3.0))]
)
def test_noise_has_no_mean_and_differs_in_channels_pictures_and_cameras(conditions, body):
    # Wider than the noise that is drawn once, so that it must go on from another place.
    wide = replace(CAMERA, width=1400, height=600)
    lens = Lens(conditions, body)
    seen = [lens.spoil(flat(128, wide), camera, time) for camera, time in (
        (wide, 0.0), (wide, 1.0), (replace(wide, name="d"), 0.0),
    )]  # fmt: skip
    # A sensor adds noise to light, `noise` to the picture.
    levels = light if body.read_noise else np.float64
    noise = (levels(np.array(seen)) - levels(flat(128, wide))).transpose(0, 3, 1, 2)
    deviations = noise.std(axis=(2, 3))
    assert np.abs(noise.mean(axis=(2, 3))).max() < 0.01 * deviations.max()
    np.testing.assert_allclose(deviations, deviations[0, 0], rtol=0.01)
    related = np.corrcoef(noise.reshape(9, -1)) - np.eye(9)
    assert np.abs(related).max() < 0.01
    # What is far apart in a picture is not the same again.
    assert abs(np.corrcoef(noise[0, 0, :, :376].ravel(), noise[0, 0, :, 1024:].ravel())[0, 1]) < 0.02
    neighbours = np.corrcoef(noise[0, 0, :, 1:].ravel(), noise[0, 0, :, :-1].ravel())[0, 1]
    # White noise, or colours made of their neighbours' by a Gaussian of 0.6 pixels.
    weights = np.exp(-np.square([-2, -1, 0, 1, 2]) / (2 * 0.6**2))
    wanted = 0.0 if conditions.noise else weights[1:] @ weights[:-1] / (weights @ weights)
    assert neighbours == pytest.approx(wanted, abs=0.03)


@pytest.mark.slow
def test_a_stream_of_more_bits_shows_more(bundle, beside):
    camera, bus = beside
    whole = see(bundle, camera, bus).rgb
    rates = (20.0, 200.0, 2000.0)
    packed = [see(bundle, camera, bus, imaging=Imaging(h264_kbps=rate)).rgb for rate in rates]
    errors = [np.abs(picture.astype(int) - whole).mean() for picture in packed]
    assert errors[0] > 1.3 * errors[1] > 1.3**2 * errors[2] > 0
    assert errors[0] < 25
    again = see(bundle, camera, bus, imaging=Imaging(h264_kbps=20.0)).rgb
    np.testing.assert_array_equal(packed[0], again)


def test_a_key_frame_is_as_fine_as_its_stream_allows():
    random = np.random.default_rng(3)
    rgb = cv2.GaussianBlur(random.integers(0, 255, (81, 121, 3), dtype=np.uint8), (0, 0), 2.0)
    stream, sizes = Stream(20.0), {}
    encode = stream._encode

    def note(frame, quantiser):
        packet = encode(frame, quantiser)
        sizes[quantiser] = packet.size
        return packet

    stream._encode = note
    assert stream.compress(rgb).shape == rgb.shape
    most = 20_000 / 8 * 0.3
    fits = [quantiser for quantiser, size in sizes.items() if size <= most]
    assert sizes[min(fits) - 1] > most
    # The next picture begins where this one ended, and ends there, too.
    count = len(sizes)
    np.testing.assert_array_equal(stream.compress(rgb), Stream(20.0).compress(rgb))
    assert len(sizes) == count


def test_jpeg_is_that_of_the_quality_asked_for(bundle, beside):
    camera, bus = beside
    whole = see(bundle, camera, bus).rgb
    packed = [see(bundle, camera, bus, imaging=Imaging(jpeg_quality=quality)).rgb for quality in (20, 80)]
    errors = [np.abs(picture.astype(int) - whole).mean() for picture in packed]
    assert errors[0] > 1.4 * errors[1] > 0
    again = cv2.imencode(".jpg", whole[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 20])[1]
    np.testing.assert_array_equal(packed[0], cv2.imdecode(again, cv2.IMREAD_COLOR)[..., ::-1])


def test_glare_comes_from_a_sun_that_the_camera_sees(scene):
    state = compute_light(Conditions(hour=17.0))
    x, y = (float(v) for v in scene.origin[:2])
    towards = replace(
        CAMERA,
        position=(x, y, 30.0),
        heading_deg=float(np.degrees(np.arctan2(state.sun[1], state.sun[0]))),
        pitch_deg=0.0,
    )
    stray = scatter_sun(towards, state, scene)
    (sun,), _ = towards.project(np.array([towards.position]) + 1e4 * state.sun)
    row, column, _ = np.unravel_index(np.argmax(stray), stray.shape)
    assert abs(column - sun[0]) <= 1.0
    assert abs(row - max(0.0, sun[1])) <= 1.0
    away = replace(towards, heading_deg=towards.heading_deg + 180.0)
    assert scatter_sun(away, state, scene).max() < 0.05 * stray.max()
    # Under the ground no sun shines.
    assert scatter_sun(replace(towards, position=(x, y, -5.0)), state, scene).max() == 0


def test_drops_stay_for_a_while_and_belong_to_their_camera():
    random = np.random.default_rng(0)
    rgb = random.integers(0, 255, (80, 120, 3), dtype=np.uint8)
    lens = Lens(Conditions(drops=0.5, seed=1))
    first, soon, late = (lens.spoil(rgb, CAMERA, time) for time in (0.0, 0.5, 500.0))
    np.testing.assert_array_equal(first, Lens(Conditions(drops=0.5, seed=1)).spoil(rgb, CAMERA, 0.0))
    wet = [(picture != rgb).any(axis=2) for picture in (first, soon, late)]
    assert 0.02 < wet[0].mean() < 0.6
    assert (wet[0] & wet[1]).sum() > 0.8 * wet[0].sum()
    assert (wet[0] & wet[2]).sum() < 0.6 * wet[0].sum()
    other = lens.spoil(rgb, replace(CAMERA, name="d"), 0.0)
    assert not np.array_equal(first, other)


def test_all_that_a_swaying_camera_shows_is_what_the_turned_one_sees(bundle, scene, beside):
    camera, bus = beside
    outputs = ("rgb", "depth", "instance", "boxes")
    swayed = see(bundle, camera, replace(bus, time=3.0), outputs, conditions=Conditions(sway_deg=1.0))
    turned = swayed.camera
    assert 0.05 < np.hypot(turned.heading_deg - 90.0, turned.pitch_deg) < 5.0
    wanted = Renderer(scene).render(bus, [turned], outputs)[0]
    both, either = (
        (f(swayed.instance > 0, wanted.instance > 0)).sum() for f in (np.logical_and, np.logical_or)
    )
    assert both / either > 0.96
    inner = (slice(30, -30), slice(30, -30))
    assert np.median(np.abs(swayed.depth[inner] - wanted.depth[inner])) < 0.3
    assert np.abs(swayed.rgb[inner].astype(int) - wanted.rgb[inner]).mean() < 6
    assert np.abs(swayed.boxes.picture - wanted.boxes.picture).max() <= 2
    np.testing.assert_allclose(swayed.boxes.projected, wanted.boxes.projected, atol=1e-6)


def test_the_same_seed_gives_the_same_bytes_and_another_other_ones(bundle, beside):
    camera, bus = beside
    moving = replace(bus, speeds=np.array([SPEED]), time=7.0)
    state = Conditions(hour=18.0, rain=0.3, dirt=0.4, drops=0.4, sway_deg=0.2, shake_deg=0.5)
    first, again, other = (
        see(bundle, camera, moving, conditions=state, imaging="webcam", seed=seed).rgb for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_bodies_are_named_written_down_and_drawn(bundle):
    assert read_imaging("traffic_camera") == IMAGING_PRESETS["traffic_camera"]
    assert read_imaging("shutter_s=0.02,jpeg_quality=50") == Imaging(shutter_s=0.02, jpeg_quality=50)
    ranges = {"shutter_s": (0.001, 0.02), "jpeg_quality": (30, 90)}
    drawn = [sample_imaging(ranges, seed) for seed in range(50)]
    assert drawn == [sample_imaging(ranges, seed) for seed in range(50)]
    assert 30 <= min(each.jpeg_quality for each in drawn) < max(each.jpeg_quality for each in drawn) <= 90
    eyes = Eyes(bundle, SensingConfig(imaging=ranges))
    eyes.reset(4)
    assert eyes.imaging == drawn[4]


@pytest.mark.parametrize(
    "wrong",
    [
        "mirror",
        "shutter_s=fast",
        "shutter=1",
        {"iso": (1, 2)},
        3,
        {"glare": (1, 9)},
        "jpeg_quality=50,h264_kbps=500",
    ],
)
def test_impossible_bodies_are_refused(wrong):
    with pytest.raises(ConfigError, match="imaging"):
        SensingConfig(imaging=wrong)


@pytest.mark.parametrize("name", sorted(IMAGING_LIMITS))
def test_bodies_out_of_range_are_refused(name):
    with pytest.raises(ConfigError, match=name):
        Imaging(**{name: IMAGING_LIMITS[name][1] + 1})
