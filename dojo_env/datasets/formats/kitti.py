"""KITTI's object benchmark: labels with 3D boxes, and calibrations. Source: devkit_object/readme.txt.

KITTI knows boxes that turn about the camera's vertical axis only, and its cameras look level. Cameras of
junctions look down, so labels stand in a level frame at the camera's place (x right, y down, z ahead, level),
and P2 holds the camera's tilt: P2 @ (x, y, z, 1) is exactly where a point shows, and Tr_velo_to_cam brings
points of the map into that frame.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import atan2, cos, pi, radians, sin
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.datasets.formats.base import Format, Lines
from dojo_env.datasets.labels import Category, ObjectLabel, PictureLabels
from dojo_env.errors import ConfigError
from dojo_env.snapshot import Kind

if TYPE_CHECKING:
    from dojo_env.datasets.settings import DatasetSettings

Floats = NDArray[np.float64]

_TYPES = {
    Category.PERSON: "Pedestrian", Category.BICYCLE: "Cyclist", Category.CAR: "Car", Category.TRUCK: "Truck",
    Category.TRAIN: "Tram",
}  # fmt: skip
"""KITTI's types; it has none for buses, motorcycles and ships, which are `Misc`."""
_VANS = (Kind.VAN, Kind.AMBULANCE)


class Kitti(Format):
    """`training/{image_2,label_2,calib}`, and the splits' numbers in `ImageSets`.

    Road users of which too little shows are `DontCare`.
    """

    picture = "png"

    def place(self, split: str, sequence: str, frame: int, number: int) -> tuple[str, str]:
        """See `Format`."""
        return f"training/image_2/{number:06d}", f"training/depth_2/{number:06d}"

    def write_part(self, pictures: Sequence[PictureLabels], settings: "DatasetSettings") -> Mapping[str, str]:
        """See `Format`.

        Raises:
            ConfigError: a camera's lens bends, which KITTI cannot say.
        """
        files = {}
        for picture in pictures:
            camera = picture.camera
            if any(camera.distortion):
                raise ConfigError(
                    f"camera {camera.name!r}: its lens bends, which KITTI cannot say; take another format"
                )
            rows = (_write(each, camera) for each in picture.objects)
            files[f"training/label_2/{picture.number:06d}.txt"] = "".join(f"{row}\n" for row in rows)
            files[f"training/calib/{picture.number:06d}.txt"] = _calibrate(camera)
        return files

    def write_lines(self, pictures: Sequence[PictureLabels]) -> Mapping[str, list[str]]:
        """See `Format`."""
        return {pictures[0].split: [f"{picture.number:06d}" for picture in pictures]}

    def finish(self, settings: "DatasetSettings", lines: Lines) -> Iterable[tuple[str, Iterable[str]]]:
        """See `Format`."""
        for split in settings.splits:
            yield f"ImageSets/{split}.txt", (f"{line}\n" for line in lines(split))


def _level_axes(camera: Camera) -> Floats:
    """Rows are right, down and ahead of the camera, if it looked level."""
    heading = radians(camera.heading_deg)
    return np.array([[sin(heading), -cos(heading), 0.0], [0.0, 0.0, -1.0], [cos(heading), sin(heading), 0.0]])


def _write(label: ObjectLabel, camera: Camera) -> str:
    box = " ".join(f"{value:.2f}" for value in label.cut_box(camera))
    if label.is_ignored:
        return f"DontCare -1 -1 -10 {box} -1 -1 -1 -1000 -1000 -1000 -10"
    axes = _level_axes(camera)
    x, y, z = axes @ (0.5 * (label.corners[0] + label.corners[6]) - camera.position)
    ahead = axes @ [cos(label.heading), sin(label.heading), 0.0]
    turn = atan2(-ahead[2], ahead[0])
    alpha = (turn - atan2(x, z) + pi) % (2 * pi) - pi
    length, width, height = label.size
    kind = "Van" if label.kind in _VANS else _TYPES.get(label.category, "Misc")
    sizes = " ".join(f"{value:.3f}" for value in (height, width, length, x, y, z, turn))
    return f"{kind} {label.truncated:.2f} {label.occlusion} {alpha:.3f} {box} {sizes}"


def _calibrate(camera: Camera) -> str:
    axes = _level_axes(camera)
    projection = np.column_stack([camera.intrinsics @ camera.axes @ axes.T, np.zeros(3)])
    into_level = np.column_stack([axes, -axes @ camera.position])
    rows = [(f"P{k}", projection) for k in range(4)]
    rows += [("R0_rect", np.eye(3)), ("Tr_velo_to_cam", into_level), ("Tr_imu_to_velo", np.eye(3, 4))]
    return "".join(f"{name}: {' '.join(f'{value:.12e}' for value in m.ravel())}\n" for name, m in rows)
