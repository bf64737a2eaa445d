"""A camera's canvas: its visibility buffer, and what is drawn into it frame by frame."""

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering import drawing, lights
from dojo_env.rendering.lighting import Light, srgb_table
from dojo_env.rendering.raster import STATIC
from dojo_env.rendering.scene import LAMP_COLOURS, Lamps, Paths
from dojo_env.rendering.target import Target, restore
from dojo_env.rendering.traffic import MOST_FACES, Users, library
from dojo_env.rendering.view import View

Ints = NDArray[np.int32]

_OVERHEAD = np.array([0.0, 0.0, 1.0])
_NO_LIGHT = np.zeros((7, 3))
_NO_SUN = 0.05
"""Where the sun is weaker, road users only darken the ground right under them."""


class Canvas:
    """What a camera draws into, frame by frame: it puts back only what the frame before has changed."""

    def __init__(self, view: View, clean: NDArray[np.float32]) -> None:
        """Begin with the background's inverse depths."""
        self._view, self._clean = view, clean
        height, width = clean.shape
        self._target = Target(
            depths=clean.copy(),
            tags=np.full((height, width), STATIC, dtype=np.int32),
            shades=np.empty((0, 3), dtype=np.uint8),
            owners=np.empty(0, dtype=np.int32),
            spans=np.tile(np.array([width, 0], dtype=np.int32), (height, 1)),
        )
        self._table = srgb_table()

    def draw(self, users: Users, lamps: Lamps, paths: Paths, light: Light) -> Target:
        """Draw a frame.

        Args:
            users: the road users.
            lamps: the signal lamps that are lit.
            paths: the link paths to show.
            light: what shines on them.

        Returns:
            The canvas's own buffers, which the next frame changes.
        """
        self._make_room(len(users.models) * MOST_FACES + len(lamps.colours) + len(paths.colours))
        view, target, count = self._view, self._target, 0
        restore(target, self._clean)
        if len(paths.colours):
            count = lights.draw_flat(paths, LAMP_COLOURS, self._table, view, target, count)
        near = drawing.users_in_view(users, view) if len(users.models) else ()
        if len(near):
            sun = light.sun if light.sun_colour.max() > _NO_SUN else _OVERHEAD
            drawing.draw_shadows(near, users, sun, view, target)
            if light.headlights > 0:
                lights.draw_beams(near, users, view, target)
            count = drawing.draw_users(near, users, library(), light.packed, self._table, view, target, count)
        if len(lamps.colours):
            lights.draw_lamps(lamps, LAMP_COLOURS, self._table, view, target, count)
        return target

    def count_pixels(self, users: Users, whose: Ints) -> Ints:
        """Count the pixels that each of some road users would cover if it were alone: (k,)."""
        alone = self._target._replace(tags=np.full_like(self._target.tags, STATIC))
        return drawing.count_alone(whose, users, library(), _NO_LIGHT, self._view, alone)

    def _make_room(self, faces: int) -> None:
        if len(self._target.owners) < faces:
            self._target = self._target._replace(
                shades=np.empty((2 * faces, 3), dtype=np.uint8), owners=np.empty(2 * faces, dtype=np.int32)
            )
