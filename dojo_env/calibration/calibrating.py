"""From control points, and the photograph they were marked in, to a camera and how far it can be trusted."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dojo_env.calibration.fitting import Fit, Form, Sightings, find_seen, jacobian
from dojo_env.calibration.paint import Edges, Sharpened, sharpen
from dojo_env.calibration.points import LEAST, ControlPoints
from dojo_env.calibration.solving import Known, fit_points, make_prior
from dojo_env.camera import Camera
from dojo_env.errors import CalibrationError

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

_BENT_FROM = 8
"""Points from which on a lens is found as a bent one, unless the user says otherwise."""
_LIMIT = 3.1
"""Standard deviations, of the cost's own spread, that one set of points in a thousand exceeds."""
_SUSPECTS, _MOST_WRONG = 8, 1 / 3
"""How many points are tried to be left out at a time, and the share of them all that may be wrong."""
_HOPELESS = 12.0
"""Times the expected misfit from which on there is no camera to speak of."""
_SEEN = 0.35
"""Share of the paint in view that must lie where the camera says, for a photograph to have a say.

In pictures of cologne1 0.56 and more is found, with trees in front; in those of another place up to 0.21.
"""
_WITHIN_95 = 5.991
"""Squared radius, in standard deviations, of the ellipse that holds 95 % of a plane's normal distribution."""
_ARC = np.radians(np.arange(-80.0, 80.1, 0.5))


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundError:
    """How far off a place on the ground may be, at a distance from the camera.

    Attributes:
        distance: level, metres.
        middle: half axes of the ellipse that holds it with 95 %, where that distance crosses the picture's
            middle, metres, the longer one first.
        worst: the longest half axis anywhere in the picture at that distance, metres.
    """

    distance: float
    middle: tuple[float, float]
    worst: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """A camera found.

    Attributes:
        camera: the most probable one.
        points: that it was found from.
        misfits: (n, 2) pixels, where the camera puts each point minus where it was marked.
        wrong: what was left out as wrong: label, and how far off it is, pixels.
        form: how the camera is a vector of numbers.
        fit: the vector and its covariance.
        paint: what the photograph's painted lines said; None where they were not asked, or did not fit.
        paint_share: of the paint in view, what was found where the camera says; None where it was not asked.
    """

    camera: Camera
    points: ControlPoints
    misfits: Floats
    wrong: tuple[tuple[str, float], ...]
    form: Form
    fit: Fit
    paint: Sharpened | None
    paint_share: float | None

    def deviations(self) -> Floats:
        """Give standard deviations: x, y, height (m), heading, pitch, roll, view (degrees), k1 and on."""
        scales = np.ones(len(self.fit.vector))
        scales[2] = self.camera.position[2] - self.form.ground
        scales[3:6] = np.degrees(1.0)
        opening = np.radians(self.camera.field_of_view_deg)
        scales[6] = np.degrees(np.sin(opening))
        return np.sqrt(np.diag(self.fit.covariance)) * scales

    def ground_error(self, distance: float) -> GroundError | None:
        """Tell how far off places on the ground are at a distance.

        Args:
            distance: from the camera, level, metres.

        Returns:
            The errors with 95 % confidence; None where the picture shows no ground at that distance.
        """
        heading = np.radians(self.camera.heading_deg)
        arc = np.column_stack(
            [
                self.camera.position[0] + distance * np.cos(heading + _ARC),
                self.camera.position[1] + distance * np.sin(heading + _ARC),
                np.full(len(_ARC), self.form.ground),
            ]
        )
        pixels, seen = find_seen(self.camera, arc)
        if not seen.any():
            return None
        axes = _WITHIN_95**0.5 * np.sqrt(np.linalg.eigvalsh(self.ground_covariance(arc[seen])))
        middle = int(np.argmin(np.abs(pixels[seen, 0] - self.camera.width / 2)))
        return GroundError(
            distance=distance,
            middle=(float(axes[middle, 1]), float(axes[middle, 0])),
            worst=float(axes[:, 1].max()),
        )

    def ground_covariance(self, places: Floats) -> Floats:
        """Tell how places found on the ground by their pixels scatter, as the camera is not known exactly.

        Args:
            places: (n, 3) metres, map frame, on the ground and before the camera.

        Returns:
            (n, 2, 2) covariances of x and y, square metres.
        """
        count, vector = len(places), self.fit.vector
        by_camera = jacobian(lambda v: self.form.camera(v).project(places)[0], vector).reshape(count, 2, -1)
        shifts = np.eye(3)[:2] * 1e-3
        by_place = np.stack(
            [
                (self.camera.project(places + shift)[0] - self.camera.project(places - shift)[0]) / 2e-3
                for shift in shifts
            ],
            axis=2,
        )
        moves = np.linalg.solve(by_place, by_camera)
        return moves @ self.fit.covariance @ moves.transpose(0, 2, 1)


def calibrate(
    points: ControlPoints,
    template: Camera,
    known: Known,
    *,
    photograph: Image | None = None,
    edges: Edges | None = None,
) -> Calibration:
    """Find the camera that points were seen through.

    Args:
        points: at least six.
        template: name, width and height of the camera.
        known: what else is known of it.
        photograph: (h, w, 3) uint8 RGB, to sharpen the camera by the road's paint; None leaves that out.
        edges: of that paint.

    Returns:
        The camera, and how far it can be trusted.

    Raises:
        CalibrationError: the points do not determine a camera, or do not fit each other.
    """
    points.check(template.width, template.height)
    bends = known.bends if known.bends is not None else int(len(points) >= _BENT_FROM)
    form = Form(template=template, ground=points.ground, bends=bends)
    points, fit, wrong = _leave_out_wrong(form, points, known)
    scale = float(np.sqrt(fit.cost / _freedom(points)))
    if scale > _HOPELESS:
        raise CalibrationError(
            points.path,
            f"no camera fits the points: they are off by {_typical(form, fit, points):.0f} px; "
            "see that photograph and map show one place, and that u counts from the left, v from the top",
        )
    fit = replace(fit, covariance=fit.covariance * max(scale, 1.0) ** 2)
    paint = share = None
    if photograph is not None and edges is not None:
        paint = _sharpen(form, points, known, fit, photograph, edges)
        share = paint.share
        if _agrees(paint, form, points, known):
            fit = paint.fit
        else:
            paint = None
    camera = _rounded(form.camera(fit.vector))
    return Calibration(
        camera=camera,
        points=points,
        misfits=camera.project(points.places)[0] - points.pixels,
        wrong=wrong,
        form=form,
        fit=fit,
        paint=paint,
        paint_share=share,
    )


def _leave_out_wrong(
    form: Form, points: ControlPoints, known: Known
) -> tuple[ControlPoints, Fit, tuple[tuple[str, float], ...]]:
    """Fit, without points that the others contradict, as long as enough are left.

    Where leaving some out does not make the others agree, all are kept: it is not a matter of single points.
    """
    every, all_fit = points, fit_points(form, points.places, points.pixels, known)
    wrong: list[tuple[str, float]] = []
    fit = all_fit
    while not _is_usual(fit.cost, _freedom(points)):
        number, fewer, fit = _leave_one_out(form, points, fit, known)
        at = form.camera(fit.vector).project(points.places[[number]])[0][0]
        wrong.append((points.labels[number], float(np.hypot(*(at - points.pixels[number])))))
        usual = _is_usual(fit.cost, _freedom(fewer))
        if usual and len(fewer) < LEAST:
            label, off = wrong[-1]
            problem = f"it is off by {off:.0f} px, if the others are right; correct it, or give more points"
            raise CalibrationError(points.path, problem, label)
        if not usual and (len(fewer) <= LEAST or len(wrong) >= _MOST_WRONG * len(every)):
            return every, all_fit, ()
        points = fewer
    return points, fit, tuple(wrong)


def _leave_one_out(
    form: Form, points: ControlPoints, fit: Fit, known: Known
) -> tuple[int, ControlPoints, Fit]:
    """Find the point without which the others agree best, among those that are off the most."""
    off = points.pixels - form.camera(fit.vector).project(points.places)[0]
    worst = np.argsort(-np.nan_to_num(np.hypot(*off.T), nan=np.inf))[:_SUSPECTS].tolist()
    tries = [(number, points.without(number)) for number in worst]
    fits = [fit_points(form, fewer.places, fewer.pixels, known) for _, fewer in tries]
    best = int(np.argmin([each.cost for each in fits]))
    return *tries[best], fits[best]


def _freedom(points: ControlPoints) -> int:
    """Two measurements a point, and priors for all but four of the camera's numbers."""
    return 2 * len(points) - 4


def _is_usual(cost: float, freedom: int) -> bool:
    """Tell whether such a sum of squared deviations is to be expected. Source: Wilson and Hilferty 1931."""
    spread = 2.0 / (9.0 * freedom)
    return cost <= freedom * (1.0 - spread + _LIMIT * spread**0.5) ** 3


def _typical(form: Form, fit: Fit, points: ControlPoints) -> float:
    off = form.camera(fit.vector).project(points.places)[0] - points.pixels
    return float(np.nanmedian(np.hypot(*off.T)))


def _sharpen(
    form: Form, points: ControlPoints, known: Known, fit: Fit, photograph: Image, edges: Edges
) -> Sharpened:
    sightings = Sightings.of_points(points.places, points.pixels, known.noise)
    return sharpen(form, sightings, make_prior(form, known), fit, photograph, edges)


def _agrees(paint: Sharpened, form: Form, points: ControlPoints, known: Known) -> bool:
    """Tell whether most of the paint was found, and the points lie as near to the camera as before."""
    sightings = Sightings.of_points(points.places, points.pixels, known.noise)
    off = sightings.residuals(form.camera(paint.fit.vector))
    return paint.share >= _SEEN and _is_usual(float(off @ off), len(off))


def _rounded(camera: Camera) -> Camera:
    """Leave out digits that nobody measured."""
    x, y, z = camera.position
    return replace(
        camera,
        position=(round(x, 4), round(y, 4), round(z, 4)),
        **{
            name: round(getattr(camera, name), 5)
            for name in ("heading_deg", "pitch_deg", "roll_deg", "field_of_view_deg")
        },
        distortion=tuple(round(each, 6) for each in camera.distortion),
    )
