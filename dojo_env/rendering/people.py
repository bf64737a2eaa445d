"""Bodies of people: rounded torso, head and limbs, bent at hips, knees, shoulders and elbows into poses.

Whoever walks goes through poses by the distance walked, so that a foot on the ground stays where it is. All
poses of somebody are built at once, for they have the same faces: arrays of corners begin with the poses, p.
Lengths are metres of somebody 1.75 m tall; x points ahead, y to the left, z up; the hips are over the origin.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.shapes import Face, Part, loft_rings, tube

Floats = NDArray[np.float64]
Point = tuple[float, float, float]

TALL = 1.75
"""Metres; all lengths are of somebody as tall as this."""
PACE = 1.26
"""Metres walked with a left and a right step."""
_FAR, _COARSEST = 2, 3
"""Levels of detail with fewer parts."""
_THIGH, _SHANK, _UPPER_ARM, _FOREARM = 0.43, 0.42, 0.29, 0.27
_HIP, _SHOULDER = 0.09, 0.19
"""Half of the distance between the joints."""
_SHOULDERS, _NECK = 0.49, 0.57
"""Heights over the hips."""
_ANKLE, _HEAD = 0.08, 0.25
_STANCE = 0.6
"""Share of the pace for which a foot is on the ground."""
_TORSO_SIDES, _HEAD_SIDES, _LEG_SIDES, _ARM_SIDES = (10, 7, 5), (10, 6, 4), (8, 5, 3), (7, 4, 3)
"""By level of detail."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How somebody is built and dressed.

    Attributes:
        height: metres.
        broad: width of shoulders and chest, as a share of the usual.
        head: size of the head, as a share of the usual.
        long_hair: it falls to the shoulders.
        bare_arms: short sleeves.
        skirt: instead of trousers.
        coat: it reaches the knees.
        bag: carried on the back.
        helmet: over the hair.
        face: part that it shows; the glass of a visor, for one.
        top: part that the clothes over the hips show.
    """

    height: float = TALL
    broad: float = 1.0
    head: float = 1.0
    long_hair: bool = False
    bare_arms: bool = False
    skirt: bool = False
    coat: bool = False
    bag: bool = False
    helmet: bool = False
    face: Part = Part.SKIN
    top: Part = Part.BODY


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where somebody's hips, feet and hands are; left before right.

    Attributes:
        hips: x and z.
        ankles: x, y and z of each.
        hands: x, y and z of each.
        lean: how far the back is bent forward, radians.
        tips: how far each foot's tip is raised, radians.
    """

    hips: tuple[float, float]
    ankles: tuple[Point, Point]
    hands: tuple[Point, Point]
    lean: float = 0.0
    tips: tuple[float, float] = (0.0, 0.0)


STANDING = Pose(
    hips=(0.0, 0.915),
    ankles=((0.02, 0.1, _ANKLE), (-0.03, -0.1, _ANKLE)),
    hands=((0.06, 0.25, 0.87), (0.04, -0.25, 0.87)),
)


def walking(share: float) -> Pose:
    """Find the pose after a share of a pace: the left foot touches the ground at 0, the right one at 0.5.

    Args:
        share: of `PACE`; beyond 1 the next pace begins.

    Returns:
        The pose, metres of somebody as tall as `TALL`.
    """
    left, right = _step(share), _step(share + 0.5)
    hips = (0.0, 0.895 - 0.02 * cos(4 * pi * share))
    swing = 0.42 * cos(2 * pi * share)
    hands = tuple(
        (0.53 * sin(turn) + 0.05, y, hips[1] + 0.45 - 0.53 * cos(turn) + 0.05 * max(0.0, turn))
        for turn, y in ((-swing, 0.25), (swing, -0.25))
    )
    return Pose(
        hips=hips,
        lean=0.04,
        ankles=((left[0], 0.085, left[1]), (right[0], -0.085, right[1])),
        tips=(left[2], right[2]),
        hands=(hands[0], hands[1]),
    )


def _step(share: float) -> tuple[float, float, float]:
    """Find a foot's x, the ankle's height and the tip's angle; it touches the ground at 0."""
    share %= 1.0
    ahead, behind = 0.5 * _STANCE * PACE, -0.5 * _STANCE * PACE
    if share < _STANCE:
        rolled = max(0.0, share / _STANCE - 0.6) / 0.4
        touched = max(0.0, 1.0 - share / (0.2 * _STANCE))
        return ahead - share * PACE, _ANKLE + 0.1 * rolled**2, 0.3 * touched - 0.6 * rolled**2
    swung = (share - _STANCE) / (1.0 - _STANCE)
    eased = swung * swung * (3.0 - 2.0 * swung)
    lift = 0.1 * (1.0 - eased) + 0.09 * sin(pi * swung)
    return behind + (ahead - behind) * eased, _ANKLE + lift, -0.6 + 0.9 * eased


def under_umbrella(pose: Pose) -> Pose:
    """Raise the right hand to hold an umbrella.

    Args:
        pose: of somebody whose right hand is free; the rest of it stays.

    Returns:
        The pose with that hand before the chest.
    """
    return replace(pose, hands=(pose.hands[0], (0.22, -0.2, pose.hips[1] + 0.31)))


def pushing(pose: Pose) -> Pose:
    """Put both hands on the handle of a pram.

    Args:
        pose: of somebody on foot; the rest of it stays.

    Returns:
        The pose with both hands 1 m above the ground, where `build_pram` has the handle.
    """
    return replace(pose, hands=((0.32, 0.2, 1.0), (0.32, -0.2, 1.0)))


@dataclass(frozen=True, slots=True)
class _Poses:
    """Poses as arrays; what `Pose` says of left and right is (p, 2, ...)."""

    hips: Floats
    ankles: Floats
    hands: Floats
    lean: Floats
    tips: Floats

    def bend(self, points: Sequence[Point] | Floats) -> Floats:
        """Bring places over the hips, (n, 3), to where the bent back has them, (p, n, 3)."""
        x, y, z = np.asarray(points, dtype=float).T
        ahead, up = np.cos(self.lean)[:, None], np.sin(self.lean)[:, None]
        bent = (self.hips[:, :1] + x * ahead + z * up, y + 0 * ahead, self.hips[:, 1:] + z * ahead - x * up)
        return np.stack(bent, axis=-1)

    def keep_upright(self, points: Sequence[Point] | Floats) -> Floats:
        """Bring places over the hips to where the neck has them, on which the head stays upright."""
        neck = np.array([[0.0, 0.0, _NECK]])
        return np.asarray(points) - neck + self.bend(neck)


_POSES = tuple(each.name for each in fields(_Poses))


def build_people(
    look: Look, poses: Sequence[Pose], detail: int, *, umbrella: bool = False
) -> list[list[Face]]:
    """Build somebody in several poses.

    Args:
        look: how he is built and dressed.
        poses: what he does.
        detail: level of detail.
        umbrella: the right hand holds one.

    Returns:
        Faces of each pose, metres.
    """
    packed = _Poses(*(
        np.array([getattr(pose, name) for pose in poses]) for name in _POSES
    ))  # fmt: skip
    if detail == _COARSEST:
        faces = _plain_person(look, packed)
    else:
        faces = _torso(look, packed, detail) + _head(look, packed, detail)
        for number in range(2):
            faces += _leg(look, packed, detail, number) + _arm(look, packed, detail, number)
        if look.bag and detail < _FAR:
            faces += _backpack(packed)
    if umbrella:
        faces += _umbrella(packed, detail)
    share = look.height / (TALL + _HEAD * (look.head - 1.0))
    return [[(share * corners[k], part) for corners, part in faces] for k in range(len(poses))]


def _torso(look: Look, poses: _Poses, detail: int) -> list[Face]:
    heights = (-0.1, -0.02, 0.16, 0.36, 0.475, 0.535, 0.62)
    spine = np.array([(-0.01 + 0.2 * max(0.0, z - 0.5), 0.0, z) for z in heights])
    radii = np.array(
        [(0.12, 0.1), (0.165, 0.12), (0.14, 0.1), (0.175, 0.118), (0.185, 0.095), (0.07, 0.06), (0.05, 0.05)]
    )
    radii[2:5, 0] *= look.broad
    if look.skirt:
        radii[2, 0] *= 0.92
    sides = _TORSO_SIDES[detail]
    kept = ([0, 1, 2, 3, 4, 5, 6], [0, 1, 3, 4, 5, 6], [1, 3, 4, 6])[detail]
    parts = np.full((len(kept) - 1, sides), look.top, dtype=np.uint8)
    if detail < _FAR:
        parts[0], parts[-1] = Part.LEGS, Part.SKIN
    faces = tube(poses.bend(spine[kept]), radii[kept], sides, parts)
    if look.skirt or look.coat:
        faces += _hem(look, poses, sides)
    return faces


_HEM = ((0.0, 0.255), (0.35, 0.245), (0.7, 0.235), (1.0, 0.222))
"""Half widths of a skirt or coat, by the share of the way from its lower edge to the hips."""
_LOOSE = 0.15
"""Metres from the legs' middles to the cloth before and behind them."""


def _hem(look: Look, poses: _Poses, sides: int) -> list[Face]:
    """Let skirt or coat fall from the hips over both knees: level rings, each around both legs."""
    limbs = [_bend_leg(poses, number) for number in range(2)]
    (x, z), low = poses.hips.T, np.max([knee[:, 2] for _, knee, _ in limbs], axis=0) - 0.06
    angles = (np.arange(sides) + 0.5) * 2 * pi / sides
    rings = []
    for share, wide in _HEM:
        level = low + share * (z - 0.1 - low)
        legs = np.array([_at_height(hip, knee, level) for hip, knee, _ in limbs] + [x] * (share == 1.0))
        back, front = legs.min(axis=0) - _LOOSE, legs.max(axis=0) + _LOOSE
        rings.append((0.5 * (back + front), level, 0.5 * (front - back), wide))
    rings.append((x, z + 0.08, np.full(len(x), 0.122), 0.175))
    corners = np.stack(
        [
            np.stack(
                [
                    middle[:, None] - deep[:, None] * np.sin(angles),
                    np.broadcast_to(wide * np.cos(angles), (len(x), sides)),
                    np.broadcast_to(level[:, None], (len(x), sides)),
                ],
                axis=-1,
            )
            for middle, level, deep, wide in rings
        ],
        axis=1,
    )
    return loft_rings(corners, look.top if look.coat else Part.LEGS)


def _at_height(hip: Floats, knee: Floats, level: Floats) -> Floats:
    """Find how far ahead a thigh is at a height; below the knee it counts as straight down."""
    share = np.clip((hip[:, 2] - level) / (hip[:, 2] - knee[:, 2]), 0.0, 1.0)
    ahead: Floats = hip[:, 0] + share * (knee[:, 0] - hip[:, 0])
    return ahead


def _head(look: Look, poses: _Poses, detail: int) -> list[Face]:
    """Build neck, face, and the hair behind and above it."""
    low, tall = 0.585, _HEAD * look.head
    rows = np.array(
        [(0.0, 0.036, 0.045, 0.035), (0.14, 0.06, 0.078, 0.022), (0.45, 0.077, 0.1, 0.01),
         (0.72, 0.077, 0.1, 0.005), (0.92, 0.052, 0.068, 0.0), (1.0, 0.015, 0.02, -0.005)]
    )  # fmt: skip
    if detail > 0:
        rows = rows[[1, 2, 3, 4]] if detail < _FAR else rows[[1, 3, 4]]
        rows[[0, -1], 0] = 0.0, 1.0
    shares, sides = rows[:, 0], _HEAD_SIDES[detail]
    over = Part.GEAR if look.helmet else Part.HAIR
    behind = np.sin((np.arange(sides) + 1.0) * 2 * pi / sides) > (0.0 if look.long_hair else 0.35)
    parts = np.full((len(rows) - 1, sides), look.face, dtype=np.uint8)
    parts[shares[1:] > 0.15] = np.where(behind, over, look.face)
    parts[shares[1:] > 0.75] = over
    spine = np.column_stack([rows[:, 3], np.zeros(len(rows)), low + tall * shares])
    swell = look.head * (1.2 if look.helmet else 1.0)
    faces = tube(poses.keep_upright(spine), swell * rows[:, 1:3], sides, parts)
    if look.long_hair and detail < _FAR:
        fall = [(-0.055, 0.0, 0.48), (-0.06, 0.0, 0.6), (-0.035, 0.0, low + 0.7 * tall)]
        radii = np.array([(0.085, 0.03), (0.088, 0.055), (0.082, 0.07)])
        faces += tube(poses.keep_upright(fall), radii, 5, Part.HAIR)
    return faces


def _join(start: Floats, end: Floats, lengths: tuple[float, float], towards: Point) -> list[Floats]:
    """Find start, knee or elbow, and end of a limb, (p, 3) each; a limb that is too short ends before it."""
    first, second = lengths
    way = end - start
    far = np.linalg.norm(way, axis=1, keepdims=True)
    way /= far
    reach = np.minimum(far, 0.999 * (first + second))
    along = (first**2 - second**2 + reach**2) / (2 * reach)
    aside = towards - (way @ np.array(towards))[:, None] * way
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    return [start, start + along * way + np.sqrt(first**2 - along**2) * aside, start + reach * way]


def _bend_leg(poses: _Poses, number: int) -> list[Floats]:
    """Find hip, knee and ankle."""
    (x, z), side = poses.hips.T, (1.0, -1.0)[number]
    hip = np.column_stack([x, np.full(len(x), side * _HIP), z - 0.02])
    return _join(hip, poses.ankles[:, number], (_THIGH, _SHANK), (1.0, 0.12 * side, 0.1))


def _line(*points: Floats) -> Floats:
    """Join points, (p, 3) each, to lines, (p, n, 3)."""
    return np.stack(points, axis=1)


def _leg(look: Look, poses: _Poses, detail: int, number: int) -> list[Face]:
    hip, knee, ankle = _bend_leg(poses, number)
    sides, part = _LEG_SIDES[detail], Part.SKIN if look.skirt else Part.LEGS
    thick = (0.085, 0.055, 0.05, 0.036) if look.skirt else (0.09, 0.062, 0.056, 0.046)
    ahead, up = np.cos(poses.tips[:, number]), np.sin(poses.tips[:, number])

    def sole(x: float, z: float) -> Floats:
        return ankle + np.column_stack([x * ahead - z * up, 0 * ahead, x * up + z * ahead])

    if detail == _FAR:
        return tube(_line(hip, knee, sole(0.0, -0.06)), [thick[0], thick[1], 1.5 * thick[3]], sides, part)
    if detail > 0:
        faces = tube(_line(hip, knee, ankle), [thick[0], thick[1], 1.1 * thick[3]], sides, part)
        return faces + tube(_line(sole(-0.08, -0.035), sole(0.18, -0.04)), [0.05, 0.04], 4, Part.TRIM)
    faces = tube(_line(hip, knee, 0.65 * knee + 0.35 * ankle, ankle), thick, sides, part)
    radii = np.array([(0.036, 0.05), (0.047, 0.045), (0.036, 0.022)])
    shoe = _line(sole(-0.085, -0.028), sole(0.04, -0.033), sole(0.19, -0.056))
    return faces + tube(shoe, radii, 6, Part.TRIM)


def _arm(look: Look, poses: _Poses, detail: int, number: int) -> list[Face]:
    side = (1.0, -1.0)[number]
    (shoulder,) = poses.bend([(-0.01, side * _SHOULDER * look.broad, _SHOULDERS - 0.045)]).transpose(1, 0, 2)
    limb = _join(shoulder, poses.hands[:, number], (_UPPER_ARM, _FOREARM), (-1.0, 0.25 * side, -0.5))
    _, elbow, wrist = limb
    sides, lower = _ARM_SIDES[detail], Part.SKIN if look.bare_arms else look.top
    if detail == _FAR:
        return tube(_line(shoulder, elbow), [0.052, 0.042], sides, look.top) + tube(
            _line(elbow, wrist), [0.042, 0.035], sides, lower
        )
    way = (wrist - elbow) / _FOREARM
    if detail > 0:
        faces = tube(_line(shoulder, elbow), [0.055, 0.043], sides, look.top)
        faces += tube(_line(elbow, wrist), [0.041, 0.031], sides, lower)
        return faces + tube(_line(wrist, wrist + 0.1 * way), [0.034, 0.034], sides, Part.SKIN)
    top = shoulder + 0.1 * (shoulder - elbow)
    faces = tube(_line(top, shoulder, elbow), [0.034, 0.055, 0.043], sides, look.top)
    faces += tube(_line(elbow + 0.03 * (shoulder - elbow), elbow, wrist), [0.036, 0.041, 0.031], sides, lower)
    hand = _line(wrist - 0.01 * way, wrist + 0.05 * way, wrist + 0.1 * way)
    return faces + tube(hand, [0.027, 0.04, 0.024], 5, Part.SKIN)


def _backpack(poses: _Poses) -> list[Face]:
    spine = poses.bend([(-0.17, 0.0, 0.1), (-0.19, 0.0, 0.2), (-0.18, 0.0, 0.4), (-0.15, 0.0, 0.46)])
    radii = np.array([(0.12, 0.05), (0.15, 0.085), (0.14, 0.075), (0.1, 0.04)])
    return tube(spine, radii, 6, Part.GEAR)


def _umbrella(poses: _Poses, detail: int) -> list[Face]:
    """Open an umbrella over the right hand; it is seen from above and from below."""
    hand = poses.hands[:, 1]
    sides = 8 if detail < _FAR else 5
    angles = np.arange(sides) * 2 * pi / sides
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])
    middle = hand[:, None] * [1.0, 1.0, 0.0] + [-0.1, 0.12, 0.0]
    outer, inner = middle + 0.54 * circle + [0.0, 0.0, 1.86], middle + 0.3 * circle + [0.0, 0.0, 2.06]
    tip = middle + np.array([0.0, 0.0, 2.12])

    def band(low: Floats, high: Floats) -> Floats:
        return np.stack([low, np.roll(low, -1, axis=1), np.roll(high, -1, axis=1), high], axis=2)

    above = [band(outer, inner), band(inner, np.broadcast_to(tip, inner.shape))[:, :, :3]]
    faces: list[Face] = [(each, Part.GEAR) for each in above]
    faces += [(each[:, :, ::-1] - [0.0, 0.0, 0.012], Part.GEAR) for each in above]
    if detail < _FAR:
        faces += tube(_line(hand - [0.0, 0.0, 0.04], tip[:, 0]), [0.012, 0.012], 4, Part.TRIM)
    return faces


def _plain_person(look: Look, poses: _Poses) -> list[Face]:
    """Build somebody of a dozen pixels: legs, torso and head."""
    hips = np.insert(poses.hips, 1, 0.0, axis=1)
    neck = poses.bend([(0.0, 0.0, 0.53)])[:, 0]
    feet = poses.ankles.mean(axis=1) * [1.0, 0.0, 1.0] - [0.0, 0.0, _ANKLE]
    spread = 0.5 * np.ptp(poses.ankles[..., 0], axis=1) + 0.08
    radii = np.array([[(0.12, each), (0.14, 0.1)] for each in spread])
    faces = tube(_line(feet, hips), radii, 4, Part.LEGS)
    faces += tube(_line(hips, neck), np.array([(0.2, 0.12), (0.25 * look.broad, 0.13)]), 4, look.top)
    over = Part.GEAR if look.helmet else Part.HAIR
    parts = np.array([(over, over, look.face, look.face), (over, over, over, over)], dtype=np.uint8)
    head = poses.keep_upright([(0.0, 0.0, 0.54), (0.0, 0.0, 0.7), (0.0, 0.0, 0.83)])
    return faces + tube(head, [0.09, 0.11, 0.06], 4, parts)
