"""The road's paint in a photograph: where the edges of lines, stripes and arrows lie, to sharpen a camera.

A click on a corner is good to a pixel or two. A painted edge of the map that runs through the picture is good
to a fraction of one at each of its places, and there are hundreds of these. Each place is projected through
the camera found so far, and the picture is searched across the edge for where bright turns to dark.

Source: Harris and Stennett, RAPID, a video rate object tracker, 1990; its robust form: Drummond and Cipolla,
Real-time visual tracking of complex structures, 2002.
"""

from dataclasses import dataclass, fields, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.calibration.fitting import Fit, Form, Prior, Sightings, find_seen, fit_vector, jacobian
from dojo_env.camera import Camera
from dojo_maps.bundle import Bundle

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

_LAYERS = ("marking", "crossing", "stop_line", "arrow")
_SPACING = 0.25
"""Metres from place to place along an edge."""
_SHORTEST = 0.08
"""Metres; a dash is 0.12 m wide, and its ends tell how far along the road it lies."""
_REACH = 90.0
"""Metres from the camera beyond which paint is too small to be told from noise."""
_THINNEST = 1.0
"""Pixels that the paint must show behind its edge."""
_INWARD = 0.12
"""Metres; what `_THINNEST` is measured on: the width of a line."""
_SMALLEST_TURN = 3.0
"""Grey levels per pixel from which on a turn from bright to dark is an edge."""
_RIVAL = 0.5
"""An edge is taken where no other in reach is more than this share as strong."""
_WIDEST, _NARROWEST = 24.0, 2.5
"""Bounds of the search to either side, pixels."""
_STEP = 0.5
_BLUR = 0.8
"""Pixels between places of the search, and the deviation by which noise is blurred first."""
_MOST_PLACES = 6000
_ROUNDS = 6
_SIGMA = 0.5
"""Pixels, of a clean edge."""
_INDEPENDENT = 4
"""Measurements that one edge counts for, however long: its places err together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Edges:
    """Places along the edges of all paint.

    Attributes:
        places: (n, 3) metres, map frame.
        along: (n, 3) unit vectors.
        inward: (n, 3) unit vectors to where the paint is.
        edge: (n,) which edge each place is on.
        length: (n,) metres, of that edge.
    """

    places: Floats
    along: Floats
    inward: Floats
    edge: NDArray[np.int64]
    length: Floats

    def near(self, position: tuple[float, float, float]) -> "Edges":
        """Keep those within reach of a camera.

        Args:
            position: of the camera, metres, map frame; its height does not count.

        Returns:
            The places less than 90 m away.
        """
        close = np.hypot(*(self.places[:, :2] - position[:2]).T) < _REACH
        return Edges(**{each.name: getattr(self, each.name)[close] for each in fields(self)})


def list_edges(bundle: Bundle) -> Edges:
    """Outline the paint of a map: lines, crossings, stop lines and arrows.

    Args:
        bundle: the map.

    Returns:
        Places 0.25 to 0.5 m apart along all edges, but those shorter than 0.08 m.

    Raises:
        DescriptionError: the bundle's scene is missing or broken.
    """
    starts, ends, insides = [np.empty((0, 3))], [np.empty((0, 3))], [np.empty((0, 3))]
    shift = np.array([*bundle.road_map.origin, 0.0])
    for mesh in bundle.read_meshes():
        if mesh.layer in _LAYERS:
            for parts, found in zip(
                (starts, ends, insides), _outline(mesh.vertices + shift, mesh.faces), strict=True
            ):
                parts.append(found)
    start, end, inside = (np.concatenate(parts) for parts in (starts, ends, insides))
    length = np.linalg.norm(end - start, axis=1)
    kept = length > _SHORTEST
    start, end, inside, length = start[kept], end[kept], inside[kept], length[kept]
    along = (end - start) / length[:, None]
    inward = inside - start
    inward -= np.einsum("ij,ij->i", inward, along)[:, None] * along
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    count = np.maximum(length / _SPACING, 1.0).astype(int)
    edge = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    at = (number + 0.5) / count[edge] * length[edge]
    return Edges(
        places=start[edge] + at[:, None] * along[edge],
        along=along[edge],
        inward=inward[edge],
        edge=edge,
        length=length[edge],
    )


def _outline(vertices: Floats, faces: NDArray[np.int64]) -> tuple[Floats, Floats, Floats]:
    """Find the sides that belong to one face alone: their ends, and the third corner of the face."""
    _, same = np.unique(np.round(vertices, 3), axis=0, return_inverse=True)
    same = same.ravel()
    sides = np.concatenate([faces[:, [0, 1, 2]], faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]])
    low, high = np.sort(same[sides[:, :2]], axis=1).T
    _, which, count = np.unique(low * len(vertices) + high, return_inverse=True, return_counts=True)
    alone = sides[count[which.ravel()] == 1]
    return vertices[alone[:, 0]], vertices[alone[:, 1]], vertices[alone[:, 2]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sharpened:
    """A camera that fits points and paint.

    Attributes:
        fit: the camera.
        paint: what was found of the paint.
        share: of the places in view, those found where the camera says.
    """

    fit: Fit
    paint: Sightings
    share: float


def sharpen(form: Form, points: Sightings, prior: Prior, fit: Fit, picture: Image, edges: Edges) -> Sharpened:
    """Fit a camera to the paint in its picture, beginning with what the points say.

    Args:
        form: of the vector.
        points: the control points.
        prior: what is believed.
        fit: the camera that fits the points.
        picture: (h, w, 3) uint8 RGB.
        edges: of the map's paint.

    Returns:
        The camera that fits both, and what was found of the paint; the caller judges whether that is enough.
    """
    grey = np.asarray(cv2.GaussianBlur(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), (0, 0), _BLUR), np.float32)
    edges = edges.near(form.camera(fit.vector).position)
    found, share = points, 0.0
    for _ in range(_ROUNDS):
        seen, edge = _look(form.camera(fit.vector), edges)
        found, edge = _search(grey, seen, edge, _reaches(form, fit, seen))
        for _ in range(3):
            robust = _weigh(found, edge, form.camera(fit.vector))
            fit = fit_vector(form, points.joined(robust), prior, fit.vector)
        off = np.abs(found.residuals(form.camera(fit.vector)))
        share = float((off < 1.5).sum() / max(len(seen.pixels), 1))
    return Sharpened(fit=fit, paint=found, share=share)


def _look(camera: Camera, edges: Edges) -> tuple[Sightings, NDArray[np.int64]]:
    """Find where edges fall in a picture, with the vectors out of the paint; returns their numbers, too."""
    at, good = find_seen(camera, edges.places, _WIDEST)
    along = camera.project(edges.places + _INWARD * edges.along)[0] - at
    behind = camera.project(edges.places + _INWARD * edges.inward)[0] - at
    across = np.column_stack([-along[:, 1], along[:, 0]])
    with np.errstate(invalid="ignore"):
        stretch = np.linalg.norm(across, axis=1)
        across /= stretch[:, None]
        thickness = np.einsum("ij,ij->i", across, behind)
        good &= (np.abs(thickness) > _THINNEST) & (stretch / _INWARD * edges.length > _THINNEST)
    chosen = np.flatnonzero(good)
    chosen = chosen[:: len(chosen) // _MOST_PLACES + 1]
    normals = -across[chosen] * np.sign(thickness[chosen])[:, None]
    seen = Sightings(
        places=edges.places[chosen], pixels=at[chosen], normals=normals, sigmas=np.ones(len(chosen))
    )
    return seen, edges.edge[chosen]


def _reaches(form: Form, fit: Fit, seen: Sightings) -> Floats:
    """How far an edge may lie from where the camera says, by the camera's covariance: (n,) pixels."""
    slopes = jacobian(lambda vector: seen.residuals(form.camera(vector)), fit.vector)
    deviation = np.sqrt(np.einsum("ij,jk,ik->i", slopes, fit.covariance, slopes))
    return np.clip(3.0 * deviation, _NARROWEST, _WIDEST)


def _search(
    grey: NDArray[np.float32], seen: Sightings, edge: NDArray[np.int64], reaches: Floats
) -> tuple[Sightings, NDArray[np.int64]]:
    """Find the one strong turn from bright to dark on the way out of the paint, where there is one."""
    offsets = np.arange(-_WIDEST, _WIDEST + _STEP, _STEP)
    ways = (seen.pixels[:, None] + offsets[:, None] * seen.normals[:, None] - 0.5).astype(np.float32)
    values = cv2.remap(grey, ways[..., 0], ways[..., 1], cv2.INTER_LINEAR)
    fall = np.zeros_like(values)
    fall[:, 1:-1] = (values[:, :-2] - values[:, 2:]) / (2 * _STEP)
    fall[np.abs(offsets) > reaches[:, None]] = 0.0
    peak = (fall[:, 1:-1] >= fall[:, :-2]) & (fall[:, 1:-1] > fall[:, 2:]) & (fall[:, 1:-1] > _SMALLEST_TURN)
    heights = np.where(peak, fall[:, 1:-1], 0.0)
    two = np.sort(heights, axis=1)[:, -2:]
    rows = np.flatnonzero((two[:, 1] > 0) & (two[:, 0] < _RIVAL * two[:, 1]))
    best = heights[rows].argmax(axis=1) + 1
    left, middle, right = (fall[rows, best + k] for k in (-1, 0, 1))
    shift = offsets[best] + _STEP * 0.5 * (left - right) / np.minimum(left - 2 * middle + right, -1e-6)
    found = Sightings(
        places=seen.places[rows],
        pixels=seen.pixels[rows] + shift[:, None] * seen.normals[rows],
        normals=seen.normals[rows],
        sigmas=np.ones(len(rows)),
    )
    return found, edge[rows]


def _weigh(found: Sightings, edge: NDArray[np.int64], camera: Camera) -> Sightings:
    """Trust what lies far from the others less, and no edge more for being long. Source: Cauchy's weights."""
    if not len(edge):
        return found
    off = found.residuals(camera)
    spread = max(_SIGMA, 1.48 * float(np.median(np.abs(off))))
    _, which, count = np.unique(edge, return_inverse=True, return_counts=True)
    together = np.maximum(count[which] / _INDEPENDENT, 1.0)
    return replace(found, sigmas=spread * np.sqrt(together * (1.0 + (off / spread) ** 2)))
