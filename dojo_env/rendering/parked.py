"""Parked cars as one camera sees them: drawn like all road users, but once, into its background."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.background import Background
from dojo_env.rendering.canvas import Canvas
from dojo_env.rendering.classes import SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.lighting import Light
from dojo_env.rendering.scene import NO_LAMPS, NO_PATHS
from dojo_env.rendering.target import label, resolve
from dojo_env.rendering.traffic import Users, place_users
from dojo_env.rendering.view import View
from dojo_env.snapshot import Snapshot


class Parked(NamedTuple):
    """The parked cars of a scene, and what a camera would see of each.

    Attributes:
        cars: n of them; their numbers follow each other.
        users: the same in place.
        alone: (n,) pixels that each would cover if it were alone.
    """

    cars: Snapshot
    users: Users
    alone: NDArray[np.int32]


def park_cars(
    background: Background,
    cars: Snapshot,
    origin: NDArray[np.float64],
    view: View,
    light: Light,
    *,
    plain: bool,
) -> tuple[Background, Parked]:
    """Draw parked cars into a background, with their shadows.

    Args:
        background: the static world without them.
        cars: see `parked_cars.list_parked`.
        origin: (3,) of the scene, metres, map frame.
        view: the background's.
        light: what shines.
        plain: draw them more simply.
    """
    users = place_users(cars, origin)
    if not cars.ids:
        return background, Parked(cars, users, np.empty(0, np.int32))
    canvas = Canvas(view, background.depths, light, plain=plain)
    target = canvas.draw(users, NO_LAMPS, NO_PATHS)
    lit, shaded, headlit = background.lit, background.shaded, background.headlit
    pictures = [picture.copy() for picture in (lit, shaded, headlit)]
    # Shadows turn what is lit into what is shaded, and leave the others as they are.
    for picture, dark in zip(pictures, (shaded, shaded, headlit), strict=True):
        resolve(target.tags, target.spans, target.shades, dark, headlit, picture)
    classes = np.append(SEMANTIC_OF_KIND[cars.kinds], np.uint8(Semantic.SIGNAL))
    numbers = np.append(cars.numbers, np.int32(0))
    every = np.arange(len(cars.ids), dtype=np.int32)
    drawn = replace(
        background,
        lit=pictures[0],
        shaded=pictures[1],
        headlit=pictures[0] if headlit is lit else pictures[2],
        depths=target.depths.copy(),
        semantics=label(target.tags, target.owners, classes, background.semantics),
        instances=label(target.tags, target.owners, numbers, background.instances),
    )
    return drawn, Parked(cars, users, canvas.count_pixels(users, every))
