"""A camera as a vector of numbers, and the vector that fits what was seen, by Levenberg and Marquardt."""

from collections.abc import Callable
from dataclasses import dataclass
from math import atan, degrees, exp, log, radians

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera

Floats = NDArray[np.float64]

HEIGHT, ROLL, FOCAL, BENDS = 2, 5, 6, 7
"""Places in a vector: logarithm of metres above the ground, radians, logarithm of pixels, k1 and on."""
_STEP = 1e-5
"""For differences, in each of a vector's units."""
_MOST_ROUNDS = 60
_CONVERGED = 1e-9
"""Relative gain below which the search ends."""
_FARTHEST = 1e8
"""Metres; a search that goes astray stays among what cameras can be."""
_HIDDEN = 1e3
"""What a place behind the camera counts, standard deviations."""


def find_seen(camera: Camera, places: Floats, margin: float = 0.0) -> tuple[Floats, NDArray[np.bool_]]:
    """Project places and tell which of them the picture shows, as far as nothing is in front.

    A lens formula folds places far outside of the picture back into it; those are not seen.

    Args:
        camera: looks.
        places: (n, 3) metres, map frame.
        margin: pixels along the picture's border that do not count.

    Returns:
        (n, 2) pixels, and (n,) whether they are in the picture.
    """
    pixels, depth = camera.project(places)
    inside = (pixels > margin) & (pixels < [camera.width - margin, camera.height - margin])
    seen = inside.all(axis=1) & (depth > camera.near)
    if camera.distortion:
        k1, k2, _, _, k3 = (*camera.distortion, 0.0)[:5]
        square = ((places - camera.position) ** 2).sum(axis=1) / np.maximum(depth, 1e-9) ** 2 - 1.0
        seen &= 1 + square * (3 * k1 + square * (5 * k2 + square * 7 * k3)) > 0
    return pixels, seen


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """What was measured: lines in the picture that places of the map lie on.

    A control point is two of them, one across and one down; a painted line is one for each of its places.

    Attributes:
        places: (n, 3) metres, map frame.
        pixels: (n, 2) a pixel of each line.
        normals: (n, 2) the unit vector across it.
        sigmas: (n,) standard deviation along `normals`, pixels.
    """

    places: Floats
    pixels: Floats
    normals: Floats
    sigmas: Floats

    @classmethod
    def of_points(cls, places: Floats, pixels: Floats, sigma: float) -> "Sightings":
        """Take control points, each as two sightings: one across and one down.

        Args:
            places: (n, 3) metres, map frame.
            pixels: (n, 2) where each was marked.
            sigma: standard deviation of the marks in each direction, pixels.

        Returns:
            2 n sightings, the two of a point one after the other.
        """
        count = len(places)
        return cls(
            places=np.repeat(places, 2, axis=0),
            pixels=np.repeat(pixels, 2, axis=0),
            normals=np.tile(np.eye(2), (count, 1)),
            sigmas=np.full(2 * count, sigma),
        )

    def joined(self, other: "Sightings") -> "Sightings":
        """Put both together.

        Args:
            other: sightings of the same picture.

        Returns:
            New ones, the other's last.
        """
        return Sightings(
            places=np.vstack([self.places, other.places]),
            pixels=np.vstack([self.pixels, other.pixels]),
            normals=np.vstack([self.normals, other.normals]),
            sigmas=np.append(self.sigmas, other.sigmas),
        )

    def residuals(self, camera: Camera) -> Floats:
        """Tell how far each place is from its line.

        Args:
            camera: through which the places are seen.

        Returns:
            (n,) standard deviations, with their sign; 1000 for places that are not before the camera.
        """
        pixels, _ = camera.project(self.places)
        across = np.einsum("ij,ij->i", self.normals, pixels - self.pixels) / self.sigmas
        return np.nan_to_num(across, nan=_HIDDEN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """What of a camera is free, and how it stands in a vector.

    x, y (metres), logarithm of the height, heading, pitch, roll (radians), logarithm of the focal length
    (pixels), and `bends` coefficients k1, k2, k3 of the lens.

    Attributes:
        template: what is not free.
        ground: metres; heights count from there, so that no camera is below.
        bends: 0 to 3.
    """

    template: Camera
    ground: float
    bends: int

    def camera(self, vector: Floats) -> Camera:
        """Make the camera of a vector.

        Args:
            vector: (7 + bends,) as `Form` tells; a place, height or focal length that no camera can have
                becomes the nearest that one can.

        Returns:
            The camera, with the template's name, size, `near` and `far`.

        Raises:
            ConfigError: a number is not finite, or the lens bends more than a camera's may.
        """
        x, y, height, heading, pitch, roll, focal, *bends = vector.tolist()
        radial = [*bends, 0.0, 0.0, 0.0][:3]
        x, y = (min(max(each, -_FARTHEST), _FARTHEST) for each in (x, y))
        return Camera(
            name=self.template.name,
            position=(x, y, self.ground + exp(min(height, 12.0))),
            heading_deg=degrees(heading),
            pitch_deg=degrees(pitch),
            roll_deg=degrees(roll),
            field_of_view_deg=min(
                max(degrees(2 * atan(self.template.width / 2 / exp(min(focal, 20.0)))), 1.0), 160.0
            ),
            width=self.template.width,
            height=self.template.height,
            near=self.template.near,
            far=self.template.far,
            distortion=(radial[0], radial[1], 0.0, 0.0, radial[2]) if bends else (),
        )

    def vector(self, camera: Camera) -> Floats:
        """Write a camera as a vector.

        Args:
            camera: any; of its lens only the first `bends` of k1, k2 and k3 are written, and a height below
                0.1 m counts as that.

        Returns:
            (7 + bends,) numbers.
        """
        x, y, z = camera.position
        angles = (radians(a) for a in (camera.heading_deg, camera.pitch_deg, camera.roll_deg))
        k1, k2, _, _, k3 = (*camera.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
        return np.array(
            [
                *(x, y, log(max(z - self.ground, 0.1))),
                *angles,
                log(camera.focal_length),
                *(k1, k2, k3)[: self.bends],
            ]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """What is believed before anything is measured: means and standard deviations of a vector's numbers."""

    means: Floats
    sigmas: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The most probable vector.

    Attributes:
        vector: as its `Form` has it.
        cost: the sum of squared residuals, those of the prior, too.
        covariance: (n, n) of the vector, where the standard deviations are right.
    """

    vector: Floats
    cost: float
    covariance: Floats


def fit_vector(form: Form, sightings: Sightings, prior: Prior, start: Floats) -> Fit:
    """Go from a start to the nearest vector that fits best. Source: Marquardt 1963.

    Args:
        form: of the vector.
        sightings: what was measured.
        prior: what is believed.
        start: (n,) where to begin.

    Returns:
        The vector, its cost and its covariance.
    """

    def residuals(vector: Floats) -> Floats:
        return _residuals(form, sightings, prior, vector)

    vector, damping = start, 1e-3
    values = residuals(vector)
    cost = float(values @ values)
    slopes = jacobian(residuals, vector)
    for _ in range(_MOST_ROUNDS):
        normal, gradient = slopes.T @ slopes, slopes.T @ values
        move = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -gradient)
        tried = residuals(vector + move)
        lower = float(tried @ tried)
        if not lower < cost:
            if damping > 1e8:
                break
            damping *= 8.0
            continue
        gain = (cost - lower) / max(cost, 1e-12)
        vector, values, cost, damping = vector + move, tried, lower, max(damping / 6.0, 1e-12)
        slopes = jacobian(residuals, vector)
        if gain < _CONVERGED:
            break
    return Fit(vector=vector, cost=cost, covariance=np.asarray(np.linalg.inv(slopes.T @ slopes), np.float64))


def measure_cost(form: Form, sightings: Sightings, prior: Prior, vector: Floats) -> float:
    """Sum the squared residuals of a vector.

    Args:
        form: of the vector.
        sightings: what was measured.
        prior: what is believed.
        vector: (7 + bends,) the camera to judge.

    Returns:
        The sum over sightings and prior, squared standard deviations.
    """
    values = _residuals(form, sightings, prior, vector)
    return float(values @ values)


def _residuals(form: Form, sightings: Sightings, prior: Prior, vector: Floats) -> Floats:
    return np.concatenate([sightings.residuals(form.camera(vector)), (vector - prior.means) / prior.sigmas])


def jacobian(function: Callable[[Floats], Floats], at: Floats) -> Floats:
    """Differentiate a function of a vector by central differences.

    Args:
        function: takes (n,) and gives m values in any shape.
        at: (n,) where to differentiate.

    Returns:
        (m, n) slopes, a row for each value in the order of its array.
    """
    columns = []
    for k in range(len(at)):
        step = np.zeros(len(at))
        step[k] = _STEP
        columns.append((function(at + step) - function(at - step)).ravel() / (2 * _STEP))
    return np.column_stack(columns)
