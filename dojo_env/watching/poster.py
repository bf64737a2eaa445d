"""All views and the figures of an instant as one picture: what `render` returns and videos show."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from dojo_env.watching.board import Board, Lamp
from dojo_env.watching.views import Frame, Image
from dojo_maps.wording import counted

_GAP, _HEAD, _FOOT = 8, 46, 84
_BACK, _CARD, _LINE = (17, 22, 29), (26, 33, 43), (52, 62, 76)
_WHITE, _GREY = (236, 240, 245), (140, 152, 168)
_COLOURS = {"queue": (88, 166, 255), "waiting": (240, 160, 75)}
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_LAMPS = {
    "G": (46, 204, 113), "g": (33, 145, 80), "y": (241, 196, 15), "Y": (241, 196, 15),
    "u": (230, 126, 34), "o": (160, 130, 20), "O": (90, 98, 110),
}  # fmt: skip
_RED = (208, 60, 52)
_MIN_WIDTH = 720
_POINTS = 300
"""Instants that a chart shows."""


def draw_poster(frame: Frame, *, title: str, history: Sequence[Board] = ()) -> Image:
    """Lay out the views under a headline and above the figures.

    Args:
        frame: views of any sizes; a first one that is taller than the others stands beside them.
        title: of the headline.
        history: earlier boards of the episode, for charts.

    Returns:
        (h, w, 3) uint8 RGB, h and w even; the same size for the same cameras.
    """
    tiles, (height, width) = _place(frame)
    width = max(width, _MIN_WIDTH)
    poster = np.empty((_HEAD + height + _FOOT, width, 3), dtype=np.uint8)
    poster[:] = _BACK
    for name, (row, column) in tiles.items():
        view = frame.views[name]
        top, left = _HEAD + row, column
        poster[top : top + view.shape[0], left : left + view.shape[1]] = view
        shown = [lamp for lamp in frame.board.lamps if lamp.signal == name]
        _label(poster, (left, top), [name, *(f"{_words(lamp)}, queue {lamp.queue}" for lamp in shown)])
    _write_head(poster, frame.board, title)
    _write_foot(poster, frame.board, [*history[-_POINTS:], frame.board], _HEAD + height)
    return np.ascontiguousarray(poster[: len(poster) // 2 * 2, : width // 2 * 2])


def _place(frame: Frame) -> tuple[dict[str, tuple[int, int]], tuple[int, int]]:
    """Find each view's upper left corner: a large first one, the others in rows beside it.

    Returns:
        (row, column) by name, and the height and width of all together, pixels.
    """
    (main, first), *rest = frame.views.items()
    is_large = bool(rest) and first.shape[0] > max(view.shape[0] for _, view in rest)
    names = [name for name, _ in rest] if is_large else list(frame.views)
    small = np.max([frame.views[name].shape[:2] for name in names], axis=0).tolist()
    start = first.shape[1] + 2 * _GAP if is_large else _GAP
    rows = 2 if is_large else max(1, math.isqrt(len(names)))
    columns = math.ceil(len(names) / rows)
    places = {
        name: ((k // columns) * (small[0] + _GAP), start + (k % columns) * (small[1] + _GAP))
        for k, name in enumerate(names)
    }
    height = max(rows * (small[0] + _GAP), first.shape[0] + _GAP)
    if is_large:
        places[main] = ((height - _GAP - first.shape[0]) // 2, _GAP)
    return places, (height, start + columns * (small[1] + _GAP))


def _write_head(poster: Image, board: Board, title: str) -> None:
    _write(poster, title, (_GAP + 4, 30), 0.62, _WHITE)
    right = poster.shape[1] - _GAP - 4
    clock = format_clock(board.time)
    left = right - _width(clock, 0.62)
    _write(poster, clock, (left, 30), 0.62, _WHITE)
    if len(board.lamps) == 1:
        lamp = board.lamps[0]
        words = _words(lamp)
        left -= _width(words, 0.5) + 28
        _write(poster, words, (left, 29), 0.5, _GREY)
        _draw_lamps(poster, lamp, left - 16, _GAP + _width(title, 0.62) + 24)


def _words(lamp: Lamp) -> str:
    if lamp.phase is None:
        return f"changing, {counted(lamp.phases, 'phase')}"
    return f"phase {lamp.phase + 1} of {lamp.phases}, green {lamp.green_time:.0f} s"


def _draw_lamps(poster: Image, lamp: Lamp, right: int, least: int) -> None:
    """Draw a square per link, as far as there is room."""
    pitch = 13
    left = right - pitch * len(lamp.state)
    if left < least:
        return
    for k, letter in enumerate(lamp.state):
        corner = (left + k * pitch, 19)
        cv2.rectangle(poster, corner, (corner[0] + 9, corner[1] + 9), _LAMPS.get(letter, _RED), -1)


def _write_foot(poster: Image, board: Board, history: Sequence[Board], top: int) -> None:
    width = poster.shape[1] - 2 * _GAP
    figures = (
        ("queue", f"{board.queue}"),
        ("waiting", f"{board.waiting:,.0f} s"),
        ("vehicles", f"{board.vehicles}"),
        ("arrived", f"{board.arrived}"),
        ("speed", f"{board.speed:.1f} m/s"),
    )
    card = min(118, (width - 2 * 110) // len(figures))
    for k, (name, value) in enumerate(figures):
        left = _GAP + k * card
        _draw_card(poster, left, top, card - _GAP)
        _write(poster, name, (left + 10, top + 24), 0.42, _GREY)
        _write(poster, value, (left + 10, top + 54), 0.62, _WHITE)
    left = _GAP + len(figures) * card
    half = (poster.shape[1] - _GAP - left - _GAP) // 2
    for k, name in enumerate(("queue", "waiting")):
        _draw_chart(poster, (left + k * (half + _GAP), top, half), name, history)


def _draw_chart(poster: Image, place: tuple[int, int, int], name: str, history: Sequence[Board]) -> None:
    """Draw a line of a figure's last values on a card at (left, top, width)."""
    left, top, width = place
    _draw_card(poster, left, top, width)
    values = np.array([getattr(board, name) for board in history], dtype=np.float64)
    highest = max(float(values.max()), 1.0)
    x = left + 6 + np.linspace(0, width - 12, _POINTS + 1)[: len(values)]
    y = top + _FOOT - _GAP - 6 - values / highest * (_FOOT - _GAP - 30)
    line = np.rint(np.column_stack([x, y]) * 16).astype(np.int32)
    cv2.polylines(poster, [line], False, _COLOURS[name], 1, cv2.LINE_AA, 4)
    _write(poster, f"{name}, at most {highest:,.0f}", (left + 8, top + 17), 0.38, _GREY)


def _draw_card(poster: Image, left: int, top: int, width: int) -> None:
    corner = (left + width - 1, top + _FOOT - _GAP - 1)
    cv2.rectangle(poster, (left, top), corner, _CARD, -1)
    cv2.rectangle(poster, (left, top), corner, _LINE, 1)


def _label(poster: Image, at: tuple[int, int], lines: Sequence[str]) -> None:
    """Write a view's name on a dark strip in its corner, and what is to be said of it below."""
    left, top = at
    width = max(_width(line, 0.42) for line in lines) + 14
    strip = poster[top : top + 4 + 18 * len(lines), left : left + width]
    strip[:] = (strip * 0.35 + np.array(_BACK) * 0.65).astype(np.uint8)
    for k, line in enumerate(lines):
        _write(poster, line, (left + 7, top + 15 + 18 * k), 0.42, _WHITE)


def _write(poster: Image, text: str, at: tuple[int, int], size: float, colour: tuple[int, ...]) -> None:
    cv2.putText(poster, _plain(text), at, _FONT, size, colour, 1, cv2.LINE_AA)


def _width(text: str, size: float) -> int:
    (width, _), _ = cv2.getTextSize(_plain(text), _FONT, size, 1)
    return int(width)


def _plain(text: str) -> str:
    """Leave out what OpenCV's font does not have."""
    return text.encode("ascii", "replace").decode("ascii")


def format_clock(time: float) -> str:
    """Write simulated seconds as hours, minutes and seconds.

    Args:
        time: simulated seconds, not negative; a part of a second is left out.

    Returns:
        Such as 07:05:09; hours go on after 23.
    """
    minutes, seconds = divmod(int(time), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:02d}:{minutes:02d}:{seconds:02d}"
