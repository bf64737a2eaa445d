"""The canvas of one picture size: the visibility buffer, and what is drawn into it frame by frame."""

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering import drawing
from dojo_env.rendering.lighting import Light, srgb_table
from dojo_env.rendering.raster import STATIC
from dojo_env.rendering.scene import LAMP_COLOURS, Lamps, Paths
from dojo_env.rendering.traffic import Users, library
from dojo_env.rendering.view import View

Ints = NDArray[np.int32]

_OVERHEAD = np.array([0.0, 0.0, 1.0])
_NO_SUN = 0.05
"""Where the sun is weaker, road users only darken the ground right under them."""


class Canvas:
    """Depths and tags of a picture, and the colour and owner of each face in it."""

    def __init__(self, height: int, width: int) -> None:
        """Make room for pictures of this size."""
        self.depths = np.zeros((height, width), dtype=np.float32)
        self.tags = np.full((height, width), STATIC, dtype=np.int32)
        self.shades = np.empty((0, 3), dtype=np.uint8)
        self.owners = np.empty(0, dtype=np.int32)
        self._table = srgb_table()

    def draw(
        self, view: View, depths: NDArray[np.float32], users: Users, lamps: Lamps, paths: Paths, light: Light
    ) -> drawing.Target:
        """Draw a frame: the background's depths first, then all that moves.

        Args:
            view: the camera.
            depths: the background's inverse depths.
            users: the road users.
            lamps: the signal lamps that are lit.
            paths: the link paths to show.
            light: what shines on them.

        Returns:
            The canvas's own buffers, which the next frame changes.
        """
        np.copyto(self.depths, depths)
        self.tags.fill(STATIC)
        self._make_room(users, len(lamps.colours) + len(paths.colours))
        target = drawing.Target(self.depths, self.tags, self.shades, self.owners)
        count = 0
        if len(paths.colours):
            count = drawing.draw_flat(paths, LAMP_COLOURS, self._table, view, target, count)
        near = drawing.users_in_view(users, view)
        if len(near):
            sun = light.sun if light.sun_colour.max() > _NO_SUN else _OVERHEAD
            drawing.draw_shadows(near, users, library(), sun, view, target)
            if light.headlights > 0:
                drawing.draw_beams(near, users, view, target)
            towards = view.axes @ light.sun
            count = drawing.draw_users(
                near, users, library(), light.packed, towards, self._table, view, target, count
            )
        if len(lamps.colours):
            drawing.draw_lamps(lamps, LAMP_COLOURS, self._table, view, target, count)
        return target

    def count_pixels(self, view: View, users: Users, whose: Ints) -> Ints:
        """Count the pixels that each of some road users would cover if it were alone: (k,)."""
        tags = np.full_like(self.tags, STATIC)
        target = drawing.Target(self.depths, tags, self.shades, self.owners)
        return drawing.count_alone(whose, users, library(), view, target)

    def _make_room(self, users: Users, others: int) -> None:
        spans = library().spans[users.models, 0]
        most = int((spans[:, 3] - spans[:, 2]).sum()) + others
        if len(self.owners) < most:
            self.shades = np.empty((2 * most, 3), dtype=np.uint8)
            self.owners = np.empty(2 * most, dtype=np.int32)
