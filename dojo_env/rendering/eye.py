"""What a camera keeps from frame to frame: its view of the static world, and how its lens bends it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.background import Background, draw_background
from dojo_env.rendering.canvas import Canvas
from dojo_env.rendering.lighting import Light
from dojo_env.rendering.parked import Parked, park_cars
from dojo_env.rendering.scene import Scene
from dojo_env.rendering.target import Target
from dojo_env.rendering.view import View, view_of
from dojo_env.snapshot import Snapshot

Places = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Eye:
    """A camera at work.

    Attributes:
        view: the straight view that frames are drawn in; larger than the picture where a lens bends.
        canvas: what they are drawn into.
        background: what the picture shows where nothing moves, bent by the lens.
        parked: the cars that stand in the background.
        rows: (h, w) row of the straight view that each pixel of the picture shows; None for a perfect lens.
        columns: (h, w) its column.
    """

    view: View
    canvas: Canvas
    background: Background
    parked: Parked
    rows: NDArray[np.intp] | None = None
    columns: NDArray[np.intp] | None = None

    def bend(self, target: Target) -> Target:
        """Look at a frame through the lens."""
        if self.rows is None:
            return target
        height, width = self.rows.shape
        return target._replace(
            depths=target.depths[self.rows, self.columns],
            tags=target.tags[self.rows, self.columns],
            spans=np.tile(np.array([0, width], dtype=np.int32), (height, 1)),
        )


def open_eye(
    scene: Scene, cars: Snapshot, camera: Camera, light: Light, factor: int, *, samples: int, plain: bool
) -> Eye:
    """Draw a camera's background.

    Args:
        scene: the static world.
        cars: that are parked in it.
        camera: the camera.
        light: what shines on it.
        factor: pixels across and down for each of the camera's own.
        samples: that each of these has across and down.
        plain: road users are drawn more cheaply.
    """
    view = view_of(camera, scene.origin).scaled(factor)
    if not camera.distortion:
        background, parked = park_cars(
            draw_background(scene, view, light, samples), cars, scene.origin, view, light, plain=plain
        )
        canvas = Canvas(view, background.depths, light, plain=plain)
        return Eye(view=view, canvas=canvas, background=background, parked=parked)
    from dojo_env.rendering.lens import bend_background, straightened  # noqa: PLC0415 - OpenCV is large; few need it

    x, y = straightened(camera, view)
    left, top = int(max(0.0, np.ceil(-x.min()))), int(max(0.0, np.ceil(-y.min())))
    right, bottom = (int(max(0.0, np.ceil(v.max() - n))) for v, n in ((x, view.width), (y, view.height)))
    wide = view._replace(
        lens=view.lens + np.array([0.0, left, top, 0.0, 0.0]),
        height=view.height + top + bottom,
        width=view.width + left + right,
    )
    straight, parked = park_cars(
        draw_background(scene, wide, light, samples), cars, scene.origin, wide, light, plain=plain
    )
    x, y = x + np.float32(left), y + np.float32(top)
    return Eye(
        view=wide,
        canvas=Canvas(wide, straight.depths, light, plain=plain),
        background=bend_background(straight, x, y),
        parked=parked,
        rows=np.clip(np.floor(y).astype(np.intp), 0, wide.height - 1),
        columns=np.clip(np.floor(x).astype(np.intp), 0, wide.width - 1),
    )
