"""A film's frame with what was seen in it: boxes, lanes and their counts, and what a controller would do."""

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.films.places import Backdrop
from dojo_env.films.watching import Look

Image = NDArray[np.uint8]
_MOVING, _STANDING, _OTHER = (70, 220, 110), (255, 80, 70), (170, 170, 170)
_WHITE, _BACK = (240, 244, 248), (17, 22, 29)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_STRIP = 24
"""Pixels of a line below the picture."""


def draw_look(look: Look, backdrop: Backdrop) -> Image:
    """Draw what a look has told.

    Args:
        look: its frame stays as it is.
        backdrop: the lanes, for frames of this size.

    Returns:
        (h, w, 3) uint8 RGB, h and w even: the frame, and below it the time and a line for each signal.
    """
    picture = look.frame.picture
    drawn = np.where(backdrop.lines.any(axis=2, keepdims=True), picture // 2 + backdrop.lines // 2, picture)
    thick = max(1, round(picture.shape[1] / 900))
    for each in look.measured.seen:
        colour = _OTHER if not each.lane else _STANDING if each.is_halting else _MOVING
        left, top, right, bottom = (round(side) for side in each.box)
        cv2.rectangle(drawn, (left, top), (right, bottom), colour, thick)
        if each.number:
            _write(drawn, f"{each.number}", (left, top - 3), 0.4 * thick, colour)
    for lane, vehicles, halting, _ in look.measured.rows():
        if lane in backdrop.labels:
            u, v = backdrop.labels[lane]
            _write(drawn, f"{vehicles} / {halting}", (round(u), round(v)), 0.5 * thick, _WHITE)
    lines = [f"{look.frame.time:.1f} s   vehicles / standing"]
    lines += [f"{each.signal[:28]}: {each.describe()}" for each in look.advice]
    strip = np.full((_STRIP * len(lines), picture.shape[1], 3), _BACK, np.uint8)
    for number, line in enumerate(lines):
        _write(strip, line, (8, _STRIP * number + 17), 0.45, _WHITE)
    whole = np.vstack([drawn, strip])
    return np.ascontiguousarray(whole[: len(whole) // 2 * 2, : whole.shape[1] // 2 * 2])


def _write(
    picture: Image, words: str, at: tuple[int, int], size: float, colour: tuple[int, int, int]
) -> None:
    width = max(1, round(size * 2))
    cv2.putText(picture, words, at, _FONT, size, _BACK, width + 2, cv2.LINE_AA)
    cv2.putText(picture, words, at, _FONT, size, colour, width, cv2.LINE_AA)
