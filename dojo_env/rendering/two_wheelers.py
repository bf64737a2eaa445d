"""Bicycles, motorcycles and scooters with their riders, wheelchairs, and prams.

Lengths are metres, x points ahead, y to the left, z up; the middle between the axles is over the origin.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.people import Look, Pose, build_people
from dojo_env.rendering.shapes import Face, Part, box, disc, loft, mirrored, moved, ring, section, tube

Floats = NDArray[np.float64]
Point = tuple[float, float, float]

_FAR, _COARSEST = 2, 3
"""Levels of detail with fewer parts."""
_WHEEL_SIDES = (14, 10, 8, 6)
"""By level of detail."""
_CRANK, _CRANK_REACH = (-0.07, 0.29), 0.17
"""The bottom bracket of a bicycle, x and z, and the length of its cranks."""


def _rod(points: Sequence[Point], radius: float, part: Part, sides: int = 3) -> list[Face]:
    return tube(np.array(points), np.full(len(points), radius), sides, part)


def _spokes(middle: Point, radius: float, count: int) -> list[Face]:
    """Cross a wheel with a few flat spokes that stand for many."""
    faces: list[Face] = []
    for angle in np.arange(count) * pi / count:
        way = radius * np.array([cos(angle), 0.0, sin(angle)])
        aside = 0.007 * np.array([-sin(angle), 0.0, cos(angle)])
        blade = np.array([way - aside, way + aside, aside - way, -aside - way]) + middle
        faces += [(blade, Part.CHROME), (blade[::-1], Part.CHROME)]
    return faces


def _spoked_wheel(x: float, radius: float, detail: int, *, y: float = 0.0) -> list[Face]:
    """Build a thin tyre with a bright rim and spokes."""
    middle, sides = (x, y, radius), _WHEEL_SIDES[detail]
    if detail == _COARSEST:
        return _full_wheel(x, radius, 0.03, detail, y=y)
    # From further away tyres are drawn thicker, or pixels would miss them.
    inner = (0.92, 0.87, 0.8)[detail] * radius
    if detail == _FAR:
        return ring(middle, (inner, radius), 0.03, sides, Part.TYRE)
    faces = ring(middle, (inner, radius), 0.022, sides, Part.TYRE)
    faces += _rod([(x, y - 0.05, radius), (x, y + 0.05, radius)], 0.025, Part.CHROME, 5)
    if detail == 0:
        faces += ring(middle, (0.87 * radius, 0.92 * radius), 0.008, sides, Part.CHROME)[:2]
        faces += _spokes(middle, 0.88 * radius, 4)
    return faces


def _full_wheel(x: float, radius: float, half: float, detail: int, *, y: float = 0.0) -> list[Face]:
    """Build a wheel with a disc: tyre, rim and hub."""
    middle, sides = (x, y, radius), _WHEEL_SIDES[detail]
    if detail >= _FAR:
        tread = ring(middle, (0.0, radius), half, sides, Part.TYRE)[2:3]
        return disc(middle, radius, half, sides, Part.TYRE) + tread
    faces = ring(middle, (0.62 * radius, radius), half, sides, Part.TYRE)
    faces += disc(middle, 0.63 * radius, 0.5 * half, sides, Part.CHROME)
    return faces + disc(middle, 0.3 * radius, 0.62 * half, 6, Part.TRIM)


def build_cyclists(look: Look, turns: Sequence[float], detail: int) -> list[list[Face]]:
    """Build a bicycle and its rider in several poses: first at a stop, with a foot on the ground.

    Args:
        look: the rider.
        turns: of the crank, shares of a turn.
        detail: level of detail.

    Returns:
        Faces of each pose.
    """
    riding = [_riding(turn) for turn in turns]
    waiting = replace(
        riding[0], hips=(-0.14, 0.93), ankles=(riding[0].ankles[0], (0.05, -0.28, 0.08)), tips=(-0.15, 0.0)
    )
    people = build_people(look, [waiting, *riding], detail)
    bicycle = _bicycle(detail)
    cranks = [_cranks(turn) if detail < _FAR else [] for turn in (turns[0], *turns)]
    return [person + bicycle + crank for person, crank in zip(people, cranks, strict=True)]


def _riding(turn: float) -> Pose:
    feet = []
    for side, part in ((0.12, turn), (-0.12, turn + 0.5)):
        x, z = _pedal(part)
        feet.append((x - 0.07, side, z + 0.1))
    return Pose(
        hips=(-0.2, 1.0),
        lean=0.5,
        ankles=(feet[0], feet[1]),
        tips=(-0.15, -0.15),
        hands=((0.36, 0.25, 1.1), (0.36, -0.25, 1.1)),
    )


def _pedal(turn: float) -> tuple[float, float]:
    angle = 2 * pi * turn
    return _CRANK[0] + _CRANK_REACH * cos(angle), _CRANK[1] - _CRANK_REACH * sin(angle)


def _cranks(turn: float) -> list[Face]:
    faces: list[Face] = []
    for side, part in ((1.0, turn), (-1.0, turn + 0.5)):
        x, z = _pedal(part)
        faces += _rod([(_CRANK[0], 0.06 * side, _CRANK[1]), (x, 0.07 * side, z)], 0.014, Part.TRIM, 3)
        faces += moved(box(x + 0.05, x - 0.05, 0.045, z - 0.012, z + 0.012, Part.TRIM), 0.12 * side)
    return faces


def _bicycle(detail: int) -> list[Face]:
    radius, rear, front = 0.34, -0.53, 0.53
    axle, bracket, saddle = (rear, 0.0, radius), (_CRANK[0], 0.0, _CRANK[1]), (-0.23, 0.0, 0.9)
    head, crown, hub = (0.31, 0.0, 0.93), (0.36, 0.0, 0.72), (front, 0.0, radius)
    thick = 0.018 if detail == 0 else 0.024
    faces = _spoked_wheel(rear, radius, detail) + _spoked_wheel(front, radius, detail)
    if detail == _COARSEST:
        return faces + box(0.36, -0.3, 0.03, 0.45, 0.8, Part.GEAR)
    for line in (
        (bracket, saddle),
        (bracket, crown),
        ((-0.19, 0.0, 0.8), (0.33, 0.0, 0.86)),
        (axle, bracket),
    ):
        faces += _rod(line, thick, Part.GEAR)
    faces += _rod((head, crown, hub), thick, Part.GEAR) + _rod(
        (axle, (-0.2, 0.0, 0.83)), 0.7 * thick, Part.GEAR
    )
    faces += box(-0.08, -0.36, 0.07, 0.92, 0.97, Part.TRIM)
    bar = [(0.3, 0.28, 1.04), (0.36, 0.1, 1.05), (0.36, -0.1, 1.05), (0.3, -0.28, 1.04)]
    faces += _rod(bar, thick, Part.TRIM) + _rod((head, (0.34, 0.0, 1.05)), thick, Part.TRIM)
    if detail < _FAR:
        ring_gear = disc((_CRANK[0], -0.05, _CRANK[1]), 0.09, 0.01, 8, Part.TRIM)
        lamp = box(0.45, 0.4, 0.03, 0.88, 0.94, Part.HEADLAMP)
        guard = [(rear - 0.3, 0.0, radius + 0.2), (rear - 0.05, 0.0, 2 * radius + 0.03),
                 (rear + 0.2, 0.0, 2 * radius - 0.03)]  # fmt: skip
        faces += ring_gear + lamp + tube(np.array(guard), np.array([(0.03, 0.01)] * 3), 4, Part.TRIM)
        faces += box(rear - 0.28, rear - 0.31, 0.025, radius + 0.24, radius + 0.3, Part.BRAKE)
    return faces


def build_motorcyclist(look: Look, detail: int) -> list[Face]:
    """Build a motorcycle and its rider.

    Args:
        look: the rider.
        detail: level of detail, 0 (finest) to 3.

    Returns:
        Faces of both, metres.
    """
    pose = Pose(
        hips=(-0.25, 0.9),
        lean=0.45,
        ankles=((-0.1, 0.21, 0.4), (-0.1, -0.21, 0.4)),
        hands=((0.34, 0.34, 1.03), (0.34, -0.34, 1.03)),
    )
    (faces,) = build_people(look, [pose], detail)
    radius, front, rear = 0.31, 0.71, -0.68
    for x, half in ((front, 0.065), (rear, 0.085)):
        faces += _full_wheel(x, radius, half, detail)
    tank = [section(0.32, 0.1, 0.72, 0.94), section(0.2, 0.16, 0.68, 1.0), section(-0.12, 0.13, 0.68, 0.9)]
    tail = [section(-0.1, 0.12, 0.7, 0.84), section(-0.5, 0.13, 0.72, 0.86), section(-0.88, 0.08, 0.8, 0.9)]
    faces += loft(tank, Part.BODY) + loft(tail, Part.BODY)
    faces += box(0.22, -0.25, 0.17, 0.22, 0.66, Part.TRIM)
    if detail == _COARSEST:
        return faces
    faces += box(-0.12, -0.62, 0.125, 0.845, 0.895, Part.TRIM)
    for side in (1.0, -1.0):
        faces += _rod([(0.34, 0.1 * side, 0.98), (front, 0.1 * side, radius)], 0.028, Part.CHROME)
        faces += _rod([(-0.15, 0.1 * side, 0.4), (rear, 0.1 * side, radius)], 0.03, Part.TRIM)
    bar = [(0.26, 0.4, 1.02), (0.36, 0.15, 1.02), (0.36, -0.15, 1.02), (0.26, -0.4, 1.02)]
    faces += _rod(bar, 0.022, Part.TRIM)
    if detail == _FAR:
        faces += box(0.47, 0.34, 0.1, 0.82, 0.98, Part.HEADLAMP)
        return faces + box(-0.88, -0.92, 0.08, 0.78, 0.88, Part.BRAKE)
    lamp = np.array([(0.36, 0.0, 0.91), (0.42, 0.0, 0.91), (0.47, 0.0, 0.905)])
    faces += tube(lamp, [0.07, 0.105, 0.1], 8, Part.TRIM)
    angles = np.arange(8) * pi / 4
    glass = np.column_stack([np.full(8, 0.482), 0.085 * np.cos(angles), 0.905 + 0.085 * np.sin(angles)])
    faces += [(glass, Part.HEADLAMP)]
    screen = np.array([(0.4, -0.14, 1.0), (0.4, 0.14, 1.0), (0.3, 0.1, 1.2), (0.3, -0.1, 1.2)])
    faces += [(screen, Part.GLASS), (screen[::-1], Part.GLASS)]
    guard = np.array([(front + 0.3, 0.0, radius + 0.15), (front, 0.0, 2 * radius + 0.03),
                      (front - 0.25, 0.0, radius + 0.23)])  # fmt: skip
    faces += tube(guard, np.array([(0.075, 0.012)] * 3), 4, Part.BODY)
    faces += box(-0.86, -0.9, 0.08, 0.81, 0.88, Part.BRAKE) + box(-0.9, -0.93, 0.1, 0.56, 0.7, Part.WHITE)
    exhaust = [(0.15, -0.16, 0.3), (-0.3, -0.19, 0.28), (-0.8, -0.22, 0.42)]
    faces += tube(np.array(exhaust), [0.03, 0.05, 0.06], 6, Part.CHROME)
    for part, y in ((Part.LEFT, 0.17), (Part.RIGHT, -0.17)):
        faces += moved(
            box(0.4, 0.34, 0.035, 0.86, 0.92, part) + box(-0.82, -0.88, 0.035, 0.76, 0.82, part), y
        )
    return faces


def build_moped_rider(look: Look, detail: int) -> list[Face]:
    """Build somebody who sits on a motor scooter, feet on its floor.

    Args:
        look: the rider.
        detail: level of detail, 0 (finest) to 3.

    Returns:
        Faces of both, metres.
    """
    pose = Pose(
        hips=(-0.3, 0.83),
        lean=0.12,
        ankles=((0.2, 0.13, 0.4), (0.2, -0.13, 0.4)),
        hands=((0.36, 0.3, 1.0), (0.36, -0.3, 1.0)),
    )
    (faces,) = build_people(look, [pose], detail)
    for x in (0.64, -0.62):
        faces += _full_wheel(x, 0.24, 0.06, detail)
    tail = [section(-0.12, 0.15, 0.3, 0.66), section(-0.2, 0.2, 0.28, 0.72), section(-0.75, 0.2, 0.34, 0.74),
            section(-0.92, 0.1, 0.5, 0.7)]  # fmt: skip
    shield = [section(0.5, 0.12, 0.36, 0.9), section(0.42, 0.2, 0.32, 0.94), section(0.34, 0.2, 0.3, 0.92)]
    faces += loft(tail, Part.BODY) + loft(shield, Part.BODY)
    faces += box(0.42, -0.2, 0.17, 0.26, 0.32, Part.TRIM) + box(-0.14, -0.78, 0.15, 0.72, 0.8, Part.TRIM)
    if detail == _COARSEST:
        return faces
    faces += _rod([(0.4, 0.0, 0.9), (0.34, 0.0, 1.02)], 0.05, Part.BODY, 4)
    faces += _rod(
        [(0.32, 0.33, 1.0), (0.36, 0.12, 1.03), (0.36, -0.12, 1.03), (0.32, -0.33, 1.0)], 0.022, Part.TRIM
    )
    faces += box(0.53, 0.48, 0.07, 0.72, 0.84, Part.HEADLAMP) + box(-0.9, -0.94, 0.07, 0.58, 0.66, Part.BRAKE)
    if detail == _FAR:
        return faces
    guard = np.array([(0.86, 0.0, 0.36), (0.64, 0.0, 0.53), (0.42, 0.0, 0.46)])
    faces += tube(guard, np.array([(0.075, 0.015)] * 3), 4, Part.BODY)
    faces += box(-0.94, -0.96, 0.09, 0.4, 0.52, Part.WHITE)
    for part, y in ((Part.LEFT, 0.14), (Part.RIGHT, -0.14)):
        faces += moved(box(0.5, 0.44, 0.03, 0.78, 0.84, part) + box(-0.86, -0.91, 0.03, 0.6, 0.66, part), y)
        faces += moved(
            _rod([(0.36, 0.0, 1.03), (0.38, 0.06, 1.16)], 0.01, Part.TRIM)
            + box(0.4, 0.37, 0.05, 1.14, 1.24, Part.TRIM), 1.6 * y
        )  # fmt: skip
    return faces


def build_scooter_rider(look: Look, detail: int) -> list[Face]:
    """Build somebody who stands on an electric scooter.

    Args:
        look: the rider.
        detail: level of detail, 0 (finest) to 3.

    Returns:
        Faces of both, metres.
    """
    pose = Pose(
        hips=(-0.1, 1.07),
        lean=0.06,
        ankles=((0.02, 0.05, 0.26), (-0.24, -0.05, 0.26)),
        hands=((0.3, 0.22, 1.16), (0.3, -0.22, 1.16)),
    )
    (faces,) = build_people(look, [pose], detail)
    for x in (0.45, -0.45):
        faces += _full_wheel(x, 0.12, 0.03, detail)
    faces += box(0.26, -0.4, 0.075, 0.12, 0.18, Part.TRIM)
    faces += _rod([(0.26, 0.0, 0.15), (0.4, 0.0, 0.28), (0.3, 0.0, 1.16)], 0.028, Part.GEAR)
    if detail < _COARSEST:
        faces += _rod([(0.4, 0.0, 0.3), (0.46, 0.0, 0.12)], 0.03, Part.TRIM)
        faces += _rod([(0.28, 0.25, 1.15), (0.28, -0.25, 1.15)], 0.018, Part.TRIM)
    if detail < _FAR:
        faces += box(0.4, 0.36, 0.03, 1.02, 1.08, Part.HEADLAMP) + box(
            -0.52, -0.55, 0.03, 0.2, 0.25, Part.BRAKE
        )
    return faces


def build_wheelchair(look: Look, detail: int) -> list[Face]:
    """Build somebody in a wheelchair.

    Args:
        look: who sits in it.
        detail: level of detail, 0 (finest) to 3.

    Returns:
        Faces of both, metres.
    """
    pose = Pose(
        hips=(-0.12, 0.6),
        lean=0.03,
        ankles=((0.42, 0.09, 0.2), (0.42, -0.09, 0.2)),
        hands=((0.1, 0.3, 0.66), (0.1, -0.3, 0.66)),
    )
    (faces,) = build_people(look, [pose], detail)
    wheel = _spoked_wheel(-0.12, 0.3, detail, y=0.31)
    if detail < _FAR:
        wheel += moved(
            _rod([(-0.26, 0.0, 0.95), (-0.22, 0.0, 0.3), (0.34, 0.0, 0.32)], 0.016, Part.CHROME), 0.25
        )
        wheel += _full_wheel(0.3, 0.08, 0.02, _FAR, y=0.24)
        wheel += moved(box(0.18, -0.22, 0.025, 0.7, 0.73, Part.TRIM), 0.27)
    faces += mirrored(wheel)
    faces += box(0.22, -0.28, 0.25, 0.42, 0.5, Part.TRIM) + box(-0.25, -0.3, 0.23, 0.5, 1.0, Part.GEAR)
    return faces + box(0.56, 0.38, 0.16, 0.08, 0.11, Part.TRIM)


def build_pram(detail: int) -> list[Face]:
    """Build a pram that somebody pushes whose hips are over the origin.

    Args:
        detail: level of detail, 0 (finest) to 3.

    Returns:
        Its faces, metres; who pushes it is no part of them.
    """
    cot = [section(1.25, 0.16, 0.62, 0.78), section(1.15, 0.21, 0.5, 0.82), section(0.62, 0.21, 0.5, 0.82),
           section(0.52, 0.17, 0.6, 0.8)]  # fmt: skip
    faces = loft(cot, Part.GEAR)
    if detail == _COARSEST:
        return faces + box(1.15, 0.6, 0.2, 0.05, 0.45, Part.TRIM)
    hood = [section(1.2, 0.2, 0.76, 0.84), section(1.14, 0.22, 0.76, 1.0), section(1.0, 0.22, 0.76, 1.1),
            section(0.86, 0.22, 0.76, 1.08)]  # fmt: skip
    faces += loft(hood, Part.GEAR)
    wheel = _full_wheel(1.12, 0.13, 0.025, detail, y=0.24)
    wheel += _full_wheel(0.62, 0.16, 0.025, detail, y=0.24)
    if detail < _FAR:
        wheel += moved(_rod([(1.12, 0.0, 0.13), (0.72, 0.0, 0.5), (0.3, 0.0, 1.02)], 0.014, Part.CHROME), 0.2)
        wheel += moved(_rod([(0.62, 0.0, 0.16), (1.0, 0.0, 0.5)], 0.014, Part.CHROME), 0.2)
        faces += _rod([(0.3, 0.2, 1.02), (0.3, -0.2, 1.02)], 0.018, Part.TRIM)
    return faces + mirrored(wheel)
