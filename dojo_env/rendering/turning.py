"""Vehicles on their way round a corner: front wheels that steer, and bodies that bend.

A body is built straight. Where it has joints it is cut; its front wheels are turned; then its sections are
turned one by one, so that each lies along the curve that the whole vehicle is on. Lengths are metres, x is 0
at the nose and points ahead, y to the left. Angles are radians, positive to the left; of each there are t.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.shapes import Part, loft, section

Floats = NDArray[np.float64]
Parts = NDArray[np.uint8]

_RIB = 0.12
"""Metres from rib to rib of bellows, and a fold's depth as a share of it."""
_FOLD = 0.35
_SHARPEST = 0.6
"""Radians; no wheel steers more."""
_TYRE = 0.24
"""A front wheel reaches no further inwards than this, metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """Where a vehicle bends.

    Attributes:
        pivot: metres behind the nose.
        cut: where the section before it ends, and the one behind it begins, metres behind the nose.
        bellows: half width, lower and upper edge of the bellows between them; None for a coupling.
    """

    pivot: float
    cut: tuple[float, float]
    bellows: tuple[float, float, float] | None = None


def steer(triangles: Floats, parts: Parts, axle: float, half: float, radius: float, angles: Floats) -> Floats:
    """Turn the front wheels.

    Args:
        triangles: (n, 3, 3) of the vehicle.
        parts: (n,) what they show.
        axle: of the front wheels, metres behind the nose.
        half: of their outer sides, from the middle, metres.
        radius: of them, metres.
        angles: (t,) of them.

    Returns:
        (t, n, 3, 3) triangles.
    """
    x, y, z = np.moveaxis(triangles, -1, 0)
    near = (abs(x + axle) < radius + 0.02) & (abs(y) > half - _TYRE) & (z < 2 * radius + 0.02)
    wheels = np.isin(parts, (Part.TYRE, Part.CHROME)) & near.all(axis=1)
    frames = _frames(np.clip(angles, -_SHARPEST, _SHARPEST))
    turned = np.repeat(triangles[None], len(angles), axis=0)
    for side in (1.0, -1.0):
        own = wheels & (y[:, 0] * side > 0.0)
        pivot = np.array([-axle, side * (half - 0.5 * _TYRE), 0.0])
        turned[:, own] = np.einsum("tij,nkj->tnki", frames, triangles[own] - pivot) + pivot
    return turned


def cut_apart(
    triangles: Floats, parts: Parts, joints: Sequence[Joint]
) -> tuple[Floats, Parts, NDArray[np.intp]]:
    """Cut a vehicle at its joints.

    Args:
        triangles: (n, 3, 3) of the straight vehicle.
        parts: (n,) what they show.
        joints: where it bends, from the nose; what lies between the two places of a cut is left out.

    Returns:
        (m, 3, 3) triangles, (m,) what they show, and (m,) the section of each, 0 at the nose.
    """
    edges = [np.inf, *(-place for joint in joints for place in joint.cut), -np.inf]
    x = triangles[..., 0]
    pieces: list[Floats] = []
    shown: list[Parts] = []
    for front, rear in zip(edges[::2], edges[1::2], strict=True):
        whole = ((x <= front) & (x >= rear)).all(axis=1)
        cut = ~whole & (x < front).any(axis=1) & (x > rear).any(axis=1)
        extra = [_fan(_clip(_clip(each, front, 1.0), rear, -1.0)) for each in triangles[cut]]
        pieces.append(np.concatenate([triangles[whole], *extra]))
        shown.append(np.concatenate([parts[whole], np.repeat(parts[cut], [len(each) for each in extra])]))
    sections = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
    return np.concatenate(pieces), np.concatenate(shown), sections


def bend(
    triangles: Floats, sections: NDArray[np.intp], length: float, joints: Sequence[Joint], turns: Floats
) -> tuple[Floats, int]:
    """Turn the sections of a vehicle.

    Args:
        triangles: (t, n, 3, 3) straight.
        sections: (n,) of each.
        length: of the vehicle, metres.
        joints: where it bends, from the nose.
        turns: (t,) how far the road at the nose has turned from the line between nose and tail.

    Returns:
        (t, n + b, 3, 3) triangles, and b, how many of them, the last ones, are bellows.
    """
    frames, pivots = _lay(length, joints, turns)
    bent = triangles.copy()
    for k, begin in enumerate([0.0, *(joint.pivot for joint in joints)]):
        own = triangles[:, sections == k] + [begin, 0.0, 0.0]
        bent[:, sections == k] = np.einsum("tij,tnkj->tnki", frames[k], own) + pivots[:, k, None, None]
    bellows = [np.empty((len(turns), 0, 3, 3))]
    for k, joint in enumerate(joints):
        if joint.bellows is not None:
            pairs = zip(pivots[:, k + 1], frames[k], frames[k + 1], strict=True)
            bellows.append(np.array([_fold(joint, *pair) for pair in pairs]))
    folds = np.concatenate(bellows, axis=1)
    return np.concatenate([bent, folds], axis=1), folds.shape[1]


def footprints(length: float, joints: Sequence[Joint], turns: Floats) -> Floats:
    """Tell where the sections of a vehicle stand.

    Args:
        length: of the vehicle, metres.
        joints: where it bends, from the nose.
        turns: (t,) how far the road at the nose has turned from the line between nose and tail.

    Returns:
        (t, sections, 2, 2) x and y of the front and rear end of each, metres.
    """
    _, pivots = _lay(length, joints, turns)
    return np.stack([pivots[:, :-1, :2], pivots[:, 1:, :2]], axis=2)


def _lay(length: float, joints: Sequence[Joint], turns: Floats) -> tuple[list[Floats], Floats]:
    """Lay sections along a curve: axes of each, (t, 3, 3), and nose, pivots, tail, (t, sections + 1, 3)."""
    places = [0.0, *(joint.pivot for joint in joints), length]
    # On a circle the direction changes evenly from the nose to the tail.
    frames = [_frames(turns * (1.0 - (a + b) / length)) for a, b in pairwise(places)]
    steps = [frame[:, :, 0] * (b - a) for frame, (a, b) in zip(frames, pairwise(places), strict=True)]
    pivots = -np.cumsum([np.zeros((len(turns), 3)), *steps], axis=0)
    return frames, np.moveaxis(pivots, 0, 1)


def _frames(headings: Floats) -> Floats:
    """Axes of what turns by each heading: (t, 3, 3)."""
    cos, sin, none, one = np.cos(headings), np.sin(headings), np.zeros(len(headings)), np.ones(len(headings))
    rows = [cos, -sin, none], [sin, cos, none], [none, none, one]
    return np.moveaxis(np.array(rows), -1, 0)


def _fold(joint: Joint, pivot: Floats, front: Floats, rear: Floats) -> Floats:
    """Join two sections, whose axes are given, by folds around a pivot: (b, 3, 3) triangles."""
    half, low, high = joint.bellows or (0.0, 0.0, 0.0)
    ahead, behind = (
        section(joint.pivot - cut, half, low, high) @ frame.T + pivot
        for cut, frame in zip(joint.cut, (front, rear), strict=True)
    )
    count = 2 * max(1, round((joint.cut[1] - joint.cut[0]) / _RIB / 2))
    rings = []
    for k in range(count + 1):
        ring = ahead + (behind - ahead) * k / count
        middle = ring.mean(axis=0)
        rings.append(middle + (ring - middle) * (1.0 - (k % 2) * _FOLD * _RIB / half))
    return np.concatenate([_fan(corners) for corners, _ in loft(rings, Part.TRIM)])


def _fan(polygon: Floats) -> Floats:
    """Cut a convex polygon into triangles: (n - 2, 3, 3)."""
    return np.array([polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)]).reshape(-1, 3, 3)


def _clip(polygon: Floats, x: float, side: float) -> Floats:
    """Cut a convex polygon at x, and keep what lies behind it, for `side` 1, or before it, for -1."""
    out = side * (polygon[:, 0] - x)
    if (out <= 0.0).all():
        return polygon
    kept = []
    for k in range(len(polygon)):
        a, b, here, there = polygon[k - 1], polygon[k], out[k - 1], out[k]
        if (here <= 0.0) != (there <= 0.0):
            kept.append(a + (b - a) * here / (here - there))
        if there <= 0.0:
            kept.append(b)
    return np.array(kept).reshape(-1, 3)
