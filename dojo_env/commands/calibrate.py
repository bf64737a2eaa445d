"""The command `dojo-env calibrate`: from a photograph and points that are known on the map to its camera."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command

if TYPE_CHECKING:
    from dojo_env.calibration.calibrating import Calibration

_DISTANCES = (20.0, 50.0)
"""Metres at which the error on the ground is told."""


def add_calibrate(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    calibrate = add_command(
        commands,
        "calibrate",
        _calibrate,
        "find the camera that took a photograph",
        example="dojo-env calibrate street.jpg --map junction.dojo --points points.csv --overlay over.png",
    )
    calibrate.add_argument("image", nargs="?", type=Path, metavar="IMAGE", help="a JPEG or PNG")
    calibrate.add_argument("--map", metavar="MAP", help="a bundle, a network or a packaged scenario")
    calibrate.add_argument(
        "--points",
        type=Path,
        metavar="FILE",
        help="six or more: CSV or JSON of u, v (pixels) and x, y (and z), or lon, lat, or element",
    )
    calibrate.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="where the camera goes (default: IMAGE.cameras.json)",
    )
    calibrate.add_argument(
        "--overlay", type=Path, metavar="PNG", help="also draw lanes and stop lines over the photograph"
    )
    calibrate.add_argument("--name", metavar="NAME", help="of the camera (default: the photograph's)")
    calibrate.add_argument("--height", type=float, metavar="M", help="of the camera above the road, if known")
    calibrate.add_argument("--fov", type=float, metavar="DEG", help="horizontal field of view, if known")
    calibrate.add_argument(
        "--noise", type=float, default=2.0, metavar="PX", help="how well the points are marked (default: 2)"
    )
    calibrate.add_argument(
        "--distortion",
        type=int,
        choices=range(4),
        metavar="N",
        help="coefficients of the lens to find (default: 1 with eight points or more, else none)",
    )
    calibrate.add_argument(
        "--no-paint", action="store_true", help="do not sharpen the camera by the road's painted lines"
    )
    calibrate.add_argument(
        "--elements", action="store_true", help="only list the map's elements that points can name"
    )


def _calibrate(options: argparse.Namespace) -> int:
    from dojo_env.scenario import find_map, open_map

    _check(options)
    bundle = open_map(find_map(options.map))
    if options.elements:
        from dojo_env.calibration.landmarks import list_landmarks

        print(f"{'x':>12}{'y':>12}{'z':>9}  element")
        for name, (x, y, z) in list_landmarks(bundle.road_map).items():
            print(f"{x:12.3f}{y:12.3f}{z:9.3f}  {name}")
        return 0

    import cv2

    from dojo_env.calibration.calibrating import calibrate
    from dojo_env.calibration.overlay import draw_overlay
    from dojo_env.calibration.paint import list_edges
    from dojo_env.calibration.points import read_points
    from dojo_env.calibration.solving import Known
    from dojo_env.camera import Camera, write_cameras
    from dojo_env.photographs import read_photograph
    from dojo_maps.whole_file import replaced

    photograph = read_photograph(options.image)
    height, width = photograph.shape[:2]
    found = calibrate(
        read_points(options.points, bundle.road_map),
        Camera(name=options.name or options.image.stem, position=(0, 0, 0), width=width, height=height),
        Known(
            noise=options.noise,
            height=options.height,
            field_of_view_deg=options.fov,
            bends=options.distortion,
        ),
        photograph=None if options.no_paint else photograph,
        edges=None if options.no_paint else list_edges(bundle),
    )
    output = options.output or options.image.with_suffix(".cameras.json")
    write_cameras([found.camera], output)
    if options.overlay:
        drawn = draw_overlay(
            photograph,
            found.camera,
            bundle.road_map,
            pixels=found.points.pixels,
            places=found.points.places,
        )
        with replaced(options.overlay) as fresh:
            fresh.write_bytes(cv2.imencode(".png", drawn[..., ::-1])[1].tobytes())
    _tell(found)
    print(f"written to {output}" + (f" and {options.overlay}" if options.overlay else ""))
    return 0


def _check(options: argparse.Namespace) -> None:
    """Refuse what cannot work before anything is read."""
    if options.map is None:
        raise ConfigError("--map: give the bundle, network or scenario that the photograph shows")
    if not options.elements and (options.image is None or options.points is None):
        raise ConfigError("expected IMAGE and --points FILE, or --elements to list what points can name")
    if options.overlay and options.overlay.suffix.lower() != ".png":
        raise ConfigError(f"--overlay {options.overlay}: its name must end in .png")
    for name, low, high in (("height", 0.5, 200.0), ("fov", 1.0, 160.0), ("noise", 0.01, 100.0)):
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            raise ConfigError(f"--{name} {value:g}: expected {low:g} to {high:g}")


def _tell(found: "Calibration") -> None:
    """Print a camera with what is known of its errors."""
    camera, off = found.camera, found.deviations().tolist()
    x, y, z = camera.position
    print(f"{'position':16}{x:.2f} ± {off[0]:.2f}, {y:.2f} ± {off[1]:.2f}, {z:.2f} ± {off[2]:.2f} m")
    told = (
        ("heading", camera.heading_deg % 360.0, off[3], "° counter-clockwise from east"),
        ("pitch", camera.pitch_deg, off[4], "°"),
        ("roll", camera.roll_deg, off[5], "°"),
        ("field of view", camera.field_of_view_deg, off[6], "° across"),
    )
    for name, value, deviation, unit in told:
        print(f"{name:16}{value:.2f} ± {deviation:.2f}{unit}")
    for number, deviation in enumerate(off[7:], 1):
        value = (camera.distortion[0], camera.distortion[1], camera.distortion[4])[number - 1]
        print(f"{f'lens k{number}':16}{value:.4f} ± {deviation:.4f}")
    for distance in _DISTANCES:
        error = found.ground_error(distance)
        words = "not in the picture"
        if error is not None:
            words = (
                f"off by up to {error.middle[0]:.2f} m in the middle of the picture, "
                f"{error.worst:.2f} m at its worst (95 %)"
            )
        print(f"{f'ground at {distance:.0f} m':16}{words}")
    if found.paint is not None:
        count = len(found.paint.paint.places)
        print(f"{'paint':16}found at {count} places, {found.paint.share:.0%} of those in view")
    elif found.paint_share is not None:
        print(
            "dojo-env: the photograph's painted lines are not the map's "
            f"({found.paint_share:.0%} found); only the points were used",
            file=sys.stderr,
        )
    print(f"{'misfit':>10}  point")
    for label, (u, v) in zip(found.points.labels, found.misfits, strict=True):
        print(f"{(u * u + v * v) ** 0.5:7.1f} px  {label}")
    for label, pixels in found.wrong:
        print(f"dojo-env: warning: {label} is off by {pixels:.0f} px and was left out", file=sys.stderr)
