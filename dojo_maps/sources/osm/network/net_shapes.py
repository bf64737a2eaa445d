"""Shapes as a SUMO network's XML has them."""

import numpy as np

from dojo_maps.geometry.polylines import Floats


def read_shape(text: str) -> Floats:
    """Read a shape.

    Args:
        text: corners, a blank between each two, as `x,y` or `x,y,z`.

    Returns:
        (n, 3), metres; a height that is left out is 0.
    """
    corners = [[float(value) for value in corner.split(",")] for corner in text.split()]
    # netconvert leaves out heights of 0.
    return np.array([[*corner, 0.0][:3] for corner in corners])


def write_shape(shape: Floats) -> str:
    """Write a shape to the centimetre.

    Args:
        shape: (n, 3), metres.

    Returns:
        The text that a network has; without heights where all are 0.
    """
    size = 3 if shape[:, 2].any() else 2
    return " ".join(",".join(f"{value:.2f}" for value in row) for row in shape[:, :size])
