"""How exactly cameras are found: 200 synthetic ones at cologne1, six points each, marked 2 pixels off.

Cameras hang as traffic cameras do: 3 to 18 m high, beyond a stop line, looking at its approach, 5 to 45
degrees down, with lenses of 30 to 110 degrees, rolled by a degree. The six points are those that a user is
told to take: corners of stop lines, crossings, junctions and arrows, spread over the picture. Each pixel is
off by Gaussian noise in both directions.

The error on the ground is the distance between where a pixel is taken to be and where it is, for the pixels
whose place is 50 m from the camera: their median for each camera.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dojo_env.calibration.calibrating import Calibration, calibrate
from dojo_env.calibration.fitting import find_seen
from dojo_env.calibration.landmarks import list_landmarks
from dojo_env.calibration.paint import list_edges
from dojo_env.calibration.points import ControlPoints
from dojo_env.calibration.solving import Known
from dojo_env.camera import Camera
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import Scene, build_scene
from dojo_env.scenario import find_map, open_map
from dojo_env.snapshot import Snapshot
from dojo_maps.bundle import Bundle

Floats = NDArray[np.float64]

DISTANCE = 50.0
LIMIT = 0.3
SIZES = ((1280, 896), (1920, 1080))
REACH, NARROWEST = 90.0, 0.1
CLASSES = ((3.0, 6.0), (6.0, 12.0), (12.0, 18.0))


@dataclass(frozen=True, slots=True)
class Trial:
    """A camera, what a user could mark in its picture, and the ground 50 m away."""

    camera: Camera
    arc: Floats
    pixels: Floats
    places: Floats


def list_corners(bundle: Bundle) -> Floats:
    """List the places that a user may mark."""
    corners = [*list_landmarks(bundle.road_map).values()]
    shift = np.array([*bundle.road_map.origin, 0.0])
    corners += [
        tuple(vertex + shift)
        for mesh in bundle.read_meshes()
        if mesh.layer == "arrow"
        for vertex in mesh.vertices
    ]
    return np.array(corners) * [1.0, 1.0, 0.0]


def draw_trials(bundle: Bundle, count: int, seed: int) -> Iterator[Trial]:
    """Draw cameras from which at least twelve such places, and ground 50 m away, are seen."""
    random = np.random.default_rng(seed)
    lanes = {lane.id: lane for lane in bundle.road_map.lanes}
    corners = list_corners(bundle)
    while count:
        line = bundle.road_map.stop_lines[random.integers(len(bundle.road_map.stop_lines))]
        camera = draw_camera(random, lanes[line.lane].shape)
        heading = np.radians(camera.heading_deg + np.linspace(-60, 60, 121))
        arc = np.array(camera.position) * [1, 1, 0] + DISTANCE * np.column_stack(
            [np.cos(heading), np.sin(heading), np.zeros(121)]
        )
        seen_arc = find_seen(camera, arc)[1]
        pixels, seen = find_seen(camera, corners, 8.0)
        seen &= np.hypot(*(corners[:, :2] - camera.position[:2]).T) < REACH
        if seen_arc.sum() < 5 or seen.sum() < 12:
            continue
        chosen = spread_out(pixels[seen] / [camera.width, camera.height])
        places = corners[seen][chosen]
        narrow = pixels[seen][chosen].std(axis=0).max() < NARROWEST * camera.width
        if narrow or np.linalg.svd(places - places.mean(axis=0))[1][1] < 5.0:
            continue
        count -= 1
        yield Trial(camera, arc[seen_arc], pixels[seen][chosen], places)


def draw_camera(random: np.random.Generator, lane: Floats) -> Camera:
    """Hang a camera beyond a lane's stop line."""
    ahead = lane[-1, :2] - lane[-2, :2]
    ahead /= np.linalg.norm(ahead)
    aside = np.array([-ahead[1], ahead[0]])
    x, y = lane[-1, :2] + random.uniform(0, 35) * ahead + random.uniform(-10, 10) * aside
    width, height = SIZES[random.integers(len(SIZES))]
    return Camera(
        name="street",
        position=(x, y, random.uniform(3, 18)),
        heading_deg=np.degrees(np.arctan2(*-ahead[::-1])) + random.uniform(-25, 25),
        pitch_deg=random.uniform(-45, -5),
        roll_deg=random.normal(0, 1),
        field_of_view_deg=random.uniform(30, 110),
        width=width,
        height=height,
    )


def spread_out(shares: Floats) -> list[int]:
    """Choose six, each as far from the others as can be, the lowest first."""
    chosen = [int(np.argmax(shares[:, 1]))]
    while len(chosen) < 6:
        apart = np.min([np.linalg.norm(shares - shares[k], axis=1) for k in chosen], axis=0)
        chosen.append(int(np.argmax(apart)))
    return chosen


def measure(trial: Trial, found: Calibration) -> tuple[float, float, bool]:
    """Measure the error 50 m away: median, maximum, and whether the middle's is as small as is told."""
    pixels = trial.camera.project(trial.arc)[0]
    # Where the found camera sees these pixels: Newton's method on the ground.
    places = trial.arc.copy()
    for _ in range(20):
        off = pixels - found.camera.project(places)[0]
        slopes = np.stack(
            [(found.camera.project(places + step)[0] - found.camera.project(places - step)[0]) / 0.02
             for step in np.eye(3)[:2] * 0.01], axis=2,
        )  # fmt: skip
        places[:, :2] += np.clip(np.linalg.solve(slopes, off[..., None])[..., 0], -5.0, 5.0)
    errors = np.hypot(*(places - trial.arc)[:, :2].T)
    middle = int(np.argmin(np.abs(pixels[:, 0] - trial.camera.width / 2)))
    off = (places - trial.arc)[middle, :2]
    covariance = found.ground_covariance(places[[middle]])[0]
    return float(np.median(errors)), float(errors.max()), bool(off @ np.linalg.solve(covariance, off) < 5.991)


def main() -> None:
    """Print the errors with and without the photograph's paint."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cameras", type=int, default=200)
    parser.add_argument("--noise", type=float, default=2.0, help="pixels")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    random = np.random.default_rng([options.seed, 1])
    bundle = open_map(find_map("cologne1"))
    scene, edges = build_scene(bundle), list_edges(bundle)
    known = Known(noise=options.noise)
    rows = []
    for number, trial in enumerate(draw_trials(bundle, options.cameras, options.seed)):
        marked = trial.pixels + random.normal(0, options.noise, trial.pixels.shape)
        marked = np.clip(marked, 0, [trial.camera.width, trial.camera.height])
        points = ControlPoints(
            path=Path(f"camera {number}"), labels=("",) * 6, pixels=marked, places=trial.places, ground=0.0
        )
        picture = take_picture(scene, trial.camera)
        plain = calibrate(points, trial.camera, known)
        sharp = calibrate(points, trial.camera, known, photograph=picture, edges=edges)
        rows.append(
            (
                trial.camera.position[2],
                *measure(trial, plain),
                *measure(trial, sharp),
                sharp.paint is not None,
            )
        )
    report(np.array(rows, np.float64))


def take_picture(scene: Scene, camera: Camera) -> NDArray[np.uint8]:
    """Take a picture of the empty street."""
    (picture,) = Renderer(scene).render(Snapshot(time=0.0), [camera], ("rgb",))
    return picture.rgb


def report(rows: Floats) -> None:
    """Print medians, 95th percentiles and the shares of cameras within the limit, by height."""
    print(f"{len(rows)} cameras; paint was found in {rows[:, 7].mean():.1%} of the pictures")
    print("error on the ground 50 m away, m; and how often it is as small as is told in 95 of 100 cases")
    heads = f"{'median':>8}{'95 %':>8}{'<= 0.3':>8}{'worst <= 0.3':>14}{'as told':>9}"
    print(f"{'height':12}{'cameras':>8}  {'':14}{heads}")
    for low, high in (*CLASSES, (0.0, 100.0)):
        chosen = rows[(rows[:, 0] >= low) & (rows[:, 0] < high)]
        for name, at in (("six points", 1), ("and paint", 4)) if len(chosen) else ():
            middle, worst, told = chosen[:, at], chosen[:, at + 1], chosen[:, at + 2]
            height = f"{low:g} to {high:g} m" if high < 100 else "all"
            print(
                f"{height:12}{len(chosen):8}  {name:14}{np.median(middle):8.2f}"
                f"{np.percentile(middle, 95):8.2f}"
                f"{(middle <= LIMIT).mean():8.1%}{(worst <= LIMIT).mean():14.1%}{told.mean():9.1%}"
            )


if __name__ == "__main__":
    main()
