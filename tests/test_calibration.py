"""From control points and photographs to cameras."""

import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import sumolib

from dojo_env.calibration.calibrating import calibrate
from dojo_env.calibration.fitting import find_seen
from dojo_env.calibration.landmarks import Ground, list_landmarks
from dojo_env.calibration.overlay import draw_overlay
from dojo_env.calibration.paint import list_edges
from dojo_env.calibration.points import ControlPoints, read_points
from dojo_env.calibration.solving import Known
from dojo_env.camera import Camera, read_cameras
from dojo_env.cli import main
from dojo_env.errors import CalibrationError, PhotographError
from dojo_env.photographs import read_photograph
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import build_scene
from dojo_env.snapshot import Snapshot
from dojo_maps.bundle import read_bundle
from dojo_maps.conversion import ConvertOptions, convert

STREET = Camera(
    name="street", position=(11841.5, 13323.1, 7.5), heading_deg=168.0, pitch_deg=-14.0, roll_deg=0.8,
    field_of_view_deg=62.0, width=960, height=672,
)  # fmt: skip


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    """The streets alone: trees that hide their paint are no part of what is measured here."""
    folder = tmp_path_factory.mktemp("streets") / "cologne1.dojo"
    return read_bundle(convert("cologne1", folder, ConvertOptions(surroundings=False))[0].folder)


def names_in_view(bundle, camera, count):
    """Choose stop lines' and crossings' corners in view, each far from the others."""
    landmarks = list_landmarks(bundle.road_map)
    names = [name for name in landmarks if name.startswith(("stop_line", "crossing"))]
    places = np.array([landmarks[name] for name in names])
    pixels, seen = find_seen(camera, places, 5.0)
    seen &= np.hypot(*(places - camera.position)[:, :2].T) < 80
    rows = np.flatnonzero(seen)
    chosen = [0]
    while len(chosen) < count:
        apart = [np.linalg.norm(pixels[rows] - pixels[rows[k]], axis=1) for k in chosen]
        chosen.append(int(np.argmax(np.min(apart, axis=0))))
    return [names[row] for row in rows[chosen]], pixels[rows[chosen]], places[rows[chosen]]


def points_of(bundle, camera, count, noise=0.0, seed=0):
    names, pixels, places = names_in_view(bundle, camera, count)
    pixels = pixels + np.random.default_rng(seed).normal(0, noise, pixels.shape)
    return ControlPoints(path=Path("p.csv"), labels=tuple(names), pixels=pixels, places=places, ground=0.0)


def ground_place(camera, pixel):
    """Where the ray of a pixel meets z = 0, by OpenCV's own model of a camera."""
    lens = np.array(camera.distortion or (0.0, 0.0, 0.0, 0.0))
    level = cv2.undistortPoints(np.array([[pixel]]), camera.intrinsics, lens).ravel()
    ray = np.array([*level, 1.0]) @ camera.axes
    return np.array(camera.position) - ray * camera.position[2] / ray[2]


def error_at(true, found, distance):
    """Metres between the places that both cameras give a pixel whose true place is so far away."""
    heading = np.radians(true.heading_deg)
    place = np.array(true.position) * [1, 1, 0] + distance * np.array([np.cos(heading), np.sin(heading), 0])
    (pixel,), _ = true.project(place[None])
    return (ground_place(found, pixel) - place)[:2], place


def test_exact_points_give_the_exact_camera(bundle):
    found = calibrate(points_of(bundle, STREET, 12), STREET, Known(noise=0.05, bends=0)).camera
    np.testing.assert_allclose(found.position, STREET.position, atol=0.02)
    assert np.linalg.norm(error_at(STREET, found, 50.0)[0]) < 0.02


def test_pose_is_that_of_opencv_where_the_lens_is_known(bundle):
    points = points_of(bundle, STREET, 14, noise=1.0)
    known = Known(noise=1.0, bends=0, field_of_view_deg=62.0)
    found = calibrate(points, STREET, known).camera
    _, turn, shift = cv2.solvePnP(
        points.places - STREET.position, points.pixels, STREET.intrinsics, None, flags=cv2.SOLVEPNP_ITERATIVE
    )
    theirs = np.array(STREET.position) - (cv2.Rodrigues(turn)[0].T @ shift).ravel()
    np.testing.assert_allclose(found.position, theirs, atol=0.35)


def test_errors_are_as_large_as_is_told(bundle):
    random = np.random.default_rng(5)
    inside = []
    for seed in range(24):
        camera = replace(
            STREET,
            position=(
                11841.5 + random.uniform(-4, 4),
                13323.1 + random.uniform(-4, 4),
                random.uniform(5, 12),
            ),
            field_of_view_deg=random.uniform(50, 90),
            roll_deg=random.normal(0, 1),
        )
        found = calibrate(points_of(bundle, camera, 8, noise=2.0, seed=seed), camera, Known(bends=0))
        off, place = error_at(camera, found.camera, 50.0)
        covariance = found.ground_covariance(place[None])[0]
        inside.append(off @ np.linalg.solve(covariance, off) < 5.991)
        error = found.ground_error(50.0)
        assert error.middle[1] <= error.middle[0] <= error.worst
    assert sum(inside) >= 20  # Of 24, 22.8 are expected, and fewer than 20 with a chance of 1 %.


def test_known_height_and_view_make_it_surer(bundle):
    points = points_of(bundle, STREET, 6, noise=0.5)
    told = [
        calibrate(points, STREET, known).ground_error(50.0).middle[0]
        for known in (Known(), Known(height=7.5), Known(height=7.5, field_of_view_deg=62.0))
    ]
    assert told[0] > told[1] > told[2]


def test_bent_lenses_are_found(bundle):
    bent = replace(STREET, distortion=(-0.2, 0.0, 0.0, 0.0, 0.0))
    found = calibrate(points_of(bundle, bent, 20, noise=0.3), STREET, Known(noise=0.3)).camera
    assert found.distortion[0] == pytest.approx(-0.2, abs=0.03)
    assert np.linalg.norm(error_at(bent, found, 40.0)[0]) < 0.3


def test_a_wrong_point_is_named(bundle):
    points = points_of(bundle, STREET, 11, noise=1.0)
    points.pixels[4] += [60, -25]
    found = calibrate(points, STREET, Known(noise=1.0, bends=0))
    ((label, off),) = found.wrong
    assert label == points.labels[4]
    assert off == pytest.approx(65, abs=15)
    assert label not in found.points.labels
    points.pixels[7] += [-50, 40]
    two = calibrate(points, STREET, Known(noise=1.0, bends=0)).wrong
    assert {label for label, _ in two} == {points.labels[4], points.labels[7]}
    six = points_of(bundle, STREET, 6, noise=1.0)
    six.pixels[2] += [90, 60]
    with pytest.raises(CalibrationError, match=r"off by \d+ px, if the others are right"):
        calibrate(six, STREET, Known(noise=1.0))


def test_points_of_another_place_are_refused(bundle):
    points = points_of(bundle, STREET, 7)
    points.pixels[:] = np.random.default_rng(1).uniform([0, 300], [960, 672], points.pixels.shape)
    with pytest.raises(CalibrationError, match="no camera fits the points"):
        calibrate(points, STREET, Known())


@pytest.fixture(scope="module")
def photograph(bundle):
    (picture,) = Renderer(build_scene(bundle)).render(Snapshot(time=0.0), [STREET], ("rgb",))
    return picture.rgb


def test_paint_sharpens_the_camera(bundle, photograph):
    edges = list_edges(bundle)
    for seed in range(3):
        points = points_of(bundle, STREET, 6, noise=2.0, seed=seed)
        found = calibrate(points, STREET, Known(), photograph=photograph, edges=edges)
        plain = calibrate(points, STREET, Known())
        assert found.paint is not None
        assert found.paint_share > 0.5
        off = [np.linalg.norm(error_at(STREET, each.camera, 50.0)[0]) for each in (found, plain)]
        assert off[0] < 0.15 < off[1]


def test_paint_has_no_say_where_it_is_not_that_of_the_map(bundle, photograph):
    points = points_of(bundle, STREET, 6, noise=2.0)
    plain = calibrate(points, STREET, Known()).camera
    for other in (np.ascontiguousarray(photograph[:, ::-1]), np.full_like(photograph, 90)):
        found = calibrate(points, STREET, Known(), photograph=other, edges=list_edges(bundle))
        assert found.paint is None
        assert found.camera == plain


def test_overlay_lies_on_the_painted_lines(bundle, photograph):
    drawn = draw_overlay(photograph, STREET, bundle.road_map)
    for line in bundle.road_map.stop_lines:
        middle = line.shape.mean(axis=0)
        (at,), (seen,) = find_seen(STREET, middle[None], 20.0)
        if seen and np.hypot(*(middle - STREET.position)[:2]) < 40:
            red = drawn[int(at[1]), int(at[0])].astype(int)
            assert red[0] > 180 > red[1] + 60
            assert photograph[int(at[1]), int(at[0])].min() > 150  # It is painted white there.
    assert (draw_overlay(photograph, replace(STREET, pitch_deg=60.0), bundle.road_map) == photograph).all()


def test_landmarks_are_where_drivers_see_them(bundle):
    landmarks = list_landmarks(bundle.road_map)
    for lane in bundle.road_map.lanes:
        if f"stop_line:{lane.id}:left" in landmarks:
            left, right = (np.array(landmarks[f"stop_line:{lane.id}:{side}"]) for side in ("left", "right"))
            ahead = (lane.shape[-1] - lane.shape[-2])[:2]
            assert np.cross([*ahead, 0], right - left)[2] < 0
    assert sum(name.startswith("crossing") for name in landmarks) >= 4 * len(bundle.road_map.crossings)


def test_ground_lies_where_the_nearest_lane_does(bundle):
    lane = bundle.road_map.lanes[0]
    raised = replace(lane, shape=np.array([(0.0, 0.0, 2.0), (100.0, 0.0, 12.0)]))
    assert Ground(replace(bundle.road_map, lanes=(raised,))).height(50.0, 3.0) == pytest.approx(7.0)
    assert Ground(replace(bundle.road_map, lanes=())).height(1.0, 2.0) == 0.0


def test_points_come_as_elements_places_and_degrees(bundle, tmp_path, converted):
    network = sumolib.net.readNet(str(bundle.network))
    names, pixels, places = names_in_view(bundle, STREET, 6)
    degrees = [network.convertXY2LonLat(x, y) for x, y, _ in places]
    files = {
        "a.csv": "u,v,element\n" + "".join(f"{u},{v},{n}\n" for (u, v), n in zip(pixels, names, strict=True)),
        "b.csv": "# a comment\nu, v, x, y\n\n"
        + "".join(f"{u},{v},{x},{y}\n" for (u, v), (x, y, _) in zip(pixels, places, strict=True)),
        "c.csv": "u,v,lon,lat\n"
        + "".join(f"{u},{v},{x!r},{y!r}\n" for (u, v), (x, y) in zip(pixels, degrees, strict=True)),
        "d.json": json.dumps(
            {"points": [{"u": u, "v": v, "element": n} for (u, v), n in zip(pixels, names, strict=True)]}
        ),
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        points = read_points(tmp_path / name, bundle.road_map)
        np.testing.assert_allclose(points.places, places, atol=1e-3)
        np.testing.assert_allclose(points.pixels, pixels)
    assert read_points(tmp_path / "b.csv", bundle.road_map).labels[0] == "line 4"


@pytest.mark.parametrize(
    ("text", "message"),
    [("u,v\n1,2\n", "line 1: the head is"),
     ("u,v,x,y\n1,2,3\n", "line 2: 3 values for 4 columns"),
     ("u,v,x,y\n1,2,3,four\n", "line 2: y is 'four'; expected a number"),
     ("u,v,x,y\n1,2,3,nan\n", "line 2: y is nan"),
     ("u,v,x,y,lon,lat\n1,2,3,4,5,6\n", "line 2: has x and lon"),
     ("u,v,x,y\n1,2,,\n", "line 2: has no place"),
     ("u,v,element\n1,2,stop_lin:-32038056#3_0:left\n", "did you mean stop_line:-32038056#3_0:left"),
     ("u,v,x,y,w\n1,2,3,4,5\n", "'w' is not known"),
     ('[{"u": 1, "v": 2}]', "point 1: has no place"),
     ("[3]", "point 1: expected an object"),
     ('{"points": 3}', "expected a list of points"),
     ("\x00\xff", "")],
)  # fmt: skip
def test_broken_points_are_told_by_line(bundle, tmp_path, text, message):
    file = tmp_path / "points.csv"
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(CalibrationError) as caught:
        read_points(file, bundle.road_map)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [(lambda p: [p.without(0)], "at least 6 points"),
     (lambda p: [replace(p, pixels=p.pixels * 0 + [100, 100])], "different pixels"),
     (lambda p: [replace(p, pixels=p.pixels * [0.01, 0.01] + 300)], "near one place"),
     (lambda p: [replace(p, places=p.places * [1, 0, 0])], "places lie on one line"),
     (lambda p: [replace(p, pixels=p.pixels + np.array([2000, 0]))], "outside the picture of 960 x 672")],
)  # fmt: skip
def test_points_that_determine_no_camera_are_refused(bundle, change, message):
    (points,) = change(points_of(bundle, STREET, 6))
    with pytest.raises(CalibrationError, match=message):
        calibrate(points, STREET, Known())


def test_photographs_are_read_as_they_are(tmp_path, photograph):
    for name in ("a.png", "a.jpg"):
        cv2.imwrite(str(tmp_path / name), photograph[..., ::-1])
        assert np.abs(read_photograph(tmp_path / name).astype(int) - photograph).mean() < 3
    whole = (tmp_path / "a.png").read_bytes()
    huge = whole[:16] + (1 << 20).to_bytes(4) * 2 + whole[24:]
    cut = (tmp_path / "a.jpg").read_bytes()[:40]
    for data, message in (
        (huge, "1048576 x 1048576"),
        (cut, "is broken|not a JPEG"),
        (b"GIF89a" * 9, "not a JPEG or PNG"),
    ):
        (tmp_path / "b.png").write_bytes(data)
        with pytest.raises(PhotographError, match=message):
            read_photograph(tmp_path / "b.png")


def test_command_writes_a_camera_that_sees_the_same(bundle, photograph, tmp_path, capsys):
    image, points = tmp_path / "street.png", tmp_path / "points.csv"
    cv2.imwrite(str(image), photograph[..., ::-1])
    names, pixels, _ = names_in_view(bundle, STREET, 6)
    marked = pixels + np.random.default_rng(2).normal(0, 2, pixels.shape)
    points.write_text(
        "u,v,element\n" + "".join(f"{u},{v},{n}\n" for (u, v), n in zip(marked, names, strict=True))
    )
    arguments = ["calibrate", str(image), "--map", str(bundle.folder), "--points", str(points)]
    assert main([*arguments, "--overlay", str(tmp_path / "over.png")]) == 0
    told = capsys.readouterr().out
    assert re.search(r"ground at 50 m +off by up to 0\.[01]", told)
    (camera,) = read_cameras(tmp_path / "street.cameras.json")
    assert camera.name == "street"
    (again,) = Renderer(build_scene(bundle)).render(Snapshot(time=0.0), [camera], ("rgb",))
    assert np.abs(again.rgb.astype(int) - photograph).mean() < 1.5
    over = read_photograph(tmp_path / "over.png")
    assert over.shape == photograph.shape
    assert not np.array_equal(over, photograph)


def test_command_lists_elements_and_refuses_in_one_line(bundle, tmp_path, capsys):
    assert main(["calibrate", "--elements", "--map", str(bundle.folder)]) == 0
    assert "stop_line:-32038056#3_0:left" in capsys.readouterr().out
    for arguments, status in (
        (["x.png"], 2),
        (["x.png", "--map", str(bundle.folder), "--points", "p.csv"], 3),
        (["x.png", "--map", str(bundle.folder), "--points", "p.csv", "--fov", "400"], 2),
        (["x.png", "--map", str(bundle.folder), "--points", "p.csv", "--overlay", "o.bmp"], 2),
    ):
        assert main(["calibrate", *arguments]) == status
        told = capsys.readouterr().err
        assert told.count("\n") == 1
        assert "Traceback" not in told
