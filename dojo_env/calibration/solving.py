"""The camera that fits control points: the maximum a posteriori estimate of its place, direction and lens.

Six points on a road are nearly coplanar, and leave much open. So what holds for nearly every traffic camera
is part of the estimate: pixels are square, the axis meets the middle of the picture, cameras hang nearly
level, 2 to 30 m high, and most lenses see 30 to 110 degrees. Measurements outweigh these priors wherever they
say more.

Source: Hartley and Zisserman, Multiple View Geometry, chapters 5 and 7.
"""

from dataclasses import dataclass, replace
from math import asin, atan2, cos, degrees, log, radians, sin, tan

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.calibration.fitting import (
    BENDS,
    FOCAL,
    HEIGHT,
    ROLL,
    Fit,
    Form,
    Prior,
    Sightings,
    fit_vector,
    measure_cost,
)
from dojo_env.camera import Camera

Floats = NDArray[np.float64]

_FIELDS_OF_VIEW_DEG = (20.0, 30.0, 42.0, 55.0, 70.0, 85.0, 105.0)
"""Where the search begins."""
_TRIED = 3
"""How many of these places, the best ones, are followed to their end."""
_USUAL_HEIGHT, _HEIGHT_SPREAD = 7.5, 0.7
"""Metres, and the standard deviation of the logarithm: 19 of 20 cameras hang 1.9 to 30 m high."""
_USUAL_FIELD_OF_VIEW_DEG, _FOCAL_SPREAD = 60.0, 0.5
"""19 of 20 lenses see 25 to 114 degrees."""
_ROLL_SPREAD = radians(2.0)
_BEND_SPREADS = (0.15, 0.08, 0.04)
_MEASURED_HEIGHT_SPREAD = 0.1
"""Metres, of a height that a user gives."""
_GIVEN_FOCAL_SPREAD = 0.01
"""Of a field of view that a user gives."""
_FREE = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What a user knows of the camera besides the points.

    Attributes:
        noise: standard deviation of the points' pixels, in each direction.
        height: metres above the ground; None where it is not known.
        field_of_view_deg: horizontal; None where it is not known.
        bends: coefficients of the lens to find, 0 to 3; None decides by the number of points.
    """

    noise: float = 2.0
    height: float | None = None
    field_of_view_deg: float | None = None
    bends: int | None = None


def make_prior(form: Form, known: Known) -> Prior:
    """Write down what is believed of a camera.

    Args:
        form: of the vector.
        known: what the user knows; it takes the place of what holds for most cameras.

    Returns:
        (7 + bends,) means and standard deviations; those of place, heading and pitch leave them free.
    """
    means, sigmas = np.zeros(BENDS + form.bends), np.full(BENDS + form.bends, _FREE)
    means[HEIGHT], sigmas[HEIGHT] = log(_USUAL_HEIGHT), _HEIGHT_SPREAD
    if known.height is not None:
        means[HEIGHT], sigmas[HEIGHT] = log(known.height), _MEASURED_HEIGHT_SPREAD / known.height
    field_of_view = known.field_of_view_deg or _USUAL_FIELD_OF_VIEW_DEG
    means[FOCAL] = log(form.template.width / 2 / tan(radians(field_of_view) / 2))
    sigmas[FOCAL] = _GIVEN_FOCAL_SPREAD if known.field_of_view_deg else _FOCAL_SPREAD
    sigmas[ROLL] = _ROLL_SPREAD
    sigmas[BENDS:] = _BEND_SPREADS[: form.bends]
    return Prior(means=means, sigmas=sigmas)


def fit_points(form: Form, places: Floats, pixels: Floats, known: Known) -> Fit:
    """Find the camera that fits points best, from several starts.

    Args:
        form: of the vector.
        places: (n, 3) metres, map frame.
        pixels: (n, 2) where each was marked.
        known: what the user knows, and how well points are marked.

    Returns:
        The vector of least cost, and its covariance.
    """
    prior = make_prior(form, known)
    sightings = Sightings.of_points(places, pixels, known.noise)
    starts = [form.vector(camera) for camera in _list_starts(form, places, pixels)]
    starts.sort(key=lambda start: measure_cost(form, sightings, prior, start))
    starts = starts[:_TRIED]
    return min((fit_vector(form, sightings, prior, start) for start in starts), key=lambda found: found.cost)


def _list_starts(form: Form, places: Floats, pixels: Floats) -> list[Camera]:
    """For each field of view, where a camera with it would hang, as far as there is an answer."""
    middle = places.mean(axis=0)
    starts = []
    for field_of_view in _FIELDS_OF_VIEW_DEG:
        camera = replace(form.template, field_of_view_deg=field_of_view, distortion=())
        found, turns, shifts, _ = cv2.solvePnPGeneric(
            places - middle, pixels, camera.intrinsics, None, flags=cv2.SOLVEPNP_SQPNP
        )
        for turn, shift in zip(turns[:found], shifts[:found], strict=True):
            axes = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
            position = middle - (axes.T @ shift).ravel()
            if np.isfinite(position).all() and np.abs(position).max() < 1e7:
                starts.append(_hang(camera, position, axes))
    return starts or [
        replace(
            form.template,
            position=(
                middle[0] - 20 * cos(heading),
                middle[1] - 20 * sin(heading),
                form.ground + _USUAL_HEIGHT,
            ),
            heading_deg=degrees(heading),
            pitch_deg=-20.0,
            field_of_view_deg=_USUAL_FIELD_OF_VIEW_DEG,
        )
        for heading in np.linspace(0.0, 2 * np.pi, 8, endpoint=False).tolist()
    ]


def _hang(camera: Camera, position: Floats, axes: Floats) -> Camera:
    """Give a camera a place and (3, 3) axes, rows right, down, forward."""
    forward = axes[2]
    level = replace(
        camera,
        position=tuple(position),
        heading_deg=degrees(atan2(forward[1], forward[0])),
        pitch_deg=degrees(asin(min(max(forward[2], -1.0), 1.0))),
    )
    right, down, _ = level.axes
    return replace(level, roll_deg=degrees(atan2(axes[0] @ down, axes[0] @ right)))
