"""A camera in the scene's frame, as kernels take it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera

Floats = NDArray[np.float64]


class View(NamedTuple):
    """A pinhole.

    Attributes:
        eye: (3,) metres, scene frame.
        axes: (3, 3) rows right, down, forward.
        lens: (5,) focal length (pixels), middle (x, y), near, far (metres).
        height: pixels.
        width: pixels.
    """

    eye: Floats
    axes: Floats
    lens: Floats
    height: int
    width: int

    def scaled(self, factor: int) -> "View":
        """The same view with more pixels.

        Args:
            factor: how many times as many, across and down.

        Returns:
            A new view; what it shows of the scene is the same.
        """
        return self._replace(
            lens=self.lens * np.array([factor, factor, factor, 1.0, 1.0]),
            height=self.height * factor,
            width=self.width * factor,
        )


def view_of(camera: Camera, origin: Floats) -> View:
    """Bring a camera into the frame of a scene.

    Args:
        camera: the camera; its distortion is left out.
        origin: (3,) of the scene, metres, map frame.

    Returns:
        The camera as kernels take it.
    """
    return View(
        eye=np.array(camera.position) - origin,
        axes=np.ascontiguousarray(camera.axes),
        lens=np.array([camera.focal_length, camera.width / 2, camera.height / 2, camera.near, camera.far]),
        height=camera.height,
        width=camera.width,
    )
