"""A camera's canvas: its visibility buffer, and what is drawn into it frame by frame."""

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import kernel
from dojo_env.rendering.drawing import WEATHER, count_alone, draw_users, users_in_view
from dojo_env.rendering.fleet import MOST_FACES, Library
from dojo_env.rendering.ground import BEAM_LENGTH, draw_on_ground
from dojo_env.rendering.lighting import Light
from dojo_env.rendering.lights import draw_flat, draw_lamps
from dojo_env.rendering.raster import STATIC
from dojo_env.rendering.scene import Lamps, Paths
from dojo_env.rendering.target import Target, restore
from dojo_env.rendering.traffic import Users
from dojo_env.rendering.view import View
from dojo_env.rendering.visibility import draw_boxes

Ints = NDArray[np.int32]

_NO_LIGHT = np.zeros((7, 3))
_NO_SUN = 0.05
"""Where the sun is weaker, road users throw no shadows but where they touch the ground."""
_SHADOW_LENGTH = 3.0
"""How far shadows that matter reach beyond road users, metres."""


class Canvas:
    """What a camera draws into, frame by frame: it puts back only what the frame before has changed."""

    def __init__(
        self,
        view: View,
        clean: NDArray[np.float32],
        light: Light,
        models: Library,
        *,
        plain: bool = False,
    ) -> None:
        """Begin with the background's inverse depths, under a light; plain is cheaper."""
        self._plain, self._models = plain, models
        self._view, self._clean, self._light = view, clean, light.packed
        self._sun = light.sun if light.sun_colour.max() > _NO_SUN else np.zeros(3)
        height, width = clean.shape
        self._target = Target(
            depths=clean.copy(),
            tags=np.full((height, width), STATIC, dtype=np.int32),
            shades=np.empty((0, 3), dtype=np.uint8),
            owners=np.empty(0, dtype=np.int32),
            spans=np.tile(np.array([width, 0], dtype=np.int32), (height, 1)),
        )

    def draw(self, users: Users, lamps: Lamps, paths: Paths, *, colours: bool = True) -> Target:
        """Draw a frame.

        Args:
            users: the road users.
            lamps: the signal lamps that are lit.
            paths: the link paths to show.
            colours: whether anybody looks at them; shapes alone cost half as much.

        Returns:
            The canvas's own buffers, which the next frame changes.
        """
        self._make_room(len(users.models) * MOST_FACES + len(lamps.colours) + len(paths.colours))
        lit = (self._light, self._sun, self._plain, colours)
        _draw(users, lamps, paths, self._models, *lit, self._view, self._clean, self._target)
        return self._target

    def draw_boxes(self, users: Users) -> tuple[Target, Ints]:
        """Draw nothing but the box around each road user.

        Args:
            users: the road users.

        Returns:
            The canvas's own buffers, whose tags are the users' rows; and (n,) the pixels that each box would
            cover if nothing stood in front.
        """
        self._make_room(len(users.models))
        restore(self._target, self._clean)
        return self._target, draw_boxes(users, self._view, self._target)

    def count_pixels(self, users: Users, whose: Ints) -> Ints:
        """Count the pixels that each of some road users would cover if it were alone.

        Args:
            users: all road users.
            whose: (k,) rows of those to count.

        Returns:
            (k,) pixels inside the view; the canvas's own buffers stay as they are.
        """
        alone = self._target._replace(tags=np.full_like(self._target.tags, STATIC))
        return count_alone(whose, users, self._models, _NO_LIGHT, self._plain, self._view, alone)

    def _make_room(self, faces: int) -> None:
        if len(self._target.owners) < faces:
            self._target = self._target._replace(
                shades=np.empty((2 * faces, 3), dtype=np.uint8), owners=np.empty(2 * faces, dtype=np.int32)
            )


@kernel
def _draw(users, lamps, paths, models, light, sun, plain, colours, view, clean, target):
    """Draw all that moves: one call, since handing arrays over costs as much as drawing a few cars."""
    restore(target, clean)
    count = draw_flat(paths, view, target)
    headlights = light[WEATHER, 0] > 0.0
    near = users_in_view(users, BEAM_LENGTH if headlights else _SHADOW_LENGTH, view)
    count = draw_users(near, users, models, light, plain, colours, view, target, count)
    if colours:
        draw_on_ground(near, users, models, sun, headlights, plain, view, target)
    draw_lamps(lamps, view, target, count)
