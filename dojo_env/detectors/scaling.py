"""How a picture becomes a network's input, and boxes in the input become boxes in the picture."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.detectors.base import Floats, Image
from dojo_env.errors import ConfigError

_GREY = 114
"""What fills up an input beside a picture of another shape; networks of the YOLO family are trained so."""


class Fit(NamedTuple):
    """Where a picture lies in an input: input = picture * scale + shift, each (x, y)."""

    scale: tuple[float, float]
    shift: tuple[float, float]

    def to_picture(self, boxes: Floats) -> Floats:
        """Turn boxes of the input into boxes of the picture.

        Args:
            boxes: (n, 4) left, top, right and bottom, pixels of the input.

        Returns:
            (n, 4) pixels of the picture, not cut at its edges.
        """
        return (boxes - np.tile(self.shift, 2)) / np.tile(self.scale, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """What a network wants its pictures to be like: (value / 255 - mean) / deviation, at its own size.

    Attributes:
        order: of the channels, `rgb` or `bgr`.
        mean: of each channel in that order, 0 to 1.
        deviation: of each channel; 1 / 255 leaves values of 0 to 255.
        fit: `squash` stretches a picture to the input's shape, `centre` and `corner` keep its own shape and
            put it into the middle or the upper left, with grey around.
    """

    order: str = "rgb"
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    deviation: tuple[float, float, float] = (1.0, 1.0, 1.0)
    fit: str = "squash"

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a name is unknown, or a channel has no numbers.
        """
        for name, known in (("order", ("rgb", "bgr")), ("fit", ("squash", "centre", "corner"))):
            if getattr(self, name) not in known:
                raise ConfigError(f"scaling: {name}={getattr(self, name)!r}; expected {' or '.join(known)}")
        for name in ("mean", "deviation"):
            values = np.array(getattr(self, name), np.float64)
            if (
                values.shape != (3,)
                or not np.isfinite(values).all()
                or (name == "deviation" and not values.all())
            ):
                raise ConfigError(f"scaling: {name}={getattr(self, name)!r}; expected three numbers")

    def place(self, picture: Image, height: int, width: int) -> tuple[Image, Fit]:
        """Resize a picture to an input's size.

        Args:
            picture: (h, w, 3).
            height: of the input, pixels.
            width: of the input, pixels.

        Returns:
            (height, width, 3) uint8, and where the picture lies in it.
        """
        high, wide = picture.shape[:2]
        if self.fit == "squash":
            return _resized(picture, width, height), Fit((width / wide, height / high), (0.0, 0.0))
        ratio = min(width / wide, height / high)
        new = max(1, round(wide * ratio)), max(1, round(high * ratio))
        left, top = ((width - new[0]) // 2, (height - new[1]) // 2) if self.fit == "centre" else (0, 0)
        canvas = np.full((height, width, 3), _GREY, np.uint8)
        canvas[top : top + new[1], left : left + new[0]] = _resized(picture, *new)
        return canvas, Fit((new[0] / wide, new[1] / high), (float(left), float(top)))

    def normalise(self, image: Image) -> NDArray[np.float32]:
        """Give an image the values that the network wants.

        Args:
            image: (h, w, 3) uint8 RGB.

        Returns:
            (h, w, 3) float32, channels in `order`.
        """
        ordered = image if self.order == "rgb" else image[:, :, ::-1]
        slope = np.float32(1 / 255) / np.array(self.deviation, np.float32)
        offset = np.array(self.mean, np.float32) / np.array(self.deviation, np.float32)
        return np.asarray(ordered * slope - offset, np.float32)


def _resized(picture: Image, width: int, height: int) -> Image:
    if picture.shape[:2] == (height, width):
        return picture
    import cv2  # noqa: PLC0415 - OpenCV is large; few need it

    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)
