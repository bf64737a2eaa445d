"""What the live page shows: the last frame and the figures so far, shared between threads."""

import base64
import json
import threading
from dataclasses import asdict
from typing import Any

import cv2

from dojo_env.watching.board import Board
from dojo_env.watching.pace import SPEEDS, Pace
from dojo_env.watching.poster import format_clock
from dojo_env.watching.views import Frame, Image

_POINTS = 400
"""Points of a chart; of a longer episode every second, fourth or further one is kept."""
_QUALITY = 88


class PageState:
    """The last frame, until the next one comes; whoever asks waits for news."""

    def __init__(self, title: str, signals: tuple[str, ...], pace: Pace | None) -> None:
        """Take the page's title, the signals to choose from, and what its controls control, if anything."""
        self._title, self._signals, self._pace = title, signals, pace
        self._news = threading.Condition()
        self._version = 0
        self._frame: Frame | None = None
        self._encoded: tuple[Frame | None, list[dict[str, str]]] = (None, [])
        self._second = self._shown = 0
        self._history: list[tuple[float, int, float]] = []
        self._shown_history: list[tuple[float, int, float]] = []
        self._every = 1
        self._asked = self._ended = self._closed = False
        self.signal = signals[0]
        """Whose views are shown."""

    @property
    def is_asked(self) -> bool:
        """Whether somebody waits for a frame."""
        return self._asked

    def note(self, board: Board) -> None:
        """Take in the figures of the next instant; one that does not lie after the last begins an episode.

        Args:
            board: the figures; they go into the charts, and are shown with the next frame.
        """
        with self._news:
            if self._history and board.time <= self._history[-1][0]:
                self._history, self._every, self._second = [], 1, 0
            if self._second % self._every == 0:
                self._history.append((board.time, board.queue, board.waiting))
            if len(self._history) > _POINTS:
                self._history, self._every = self._history[::2], 2 * self._every
            self._second += 1
            self._ended = False

    def publish(self, frame: Frame) -> None:
        """Show a frame, with the charts so far, to all who wait for one.

        Args:
            frame: the views and the figures; its views are compressed when somebody fetches them.
        """
        with self._news:
            self._frame, self._asked = frame, False
            # At full speed the simulation is far ahead when the frame is fetched.
            self._shown, self._shown_history = self._second, list(self._history)
            self._tell()

    def end(self) -> None:
        """Say that the episode is over."""
        with self._news:
            self._ended = True
            self._tell()

    def close(self) -> None:
        """Let everyone who waits go."""
        with self._news:
            self._closed = True
            self._tell()

    def wait(self, version: int, seconds: float) -> bytes:
        """Wait for something newer than a version, and write it as JSON.

        Args:
            version: the last one that the asker has got; 0 for none.
            seconds: how long to wait at most; then the present version is written.

        Returns:
            An object in JSON: version, figures, charts, what the controls say, and the views as JPEG.
        """
        with self._news:
            if version >= self._version and not self._closed:
                self._ask()
                self._news.wait_for(lambda: self._version > version or self._closed, seconds)
            frame, shown = self._frame, self._describe()
        return json.dumps({**shown, "views": self._encode(frame)}).encode()

    def control(self, order: Any) -> None:
        """Do what the page's buttons say.

        Args:
            order: an object with an `action`: `pause`, `play` or `step`; `speed` with one of `SPEEDS` as
                `value`; or `signal` with the id of the one to show. It may be anything at all.

        Raises:
            ValueError: there is no such order, or the page has no controls.
            TypeError: the action is a list or an object.
        """
        action, value = (order.get("action"), order.get("value")) if isinstance(order, dict) else (None, None)
        if action == "signal" and value in self._signals:
            self.signal = str(value)
            with self._news:
                self._ask()
        elif self._pace is None:
            raise ValueError("this page only shows")
        elif action == "speed" and value in SPEEDS:
            self._pace.set_speed(value)
        elif action in {"pause", "play", "step"}:
            getattr(self._pace, action)()
        else:
            raise ValueError("no such order")
        with self._news:
            self._tell()

    def _ask(self) -> None:
        self._asked = True
        if self._pace is not None:
            self._pace.nudge()

    def _tell(self) -> None:
        self._version += 1
        self._news.notify_all()

    def _describe(self) -> dict[str, Any]:
        board = self._frame.board if self._frame else None
        return {
            "version": self._version,
            "title": self._title,
            "second": self._shown,
            "clock": format_clock(board.time) if board else "",
            "board": asdict(board) if board else None,
            "history": self._shown_history,
            "signal": self.signal,
            "controls": self._pace is not None,
            "paused": self._pace is not None and self._pace.paused,
            "speed": self._pace.speed if self._pace else None,
            "ended": self._ended,
            "closed": self._closed,
        }

    def _encode(self, frame: Frame | None) -> list[dict[str, str]]:
        """Compress the views, once per frame, on the thread of who asks."""
        last, encoded = self._encoded
        if frame is not last and frame is not None:
            encoded = [{"name": name, "jpeg": _jpeg(view)} for name, view in frame.views.items()]
            self._encoded = (frame, encoded)
        return encoded


def _jpeg(view: Image) -> str:
    _, data = cv2.imencode(".jpg", view[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return base64.b64encode(data.tobytes()).decode("ascii")
