"""Lenses that bend: where the rays of a bent picture fall in the straight one that is drawn."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.background import Background
from dojo_env.rendering.view import View

Places = NDArray[np.float32]

_WIDEST = 3.0
"""A bent picture shows at most this many times the straight one's width and height."""


def straightened(camera: Camera, view: View) -> tuple[Places, Places]:
    """For each pixel of the bent picture, where in the straight one its ray falls. Source: OpenCV calib3d."""
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
    """Look at a straight picture through the lens that `straightened` described."""
    half = np.float32(0.5)
    lit, shaded, headlit = (
        np.asarray(
            cv2.remap(p, x - half, y - half, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8
        )
        for p in (straight.lit, straight.shaded, straight.headlit)
    )
    rows = np.clip(np.floor(y).astype(np.intp), 0, straight.depths.shape[0] - 1)
    columns = np.clip(np.floor(x).astype(np.intp), 0, straight.depths.shape[1] - 1)
    return replace(
        straight,
        lit=lit,
        shaded=shaded,
        headlit=headlit,
        depths=straight.depths[rows, columns],
        semantics=straight.semantics[rows, columns],
        instances=straight.instances[rows, columns],
    )
