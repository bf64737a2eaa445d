"""Watching an episode: simulated or recorded seconds become frames of a live page or of a video."""

import sys
import webbrowser
from collections.abc import Iterable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.eyes import Eyes
from dojo_env.signals.plan import SignalPlan
from dojo_env.snapshot import Snapshot
from dojo_env.watching.board import Board, Scoreboard
from dojo_env.watching.pace import Pace
from dojo_env.watching.page import PageState
from dojo_env.watching.poster import draw_poster
from dojo_env.watching.server import LiveServer
from dojo_env.watching.video import Video
from dojo_env.watching.views import Frame, choose_cameras, draw_views
from dojo_env.world import World

Plans = Mapping[str, SignalPlan]


class LiveShow:
    """Shows seconds on a live page, at the pace that its buttons set."""

    def __init__(self, eyes: Eyes, plans: Plans, title: str, *, port: int = 0, browser: bool = True) -> None:
        """Open the page, and a browser on it if wanted.

        Raises:
            ConfigError: the port is taken.
        """
        self._eyes, self._scores = eyes, Scoreboard(plans)
        self._pace = Pace()
        self._last: tuple[Snapshot, Board] | None = None
        self._drawn = ""
        self.page = PageState(title, tuple(plans), self._pace)
        self._server = LiveServer(self.page, port=port)
        print(f"watch at {self._server.url} (Ctrl-C ends it)", file=sys.stderr)  # noqa: T201
        if browser:
            webbrowser.open(self._server.url)

    @property
    def url(self) -> str:
        """Where the page is."""
        return self._server.url

    def add(self, snapshot: Snapshot) -> None:
        """Show a second; returns when the next one's turn has come."""
        board = self._scores.note(snapshot)
        self.page.note(board)
        self._last, self._drawn = (snapshot, board), ""
        while not self._turn():
            pass

    def hold(self) -> None:
        """Say that the episode is over, and keep showing its last second until interrupted."""
        self.page.end()
        while True:
            self._pace.pause()
            self._turn()

    def _turn(self) -> bool:
        """Draw the present second where somebody waits for it, and wait for news or for the next one."""
        signal = self.page.signal
        if self._last is not None and self.page.is_asked and self._drawn != signal:
            snapshot, board = self._last
            views = draw_views(self._eyes, choose_cameras(self._eyes, (signal,)), snapshot)
            self._drawn = signal
            self.page.publish(Frame(board=board, views=views))
        return self._pace.wait()

    def close(self) -> None:
        """Close the page."""
        self._server.close()


class FilmShow:
    """Adds a picture per second to a video."""

    def __init__(self, eyes: Eyes, plans: Plans, title: str, video: Video) -> None:
        """Take where to draw and to write."""
        self._eyes, self._title, self._video = eyes, title, video
        self._plans, self._scores = plans, Scoreboard(plans)
        self._history: list[Board] = []

    def add(self, snapshot: Snapshot) -> None:
        """Add a second."""
        board = self._scores.note(snapshot)
        if self._history and board.time <= self._history[-1].time:
            self._history = []
        views = draw_views(self._eyes, choose_cameras(self._eyes, self._plans), snapshot)
        frame = Frame(board=board, views=views)
        self._video.add(draw_poster(frame, title=self._title, history=self._history))
        self._history.append(board)


def watch(controller: str, *, seed: int = 0, port: int = 0, browser: bool = True, **keywords: Any) -> None:
    """Show an episode live, until interrupted.

    Raises:
        ConfigError: the controller or a setting is unknown, or the port is taken.
        SimulationError: SUMO refuses the scenario.
    """
    acts = make_controller(controller)
    config = build_config(**{"show_links": True, **keywords, **acts.settings})
    title = f"{config.scenario.name}, {controller}, seed {seed}"
    with closing(World(config)) as world:
        show = LiveShow(world.eyes, world.map.plans, title, port=port, browser=browser)
        with closing(show):
            world.watch(show.add)
            acts.reset(seed)
            world.reset(seed)
            ended = False
            while not ended:
                _, _, ended, _ = world.step(acts.act(world.instant))
            show.hold()


def watch_snapshots(
    snapshots: Iterable[Snapshot],
    eyes: Eyes,
    plans: Plans,
    title: str,
    *,
    port: int = 0,
    browser: bool = True,
) -> None:
    """Show recorded seconds on a live page, until interrupted.

    Raises:
        ConfigError: the port is taken.
    """
    with closing(LiveShow(eyes, plans, title, port=port, browser=browser)) as show:
        for snapshot in snapshots:
            show.add(snapshot)
        show.hold()


def film_snapshots(
    snapshots: Iterable[Snapshot], eyes: Eyes, plans: Plans, title: str, path: Path | str
) -> None:
    """Write a video of recorded seconds.

    Raises:
        ConfigError: the path cannot be written.
        ToolMissingError: no codec for it is installed.
    """
    with Video(path) as video:
        show = FilmShow(eyes, plans, title, video)
        for snapshot in snapshots:
            show.add(snapshot)
