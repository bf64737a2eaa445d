"""What a camera keeps from frame to frame: its view of the static world, and how its lens bends it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.background import Background, draw_background
from dojo_env.rendering.canvas import Canvas
from dojo_env.rendering.lighting import Light
from dojo_env.rendering.parked import Parked, park_cars
from dojo_env.rendering.scene import Lamps, Paths, Scene
from dojo_env.rendering.target import Target, bend
from dojo_env.rendering.traffic import Users
from dojo_env.rendering.view import View, view_of
from dojo_env.rendering.visibility import Visible, measure_visible
from dojo_env.snapshot import Snapshot

Indices = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """What frames are drawn into, at some samples a pixel.

    Attributes:
        canvas: of the straight view, which is larger than the picture where a lens bends.
        rows: (h, w) row of the straight view that each sample of the picture shows; None for a perfect lens.
        columns: (h, w) its column.
    """

    canvas: Canvas
    rows: Indices | None = None
    columns: Indices | None = None

    def draw(self, users: Users, lamps: Lamps, paths: Paths, *, colours: bool) -> Target:
        """Draw a frame, and look at it through the lens; see `Canvas.draw`.

        Args:
            users: the road users.
            lamps: the signal lamps that are lit.
            paths: the link paths to show.
            colours: whether anybody looks at them; shapes alone cost half as much.

        Returns:
            The buffers as the picture has them, bent by the lens; the next frame may change them.
        """
        return self._bend(self.canvas.draw(users, lamps, paths, colours=colours))

    def measure_visible(self, users: Users) -> Visible:
        """Tell how much of each road user shows, as a box.

        Args:
            users: the road users; parked cars are no part of them.

        Returns:
            Those of whose boxes at least one pixel is visible.
        """
        target, alone = self.canvas.draw_boxes(users)
        return measure_visible(self._bend(target), alone)

    def _bend(self, target: Target) -> Target:
        if self.rows is None:
            return target
        depths, tags, spans = bend(target.depths, target.tags, self.rows, self.columns)
        return target._replace(depths=depths, tags=tags, spans=spans)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Eye:
    """A camera at work.

    Attributes:
        background: what the picture shows where nothing moves, bent by the lens.
        parked: the cars that stand in the background.
        sights: by how many samples a pixel has across and down: 1, and where pictures are smooth `SAMPLES`.
    """

    background: Background
    parked: Parked
    sights: Mapping[int, Sight]


def open_eye(scene: Scene, cars: Snapshot, camera: Camera, light: Light, *, smooth: bool, plain: bool) -> Eye:
    """Draw a camera's background.

    Args:
        scene: the static world.
        cars: that are parked in it.
        camera: that looks.
        light: what shines.
        smooth: pictures have more samples a pixel.
        plain: what moves is drawn more cheaply.

    Returns:
        The camera at work, with a sight of one sample a pixel, and if smooth one of `SAMPLES`.
    """
    view = view_of(camera, scene.origin)

    def draw(straight: View) -> tuple[Background, Mapping[int, Canvas], Parked]:
        background, depths, parked = park_cars(
            *draw_background(scene, straight, light),
            cars,
            scene,
            straight,
            light,
            smooth=smooth,
            plain=plain,
        )
        canvases = {
            factor: Canvas(straight.scaled(factor), clean, light, scene.fleet.library, plain=plain)
            for factor, clean in depths.items()
        }
        return background, canvases, parked

    if not camera.distortion:
        background, canvases, parked = draw(view)
        sights = {factor: Sight(canvas=canvas) for factor, canvas in canvases.items()}
        return Eye(background=background, parked=parked, sights=sights)
    from dojo_env.rendering.lens import bend_background, find_places, straightened  # noqa: PLC0415 - OpenCV is large; few need it

    x, y = straightened(camera, view)
    left, top = int(max(0.0, np.ceil(-x.min()))), int(max(0.0, np.ceil(-y.min())))
    right, bottom = (int(max(0.0, np.ceil(v.max() - n))) for v, n in ((x, view.width), (y, view.height)))
    wide = view._replace(
        lens=view.lens + np.array([0.0, left, top, 0.0, 0.0]),
        height=view.height + top + bottom,
        width=view.width + left + right,
    )
    background, canvases, parked = draw(wide)
    sights = {}
    for factor, canvas in canvases.items():
        at_x, at_y = (x, y) if factor == 1 else straightened(camera, view.scaled(factor))
        at_x, at_y = at_x + np.float32(factor * left), at_y + np.float32(factor * top)
        rows, columns = find_places(at_x, at_y, (factor * wide.height, factor * wide.width))
        sights[factor] = Sight(canvas=canvas, rows=rows, columns=columns)
    bent = bend_background(background, x + np.float32(left), y + np.float32(top))
    return Eye(background=bent, parked=parked, sights=sights)
