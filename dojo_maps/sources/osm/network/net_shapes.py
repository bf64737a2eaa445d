"""Shapes as a SUMO network's XML has them, and those of its internal lanes."""

import re
from collections.abc import Mapping

import numpy as np

from dojo_maps.geometry.polylines import Floats

_LANE = re.compile(r'(<lane id="(:[^"]*)"[^>]*? length=")([^"]*)("[^>]*? shape=")([^"]*)(")')

Course = tuple[float, Floats]
"""A lane's length and the (n, 3) corners of its middle, metres."""


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


def read_internal_lanes(text: str) -> dict[str, Course]:
    """Read the courses of a network's internal lanes.

    Args:
        text: the network.

    Returns:
        Courses by the lanes' ids.
    """
    return {found[2]: (float(found[3]), read_shape(found[5])) for found in _LANE.finditer(text)}


def replace_internal_lanes(text: str, courses: Mapping[str, Course]) -> str:
    """Give internal lanes other courses.

    Args:
        text: the network.
        courses: by the lanes' ids; the other lanes keep theirs.

    Returns:
        The network.
    """

    def replaced(found: re.Match[str]) -> str:
        if found[2] not in courses:
            return found[0]
        length, shape = courses[found[2]]
        return f"{found[1]}{length:.2f}{found[4]}{write_shape(shape)}{found[6]}"

    return _LANE.sub(replaced, text) if courses else text
