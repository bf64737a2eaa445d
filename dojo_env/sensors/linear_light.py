"""Pictures as the light that makes them: sums, shares and gains hold for it, not for sRGB's bytes."""

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.lighting import SRGB, to_linear

Light = NDArray[np.float32]
Picture = NDArray[np.uint8]

_LINEAR = to_linear(np.arange(256, dtype=np.uint8)).astype(np.float32)
_WHITE = np.float32(len(SRGB) - 1)


def to_light(rgb: Picture) -> Light:
    """Turn a picture into linear light from 0 to 1: (h, w, 3)."""
    return np.asarray(cv2.LUT(rgb, _LINEAR), dtype=np.float32)


def to_picture(light: Light) -> Picture:
    """Turn linear light into a picture (h, w, 3); what is above 1 is white."""
    return SRGB[np.clip(light * _WHITE + np.float32(0.5), 0, _WHITE).astype(np.uint16)]
