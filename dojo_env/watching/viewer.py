"""An environment's render modes: `rgb_array` returns a picture, `human` serves a live page.

Who renders nothing loads nothing of it.
"""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import gymnasium

from dojo_env.watching.board import Board
from dojo_env.watching.views import Frame, Image

if TYPE_CHECKING:
    from dojo_env.watching.page import PageState
    from dojo_env.watching.server import LiveServer

Draw = Callable[[str | None], Frame]
"""Draws the present decision: all signals, or the cameras of the one that is named."""


class Viewer:
    """Shows one environment."""

    def __init__(self, mode: str | None, title: str, signals: tuple[str, ...], *, port: int = 0) -> None:
        """Take the render mode; `human` begins to serve its page, and says where.

        Raises:
            ConfigError: the port is taken.
        """
        self._mode, self._title = mode, title
        self._history: list[Board] = []
        self._page: PageState | None = None
        self._server: LiveServer | None = None
        if mode == "human":
            self._page, self._server = _serve(title, signals, port)
            print(f"watch at {self._server.url}", file=sys.stderr)  # noqa: T201 - the page has to be found

    def follow(self, draw: Draw, *, ended: bool = False) -> None:
        """Show a decision that has just been reached, where somebody looks on.

        Args:
            draw: draws the present decision; only called where a page is served.
            ended: whether the decision is the episode's last one.
        """
        if self._page is not None:
            frame = draw(self._page.signal)
            self._page.note(frame.board)
            self._page.publish(frame)
            if ended:
                self._page.end()

    def render(self, draw: Draw) -> Image | None:
        """Make the picture that `rgb_array` asks for.

        Args:
            draw: draws the present decision; only called with `rgb_array`.

        Returns:
            (h, w, 3) uint8 RGB, all signals and the figures; None in other modes, with a warning where no
            mode was chosen.
        """
        if self._mode is None:
            gymnasium.logger.warn('render() draws nothing without render_mode="rgb_array"')
        if self._mode != "rgb_array":
            return None
        from dojo_env.watching.poster import draw_poster

        frame = draw(None)
        if self._history and frame.board.time <= self._history[-1].time:
            self._history = [board for board in self._history if board.time < frame.board.time]
        self._history.append(frame.board)
        return draw_poster(frame, title=self._title, history=self._history[:-1])

    def close(self) -> None:
        """End the page; safe at any time."""
        server, self._server, self._page = self._server, None, None
        if server is not None:
            server.close()


def _serve(title: str, signals: tuple[str, ...], port: int) -> "tuple[PageState, LiveServer]":
    from dojo_env.watching.page import PageState
    from dojo_env.watching.server import LiveServer

    page = PageState(title, signals, None)
    return page, LiveServer(page, port=port)
