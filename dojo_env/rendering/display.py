"""How people see the outputs of cameras: colours as they are, depths and numbers as colours, side by side."""

from collections.abc import Iterable, Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
_GAP = 4
_NEAREST = 1.0
"""Metres; what is nearer has the same colour."""


def encode_images(images: Iterable[Image]) -> bytes:
    """Put pictures side by side, at most three in a row, as a PNG file.

    Args:
        images: (h, w, 3) uint8 RGB, of any sizes.

    Returns:
        The file's bytes.
    """
    shown = list(images)
    height, width = np.max([image.shape[:2] for image in shown], axis=0) + _GAP
    across = min(len(shown), 2 if len(shown) == 4 else 3)
    page = np.full((-(-len(shown) // across) * height, across * width, 3), 255, np.uint8)
    for k, image in enumerate(shown):
        top, left = k // across * height, k % across * width
        page[top : top + image.shape[0], left : left + image.shape[1]] = image
    return cv2.imencode(".png", page[:-_GAP, :-_GAP, ::-1])[1].tobytes()


def colour_outputs(outputs: Mapping[str, Any]) -> list[Image]:
    """Turn each output of a camera that is an array into a picture.

    Args:
        outputs: (h, w, 3) colours, (h, w) depths in metres or numbers of classes and road users, by name.

    Returns:
        (h, w, 3) uint8 RGB each.
    """
    return [
        _colour(values) for values in outputs.values() if isinstance(values, np.ndarray) and values.ndim > 1
    ]


def _colour(values: NDArray[Any]) -> Image:
    if values.ndim == 3:
        return values
    if values.dtype.kind == "f":
        far = np.log(np.maximum(values, _NEAREST))
        return _mapped(far / max(float(far.max()), 1e-6) * 255, cv2.COLORMAP_VIRIDIS)
    # Neighbouring numbers get colours far apart; 0 is nothing, and black.
    spread = values.astype(np.int64) * 97 % 251 + 4
    picture = _mapped(spread, cv2.COLORMAP_HSV)
    picture[values == 0] = 0
    return picture


def _mapped(values: NDArray[Any], colours: int) -> Image:
    return np.asarray(cv2.applyColorMap(values.astype(np.uint8), colours)[..., ::-1], np.uint8).copy()
