"""Parked cars as one camera sees them: drawn like all road users, but once, into its background."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.background import OWN, SAMPLES, Background, Depths
from dojo_env.rendering.canvas import Canvas
from dojo_env.rendering.classes import SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.lighting import Light
from dojo_env.rendering.scene import NO_LAMPS, NO_PATHS, Scene
from dojo_env.rendering.target import label, resolve_pixels, resolve_samples
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
    depths: Depths,
    cars: Snapshot,
    scene: Scene,
    view: View,
    light: Light,
    *,
    smooth: bool,
    plain: bool,
) -> tuple[Background, Mapping[int, Depths], Parked]:
    """Draw parked cars into a background, with their shadows.

    Args:
        background: the static world without them.
        depths: of its samples; see `draw_background`.
        cars: see `parked_cars.list_parked`.
        scene: the static world.
        view: the background's.
        light: what shines.
        smooth: pictures have more samples a pixel.
        plain: draw them more simply.

    Returns:
        The background with them, its inverse depths by how many samples a pixel has across and down (1, and
        where pictures are smooth `SAMPLES`), and the cars.
    """
    clean = {1: np.ascontiguousarray(depths[OWN]), **({SAMPLES: depths} if smooth else {})}
    users = place_users(cars, scene.origin, fleet=scene.fleet)
    if not cars.ids:
        return background, clean, Parked(cars, users, np.empty(0, np.int32))
    canvases = {
        factor: Canvas(view.scaled(factor), empty, light, scene.fleet.library, plain=plain)
        for factor, empty in clean.items()
    }
    targets = {factor: canvas.draw(users, NO_LAMPS, NO_PATHS) for factor, canvas in canvases.items()}
    own, finest = targets[1], targets[max(targets)]
    resolve = resolve_samples if smooth else resolve_pixels
    lit, shaded, headlit = background.lit, background.shaded, background.headlit
    pictures = [picture.copy() for picture in (lit, shaded, headlit)]
    # Shadows turn what is lit into what is shaded, and leave the others as they are.
    for picture, dark in zip(pictures, (shaded, shaded, headlit), strict=True):
        resolve(finest.tags, finest.spans, finest.shades, dark, headlit, picture)
    classes = np.append(SEMANTIC_OF_KIND[cars.kinds], np.uint8(Semantic.SIGNAL))
    numbers = np.append(cars.numbers, np.int32(0))
    every = np.arange(len(cars.ids), dtype=np.int32)
    drawn = replace(
        background,
        lit=pictures[0],
        shaded=pictures[1],
        headlit=pictures[0] if headlit is lit else pictures[2],
        semantics=label(own.tags, own.owners, classes, background.semantics),
        instances=label(own.tags, own.owners, numbers, background.instances),
    )
    parked = Parked(cars, users, canvases[1].count_pixels(users, every))
    return drawn, {factor: target.depths for factor, target in targets.items()}, parked
