"""Lenses that bend: where the rays of a bent picture fall in the straight one that is drawn."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.background import Background
from dojo_env.rendering.view import View

Places = NDArray[np.float32]
Indices = NDArray[np.int32]

_WIDEST = 3.0
"""A bent picture shows at most this many times the straight one's width and height."""


def straightened(camera: Camera, view: View) -> tuple[Places, Places]:
    """Find where in the straight picture the ray of each pixel of the bent one falls. Source: OpenCV calib3d.

    Args:
        camera: its distortion counts.
        view: the camera without it, at as many pixels as the bent picture has.

    Returns:
        (h, w) x and (h, w) y, pixels from the straight picture's upper left corner; they may lie outside of
        it, but within a picture three times as wide and high around it.
    """
    focal, middle_x, middle_y = view.lens[:3]
    matrix = np.array([[focal, 0.0, middle_x], [0.0, focal, middle_y], [0.0, 0.0, 1.0]])
    y, x = np.mgrid[0 : view.height, 0 : view.width].astype(np.float64) + 0.5
    pixels = np.column_stack([x.ravel(), y.ravel()]).reshape(-1, 1, 2)
    straight = cv2.undistortPoints(
        pixels, matrix, np.array(camera.distortion), R=np.eye(3), P=matrix,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-4),
    )  # fmt: skip
    middle = np.array([middle_x, middle_y])
    reach = (_WIDEST - 1) / 2 * np.array([view.width, view.height]) + middle
    places = np.clip(
        np.nan_to_num(straight.reshape(view.height, view.width, 2)), middle - reach, middle + reach
    )
    return places[..., 0].astype(np.float32), places[..., 1].astype(np.float32)


def bend_background(straight: Background, x: Places, y: Places) -> Background:
    """Look at a straight picture through the lens that `straightened` described.

    Args:
        straight: the picture.
        x: (h, w) where the ray of each pixel falls in it, pixels from its left edge.
        y: (h, w) the same from its upper edge.

    Returns:
        The bent picture, (h, w); colours are interpolated, classes and numbers are those of one pixel.
    """
    half = np.float32(0.5)
    lit, shaded, headlit = (
        np.asarray(
            cv2.remap(p, x - half, y - half, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8
        )
        for p in (straight.lit, straight.shaded, straight.headlit)
    )
    places = find_places(x, y, straight.semantics.shape)
    return replace(
        straight,
        lit=lit,
        shaded=shaded,
        headlit=headlit,
        semantics=straight.semantics[places],
        instances=straight.instances[places],
    )


def find_places(x: Places, y: Places, shape: tuple[int, ...]) -> tuple[Indices, Indices]:
    """Find the pixels of a straight picture that hold some places.

    Args:
        x: (h, w) pixels from its left edge.
        y: (h, w) pixels from its upper edge.
        shape: its height and width, pixels.

    Returns:
        (h, w) rows and (h, w) columns; those outside are moved to the edge.
    """
    rows, columns = (np.floor(places).astype(np.int32) for places in (y, x))
    return np.clip(rows, 0, shape[0] - 1), np.clip(columns, 0, shape[1] - 1)
