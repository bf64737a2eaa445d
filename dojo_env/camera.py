"""Cameras: pinholes with a place, a direction and, if wanted, a lens that bends."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from math import cos, radians, sin, tan
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from dojo_env.errors import CameraError, ConfigError
from dojo_maps.safe_json import read_json
from dojo_maps.short_repr import short_repr
from dojo_maps.whole_file import write_json

Floats = NDArray[np.float64]

BEV = "bev"
"""Name of the camera straight above a signal."""
LARGEST_SIDE = 8192
"""Pixels; larger pictures are refused."""
_MOST_PIXELS = LARGEST_SIDE**2
"""Of all cameras of a file together."""
_FARTHEST, _MOST_BENT = 1e8, 1e3
_NUMBERS = ("heading_deg", "pitch_deg", "roll_deg", "field_of_view_deg", "near", "far")


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """Where a camera hangs and what it can see.

    Attributes:
        name: unique among the cameras of one signal or scene.
        position: metres, map frame.
        heading_deg: where it looks, counter-clockwise from east; the top of a picture taken straight down.
        pitch_deg: above the horizon, so -90 looks straight down.
        roll_deg: clockwise turn of the camera about its axis.
        field_of_view_deg: horizontal, from edge to edge.
        width: pixels.
        height: pixels.
        near: metres along the axis; nothing nearer is drawn.
        far: metres along the axis; the depth of the sky.
        distortion: (k1, k2, p1, p2, k3) of Brown and Conrady as OpenCV takes them; empty for a perfect lens.
    """

    name: str
    position: tuple[float, float, float]
    heading_deg: float = 0.0
    pitch_deg: float = -35.0
    roll_deg: float = 0.0
    field_of_view_deg: float = 75.0
    width: int = 356
    height: int = 256
    near: float = 0.2
    far: float = 400.0
    distortion: tuple[float, ...] = ()

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse what no camera can be.

        Raises:
            ConfigError: a number is missing, not finite, or out of its range.
        """
        for name in ("position", "distortion"):
            values = getattr(self, name)
            if not isinstance(values, Iterable) or not all(map(_is_number, values := tuple(values))):
                self._refuse(name, "finite numbers")
            object.__setattr__(self, name, tuple(float(value) for value in values))
        if not all(_is_number(getattr(self, name)) for name in (*_NUMBERS, "width", "height")):
            self._refuse("angles, near, far, width and height", "finite numbers")
        sides, bends = (self.width, self.height), self.distortion
        possible = (
            ("name", "a text", isinstance(self.name, str)),
            (
                "position",
                f"three numbers up to {_FARTHEST:g}, metres",
                len(self.position) == 3 and max(map(abs, self.position)) <= _FARTHEST,
            ),
            (
                "width and height",
                f"whole numbers, 1 to {LARGEST_SIDE} pixels",
                all(1 <= side <= LARGEST_SIDE and side == int(side) for side in sides),
            ),
            ("field_of_view_deg", "1 to 160", 1.0 <= self.field_of_view_deg <= 160.0),
            (
                "near and far",
                "0.01 <= near < far <= 100,000 metres",
                0.01 <= self.near < self.far <= 1e5,
            ),
            (
                "distortion",
                f"none, four or five numbers up to {_MOST_BENT:g}: k1, k2, p1, p2, k3",
                len(bends) in (0, 4, 5) and max(map(abs, bends), default=0.0) <= _MOST_BENT,
            ),
        )
        for what, wanted, is_possible in possible:
            if not is_possible:
                self._refuse(what, wanted)
        for name in ("width", "height"):
            object.__setattr__(self, name, int(getattr(self, name)))

    def __hash__(self) -> int:
        """Hash what mostly differs: cameras are looked up at every picture."""
        return hash((self.name, self.position))

    def _refuse(self, what: str, wanted: str) -> NoReturn:
        got = {f.name: getattr(self, f.name) for f in fields(self) if f.name in what or f.name in _NUMBERS}
        raise ConfigError(f"camera {str(self.name)[:60]!r}: {what} must be {wanted}; got {str(got)[:300]}")

    @property
    def focal_length(self) -> float:
        """Pixels, the same across and down."""
        return self.width / 2 / tan(radians(self.field_of_view_deg) / 2)

    @property
    def axes(self) -> Floats:
        """(3, 3): rows are the camera's right, down and forward, map frame."""
        heading, pitch, roll = (radians(a) for a in (self.heading_deg, self.pitch_deg, self.roll_deg))
        x, y, z = cos(pitch) * cos(heading), cos(pitch) * sin(heading), sin(pitch)
        forward, right = np.array([x, y, z]), np.array([sin(heading), -cos(heading), 0.0])
        # Their cross product, written out: NumPy's own costs more than projecting a picture's points.
        down = np.array([z * cos(heading), z * sin(heading), -x * cos(heading) - y * sin(heading)])
        return np.array([cos(roll) * right + sin(roll) * down, cos(roll) * down - sin(roll) * right, forward])

    @property
    def intrinsics(self) -> Floats:
        """(3, 3) matrix K; pixel (0, 0) covers 0 to 1, so its centre is (0.5, 0.5)."""
        f = self.focal_length
        return np.array([[f, 0.0, self.width / 2], [0.0, f, self.height / 2], [0.0, 0.0, 1.0]])

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Find where points of the map fall in the picture.

        Args:
            points: (n, 3) metres, map frame.

        Returns:
            (n, 2) pixels, and (n,) metres along the axis; pixels of points not before the camera are nan.
        """
        seen = (np.asarray(points, dtype=np.float64) - self.position) @ self.axes.T
        depth = seen[:, 2]
        ahead = np.where(depth > 1e-9, depth, np.nan)
        level = _distort(seen[:, :2] / ahead[:, None], self.distortion)
        return level * self.focal_length + [self.width / 2, self.height / 2], depth


def _distort(level: Floats, distortion: tuple[float, ...]) -> Floats:
    """Bend points of the plane one metre ahead as a lens does. Source: OpenCV calib3d, the pinhole model."""
    if not distortion:
        return level
    k1, k2, p1, p2, k3 = (*distortion, 0.0)[:5]
    x, y = level.T
    square = x * x + y * y
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    return np.column_stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
            y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
        ]
    )


def write_cameras(cameras: Iterable[Camera], path: Path | str) -> None:
    """Save cameras as JSON, whole or not at all.

    Args:
        cameras: each with a name of its own.
        path: of the file, JSON.
    """
    value = {"format": "dojo-cameras", "version": 1, "cameras": [asdict(camera) for camera in cameras]}
    write_json(Path(path), value)


def read_cameras(path: Path | str) -> tuple[Camera, ...]:
    """Read cameras back.

    Args:
        path: of a file that `write_cameras` or `dojo-env cameras -o` wrote.

    Returns:
        The cameras.

    Raises:
        CameraError: the file is missing, not JSON, or does not hold cameras.
    """
    path = Path(path)
    value = read_json(path, error=CameraError)
    if not isinstance(value, dict) or (value.get("format"), value.get("version")) != ("dojo-cameras", 1):
        raise CameraError(path, "not a dojo-cameras file of version 1; dojo_env.write_cameras makes one")
    try:
        cameras = tuple(Camera(**each) for each in value["cameras"])
    except (ConfigError, TypeError, KeyError) as error:
        raise CameraError(path, f"holds no cameras ({error})") from error
    if not cameras or len({camera.name for camera in cameras}) != len(cameras):
        raise CameraError(path, "holds no camera, or two that share a name; each needs its own")
    if sum(camera.width * camera.height for camera in cameras) > _MOST_PIXELS:
        raise CameraError(path, f"its pictures have more than {_MOST_PIXELS} pixels together; take less")
    return cameras


def _is_number(value: object) -> bool:
    """Tell numbers from texts, nan, infinity, and whole numbers too large for any float."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    return bool(-1e300 < value < 1e300)
